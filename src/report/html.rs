//! The page of a run: verdict, table, drawings and settings.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{
    InformationMap, RunRecord, ScoreColumn, by_scene, certificate_in_words, convergence_svg,
    methods_in_words, optional, placement_svg, spread_in_words, verdict,
};
use crate::search::{GenerationRecord, Scored};
use crate::vehicle::Constraints;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;color:#1b2a3a;max-width:64rem;\
margin:2rem auto;padding:0 1rem}h1{margin:0}table{border-collapse:collapse;margin:1rem 0;\
font-size:.9rem;font-variant-numeric:tabular-nums}th,td{padding:.25rem .5rem;text-align:right;\
border-bottom:1px solid #dde4ea;white-space:nowrap}th{white-space:normal;vertical-align:bottom}\
th:first-child,td:first-child{text-align:left}tr.best{background:#fbecee;font-weight:600}\
.guard{color:#a32638;text-align:left;white-space:normal}svg{max-width:100%;height:auto}\
.wide{overflow-x:auto}dl{display:grid;grid-template-columns:max-content 1fr;gap:.1rem 1rem}\
dt{color:#5a6b7b}dd{margin:0}@media print{body{font-size:12px;max-width:none;margin:0;padding:0}\
.wide{overflow:visible}th,td{padding:.1rem .3rem}h2{break-after:avoid}svg,tr{break-inside:avoid}}";

/// The drawings of a run, as SVG.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// Objective against evaluations.
    pub convergence: String,
    /// The placement on the vehicle; `None` without a result.
    pub placement: Option<String>,
    /// Information gained, seen from above, with the name of each scene; empty without a result.
    pub maps: Vec<(String, String)>,
}

impl Figures {
    /// Draws a run; `body` holds the ego body's triangles in the ego frame, `maps` what the result gains in
    /// each scene, by name.
    pub fn new(
        run: &RunRecord,
        history: &[GenerationRecord],
        constraints: &Constraints,
        body: &[[[f32; 3]; 3]],
        maps: &[(String, InformationMap)],
    ) -> Self {
        let best = run.best.as_ref();
        Self {
            convergence: convergence_svg(history, &run.objective, &run.baselines, best),
            placement: best.map(|best| placement_svg(best, constraints, body)),
            maps: best.map_or_else(Vec::new, |best| {
                let svg = |map: &InformationMap| map.svg(&best.placement);
                maps.iter().map(|(scene, map)| (scene.clone(), svg(map))).collect()
            }),
        }
    }
}

/// The page of a run: verdict, table, charts and settings; it opens offline and loads nothing.
pub fn report_html(run: &RunRecord, figures: &Figures) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "sightline: " (run.scene) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (run.scene) }
                p { (verdict(run.best.as_ref(), &run.baselines, &run.objective)) }
                @if let Some(words) = spread_in_words(run) { p { (words) } }
                @if let Some(phases) = &run.phases { p { (phases.words) } }
                (scores(run))
                (scenes(run))
                @if let Some(best) = &run.best {
                    (placement(best, figures, &run.active_bounds))
                }
                @if !figures.maps.is_empty() {
                    h2 { "What it sees" }
                    p {
                        "Information of each column of voxels, from above: red where the beams gain it, \
                         grey where it stays unseen."
                    }
                    @for (scene, map) in &figures.maps {
                        @if figures.maps.len() > 1 { h3 { (scene) } }
                        (PreEscaped(map))
                    }
                }
                (findings(run))
                h2 { "The search" }
                (PreEscaped(&figures.convergence))
                (search(run))
                (facts(run))
            }
        }
    };
    page.into_string()
}

/// The result and the baselines, a row each, with the guards and broken rules below.
fn scores(run: &RunRecord) -> Markup {
    let columns = ScoreColumn::ALL;
    let rows =
        run.best.iter().map(|best| (best, true)).chain(run.baselines.iter().map(|b| (b, false)));
    html! {
        div.wide {
            table {
                tr {
                    @for column in columns { th { (column.title()) } }
                    th { "objective" }
                }
                @for (scored, is_best) in rows {
                    tr.best[is_best] {
                        @for column in columns { td { (column.cell(&scored.scores)) } }
                        td { (scored.objective.map_or("–".into(), |v| format!("{v:.4e}"))) }
                    }
                    @for reason in reasons(scored) {
                        tr { td.guard colspan=(columns.len() + 1) { (reason) } }
                    }
                }
            }
        }
        p {
            "Scores are means over frames; larger is better. The gain is ΣH over covered voxels, in nats: \
             the more of what changes in the scene the beams reach, the larger it is. M-SOG is its negative \
             mean, −(1/N)·ΣH, and can be raised by looking at what never changes. Red lines are guards: \
             reasons not to believe a row."
        }
    }
}

