//! The page of a run, or of placements alone: one file that opens offline and loads nothing.
//!
//! | file | holds |
//! |---|---|
//! | `scores` | requirements, result against baselines, guards, scene by scene |
//! | `layout` | poses of the result, and the gain of each LiDAR; tables and figures |
//! | `seen` | range card, blind zone and maps; things by the LiDARs that see them, loss of each LiDAR, overlap of pairs |
//! | `search` | convergence, findings, how the run was made and how to repeat it |
//! | `front` | the page of a front |

mod front;
mod layout;
mod scores;
mod search;
mod seen;

use std::sync::Arc;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::coverage::near_field_svg;
use super::targets::range_card_svg;
use super::view::ViewData;
use super::{
    InformationMap, NearRecord, RunRecord, SceneRecord, convergence_svg, judged, next_in_words,
    placement_svg, run_verdict, spread_in_words,
};
use crate::engine::{BackendError, EngineChoice, open};
use crate::job::{Job, JobError, JobScene, Losses};
use crate::near_field::{Footprint, NearField, NearSite, cast_frames};
use crate::problem::Problem;
use crate::scan::conditions::under;
use crate::scene::Target;
use crate::search::{Evaluator, GenerationRecord, Member, Scored, Suite};
use crate::shared::{
    LEAST_SHARED, Overlap, REDUNDANCY_TARGETS, Redundancy, RedundancySite, redundancy_question,
};
use crate::vehicle::{Constraints, Placement, UNNAMED};

pub use front::front_html;
pub use search::found_html;

/// The page of a run: the result in a sentence and a picture, then all that is known of it. `tolerance` is
/// [`Subject::tolerance`].
pub(crate) fn report_html(run: &RunRecord, figures: &Figures, tolerance: &str) -> String {
    let subject = Subject { tolerance: tolerance.to_owned(), ..Subject::of(run) };
    page(&subject, figures, Some(run)).into_string()
}

pub(crate) fn view_html(subject: &Subject<'_>, figures: &Figures) -> String {
    page(subject, figures, None).into_string()
}

/// Policy that loads and sends nothing: styles, scripts and pictures are part of the page.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; \
                      base-uri 'none'; form-action 'none'";

/// A page of `title` with its header and its sections; `end` stands behind the footer.
fn whole(title: &str, header: &Markup, sections: &Markup, end: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "sightline: " (title) }
                style { (PreEscaped(include_str!("page/style.css"))) }
            }
            body {
                (header)
                main { (sections) }
                footer { p { "Made by sightline " (env!("CARGO_PKG_VERSION")) "." } }
                (end)
            }
        }
    }
}

/// A section of a page under its title; nothing without a body.
fn section(id: &str, title: &str, body: &Markup) -> Markup {
    html! {
        @if !body.0.is_empty() { section aria-labelledby=(id) { h2 id=(id) { (title) } (body) } }
    }
}

/// Head of a page: scene and weather, the first sentence of the verdict large, the others and its list below.
fn heading((vehicle, scene): (&str, &str), conditions: &[String], verdict: &str) -> Markup {
    let (verdict, list) = verdict.split_once('\n').unwrap_or((verdict, ""));
    let (first, rest) = verdict.split_once(". ").unwrap_or((verdict, ""));
    let stop = if rest.is_empty() { "" } else { "." };
    html! {
        header {
            p.scene {
                "sightline · " (scene) (under(conditions))
                @if !vehicle.is_empty() { " · vehicle " (vehicle) }
            }
            h1 { (layout::prose_of(first, unbroken)) (stop) }
            @if !rest.is_empty() { p { (layout::prose(rest)) } }
            @if !list.is_empty() { ul { @for place in list.lines() { li { (layout::prose(place)) } } } }
        }
    }
}

