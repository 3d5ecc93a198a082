//! The folder of a data set: files that arrive whole, records of frames, and a list of its content.
//!
//! `dataset.json` lists the content of a folder: a data set that is continued must be the one listed.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use tempfile::NamedTempFile;

use super::plan::Planned;
use super::record::{FrameRecord, Written};
use super::{Checked, DatasetSettings, SceneFacts, Split};
use sightline_files::files::{self, FileError, Input, Temporary};

/// States the folder's content, and whether it is complete.
pub(super) const ABOUT: &str = "dataset.json";
/// Marks the folder as incomplete while it exists.
pub(super) const INCOMPLETE: &str = "INCOMPLETE.txt";
/// Records and files that are being written: hidden, because loaders list the other folders.
const HIDDEN: &str = ".sightline";
/// Locked while a program finds out whether the folder is its own.
const CLAIM: &str = "claim";
/// Largest record of a frame (ten thousand boxes have a few megabytes) and largest `dataset.json` (a thousand scenes
/// have one).
const MOST_BYTES: u64 = 1 << 28;

/// Bytes that are put together before they are written: arrays of clouds are longer, and are not copied.
const BUFFER: usize = 1 << 14;

pub(super) struct Folder {
    pub(super) root: PathBuf,
}

/// A file that is being written; it takes its place when it is done.
pub(super) struct StagedFile {
    out: BufWriter<NamedTempFile>,
    _temporary: Temporary,
    place: PathBuf,
    name: String,
}

impl Folder {
    /// Opens the folder for reading; it need not exist.
    ///
    /// # Errors
    /// The hidden folder is a link or a file: cleaning up behind a link would delete other users' files.
    pub(super) fn at(root: &Path) -> Checked<Self> {
        let hidden = root.join(HIDDEN);
        match std::fs::symlink_metadata(&hidden) {
            Ok(meta) if !meta.is_dir() => Err(refused!(
                "{}: is not the folder of records that a data set keeps; take it away, or name another place for the set",
                hidden.display()
            )),
            _ => Ok(Self { root: root.to_owned() }),
        }
    }

    /// Makes the folder if there is none; removes temporary files of killed runs.
    ///
    /// # Errors
    /// See [`Self::at`], and a place that cannot be written.
    pub(super) fn open(root: &Path) -> Checked<Self> {
        let folder = Self::at(root)?;
        let hidden = root.join(HIDDEN);
        std::fs::create_dir_all(&hidden).map_err(FileError::write(root))?;
        files::sweep(&hidden);
        Ok(folder)
    }

    /// Keeps other programs from finding out whether the folder is theirs, until the file is dropped. `None` where files
    /// cannot be locked, as on some network drives.
    pub(super) fn claim(&self) -> Option<File> {
        let claim = self.root.join(HIDDEN).join(CLAIM);
        let file = File::options().create(true).truncate(false).write(true).open(claim).ok()?;
        file.lock().ok().map(|()| file)
    }

    /// Waits until the disk has all files: once a set, not once a file.
    pub(super) fn sync(&self) {
        files::sync_disk(&self.root);
    }

    /// Begins a file, named from the root with `/`.
    pub(super) fn begin(&self, name: &str) -> Checked<StagedFile> {
        let place = self.root.join(name);
        let hidden = self.root.join(HIDDEN);
        let (file, temporary) = files::begin_in(&hidden).map_err(FileError::write(&place))?;
        let out = BufWriter::with_capacity(BUFFER, file);
        Ok(StagedFile { out, _temporary: temporary, place, name: name.to_owned() })
    }

    /// Writes a file of records of any kind.
    pub(super) fn put(&self, name: &str, bytes: &[u8]) -> Checked<Written> {
        let mut staged = self.begin(name)?;
        staged.write(|out| out.write_all(bytes))?;
        staged.end()
    }

    pub(crate) fn put_json(&self, name: &str, value: &impl Serialize) -> Checked<()> {
        let mut text =
            serde_json::to_vec_pretty(value).map_err(FileError::json(&self.root.join(name)))?;
        text.push(b'\n');
        self.put(name, &text).map(drop)
    }

