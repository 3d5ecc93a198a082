//! `score`: scores of a batch of placements, written as they are computed.

mod several;

use std::cell::RefCell;
use std::io::Write;
use std::iter::Peekable;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::internals::{
    LinePerElement, count_placements, shared_folder, writable_file, write_npy, write_whole,
};
use crate::near_field::{FEW_PLACEMENTS, NearSite, add_self_hits, weighted};
use crate::problem::{Problem, StageTimes};
use crate::report;
use crate::scene::Scene;
use crate::score::Scores;
use crate::search::Evaluator;
use crate::vehicle::{Placement, PlacementFileError, PlacementReader};
use indicatif::ProgressBar;
use serde::ser::{Error as _, SerializeMap, SerializeSeq};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::args::{Compute, Conditions, Format, parse_weight, whole};
use super::error::Error;
use super::exit::Exit;
use super::files::Files;
use super::load::{self, LoadTimes, Loaded};
use super::output::unless_closed;
use super::progress;

/// Placements that are read, scored and printed at a time.
const BLOCK: usize = 1024;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline score scenes/highway.json scenes/placements.json
  sightline score scenes/highway.json million.jsonl --format json --out scores.json
  sightline score scenes/highway.json scenes/residential.json scenes/placements.json")]
pub struct Args {
    /// Scene files, and placements: a .json document, or a .jsonl file with one placement a line, read as a
    /// stream; - is stdin. Several scenes share one LiDAR and mount, and get the mean beside each
    #[arg(value_name = "SCENE… PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Write the scores to this file instead of stdout
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the covered voxels of each placement to DIR/NAME.npy: u64 linear indices, rising; with
    /// several frames, voxels covered in at least one; of several scenes DIR/SCENE/NAME.npy
    #[arg(long, value_name = "DIR")]
    coverage_out: Option<PathBuf>,
    /// Average over this many frames, spread evenly over each scene [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Count W nats more in every voxel of ground within 10 m of the own body, as in `optimize`; one scene
    #[arg(long, value_name = "W", value_parser = parse_weight)]
    near_weight: Option<f64>,
    /// Score the near field, too: the share of the ground within 10 m, and within 3 m, of the own body with a hit close
    /// by; takes casts of its own
    #[arg(long)]
    near_field: bool,
    /// Draw of what is left to chance, of free phases and of the beams that come back through weather; the mean
    /// over several is the expectation; one scene
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<u64>)]
    draw: u64,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let (scenes, placements) = Files::with_placements(&args.files)?;
    // Everything that can be wrong is found before the first score is computed or printed; a pipe can
    // be read only once.
    let is_file = placements != Path::new("-") && placements.is_file();
    let total = if is_file { count_placements(&placements)? } else { 0 };
    let alone = [("--near-weight", args.near_weight.is_some()), ("--draw", args.draw > 0)];
    if let Some((option, _)) = alone.iter().find(|(_, given)| *given && scenes.len() > 1) {
        return Err(Error::Usage(format!("{option}: takes one scene")));
    }
    let [scene] = &scenes[..] else {
        several::run(args, &scenes, &placements, start)?;
        return Ok(Exit::Done);
    };
    let mut loaded = load::scene(scene, args.frames, &args.conditions.condition, &args.compute)?;
    if let Some(nats) = args.near_weight {
        let problem = loaded.evaluator.problem().clone();
        let problem = weighted(&loaded.scene, problem, nats)?;
        loaded.evaluator = load::evaluator(problem, &args.compute)?;
    }
    if args.draw > 0 {
        let problem = Problem::clone(loaded.evaluator.problem());
        let sensors = problem.sensors().with_seed(args.draw);
        loaded.evaluator = load::evaluator(problem.with_sensors(sensors), &args.compute)?;
    }
    load::note_frames(&loaded.scene, args.frames, args.compute.talk);
    if let Some(file) = &args.out {
        writable_file(file, loaded.inputs(&placements))?;
    }
    if let Some(folder) = &args.coverage_out {
        shared_folder(folder)?;
    }
    write_out(args, |path, out| print(args, loaded, &placements, total, start, path, out))?;
    Ok(Exit::Done)
}

