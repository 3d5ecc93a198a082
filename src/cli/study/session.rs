use std::io::Write;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sightline::report::Plot;
use sightline::study::{Row, Table};

use crate::cli::args::Talk;
use crate::cli::error::Error;
use crate::cli::interrupt::Interrupt;
use crate::cli::output::{writable_folder, write_whole};
use crate::cli::progress;

/// What a study has come to.
pub(super) struct Study {
    pub table: Table,
    pub plot: Plot,
}

/// A study's folder: cases that were done before are read, new ones are saved one by one.
pub(super) struct Session {
    folder: PathBuf,
    settings: Value,
    done: Vec<Row>,
    interrupt: Interrupt,
    bar: ProgressBar,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    settings: Value,
    rows: Vec<Row>,
    #[serde(default)]
    notes: Vec<String>,
}

impl Session {
    /// Opens a folder; one that holds another study is an error.
    pub fn open(
        folder: &Path,
        settings: &Value,
        interrupt: &Interrupt,
        talk: Talk,
    ) -> Result<Self, Error> {
        writable_folder(folder)?;
        let file = folder.join("study.json");
        let mut done = Vec::new();
        if file.exists() {
            let json = |source| Error::Json { path: file.clone(), source };
            let text = std::fs::read_to_string(&file).map_err(Error::io(&file))?;
            let saved: Saved = serde_json::from_str(&text).map_err(json)?;
            if saved.settings != *settings {
                return Err(Error::Usage(format!(
                    "{}: holds a study of other settings or other files; name another folder with --out",
                    folder.display()
                )));
            }
            done = saved.rows;
        }
        let (folder, settings) = (folder.to_owned(), settings.clone());
        let bar = progress::bar(0, "cases", talk);
        Ok(Self { folder, settings, done, interrupt: interrupt.clone(), bar })
    }

    /// How many cases there will be, for the time left.
    pub fn expect(&self, cases: usize) {
        self.bar.set_length(cases as u64);
    }

    /// The case of that name, measured unless it was before; `None` after Ctrl-C.
    pub fn case(
        &mut self,
        name: &str,
        measure: impl FnOnce() -> Result<Row, Error>,
    ) -> Result<Option<Row>, Error> {
        self.bar.inc(1);
        if let Some(row) = self.done.iter().find(|row| row.name == name) {
            return Ok(Some(row.clone()));
        }
        if self.interrupt.is_set() {
            return Ok(None);
        }
        let row = measure()?;
        // What was cut short is not kept as if it were whole.
        if self.interrupt.is_set() {
            return Ok(None);
        }
        self.done.push(row.clone());
        self.save(&[])?;
        Ok(Some(row))
    }

    fn save(&self, notes: &[String]) -> Result<(), Error> {
        let path = self.folder.join("study.json");
        let saved = Saved {
            settings: self.settings.clone(),
            rows: self.done.clone(),
            notes: notes.to_vec(),
        };
        write_whole(&path, |file| {
            serde_json::to_writer_pretty(&mut *file, &saved)
                .map_err(|source| Error::Json { path: path.clone(), source })?;
            file.write_all(b"\n").map_err(Error::io(&path))
        })
    }

    /// Writes table and chart of the cases there are.
    pub fn finish(&self, study: &Study) -> Result<(), Error> {
        self.bar.finish_and_clear();
        self.save(&study.table.notes)?;
        for (name, text) in [("table.csv", study.table.csv()), ("chart.svg", study.plot.svg())] {
            let path = self.folder.join(name);
            write_whole(&path, |file| file.write_all(text.as_bytes()).map_err(Error::io(&path)))?;
        }
        Ok(())
    }
}
