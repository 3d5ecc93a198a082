//! Weather: own rigs in clear air, and under each condition for itself.

use super::cases::Cases;
use super::columns::{self, SCORES, check_distinct, made_large};
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::job::{Job, JobError};
use crate::scan::conditions::Condition;
use crate::search::Evaluator;
use crate::targets::CARD_BEAMS;
use crate::vehicle::Placement;

/// Conditions without any in the settings, at their usual strengths.
const USUAL: [&str; 3] = ["fog", "snow", "rain"];
/// Columns after the scores.
const LAST: [&str; 2] = ["not met", "car ahead m"];

pub(super) fn weather(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let skies = skies(&scene.settings.conditions)?;
    let mut named = Vec::new();
    for (index, (sky, condition)) in skies.iter().enumerate() {
        let rigs = scene.some_layouts()?.iter();
        named.extend(rigs.map(|rig| (format!("{}, {sky}", rig.name), (index, condition, rig))));
    }
    let mut open: Option<(usize, Job, Evaluator)> = None;
    let rows = cases.each(named, |(index, condition, rig), _| {
        // One engine at a time: rigs under one condition follow each other.
        let (_, job, evaluator) = match open.take() {
            Some(known) if known.0 == index => open.insert(known),
            _ => {
                let (job, evaluator) = scene.in_condition(condition)?;
                open.insert((index, job, evaluator))
            }
        };
        row(scene, (job, evaluator), condition, rig)
    })?;
    let notes = vec![
        "Each condition for itself. Clear air limits no beam, as `score` without --condition does; under a condition a \
         beam counts that its sensor's echo model returns. not met: requirements."
            .to_owned(),
        format!(
            "car ahead m: distance up to which a car straight ahead has {CARD_BEAMS} beams or more without a gap, on level \
             ground; 0 where it never has. Conditions other than fog, snow and rain have no such number."
        ),
    ];
    let drawn = made_large(&scene.settings.objective);
    let columns = std::iter::once("placement").chain(SCORES).chain(LAST);
    let title = scene.title("rigs in weather");
    Ok(Table::new(title, columns, rows, notes, TablePlot::of_column(drawn, SCORES[drawn], false)))
}

/// Clear air and each condition, by name.
fn skies(given: &[Condition]) -> Result<Vec<(String, Vec<Condition>)>, StudyError> {
    let usual = USUAL.iter().map(|name| name.parse());
    let all = match given {
        [] => usual.collect::<Result<_, _>>().map_err(JobError::Condition)?,
        given => given.to_vec(),
    };
    let named = all.into_iter().map(|one: Condition| (one.to_string(), vec![one]));
    let skies: Vec<_> = std::iter::once(("clear".to_owned(), Vec::new())).chain(named).collect();
    let names = skies.iter().map(|(name, _)| &**name);
    check_distinct(names, "conditions", "give each --condition once")?;
    Ok(skies)
}

/// Scores of a rig under a condition, requirements that it misses, and the range of a car ahead.
fn row(
    scene: &StudyScene,
    (job, evaluator): (&Job, &mut Evaluator),
    condition: &[Condition],
    rig: &Placement,
) -> Result<Row, StudyError> {
    let scores = scene.score(evaluator, rig)?;
    let not_met = scores.required.iter().filter(|seen| !seen.is_met()).count() as f64;
    let mut values = columns::values(&scores);
    values.push((!scores.required.is_empty()).then_some(not_met));
    if condition.iter().all(Condition::dims_light) {
        let cards = scene.range_cards(job, std::slice::from_ref(rig))?;
        let ahead = cards.first().and_then(|card| card.targets.first()?.bearings.first());
        values.push(ahead.map(|ahead| ahead.met.first().map_or(0.0, |[_, to]| *to)));
    }
    Ok(Row::scored(values, rig.clone(), &scores))
}
