use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sightline::report::{Figures, RunRecord, RunTimes, report_html};
use sightline::search::{GenerationRecord, Search};

use super::auto::Auto;
use super::{Run, RunSettings};
use crate::cli::error::Error;
use crate::cli::inputs::Input;
use crate::cli::output::{writable_folder, write_whole};

/// Version of `checkpoint.json`.
const CHECKPOINT: u32 = 4;
/// File of the times of earlier sittings.
const TIMES: &str = "times.json";
/// Numbered folders that are tried before giving up.
const MOST_RUNS: u32 = 10_000;

/// A run's folder; every file in it is whole at any time.
pub(super) struct RunFolder {
    path: PathBuf,
    /// Files that the run was begun with.
    inputs: Vec<Input>,
    evaluations_before: u64,
    /// Folders made for the run, the innermost first.
    made: Vec<PathBuf>,
}

impl Drop for RunFolder {
    /// A run that came to nothing leaves nothing; folders that hold something stay.
    fn drop(&mut self) {
        let _ = self.made.iter().try_for_each(std::fs::remove_dir);
    }
}

#[derive(Serialize)]
struct Checkpoint<'a> {
    checkpoint: u32,
    /// Of what follows, so that a file that was changed is refused: a search goes on from numbers that
    /// belong together, or not at all.
    digest: String,
    #[serde(flatten)]
    state: State<'a>,
}

#[derive(Serialize)]
struct State<'a> {
    settings: &'a RunSettings,
    inputs: &'a [Input],
    search: &'a Search,
    #[serde(skip_serializing_if = "Option::is_none")]
    auto: &'a Option<Auto>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedCheckpoint {
    checkpoint: u32,
    #[serde(default)]
    digest: String,
    settings: RunSettings,
    inputs: Vec<Input>,
    search: Search,
    #[serde(default)]
    auto: Option<Auto>,
}

impl State<'_> {
    /// FNV-1a over the compact JSON.
    fn digest(&self) -> Result<String, serde_json::Error> {
        let text = serde_json::to_string(self)?;
        let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        Ok(format!("{:016x}", text.bytes().fold(0xcbf2_9ce4_8422_2325, mix)))
    }
}

/// What all sittings of a run have taken together. Not in the checkpoint: that is the same bytes
/// however often a run was interrupted.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Spent {
    /// Placements × frames that the generations scored.
    pub(super) searched: u64,
    /// Seconds of the generations, with what choosing frames took.
    pub(super) seconds: f64,
    pub(super) times: RunTimes,
}

impl Run {
    /// What all sittings have taken up to now.
    pub(super) fn spent_so_far(&self) -> Spent {
        let mut spent = self.spent;
        let evaluations = self.search.evaluations() - self.folder.evaluations_before;
        let frames = self.evaluator.problem().frame_count() as u64;
        spent.searched += self.auto.as_ref().map_or(evaluations * frames, |auto| auto.searched);
        let searching = self.searching.elapsed().as_secs_f64();
        spent.seconds += searching;
        spent.times.search += searching;
        spent.times.total += self.start.elapsed().as_secs_f64();
        spent
    }
}

/// What an earlier sitting has left.
pub(super) struct Resumed {
    pub(super) folder: RunFolder,
    pub(super) settings: RunSettings,
    pub(super) search: Search,
    pub(super) history: Vec<GenerationRecord>,
    pub(super) auto: Option<Auto>,
    pub(super) spent: Spent,
}

impl RunFolder {
    /// Makes the folder asked for, which must not hold a run yet, or a numbered one of the scene.
    pub(super) fn create(
        out: Option<&Path>,
        scene: &Path,
        inputs: Vec<Input>,
    ) -> Result<Self, Error> {
        let path = match out {
            Some(path) if path.join("checkpoint.json").exists() => {
                return Err(Error::Usage(format!(
                    "{}: already holds a run; go on with --resume, or name another folder",
                    path.display()
                )));
            }
            Some(path) => path.to_owned(),
            None => free_folder(scene)?,
        };
        let missing = path.ancestors().take_while(|folder| !folder.exists());
        let made = missing.filter(|f| !f.as_os_str().is_empty()).map(Path::to_owned).collect();
        let folder = Self { path, inputs, evaluations_before: 0, made };
        writable_folder(&folder.path)?;
        Ok(folder)
    }

