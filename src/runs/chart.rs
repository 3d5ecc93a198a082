//! Cost against accuracy, in one folder a scene that can be resumed.

use std::cell::RefCell;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::inputs::{Files, Given, name_published};
use super::{Bar, Computing, GRACE, RunError, Watcher, opening};
use crate::chart::{Chart, ChartObserver, ChartSettings, ChartState, chart};
use crate::files::{Input, RunDir, Session, safe_names};
use crate::report::chart::fidelity_svg;
use crate::report::chart_text::{chart_words, charts_csv};
use crate::vehicle::{read_placements, table_7};

/// Charts to be made, or one to go on with.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ChartRequest {
    /// Scene files, and placements to rank together with random ones [default: Table 7 of the paper]
    #[cfg_attr(
        feature = "cli",
        arg(
            value_name = "SCENE… [PLACEMENTS]",
            required_unless_present = "resume",
            conflicts_with = "resume"
        )
    )]
    pub files: Vec<PathBuf>,
    /// Folder for chart.svg, chart.csv and chart.json, of several scenes one in it for each
    /// [default: runs/SCENE-chart, numbered if it is taken]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR", conflicts_with = "resume"))]
    pub out: Option<PathBuf>,
    /// Go on with an interrupted run; settings that were measured are kept
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub resume: Option<PathBuf>,
    /// Score that ranks the placements, or a weighted sum of several
    #[cfg_attr(feature = "cli", arg(long, default_value_t = ChartSettings::default().objective.to_string(), conflicts_with = "resume"))]
    pub objective: String,
    /// Random placements within the mount, ranked together with the given ones
    #[cfg_attr(feature = "cli", arg(long, alias = "placements", value_name = "N", default_value_t = 100, conflicts_with = "resume", value_parser = clap::value_parser!(u32).range(0..=2_000)))]
    pub random: u32,
    /// How much worse than the best placement that of a coarser setting may be, as a share of the score;
    /// pairs of placements farther apart than that must keep their order, 19 of 20 of them
    #[cfg_attr(feature = "cli", arg(long = "regret", alias = "tolerance", value_name = "SHARE", default_value_t = 0.01, value_parser = super::parse::number_that(|share| (0.0..=1.0).contains(&share), "0 to 1, as 0.01")))]
    pub tolerance: f64,
    /// Edge of the finest voxels in metres, which all other settings are compared with
    /// [default: half of the scene's, where that is 0.1 or more]
    #[cfg_attr(feature = "cli", arg(long, value_name = "METRES", conflicts_with = "resume", value_parser = super::parse::metres))]
    pub finest: Option<f64>,
    /// No voxels finer than those of each scene
    #[cfg_attr(feature = "cli", arg(long, conflicts_with_all = ["resume", "finest"]))]
    pub quick: bool,
    /// Measure every setting with all placements, also those that cannot be the advice, and print them all
    #[cfg_attr(feature = "cli", arg(long, conflicts_with = "resume"))]
    pub full: bool,
    /// Seed of the random placements and of the bootstrap
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 1, value_parser = super::parse::whole::<u64>, conflicts_with = "resume"))]
    pub seed: u64,
}

/// The chart of a scene.
#[derive(Debug)]
pub struct Charted {
    /// Measured settings, and the one to take.
    pub chart: Chart,
    /// Folder that holds it.
    pub folder: PathBuf,
    /// All of `chart.json`.
    pub answer: Value,
}

/// Makes the charts, one a scene, until the watcher stops them, and calls `each` with every one. Returns the number of
/// charts in the request, and the charts that were made.
///
/// # Errors
/// Files that cannot be read or written, errors of [`chart`] and of `each`.
pub fn chart_scenes(
    request: &ChartRequest,
    computing: &Computing<'_>,
    mut each: impl FnMut(&Charted) -> Result<(), RunError>,
) -> Result<(usize, Vec<Charted>), RunError> {
    let _session = Session::begin();
    let watcher = computing.watcher;
    watcher.listen(GRACE);
    let begun = begun(request, computing)?;
    let (count, mut charts) = (begun.len(), Vec::new());
    for begun in begun {
        let found = of_scene(begun, request.tolerance, computing)?;
        each(&found)?;
        if found.chart.missing > 0 {
            watcher.note(&format!(
                "interrupted with {} settings to go; go on with --resume {}",
                found.chart.missing,
                found.folder.display()
            ));
        }
        charts.push(found);
        if !watcher.goes_on() {
            break;
        }
    }
    Ok((count, charts))
}

#[derive(Clone, Serialize, Deserialize)]
struct ChartCheckpoint {
    scene: PathBuf,
    settings: ChartSettings,
    #[serde(flatten)]
    state: ChartState,
}

/// A chart to be made: in a new folder, or in one that an earlier run has left.
struct ChartRun {
    saved: ChartCheckpoint,
    resumed: Option<RunDir<ChartCheckpoint>>,
    /// Path of a new folder, if one was given.
    out: Option<PathBuf>,
    /// Name of the scene among those of the command.
    name: String,
    /// File of the placements that are ranked.
    placements: Option<PathBuf>,
}

