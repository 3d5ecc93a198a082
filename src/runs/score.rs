//! Scores of a batch of placements: as a stream in one scene, with their mean in several.

mod journal;
mod listed;
mod rigs;
mod stream;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::{Value, json};

use super::inputs::{Files, Given, fit_alone, note_unpriced};
use super::opening::{LoadTimes, Loaded, timings};
use super::run_folder::with_run_scenes;
use super::{
    Computing, Conditions, FiguresOut, GRACE, MountingArgs, RunError, TableFormat, Watcher,
    opening, outputs,
};
use crate::csv::csv;
use crate::files::{
    FileNames, Output, Session, safe_names, shared_folder, sync_disk, writable_file, write_as,
    write_npy, write_whole,
};
use crate::job::{Job, JobFiles};
use crate::json::counted;
use crate::near_field::{FEW_PLACEMENTS, NearSite};
use crate::report;
use crate::report::run_tables::{
    requirements_of, rows_with_requirements, titles_with_requirements,
};
use crate::scan::conditions::{in_words, under};
use crate::score::{Scores, Seen};
use crate::search::{Evaluator, Judged, Member};
use crate::vehicle::{Placement, PlacementFileError, Vehicle};
use listed::{listed, not_looked_closely};
use rigs::RigFiles;

/// Scores placements and writes the scores as they are computed, to the request's file or else to `out`. False, and a note,
/// where there are requirements and no placement meets all of them.
///
/// # Errors
/// Files that cannot be read or written, errors of the engine; mistakes in files are found before the first score.
pub fn score(
    request: &ScoreRequest,
    computing: &Computing<'_>,
    out: &mut dyn Write,
) -> Result<bool, RunError> {
    let _session = Session::begin();
    let start = Instant::now();
    let (files, computing) = &with_run_scenes(&request.files, computing)?;
    let (scenes, placements) = Files::with_rigs(files, computing.watcher)?;
    let placements = RigFiles::new(placements);
    // Everything that can be wrong is found before the first score is computed or printed; a pipe can
    // be read only once.
    let total = placements.count()?;
    if request.draw > 0 && scenes.len() > 1 {
        return Err(RunError::Usage("--draw: takes one scene".to_owned()));
    }
    outputs::Drawings::in_folder(&request.figures).check()?;
    if request.resume && request.figures.figures.is_some() {
        let words = "--figures: needs all scores, and --resume does not read those that are known; leave one of them out";
        return Err(RunError::Usage(words.to_owned()));
    }
    if request.resume && scenes.len() > 1 {
        return Err(RunError::Usage("--resume: takes one scene".to_owned()));
    }
    if let ([_], Some(folder)) = (&scenes[..], &request.coverage_out)
        && total > 0
    {
        let names = placements.reader()?.map(|placement| Ok(placement?.name));
        let names = names.collect::<Result<Vec<String>, RunError>>()?;
        check_coverage(std::slice::from_ref(folder), names.iter().map(|name| &**name), request)?;
    }
    if total > 0 {
        let first: Result<Vec<_>, _> = placements.reader()?.take(FEW_PLACEMENTS).collect();
        fit_alone(placements.label(), &first?, computing)?;
    }
    let is_met = match &scenes[..] {
        [scene] => stream::score(request, computing, scene, &placements, total, start, out),
        _ => score_each(request, computing, &scenes, &placements, start, out),
    }?;
    if !is_met {
        computing.watcher.note(&format!(
            "NOT MET: no placement of {} meets all requirements; exit code 1",
            placements.label().display()
        ));
    }
    Ok(is_met)
}

/// True if a placement meets all requirements, or there are none.
fn meets(scores: &Scores) -> bool {
    scores.required.iter().all(Seen::is_met)
}

/// Price of each placement; empty where no sensor has one.
fn prices_of(vehicle: &Vehicle, placements: &[Placement]) -> Vec<f64> {
    placements.iter().filter_map(|placement| vehicle.price_of_rig(placement)).collect()
}

/// Placements that are read, scored and printed at a time.
const BLOCK: usize = 1024;

