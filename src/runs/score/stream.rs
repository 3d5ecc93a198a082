//! Scores of a batch of placements in one scene, written as they are computed.

use std::collections::HashSet;
use std::io::Write;
use std::iter::Peekable;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::ser::{CompactFormatter, Formatter};
use serde_json::{Map, Value, json};

use super::journal::Journal;
use super::listed::{listed, not_looked_closely};
use super::rigs::{RigFiles, RigReader};
use super::{BLOCK, ScoreRequest, interrupted, write_coverage, write_out, write_table};
use crate::csv::csv;
use crate::files::{
    FileError, LinePerElement, is_sink, shared_folder, sync_disk, target, writable_file,
};
use crate::job::Job;
use crate::json::counted;
use crate::near_field::{FEW_PLACEMENTS, NearSite};
use crate::report;
use crate::report::run_tables::{
    requirements_of, rows_with_requirements, titles_with_requirements,
};
use crate::runs::inputs::Given;
use crate::runs::opening::{LoadTimes, Loaded, note_relief, timings};
use crate::runs::{Bar, Computing, GRACE, RunError, TableFormat, Watcher, outputs};
use crate::scan::conditions::{in_words, under};
use crate::score::Scores;
use crate::search::Evaluator;
use crate::vehicle::{Placement, PlacementFileError, SensorName};

/// Placements that are scored in one go at first.
const FEWEST: usize = 32;
/// Time of a go after which the next one takes twice as many.
const SHORT: Duration = Duration::from_millis(250);

/// Scores the placements of a file, `total` of them if that is known.
pub(super) fn score(
    request: &ScoreRequest,
    computing: &Computing<'_>,
    scene: &Path,
    placements: &RigFiles,
    total: u64,
    start: Instant,
    out: &mut dyn Write,
) -> Result<bool, RunError> {
    let Loaded { job, times } = super::open(request, &[scene.to_owned()], computing)?;
    let mut loaded =
        Loaded { job: job.draw(request.draw).tolerance(Some(request.mounting.tolerance)), times };
    let evaluator = loaded.evaluator(computing)?;
    note_relief(&loaded.job, computing.watcher)?;
    let scene = loaded.job.scene().clone();
    if let Some(file) = &request.out {
        writable_file(file)?;
        outputs::check_table(file, request.format)?;
    }
    if let Some(folder) = &request.coverage_out {
        shared_folder(folder)?;
    }
    let journal = match (&request.out, placements.only()) {
        (Some(file), Some(only)) if !is_sink(&target(file)?) => {
            Some(Journal::open(file, request, &scene, only)?)
        }
        _ if request.resume => {
            return Err(RunError::Usage(
                "--resume: goes on with the scores of a file of placements in a file; give both, and --out".into(),
            ));
        }
        _ => None,
    };
    match (journal, &request.out) {
        (Some(journal), Some(out_file)) => {
            computing.watcher.listen(GRACE);
            match scoring(request, computing, loaded, evaluator, placements, total, start) {
                Ok(scoring) => scoring.into_file(journal, out_file),
                Err(error) => {
                    journal.remove();
                    Err(error)
                }
            }
        }
        _ => {
            let mut is_met = true;
            write_out(request, out, |path, out| {
                let scoring =
                    scoring(request, computing, loaded, evaluator, placements, total, start)?;
                is_met = scoring.into_writer(path, out)?;
                Ok(())
            })?;
            Ok(is_met)
        }
    }
}

/// Scoring of placements that are about to be read.
fn scoring<'a>(
    request: &'a ScoreRequest,
    computing: &Computing<'a>,
    loaded: Loaded,
    evaluator: Evaluator,
    placements: &'a RigFiles,
    total: u64,
    start: Instant,
) -> Result<Scoring<'a>, RunError> {
    let watcher = computing.watcher;
    let reader = placements.reader()?.peekable();
    let site = || NearSite::new(loaded.job.scene(), &evaluator.shared_problem());
    let near = request.near_field.then(site).transpose()?;
    let bar = Some(watcher.bar(total, Some("placements")));
    let given = Given::in_problem(placements.label(), evaluator.problem(), computing);
    let (Loaded { job, times }, count) = (loaded, 0);
    Ok(Scoring {
        request,
        placements: placements.label(),
        job,
        given,
        evaluator,
        near,
        reader,
        watcher,
        bar,
        total,
        count,
        used: HashSet::new(),
        prices: Vec::new(),
        below: String::new(),
        table: String::new(),
        is_looked_at: false,
        at_once: FEWEST,
        is_stopped: false,
        is_met: false,
        times,
        start,
    })
}

