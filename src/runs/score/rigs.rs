//! Placements of one file or several, one after the other, each of a name of its own.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use crate::runs::RunError;
use crate::runs::inputs::file_and_name;
use crate::vehicle::placement_file::count_placements;
use crate::vehicle::{Placement, PlacementReader};

/// Files of placements to be scored together.
pub(super) struct RigFiles {
    files: Vec<PathBuf>,
    /// All files, for messages.
    label: PathBuf,
    /// Names that come more than once in several files, looked up on first use.
    shared: OnceLock<Arc<HashSet<String>>>,
}

impl RigFiles {
    pub(crate) fn new(files: Vec<PathBuf>) -> Self {
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        Self { label: PathBuf::from(names.join(", ")), files, shared: OnceLock::new() }
    }

    /// The files in words, as a path; the file itself where there is one.
    pub(crate) fn label(&self) -> &Path {
        if let [only] = &self.files[..] { only } else { &self.label }
    }

    /// The only file, if it can be read again.
    pub(crate) fn only(&self) -> Option<&Path> {
        let [only] = &self.files[..] else { return None };
        only.is_file().then_some(only)
    }

    /// Placements in all files, each read and checked once; 0 where one is a pipe.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn count(&self) -> Result<u64, RunError> {
        if !self.are_files() {
            return Ok(0);
        }
        let counts = self.files.iter().map(|file| Ok(count_placements(file)?));
        counts.sum()
    }

    /// True if all can be read again: none is a pipe.
    fn are_files(&self) -> bool {
        let is_file = |path: &PathBuf| {
            let file = path.to_str().map_or(&**path, |text| Path::new(file_and_name(text).0));
            path != Path::new("-") && file.is_file()
        };
        self.files.iter().all(is_file)
    }

    /// Names that come more than once in several files; none where one is a pipe. Errors are left to the reader.
    fn shared_names(&self) -> HashSet<String> {
        let (mut once, mut shared) = (HashSet::new(), HashSet::new());
        if self.files.len() < 2 || !self.are_files() {
            return shared;
        }
        let open = self.files.iter().filter_map(|file| PlacementReader::open(file).ok());
        for placement in open.flat_map(|reader| reader.map_while(Result::ok)) {
            if once.contains(&placement.name) {
                shared.insert(placement.name);
            } else {
                once.insert(placement.name);
            }
        }
        shared
    }

    /// Opens the first file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn reader(&self) -> Result<RigReader, RunError> {
        let mut rest = self.files.clone().into_iter();
        let first = rest.next().unwrap_or_default();
        let names = (self.files.len() > 1).then(HashSet::new);
        let open = PlacementReader::open(&first)?;
        let shared = self.shared.get_or_init(|| Arc::new(self.shared_names())).clone();
        Ok(RigReader { open, file: first, rest, names, shared })
    }
}

/// Iterator over the placements of all files.
pub(super) struct RigReader {
    open: PlacementReader,
    file: PathBuf,
    rest: std::vec::IntoIter<PathBuf>,
    /// Names so far, where there are several files.
    names: Option<HashSet<String>>,
    /// Names that come more than once.
    shared: Arc<HashSet<String>>,
}

impl RigReader {
    /// Gives a placement whose name another one has the name of its file, too; behind a pipe the later one alone.
    fn named(&mut self, mut placement: Placement) -> Placement {
        let Some(names) = &mut self.names else { return placement };
        let own = placement.name.clone();
        let file = self.file.to_str().map_or_else(String::new, |text| file_and_name(text).0.into());
        let mut with_file = (1..).map(|number| match number {
            1 => format!("{own} ({file})"),
            _ => format!("{own} ({file}, {number})"),
        });
        if self.shared.contains(&own) {
            placement.name = with_file.next().expect("numbers do not end");
        }
        while !names.insert(placement.name.clone()) {
            placement.name = with_file.next().expect("numbers do not end");
        }
        placement
    }
}

impl Iterator for RigReader {
    type Item = Result<Placement, RunError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(placement) = self.open.next() {
                return Some(placement.map(|found| self.named(found)).map_err(RunError::from));
            }
            self.file = self.rest.next()?;
            match PlacementReader::open(&self.file) {
                Ok(open) => self.open = open,
                Err(error) => return Some(Err(error.into())),
            }
        }
    }
}