    /// Reads what an earlier sitting has left.
    pub(super) fn resume(path: &Path) -> Result<Resumed, Error> {
        let file = path.join("checkpoint.json");
        let json = |source| Error::Json { path: file.clone(), source };
        let text = std::fs::read_to_string(&file).map_err(Error::io(&file))?;
        let saved: SavedCheckpoint = serde_json::from_str(&text).map_err(json)?;
        if saved.checkpoint != CHECKPOINT {
            return Err(Error::Usage(format!(
                "{}: is of version {}, this program reads {CHECKPOINT}; start a new run",
                file.display(),
                saved.checkpoint
            )));
        }
        let SavedCheckpoint { settings, inputs, search, auto, .. } = &saved;
        let state = State { settings, inputs, search, auto };
        if state.digest().map_err(json)? != saved.digest {
            return Err(Error::Usage(format!(
                "{}: was changed after it was written, or is damaged; start a new run",
                file.display()
            )));
        }
        let file = path.join("history.jsonl");
        let text = std::fs::read_to_string(&file).map_err(Error::io(&file))?;
        let history = text
            .lines()
            .take(saved.search.generation() as usize)
            .map(serde_json::from_str)
            .collect::<Result<Vec<GenerationRecord>, _>>()
            .map_err(|source| Error::Json { path: file.clone(), source })?;
        if history.len() as u64 != saved.search.generation() {
            return Err(Error::Usage(format!(
                "{}: has {} generations, the checkpoint {}; the folder is damaged",
                file.display(),
                history.len(),
                saved.search.generation()
            )));
        }
        // A run that was killed before it wrote its first times has none.
        let spent = std::fs::read(path.join(TIMES)).ok();
        let spent = spent.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
        writable_folder(path)?;
        let evaluations_before = saved.search.evaluations();
        Ok(Resumed {
            folder: Self {
                path: path.to_owned(),
                inputs: saved.inputs,
                evaluations_before,
                made: Vec::new(),
            },
            settings: saved.settings,
            search: saved.search,
            history,
            auto: saved.auto,
            spent,
        })
    }

    /// Refuses to go on with files that have changed.
    pub(super) fn check(&self, inputs: &[Input]) -> Result<(), Error> {
        Input::check(&self.path, &self.inputs, inputs)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Saves the state after a generation: the history first, so that it is never behind.
    pub(super) fn save(
        &self,
        settings: &RunSettings,
        search: &Search,
        history: &[GenerationRecord],
        auto: &Option<Auto>,
        spent: &Spent,
    ) -> Result<(), Error> {
        let path = self.path.join("history.jsonl");
        write_whole(&path, |file| {
            for record in history {
                serde_json::to_writer(&mut *file, record)
                    .map_err(|source| Error::Json { path: path.clone(), source })?;
                file.write_all(b"\n").map_err(Error::io(&path))?;
            }
            Ok(())
        })?;
        let state = State { settings, inputs: &self.inputs, search, auto };
        let path = self.path.join("checkpoint.json");
        let digest = state.digest().map_err(|source| Error::Json { path, source })?;
        let checkpoint = Checkpoint { checkpoint: CHECKPOINT, digest, state };
        self.write_json("checkpoint.json", &checkpoint)?;
        self.write_json(TIMES, spent)
    }

    fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), Error> {
        let path = self.path.join(name);
        write_whole(&path, |file| {
            serde_json::to_writer_pretty(&mut *file, value)
                .map_err(|source| Error::Json { path: path.clone(), source })?;
            file.write_all(b"\n").map_err(Error::io(&path))
        })
    }

    fn write_text(&self, name: &str, text: &str) -> Result<(), Error> {
        let path = self.path.join(name);
        write_whole(&path, |file| file.write_all(text.as_bytes()).map_err(Error::io(&path)))
    }

    /// Writes the result, the charts and the page.
    pub(super) fn finish(
        &self,
        record: &RunRecord,
        figures: &Figures,
        spent: &Spent,
    ) -> Result<(), Error> {
        self.write_json(TIMES, spent)?;
        self.write_json("result.json", record)?;
        self.write_text("convergence.svg", &figures.convergence)?;
        for (name, figure) in [("placement.svg", &figures.placement), ("map.svg", &figures.map)] {
            if let Some(figure) = figure {
                self.write_text(name, figure)?;
            }
        }
        self.write_text("report.html", &report_html(record, figures))
    }
}

/// `runs/SCENE`, or the first `runs/SCENE-2`, `-3`, … that does not exist.
fn free_folder(scene: &Path) -> Result<PathBuf, Error> {
    let name = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let numbered = (1..MOST_RUNS).map(|n| match n {
        1 => Path::new("runs").join(&name),
        n => Path::new("runs").join(format!("{name}-{n}")),
    });
    numbered.into_iter().find(|path| !path.exists()).ok_or_else(|| {
        Error::Usage(format!("runs/{name}: too many runs; name a folder with --out"))
    })
}
