//! Placements of one scene against each other.

use sightline::report::{Axis, Plot, Series};
use sightline::score::Objective;
use sightline::study::{
    Region, Row, Table, after_worst_loss, gains_by_region, most_robust, without_each,
};
use sightline::vehicle::Placement;

use super::{check_distinct, columns, plot_of, series_by_row, title};
use crate::cli::error::Error;
use crate::cli::study::bench::Bench;
use crate::cli::study::session::{Session, Study};

/// Weights of detection; the rest is that of segmentation.
const WEIGHTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

pub fn random(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    let drawn = bench.random(bench.args.random as usize);
    session.expect(2 + bench.table_7.len());
    let mut rows = Vec::new();
    let mut evaluator = bench.evaluator()?;
    let value = |scores: &sightline::score::Scores| {
        bench.objective.value(scores).filter(|_| scores.guards.is_empty())
    };
    let mut notes = Vec::new();
    // Quantiles of the random ones are one case: they come from one batch.
    let case = session.case("random, best", || {
        let scores = evaluator.scores(&drawn)?;
        let best = (0..scores.len()).filter_map(|k| Some((k, value(&scores[k])?)));
        let best = best.max_by(|a, b| a.1.total_cmp(&b.1));
        let mut values: Vec<f64> = scores.iter().filter_map(value).collect();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (share * (values.len().max(1) - 1) as f64).round() as usize;
            values.get(index).copied()
        };
        let placement = best.map(|(k, _)| drawn[k].clone());
        let values = vec![best.map(|b| b.1), at(0.0), at(0.25), at(0.5), at(0.75)];
        Ok(Row { name: "random, best".into(), values, placement })
    })?;
    let quantiles = case.map(|row| row.values.clone()).unwrap_or_default();
    if let [Some(best), Some(worst), Some(low), Some(median), Some(high)] = quantiles[..] {
        for (name, v) in [
            ("random, worst", worst),
            ("random, lower quartile", low),
            ("random, median", median),
            ("random, upper quartile", high),
            ("random, best", best),
        ] {
            rows.push(Row { name: name.into(), values: vec![Some(v)], placement: None });
        }
    }
    for placement in bench.table_7.clone() {
        let case = session.case(&placement.name, || {
            let scores = bench.score(&mut evaluator, &placement)?;
            let values = vec![value(&scores)];
            Ok(Row { name: placement.name.clone(), values, placement: Some(placement.clone()) })
        })?;
        rows.extend(case);
    }
    let case = session.case("optimized", || {
        let best = bench.optimize(&mut evaluator, &bench.table_7)?;
        let values = match &best {
            Some(best) => vec![value(&bench.score(&mut evaluator, best)?)],
            None => vec![None],
        };
        Ok(Row { name: "optimized".into(), values, placement: best })
    })?;
    rows.extend(case);
    notes.push(format!(
        "{} random placements, uniform in every pose field that may vary; those that violate a guard do \
         not count. The optimized one had {} evaluations and swaps.",
        drawn.len(),
        bench.args.evaluations
    ));
    let title = title(bench, "random, hand-made and optimized placements");
    let objective = bench.objective.to_string();
    let table = Table { title, columns: columns("placement", &[&objective]), rows, notes };
    let mut plot = plot_of(&table, &objective, "placement");
    plot.series[0].line = false;
    Ok(Study { table, plot })
}