fn page(subject: &Subject<'_>, figures: &Figures, run: Option<&RunRecord>) -> Markup {
    let names = (&*figures.vehicle, subject.scene);
    let head = heading(names, subject.conditions, &subject.verdict);
    let main = html! {
        (section("required", "Requirements", &scores::required(subject)))
        @for step in run.map(next_in_words).unwrap_or_default() { p { (layout::prose(&step)) } }
        @if let Some(words) = run.and_then(|run| run.equipment.as_ref()) { p { "Equipment: " (layout::prose(words)) "." } }
        (section("required", "No requirement is set", &scores::usual(subject)))
        (layout::stage(subject, figures))
        @if subject.result.is_some() {
            p.part { "For the engineer: what it sees and where it stands" }
        }
        (section("range", "Range card", &seen::range_card(subject, figures)))
        (section("near", "Ground near the vehicle", &seen::near_field(figures)))
        (section("placement", "The placement", &layout::layout(subject, figures, run)))
        (section("redundancy", "Seen by how many LiDARs", &seen::redundancy(subject, figures)))
        (section("lost", "If one LiDAR fails", &seen::losses(subject, figures)))
        (section("overlap", "Overlap of the LiDARs", &seen::overlap(figures)))
        p.part { "For the sceptic: what to doubt, and how to repeat it" }
        (section("guards", "Warnings", &scores::guards(subject, run)))
        @if let Some(words) = run.and_then(spread_in_words) { p { (layout::prose(&words)) } }
        @if let Some(phases) = run.and_then(|run| run.phases.as_ref()) { p { (layout::prose(&phases.words)) } }
        (section("against", "Against every baseline", &scores::against(subject, run)))
        (section("gains", "Where the gain comes from", &scores::gains(subject, figures)))
        (seen::maps(figures))
        (section("scores", "All scores", &scores::scores(subject)))
        (section("scenes", "Scene by scene", &scores::scenes(subject)))
        @if let Some(run) = run { (section("search", "The search", &search::search(run, figures))) }
        (section("repeat", "How to repeat it", &search::run_again(subject, run)))
    };
    whole(subject.scene, &head, &main, &layout::script(figures))
}

/// Words of a heading; names with a hyphen stay on one line.
fn unbroken(words: &str) -> Markup {
    html! {
        @for (index, word) in words.split(' ').enumerate() {
            @if index > 0 { " " }
            @if word.contains('-') { span.name { (word) } } @else { (word) }
        }
    }
}

/// A command with the engine that it ran on; empty where no program ran.
fn on_backend(command: &str, backend: &str) -> String {
    if command.is_empty() { String::new() } else { format!("{command} --backend {backend}") }
}

/// Subject of a page, whether it was searched for or given.
#[derive(Debug, Clone, Default)]
pub(crate) struct Subject<'a> {
    /// Name of the scene; all names where there are several.
    pub scene: &'a str,
    /// Each of several scenes.
    pub scenes: &'a [SceneRecord],
    /// Score of the comparison.
    pub objective: &'a str,
    /// Weather and faults that it holds for, as they are written.
    pub conditions: &'a [String],
    /// The result in sentences, the first of which heads the page.
    pub verdict: String,
    /// The placement of the page; `None` where a search found nothing.
    pub result: Option<&'a Scored>,
    /// Layouts to compare with.
    pub baselines: &'a [Scored],
    /// The command that makes this page again.
    pub command: String,
    /// The command that asks how far each LiDAR may be off; empty where no program gives one.
    pub tolerance: String,
}

impl<'a> Subject<'a> {
    pub(crate) fn of(run: &'a RunRecord) -> Self {
        Self {
            scene: &run.scene,
            scenes: &run.scenes,
            objective: &run.objective,
            conditions: &run.conditions,
            verdict: run_verdict(run),
            result: run.best.as_ref(),
            baselines: &run.baselines,
            command: on_backend(&run.command, &run.backend),
            tolerance: String::new(),
        }
    }

    /// A placement that was given, by `objective` in clear air; `command` makes the page again.
    pub(crate) fn given(
        scene: &'a str,
        scenes: &'a [SceneRecord],
        result: &'a Scored,
        baselines: &'a [Scored],
        objective: &'a str,
        command: String,
    ) -> Self {
        let (verdict, result) = (judged(result, baselines, objective), Some(result));
        Self { scene, scenes, objective, verdict, result, baselines, command, ..Self::default() }
    }

    /// The best baseline that keeps all rules.
    fn rival(&self) -> Option<&'a Scored> {
        Scored::yardstick(self.baselines)
    }
}

/// Most LiDARs × frames of which each LiDAR is lost in turn: every loss takes a score over all frames.
const MOST_LOST: usize = 512;

