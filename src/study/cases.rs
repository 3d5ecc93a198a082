//! The cases of a study: measured one after the other, kept by name, skipped where they are known.

use super::{Row, StudyError};

/// Observer of a study, which may stop it.
pub trait StudyObserver {
    /// Called before the first case with the number of cases.
    fn begins(&self, _cases: usize) {}

    /// Called after each case that was measured, with all rows known so far: the state to go on from.
    fn measured(&self, _rows: &[Row]) {}

    /// Called whenever an engine was opened, with sentences that name it.
    fn opened(&self, _notes: &[String]) {}

    /// Called after each case, measured or known from before.
    fn done(&self) {}

    /// Asked often; `false` stops the study and drops the case under way.
    fn goes_on(&self) -> bool {
        true
    }
}

/// An observer that hears nothing and never stops.
impl StudyObserver for () {}

/// The cases of one study.
pub(super) struct Cases<'a> {
    known: &'a mut Vec<Row>,
    observer: &'a dyn StudyObserver,
}

impl<'a> Cases<'a> {
    /// Goes on from the rows that are `known`, which it extends.
    pub(super) fn new(known: &'a mut Vec<Row>, observer: &'a dyn StudyObserver) -> Self {
        Self { known, observer }
    }

    /// Announces the number of cases.
    pub(super) fn expect(&self, cases: usize) {
        self.observer.begins(cases);
    }

    /// The row of that name, which `measure` leaves without a name, measured unless it is known; `None` once the observer has said stop.
    pub(super) fn one(
        &mut self,
        name: &str,
        measure: impl FnOnce() -> Result<Row, StudyError>,
    ) -> Result<Option<Row>, StudyError> {
        if let Some(row) = self.known.iter().find(|row| row.name == name) {
            self.observer.done();
            return Ok(Some(row.clone()));
        }
        if !self.observer.goes_on() {
            return Ok(None);
        }
        let measured = measure();
        // A case that was cut short is not kept as if it were whole, nor is its end an error.
        if !self.observer.goes_on() {
            return Ok(None);
        }
        let row = Row { name: name.to_owned(), ..measured? };
        self.known.push(row.clone());
        self.observer.measured(self.known);
        self.observer.done();
        Ok(Some(row))
    }

    /// The rows of named cases in order, up to the one at which the observer says stop; `measure` sees the
    /// rows before its own.
    pub(super) fn each<T>(
        &mut self,
        cases: Vec<(String, T)>,
        mut measure: impl FnMut(T, &[Row]) -> Result<Row, StudyError>,
    ) -> Result<Vec<Row>, StudyError> {
        self.expect(cases.len());
        let mut rows = Vec::new();
        for (name, case) in cases {
            let Some(row) = self.one(&name, || measure(case, &rows))? else { break };
            rows.push(row);
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Stops after some questions.
    struct Patience(Cell<u32>);

    impl StudyObserver for Patience {
        fn goes_on(&self) -> bool {
            self.0.set(self.0.get().saturating_sub(1));
            self.0.get() > 0
        }
    }

    #[test]
    fn known_cases_are_not_measured_and_a_case_cut_short_is_dropped() {
        let names = || ["a", "b", "c"].map(|name| (name.to_owned(), ())).to_vec();
        let run = |known: &mut Vec<Row>, questions: u32| {
            let patience = Patience(Cell::new(questions));
            let count = Cell::new(0.0);
            let rows = Cases::new(known, &patience).each(names(), |(), rows| {
                count.set(count.get() + 1.0);
                Ok(Row::of(vec![Some(rows.len() as f64)]))
            });
            (rows.unwrap().len(), count.get())
        };
        // A case that is cut short fails without an error; a whole case that fails is an error.
        let failed = |questions: u32| {
            let patience = Patience(Cell::new(questions));
            let rows = Cases::new(&mut Vec::new(), &patience)
                .each(names(), |(), _| Err(StudyError::SeveralScenes));
            rows.map(|rows| rows.len()).ok()
        };
        assert_eq!([failed(2), failed(3)], [Some(0), None]);
        let mut known = Vec::new();
        // Two questions a case: the fourth is asked after `b` was measured, and answered with no.
        assert_eq!(run(&mut known, 4), (1, 2.0));
        assert_eq!(known.len(), 1);
        known[0].values = vec![Some(12.5)];
        assert_eq!(run(&mut known, 100), (3, 2.0));
        let values: Vec<_> = known.iter().map(|row| row.values[0]).collect();
        assert_eq!(values, [Some(12.5), Some(1.0), Some(2.0)]);
    }
}
