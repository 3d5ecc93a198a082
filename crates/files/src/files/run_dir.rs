//! Folder of a run that can go on after an interruption: `checkpoint.json` and its other files.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Write;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sha2::{Digest, Sha256};

use super::folder::{MissingFolders, is_empty, lock_folder, lock_new_folder};
use super::{FileError, Input, Output, guard, is_forced, paths, read_own, write_as};

/// File of the state, in every run folder.
const CHECKPOINT: &str = "checkpoint.json";
/// Largest checkpoint: one of a search over many LiDARs has a few megabytes.
const MOST_BYTES: u64 = 1 << 30;
/// Version of that file. 2 to 4: `optimize` of earlier programs.
const VERSION: u32 = 5;
/// Numbered folders that are tried before giving up.
const MOST_RUNS: u32 = 10_000;
/// Patience of `--resume` with a process that was just told to end and still holds the folder.
const PATIENCE: Duration = Duration::from_secs(5);

/// A run's folder; every file in it is whole at any time, and `S` is the state that the run goes on from.
///
/// While this value lives no second program writes into the folder. A folder that the run made and put
/// nothing into is removed with it.
pub struct RunDir<S> {
    path: PathBuf,
    command: &'static str,
    inputs: Vec<Input>,
    /// Files written so far by a run that began here; `None` for one that goes on.
    written: Option<Mutex<BTreeSet<PathBuf>>>,
    _made: MissingFolders,
    _lock: Option<File>,
    state: PhantomData<fn(&S)>,
}

/// All of `checkpoint.json`.
#[derive(Serialize, Deserialize)]
struct Checkpoint<'a> {
    checkpoint: u32,
    command: &'a str,
    /// SHA-256 of the text of `state`, so that a file that was changed is refused: a run goes on from
    /// numbers that belong together, or not at all.
    digest: String,
    inputs: Vec<Input>,
    #[serde(borrow)]
    state: &'a RawValue,
}

/// The part of `checkpoint.json` that every version has.
#[derive(Deserialize)]
struct Head {
    checkpoint: u32,
}

impl<S: Serialize + DeserializeOwned> RunDir<S> {
    /// Makes the requested folder, which must be new or empty unless `--force` is given, or the first of `runs/NAME`,
    /// `runs/NAME-2`, … that does not exist.
    pub fn create(
        command: &'static str,
        out: Option<&Path>,
        name: &str,
        inputs: Vec<Input>,
    ) -> Result<Self, FileError> {
        let (path, mut made) = match out {
            Some(path) => (path.to_owned(), MissingFolders::of(path)),
            None => free_folder(name)?,
        };
        let lock = lock_new_folder(&path, &mut made)?;
        // Under the lock: another run may have ended since the command began.
        if is_forced() {
            guard::holds_no_input(&path)?;
        } else {
            is_free(&path)?;
        }
        let written = Some(Mutex::default());
        Ok(Self { path, command, inputs, written, _made: made, _lock: lock, state: PhantomData })
    }

    /// Reads the state that an earlier sitting has left. Where that one was just killed and still holds
    /// the folder, its end is waited for.
    pub fn resume(command: &'static str, path: &Path) -> Result<(Self, S), FileError> {
        let file = path.join(CHECKPOINT);
        if !holds_run(path) {
            let words = format!(
                "holds no run to go on with ({CHECKPOINT} is missing); name the folder of one, or start a new run"
            );
            return Err(FileError::refused(path, words));
        }
        let lock = lock_folder(path, PATIENCE)?;
        let text = read_own(&file, MOST_BYTES).map_err(FileError::io(&file))?;
        let text = String::from_utf8(text)
            .map_err(|_| FileError::io(&file)(std::io::ErrorKind::InvalidData.into()))?;
        let refuse =
            |words: String| Err(FileError::refused(&file, format!("{words}; start a new run")));
        let json = |source| FileError::Json { path: file.clone(), source };
        let Head { checkpoint } = serde_json::from_str(&text).map_err(json)?;
        if checkpoint != VERSION {
            return refuse(format!("is of version {checkpoint}, this program reads {VERSION}"));
        }
        let saved: Checkpoint = serde_json::from_str(&text).map_err(json)?;
        if saved.command != command {
            return refuse(format!("is a run of `{}`, not of `{command}`", saved.command));
        }
        if saved.digest != digest(saved.state) {
            return refuse("was changed after it was written, or is damaged".to_owned());
        }
        let state = match serde_json::from_str(saved.state.get()) {
            Ok(state) => state,
            Err(error) => return refuse(format!("its state cannot be read: {error}")),
        };
        let (path, inputs, _made) = (path.to_owned(), saved.inputs, MissingFolders::of(path));
        let (written, _lock) = (None, lock);
        Ok((Self { path, command, inputs, written, _made, _lock, state: PhantomData }, state))
    }