/// Figures that are computed of a placement for its page, beyond its scores.
pub(crate) struct Looks {
    /// Name of the vehicle; empty without one.
    vehicle: String,
    /// Information that the placement gains, seen from above, by name of the scene.
    maps: Vec<(String, InformationMap)>,
    views: Vec<ViewData>,
    /// Ground near the vehicle in the first scene that placement and best baseline see, or why there is none.
    near: Result<Near, String>,
    several: Several,
    /// True if bodies of the vehicle move: some figures are of frame 0.
    has_moving_bodies: bool,
    /// Sentence on ground that is not level where targets stand.
    relief: Option<String>,
}

/// LiDARs of a placement against each other.
#[derive(Debug, Clone, Default)]
struct Several {
    /// Pairs in the first scene; `None` where there is one LiDAR, or beams end at nothing.
    overlap: Option<Overlap>,
    /// Things of the first scene by the number of LiDARs that see them; `None` where there is one LiDAR and no other sensor.
    redundancy: Option<Redundancy>,
    /// Sentences on sensors of other technologies whose view the own body blocks.
    notes: Vec<String>,
    /// The placement without each of its LiDARs; `None` for one LiDAR, beyond [`MOST_LOST`], and where there was no time.
    losses: Option<Losses>,
}

/// Near fields of some placements around one body.
struct Near {
    footprint: Footprint,
    /// Frames that they are taken over.
    frames: usize,
    all: Vec<(Placement, NearField)>,
}

impl Looks {
    /// Looks at a placement and its baselines in the scenes of a job, whose suite is over all frames, on the CPU
    /// within the memory of the job's engine. Losses of LiDARs are left out once `go_on`, which is asked often, says no.
    pub(crate) fn new(
        job: &Job,
        suite: &Suite,
        placement: &Placement,
        baselines: &[Scored],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Self, JobError> {
        let choice = EngineChoice { memory: job.settings().engine.memory, ..EngineChoice::cpu() };
        let rival = Scored::yardstick(baselines).map(|rival| &rival.placement);
        let layouts: Vec<Placement> = baselines.iter().map(|b| b.placement.clone()).collect();
        let (mut maps, mut views, mut ground) = (Vec::new(), Vec::new(), None);
        let places: Vec<&Member> =
            suite.members().iter().filter(|member| !member.is_mirrored()).collect();
        for member in &places {
            let (name, problem) = (member.name(), member.problem());
            let scene = &**job.scenes()[member.scene()].scene();
            // Much of either is work of one thread.
            let (seen, near) = rayon::join(
                || -> Result<_, JobError> {
                    let mut engine = open(problem.task(), &choice, |_| {})?.engine;
                    let engine = &mut *engine;
                    let map =
                        InformationMap::of(problem, engine, placement)?.with_body(&scene.body());
                    let count = places.len();
                    let view = ViewData::new(scene, problem, engine, placement, &layouts, count)?;
                    Ok((map, view))
                },
                || {
                    let both = std::iter::once(placement).chain(rival);
                    let of = &job.scenes()[member.scene()];
                    ground.is_none().then(|| near(of, problem, &choice, both))
                },
            );
            let (map, view) = seen?;
            maps.push((name.to_owned(), map));
            views.push(view);
            ground = near.transpose()?.or(ground);
        }
        let (near, mut several) = ground.expect("a suite has a scene that is no mirror image");
        let lidars = placement.lidars.len();
        if lidars > 1 && lidars * suite.frame_count() <= MOST_LOST {
            let (mut evaluator, _) = Evaluator::open(suite, &choice, |_| {})?;
            several.losses = job.losses_while(&mut evaluator, placement, go_on)?;
        }
        let has_moving_bodies = job.scene().has_moving_bodies();
        let relief = job.relief_in_words()?;
        let name = &job.scene().vehicle().name;
        let vehicle = if name == UNNAMED { String::new() } else { name.clone() };
        Ok(Self { vehicle, maps, views, near, several, has_moving_bodies, relief })
    }

    /// Near field of the placement and of the best baseline; `None` where there is none to tell.
    pub(crate) fn near_field(&self) -> Option<NearRecord> {
        let looked = self.near.as_ref().ok()?;
        let mut all = looked.all.iter().map(|(_, near)| near.clone());
        Some(NearRecord { frames: looked.frames, near: all.next()?, rival: all.next() })
    }
}

/// Ground near the vehicle that a placement sees in the first scene of a job, over the frames of its page, on the CPU; `None`
/// without own body or ground.
///
/// # Errors
/// See [`Job::problem`]; an engine that fails.
pub fn near_record(job: &Job, placement: &Placement) -> Result<Option<NearRecord>, JobError> {
    let choice = EngineChoice { memory: job.settings().engine.memory, ..EngineChoice::cpu() };
    let Some(site) = job.scenes()[0].near_site()? else { return Ok(None) };
    let mut engine = open(site.problem().task(), &choice, |_| {})?.engine;
    let near = site.look(&mut *engine, placement)?;
    Ok(Some(NearRecord { frames: near.frames as usize, near, rival: None }))
}

/// Near fields of placements over the frames of a scene, and the LiDARs of the first one against each other.
fn near<'a>(
    of: &JobScene,
    problem: &Arc<Problem>,
    choice: &EngineChoice,
    placements: impl Iterator<Item = &'a Placement> + Clone,
) -> Result<(Result<Near, String>, Several), JobError> {
    let scene = &**of.scene();
    let cast = cast_frames(problem);
    let frames = cast.geometry_frame_count();
    let mut engine = open(cast.task(), choice, |_| {})?.engine;
    let mut several = Several::default();
    let has_others = !scene.vehicle().other_sensors.is_empty();
    let first = placements.clone().next();
    if let Some(first) = first.filter(|first| has_others || first.lidars.len() > 1) {
        several.overlap = Overlap::new(scene, &cast, &mut *engine, first, LEAST_SHARED).ok();
        let targets = REDUNDANCY_TARGETS.iter().filter_map(|name| Target::named(name).ok());
        let question = redundancy_question(targets.collect());
        let site = RedundancySite::new(scene, cast.clone(), of.target_site()?.cloned());
        several.notes = site.notes();
        several.redundancy = Some(site.look(&mut *engine, &question, first)?);
    }
    let site = match NearSite::new(scene, &cast) {
        Ok(site) => site,
        Err(why) => return Ok((Err(why.to_string()), several)),
    };
    let look = |placement: &Placement| Ok((placement.clone(), site.look(&mut *engine, placement)?));
    let all = placements.map(look).collect::<Result<Vec<_>, BackendError>>()?;
    let near = Near { footprint: site.footprint().clone(), frames, all };
    Ok((Ok(near), several))
}