/// Gains in each of several scenes.
fn scenes(run: &RunRecord) -> Markup {
    let rows = by_scene(run).unwrap_or_default();
    html! {
        @if let Some((titles, rows)) = rows.split_first() {
            h2 { "Scene by scene" }
            div.wide {
                table {
                    tr { @for title in titles { th { (title) } } }
                    @for (index, row) in rows.iter().enumerate() {
                        tr.best[index == 0 && run.best.is_some()] { @for cell in row { td { (cell) } } }
                    }
                }
            }
            p {
                "Share of each scene's information. Over all is the mean, each scene counting the same; the \
                 gain in nats above is that share of the mean total."
            }
        }
    }
}

/// Guards that speak against a placement, and rules of the mount that it breaks.
fn reasons(scored: &Scored) -> impl Iterator<Item = String> {
    let guards = scored.scores.guards.iter().map(ToString::to_string);
    let lacking = scored.scores.required.iter().filter(|seen| seen.share < seen.least);
    guards.chain(scored.violations.iter().cloned()).chain(lacking.map(ToString::to_string))
}

/// The poses of the result.
fn placement(best: &Scored, figures: &Figures, active_bounds: &[String]) -> Markup {
    let titles =
        ["LiDAR", "x m", "y m", "z m", "roll rad", "pitch rad", "yaw rad", "only it gains %"];
    let lidars = best.placement.lidars.iter().zip(&best.scores.unique_share).enumerate();
    let named = best.placement.lidars.iter().any(|pose| !pose.sensor.is_none());
    html! {
        h2 { "The placement" }
        (PreEscaped(figures.placement.as_deref().unwrap_or_default()))
        div.wide {
            table {
                tr {
                    @for title in titles { th { (title) } }
                    @if named { th { "sensor" } }
                }
                @for (index, (pose, unique)) in lidars {
                    tr {
                        td { (index) }
                        @for (_, value) in pose.fields() { td { (format!("{value:.3}")) } }
                        td { (format!("{:.1}", 100.0 * unique)) }
                        @if named { td { (pose.sensor) } }
                    }
                }
            }
        }
        @for seen in &best.scores.required { p { "Must be seen: " (seen) "." } }
        @if !active_bounds.is_empty() {
            p { "On a bound or a rule of the mount: " (active_bounds.join("; ")) "." }
        }
    }
}

/// Properties of layouts that go with the objective.
fn findings(run: &RunRecord) -> Markup {
    html! {
        @if !run.findings.is_empty() {
            h2 { "What goes with the score" }
            p {
                "Rank correlations (Spearman) of properties of layouts with the objective over random \
                 placements, and what is left of them with mean height, the null model, held fixed."
            }
            div.wide {
                table {
                    tr { th { "property" } th { "correlation" } th { "beside mean height" } }
                    @for finding in &run.findings {
                        tr {
                            td { (finding.property) }
                            td { (optional(finding.correlation, 2)) }
                            td { (optional(finding.beside_height, 2)) }
                        }
                    }
                }
            }
        }
    }
}

/// Rules, restarts, layouts left out and frames, a sentence each.
fn search(run: &RunRecord) -> Markup {
    html! {
        @for (title, lines) in [("Rules kept", &run.constraints), ("Restarts", &run.ended)] {
            @if !lines.is_empty() { p { (title) ": " (lines.join("; ")) "." } }
        }
        @for layout in &run.left_out {
            p { "Not started from " (layout.name) ": " (layout.why.join("; ")) "." }
        }
        @if let Some(words) = run.fidelity.as_ref().map(|frames| frames.words.as_str()) {
            p { "Fidelity: " (words) "." }
        }
    }
}

/// How the run was made, a line each.
fn facts(run: &RunRecord) -> Markup {
    let times = &run.timings;
    let facts = [
        ("stopped by", run.stopped.clone()),
        (
            "evaluations",
            format!(
                "{} in {} generations, over {} frame(s) each; the table above is over {}",
                run.evaluations, run.generations, run.search_frames, run.frames
            ),
        ),
        ("rate", format!("{:.1} placements × frames/s", run.rate)),
        ("backend", format!("{}: {}", run.backend, run.adapter)),
        ("seed", run.seed.to_string()),
        (
            "time",
            format!(
                "{:.1} s: load {:.1}, build {:.1}, search {:.1}, confirm {:.1}",
                times.total, times.load, times.build, times.search, times.confirm
            ),
        ),
        ("found by", methods_in_words(run)),
        ("certificate", certificate_in_words(run)),
        ("program", format!("sightline {}", run.sightline)),
    ];
    html! {
        dl { @for (name, value) in facts { dt { (name) } dd { (value) } } }
    }
}
