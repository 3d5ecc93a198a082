//! Bars on stderr of the work of a run.

use crate::search::{Event, Work};
use indicatif::ProgressBar;

use crate::cli::args::Talk;
use crate::cli::progress;

/// Progress of a run on stderr.
pub(super) struct Bars {
    shown: Option<(Work, ProgressBar)>,
    talk: Talk,
}

impl Bars {
    pub fn new(talk: Talk) -> Self {
        Self { shown: None, talk }
    }

    pub fn show(&mut self, event: &Event) {
        match *event {
            Event::Note(sentence) => self.talk.note(sentence),
            Event::Generation(record) => {
                if let (Some((_, bar)), Some(best)) = (&self.shown, record.best_so_far) {
                    bar.set_message(format!("· best {best:.4e}"));
                }
            }
            Event::Progress { work, done, total } => {
                if self.shown.as_ref().is_none_or(|(shown, _)| *shown != work) {
                    self.clear();
                    let bar = progress::bar(total, &work.to_string(), self.talk);
                    self.shown = Some((work, bar));
                }
                if let Some((_, bar)) = &self.shown {
                    bar.set_length(total);
                    bar.set_position(done);
                }
            }
        }
    }

    pub fn clear(&mut self) {
        if let Some((_, bar)) = self.shown.take() {
            bar.finish_and_clear();
        }
    }
}
