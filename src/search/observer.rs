//! Events of a run, and the observer that may stop it.

use std::fmt;
use std::time::Instant;

use super::generations::GenerationRecord;

/// Observer of a run, which may stop it.
///
/// Every closure from an [`Event`] to `bool` is one: `&mut |_: &Event| true` lets a run go on in silence.
pub trait Observer {
    /// Takes note of an event. `false` interrupts the run: it ends the generation or climb that is under way,
    /// confirms what it has, over few frames where there are many, and ends.
    fn on(&mut self, event: &Event) -> bool;
}

impl<F: FnMut(&Event) -> bool> Observer for F {
    fn on(&mut self, event: &Event) -> bool {
        self(event)
    }
}

/// An event of a run.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Event<'a> {
    /// Nothing new; asks only whether to go on.
    Asks,
    /// A sentence for the user: the engine taken, frames added, a layout left out, a device lost.
    Note(&'a str),
    /// A generation is scored.
    Generation(&'a GenerationRecord),
    /// A step of some work is done.
    Progress {
        /// Kind of work.
        work: Work,
        /// Steps done.
        done: u64,
        /// Steps in all, at most.
        total: u64,
    },
}

/// Work that takes many steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Work {
    /// Frames looked at for the choice of the search's first frames.
    Frames,
    /// Sensor poses cast for the choice of equipment.
    Equipment,
    /// Rounds of exchanges in the choice of equipment.
    Exchanges,
    /// Casts of given placements, which may have better sensors than the choice has.
    Given,
    /// Choices of sensors along a front.
    Choices,
    /// Searches of poses around the placements of a front, in hundredths of one.
    Polish,
    /// Placements of a front whose own body, range cards and tolerances are looked at.
    Looks,
    /// Placements of the generations.
    Generations,
    /// Sensor poses cast for swaps.
    Swaps,
    /// Climbs of swaps among poses that are cast.
    Climbs,
    /// Casts, of a sensor pose in a frame, for swaps over more frames.
    Refinements,
    /// Sensor poses cast for swaps against flaws of the best end: a look at the own body, blind sectors.
    Mending,
    /// Moves of single LiDARs, looked at for requirements that are to hold within the mounting tolerance.
    Securing,
    /// Sets of sensors looked at for the bound on the gain.
    Bounds,
    /// Placements scored over all frames.
    Confirming {
        /// How many frames.
        frames: usize,
    },
}

impl fmt::Display for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frames => f.write_str("frames looked at to choose a few"),
            Self::Equipment => f.write_str("poses for the choice of sensors"),
            Self::Exchanges => f.write_str("rounds of exchanged sensors at most"),
            Self::Given => f.write_str("casts of given placements, in place of the sensors chosen"),
            Self::Choices => f.write_str("choices of sensors along the front at most"),
            Self::Polish => f.write_str("steps of the search around the front"),
            Self::Looks => f.write_str("placements of the front looked at closely"),
            Self::Generations => f.write_str("placements"),
            Self::Swaps => f.write_str("poses for swaps"),
            Self::Climbs => f.write_str("climbs of swaps at most"),
            Self::Mending => {
                f.write_str("poses for swaps against blind sectors and the own body at most")
            }
            Self::Securing => f.write_str("moves within the mounting tolerance at most"),
            Self::Refinements => f.write_str("casts for swaps over more frames at most"),
            Self::Bounds => f.write_str("first poses bounded"),
            Self::Confirming { frames } => {
                write!(f, "placements confirmed over all {frames} frames")
            }
        }
    }
}

/// An observer with a deadline, which remembers an interruption.
pub(super) struct Watch<'a> {
    observer: &'a mut dyn Observer,
    pub(super) deadline: Option<Instant>,
    pub(super) interrupted: bool,
}

impl<'a> Watch<'a> {
    pub(super) fn new(observer: &'a mut dyn Observer, interrupted: bool) -> Self {
        Self { observer, deadline: None, interrupted }
    }

    pub(super) fn until(observer: &'a mut dyn Observer, deadline: Option<Instant>) -> Self {
        Self { observer, deadline, interrupted: false }
    }

    /// Passes an event to the observer; false once the observer or the deadline ends the run.
    pub(super) fn tell(&mut self, event: &Event) -> bool {
        let goes_on = self.observer.on(event);
        self.interrupted |= !goes_on;
        !self.is_over()
    }

    /// True unless the observer or the deadline ends the run.
    pub(super) fn goes_on(&mut self) -> bool {
        self.tell(&Event::Asks)
    }

    pub(super) fn note(&mut self, sentence: &str) {
        self.tell(&Event::Note(sentence));
    }

    pub(super) fn why_over(&self) -> &'static str {
        if self.interrupted { "interrupted" } else { "the time is over" }
    }

    pub(super) fn is_over(&self) -> bool {
        self.interrupted || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}