/// Charts of the request, one a scene.
fn begun(request: &ChartRequest, computing: &Computing<'_>) -> Result<Vec<ChartRun>, RunError> {
    if let Some(folder) = &request.resume {
        let (dir, saved) = RunDir::<ChartCheckpoint>::resume("chart", folder)?;
        let (resumed, out, name, placements) = (Some(dir), None, String::new(), None);
        return Ok(vec![ChartRun { saved, resumed, out, name, placements }]);
    }
    let Files { scenes, placements } = Files::sort(&request.files, computing.watcher)?;
    let settings = ChartSettings {
        given: match &placements {
            Some(file) => read_placements(file)?,
            None => table_7(),
        },
        random: request.random,
        objective: request.objective.parse()?,
        finest: request.finest,
        quick: request.quick,
        full: request.full,
        seed: request.seed,
        engine: computing.engine.clone(),
    };
    let stem = |scene: &PathBuf| scene.file_stem().unwrap_or_default().to_string_lossy().into();
    let stems: Vec<String> = scenes.iter().map(stem).collect();
    let names = safe_names(stems.iter().map(|stem| &**stem));
    let several = scenes.len() > 1;
    let begun = |(scene, name): (&PathBuf, String)| {
        let scene = std::path::absolute(scene).map_err(RunError::io(scene))?;
        let out =
            request.out.as_ref().map(|out| if several { out.join(&name) } else { out.clone() });
        let saved =
            ChartCheckpoint { scene, settings: settings.clone(), state: ChartState::default() };
        Ok(ChartRun { saved, resumed: None, out, name, placements: placements.clone() })
    };
    scenes.iter().zip(names).map(begun).collect()
}

/// The chart of one scene, its folder, and all of `chart.json`.
fn of_scene(
    begun: ChartRun,
    tolerance: f64,
    computing: &Computing<'_>,
) -> Result<Charted, RunError> {
    let watcher = computing.watcher;
    let ChartRun { mut saved, resumed, out, name, placements } = begun;
    let files = opening::files(&[saved.scene.clone()], &[], None, computing);
    let job = opening::job(&files, computing)?.job;
    let (scene, psog) = (job.scene().clone(), opening::psog(&job.scenes()[0], None, watcher)?);
    let sensors = scene.sensors()?;
    let mut ranked = std::mem::take(&mut saved.settings.given);
    match placements {
        Some(file) => {
            Given::new(&file, &sensors, &scene.rules(), computing).all(&mut ranked)?;
        }
        None => ranked = name_published(ranked, &sensors, computing)?,
    }
    saved.settings.given = ranked;
    let inputs = Input::of(scene.files())?;
    let dir = match resumed {
        Some(dir) => {
            dir.check(&inputs)?;
            dir
        }
        None => RunDir::create("chart", out.as_deref(), &format!("{name}-chart"), inputs)?,
    };
    let settings = ChartSettings { engine: computing.engine.clone(), ..saved.settings.clone() };
    let mut state = saved.state.clone();
    let sitting = ChartSession {
        dir: &dir,
        saved: &saved,
        bar: watcher.bar(MILLION, None),
        watcher,
        failed: RefCell::default(),
    };
    let found = chart(scene, psog, &settings, tolerance, &mut state, &sitting);
    let ChartSession { bar, failed, .. } = sitting;
    drop(bar);
    if let Some(error) = failed.into_inner() {
        return Err(error);
    }
    let found = found?;
    let answer = answer(&ChartCheckpoint { state, ..saved.clone() }, &found);
    write(&dir, &found, &answer)?;
    Ok(Charted { chart: found, folder: dir.path().to_owned(), answer })
}

/// Steps of the bar: the share of the work in millionths.
const MILLION: u64 = 1_000_000;

/// A chart under way, as its folder and the watcher see it.
struct ChartSession<'a> {
    dir: &'a RunDir<ChartCheckpoint>,
    saved: &'a ChartCheckpoint,
    bar: Box<dyn Bar>,
    watcher: &'a dyn Watcher,
    /// Why the state could not be written, which ends the chart.
    failed: RefCell<Option<RunError>>,
}

impl ChartObserver for ChartSession<'_> {
    fn begins(&self, number: usize, of: usize, setting: &str) {
        self.bar.say(format!("{number}/{of}: {setting}"));
    }

    fn progress(&self, share: f64) {
        self.bar.set((share * MILLION as f64) as u64, MILLION);
    }

    fn measured(&self, state: &ChartState) {
        if let Some(last) = state.measured.last() {
            self.watcher.detail(&format!("{} s", last.seconds));
        }
        let saved = ChartCheckpoint { state: state.clone(), ..self.saved.clone() };
        if let Err(error) = self.dir.save(&saved) {
            self.failed.replace(Some(error.into()));
        }
    }

    fn goes_on(&self) -> bool {
        self.watcher.goes_on() && self.failed.borrow().is_none()
    }
}

/// All of `chart.json`.
fn answer(saved: &ChartCheckpoint, found: &Chart) -> Value {
    let rows = found.rows();
    json!({
        "settings": saved.settings,
        "scene_file": saved.scene,
        "yardstick_seconds": saved.state.unit_seconds,
        "measured": saved.state.measured,
        "scene": found.scene,
        "placements": found.placements,
        "tolerance": found.tolerance,
        "threads": rayon::current_num_threads(),
        "reference": rows.first().map(|row| &row.setting),
        "rows": rows,
        "skipped": found.skipped,
        "left_out": found.left_out,
        "verdict": found.verdict,
        "words": chart_words(found),
        "finished": found.missing == 0,
    })
}

fn write(dir: &RunDir<ChartCheckpoint>, found: &Chart, answer: &Value) -> Result<(), RunError> {
    dir.write_text("chart.svg", &fidelity_svg(found))?;
    dir.write_text("chart.csv", &charts_csv(std::slice::from_ref(found), false))?;
    Ok(dir.write_json("chart.json", answer)?)
}
