//! Events of a run as sentences and bars of the watcher.

use crate::runs::{Bar, Watcher};
use crate::search::{Event, Work};

/// Progress of a run.
pub(super) struct Bars<'a> {
    shown: Option<(Work, Box<dyn Bar>)>,
    watcher: &'a dyn Watcher,
}

impl<'a> Bars<'a> {
    pub fn new(watcher: &'a dyn Watcher) -> Self {
        Self { shown: None, watcher }
    }

    pub fn show(&mut self, event: &Event) {
        match *event {
            Event::Asks => {}
            Event::Note(sentence) => self.watcher.note(sentence),
            Event::Generation(record) => {
                if let (Some((_, bar)), Some(best)) = (&self.shown, record.best_so_far) {
                    bar.say(format!("· best {best:.4e}"));
                }
            }
            Event::Progress { work, done, total } => {
                if self.shown.as_ref().is_none_or(|(shown, _)| *shown != work) {
                    self.clear();
                    let bar = self.watcher.bar(total, Some(&work.to_string()));
                    self.shown = Some((work, bar));
                }
                if let Some((_, bar)) = &self.shown {
                    bar.set(done, total);
                }
            }
        }
    }

    pub fn clear(&mut self) {
        self.shown = None;
    }
}