/// A batch of placements to be scored.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ScoreRequest {
    /// Scene files, then placements: .json or, one a line, .jsonl; with :NAME one of them; the folder of a run for its
    /// result; - is stdin
    ///
    /// Several files of placements are scored one after the other; placements of one name get their file behind it. A .jsonl
    /// file is read as a stream. Several scenes share one LiDAR and mount, and get the mean beside each.
    #[cfg_attr(feature = "cli", arg(value_name = "SCENE… PLACEMENTS", required = true))]
    pub files: Vec<PathBuf>,
    /// How to print
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub format: TableFormat,
    /// Write the scores to this file instead of stdout
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
    /// Go on with the scores of an interrupted run, which stand in FILE.partial beside the file of --out
    #[cfg_attr(feature = "cli", arg(long, requires = "out"))]
    pub resume: bool,
    /// Write the covered voxels of each placement to DIR/NAME.npy: u64 linear indices, rising; with
    /// several frames, voxels covered in at least one; of several scenes DIR/SCENE/NAME.npy
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub coverage_out: Option<PathBuf>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    /// Average over this many frames, spread evenly over each scene [default: all]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
    /// Score the near field, too: the share of the ground within 10 m, and within 3 m, of the own body with a hit close
    /// by; takes casts of its own
    #[cfg_attr(feature = "cli", arg(long))]
    pub near_field: bool,
    /// Random seed for free phases and weather; the mean over several seeds is the expectation; one scene
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 0, value_parser = super::parse::whole::<u64>))]
    pub draw: u64,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub mounting: MountingArgs,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
}

/// Hands out the file of the request, which is whole at any time, or the caller's writer.
fn write_out(
    request: &ScoreRequest,
    out: &mut dyn Write,
    print: impl FnOnce(&Path, &mut dyn Write) -> Result<(), RunError>,
) -> Result<(), RunError> {
    match &request.out {
        Some(path) => write_whole(path, |file| print(path, file)),
        None => print(Path::new("stdout"), out),
    }
}

/// Writes the scores as CSV where a folder is given for it.
fn write_table(
    request: &ScoreRequest,
    csv: impl FnOnce() -> String,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    outputs::Drawings::in_folder(&request.figures).write(
        Vec::new(),
        ("scores", csv),
        || None,
        watcher,
    )
}

/// Says how far a batch came whose scores are not kept; `total` is 0 where it is not known.
fn interrupted(request: &ScoreRequest, scored: u64, total: u64) -> RunError {
    let all = if total > 0 { format!(" of {total}") } else { String::new() };
    let left = request.out.as_ref().map(|out| format!("; {} is not written", out.display()));
    let left = left.unwrap_or_default();
    RunError::Interrupted(format!("interrupted after {scored}{all} placements{left}"))
}

/// Ending of the files of covered voxels.
const COVERAGE: &str = ".npy";

/// Checks, before long work, that the covered voxels of every placement can have a file of their own in a folder, or in
/// each of several: NAME.npy, which nothing else has and no earlier run has left.
fn check_coverage<'a>(
    folders: &[PathBuf],
    names: impl IntoIterator<Item = &'a str>,
    request: &ScoreRequest,
) -> Result<(), RunError> {
    let mut taken = FileNames::default();
    for name in names {
        let file = taken.take(name, COVERAGE)?;
        let paths = folders.iter().map(|folder| folder.join(&file));
        for path in paths.filter(|path| !request.resume && path.exists()) {
            writable_file(&path)?;
        }
    }
    Ok(())
}

/// Folder of the covered voxels in each scene, within one for all.
fn coverage_folders(evaluator: &Evaluator, folder: &Path) -> Vec<PathBuf> {
    let names = safe_names(evaluator.members().map(|(member, _)| member.name()));
    names.iter().map(|name| folder.join(name)).collect()
}

/// Like [`check_coverage`], for placements in several scenes.
fn check_coverage_in_each(
    evaluator: &Evaluator,
    placements: &[Placement],
    request: &ScoreRequest,
) -> Result<(), RunError> {
    let Some(folder) = &request.coverage_out else { return Ok(()) };
    let names = placements.iter().map(|placement| &*placement.name);
    check_coverage(&coverage_folders(evaluator, folder), names, request)
}