/// The drawings of a page, as SVG, and the data of its 3-D view.
#[derive(Debug, Clone)]
pub(crate) struct Figures {
    /// Name of the vehicle; empty without one, and without a result.
    vehicle: String,
    /// Objective against evaluations; `None` without a search.
    pub convergence: Option<String>,
    /// The placement on the vehicle; `None` without a result.
    pub placement: Option<String>,
    /// Mount of each LiDAR, where mounts have names; `None` for one that stands on none.
    pub mounts: Vec<Option<String>>,
    /// Information gained, seen from above, with the name of each scene; empty without a result.
    pub maps: Vec<(String, String)>,
    /// Columns by the number of LiDARs that see them, from above, scene by scene; empty without a result and for one LiDAR.
    pub lidars: Vec<(String, String)>,
    /// The blind zone from above, or why it is not drawn.
    pub near_field: Result<String, String>,
    /// Frames that it is taken over.
    pub near_frames: usize,
    /// LiDARs of the placement against each other, over the same frames.
    several: Several,
    /// True if bodies of the vehicle move: range card and outline are of frame 0.
    has_moving_bodies: bool,
    /// Sentence on ground that is not level where targets stand.
    relief: Option<String>,
    /// The 3-D view of each scene; empty without a result.
    pub views: Vec<ViewData>,
}

