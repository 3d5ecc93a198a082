use std::fmt::Write;

use super::{InformationMap, RunRecord, convergence_svg, placement_svg};
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

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn cell(value: Option<f64>, factor: f64, decimals: usize) -> String {
    value.map_or("–".into(), |v| format!("{:.decimals$}", v * factor))
}

fn row(html: &mut String, scored: &Scored, is_best: bool) {
    let scores = &scored.scores;
    let detection = scores.detection.and_then(|d| d.m_sog_scaled);
    let _ = writeln!(
        html,
        "<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
         <td>{:.0}</td><td>{}</td></tr>",
        if is_best { " class=\"best\"" } else { "" },
        escape(&scored.placement.name),
        scored.objective.map_or("–".into(), |v| format!("{v:.4e}")),
        cell(scores.segmentation.m_sog, 1.0, 4),
        cell(scores.segmentation.m_sog_scaled, 1e6, 3),
        cell(detection, 1e6, 3),
        cell(scores.segmentation.information_gain, 1.0, 0),
        cell(scores.segmentation.information_gain_share, 100.0, 2),
        scores.covered,
        cell(scores.hit_share, 100.0, 1)
    );
    let guards = scores.guards.iter().map(ToString::to_string);
    for reason in guards.chain(scored.violations.iter().cloned()) {
        let _ =
            writeln!(html, "<tr><td colspan=\"9\" class=\"guard\">{}</td></tr>", escape(&reason));
    }
}

/// The drawings of a run, as SVG.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// Objective against evaluations.
    pub convergence: String,
    /// The placement on the vehicle; `None` without a result.
    pub placement: Option<String>,
    /// Information gained, seen from above; `None` without a result.
    pub map: Option<String>,
}

impl Figures {
    /// Draws a run; `body` holds the ego body's triangles in the ego frame, `map` what the result
    /// gains.
    pub fn new(
        run: &RunRecord,
        history: &[GenerationRecord],
        constraints: &Constraints,
        body: &[[[f32; 3]; 3]],
        map: Option<&InformationMap>,
    ) -> Self {
        let best = run.best.as_ref();
        Self {
            convergence: convergence_svg(history, &run.objective, &run.baselines, best),
            placement: best.map(|best| placement_svg(best, constraints, body)),
            map: best.zip(map).map(|(best, map)| map.svg(&best.placement)),
        }
    }
}

