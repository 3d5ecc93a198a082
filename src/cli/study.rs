//! `sightline study`: questions that take many runs.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::internals::{Input, RunDir, holds_run, study_plot, study_text};
use crate::psog::Psog;
use crate::scene::Scene;
use crate::study::{
    Kind, Region, Row, StudyObserver, StudySettings, Table, mean_over_scenes, study,
};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::args::{Compute, Conditions, Format, Talk, at_least_one, whole};
use super::error::Error;
use super::exit::Exit;
use super::files::told_apart;
use super::interrupt::Interrupt;
use super::{load, near_field, progress};

/// A study of one table is a command of its own; all others name their kind.
pub enum Command {
    Make(Box<Args>),
    NearField(Box<near_field::Args>),
}

/// Name of the study that is a command.
const NEAR_FIELD: &str = "nearfield";

impl clap::FromArgMatches for Command {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        Ok(match matches.subcommand() {
            Some((NEAR_FIELD, matches)) => {
                Self::NearField(Box::new(near_field::Args::from_arg_matches(matches)?))
            }
            _ => Self::Make(Box::new(Args::from_arg_matches(matches)?)),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl clap::Args for Command {
    fn augment_args(command: clap::Command) -> clap::Command {
        let near = near_field::Args::augment_args(clap::Command::new(NEAR_FIELD))
            .about("Ground and poles near the vehicle: what is seen, what is blind, what hits the own body");
        Args::augment_args(command)
            .subcommand(near)
            .args_conflicts_with_subcommands(true)
            .subcommand_negates_reqs(true)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study lidars scenes/highway.json
  sightline study channels scenes/highway.json --sensor velodyne_vlp_32c.json --sensor os1_64.json
  sightline study loss scenes/highway.json scenes/residential.json
  sightline study regions scenes/residential.json --box crossing:10,-5,0,30,5,2
  sightline study nearfield scenes/highway.json --out near.svg
  sightline study transfer scenes/highway.json scenes/residential.json

A study writes study.json, table.csv and chart.svg into its folder. The same command goes on with an
interrupted one.")]
pub struct Args {
    /// What to study
    #[arg(value_parser = kinds())]
    kind: Kind,
    /// Scene files: `transfer` looks at all together, every other kind at one after the other
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Folder for the study, of several scenes one in it for each [default: studies/SCENE-KIND]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Score to maximize where placements are searched
    #[arg(long, default_value_t = StudySettings::default().objective.to_string())]
    objective: String,
    /// Placements that each search evaluates before swaps
    #[arg(long, value_name = "N", default_value_t = StudySettings::default().evaluations,
          value_parser = at_least_one)]
    evaluations: u64,
    /// Frames to average over, spread evenly [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Random placements, where the study draws some
    #[arg(long, value_name = "N", default_value_t = StudySettings::default().random,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    random: u32,
    /// Sensor file to compare, for `channels`; may be given several times
    #[arg(long, value_name = "FILE")]
    sensor: Vec<PathBuf>,
    /// Further region, for `regions`: NAME:x0,y0,z0,x1,y1,z1 in metres; may be given several times
    #[arg(long = "box", value_name = "BOX", value_parser = parse_box)]
    boxes: Vec<Region>,
    /// Edge of a voxel in metres, for `published` [default: 0.1, as in the paper]
    #[arg(long, value_name = "M", value_parser = parse_length)]
    voxel: Option<f64>,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = StudySettings::default().seed,
          value_parser = whole::<u64>)]
    seed: u64,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    compute: Compute,
}

fn kinds() -> impl TypedValueParser<Value = Kind> {
    let values = Kind::ALL.map(|(_, name, answers)| PossibleValue::new(name).help(answers));
    PossibleValuesParser::new(values).try_map(|name| Kind::from_str(&name))
}

pub fn run(command: &Command) -> Result<Exit, Error> {
    match command {
        Command::Make(args) => make(args),
        Command::NearField(args) => near_field::run(args),
    }
}

fn make(args: &Args) -> Result<Exit, Error> {
    args.compute.start()?;
    let settings = settings(args)?;
    let interrupt = Interrupt::listen(args.compute.talk);
    // What needs several scenes looks at them together; all other kinds at one after the other.
    let together = args.kind == Kind::Transfer || args.scenes.len() == 1;
    if together {
        args.kind.check_scenes(args.scenes.len())?;
    }
    let each: Vec<&[PathBuf]> =
        if together { vec![&args.scenes] } else { args.scenes.chunks(1).collect() };
    let stems = each.iter().map(|scenes| stem(&scenes[0]));
    let (folders, mut tables) = (told_apart(stems), Vec::new());
    for (scenes, name) in each.iter().zip(&folders) {
        let folder = match &args.out {
            Some(out) if together => out.clone(),
            Some(out) => out.join(name),
            None => PathBuf::from("studies").join(format!("{name}-{}", args.kind.name())),
        };
        let found = of_scenes(args, scenes, &settings, &folder, &interrupt)?;
        if args.format == Format::Text {
            outln!("{}{}", if tables.is_empty() { "" } else { "\n" }, found.title)?;
            out!("{}", study_text(&found))?;
            outln!("\n{}: study.json, table.csv, chart.svg", folder.display())?;
        }
        tables.push(found);
        if interrupt.is_set() {
            break;
        }
    }
    print(args, &tables)?;
    if interrupt.is_set() {
        args.compute.talk.note("interrupted; the same command goes on");
        return Ok(Exit::Interrupted);
    }
    Ok(Exit::Done)
}

/// What comes after the tables of the scenes: their mean, and all of it in JSON.
fn print(args: &Args, tables: &[Table]) -> Result<(), Error> {
    let mean = if tables.len() > 1 { mean_over_scenes(tables) } else { None };
    match (args.format, tables) {
        (Format::Json, [table]) => outln!("{}", json!(table)),
        (Format::Json, tables) => outln!("{}", json!({ "scenes": tables, "mean": mean })),
        (Format::Text, _) => match mean {
            Some(mean) => outln!("\n{}\n{}", mean.title, study_text(&mean).trim_end()),
            None => Ok(()),
        },
    }
}

fn stem(scene: &Path) -> String {
    scene.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The study of one scene, or of several together, in its folder.
fn of_scenes(
    args: &Args,
    paths: &[PathBuf],
    settings: &StudySettings,
    folder: &Path,
    interrupt: &Interrupt,
) -> Result<Table, Error> {
    let talk = args.compute.talk;
    let mut scenes = Vec::new();
    for path in paths {
        let (scene, psog, _) = load::scene_and_psog(path, &args.compute)?;
        load::note_frames(&scene, args.frames, talk);
        scenes.push((scene, psog));
    }
    let recorded = recorded(args, paths, settings)?;
    let (dir, mut known) = open_folder(folder, &recorded)?;
    let session = Session {
        dir: &dir,
        recorded: &recorded,
        interrupt,
        bar: progress::bar(0, "cases", talk),
        talk,
        is_named: Cell::new(false),
        failed: RefCell::default(),
    };
    let borrowed: Vec<(&Scene, &Psog)> = scenes.iter().map(|(s, p)| (s, &**p)).collect();
    let found = study(args.kind, &borrowed, settings, &mut known, &session);
    session.bar.finish_and_clear();
    if let Some(error) = session.failed.take() {
        return Err(error);
    }
    let found = found?;
    session.finish(&known, &found)?;
    Ok(found)
}

fn settings(args: &Args) -> Result<StudySettings, Error> {
    let standard = StudySettings::default();
    Ok(StudySettings {
        objective: args.objective.parse()?,
        evaluations: args.evaluations,
        frames: args.frames.unwrap_or(standard.frames),
        random: args.random,
        voxel: args.voxel.unwrap_or(standard.voxel),
        seed: args.seed,
        sensors: args.sensor.clone(),
        regions: args.boxes.clone(),
        conditions: args.conditions.condition.clone(),
        engine: args.compute.engine(),
    })
}

/// All that decides about the numbers of a study, and the files that it reads.
struct Recorded {
    settings: Value,
    inputs: Vec<Input>,
}

/// The state of a study: an interrupted one goes on from it.
#[derive(Serialize, Deserialize)]
struct Saved {
    settings: Value,
    rows: Vec<Row>,
}

/// The folder of a study and the rows that it holds; one that holds another study is an error.
fn open_folder(folder: &Path, recorded: &Recorded) -> Result<(RunDir<Saved>, Vec<Row>), Error> {
    if !holds_run(folder) {
        let dir = RunDir::create("study", Some(folder), "", recorded.inputs.clone())?;
        return Ok((dir, Vec::new()));
    }
    let (dir, saved): (RunDir<Saved>, Saved) = RunDir::resume("study", folder)?;
    if saved.settings != recorded.settings {
        return Err(Error::Usage(format!(
            "{}: holds a study of other settings; name another folder with --out",
            folder.display()
        )));
    }
    dir.check(&recorded.inputs)?;
    Ok((dir, saved.rows))
}

/// A study under way, as its folder, the terminal and Ctrl-C see it.
struct Session<'a> {
    dir: &'a RunDir<Saved>,
    recorded: &'a Recorded,
    interrupt: &'a Interrupt,
    bar: ProgressBar,
    talk: Talk,
    /// Whether the engine was named: engines are opened again and again.
    is_named: Cell<bool>,
    /// Why the rows could not be written, which ends the study.
    failed: RefCell<Option<Error>>,
}

impl StudyObserver for Session<'_> {
    fn begins(&self, cases: usize) {
        self.bar.set_length(cases as u64);
    }