/// Writes the covered voxels of a placement, in rising order.
fn write_coverage(
    folder: &Path,
    placement: &Placement,
    covered: Vec<u64>,
    resumes: bool,
) -> Result<(), RunError> {
    let path = folder.join(FileNames::default().take(&placement.name, COVERAGE)?);
    // The last block of an interrupted batch is written again.
    let output = if resumes && path.exists() { Output::Own } else { Output::OneOfMany };
    write_as(output, &path, |file| write_npy(file, covered).map_err(RunError::io(&path)))
}

/// Placements that are held at once at most: a mean needs their scores in every scene.
const MOST: usize = 100_000;

/// Scenes of the request, with a note on sensors that have no price: prices are told.
fn open(
    request: &ScoreRequest,
    scenes: &[PathBuf],
    computing: &Computing<'_>,
) -> Result<Loaded, RunError> {
    let files = opening::files(scenes, &request.conditions.condition, request.frames, computing);
    let files = JobFiles { tolerance: Some(request.mounting.tolerance), ..files };
    let loaded = opening::job(&files, computing)?;
    note_unpriced(loaded.job.scene().vehicle(), false, computing.watcher);
    opening::note_mounts(&loaded.job.scenes()[0], computing.watcher)?;
    Ok(loaded)
}

/// Scores placements in all scenes and writes tables or JSON, to the request's file or else to `out`.
fn score_each(
    request: &ScoreRequest,
    computing: &Computing<'_>,
    scenes: &[PathBuf],
    placements: &RigFiles,
    start: Instant,
    out: &mut dyn Write,
) -> Result<bool, RunError> {
    let mut loaded = open(request, scenes, computing)?;
    let evaluator = loaded.evaluator(computing)?;
    opening::note_relief(&loaded.job, computing.watcher)?;
    let Loaded { job, times } = loaded;
    computing.watcher.listen(GRACE);
    if let Some(file) = &request.out {
        writable_file(file)?;
        outputs::check_table(file, request.format)?;
    }
    let (file, mut placements) = (placements.label(), read(placements)?);
    Given::in_problem(file, evaluator.problem(), computing).whole(&mut placements)?;
    check_coverage_in_each(&evaluator, &placements, request)?;
    let mut batch = Batch {
        evaluator,
        times,
        start,
        conditions: in_words(&request.conditions.condition),
        judged: Vec::new(),
        placements: placements.clone(),
        vehicle: job.scene().vehicle().clone(),
    };
    batch.judge(request, computing.watcher)?;
    job.add_broken_rules(batch.evaluator.problem().rules(), &placements, &mut batch.judged);
    if placements.len() <= FEW_PLACEMENTS {
        job.look_closely_by_scene(&mut batch.evaluator, &placements, &mut batch.judged)?;
    } else {
        batch.not_looked_closely().iter().for_each(|note| computing.watcher.note(note));
    }
    if request.near_field {
        batch.add_near_fields(&job, &placements)?;
    }
    if let Some(folder) = &request.coverage_out {
        batch.write_coverage(folder, &placements)?;
    }
    let seconds = start.elapsed().as_secs_f64() - batch.times.load - batch.times.build;
    write_out(request, out, |path, out| {
        let text = match request.format {
            TableFormat::Json => format!("{:#}\n", batch.json()),
            TableFormat::Csv => batch.csv(),
            TableFormat::Text => batch.text(),
        };
        out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(RunError::io(path))
    })?;
    write_table(request, || batch.csv(), computing.watcher)?;
    computing.watcher.note(&batch.pace(seconds));
    Ok(batch.judged.iter().any(|judged| meets(&judged.scores)))
}