impl Figures {
    /// Draws a placement; `body` holds the ego body's triangles in the ego frame.
    pub(crate) fn new(
        shown: Option<&Scored>,
        constraints: &Constraints,
        body: &[[[f32; 3]; 3]],
        looks: Option<Looks>,
    ) -> Self {
        let mounts = shown.map(|shown| constraints.mount_names(&shown.placement));
        let mounts = mounts.unwrap_or_default().into_iter();
        let mut this = Self {
            mounts: mounts.map(|name| name.map(str::to_owned)).collect(),
            vehicle: String::new(),
            convergence: None,
            placement: shown.map(|shown| placement_svg(shown, constraints, body)),
            maps: Vec::new(),
            lidars: Vec::new(),
            near_field: Err("there is no result".to_owned()),
            near_frames: 0,
            several: Several::default(),
            has_moving_bodies: false,
            relief: None,
            views: Vec::new(),
        };
        let Some((looks, shown)) = looks.zip(shown) else {
            return this;
        };
        let placement = &shown.placement;
        let drawn = |of: fn(&InformationMap, &Placement) -> String| {
            looks.maps.iter().map(|(name, map)| (name.clone(), of(map, placement))).collect()
        };
        this.maps = drawn(InformationMap::svg);
        if placement.lidars.len() > 1 {
            this.lidars = drawn(InformationMap::lidars_svg);
        }
        this.near_frames = looks.near.as_ref().map_or(0, |near| near.frames);
        this.near_field = looks.near.map(|Near { footprint, all, .. }| {
            let drawn: Vec<(&Placement, &NearField)> = all.iter().map(|(p, n)| (p, n)).collect();
            near_field_svg(&footprint, &drawn)
        });
        (this.several, this.views, this.relief) = (looks.several, looks.views, looks.relief);
        (this.has_moving_bodies, this.vehicle) = (looks.has_moving_bodies, looks.vehicle);
        this
    }

    /// Every drawing with a name of its own; `result` is the placement that they show.
    pub(crate) fn files(&self, result: Option<&Scored>) -> Vec<(String, String)> {
        let mut all = Vec::new();
        let mut add = |name: &str, svg: &str| all.push((name.to_owned(), svg.to_owned()));
        self.placement.iter().for_each(|svg| add("placement", svg));
        self.convergence.iter().for_each(|svg| add("convergence", svg));
        if let Some((best, card)) = result.and_then(|b| Some((b, b.scores.range_card.as_ref()?))) {
            add("range-card", &range_card_svg(&best.placement.name, card));
        }
        self.near_field.iter().for_each(|svg| add("near-field", svg));
        for (scene, map) in &self.maps {
            add(&format!("information-{scene}"), map);
        }
        for (scene, map) in &self.lidars {
            add(&format!("lidars-{scene}"), map);
        }
        all
    }

    pub(crate) fn with_search(mut self, run: &RunRecord, history: &[GenerationRecord]) -> Self {
        let best = run.best.as_ref();
        let steps = run.fidelity.as_ref().map_or(&[][..], |frames| &frames.steps);
        let svg = convergence_svg(history, &run.objective, &run.baselines, best, steps);
        self.convergence = Some(svg);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::view::tests::yard;

    #[test]
    fn losses_are_left_out_where_a_run_is_to_end() {
        let (scene, _, [two, _]) = yard();
        let job = Job::new(scene);
        let suite = job.suite().unwrap();
        let looks = |goes_on: bool| Looks::new(&job, &suite, &two, &[], &mut || goes_on).unwrap();
        assert!(looks(true).several.losses.is_some());
        let late = looks(false);
        assert!(late.several.losses.is_none() && late.several.redundancy.is_some());
    }

    #[test]
    fn the_head_has_one_sentence_large_and_blind_places_as_a_list() {
        let verdict = "BLIND: 2 sectors, listed below. No warning.\nBLIND: ahead.\nBLIND: left.";
        let head = heading(("", "street"), &[], verdict).into_string();
        let want = "<h1>BLIND: 2 sectors, listed below.</h1><p>No warning.</p>\
                    <ul><li>BLIND: ahead.</li><li>BLIND: left.</li></ul>";
        assert!(head.contains(want), "{head}");
        assert!(head.contains("sightline · street<"), "{head}");
        let of_van = heading(("van", "street"), &[], verdict).into_string();
        assert!(of_van.contains("sightline · street · vehicle van<"), "{of_van}");
        assert!(
            !heading(("", "street"), &[], "The placement found. No warning.")
                .into_string()
                .contains("<ul>")
        );
    }
}