/// Hands out the file of `--out`, which is whole at any time, or standard output.
fn write_out(
    args: &Args,
    print: impl FnOnce(&Path, &mut dyn Write) -> Result<(), Error>,
) -> Result<(), Error> {
    match &args.out {
        Some(path) => write_whole(path, |file| print(path, file)),
        None => unless_closed(print(Path::new("stdout"), &mut std::io::stdout().lock())),
    }
}

/// Placements that are read, scored and handed on block by block.
struct Scoring<'a> {
    args: &'a Args,
    scene: &'a Scene,
    evaluator: Evaluator,
    /// Where the near field is asked for.
    near: Option<NearSite>,
    reader: Peekable<PlacementReader>,
    bar: ProgressBar,
    /// Placements in all; 0 where that is not known.
    total: u64,
    /// Placements scored so far.
    count: u64,
    times: LoadTimes,
    start: Instant,
}

impl Scoring<'_> {
    /// Scores of the next placements, whose covered voxels are written if that was asked for; `None` at the
    /// end.
    fn next(&mut self) -> Result<Option<Vec<Scores>>, Error> {
        if self.reader.peek().is_none() {
            self.bar.finish_and_clear();
            return Ok(None);
        }
        let block: Result<Vec<Placement>, _> = self.reader.by_ref().take(BLOCK).collect();
        if block.is_err() && self.count > 0 && self.args.out.is_none() {
            // Of a stream only: a file was read to its end before.
            let count = self.count;
            let words = format!("only the scores of the first {count} placements were printed");
            self.args.compute.talk.note(words);
        }
        let block = block?;
        let mut scores = self.evaluator.scores(&block)?;
        if self.count == 0 && block.len() <= FEW_PLACEMENTS && self.reader.peek().is_none() {
            let problem = self.evaluator.shared_problem();
            let engine = self.evaluator.backend_mut();
            add_self_hits(self.scene, &problem, engine, block.iter().zip(&mut scores))?;
        }
        if let Some(site) = &self.near {
            site.score(self.evaluator.backend_mut(), block.iter().zip(&mut scores))?;
        }
        if let Some(folder) = &self.args.coverage_out {
            for placement in &block {
                write_coverage(folder, placement, self.evaluator.covered(placement)?)?;
            }
        }
        self.count += block.len() as u64;
        self.bar.set_length(self.total.max(self.count));
        self.bar.set_position(self.count);
        Ok(Some(scores))
    }

    /// Seconds of each stage up to now.
    fn timings(&self) -> Value {
        timings(self.times, self.evaluator.backend().times(), self.start)
    }

    /// Says how fast it was.
    fn note_rate(&self) {
        let seconds = self.start.elapsed().as_secs_f64() - self.times.load - self.times.build;
        let (count, frames) = (self.count, self.evaluator.problem().frame_count() as u64);
        self.args.compute.talk.note(format!(
            "{count} placements × {frames} frame(s) in {seconds:.2} s: {:.1} placements × frames/s",
            (count * frames) as f64 / seconds
        ));
    }
}

fn print(
    args: &Args,
    loaded: Loaded,
    placements: &Path,
    total: u64,
    start: Instant,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let Loaded { scene, evaluator, times, .. } = loaded;
    let reader = PlacementReader::open(placements)?.peekable();
    let bar = progress::bar(total, "placements", args.compute.talk);
    let site = || NearSite::new(&scene, &evaluator.shared_problem());
    let near = args.near_field.then(site).transpose()?;
    let mut scoring = Scoring {
        args,
        scene: &scene,
        evaluator,
        near,
        reader,
        bar,
        total,
        count: 0,
        times,
        start,
    };
    // Before anything is written: what cannot be computed prints nothing.
    let Some(first) = scoring.next()? else {
        return Err(PlacementFileError::Empty { path: placements.to_owned() }.into());
    };
    match args.format {
        Format::Json => print_json(&mut scoring, first, scene.name(), path, out)?,
        Format::Text => print_text(&mut scoring, first, scene.name(), path, out)?,
    }
    scoring.note_rate();
    out.flush().map_err(Error::io(path))
}