/// All placements of the files, unless these are too many to be held with their scores in every scene.
fn read(files: &RigFiles) -> Result<Vec<Placement>, RunError> {
    let mut placements = Vec::new();
    for placement in files.reader()? {
        placements.push(placement?);
        if placements.len() > MOST {
            return Err(RunError::Usage(format!(
                "{}: holds more than {MOST} placements, too many for several scenes at once; score one scene \
                 at a time",
                files.label().display()
            )));
        }
    }
    if placements.is_empty() {
        return Err(PlacementFileError::empty(files.label()).into());
    }
    Ok(placements)
}

/// Placements with their scores in every scene.
struct Batch {
    evaluator: Evaluator,
    times: LoadTimes,
    start: Instant,
    /// Weather and faults, as they are written.
    conditions: Vec<String>,
    judged: Vec<Judged>,
    /// The placements, and the vehicle of the first scene.
    placements: Vec<Placement>,
    vehicle: Vehicle,
}

impl Batch {
    /// Scores all placements, a block at a time.
    fn judge(&mut self, request: &ScoreRequest, watcher: &dyn Watcher) -> Result<(), RunError> {
        let total = self.placements.len() as u64;
        let bar = watcher.bar(total, Some("placements"));
        for block in self.placements.chunks(BLOCK) {
            if !watcher.goes_on() {
                return Err(interrupted(request, self.judged.len() as u64, total));
            }
            self.judged.extend(self.evaluator.judged(block)?);
            bar.advance(block.len() as u64);
        }
        Ok(())
    }

    /// Note on what nobody looked at in placements that are too many for a close look.
    fn not_looked_closely(&self) -> Option<String> {
        let ends_at_hits = self.members().any(|(_, member)| member.problem().ends_at_hits());
        not_looked_closely(ends_at_hits, self.judged.first().map(|judged| &judged.scores))
    }

    /// Count and speed of a batch that took `seconds`, in words.
    fn pace(&self, seconds: f64) -> String {
        let (count, frames) = (self.placements.len(), self.evaluator.frame_count());
        let each = (count * frames) as f64 / seconds;
        format!(
            "{} × {} of all scenes in {seconds:.2} s: {each:.1} placements × frames/s",
            counted(count, "placement"),
            counted(frames, "frame")
        )
    }

    fn members(&self) -> impl Iterator<Item = (usize, &Member)> {
        self.evaluator.members().map(|(member, _)| member).enumerate()
    }

    /// Adds the near field in every scene, and its mean.
    fn add_near_fields(&mut self, job: &Job, placements: &[Placement]) -> Result<(), RunError> {
        for (index, scene) in job.scenes().iter().enumerate() {
            let (member, engine) = self.evaluator.member_mut(index);
            let of_scene = self.judged.iter_mut().map(|judged| &mut judged.by_scene[index].scores);
            let site = NearSite::new(scene.scene(), member.problem())?;
            site.score(engine, placements.iter().zip(of_scene))?;
        }
        for Judged { scores, by_scene } in &mut self.judged {
            let mean = |of: fn(&Scores) -> Option<f64>| {
                let sum: Option<f64> = by_scene.iter().map(|scene| of(&scene.scores)).sum();
                sum.map(|sum| sum / by_scene.len() as f64)
            };
            (scores.near_field, scores.near_ring) = (mean(|s| s.near_field), mean(|s| s.near_ring));
        }
        Ok(())
    }

    /// Scores of all placements in one scene.
    fn of_scene(&self, scene: usize) -> Vec<&Scores> {
        self.judged.iter().map(|judged| &judged.by_scene[scene].scores).collect()
    }

    fn mean(&self) -> Vec<Scores> {
        self.judged.iter().map(|judged| judged.scores.clone()).collect()
    }