    /// Saves the state, to go on from there.
    pub fn save(&self, state: &S) -> Result<(), FileError> {
        let json = |source| FileError::Json { path: self.path.join(CHECKPOINT), source };
        let state = serde_json::value::to_raw_value(state).map_err(json)?;
        let checkpoint = Checkpoint {
            checkpoint: VERSION,
            command: self.command,
            digest: digest(&state),
            inputs: self.inputs.clone(),
            state: &state,
        };
        self.write_json(CHECKPOINT, &checkpoint)
    }
}

impl<S> RunDir<S> {
    /// Refuses to go on with files that have changed since the run was begun.
    pub fn check(&self, inputs: &[Input]) -> Result<(), FileError> {
        Input::check(&self.path, &self.inputs, inputs)
    }

    /// Refuses to go on where a file was changed that the run began with.
    pub fn check_own(&self) -> Result<(), FileError> {
        let files: Vec<PathBuf> = self.inputs.iter().map(|input| input.file().to_owned()).collect();
        self.check(&Input::of(&files)?)
    }

    /// Refusal of a state that was read and does not fit.
    pub fn refusal(&self, why: &str) -> FileError {
        FileError::refused(&self.path.join(CHECKPOINT), format!("{why}; start a new run"))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Place of a file that is about to be written.
    fn file(&self, name: &str) -> PathBuf {
        let path = self.path.join(name);
        if let Some(mut written) = self.written.as_ref().and_then(|written| written.lock().ok()) {
            written.insert(path.clone());
        }
        path
    }

    /// Takes away the files that a run has written which began here, as at an error that another sitting cannot mend. The
    /// files of a run that goes on stay.
    pub fn discard(&self) {
        let written = self.written.as_ref().and_then(|written| written.lock().ok());
        for path in written.iter().flat_map(|written| written.iter()) {
            // One that cannot be removed does not hide the error that led here.
            let _ = std::fs::remove_file(path);
        }
    }

    /// Writes a file of JSON, indented.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), FileError> {
        let path = self.file(name);
        write_as(Output::Own, &path, |file| {
            serde_json::to_writer_pretty(&mut *file, value).map_err(FileError::json(&path))?;
            file.write_all(b"\n").map_err(FileError::write(&path))
        })
    }

    /// Writes a file of JSON values, one a line.
    pub fn write_lines(
        &self,
        name: &str,
        values: impl IntoIterator<Item = impl Serialize>,
    ) -> Result<(), FileError> {
        let path = self.file(name);
        write_as(Output::Own, &path, |file| {
            for value in values {
                serde_json::to_writer(&mut *file, &value).map_err(FileError::json(&path))?;
                file.write_all(b"\n").map_err(FileError::write(&path))?;
            }
            Ok(())
        })
    }

    /// Writes a file of text.
    pub fn write_text(&self, name: &str, text: &str) -> Result<(), FileError> {
        let path = self.file(name);
        write_as(Output::Own, &path, |file| {
            file.write_all(text.as_bytes()).map_err(FileError::write(&path))
        })
    }
}

/// Looks at the checkpoint of the run in a folder; `None` where it holds none, or one that cannot be read.
fn look_at<T>(path: &Path, look: impl FnOnce(Checkpoint) -> Option<T>) -> Option<T> {
    let text = String::from_utf8(read_own(&path.join(CHECKPOINT), MOST_BYTES).ok()?).ok()?;
    look(serde_json::from_str(&text).ok()?)
}

/// Command whose run a folder holds; `None` where it holds none, or one that cannot be read.
pub fn command_of(path: &Path) -> Option<String> {
    look_at(path, |saved| Some(saved.command.to_owned()))
}

/// First file that the run in a folder began with and that is another one now, or gone; `None` without a run, too.
pub fn changed_input(path: &Path) -> Option<PathBuf> {
    let is_changed = |input: &Input| Input::read(input.file()).ok().as_ref() != Some(input);
    let changed = look_at(path, |saved| saved.inputs.into_iter().find(is_changed));
    changed.map(|input| input.file().to_owned())
}

/// Checks, before long work, that [`RunDir::create`] would take a folder. One that is missing is not looked at.
///
/// # Errors
/// Without `--force`: a folder that holds a run or other files, or into which another run writes.
pub fn check_new_folder(path: &Path) -> Result<(), FileError> {
    if is_forced() || !path.is_dir() {
        return Ok(());
    }
    let _lock = lock_folder(path, Duration::ZERO)?;
    is_free(path)
}

/// Refuses a folder that holds a run or anything else.
fn is_free(path: &Path) -> Result<(), FileError> {
    if holds_run(path) {
        let words =
            "already holds a run; go on with --resume, name another folder, or give --force";
        return Err(FileError::refused(path, words));
    }
    is_empty(path)
}

/// True if a folder holds a run, finished or not.
pub fn holds_run(path: &Path) -> bool {
    path.join(CHECKPOINT).exists()
}