pub(super) fn models_of(placements: &[Placement]) -> impl Iterator<Item = SensorName> {
    placements.iter().flat_map(|placement| &placement.lidars).map(|pose| pose.sensor)
}

/// Placements that are read, scored and handed on block by block.
struct Scoring<'a> {
    request: &'a ScoreRequest,
    placements: &'a Path,
    job: Job,
    given: Given<'a>,
    evaluator: Evaluator,
    /// Where the near field is asked for.
    near: Option<NearSite>,
    reader: Peekable<RigReader>,
    watcher: &'a dyn Watcher,
    /// Until the last placement is scored.
    bar: Option<Box<dyn Bar>>,
    /// Placements in all; 0 where that is not known.
    total: u64,
    count: u64,
    /// Models of the placements so far.
    used: HashSet<SensorName>,
    /// Prices of the placements of the last block; empty where no sensor has one.
    prices: Vec<f64>,
    /// Text below the scores of few placements.
    below: String,
    /// All scores so far as CSV, where a folder is given for it.
    table: String,
    /// True if the placements are few enough to be looked at closely.
    is_looked_at: bool,
    /// Placements that are scored in one go.
    at_once: usize,
    /// True if the watcher ended the work within a block.
    is_stopped: bool,
    /// True once a placement meets all requirements, or there are none.
    is_met: bool,
    times: LoadTimes,
    start: Instant,
}