fn print_text(
    scoring: &mut Scoring,
    first: Vec<Scores>,
    scene: &str,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let problem = scoring.evaluator.problem();
    let (frames, beams) = (problem.frame_count(), problem.sensors().beams_in_words());
    let coverage = problem.coverage();
    writeln!(out, "{scene}: {coverage} over {frames} frame(s), {beams} a LiDAR")
        .and_then(|()| write!(out, "{}", report::scores_text(&first)))
        .map_err(Error::io(path))?;
    while let Some(block) = scoring.next()? {
        let text = report::scores_text(&block);
        let body = text.split_once('\n').map_or("", |(_, body)| body);
        write!(out, "{body}").map_err(Error::io(path))?;
    }
    Ok(())
}

/// One JSON object, written as the scores come; the timings follow them.
fn print_json(
    scoring: &mut Scoring,
    first: Vec<Scores>,
    scene: &str,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let problem = scoring.evaluator.problem();
    let head = json!({
        "scene": scene,
        "backend": scoring.evaluator.backend().name(),
        "adapter": scoring.evaluator.backend().adapter(),
        "coverage": problem.coverage(),
        "frames": problem.frame_count(),
        "modelled": problem.modelled(),
        "threads": rayon::current_num_threads(),
    });
    let stream = ScoreStream { scoring: RefCell::new(scoring), first, failed: RefCell::default() };
    let written = stream.write(&head, out);
    match (stream.failed.into_inner(), written) {
        (Some(error), _) => Err(error),
        (None, Ok(())) => Ok(()),
        (None, Err(error)) => Err(Error::io(path)(error.into())),
    }
}

/// Scores that are computed while they are written.
struct ScoreStream<'a, 'b> {
    scoring: RefCell<&'a mut Scoring<'b>>,
    first: Vec<Scores>,
    /// The reason why the stream ended early.
    failed: RefCell<Option<Error>>,
}

impl ScoreStream<'_, '_> {
    fn write(&self, head: &Value, out: &mut dyn Write) -> Result<(), serde_json::Error> {
        let mut json = serde_json::Serializer::with_formatter(&mut *out, LinePerElement::default());
        let mut object = json.serialize_map(None)?;
        for (key, value) in head.as_object().into_iter().flatten() {
            object.serialize_entry(key, value)?;
        }
        object.serialize_entry("scores", self)?;
        let scoring = self.scoring.borrow();
        let changes = scoring.evaluator.backend().changes();
        if !changes.is_empty() {
            object.serialize_entry("backend_changes", changes)?;
        }
        object.serialize_entry("timings", &scoring.timings())?;
        SerializeMap::end(object)?;
        out.write_all(b"\n").map_err(serde_json::Error::io)
    }
}

impl Serialize for ScoreStream<'_, '_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(None)?;
        self.first.iter().try_for_each(|scores| list.serialize_element(scores))?;
        loop {
            match self.scoring.borrow_mut().next() {
                Ok(Some(block)) => {
                    block.iter().try_for_each(|scores| list.serialize_element(scores))?;
                }
                Ok(None) => return list.end(),
                Err(error) => {
                    self.failed.replace(Some(error));
                    return Err(S::Error::custom("the placements end early"));
                }
            }
        }
    }
}

/// Writes the covered voxels of a placement, in rising order.
fn write_coverage(folder: &Path, placement: &Placement, covered: Vec<u64>) -> Result<(), Error> {
    let path = folder.join(format!("{}.npy", placement.name));
    write_whole(&path, |file| write_npy(file, covered).map_err(Error::io(&path)))
}

/// Seconds of loading, of each stage up to now, and of all since a start.
fn timings(load: LoadTimes, stages: StageTimes, start: Instant) -> Value {
    json!({
        "load": load.load,
        "build": load.build,
        "cast": stages.cast.as_secs_f64(),
        "cover": stages.cover.as_secs_f64(),
        "reduce": stages.reduce.as_secs_f64(),
        "total": start.elapsed().as_secs_f64(),
    })
}