/// The page of a run: verdict, table, charts and settings; it opens offline and loads nothing.
pub fn report_html(run: &RunRecord, figures: &Figures) -> String {
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width\"><title>sightline: {0}</title><style>{STYLE}</style></head>\
         <body><h1>{0}</h1>\n<p>{1}</p>\n",
        escape(&run.scene),
        escape(&verdict(run))
    );
    html += "<div class=\"wide\"><table><tr><th>placement</th><th>objective</th><th>M-SOG</th>\
             <th>M-SOG/N ×1e-6</th><th>detection ×1e-6</th><th>gain, nats</th><th>gain %</th>\
             <th>covered</th><th>hits %</th></tr>\n";
    if let Some(best) = &run.best {
        row(&mut html, best, true);
    }
    for baseline in &run.baselines {
        row(&mut html, baseline, false);
    }
    html += "</table></div>\n<p>Scores are means over frames; larger is better. M-SOG is \
             −(1/N)·ΣH over covered voxels and can be raised by looking at what never changes; the \
             gain is ΣH itself and cannot. Red lines are guards: reasons not to believe a row.</p>\n";
    if let Some(best) = &run.best {
        html += "<h2>The placement</h2>\n";
        html += figures.placement.as_deref().unwrap_or_default();
        html += "<div class=\"wide\"><table><tr><th>LiDAR</th><th>x m</th><th>y m</th><th>z m</th>\
                 <th>roll rad</th><th>pitch rad</th><th>yaw rad</th><th>only it gains %</th></tr>\n";
        for (index, (pose, unique)) in
            best.placement.lidars.iter().zip(&best.scores.unique_share).enumerate()
        {
            let _ = write!(html, "<tr><td>{index}</td>");
            for (_, value) in pose.fields() {
                let _ = write!(html, "<td>{value:.3}</td>");
            }
            let _ = writeln!(html, "<td>{:.1}</td></tr>", 100.0 * unique);
        }
        html += "</table></div>\n";
        if !run.active_bounds.is_empty() {
            let bounds = run.active_bounds.join("; ");
            let _ =
                writeln!(html, "<p>On a bound or a rule of the mount: {}.</p>", escape(&bounds));
        }
    }
    if let Some(map) = &figures.map {
        html += "<h2>What it sees</h2>\n<p>Information of each column of voxels, from above: red \
                 where the beams gain it, grey where it stays unseen.</p>\n";
        html += map;
    }
    if !run.findings.is_empty() {
        html += "<h2>What goes with the score</h2>\n<p>Rank correlations (Spearman) of properties of \
                 layouts with the objective over random placements, and what is left of them with mean \
                 height, the null model, held fixed.</p>\n<div class=\"wide\"><table><tr>\
                 <th>property</th><th>correlation</th><th>beside mean height</th></tr>\n";
        for finding in &run.findings {
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td>{}</td><td>{}</td></tr>",
                finding.property,
                cell(finding.correlation, 1.0, 2),
                cell(finding.beside_height, 1.0, 2)
            );
        }
        html += "</table></div>\n";
    }
    html += "<h2>The search</h2>\n";
    html += &figures.convergence;
    for (title, lines) in [("Rules kept", &run.constraints), ("Restarts", &run.ended)] {
        if !lines.is_empty() {
            let _ = writeln!(html, "<p>{title}: {}.</p>", escape(&lines.join("; ")));
        }
    }
    for layout in &run.left_out {
        let (name, why) = (escape(&layout.name), escape(&layout.why.join("; ")));
        let _ = writeln!(html, "<p>Not started from {name}: {why}.</p>");
    }
    if let Some(words) = run.fidelity.as_ref().map(|frames| frames.words.as_str()) {
        let _ = writeln!(html, "<p>Fidelity: {}.</p>", escape(words));
    }
    let _ = writeln!(
        html,
        "<dl><dt>stopped by</dt><dd>{}</dd><dt>evaluations</dt><dd>{} in {} generations, over {} \
         frame(s) each; the table above is over {}</dd><dt>rate</dt><dd>{:.1} placements × \
         frames/s</dd><dt>backend</dt><dd>{}: {}</dd><dt>seed</dt><dd>{}</dd><dt>time</dt>\
         <dd>{:.1} s: load {:.1}, build {:.1}, search {:.1}, confirm {:.1}</dd><dt>found by</dt><dd>{}</dd>\
         <dt>certificate</dt><dd>{}</dd><dt>program</dt><dd>sightline {}</dd></dl></body></html>",
        escape(&run.stopped),
        run.evaluations,
        run.generations,
        run.search_frames,
        run.frames,
        run.rate,
        run.backend,
        escape(&run.adapter),
        run.seed,
        run.timings.total,
        run.timings.load,
        run.timings.build,
        run.timings.search,
        run.timings.confirm,
        escape(&methods_in_words(run)),
        escape(&certificate_in_words(run)),
        run.sightline
    );
    html
}

/// What each way of searching reached, and which won.
pub fn methods_in_words(run: &RunRecord) -> String {
    let each = run.methods.iter().map(|m| {
        let value = m.objective.map_or("nothing".into(), |v| format!("{v:.4e}"));
        let won = if m.won { " (the result)" } else { "" };
        format!("{} reached {value} with {} poses cast{won}", m.method, m.poses_cast)
    });
    each.collect::<Vec<_>>().join("; ")
}

/// What is known about placements that were not evaluated.
pub fn certificate_in_words(run: &RunRecord) -> String {
    match &run.certificate {
        None => "nothing is claimed about placements that were not evaluated".into(),
        Some(certificate) => format!(
            "On a grid: {}. As in the paper: {}.",
            certificate.gain_says, certificate.lipschitz_says
        ),
    }
}

/// What the run found, in a sentence or two.
fn verdict(run: &RunRecord) -> String {
    let Some(best) = &run.best else {
        return "No candidate kept the rules of the mount; widen the mount or lower its \
                min_distance."
            .into();
    };
    let allowed = run.baselines.iter().filter(|b| b.violations.is_empty());
    let trusted = allowed.filter(|b| b.scores.guards.is_empty());
    let strongest = trusted
        .filter_map(|b| Some((b.objective?, b.placement.name.as_str())))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(ours), Some((theirs, name))) = (best.objective, strongest) else {
        return format!("The search found a placement of {} LiDARs.", best.placement.lidars.len());
    };
    let rival = if run.baselines.iter().all(|b| b.scores.guards.is_empty()) {
        format!("the best baseline, {name}")
    } else {
        format!("{name}, the best baseline that no guard speaks against")
    };
    let word = if ours > theirs { "better" } else { "worse" };
    let change = 100.0 * (ours - theirs).abs() / theirs.abs();
    let against = if ours == theirs {
        format!("as good as {rival}")
    } else if theirs == 0.0 {
        // Nothing to take a share of.
        format!("{word} than {rival}")
    } else {
        format!("{change:.1} % {word} than {rival}")
    };
    let guard = match best.scores.guards.len() {
        0 => "No guard speaks against it.".to_owned(),
        n => format!("{n} guard(s) speak against it: see the table."),
    };
    format!("The placement found is {against}, by {}. {guard}", run.objective)
}