    fn opened(&self, notes: &[String]) {
        if !self.is_named.replace(true) {
            notes.iter().for_each(|note| self.talk.note(note));
        }
    }

    fn measured(&self, rows: &[Row]) {
        let saved = Saved { settings: self.recorded.settings.clone(), rows: rows.to_vec() };
        if let Err(error) = self.dir.save(&saved) {
            self.failed.replace(Some(error.into()));
        }
    }

    fn done(&self) {
        self.bar.inc(1);
    }

    fn goes_on(&self) -> bool {
        !self.interrupt.is_set() && self.failed.borrow().is_none()
    }
}

impl Session<'_> {
    /// Writes the table and its chart, with the cases there are.
    fn finish(&self, rows: &[Row], found: &Table) -> Result<(), Error> {
        let Recorded { settings, inputs } = self.recorded;
        let notes = &found.notes;
        let study = json!({ "settings": settings, "inputs": inputs, "rows": rows, "notes": notes });
        self.dir.write_json("study.json", &study)?;
        self.dir.write_text("table.csv", &found.csv())?;
        Ok(self.dir.write_text("chart.svg", &study_plot(found).svg())?)
    }
}

fn recorded(args: &Args, scenes: &[PathBuf], settings: &StudySettings) -> Result<Recorded, Error> {
    let absolute = |paths: &[PathBuf]| -> Result<Vec<PathBuf>, Error> {
        paths.iter().map(|p| std::path::absolute(p).map_err(Error::io(p))).collect()
    };
    let mut inputs = Vec::new();
    for scene in scenes {
        inputs.extend(Input::of(&Scene::read(scene)?)?);
    }
    for sensor in &args.sensor {
        inputs.push(Input::read(sensor)?);
    }
    let mut settings = json!({
        "sightline": env!("CARGO_PKG_VERSION"),
        "study": args.kind.name(),
        "scenes": absolute(scenes)?,
        "objective": args.objective,
        "evaluations": args.evaluations,
        "frames": settings.frames,
        "random": args.random,
        "sensors": absolute(&args.sensor)?,
        "boxes": args.boxes.iter().map(|region| format!("{region:?}")).collect::<Vec<_>>(),
        "voxel": args.voxel,
        "seed": args.seed,
    });
    if !args.conditions.condition.is_empty() {
        let conditions: Vec<String> =
            args.conditions.condition.iter().map(|condition| condition.to_string()).collect();
        settings["conditions"] = json!(conditions);
    }
    Ok(Recorded { settings, inputs })
}

fn parse_box(text: &str) -> Result<Region, String> {
    let wrong = || {
        format!("`{text}` is no box; write NAME:x0,y0,z0,x1,y1,z1 in metres, lower corner first")
    };
    let (name, numbers) = text.split_once(':').ok_or_else(wrong)?;
    let numbers: Vec<f64> = numbers
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| wrong()))
        .collect::<Result<_, _>>()?;
    let [x0, y0, z0, x1, y1, z1] = numbers[..] else { return Err(wrong()) };
    if name.is_empty() || !(x0 < x1 && y0 < y1 && z0 < z1) {
        return Err(wrong());
    }
    Ok(Region::of_box(name, [x0, y0, z0], [x1, y1, z1]))
}

fn parse_length(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is no length; write metres, as 0.1");
    text.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite()).ok_or_else(wrong)
}
