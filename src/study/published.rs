//! Every score of the published placements against the results of trained models in the paper.

use super::scene::StudyScene;
use super::table::{Cases, SCORES, made_large, shown_objective};
use super::{Row, StudyError, Table, TablePlot, table};
use crate::json::counted;
use crate::score::{Scores, kendall_tau, mean_height, spearman};
use crate::vehicle::{Placement, random_placements_by_the_rules};

/// Placement, mean mIoU of four segmentation models, mean car mAP and mean pedestrian mAP of four
/// detectors, in per cent: Place3D, NeurIPS 2024. "Ours" is Ours-seg for segmentation and Ours-det for
/// detection.
const PUBLISHED: [(&str, f64, f64, f64); 8] = [
    ("Center", 69.1, 52.5, 26.9),
    ("Line", 63.9, 49.7, 28.9),
    ("Pyramid", 66.6, 52.2, 28.2),
    ("Square", 65.8, 50.0, 28.4),
    ("Trapezoid", 63.8, 50.9, 29.3),
    ("Line-roll", 64.0, 51.0, 28.3),
    ("Pyramid-roll", 67.6, 52.1, 28.2),
    ("Ours", 71.1, 53.4, 30.0),
];

type ComparedScore = (&'static str, fn(&Scores) -> Option<f64>);

/// Every score that is compared with the published results.
const METRICS: [ComparedScore; 10] = [
    ("m_sog", |s| s.segmentation.m_sog),
    ("m_sog_scaled", |s| s.segmentation.m_sog_scaled),
    ("m_sog_nonzero", |s| s.segmentation.m_sog_nonzero),
    ("m_sog_scaled_nonzero", |s| s.segmentation.m_sog_scaled_nonzero),
    ("information_gain", |s| s.segmentation.information_gain),
    ("near_gain", |s| s.near_gain),
    ("s_mig", |s| s.s_mig),
    ("detection.m_sog", |s| s.detection?.m_sog),
    ("detection.m_sog_scaled", |s| s.detection?.m_sog_scaled),
    ("detection.information_gain", |s| s.detection?.information_gain),
];

/// Tasks of [`PUBLISHED`], each with its column and the name of its "Ours" in Table 7.
const TASKS: [(&str, usize, &str); 3] =
    [("mIoU", 0, "Ours-seg"), ("car mAP", 1, "Ours-det"), ("pedestrian mAP", 2, "Ours-det")];

/// Results of one task by placement, "Ours" under its name in Table 7.
fn results_of(task: usize) -> Vec<(&'static str, f64)> {
    let (_, column, ours) = TASKS[task];
    PUBLISHED
        .iter()
        .map(|&(name, seg, car, pedestrian)| {
            (if name == "Ours" { ours } else { name }, [seg, car, pedestrian][column])
        })
        .collect()
}

pub(super) fn published(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let edge = scene.settings.voxel;
    let mut evaluator = None;
    let placements = scene.layouts.iter().map(|p| (p.name.clone(), p)).collect();
    let scored = cases.each(placements, |placement, _| {
        let evaluator = match &mut evaluator {
            Some(evaluator) => evaluator,
            None => evaluator.insert(scene.evaluator_of_voxels([edge; 3])?),
        };
        let scores = scene.score(evaluator, placement)?;
        let values = METRICS.iter().map(|(_, of)| of(&scores)).collect();
        Ok(Row { placement: Some(placement.clone()), ..Row::of(values) })
    })?;
    let mut rows: Vec<Row> = METRICS
        .iter()
        .enumerate()
        .map(|(metric, (name, _))| {
            row(name, &|placement| {
                scored.iter().find(|row| row.name == placement).and_then(|row| row.values[metric])
            })
        })
        .collect();
    rows.push(row("mean height (null model)", &|placement| {
        scene.layouts.iter().find(|p| p.name == placement).map(mean_height)
    }));
    let notes = vec![format!(
        "Spearman's rank correlation over the eight published placements (n = 8: below 0.74 it is not \
         significant at 5 %), voxels of {edge} m, {}. A score that does not beat the null model \
         says no more than that higher LiDARs see more.",
        counted(scene.frames().len(), "frame")
    )];
    let columns = std::iter::once("score").chain(TASKS.map(|(name, ..)| name));
    let drawing = TablePlot::ByCase {
        columns: (0..TASKS.len()).collect(),
        y_title: "Spearman's rank correlation".into(),
        line: false,
    };
    let title = scene.title("scores against published results");
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// Rank correlations of a number of each placement with the published results of each task; `None` where
/// a placement has no number.
fn row(name: &str, of: &dyn Fn(&str) -> Option<f64>) -> Row {
    let correlation = |task: usize| -> Option<f64> {
        let pairs: Option<Vec<(f64, f64)>> =
            results_of(task).into_iter().map(|(name, result)| Some((of(name)?, result))).collect();
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs?.into_iter().unzip();
        spearman(&ours, &theirs)
    };
    Row { name: name.to_owned(), ..Row::of((0..TASKS.len()).map(correlation).collect()) }
}

/// Name of the case in which all random placements are scored: its values are those of [`quantiles`], then how many
/// placements meet all requirements; `unmet_at` has the quantiles whose placement misses one.
const RANDOM: &str = "random, best";

pub(super) fn random(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let settings = scene.settings;
    let count = settings.random as usize;
    let drawn = random_placements_by_the_rules(&scene.rig()?.constraints, count, settings.seed);
    cases.expect(2 + scene.layouts.len());
    let mut evaluator = scene.evaluator_of_rig()?;
    let value = |scores: &Scores| shown(scene, scores);
    let case = cases.one(RANDOM, || {
        let scores = scene.scores(&mut evaluator, &drawn)?;
        let unguarded = |of: &Scores| value(of).filter(|_| of.guards.is_empty());
        let values: Vec<Option<f64>> = scores.iter().map(unguarded).collect();
        let Some(at) = quantiles(&values) else {
            let warning = scores.iter().find_map(|of| of.guards.first()).map(ToString::to_string);
            return Ok(Row { warning, ..Row::default() });
        };
        let mut shown: Vec<Option<f64>> = at.iter().map(|&k| values[k]).collect();
        let misses: Vec<bool> = scores.iter().map(|of| of.missing() > 0.0).collect();
        shown.push(Some(misses.iter().filter(|misses| !**misses).count() as f64));
        let row = Row::scored(shown, drawn[at[0]].clone(), &scores[at[0]]);
        let unmet_at = (0..at.len()).filter(|&number| misses[at[number]]).collect();
        Ok(Row { unmet_at, ..row })
    })?;
    let met = case.as_ref().and_then(|row| met_in_words(row, drawn.len()));
    let none = case.as_ref().and_then(|row| row.warning.as_ref());
    let none = none.map(|guard| format!("No random placement counts; one violates {guard}."));
    let mut rows = case.map_or_else(Vec::new, |row| rows_of(&row));
    for placement in &scene.layouts {
        rows.extend(cases.one(&placement.name, || {
            let scores = scene.score(&mut evaluator, placement)?;
            Ok(row_of(value(&scores), placement.clone(), &scores))
        })?);
    }
    rows.extend(cases.one(&searched(&scene.layouts), || {
        let Some(best) = scene.optimize(&evaluator)? else { return Ok(scene.none_found()) };
        let scores = scene.score(&mut evaluator, &best)?;
        Ok(row_of(value(&scores), best, &scores))
    })?);
    let mut notes = vec![format!(
        "{} random placements, uniform in every pose field that may vary; those that violate a guard do \
         not count. The optimized one had {} evaluations and swaps.",
        drawn.len(),
        settings.evaluations
    )];
    notes.extend(none.into_iter().chain(met));
    notes.extend(broken_rules(scene));
    notes.extend(prices(scene, &rows));
    let title = scene.title("random, hand-made and optimized placements");
    let (objective, _) = shown_objective(&settings.objective);
    let drawing = TablePlot::of_column(0, &objective, false);
    Ok(Table::new(title, ["placement", &objective, "guards violated"], rows, notes, drawing))
}

/// Name of the placement that is searched: rigs of a run are called `optimized`, too.
fn searched(layouts: &[Placement]) -> String {
    let is_taken = layouts.iter().any(|layout| layout.name == "optimized");
    if is_taken { "optimized by this study" } else { "optimized" }.to_owned()
}

/// Sentence on how many of `all` random placements meet all requirements; `None` without requirements.
fn met_in_words(random: &Row, all: usize) -> Option<String> {
    random.requirements_met?;
    let met = random.values.get(5).copied().flatten()?;
    Some(format!(
        "{met} of {all} random placements meet all requirements; a row with `!` is a placement that misses one, or violates \
         a guard."
    ))
}

/// Sentence on own rigs that break rules of the vehicle.
fn broken_rules(scene: &StudyScene) -> Option<String> {
    let (vehicle, rules) = (scene.scene.vehicle(), scene.scene.rules());
    let of = |rig: &Placement| {
        let broken = vehicle.broken_rules(&rules, rig);
        (!broken.is_empty()).then(|| format!("{}: {}", rig.name, broken.join(", ")))
    };
    let broken: Vec<String> = scene.settings.placements.iter().filter_map(of).collect();
    (!broken.is_empty())
        .then(|| format!("Rules of the vehicle are broken by {}.", broken.join("; ")))
}

/// Sentence on the prices of the placements where these differ.
fn prices(scene: &StudyScene, rows: &[Row]) -> Option<String> {
    let price = |row: &Row| scene.scene.vehicle().price_of_rig(row.placement.as_ref()?);
    let all: Vec<(f64, &str)> =
        rows.iter().filter_map(|row| Some((price(row)?, &*row.name))).collect();
    let differ = all.iter().any(|(price, _)| *price != all[0].0);
    let each: Vec<String> = all.iter().map(|(price, name)| format!("{name} {price}")).collect();
    differ.then(|| {
        format!("Prices differ: {}; --budget limits what is drawn and searched.", each.join(", "))
    })
}

/// The row of one placement, with the first guard that it violates: a warning, or the reason why there is no value.
fn row_of(value: Option<f64>, placement: Placement, scores: &Scores) -> Row {
    let guard = scores.guards.first().map(ToString::to_string);
    let [warning, no_answer] = if value.is_some() { [guard, None] } else { [None, guard] };
    let values = vec![value, value.map(|_| scores.guards.len() as f64)];
    Row { warning, no_answer, ..Row::scored(values, placement, scores) }
}

/// The objective of a placement in the unit of its title.
fn shown(scene: &StudyScene, scores: &Scores) -> Option<f64> {
    let objective = &scene.settings.objective;
    let (_, factor) = shown_objective(objective);
    objective.value(scores).map(|value| factor * value)
}

/// Places of the best, worst, lower quartile, median and upper quartile of the values there are; a quartile is the nearest
/// value in rank, of equal values the first is the best. `None` without values.
fn quantiles(values: &[Option<f64>]) -> Option<[usize; 5]> {
    let known = values.iter().enumerate().filter_map(|(k, value)| Some((k, (*value)?)));
    let mut sorted: Vec<(usize, f64)> = known.collect();
    // Among equal values the first stands last: it is the best.
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    let last = sorted.len().checked_sub(1)?;
    Some([1.0, 0.0, 0.25, 0.5, 0.75].map(|share| sorted[(share * last as f64).round() as usize].0))
}

/// A row for each quantile, from the worst to the best; none where no random placement counts.
fn rows_of(random: &Row) -> Vec<Row> {
    let [Some(best), Some(worst), Some(low), Some(median), Some(high), ..] = random.values[..]
    else {
        return Vec::new();
    };
    let named = [
        ("random, worst", worst, 1),
        ("random, lower quartile", low, 2),
        ("random, median", median, 3),
        ("random, upper quartile", high, 4),
        (RANDOM, best, 0),
    ];
    let row = |(name, value, number): (&str, f64, usize)| {
        let of = if name == RANDOM { random.clone() } else { Row::default() };
        let met = random.requirements_met.map(|_| !random.unmet_at.contains(&number));
        let (name, values) = (name.to_owned(), vec![Some(value), Some(0.0)]);
        Row { name, values, requirements_met: met, unmet_at: Vec::new(), ..of }
    };
    named.map(row).to_vec()
}

/// Heights from the lowest to the highest of the mount.
const HEIGHTS: u32 = 4;

pub(super) fn height(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let mounts = &scene.scene.vehicle().mounts;
    if mounts.len() > 1 || mounts[0].region.ego_from_region.is_some() {
        let names: Vec<&str> = mounts.iter().map(|mount| mount.region.name.as_str()).collect();
        let mounts = counted(names.len(), "mount");
        let mounts = format!("{mounts} of their own heights: {}", names.join(", "));
        return Err(StudyError::NoHeights { scene: scene.place(), mounts });
    }
    let rules = &scene.rig()?.constraints;
    let [low, high] = rules.corners().map(|corner| corner[2]);
    let at = |k: u32| low + f64::from(k) * (high - low) / f64::from(HEIGHTS - 1);
    let mut heights: Vec<(String, [f64; 2])> =
        (0..HEIGHTS).map(|k| (format!("{:.2} m", at(k)), [at(k); 2])).collect();
    heights.dedup_by(|a, b| a.0 == b.0);
    heights.push(("free".into(), [low, high]));
    let rows = cases.each(heights, |[low, high], _| {
        let constraints = rules.with_regions(|region| {
            (region.lower[2], region.upper[2]) = (low, high);
        });
        let mut evaluator = scene.evaluator_under(&constraints)?;
        table::of_best(scene, &mut evaluator, &scene.rig()?.starts)
    })?;
    let notes = vec![
        "All LiDARs of a case stand at one height (the paper's 2D plane), those of the last where they \
         like within the mount."
            .to_owned(),
    ];
    let title = scene.title("the best placement at each height");
    let columns = ["height"].into_iter().chain(SCORES);
    let drawn = made_large(&scene.settings.objective);
    Ok(Table::new(title, columns, rows, notes, TablePlot::of_column(drawn, SCORES[drawn], true)))
}

/// Voxel sizes of the paper's study, in metres.
const VOXELS: [[f64; 3]; 4] =
    [[0.2, 0.2, 0.2], [0.1, 0.15, 0.2], [0.1, 0.1, 0.1], [0.05, 0.1, 0.1]];

pub(super) fn voxels(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    scene.may_have_voxels()?;
    let layouts = scene.some_layouts()?;
    let sizes = VOXELS.map(|voxel| (format!("{voxel:?} m"), voxel)).to_vec();
    let rows = cases.each(sizes, |voxel, _| {
        let scores = scene.scores(&mut scene.evaluator_of_voxels(voxel)?, layouts)?;
        let scaled = scores.iter().map(|s| s.segmentation.m_sog_scaled.map(|v| 1e6 * v));
        Ok(Row::of(scaled.collect()))
    })?;
    let heights: Vec<f64> = layouts.iter().map(mean_height).collect();
    let ranked = |row: &Row| -> Vec<f64> { row.values.iter().map(|v| v.unwrap_or(0.0)).collect() };
    let mut notes = vec![
        "M-SOG/N ×1e-6 of each placement; sizes differ in N, so rankings are compared and not \
         scores."
            .to_owned(),
    ];
    for row in &rows {
        notes.push(format!(
            "{}: Kendall's τ with {} {}; Spearman with mean height alone {}",
            row.name,
            rows[0].name,
            words(kendall_tau(&ranked(&rows[0]), &ranked(row))),
            words(spearman(&heights, &ranked(row)))
        ));
    }
    let drawing = TablePlot::ByColumn {
        columns: (0..layouts.len()).collect(),
        x_title: "placement".into(),
        y_title: "M-SOG/N ×1e-6".into(),
    };
    let columns = std::iter::once("voxel").chain(layouts.iter().map(|p| p.name.as_str()));
    Ok(Table::new(scene.title("four voxel sizes"), columns, rows, notes, drawing))
}

fn words(value: Option<f64>) -> String {
    value.map_or("does not exist".into(), |v| format!("{v:.2}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Guard;

    #[test]
    fn the_published_numbers_agree_with_themselves_and_ours_stands_for_each_task() {
        for (task, (_, column, ours)) in TASKS.iter().enumerate() {
            let own = |name: &str| {
                let found =
                    PUBLISHED.iter().find(|p| p.0 == name || p.0 == "Ours" && name == *ours);
                found.map(|&(_, seg, car, pedestrian)| [seg, car, pedestrian][*column])
            };
            assert_eq!(row("own", &own).values[task], Some(1.0));
        }
        assert_eq!(row("none", &|_| None).values, [None; 3]);
        // Falling with the names' order in the table says nothing of either: ρ by hand for mIoU.
        let ranks = |name: &str| results_of(0).iter().position(|r| r.0 == name).map(|k| k as f64);
        // mIoU in rank order of the table: 6 1 4 3 0 2 5 7 against 0 1 2 3 4 5 6 7. By hand:
        // 1 − 6 · (36 + 0 + 4 + 0 + 16 + 9 + 1 + 0) / (8 · 63) = 1 − 396 / 504.
        let found = row("order", &ranks).values[0].unwrap();
        assert!((found - (1.0 - 396.0 / 504.0)).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_value_beside_a_violated_guard_is_shown_and_marked() {
        let row = |value: Option<f64>, guards: &[Guard]| {
            let rig = Placement { name: "mine".into(), lidars: vec![] };
            let scores = Scores { guards: guards.to_vec(), ..Scores::default() };
            Row { name: "mine".into(), ..row_of(value, rig, &scores) }
        };
        let short = row(Some(37.5), &[Guard::ShortSight { lost: 0.05 }]);
        assert_eq!((&*short.values, &*short.marked()), (&[Some(37.5), Some(1.0)][..], "! mine"));
        let told: Vec<String> = short.remarks().collect();
        assert!(told.len() == 1 && told[0].starts_with("! mine: short_sight: "), "{told:?}");
        let free = row(Some(37.5), &[]);
        assert_eq!((&*free.values, &*free.marked()), (&[Some(37.5), Some(0.0)][..], "mine"));
        let blind = row(None, &[Guard::CoversNothing]);
        assert_eq!((&*blind.values, &*blind.marked()), (&[None, None][..], "mine"));
        assert!(blind.no_answer.unwrap().starts_with("covers_nothing: "));
    }

    #[test]
    fn a_rig_of_a_run_takes_no_name_of_the_study() {
        let named = |name: &str| [Placement { name: name.into(), lidars: vec![] }];
        assert_eq!(searched(&named("mine")), "optimized");
        assert_ne!(searched(&named("optimized")), "optimized");
    }

    #[test]
    fn quantiles_of_the_values_there_are() {
        let values = [Some(4.0), None, Some(1.0), Some(3.0), Some(5.0), Some(2.0), Some(5.0)];
        // Sorted 1 2 3 4 5 5: ranks 1.25, 2.5 and 3.75 of 0 to 5, rounded to 1, 3 and 4.
        let found = quantiles(&values).unwrap();
        assert_eq!(found, [4, 2, 5, 0, 6]);
        assert_eq!(found.map(|k| values[k].unwrap()), [5.0, 1.0, 2.0, 4.0, 5.0]);
        assert_eq!(quantiles(&[None]), None);
    }

    #[test]
    fn quantiles_whose_placement_misses_a_requirement_are_marked() {
        let mut random = Row::of([5.0, 1.0, 2.0, 4.0, 5.0, 3.0].map(Some).to_vec());
        let marked = |random: &Row| -> Vec<String> {
            let rows = rows_of(random);
            assert!(rows.iter().all(|row| row.unmet_at.is_empty() && row.values.len() == 2));
            rows.iter().map(Row::marked).filter(|name| name.starts_with('!')).collect()
        };
        assert!(marked(&random).is_empty() && met_in_words(&random, 9).is_none());
        assert!(rows_of(&random).iter().all(|row| row.requirements_met.is_none()));
        (random.requirements_met, random.unmet_at) = (Some(true), vec![1, 3]);
        assert_eq!(marked(&random), ["! random, worst", "! random, median"]);
        assert!(met_in_words(&random, 9).unwrap().starts_with("3 of 9 random placements meet"));
    }
}