    /// Takes a file away, if it is there.
    pub(super) fn remove(&self, name: &str) -> Checked<()> {
        let path = self.root.join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(FileError::io(&path)(error).into())
            }
            _ => Ok(()),
        }
    }

    fn record_name(scene: usize, frame: usize) -> String {
        format!("{HIDDEN}/{scene:04}/{frame:08}.json")
    }

    /// True if a frame is there whole.
    pub(super) fn has(&self, scene: usize, frame: usize) -> bool {
        self.whole(scene, frame).is_some()
    }

    /// The record of a frame that is there whole.
    pub(super) fn whole(&self, scene: usize, frame: usize) -> Option<FrameRecord> {
        let is_there = |file: &Written| {
            let meta = std::fs::metadata(self.root.join(&file.path));
            meta.is_ok_and(|meta| meta.is_file() && meta.len() == file.bytes)
        };
        self.record(scene, frame).ok().filter(|record| record.files.iter().all(is_there))
    }

    /// Keeps the record of a frame whose files are all in place.
    pub(super) fn keep(&self, scene: usize, record: &FrameRecord) -> Checked<()> {
        let name = Self::record_name(scene, record.frame);
        let text = serde_json::to_vec(record).map_err(FileError::json(&self.root.join(&name)))?;
        self.put(&name, &text).map(drop)
    }

    pub(super) fn record(&self, scene: usize, frame: usize) -> Checked<FrameRecord> {
        let path = self.root.join(Self::record_name(scene, frame));
        let text = files::read_own(&path, MOST_BYTES).map_err(FileError::io(&path))?;
        Ok(serde_json::from_slice(&text).map_err(FileError::json(&path))?)
    }

    /// Checks that the disk holds `need` more bytes, where the system reports its free space.
    pub(crate) fn check_space(&self, need: u64) -> Checked<()> {
        #[cfg(unix)]
        if let Ok(disk) = rustix::fs::statvfs(&self.root) {
            let free = disk.f_bavail.saturating_mul(disk.f_frsize);
            if free < need {
                let (path, need, free) = (self.root.display(), need.div_ceil(1 << 20), free >> 20);
                return Err(refused!(
                    "{path}: the frames to come need about {need} MB, {free} MB are free; make room, or write fewer \
                     frames"
                ));
            }
        }
        Ok(())
    }
}

impl StagedFile {
    /// The writer; errors name the place of the file.
    pub(super) fn write<T>(
        &mut self,
        write: impl FnOnce(&mut BufWriter<NamedTempFile>) -> std::io::Result<T>,
    ) -> Checked<T> {
        Ok(write(&mut self.out).map_err(FileError::write(&self.place))?)
    }

    pub(super) fn end(self) -> Checked<Written> {
        let Self { out, place, name, _temporary } = self;
        let io = |error| FileError::write(&place)(error);
        files::is_no_input(&place)?;
        let mut file = out.into_inner().map_err(|error| io(error.into_error()))?;
        let bytes = file.seek(SeekFrom::End(0)).map_err(io)?;
        if let Err(error) = file.persist(&place) {
            // Most files come into a folder that is there: it is made where it is not.
            let (Some(folder), ErrorKind::NotFound) = (place.parent(), error.error.kind()) else {
                return Err(io(error.error).into());
            };
            std::fs::create_dir_all(folder).map_err(FileError::write(folder))?;
            error.file.persist(&place).map_err(|error| io(error.error))?;
        }
        Ok(Written { path: name, bytes })
    }
}

/// Keys of the provenance that hold paths as they were given: recorded, but not compared.
const PATHS: [&str; 2] = ["scenes", "vehicle"];

/// All of `dataset.json`.
#[derive(Serialize, Deserialize)]
pub(super) struct About {
    dataset: u32,
    pub complete: bool,
    settings: DatasetSettings,
    /// Name and split of each scene in the data set.
    called: Vec<Called>,
    scenes: Vec<SceneFacts>,
}

#[derive(Serialize, Deserialize, PartialEq)]
struct Called {
    scene: String,
    name: String,
    split: Split,
}

impl About {
    /// A data set that is not whole.
    pub(super) fn new(settings: &DatasetSettings, scenes: &[SceneFacts], plan: &[Planned]) -> Self {
        let called = scenes.iter().zip(plan).map(|(scene, planned)| Called {
            scene: scene.name.clone(),
            name: planned.name.clone(),
            split: planned.split,
        });
        Self {
            dataset: 1,
            complete: false,
            settings: settings.clone(),
            called: called.collect(),
            scenes: scenes.to_vec(),
        }
    }

    pub(super) fn read(dir: &Path) -> Checked<Self> {
        let path = dir.join(ABOUT);
        let text = files::read_own(&path, MOST_BYTES).map_err(FileError::io(&path))?;
        serde_json::from_slice(&text).map_err(|why| {
            let path = path.display();
            refused!(
                "{path}: cannot be read ({why}); put it back as it was, or name another folder"
            )
        })
    }

