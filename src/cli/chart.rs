//! `sightline chart`: cost against accuracy, and the cheapest setting that keeps the ranking.

mod print;

use std::cell::RefCell;
use std::path::PathBuf;

use crate::chart::{Chart, ChartObserver, ChartSettings, ChartState, chart};
use crate::internals::{ChartFrame, Input, RunDir, chart_words, fidelity_csv, fidelity_svg};
use crate::vehicle::{read_placements, table_7};
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::args::{Compute, Format, Talk, whole};
use super::error::Error;
use super::exit::Exit;
use super::files::{Files, told_apart};
use super::interrupt::Interrupt;
use super::{load, progress};
use print::{print, print_summary};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline chart scenes/urban-crossing.json --out runs/chart
  sightline chart scenes/highway.json --quick --objective information_gain
  sightline chart scenes/highway.json scenes/residential.json --quick
  sightline chart --resume runs/chart")]
pub struct Args {
    /// Scene files, and placements to rank together with random ones [default: Table 7 of the paper]
    #[arg(
        value_name = "SCENE… [PLACEMENTS]",
        required_unless_present = "resume",
        conflicts_with = "resume"
    )]
    files: Vec<PathBuf>,
    /// Folder for chart.svg, chart.csv and chart.json, of several scenes one in it for each
    /// [default: runs/SCENE-chart, numbered if it is taken]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with an interrupted run; settings that were measured are kept
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Score that ranks the placements, or a weighted sum of several
    #[arg(long, default_value_t = ChartSettings::default().objective.to_string(),
          conflicts_with = "resume")]
    objective: String,
    /// Random placements within the mount, ranked together with the given ones
    #[arg(long = "placements", value_name = "N", default_value_t = 100, conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(0..=2_000))]
    random: u32,
    /// How much worse than the best placement that of a coarser setting may be, as a share of the score;
    /// pairs of placements farther apart than that must keep their order, 19 of 20 of them
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    tolerance: f64,
    /// Edge of the finest voxels in metres, which all other settings are compared with
    /// [default: half of the scene's, where that is 0.1 or more; with --quick the scene's]
    #[arg(long, value_name = "METRES", conflicts_with = "resume", value_parser = metres)]
    finest: Option<f64>,
    /// Fewer combinations and repeats, and no voxels finer than the scene's
    #[arg(long, conflicts_with = "resume")]
    quick: bool,
    /// Seed of the random placements and of the bootstrap
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>, conflicts_with = "resume")]
    seed: u64,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number, as in 0.01".to_owned())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err("give 0 to 1, as in 0.01".into()) }
}

fn metres(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number, as in 0.1".to_owned())?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("give metres above 0".into()) }
}

/// All that a chart goes on from.
#[derive(Clone, Serialize, Deserialize)]
struct Saved {
    scene: PathBuf,
    settings: ChartSettings,
    #[serde(flatten)]
    state: ChartState,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    args.compute.start()?;
    let stop = Interrupt::listen(args.compute.talk);
    let begun = begun(args)?;
    let count = begun.len();
    let (mut charts, mut answers, mut missing) = (Vec::new(), Vec::new(), 0);
    for begun in begun {
        let (found, dir, answer) = of_scene(args, begun, &stop)?;
        if args.format == Format::Text {
            out!("{}", if charts.is_empty() { "" } else { "\n" })?;
            print(&found)?;
            outln!("chart: {}", dir.join("chart.svg").display())?;
        }
        if found.missing > 0 {
            args.compute.talk.note(format!(
                "interrupted with {} settings to go; go on with --resume {}",
                found.missing,
                dir.display()
            ));
        }
        missing += found.missing;
        charts.push(found);
        answers.push(answer);
        if stop.is_set() {
            break;
        }
    }
    match (args.format, &answers[..]) {
        (Format::Json, [answer]) if count == 1 => outln!("{answer}")?,
        (Format::Json, answers) => outln!("{}", json!({ "scenes": answers }))?,
        (Format::Text, [_]) => {}
        (Format::Text, _) => print_summary(&charts)?,
    }
    let is_finished = missing == 0 && charts.len() == count;
    Ok(if is_finished { Exit::Done } else { Exit::Interrupted })
}

/// A chart to be made: in a new folder, or in one that an earlier run has left.
struct Begun {
    saved: Saved,
    resumed: Option<RunDir<Saved>>,
    /// Where a new folder is to be, if it was said.
    out: Option<PathBuf>,
    /// Name of the scene among those of the command.
    name: String,
}