pub fn tasks(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    session.expect(WEIGHTS.len());
    let mut evaluator = bench.evaluator()?;
    if !evaluator.problem().content().has_detection() {
        return Err(Error::Usage(format!(
            "{}: has no detection target; name its classes under `detection` in the scene",
            bench.args.scenes[0].display()
        )));
    }
    let mut rows = Vec::new();
    for weight in WEIGHTS {
        let name = format!("{weight:.2}");
        let case = session.case(&name, || {
            let share = "information_gain_share";
            let text = format!("{}*{share} + {weight}*detection.{share}", 1.0 - weight);
            let objective: Objective = text.parse()?;
            let best = bench.optimize_for(&mut evaluator, &objective, &bench.table_7)?;
            let mut values = vec![None, None];
            if let Some(best) = &best {
                let scores = bench.score(&mut evaluator, best)?;
                let percent = |task: Option<f64>| task.map(|v| 100.0 * v);
                values = vec![
                    percent(scores.segmentation.information_gain_share),
                    percent(scores.detection.and_then(|d| d.information_gain_share)),
                ];
            }
            Ok(Row { name: name.clone(), values, placement: best })
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let points: Vec<(f64, f64)> = rows
        .iter()
        .map(|row| (row.values[0].unwrap_or(f64::NAN), row.values[1].unwrap_or(f64::NAN)))
        .collect();
    let beaten = |a: (f64, f64)| points.iter().any(|b| b.0 >= a.0 && b.1 >= a.1 && *b != a);
    let front: Vec<&str> = rows
        .iter()
        .zip(&points)
        .filter(|(_, point)| !beaten(**point))
        .map(|(row, _)| row.name.as_str())
        .collect();
    let notes = vec![format!(
        "Not beaten in both tasks (Pareto front): weight {}. Others were cut short by the {} evaluations \
         of each search.",
        front.join(", "),
        bench.args.evaluations
    )];
    let labels = rows.iter().enumerate().map(|(k, row)| (k, row.name.clone())).collect();
    let title = title(bench, "one placement for two tasks");
    let table = Table {
        title: title.clone(),
        columns: columns("weight of detection", &["segmentation gain %", "detection gain %"]),
        rows,
        notes,
    };
    let plot = Plot {
        title,
        x_title: "segmentation: share of the information gained, %".into(),
        y_title: "detection: share of the information gained, %".into(),
        x: Axis::Numbers,
        series: vec![Series { name: "by weight of detection".into(), points, line: false, labels }],
    };
    Ok(Study { table, plot })
}

pub fn regions(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    let mut regions = Region::standard();
    regions.extend(bench.args.boxes.iter().cloned());
    let names = regions.iter().map(|region| region.name.as_str());
    check_distinct(names, "regions", "give each --box a name of its own")?;
    session.expect(bench.table_7.len() + 1);
    let mut evaluator = bench.evaluator()?;
    let mut placements: Vec<(String, Option<Placement>)> =
        bench.table_7.iter().map(|p| (p.name.clone(), Some(p.clone()))).collect();
    placements.push(("optimized".into(), None));
    let mut rows = Vec::new();
    for (name, placement) in placements {
        let case = session.case(&name, || {
            let placement = match placement {
                Some(placement) => Some(placement),
                None => bench.optimize(&mut evaluator, &bench.table_7)?,
            };
            let Some(placement) = placement else {
                return Ok(Row { name: name.clone(), values: vec![], placement: None });
            };
            let mut covered = Vec::new();
            for frame in 0..evaluator.problem().frame_count() {
                covered.push(evaluator.backend_mut().covered(&placement, frame)?);
            }
            let problem = evaluator.shared_problem();
            let (roi, content) = (problem.roi(), problem.content());
            let gains = gains_by_region(roi, content, &regions, &covered);
            let share = |part: f64, whole: f64| (whole > 0.0).then(|| 100.0 * part / whole);
            let mut values: Vec<Option<f64>> =
                gains.iter().map(|gain| share(gain.gained, gain.total)).collect();
            let scores = bench.score(&mut evaluator, &placement)?;
            for (class, (_, seen)) in scores.covered_by_class.iter().enumerate() {
                values.push(share(*seen, content.voxels_of_class(class).len() as f64));
            }
            Ok(Row { name: name.clone(), values, placement: Some(placement) })
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let classes = evaluator.problem().content().classes().to_vec();
    let names: Vec<String> = regions
        .iter()
        .map(|r| format!("{} %", r.name))
        .chain(classes.iter().map(|c| format!("{c} %")))
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let notes = vec![
        "Regions: share of the information that lies there and is gained; near ends at 10 m, middle at \
         25 m; front and rear are 90° wide. Classes: share of the voxels in which the class ever occurs \
         that are covered; empty where the scene has none."
            .to_owned(),
    ];
    let title = title(bench, "what is seen where, and of what");
    let table = Table { title: title.clone(), columns: columns("placement", &names), rows, notes };
    let series = names.iter().take(regions.len().min(8)).map(|name| {
        let mut one = plot_of(&table, name, "placement").series.remove(0);
        (*name).clone_into(&mut one.name);
        one.line = false;
        one
    });
    let series = series.collect();
    let plot = Plot {
        y_title: "share of the region's information gained, %".into(),
        series,
        ..plot_of(&table, names[0], "placement")
    };
    Ok(Study { table, plot })
}

pub fn loss(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    session.expect(2);
    let mut evaluator = bench.evaluator()?;
    if bench.constraints().lidars < 2 {
        return Err(Error::Usage(format!(
            "{}: its mount has one LiDAR; without it nothing is left to score",
            bench.args.scenes[0].display()
        )));
    }
    let objective = bench.objective.clone();
    let mut rows: Vec<Row> = Vec::new();
    for name in ["optimized", "optimized for the worst loss"] {
        // The best of all LiDARs is a start of the second search, which can so not end below it.
        let mut starts: Vec<Placement> =
            rows.iter().filter_map(|row| row.placement.clone()).collect();
        starts.extend(bench.table_7.iter().cloned());
        let case = session.case(name, || {
            let go_on = || bench.goes_on();
            let found = if name == "optimized" {
                bench.optimize(&mut evaluator, &bench.table_7)?
            } else {
                let (evaluations, seed) = (bench.args.evaluations, bench.args.seed);
                most_robust(&mut evaluator, &objective, &starts, evaluations, seed, &go_on)?
                    .map(|(placement, _)| placement)
            };
            let Some(placement) = found else {
                return Ok(Row { name: name.into(), values: vec![], placement: None });
            };
            let whole = objective.value(&bench.score(&mut evaluator, &placement)?);
            let worst =
                after_worst_loss(&mut evaluator, &objective, std::slice::from_ref(&placement))?[0];
            let left = evaluator.scores(&without_each(&placement))?;
            let mut values = vec![whole, worst];
            values.extend(left.iter().map(|scores| objective.value(scores)));
            Ok(Row { name: name.into(), values, placement: Some(placement) })
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let losses: Vec<String> =
        (0..bench.constraints().lidars).map(|lidar| format!("without LiDAR {lidar}")).collect();
    let mut more = vec!["all LiDARs", "after the worst loss"];
    more.extend(losses.iter().map(String::as_str));
    let notes = vec![format!(
        "`{objective}` with one LiDAR failed. The second placement was searched for the score that is left \
         after its worst loss, by {} evaluations without swaps; the first for the score of all.",
        bench.args.evaluations
    )];
    let title = title(bench, "the loss of one LiDAR");
    let table = Table { title, columns: columns("placement", &more), rows, notes };
    let names: Vec<String> = more.iter().map(|s| (*s).to_owned()).collect();
    let plot = Plot {
        title: table.title.clone(),
        x_title: "what is left".into(),
        y_title: objective.to_string(),
        x: Axis::Names(names),
        series: series_by_row(&table),
    };
    Ok(Study { table, plot })
}