    /// True if the folder holds this very data set; an empty one or none holds nothing.
    ///
    /// # Errors
    /// A folder of something else, of other settings, or of scenes whose files have changed since; a new one within
    /// another data set.
    pub(super) fn is_in(&self, dir: &Path) -> Checked<bool> {
        let mut entries = match std::fs::read_dir(dir) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return lies_in_no_set(dir).map(|()| false);
            }
            Err(error) => {
                // For a place below a file, that file is in the way.
                return Err(match dir.ancestors().find(|place| place.is_file()) {
                    Some(file) => refused!(
                        "{}: is a file, and a data set is a folder; name another place",
                        file.display()
                    ),
                    None => FileError::io(dir)(error).into(),
                });
            }
            Ok(entries) => entries,
        };
        let path = dir.display();
        if !dir.join(ABOUT).is_file() {
            // A run that ended before it wrote `dataset.json` leaves only the hidden folder.
            let foreign = entries.any(|entry| entry.is_ok_and(|entry| entry.file_name() != HIDDEN));
            return if foreign {
                Err(refused!(
                    "{path}: is not empty and holds no data set of this program; name another folder"
                ))
            } else {
                lies_in_no_set(dir).map(|()| false)
            };
        }
        let found = Self::read(dir)?;
        if let Some(difference) = self.difference(&found) {
            return Err(refused!(
                "{path}: holds a data set of other settings ({difference}); name another folder, or take the same \
                 settings"
            ));
        }
        match Input::change(&found.settings.files, &self.settings.files) {
            Some(change) => Err(refused!(
                "{path}: {change} since this data set was begun; put it back as it was, or name another folder"
            )),
            None => Ok(true),
        }
    }

    /// Names of the settings that differ from the existing data set; scene files are not compared.
    fn difference(&self, found: &Self) -> Option<String> {
        let others = others(&self.settings.compared(), &found.settings.compared());
        let difference = if !others.is_empty() {
            return Some(others.join(", "));
        } else if self.scenes != found.scenes {
            "scenes or frames"
        } else if self.called != found.called || self.dataset != found.dataset {
            "another version of the program"
        } else if found.settings.files.is_empty() && !self.settings.files.is_empty() {
            "an earlier version of the program, which did not record the files of its scenes"
        } else {
            return None;
        };
        Some(difference.to_owned())
    }
}

impl DatasetSettings {
    /// The settings and the provenance as they are compared, without files and the paths of [`PATHS`]. A provenance
    /// that is no object is one of the settings.
    fn compared(&self) -> [Value; 2] {
        let mut settings = serde_json::json!(self);
        let mut provenance: Value = serde_json::from_str(&self.provenance).unwrap_or_default();
        if let Some(keys) = settings.as_object_mut() {
            keys.retain(|key, _| {
                key != "files" && (key != "provenance" || !provenance.is_object())
            });
        }
        if let Some(keys) = provenance.as_object_mut() {
            keys.retain(|key, _| !PATHS.contains(&key.as_str()));
        }
        [settings, provenance]
    }
}

/// Refuses the place of a new data set within the folder of another one; links are followed.
fn lies_in_no_set(dir: &Path) -> Checked<()> {
    let or_here = |place: &Path| match place.as_os_str().is_empty() {
        true => PathBuf::from("."),
        false => place.to_owned(),
    };
    let there = dir.ancestors().find_map(|place| or_here(place).canonicalize().ok());
    let is_set = |place: &&Path| place.join(HIDDEN).is_dir() && place.join(ABOUT).is_file();
    match there.as_deref().and_then(|there| there.ancestors().find(is_set)) {
        Some(set) => Err(refused!(
            "{}: lies in {}, the folder of another data set, which would hold files of both; name a folder outside it",
            dir.display(),
            set.display()
        )),
        None => Ok(()),
    }
}

/// Names of the values that are not alike in both, each once.
fn others(ours: &[Value; 2], theirs: &[Value; 2]) -> Vec<String> {
    let mut names = Vec::new();
    for (a, b) in ours.iter().zip(theirs) {
        for key in [a, b].into_iter().filter_map(Value::as_object).flat_map(|keys| keys.keys()) {
            if a.get(key) != b.get(key) && !names.contains(key) {
                names.push(key.clone());
            }
        }
    }
    names
}