impl Scoring<'_> {
    /// Scores of the next placements, whose covered voxels are written if that was asked for; `None` at the
    /// end.
    fn next(&mut self) -> Result<Option<Vec<Scores>>, RunError> {
        if self.reader.peek().is_none() {
            self.bar = None;
            return Ok(None);
        }
        let block: Result<Vec<Placement>, RunError> = self.reader.by_ref().take(BLOCK).collect();
        let looked = |mut block: Vec<Placement>| self.given.look(&mut block).map(|()| block);
        let block = block.and_then(looked);
        if block.is_err() && self.count > 0 && self.request.out.is_none() {
            // Streams only: a file was read to its end before.
            let count = self.count;
            let words = format!("only the scores of the first {count} placements were printed");
            self.watcher.note(&words);
        }
        let block = block?;
        if self.reader.peek().is_none() {
            self.given.check_choices()?;
        }
        self.used.extend(models_of(&block));
        let Some(mut scores) = self.scores(&block)? else {
            self.is_stopped = true;
            return Ok(None);
        };
        if self.count == 0 && block.len() <= FEW_PLACEMENTS && self.reader.peek().is_none() {
            let all = block.iter().zip(&mut scores);
            self.job.look_closely(self.evaluator.backend_mut(), all)?;
            self.below = report::rigs_text(self.job.scene().vehicle(), &block, &scores);
            self.is_looked_at = true;
        } else if self.count == 0 {
            let ends_at_hits = self.evaluator.problem().ends_at_hits();
            let note = not_looked_closely(ends_at_hits, scores.first());
            note.iter().for_each(|note| self.watcher.note(note));
        }
        let (vehicle, rules) = (self.job.scene().vehicle(), self.evaluator.problem().rules());
        self.prices = super::prices_of(vehicle, &block);
        for (placement, scores) in block.iter().zip(&mut scores) {
            scores.broken_rules = vehicle.broken_rules(rules, placement);
        }
        self.is_met |= scores.iter().any(super::meets);
        if let Some(site) = &self.near {
            site.score(self.evaluator.backend_mut(), block.iter().zip(&mut scores))?;
        }
        if let Some(folder) = &self.request.coverage_out {
            for placement in &block {
                let covered = self.evaluator.covered(placement)?;
                write_coverage(folder, placement, covered, self.request.resume)?;
            }
        }
        if self.request.figures.figures.is_some() {
            self.table += &self.csv(&scores, self.count == 0);
        }
        self.count += block.len() as u64;
        if let Some(bar) = &self.bar {
            bar.set(self.count, self.total.max(self.count));
        }
        Ok(Some(scores))
    }

    /// Scores of a block, computed a few placements at a time where they take long; `None` where the watcher ends the
    /// work in between.
    fn scores(&mut self, block: &[Placement]) -> Result<Option<Vec<Scores>>, RunError> {
        let mut scores = Vec::with_capacity(block.len());
        while scores.len() < block.len() {
            if self.request.out.is_some() && !self.watcher.goes_on() {
                return Ok(None);
            }
            let begin = Instant::now();
            let rest = &block[scores.len()..];
            scores.extend(self.evaluator.scores(&rest[..rest.len().min(self.at_once)])?);
            if begin.elapsed() < SHORT {
                self.at_once = (2 * self.at_once).min(BLOCK);
            }
        }
        Ok(Some(scores))
    }

    fn timings(&self) -> Value {
        timings(self.times, self.evaluator.backend().times(), self.start)
    }

    fn write_table(&mut self) -> Result<(), RunError> {
        let table = std::mem::take(&mut self.table);
        write_table(self.request, || table, self.watcher)
    }

    fn note_rate(&self) {
        self.given.finish();
        let seconds = self.start.elapsed().as_secs_f64() - self.times.load - self.times.build;
        let (count, frames) = (self.count as usize, self.evaluator.problem().frame_count());
        self.watcher.note(&format!(
            "{} × {} in {seconds:.2} s: {:.1} placements × frames/s",
            counted(count, "placement"),
            counted(frames, "frame"),
            (count * frames) as f64 / seconds
        ));
    }

    /// Writes all scores to the caller's writer, as they are computed. False where no placement meets all requirements.
    fn into_writer(mut self, path: &Path, out: &mut dyn Write) -> Result<bool, RunError> {
        let mut first = true;
        let in_file = self.request.out.is_some();
        if in_file {
            self.watcher.listen(GRACE);
        }
        while let Some(scores) = self.next()? {
            if in_file && !self.watcher.goes_on() {
                return Err(interrupted(self.request, self.count, self.total));
            }
            // Not before: an input whose scores cannot be computed prints nothing.
            let head = if first { self.head()? } else { String::new() };
            let text = head + &self.text(&scores, first)?;
            out.write_all(text.as_bytes()).map_err(RunError::io(path))?;
            first = false;
        }
        if self.is_stopped {
            return Err(interrupted(self.request, self.count, self.total));
        }
        self.check(first)?;
        out.write_all(self.tail()?.as_bytes()).map_err(RunError::io(path))?;
        out.flush().map_err(RunError::io(path))?;
        self.write_table()?;
        self.note_rate();
        Ok(self.is_met)
    }

    /// Writes all scores to a file. The journal keeps those so far where the watcher ends the work or the disk is full.
    /// False where no placement meets all requirements.
    fn into_file(mut self, mut journal: Journal, out: &Path) -> Result<bool, RunError> {
        let scored = self
            .fill(&mut journal)
            .and_then(|()| self.check(journal.scored == 0 && !self.is_stopped));
        match scored {
            Ok(()) if self.is_stopped || self.reader.peek().is_some() => {
                let (scored, all) = (journal.scored, self.total);
                let kept = journal.leave()?.map_or(String::new(), |path| {
                    format!(", kept in {}; the same command with --resume goes on", path.display())
                });
                self.watcher.note(&format!("interrupted after {scored} of {all} placements{kept}"));
                Ok(true)
            }
            Ok(()) => {
                let (head, tail) = (self.head()?, self.tail()?);
                if let Some(folder) = &self.request.coverage_out {
                    sync_disk(folder);
                }
                journal.finish(out, &head, &tail)?;
                self.write_table()?;
                self.note_rate();
                Ok(self.is_met)
            }
            Err(error) => {
                match &error {
                    RunError::Library(crate::Error::File(_)) => drop(journal.leave()?),
                    _ => journal.remove(),
                }
                Err(error)
            }
        }
    }

    /// Adds the scores that the journal lacks, as long as the watcher lets it.
    fn fill(&mut self, journal: &mut Journal) -> Result<(), RunError> {
        for _ in 0..journal.scored {
            let known = self.reader.next().transpose()?;
            self.used.extend(models_of(known.as_slice()));
        }
        (self.count, self.is_met) = (journal.scored, journal.is_met);
        while self.watcher.goes_on() {
            let first = journal.scored == 0;
            let Some(scores) = self.next()? else { break };
            journal.push(self.count, self.is_met, &self.text(&scores, first)?)?;
        }
        Ok(())
    }

    /// Refuses a file without any placement.
    fn check(&mut self, is_empty: bool) -> Result<(), RunError> {
        match is_empty && self.reader.peek().is_none() {
            true => Err(PlacementFileError::empty(self.placements).into()),
            false => Ok(()),
        }
    }

    fn head(&self) -> Result<String, RunError> {
        let problem = self.evaluator.problem();
        let (scene, frames) = (self.job.scene().name(), problem.frame_count());
        let coverage = problem.coverage();
        if self.request.format == TableFormat::Csv {
            return Ok(String::new());
        }
        if self.request.format == TableFormat::Text {
            let beams = problem.sensors().beams_in_words(&self.used);
            let under = under(&in_words(&self.request.conditions.condition));
            return Ok(format!(
                "{scene}: {coverage} over {}, {beams} a LiDAR{under}\n",
                counted(frames, "frame")
            ));
        }
        let engine = self.evaluator.backend();
        let mut head = json!({
            "scene": scene,
            "backend": engine.name(),
            "adapter": engine.adapter(),
            "coverage": coverage,
            "frames": frames,
            "modelled": problem.modelled(),
            "threads": rayon::current_num_threads(),
        });
        if !self.request.conditions.condition.is_empty() {
            head["conditions"] = json!(in_words(&self.request.conditions.condition));
        }
        let text = self.json(&head, LinePerElement::default())?;
        Ok(format!("{},\"scores\":[", text.strip_suffix('}').unwrap_or(&text)))
    }

    /// Scores of a block, the first one or one after others.
    fn text(&self, scores: &[Scores], first: bool) -> Result<String, RunError> {
        let mut text = String::new();
        if self.request.format == TableFormat::Csv {
            return Ok(self.csv(scores, first));
        }
        if self.request.format == TableFormat::Text {
            text += &report::scores_text(scores);
            let body = text.split_once('\n').map_or("", |(_, body)| body);
            return Ok(if first { text } else { body.to_owned() });
        }
        let ends_at_hits = self.evaluator.problem().ends_at_hits();
        let listed = listed(scores, &self.prices, self.is_looked_at, ends_at_hits);
        for (index, scores) in listed.enumerate() {
            text += if first && index == 0 { "\n" } else { ",\n" };
            text += &self.json(&scores, CompactFormatter)?;
        }
        Ok(text)
    }

    /// Scores of a block as CSV, the first one with titles.
    fn csv(&self, scores: &[Scores], first: bool) -> String {
        let (all, names) = (scores.iter().collect::<Vec<_>>(), requirements_of(scores));
        let rows = rows_with_requirements(&all, &self.prices, &names);
        let titles = first.then(|| titles_with_requirements(&self.prices, &names));
        csv(titles.into_iter().chain(rows))
    }

    fn tail(&self) -> Result<String, RunError> {
        match self.request.format {
            TableFormat::Json => {}
            TableFormat::Text => return Ok(self.below.clone()),
            TableFormat::Csv => return Ok(String::new()),
        }
        let changes = self.evaluator.backend().changes();
        let mut tail = Map::new();
        if !changes.is_empty() {
            tail.insert("backend_changes".into(), json!(changes));
        }
        tail.insert("timings".into(), self.timings());
        let tail = self.json(&tail, LinePerElement::default())?;
        Ok(format!("\n],{}\n", tail.strip_prefix('{').unwrap_or(&tail)))
    }

    fn json(&self, value: &impl Serialize, format: impl Formatter) -> Result<String, RunError> {
        let path = self.request.out.as_deref().unwrap_or(Path::new("stdout"));
        let mut text = Vec::new();
        let mut writer = serde_json::Serializer::with_formatter(&mut text, format);
        value.serialize(&mut writer).map_err(FileError::json(path))?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }
}
