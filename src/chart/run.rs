//! The chart: every setting measured in turn, and the verdict over them.

use std::cell::Cell;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::early::StoppingRule;
use super::measure::Bench;
use super::{
    Advice, ChartError, ChartWorld, Engine, Ladder, Left, Measured, PoseCost, RankingError, Rated,
    SceneDetail, Setting, Skipped, cheapest, rate,
};
use crate::engine::{EngineChoice, EngineKind, open};
use crate::psog::Psog;
use crate::scene::Scene;
use crate::score::Objective;
use crate::vehicle::{Placement, random_placements_by_the_rules, table_7};

/// Most random placements of a chart.
const MOST_RANDOM: u32 = 2_000;
/// Repeats of a timing, and of one in a full chart.
const REPEATS: [usize; 2] = [3, 5];

/// Settings of a chart: with its scene they decide about every number but the times.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ChartSettings {
    /// Placements to rank beside the random ones.
    pub given: Vec<Placement>,
    /// Random placements within the mount.
    pub random: u32,
    /// Score that ranks the placements.
    pub objective: Objective,
    /// Edge of the finest voxels in metres; `None` takes half of the scene's where that is 0.1 or more.
    pub finest: Option<f64>,
    /// No voxels finer than the scene's, whatever `finest` says.
    #[serde(default)]
    pub quick: bool,
    /// Measures every setting with all placements and times each in repeats, also those that cannot be the advice,
    /// and warm pose atlases.
    #[serde(default)]
    pub full: bool,
    /// Seed of the random placements and of the bootstrap.
    pub seed: u64,
    /// Engines to measure: [`EngineKind::Cpu`] leaves the GPU out.
    #[serde(skip, default = "EngineChoice::cpu")]
    pub engine: EngineChoice,
}

impl Default for ChartSettings {
    fn default() -> Self {
        Self {
            given: table_7(),
            random: 100,
            objective: Objective::default(),
            finest: None,
            quick: false,
            full: false,
            seed: 1,
            engine: EngineChoice::cpu(),
        }
    }
}

/// Checkpoint of a chart.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ChartState {
    /// Median seconds a placement of the setting whose time all others are divided by; `None` at first.
    #[serde(rename = "yardstick_seconds")]
    pub unit_seconds: Option<f64>,
    /// Settings that were measured, in order.
    pub measured: Vec<Measured>,
}

/// A measured setting for the reader.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChartRow {
    /// The setting in words.
    pub setting: String,
    /// The setting.
    pub rung: Setting,
    /// Wall time of a placement in seconds, all threads at work.
    pub seconds: f64,
    /// Least and most of its repeats.
    pub spread: [f64; 2],
    /// Bytes of scene, P-SOG and work buffers; for an atlas also of its poses' bitmaps.
    pub bytes: u64,
    /// Beams of one placement over all frames.
    pub beams: u64,
    /// Triangles, a mean over frames.
    pub triangles: u64,
    /// Cost of casting a pose of an atlas; `None` for other engines.
    pub(crate) pose: Option<PoseCost>,
    /// Against the reference.
    pub(crate) error: RankingError,
    /// True if its scores mean the same as the reference's; otherwise only rankings compare.
    pub same_quantity: bool,
    /// No other setting that was measured to the end is cheaper and ranks at least as well.
    pub on_front: bool,
    /// Placements that were scored, the first of all.
    pub placements: usize,
    /// Reason for which no more were.
    pub left: Option<Left>,
}

/// Cost against accuracy of the settings of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Name of the scene.
    pub scene: String,
    /// Names of the placements that were ranked.
    pub placements: Vec<String>,
    /// The score that ranks.
    pub objective: String,
    /// The scene's own voxel edge in metres.
    pub edge: f64,
    /// Share of the best score that taking a setting's best placement may lose.
    pub tolerance: f64,
    /// Every measured setting against the first, the reference.
    pub rated: Vec<Rated>,
    /// The setting to take; `None` where none was measured.
    pub verdict: Option<Advice>,
    /// True if every setting was measured to the end.
    pub full: bool,
    /// Settings that were not begun, since they cannot be the one to take.
    pub skipped: Vec<Skipped>,
    /// Why settings are missing, one sentence each.
    pub left_out: Vec<String>,
    /// Settings that were not measured because the observer said stop.
    pub missing: usize,
}

impl Chart {
    /// The measured settings for the reader.
    pub fn rows(&self) -> Vec<ChartRow> {
        let row = |rated: &Rated| {
            let Rated { measured, error, on_front } = rated.clone();
            let finest = &self.rated[0].measured.setting.fidelity;
            ChartRow {
                setting: measured.setting.words(self.edge),
                rung: measured.setting,
                seconds: measured.seconds,
                spread: measured.spread,
                bytes: measured.bytes,
                beams: measured.beams,
                triangles: measured.triangles,
                pose: measured.pose,
                error,
                same_quantity: measured.setting.fidelity.same_quantity(finest),
                on_front,
                placements: measured.scores.len(),
                left: measured.left,
            }
        };
        self.rated.iter().map(row).collect()
    }
}

