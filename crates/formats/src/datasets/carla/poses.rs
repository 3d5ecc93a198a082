//! A table of the LiDAR's poses: CSV with one `carla.Transform` a frame.

use std::collections::BTreeMap;
use std::path::Path;

use super::super::{DatasetError, files};
use crate::rig::mirrored;
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_scene::vehicle::SensorPose;

/// Columns of a transform, in metres and degrees.
const COLUMNS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// Most columns that are looked at.
const MOST_COLUMNS: usize = 64;
/// Largest number: beyond, angles lose their degrees.
const MOST: f64 = 1e7;

/// Where the LiDAR stood.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stood {
    pub world_from_sensor: Pose,
    /// Seconds.
    pub time: Option<f64>,
}

/// Poses by frame, and notes on the table.
type Table = (BTreeMap<u32, Stood>, Vec<Note>);

/// Reads the poses by frame. The world is CARLA's with y to the left.
pub(super) fn read(path: &Path) -> Result<Table, DatasetError> {
    let text = files::read_text(path)?;
    let fault = |line: usize, fault: String| DatasetError::Line {
        path: path.to_owned(),
        line: line + 1,
        fault,
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut rows = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let titles = rows.next().map_or("", |(_, line)| line).to_ascii_lowercase();
    let titles: Vec<&str> = titles.split(',').map(plain).collect();
    if let Some(k) = (1..titles.len().min(MOST_COLUMNS)).find(|&k| titles[..k].contains(&titles[k]))
        && !titles[k].is_empty()
    {
        return Err(fault(0, format!("has two columns {:?}; leave one out", short(titles[k]))));
    }
    let column = |name: &str| titles.iter().position(|title| *title == name);
    let wanted = || "give a first row with frame (or file), x, y, z, roll, pitch, yaw".to_owned();
    let key = column("frame").or(column("file")).ok_or_else(|| fault(0, wanted()))?;
    let mut places = [0; 6];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place =
            column(name).ok_or_else(|| fault(0, format!("has no column {name}; {}", wanted())))?;
    }
    let time = column("time").or(column("timestamp"));
    let known = [key].into_iter().chain(places).chain(time);
    let known: Vec<usize> = known.collect();
    let unknown = (0..titles.len().min(MOST_COLUMNS))
        .filter(|k| !known.contains(k) && !titles[*k].is_empty());
    let unknown: Vec<String> = unknown.map(|k| format!("`{}`", short(titles[k]))).collect();
    let text = format!(
        "{}: columns {} are not known here, and not read.",
        path.display(),
        unknown.join(", ")
    );
    let notes = (!unknown.is_empty()).then(|| Note::fact(text)).into_iter().collect();
    let mut poses = BTreeMap::new();
    for (line, text) in rows {
        let cells: Vec<&str> = text.split(',').take(MOST_COLUMNS + 1).map(plain).collect();
        if cells.iter().skip(titles.len()).any(|cell| !cell.is_empty()) {
            let wanted = "more cells than the first row; write decimals with a point, as 1.5";
            return Err(fault(line, format!("has {wanted}")));
        }
        let cell = |place: usize| cells.get(place).copied().unwrap_or_default();
        let number = |place: usize| match cell(place).parse::<f64>() {
            Ok(number) if number.abs() <= MOST => Ok(number),
            _ => Err(fault(line, format!("{:?} is no number within ±1e7", short(cell(place))))),
        };
        let frame = frame_of(Path::new(cell(key))).ok_or_else(|| {
            fault(
                line,
                format!("{:?} ends with no frame number up to {}", short(cell(key)), u32::MAX),
            )
        })?;
        let mut six = [0.0; 6];
        for (value, place) in six.iter_mut().zip(places) {
            *value = number(place)?;
        }
        let pose = mirrored(&SensorPose::from_values(six), f64::to_radians);
        let time = time.map(number).transpose()?;
        let stood = Stood { world_from_sensor: pose.ego_from_sensor(), time };
        if poses.insert(frame, stood).is_some() {
            return Err(fault(line, format!("frame {frame} comes twice; keep one row")));
        }
    }
    Ok((poses, notes))
}

/// A doubt about times that do not rise with the frames.
pub(super) fn backwards(
    path: &Path,
    frames: &BTreeMap<u32, (std::path::PathBuf, Stood)>,
) -> Option<Note> {
    let times: Vec<(u32, f64)> =
        frames.iter().filter_map(|(&frame, (_, stood))| Some((frame, stood.time?))).collect();
    let pair = times.windows(2).find(|pair| pair[1].1 <= pair[0].1)?;
    Some(Note::doubt(format!(
        "{}: frame {} has the time {}, and frame {} after it {}; times are seconds and rise.",
        path.display(),
        pair[0].0,
        pair[0].1,
        pair[1].0,
        pair[1].1
    )))
}

/// A cell without blanks and quotes.
fn plain(cell: &str) -> &str {
    cell.trim().trim_matches('"').trim()
}

/// The start of a cell, for messages.
fn short(cell: &str) -> String {
    cell.chars().take(40).collect()
}

/// The frame that a name ends with.
pub(super) fn frame_of(name: &Path) -> Option<u32> {
    let stem = name.file_stem()?.to_str()?;
    let digits = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[digits..].parse().ok()
}