/// The charts that are asked for, one a scene.
fn begun(args: &Args) -> Result<Vec<Begun>, Error> {
    if let Some(folder) = &args.resume {
        let (dir, saved) = RunDir::<Saved>::resume("chart", folder)?;
        return Ok(vec![Begun { saved, resumed: Some(dir), out: None, name: String::new() }]);
    }
    let Files { scenes, placements } = Files::sort(&args.files)?;
    let settings = ChartSettings {
        given: match &placements {
            Some(file) => read_placements(file)?,
            None => table_7(),
        },
        random: args.random,
        objective: args.objective.parse()?,
        finest: args.finest,
        quick: args.quick,
        seed: args.seed,
        engine: args.compute.engine(),
    };
    let stem = |scene: &PathBuf| scene.file_stem().unwrap_or_default().to_string_lossy().into();
    let names = told_apart(scenes.iter().map(stem));
    let several = scenes.len() > 1;
    let begun = |(scene, name): (&PathBuf, String)| {
        let scene = std::path::absolute(scene).map_err(Error::io(scene))?;
        let out = args.out.as_ref().map(|out| if several { out.join(&name) } else { out.clone() });
        let saved = Saved { scene, settings: settings.clone(), state: ChartState::default() };
        Ok(Begun { saved, resumed: None, out, name })
    };
    scenes.iter().zip(names).map(begun).collect()
}

/// The chart of one scene, its folder, and all of `chart.json`.
fn of_scene(args: &Args, begun: Begun, stop: &Interrupt) -> Result<(Chart, PathBuf, Value), Error> {
    let talk = args.compute.talk;
    let Begun { saved, resumed, out, name } = begun;
    let (scene, psog, _) = load::scene_and_psog(&saved.scene, &args.compute)?;
    let inputs = Input::of(&scene)?;
    let dir = match resumed {
        Some(dir) => {
            dir.check(&inputs)?;
            dir
        }
        None => RunDir::create("chart", out.as_deref(), &format!("{name}-chart"), inputs)?,
    };
    let settings = ChartSettings { engine: args.compute.engine(), ..saved.settings.clone() };
    let mut state = saved.state.clone();
    let sitting = Sitting {
        dir: &dir,
        saved: &saved,
        stop: stop.clone(),
        bar: progress::share(MILLION, talk),
        talk,
        failed: RefCell::default(),
    };
    let found = chart(scene, psog, &settings, args.tolerance, &mut state, &sitting);
    sitting.bar.finish_and_clear();
    if let Some(error) = sitting.failed.take() {
        return Err(error);
    }
    let found = found?;
    let answer = answer(&Saved { state, ..saved.clone() }, &found);
    write(&dir, &found, &answer)?;
    Ok((found, dir.path().to_owned(), answer))
}

/// Steps of the bar: the share of the work in millionths.
const MILLION: u64 = 1_000_000;

/// A chart under way, as its folder, the terminal and Ctrl-C see it.
struct Sitting<'a> {
    dir: &'a RunDir<Saved>,
    saved: &'a Saved,
    stop: Interrupt,
    bar: ProgressBar,
    talk: Talk,
    /// Why the state could not be written, which ends the chart.
    failed: RefCell<Option<Error>>,
}

impl ChartObserver for Sitting<'_> {
    fn begins(&self, number: usize, of: usize, setting: &str) {
        self.bar.set_message(format!("{number}/{of}: {setting}"));
    }

    fn progress(&self, share: f64) {
        self.bar.set_position((share * MILLION as f64) as u64);
    }

    fn measured(&self, state: &ChartState) {
        if let Some(last) = state.measured.last() {
            self.talk.detail(format!("{} s", last.seconds));
        }
        let saved = Saved { state: state.clone(), ..self.saved.clone() };
        if let Err(error) = self.dir.save(&saved) {
            self.failed.replace(Some(error.into()));
        }
    }

    fn goes_on(&self) -> bool {
        !self.stop.is_set() && self.failed.borrow().is_none()
    }
}

/// All of `chart.json`.
fn answer(saved: &Saved, found: &Chart) -> Value {
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
        "left_out": found.left_out,
        "verdict": found.verdict,
        "words": chart_words(found),
        "finished": found.missing == 0,
    })
}

fn write(dir: &RunDir<Saved>, found: &Chart, answer: &Value) -> Result<(), Error> {
    let frame = ChartFrame {
        title: &format!(
            "{}: {} placements ranked by {}",
            found.scene,
            found.placements.len(),
            found.objective
        ),
        edge: found.edge,
        chosen: found.verdict.map(|verdict| verdict.setting),
    };
    dir.write_text("chart.svg", &fidelity_svg(&found.rated, &frame))?;
    dir.write_text("chart.csv", &fidelity_csv(&found.rated, found.edge))?;
    Ok(dir.write_json("chart.json", answer)?)
}
