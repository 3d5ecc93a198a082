//! Other voxels, other scenes, and the published results.

use sightline::report::{Axis, Plot};
use sightline::score::Scores;
use sightline::score::{kendall_tau, mean_height, spearman};
use sightline::study::{Row, TASKS, Table, results_of};
use sightline::vehicle::Placement;

use super::{check_distinct, columns, plot_of, series_by_row, title};
use crate::cli::error::Error;
use crate::cli::study::bench::Bench;
use crate::cli::study::session::{Session, Study};

/// Voxel sizes of the paper's study, in metres.
const VOXELS: [[f64; 3]; 4] =
    [[0.2, 0.2, 0.2], [0.1, 0.15, 0.2], [0.1, 0.1, 0.1], [0.05, 0.1, 0.1]];
/// Edge of a voxel in the paper's main experiments, in metres.
const PAPER_VOXEL: f64 = 0.1;

/// A score by name, as the audit and the paper know it.
type Metric = (&'static str, fn(&Scores) -> Option<f64>);

/// Every score that is compared with the published results.
const METRICS: [Metric; 9] = [
    ("m_sog", |s| s.segmentation.m_sog),
    ("m_sog_scaled", |s| s.segmentation.m_sog_scaled),
    ("m_sog_nonzero", |s| s.segmentation.m_sog_nonzero),
    ("m_sog_scaled_nonzero", |s| s.segmentation.m_sog_scaled_nonzero),
    ("information_gain", |s| s.segmentation.information_gain),
    ("s_mig", |s| s.s_mig),
    ("detection.m_sog", |s| s.detection?.m_sog),
    ("detection.m_sog_scaled", |s| s.detection?.m_sog_scaled),
    ("detection.information_gain", |s| s.detection?.information_gain),
];

pub fn voxels(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    session.expect(VOXELS.len());
    let mut rows = Vec::new();
    for voxel in VOXELS {
        let name = format!("{voxel:?} m");
        let case = session.case(&name, || {
            let psog = bench.psog_of(voxel)?;
            let table = bench.scene.lidar().table()?;
            let mut evaluator = bench.evaluator_with(&psog, table, bench.constraints())?;
            let scores = evaluator.scores(&bench.table_7)?;
            let values =
                scores.iter().map(|s| s.segmentation.m_sog_scaled.map(|v| 1e6 * v)).collect();
            Ok(Row { name: name.clone(), values, placement: None })
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let names: Vec<&str> = bench.table_7.iter().map(|p| p.name.as_str()).collect();
    let heights: Vec<f64> = bench.table_7.iter().map(mean_height).collect();
    let numbers = |row: &Row| -> Vec<f64> { row.values.iter().map(|v| v.unwrap_or(0.0)).collect() };
    let mut notes = vec![
        "M-SOG/N ×1e-6 of the layouts of Table 7; sizes differ in N, so rankings are compared and not \
         scores."
            .to_owned(),
    ];
    for row in &rows {
        let tau = kendall_tau(&numbers(&rows[0]), &numbers(row));
        let null = spearman(&heights, &numbers(row));
        notes.push(format!(
            "{}: Kendall's τ with {} {}; Spearman with mean height alone {}",
            row.name,
            rows[0].name,
            words(tau),
            words(null)
        ));
    }
    let title = title(bench, "four voxel sizes");
    let table = Table { title, columns: columns("voxel", &names), rows, notes };
    let plot = Plot {
        title: table.title.clone(),
        x_title: "placement".into(),
        y_title: "M-SOG/N ×1e-6".into(),
        x: Axis::Names(names.iter().map(|s| (*s).to_owned()).collect()),
        series: series_by_row(&table),
    };
    Ok(Study { table, plot })
}

fn words(value: Option<f64>) -> String {
    value.map_or("does not exist".into(), |v| format!("{v:.2}"))
}

pub fn transfer(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    let paths = bench.args.scenes.clone();
    session.expect(2 * paths.len());
    let mut others = Vec::new();
    for path in &paths[1..] {
        others.push(bench.beside(path)?);
    }
    let benches: Vec<&Bench> = std::iter::once(&*bench).chain(&others).collect();
    let names: Vec<&str> = benches.iter().map(|b| b.scene.name()).collect();
    let mend = "give each scene file a `name` of its own";
    check_distinct(names.iter().copied(), "scenes", mend)?;
    let mut found: Vec<Option<Placement>> = Vec::new();
    let mut rows = Vec::new();
    for one in &benches {
        let name = format!("optimized on {}", one.scene.name());
        let case = session.case(&name, || {
            let mut evaluator = one.evaluator()?;
            let placement = one.optimize(&mut evaluator, &one.table_7)?;
            Ok(Row { name: name.clone(), values: vec![], placement })
        })?;
        found.push(case.and_then(|row| row.placement));
    }
    for (one, placement) in benches.iter().zip(&found) {
        let Some(placement) = placement else { continue };
        let name = one.scene.name().to_owned();
        let case = session.case(&name, || {
            let mut values = Vec::new();
            for other in &benches {
                let mut evaluator = other.evaluator()?;
                values.push(bench.objective.value(&other.score(&mut evaluator, placement)?));
            }
            Ok(Row { name: name.clone(), values, placement: Some(placement.clone()) })
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let own: Vec<Option<f64>> =
        rows.iter().enumerate().map(|(k, row)| row.values.get(k).copied().flatten()).collect();
    let mut notes = vec![format!(
        "`{}` of the placement optimized on the scene of the row, scored on that of the column. The mounts \
         may differ; a placement is scored where it stands.",
        bench.objective
    )];
    for (k, row) in rows.iter().enumerate() {
        for (j, value) in row.values.iter().enumerate().filter(|(j, _)| *j != k) {
            if let (Some(value), Some(Some(own))) = (value, own.get(j)) {
                notes.push(format!(
                    "from {} to {}: {:+.2} % against its own optimum",
                    names[k],
                    names[j],
                    100.0 * (value - own) / own.abs()
                ));
            }
        }
    }
    let title = "placements carried to other scenes".to_owned();
    let table = Table { title, columns: columns("optimized on", &names), rows, notes };
    let series = names.iter().map(|name| {
        let mut one = plot_of(&table, name, "").series.remove(0);
        one.name = format!("on {name}");
        one.line = false;
        one
    });
    let series = series.collect();
    let plot = Plot {
        y_title: bench.objective.to_string(),
        series,
        ..plot_of(&table, names[0], "optimized on")
    };
    Ok(Study { table, plot })
}

pub fn published(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    let edge = bench.args.voxel.unwrap_or(PAPER_VOXEL);
    session.expect(bench.table_7.len());
    let mut scores: Vec<(String, Vec<Option<f64>>)> = Vec::new();
    let mut evaluator = None;
    for placement in bench.table_7.clone() {
        let case = session.case(&placement.name, || {
            let evaluator = match &mut evaluator {
                Some(evaluator) => evaluator,
                None => {
                    let psog = bench.psog_of([edge; 3])?;
                    let table = bench.scene.lidar().table()?;
                    evaluator.insert(bench.evaluator_with(&psog, table, bench.constraints())?)
                }
            };
            let scores = bench.score(evaluator, &placement)?;
            let values = METRICS.iter().map(|(_, of)| of(&scores)).collect();
            Ok(Row { name: placement.name.clone(), values, placement: Some(placement.clone()) })
        })?;
        let Some(row) = case else { break };
        scores.push((row.name, row.values));
    }
    let height = |name: &str| bench.table_7.iter().find(|p| p.name == name).map(mean_height);
    let correlation = |of: &dyn Fn(&str) -> Option<f64>, task: usize| -> Option<f64> {
        let pairs: Option<Vec<(f64, f64)>> =
            results_of(task).into_iter().map(|(name, result)| Some((of(name)?, result))).collect();
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs?.into_iter().unzip();
        spearman(&ours, &theirs)
    };
    let tasks = 0..TASKS.len();
    let mut rows: Vec<Row> = METRICS
        .iter()
        .enumerate()
        .map(|(metric, (name, _))| {
            let of = |placement: &str| {
                scores.iter().find(|(name, _)| name == placement).and_then(|(_, v)| v[metric])
            };
            let values = tasks.clone().map(|task| correlation(&of, task)).collect();
            Row { name: (*name).into(), values, placement: None }
        })
        .collect();
    rows.push(Row {
        name: "mean height (null model)".into(),
        values: tasks.clone().map(|task| correlation(&height, task)).collect(),
        placement: None,
    });
    let notes = vec![format!(
        "Spearman's rank correlation over the eight published placements (n = 8: below 0.74 it is not \
         significant at 5 %), voxels of {edge} m, {} frame(s). A score that does not beat the null model \
         says no more than that higher LiDARs see more.",
        bench.frames().len()
    )];
    let names: Vec<String> = TASKS.iter().map(|task| task.0.to_owned()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let title = title(bench, "scores against published results");
    let table = Table { title, columns: columns("score", &names), rows, notes };
    let series = names.iter().map(|name| {
        let mut one = plot_of(&table, name, "").series.remove(0);
        (*name).clone_into(&mut one.name);
        one.line = false;
        one
    });
    let series = series.collect();
    let plot = Plot {
        y_title: "Spearman's rank correlation".into(),
        series,
        ..plot_of(&table, names[0], "score")
    };
    Ok(Study { table, plot })
}
