//! `FILE.partial`: scores so far of a batch that goes to a file, which `--resume` goes on from.

use std::fs::{File, TryLockError};
use std::io::{BufRead, BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;
use sha2::{Digest, Sha256};

use super::ScoreRequest;
use crate::files::{FileError, Input, is_forced, is_no_input, will_read, write_whole};
use crate::runs::RunError;
use crate::scan::conditions::in_words;
use crate::scene::Scene;

/// Longest line of marks in bytes.
const MAX_LINE: u64 = 1 << 10;
/// Largest block of text in bytes: 1024 scores have about one megabyte.
const MAX_BLOCK: u64 = 1 << 28;

/// Scores so far, block by block. While it lives no other program goes on with the same file.
pub(super) struct Journal {
    path: PathBuf,
    file: BufWriter<File>,
    /// Bytes before the first block.
    head: u64,
    /// Placements whose scores it holds.
    pub scored: u64,
    /// True once one of these meets all requirements.
    pub is_met: bool,
}

/// First line: everything that decides about the scores, as one number.
#[derive(Serialize, Deserialize)]
struct JournalHeader {
    sightline_partial: u32,
    digest: String,
}

/// Line before the text of a block.
#[derive(Serialize, Deserialize)]
struct Mark {
    /// Placements up to the end of the block.
    scored: u64,
    /// True if one of them meets all requirements.
    met: bool,
    bytes: u64,
    sha256: String,
}

impl Journal {
    /// Begins one beside the output, or goes on with the one there where the request says so.
    ///
    /// # Errors
    /// One that is there and is not asked for, of other inputs or options, or held by another program.
    pub(crate) fn open(
        out: &Path,
        request: &ScoreRequest,
        scene: &Scene,
        placements: &Path,
    ) -> Result<Self, RunError> {
        let mut name = out.as_os_str().to_owned();
        name.push(".partial");
        let path = PathBuf::from(name);
        let digest = digest(request, scene, placements)?;
        let file = own_file(&path, request.resume, placements)?;
        let is_new = file.metadata().map_err(RunError::io(&path))?.len() == 0;
        let head = json!(JournalHeader { sightline_partial: 1, digest: digest.clone() });
        let head = format!("{head}\n");
        if !is_new && !is_torn(&file, &head).map_err(RunError::io(&path))? {
            return Self::resume(path, file, &digest);
        }
        let begun = file.set_len(0);
        let begun = begun.and_then(|()| (&file).write_all(head.as_bytes()));
        if begun.is_err() {
            // It holds no scores that a run could go on with.
            let _ = std::fs::remove_file(&path);
        }
        begun.map_err(RunError::io(&path))?;
        let file = BufWriter::new(file);
        Ok(Self { path, file, head: head.len() as u64, scored: 0, is_met: false })
    }

    /// Finds the end of the last whole block; the rest of the file is cut off.
    fn resume(path: PathBuf, file: File, digest: &str) -> Result<Self, RunError> {
        let io = |error| RunError::io(&path)(error);
        let mut reader = BufReader::new(&file);
        let first = line(&mut reader);
        let head = first.as_ref().and_then(|line| serde_json::from_str::<JournalHeader>(line).ok());
        match head {
            Some(head) if head.sightline_partial == 1 && head.digest == digest => {}
            _ => {
                return Err(RunError::Usage(format!(
                    "{}: was begun with other scenes, placements or options; give those again, or begin anew with \
                     --force and without --resume",
                    path.display()
                )));
            }
        }
        let head = first.map_or(0, |line| line.len() as u64);
        let (mut end, mut scored, mut is_met) = (head, 0, false);
        while let Some((mark, length, _)) = block(&mut reader) {
            (end, scored, is_met) = (end + length, mark.scored, mark.met);
        }
        file.set_len(end).map_err(io)?;
        let mut file = BufWriter::new(file);
        file.seek(std::io::SeekFrom::Start(end)).map_err(io)?;
        Ok(Self { path, file, head, scored, is_met })
    }

    /// Keeps the text of a block that ends after so many placements, of which one meets all requirements or none does.
    pub(crate) fn push(&mut self, scored: u64, met: bool, text: &str) -> Result<(), RunError> {
        let mark = Mark { scored, met, bytes: text.len() as u64, sha256: sha256(text.as_bytes()) };
        let written = writeln!(self.file, "{}", json!(mark))
            .and_then(|()| self.file.write_all(text.as_bytes()))
            .and_then(|()| self.file.flush());
        self.scored = scored;
        written.map_err(RunError::io(&self.path))
    }

    /// Leaves the scores so far for `--resume`, and returns the path; one that holds none is removed.
    pub(crate) fn leave(mut self) -> Result<Option<PathBuf>, RunError> {
        if self.scored == 0 {
            self.remove();
            return Ok(None);
        }
        let synced = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        synced.map_err(RunError::io(&self.path))?;
        Ok(Some(self.path))
    }

    /// Takes the file away.
    pub(crate) fn remove(self) {
        let _ = std::fs::remove_file(&self.path);
    }

    /// Writes the output: `head`, all blocks, `tail`.
    pub(crate) fn finish(self, out: &Path, head: &str, tail: &str) -> Result<(), RunError> {
        let mut whole = self.file.get_ref();
        whole.seek(std::io::SeekFrom::Start(self.head)).map_err(RunError::io(&self.path))?;
        let mut reader = BufReader::new(whole);
        write_whole(out, |file| {
            file.write_all(head.as_bytes()).map_err(RunError::io(out))?;
            let mut scored = 0;
            while let Some((mark, _, text)) = block(&mut reader) {
                file.write_all(&text).map_err(RunError::io(out))?;
                scored = mark.scored;
            }
            if scored != self.scored {
                let changed = std::io::Error::other("was changed meanwhile; run again");
                return Err(RunError::io(&self.path)(changed));
            }
            file.write_all(tail.as_bytes()).map_err(RunError::io(out))
        })?;
        self.remove();
        Ok(())
    }
}

/// The file of a journal: the one there to go on with, else a new one. With `--force` the one there is taken away, so
/// that whatever else bears its name, or is linked to it, keeps its bytes.
fn own_file(path: &Path, resumes: bool, placements: &Path) -> Result<File, RunError> {
    let refuse = |words: &str| Err(RunError::Usage(format!("{}: {words}", path.display())));
    will_read(placements);
    is_no_input(path)?;
    let found = path.symlink_metadata().ok();
    let is_there = found.is_some();
    if is_there && !resumes && !is_forced() {
        return refuse(
            "holds the scores of an interrupted run; go on with --resume, or begin anew with --force",
        );
    }
    if found.is_some_and(|found| !found.is_file()) {
        return refuse(
            "is not a plain file, and the scores so far are to be kept there; move it away",
        );
    }
    let open = |is_new: bool| {
        let mut options = File::options();
        options.read(true).write(true).create_new(is_new).open(path).map_err(RunError::io(path))
    };
    let locked = |file: &File| !matches!(file.try_lock(), Err(TryLockError::WouldBlock));
    const HELD: &str = "another run writes into it; wait for its end, or name another file";
    let mut file = open(!is_there)?;
    if !locked(&file) {
        return refuse(HELD);
    }
    if is_there && !resumes {
        std::fs::remove_file(path).map_err(RunError::io(path))?;
        file = open(true)?;
        if !locked(&file) {
            return refuse(HELD);
        }
    }
    Ok(file)
}

/// Whether a kill has cut the first line, so that a file holds no scores. Leaves its place at the start.
fn is_torn(mut file: &File, head: &str) -> std::io::Result<bool> {
    let mut begin = Vec::new();
    file.take(head.len() as u64).read_to_end(&mut begin)?;
    file.rewind()?;
    Ok(begin.len() < head.len() && head.as_bytes().starts_with(&begin))
}

/// The next line with its end; `None` where there is no whole one.
fn line(reader: &mut impl BufRead) -> Option<String> {
    let mut line = String::new();
    reader.take(MAX_LINE).read_line(&mut line).ok()?;
    line.ends_with('\n').then_some(line)
}

/// The next block, its bytes with the mark, and its text; `None` where there is no whole one.
fn block(reader: &mut impl BufRead) -> Option<(Mark, u64, Vec<u8>)> {
    let line = line(reader)?;
    let mark: Mark = serde_json::from_str(&line).ok()?;
    let mut text = Vec::new();
    reader.take(mark.bytes.min(MAX_BLOCK)).read_to_end(&mut text).ok()?;
    let is_whole = text.len() as u64 == mark.bytes && sha256(&text) == mark.sha256;
    is_whole
        .then_some((line.len() as u64 + mark.bytes, text))
        .map(|(length, text)| (mark, length, text))
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// One number of all files and options that decide about the text of the scores.
fn digest(request: &ScoreRequest, scene: &Scene, placements: &Path) -> Result<String, FileError> {
    let all = json!({
        "sightline": env!("CARGO_PKG_VERSION"),
        "scene": Input::names_of(scene.files())?,
        "placements": Input::names_of(&[placements.to_owned()])?,
        "format": request.format,
        "frames": request.frames,
        "near_field": request.near_field,
        "draw": request.draw,
        "tolerance": request.mounting.tolerance,
        "conditions": in_words(&request.conditions.condition),
        "coverage": request.coverage_out.is_some(),
    });
    Ok(sha256(all.to_string().as_bytes()))
}
