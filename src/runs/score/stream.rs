//! Scores of a batch of placements in one scene, written as they are computed.

use std::cell::RefCell;
use std::io::Write;
use std::iter::Peekable;
use std::path::Path;
use std::time::Instant;

use serde::ser::{Error as _, SerializeMap, SerializeSeq};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::request::{BLOCK, ScoreRequest, write_coverage, write_out};
use crate::files::{LinePerElement, shared_folder, writable_file};
use crate::near_field::{FEW_PLACEMENTS, NearSite, add_self_hits, weighted};
use crate::report;
use crate::runs::given::Given;
use crate::runs::opening::{self, LoadTimes, Loaded, timings};
use crate::runs::{Bar, Computing, Error, Watcher};
use crate::scan::conditions::{in_words, under};
use crate::scene::Scene;
use crate::score::Scores;
use crate::search::Evaluator;
use crate::vehicle::{Placement, PlacementFileError, PlacementReader};

/// Scores the placements of a file, `total` of them if that is known.
pub(super) fn score(
    request: &ScoreRequest,
    computing: &Computing<'_>,
    scene: &Path,
    placements: &Path,
    total: u64,
    start: Instant,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let (scene, mut problem, mut times) =
        opening::problem(scene, request.frames, &request.conditions, computing)?;
    let building = Instant::now();
    if let Some(nats) = request.near_weight {
        problem = weighted(&scene, problem, nats)?;
    }
    if request.draw > 0 {
        let sensors = problem.sensors().with_seed(request.draw);
        problem = problem.with_sensors(sensors);
    }
    let evaluator = opening::evaluator(problem, computing)?;
    times.build += building.elapsed().as_secs_f64();
    let loaded = Loaded { scene, evaluator, times };
    opening::note_frames(&loaded.scene, request.frames, computing.watcher);
    if let Some(file) = &request.out {
        writable_file(file)?;
    }
    if let Some(folder) = &request.coverage_out {
        shared_folder(folder)?;
    }
    write_out(request, out, |path, out| {
        let reader = PlacementReader::open(placements)?.peekable();
        let bar = computing.watcher.bar(total, Some("placements"));
        let Loaded { scene, evaluator, times, .. } = loaded;
        let site = || NearSite::new(&scene, &evaluator.shared_problem());
        let near = request.near_field.then(site).transpose()?;
        let (scene, watcher) = (&scene, computing.watcher);
        let (count, bar) = (0, Some(bar));
        let given = Given::in_problem(placements, evaluator.problem(), watcher);
        let mut scoring = Scoring {
            request,
            scene,
            given,
            evaluator,
            near,
            reader,
            watcher,
            bar,
            total,
            count,
            times,
            start,
        };
        scoring.write(placements, path, out)
    })
}

/// Placements that are read, scored and handed on block by block.
struct Scoring<'a> {
    request: &'a ScoreRequest,
    scene: &'a Scene,
    given: Given<'a>,
    evaluator: Evaluator,
    /// Where the near field is asked for.
    near: Option<NearSite>,
    reader: Peekable<PlacementReader>,
    watcher: &'a dyn Watcher,
    /// Until the last placement is scored.
    bar: Option<Box<dyn Bar>>,
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
            self.bar = None;
            return Ok(None);
        }
        let block: Result<Vec<Placement>, _> = self.reader.by_ref().take(BLOCK).collect();
        let looked = |block: Vec<Placement>| self.given.look(&block).map(|()| block);
        let block = block.map_err(Error::from).and_then(looked);
        if block.is_err() && self.count > 0 && self.request.out.is_none() {
            // Of a stream only: a file was read to its end before.
            let count = self.count;
            let words = format!("only the scores of the first {count} placements were printed");
            self.watcher.note(&words);
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
        if let Some(folder) = &self.request.coverage_out {
            for placement in &block {
                write_coverage(folder, placement, self.evaluator.covered(placement)?)?;
            }
        }
        self.count += block.len() as u64;
        if let Some(bar) = &self.bar {
            bar.set(self.count, self.total.max(self.count));
        }
        Ok(Some(scores))
    }

    /// Seconds of each stage up to now.
    fn timings(&self) -> Value {
        timings(self.times, self.evaluator.backend().times(), self.start)
    }

    /// Says how fast it was.
    fn note_rate(&self) {
        self.given.finish();
        let seconds = self.start.elapsed().as_secs_f64() - self.times.load - self.times.build;
        let (count, frames) = (self.count, self.evaluator.problem().frame_count() as u64);
        self.watcher.note(&format!(
            "{count} placements × {frames} frame(s) in {seconds:.2} s: {:.1} placements × frames/s",
            (count * frames) as f64 / seconds
        ));
    }

    /// Writes all scores.
    fn write(&mut self, placements: &Path, path: &Path, out: &mut dyn Write) -> Result<(), Error> {
        // Before anything is written: what cannot be computed prints nothing.
        let Some(first) = self.next()? else {
            return Err(PlacementFileError::Empty { path: placements.to_owned() }.into());
        };
        let name = self.scene.name();
        match self.request.as_json {
            true => write_json(self, first, name, path, out)?,
            false => write_text(self, first, name, path, out)?,
        }
        self.note_rate();
        out.flush().map_err(Error::io(path))
    }
}

fn write_text(
    scoring: &mut Scoring,
    first: Vec<Scores>,
    scene: &str,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let problem = scoring.evaluator.problem();
    let (frames, beams) = (problem.frame_count(), problem.sensors().beams_in_words());
    let coverage = problem.coverage();
    let under = under(&in_words(&scoring.request.conditions));
    writeln!(out, "{scene}: {coverage} over {frames} frame(s), {beams} a LiDAR{under}")
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
fn write_json(
    scoring: &mut Scoring,
    first: Vec<Scores>,
    scene: &str,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let problem = scoring.evaluator.problem();
    let mut head = json!({
        "scene": scene,
        "backend": scoring.evaluator.backend().name(),
        "adapter": scoring.evaluator.backend().adapter(),
        "coverage": problem.coverage(),
        "frames": problem.frame_count(),
        "modelled": problem.modelled(),
        "threads": rayon::current_num_threads(),
    });
    if !scoring.request.conditions.is_empty() {
        head["conditions"] = json!(in_words(&scoring.request.conditions));
    }
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