/// Sees a chart being measured, and may stop it.
pub trait ChartObserver {
    /// Called before a setting is measured, with its number from 1, the number of all, and its words.
    fn begins(&self, _number: usize, _of: usize, _setting: &str) {}

    /// Called often with the share of the whole work that is done.
    fn progress(&self, _share: f64) {}

    /// Called after each setting, with the state to go on from.
    fn measured(&self, _state: &ChartState) {}

    /// Asked after every few placements; `false` stops the chart and drops the setting under way.
    fn goes_on(&self) -> bool {
        true
    }
}

/// An observer that hears nothing and never stops.
impl ChartObserver for () {}

/// Measures the settings that a scene allows, each with the same placements, and compares them.
///
/// Settings that `state` holds are not measured again; it gets those that are, and is all that an
/// interrupted chart needs to go on.
///
/// # Errors
/// Settings that the scene does not allow; a state of another scene; the scene cannot be scored.
pub fn chart(
    scene: Arc<Scene>,
    psog: Arc<Psog>,
    settings: &ChartSettings,
    tolerance: f64,
    state: &mut ChartState,
    observer: &dyn ChartObserver,
) -> Result<Chart, ChartError> {
    let (name, edge) = (scene.name().to_owned(), scene.roi().voxel[0]);
    let mut ladder = Ladder::new(&scene, finest(&scene, &psog, settings)?);
    if !settings.full {
        // The f64 scorer takes twenty times as long as its equal in `f32`, which is the reference here.
        ladder.all.swap(0, 1);
        ladder.all.retain(|setting| setting.engine != Engine::Atlas);
        let why = "warm pose atlases, which are never the advice: see --full";
        ladder.left_out.push(why.to_owned());
    }
    let random = settings.random as usize;
    let drawn = random_placements_by_the_rules(&scene.constraints(), random, settings.seed);
    let placements = settings.given.iter().cloned().chain(drawn).collect();
    // Requirements rank nothing here, and coarser settings could not pose them.
    let scene = Arc::new(Arc::unwrap_or_clone(scene).without_requirements());
    let mut bench = Bench::new(
        ChartWorld::new(scene, psog),
        placements,
        settings.objective.clone(),
        settings.engine.clone(),
        REPEATS[usize::from(settings.full)],
        state.unit_seconds,
    )?;
    if let Some(why) = why_no_gpu(&mut bench, &settings.engine)? {
        ladder.all.retain(|setting| setting.engine != Engine::Gpu);
        ladder.left_out.push(format!("the GPU: {why}"));
    }
    check_resumed(&mut bench, &ladder, state)?;
    let rule = StoppingRule::new(settings.full, tolerance, settings.seed);
    let (missing, skipped) = measure(&mut bench, &mut ladder, rule, edge, state, observer)?;
    let rated = rate(&state.measured, tolerance, settings.seed);
    Ok(Chart {
        scene: name,
        placements: bench.placements.iter().map(|p| p.name.clone()).collect(),
        objective: settings.objective.to_string(),
        edge,
        tolerance,
        verdict: cheapest(&rated, tolerance),
        rated,
        full: settings.full,
        skipped,
        missing,
        left_out: ladder.left_out,
    })
}

/// Edge of the finest voxels. Refuses settings that the scene does not allow.
fn finest(scene: &Scene, psog: &Psog, settings: &ChartSettings) -> Result<Option<f64>, ChartError> {
    let objective = &settings.objective;
    if objective.needs_detection() && scene.detection_among(psog.classes()).is_empty() {
        let file = scene.files().first();
        let scene = file.map_or_else(|| scene.name().to_owned(), |f| f.display().to_string());
        return Err(ChartError::NoDetection { scene, objective: objective.to_string() });
    }
    if settings.random > MOST_RANDOM {
        return Err(ChartError::TooMany { random: settings.random, most: MOST_RANDOM });
    }
    if settings.given.is_empty() && settings.random == 0 {
        return Err(ChartError::NoPlacement);
    }
    let edge = scene.roi().voxel[0];
    if settings.quick {
        return Ok(Some(edge));
    }
    match settings.finest.filter(|finest| *finest > edge * (1.0 + 1e-9)) {
        Some(finest) => Err(ChartError::Coarser { finest, edge }),
        None => Ok(settings.finest),
    }
}