fn digest(state: &RawValue) -> String {
    Sha256::digest(state.get()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Makes the first of `runs/NAME`, `runs/NAME-2`, … that no other program has made.
fn free_folder(name: &str) -> Result<(PathBuf, MissingFolders), FileError> {
    let (runs, name) = (Path::new("runs"), paths::safe_name(name));
    for number in 1..MOST_RUNS {
        let path = match number {
            1 => runs.join(&name),
            _ => runs.join(format!("{name}-{number}")),
        };
        let made = MissingFolders::of(&path);
        std::fs::create_dir_all(runs).map_err(FileError::write(runs))?;
        match std::fs::create_dir(&path) {
            Ok(()) => return Ok((path, made)),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(FileError::write(&path)(error)),
        }
    }
    Err(FileError::Refused(format!("runs/{name}: too many runs; name a folder with --out")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Walk {
        steps: u64,
        place: f64,
    }

    const WALK: Walk = Walk { steps: 3, place: 0.1 + 0.2 };

    fn refusal<T>(result: Result<T, FileError>) -> String {
        result.map(|_| ()).expect_err("must be refused").to_string()
    }

    #[test]
    fn a_state_comes_back_bit_for_bit_and_only_to_its_command() {
        let dir = tempfile::tempdir().expect("a folder");
        let input = dir.path().join("input");
        std::fs::write(&input, "one").expect("a file");
        let path = dir.path().join("run");
        let before = vec![Input::read(&input).expect("an input")];
        let run = RunDir::create("walk", Some(&path), "", before.clone()).expect("a run");
        run.save(&WALK).expect("a checkpoint");
        let again = || RunDir::<Walk>::create("walk", Some(&path), "", Vec::new());
        assert!(refusal(again()).contains("another run writes into it"));
        assert!(refusal(check_new_folder(&path)).contains("another run writes into it"));
        drop(run);
        assert!(refusal(again()).contains("already holds a run"));
        assert!(refusal(check_new_folder(&path)).contains("already holds a run"));
        assert!(refusal(check_new_folder(dir.path())).contains("is not empty"));
        check_new_folder(&dir.path().join("new")).expect("nothing is there");

        let (run, state) = RunDir::<Walk>::resume("walk", &path).expect("the run");
        assert_eq!(state, WALK);
        run.check(&before).expect("nothing has changed");
        std::fs::write(&input, "two").expect("a file");
        let now = vec![Input::read(&input).expect("an input")];
        assert!(refusal(run.check(&now)).contains("has changed;"));
        drop(run);
        assert!(refusal(RunDir::<Walk>::resume("ride", &path)).contains("is a run of `walk`"));
        assert_eq!((command_of(&path).as_deref(), command_of(dir.path())), (Some("walk"), None));
    }

    #[test]
    fn a_checkpoint_that_was_changed_or_is_older_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path();
        assert!(refusal(RunDir::<Walk>::resume("walk", path)).contains("holds no run"));
        let run = RunDir::create("walk", Some(path), "", Vec::new()).expect("a run");
        run.save(&WALK).expect("a checkpoint");
        drop(run);
        let file = path.join(CHECKPOINT);
        let whole = std::fs::read_to_string(&file).expect("a text");
        for (from, to, words) in [
            ("\"steps\":3", "\"steps\":4", "was changed after it was written"),
            ("\"checkpoint\": 5", "\"checkpoint\": 4", "is of version 4, this program reads 5"),
            ("}", "", "EOF while parsing"),
        ] {
            let changed = whole.replace(from, to);
            assert_ne!(changed, whole, "{from}");
            std::fs::write(&file, changed).expect("a file");
            assert_holds!(refusal(RunDir::<Walk>::resume("walk", path)), words);
        }
    }

    #[test]
    fn a_process_that_is_about_to_end_is_waited_for() {
        let dir = tempfile::tempdir().expect("a folder");
        let run = RunDir::create("walk", Some(dir.path()), "", Vec::new()).expect("a run");
        run.save(&WALK).expect("a checkpoint");
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(300));
                drop(run);
            });
            assert_eq!(RunDir::<Walk>::resume("walk", dir.path()).expect("the run").1, WALK);
        });
    }

    #[test]
    fn a_folder_that_came_to_nothing_is_gone() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("runs/one");
        drop(RunDir::<Walk>::create("walk", Some(&path), "", Vec::new()).expect("a run"));
        assert!(!dir.path().join("runs").exists());
        let run = RunDir::<Walk>::create("walk", Some(&path), "", Vec::new()).expect("a run");
        run.write_text("note", "kept").expect("a file");
        run.save(&WALK).expect("a checkpoint");
        drop(run);
        assert!(path.join("note").exists());
        // A run that goes on keeps the files of earlier sittings; one that began here leaves none.
        RunDir::<Walk>::resume("walk", &path).expect("the run").0.discard();
        assert!(path.join(CHECKPOINT).exists());
        let path = dir.path().join("two/deep");
        let run = RunDir::<Walk>::create("walk", Some(&path), "", Vec::new()).expect("a run");
        run.save(&WALK).expect("a checkpoint");
        run.write_lines("lines", [1, 2]).expect("a file");
        run.discard();
        drop(run);
        assert!(!dir.path().join("two").exists());
    }
}
