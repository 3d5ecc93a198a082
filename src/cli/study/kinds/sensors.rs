//! How many LiDARs, of which kind, how high.

use sightline::scene::Lidar;
use sightline::study::{Row, Table, knee};
use sightline::vehicle::Placement;

use super::{SCORE_COLUMNS, check_distinct, columns, plot_of, score_row, title};
use crate::cli::error::Error;
use crate::cli::study::bench::Bench;
use crate::cli::study::session::{Session, Study};

/// Numbers of LiDARs that are compared.
const LIDARS: std::ops::RangeInclusive<usize> = 1..=8;
/// Channels that are compared over the scene's own field of view.
const CHANNELS: [u32; 4] = [16, 32, 64, 128];
/// Heights between the lowest and the highest of the mount.
const HEIGHTS: u32 = 4;

pub fn lidars(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    session.expect(LIDARS.count());
    let mut rows: Vec<Row> = Vec::new();
    for count in LIDARS {
        let before = rows.last().and_then(|row| row.placement.clone());
        let case = session.case(&count.to_string(), || {
            let constraints =
                sightline::vehicle::Constraints { lidars: count, ..bench.constraints() };
            let table = bench.scene.lidar().table()?;
            let mut evaluator = bench.evaluator_with(&bench.psog, table, constraints)?;
            // The best of one LiDAR less, with one more at each corner of the mount in turn.
            let mut starts = bench.table_7.clone();
            starts.extend(before.iter().flat_map(|before| with_one_more(bench, before)));
            let Some(best) = bench.optimize(&mut evaluator, &starts)? else {
                return Ok(Row { name: count.to_string(), values: vec![], placement: None });
            };
            let scores = bench.score(&mut evaluator, &best)?;
            Ok(score_row(&count.to_string(), &scores, Some(best)))
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let gains: Vec<f64> = rows.iter().map_while(|row| row.values.first().copied()?).collect();
    for (k, row) in rows.iter_mut().enumerate() {
        let marginal = match (k, gains.get(k)) {
            (0, gain) => gain.copied(),
            (k, Some(gain)) => Some(gain - gains[k - 1]),
            _ => None,
        };
        row.values.resize(SCORE_COLUMNS.len(), None);
        row.values.insert(1, marginal);
    }
    let mut more = SCORE_COLUMNS.to_vec();
    more.insert(1, "marginal gain %");
    let mut notes = vec![format!(
        "Each number has its own search of {} evaluations for `{}`; a fall is a search that ended early, \
         not a LiDAR that harms.",
        bench.args.evaluations, bench.objective
    )];
    let from_none: Vec<f64> = std::iter::once(0.0).chain(gains.iter().copied()).collect();
    if let Some(knee) = knee(&from_none) {
        notes.push(format!(
            "The gain bends most at {knee} LiDAR(s): up to there each adds more than the average of all \
             {}.",
            gains.len()
        ));
    }
    let title = title(bench, "the best placement of each number of LiDARs");
    let table = Table { title, columns: columns("LiDARs", &more), rows, notes };
    let plot = plot_of(&table, "gain %", "LiDARs");
    Ok(Study { table, plot })
}

/// A placement with one more LiDAR at the corners of the mount's box that its rules allow.
fn with_one_more(bench: &Bench, before: &Placement) -> Vec<Placement> {
    let constraints = bench.constraints();
    let corners = (0..8).map(|corner| {
        let mut pose = before.lidars[0];
        let side =
            |k: usize| if corner >> k & 1 == 1 { &constraints.upper } else { &constraints.lower };
        (pose.x, pose.y, pose.z) = (side(0)[0], side(1)[1], side(2)[2]);
        let lidars = before.lidars.iter().copied().chain([pose]).collect();
        Placement { name: format!("corner-{corner}"), lidars }
    });
    corners.collect()
}

pub fn channels(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    let Lidar::Spinning { elevations, azimuth_steps, range, .. } = bench.scene.lidar() else {
        return Err(Error::Usage(format!(
            "{}: its LiDAR is a list of directions, which has no channels to vary",
            bench.args.scenes[0].display()
        )));
    };
    let fold = |f: fn(f64, f64) -> f64| elevations.iter().copied().reduce(f).unwrap_or(0.0);
    let (low, high) = (fold(f64::min), fold(f64::max));
    let mut sensors = Vec::new();
    for count in CHANNELS {
        let step = (high - low) / f64::from(count - 1);
        sensors.push((
            format!("{count} channels"),
            Lidar::Spinning {
                elevations: (0..count).map(|k| low + f64::from(k) * step).collect(),
                azimuth_offsets: vec![0.0; count as usize],
                azimuth_steps: *azimuth_steps,
                range: *range,
            },
        ));
    }
    for path in &bench.args.sensor {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        sensors.push((name, Lidar::from_sensor_file(path, *azimuth_steps, *range)?));
    }
    let names = sensors.iter().map(|(name, _)| name.as_str());
    check_distinct(names, "sensors", "rename one of the files")?;
    session.expect(sensors.len());
    let mut rows = Vec::new();
    for (name, lidar) in sensors {
        let case = session.case(&name, || {
            let table = lidar.table()?;
            let beams = table.directions().len();
            let mut evaluator = bench.evaluator_with(&bench.psog, table, bench.constraints())?;
            let mut row = best_row(bench, &mut evaluator, &name)?;
            row.values.insert(0, Some(beams as f64));
            Ok(row)
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let more: Vec<&str> = std::iter::once("beams a LiDAR").chain(SCORE_COLUMNS).collect();
    let notes = vec![format!(
        "Evenly spaced channels from {low}° to {high}°, as the scene's own; every sensor turns in {} \
         steps and sees {} m far, so that elevations alone differ.",
        azimuth_steps, range
    )];
    let title = title(bench, "the best placement of each sensor");
    let table = Table { title, columns: columns("sensor", &more), rows, notes };
    let plot = plot_of(&table, "gain %", "sensor");
    Ok(Study { table, plot })
}

/// A search and the scores of what it found.
fn best_row(
    bench: &Bench,
    evaluator: &mut sightline::search::Evaluator,
    name: &str,
) -> Result<Row, Error> {
    match bench.optimize(evaluator, &bench.table_7)? {
        Some(best) => Ok(score_row(name, &bench.score(evaluator, &best)?, Some(best))),
        None => {
            Ok(Row { name: name.into(), values: vec![None; SCORE_COLUMNS.len()], placement: None })
        }
    }
}

pub fn height(bench: &mut Bench, session: &mut Session) -> Result<Study, Error> {
    let constraints = bench.constraints();
    let (low, high) = (constraints.lower[2], constraints.upper[2]);
    let at = |k: u32| low + f64::from(k) * (high - low) / f64::from(HEIGHTS - 1);
    let mut heights: Vec<(String, f64, f64)> =
        (0..HEIGHTS).map(|k| (format!("{:.2} m", at(k)), at(k), at(k))).collect();
    heights.dedup_by(|a, b| a.0 == b.0);
    heights.push(("free".into(), low, high));
    session.expect(heights.len());
    let mut rows = Vec::new();
    for (name, from, to) in heights {
        let case = session.case(&name, || {
            let mut constraints = bench.constraints();
            (constraints.lower[2], constraints.upper[2]) = (from, to);
            let table = bench.scene.lidar().table()?;
            let mut evaluator = bench.evaluator_with(&bench.psog, table, constraints)?;
            best_row(bench, &mut evaluator, &name)
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let notes = vec![
        "All LiDARs of a case stand at one height (the paper's 2D plane), those of the last where they \
         like within the mount."
            .to_owned(),
    ];
    let title = title(bench, "the best placement at each height");
    let table = Table { title, columns: columns("height", &SCORE_COLUMNS), rows, notes };
    let plot = plot_of(&table, "gain %", "height");
    Ok(Study { table, plot })
}