/// Why the GPU is not measured; `None` if it is. Either the CPU was chosen, or no GPU was found.
fn why_no_gpu(bench: &mut Bench, choice: &EngineChoice) -> Result<Option<String>, ChartError> {
    match choice.kind {
        EngineKind::Cpu => return Ok(Some("--backend cpu".to_owned())),
        EngineKind::Gpu => return Ok(None),
        EngineKind::Auto => {}
    }
    let own = SceneDetail::of_scene(&bench.world.scene);
    let opened = open(bench.world.problem(&own)?.task(), choice, |_| {})?;
    let is_gpu = opened.engine.name() == "gpu";
    Ok((!is_gpu).then(|| opened.notes.into_iter().next().unwrap_or_default()))
}

/// Refuses a state that was begun with another scene or other placements.
fn check_resumed(
    bench: &mut Bench,
    settings: &Ladder,
    state: &ChartState,
) -> Result<(), ChartError> {
    let Some(first) = state.measured.first() else { return Ok(()) };
    let count = bench.placements.len();
    let is_whole = |m: &Measured| m.scores.len() == count;
    let fits = |m: &Measured| is_whole(m) || m.left.is_some() && m.scores.len() < count;
    let same = state.measured.iter().all(fits)
        && is_whole(first)
        && settings.all.first() == Some(&first.setting)
        && first.scores[0] == bench.first_score(&first.setting)?;
    if same { Ok(()) } else { Err(ChartError::OtherState) }
}

/// Measures the settings that are missing as far as `rule` says, until the observer says stop. Returns the number of
/// those then missing, without a reason, and the settings that were skipped for one.
fn measure(
    bench: &mut Bench,
    settings: &mut Ladder,
    mut rule: StoppingRule,
    edge: f64,
    state: &mut ChartState,
    observer: &dyn ChartObserver,
) -> Result<(usize, Vec<Skipped>), ChartError> {
    let efforts: Vec<f64> = settings.all.iter().map(|s| s.effort(&bench.world.scene)).collect();
    let order = rule.order(&efforts);
    let count = bench.placements.len();
    let (mut before, mut skipped) = (0.0, Vec::new());
    for (place, &index) in order.iter().enumerate() {
        let (setting, effort) = (settings.all[index], efforts[index]);
        let expected = |index: usize, rule: &StoppingRule| {
            let effort = efforts[index];
            effort * rule.expects(&settings.all[index], [effort, efforts[order[0]]], count)
        };
        let own = if place == 0 { effort } else { expected(index, &rule) };
        let later: f64 = order[place + 1..].iter().map(|&index| expected(index, &rule)).sum();
        let is_missing = |&&i: &&usize| state.measured.iter().all(|m| m.setting != settings.all[i]);
        let missing = || order[place..].iter().filter(is_missing).count();
        if !observer.goes_on() {
            return Ok((missing(), skipped));
        }
        let held = state.measured.iter().position(|m| m.setting == setting);
        if held.is_none() && rule.skips(&setting, effort) {
            skipped.push(Skipped { rung: setting, left: Left::Dearer });
        } else if held.is_none_or(|at| !rule.is_settled(&state.measured[at], effort)) {
            let words = setting.words(edge);
            observer.begins(place + 1, order.len(), &words);
            let share = |part: f64| {
                let done = before + effort * part;
                observer.progress(done / (done.max(before + own) + later));
            };
            match one(bench, &setting, &rule, state, (&share, observer)) {
                Ok(Some(measured)) => match held {
                    Some(at) => state.measured[at] = measured,
                    None => state.measured.push(measured),
                },
                Ok(None) => return Ok((missing(), skipped)),
                Err(error) if error.spares_others(&setting) => {
                    settings.left_out.push(format!("{words}: {error}"));
                }
                Err(error) => return Err(error),
            }
            state.unit_seconds = bench.unit_seconds;
            observer.measured(state);
        }
        if let Some(measured) = state.measured.iter().find(|m| m.setting == setting) {
            rule.note(measured, effort);
            before += effort * measured.scores.len() as f64 / count as f64;
        }
        observer.progress(before / (before + later));
    }
    Ok((0, skipped))
}

/// Measures one setting as far as the rule says.
fn one(
    bench: &mut Bench,
    setting: &Setting,
    rule: &StoppingRule,
    state: &ChartState,
    (share, observer): (&dyn Fn(f64), &dyn ChartObserver),
) -> Result<Option<Measured>, ChartError> {
    let (done, count) = (Cell::new(0), bench.placements.len() as f64);
    let goes_on = |placements: usize| {
        done.set(done.get() + placements);
        share(done.get() as f64 / count);
        observer.goes_on()
    };
    bench.measure(setting, &state.measured, rule, &goes_on)
}