    /// A table a scene, and the mean.
    fn text(&self) -> String {
        let mut text = String::new();
        let used = stream::models_of(&self.placements).collect();
        for (index, member) in self.members() {
            let problem = member.problem();
            text += &format!(
                "{}: {} over {}, {} a LiDAR{}\n",
                member.name(),
                problem.coverage(),
                counted(problem.frame_count(), "frame"),
                problem.sensors().beams_in_words(&used),
                under(&self.conditions)
            );
            let scores: Vec<Scores> = self.of_scene(index).into_iter().cloned().collect();
            text += &format!("{}\n", report::scores_text(&scores));
        }
        let names: Vec<&str> = self.members().map(|(_, member)| member.name()).collect();
        text += &format!(
            "mean of {}: each scene's gain as a share of its own total, in nats of the mean total\n",
            names.join(", ")
        );
        let mean = self.mean();
        text += &report::scores_text(&mean);
        if mean.len() <= FEW_PLACEMENTS {
            text += &report::rigs_text(&self.vehicle, &self.placements, &mean);
        }
        text
    }

    /// The placements in each scene, then their means.
    fn csv(&self) -> String {
        let prices = prices_of(&self.vehicle, &self.placements);
        let mean: Vec<&Scores> = self.judged.iter().map(|judged| &judged.scores).collect();
        let of_scenes = self.members().flat_map(|(index, _)| self.of_scene(index));
        let names = requirements_of(mean.iter().copied().chain(of_scenes));
        let titles = titles_with_requirements(&prices, &names);
        let titles = std::iter::once("scene".to_owned()).chain(titles).collect();
        let mut rows: Vec<Vec<String>> = vec![titles];
        let mut add = |scene: &str, scores: Vec<Vec<String>>| {
            let named = |row| std::iter::once(scene.to_owned()).chain(row).collect();
            rows.extend(scores.into_iter().map(named));
        };
        for (index, member) in self.members() {
            add(member.name(), rows_with_requirements(&self.of_scene(index), &prices, &names));
        }
        add("mean", rows_with_requirements(&mean, &prices, &names));
        csv(rows)
    }

    /// An object a scene, as `score` of that scene alone prints it, and the mean.
    fn json(&self) -> Value {
        let engines: Vec<_> = self.evaluator.members().map(|(_, engine)| engine).collect();
        let (prices, mean) = (prices_of(&self.vehicle, &self.placements), self.mean());
        let scene = |(index, member): (usize, &Member)| {
            let (problem, engine) = (member.problem(), engines[index]);
            let stages = engine.times();
            let mut scene = json!({
                "scene": member.name(),
                "backend": engine.name(),
                "adapter": engine.adapter(),
                "coverage": problem.coverage(),
                "frames": problem.frame_count(),
                "modelled": problem.modelled(),
                "threads": rayon::current_num_threads(),
                "scores": self.listed(self.of_scene(index), &prices, problem.ends_at_hits()),
                // Loading and the whole are those of all scenes together.
                "timings": timings(self.times, stages, self.start),
            });
            if !self.conditions.is_empty() {
                scene["conditions"] = json!(self.conditions);
            }
            if !engine.changes().is_empty() {
                scene["backend_changes"] = json!(engine.changes());
            }
            scene
        };
        let scenes: Vec<Value> = self.members().map(scene).collect();
        // The mean has the card of the first scene.
        let ends_at_hits = self.members().next().is_some_and(|(_, m)| m.problem().ends_at_hits());
        json!({ "scenes": scenes, "mean": self.listed(mean.iter().collect(), &prices, ends_at_hits) })
    }

    /// Scores of all placements for JSON.
    fn listed<'a>(&self, scores: Vec<&'a Scores>, prices: &'a [f64], ends_at_hits: bool) -> Value {
        let is_looked_at = scores.len() <= FEW_PLACEMENTS;
        json!(listed(scores, prices, is_looked_at, ends_at_hits).collect::<Vec<_>>())
    }

    /// Covered voxels of each placement, in a folder a scene.
    fn write_coverage(&mut self, folder: &Path, placements: &[Placement]) -> Result<(), RunError> {
        let folders = coverage_folders(&self.evaluator, folder);
        for (scene, folder) in folders.iter().enumerate() {
            shared_folder(folder)?;
            for placement in placements {
                let covered = self.evaluator.covered_in(scene, placement, &mut |_, _| true)?;
                let covered = covered.unwrap_or_default();
                write_coverage(folder, placement, covered, false)?;
            }
            sync_disk(folder);
        }
        Ok(())
    }
}
