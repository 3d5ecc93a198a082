//! Files of CARLA's frames: points, the LiDAR's poses, and boxes around actors made of their points.
//!
//! Points are PLY as `save_to_disk` writes it, raw records, or NumPy arrays of them. Poses are a CSV with one
//! `carla.Transform` a frame. CARLA's scans number the actors and say no more: a box holds the visible points of its
//! actor. Sides that no beam reached are not in it, so it may be too short, and its middle lies nearer to the LiDAR
//! than the actor's.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3};
use npyz::{DType, Endianness, TypeChar};

use super::Tag;
use crate::datasets::{BoxTrack, Checked, TrackPose, sequence};
use crate::rig::mirrored;
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_files::npy::read_header;
use sightline_scene::vehicle::SensorPose;

/// Bytes of a raw record: x, y, z and the cosine as `f32`, object and tag as `u32`.
const RECORD: usize = 24;
/// Properties of a PLY that are read, in the order of [`Record`].
const PROPERTIES: [&str; 5] = ["x", "y", "z", "ObjIdx", "ObjTag"];

/// A point in the sensor frame of this program: x forward, y left, z up, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Record {
    pub xyz: [f32; 3],
    pub object: u32,
    pub tag: u32,
}

/// Reads a scan; its name tells its form.
pub(super) fn read_points(path: &Path) -> Checked<Vec<Record>> {
    let records = match path.extension().and_then(|ending| ending.to_str()) {
        Some("ply") => ply(path, &sequence::read_text(path)?)?,
        Some("npy") => array(path, &sequence::read_bytes(path)?)?,
        _ => {
            let bytes = sequence::read_units(path, RECORD as u64)?;
            bytes.chunks_exact(RECORD).map(|record| of_bytes(record, [0, 4, 8, 16, 20])).collect()
        }
    };
    for (point, record) in records.iter().enumerate() {
        sequence::check_finite(path, point, record.xyz)?;
    }
    Ok(records)
}

/// From y right to y left.
fn left_handed([x, y, z]: [f32; 3], object: u32, tag: u32) -> Record {
    Record { xyz: [x, 0.0 - y, z], object, tag }
}

/// The record whose numbers begin at these bytes.
fn of_bytes(record: &[u8], places: [usize; 5]) -> Record {
    let [x, y, z, object, tag] =
        places.map(|at| [record[at], record[at + 1], record[at + 2], record[at + 3]]);
    let xyz = [x, y, z].map(f32::from_le_bytes);
    left_handed(xyz, u32::from_le_bytes(object), u32::from_le_bytes(tag))
}

/// An array `[N]` of records that name x, y, z, ObjIdx and ObjTag, in any order.
fn array(path: &Path, bytes: &[u8]) -> Checked<Vec<Record>> {
    let mut data = bytes;
    let mut split = || {
        let (header, _) = read_header(&mut data).ok()?;
        let DType::Record(fields) = header.dtype() else { return None };
        let &[rows] = header.shape() else { return None };
        let (mut places, mut size) = ([None; 5], 0);
        for field in &fields {
            let DType::Plain(kind) = &field.dtype else { return None };
            let known = PROPERTIES.iter().position(|name| name.eq_ignore_ascii_case(&field.name));
            if let Some(known) = known {
                let wanted = if known < 3 { TypeChar::Float } else { TypeChar::Uint };
                let is_little = kind.endianness() != Endianness::Big;
                let fits = kind.type_char() == wanted && kind.size_field() == 4 && is_little;
                if !fits || places[known].replace(size).is_some() {
                    return None;
                }
            }
            size += kind.num_bytes()?;
        }
        let [Some(x), Some(y), Some(z), Some(object), Some(tag)] = places else { return None };
        // A header's numbers are bounded together.
        if size == 0 || rows.checked_mul(size as u64) != Some(data.len() as u64) {
            return None;
        }
        let places = [x, y, z, object, tag];
        Some(data.chunks_exact(size).map(|record| of_bytes(record, places)).collect())
    };
    split().ok_or_else(|| {
        refused!(
            "{}: is no one-dimensional little-endian array of records x, y, z, CosAngle (f4), ObjIdx, ObjTag (u4), as \
             CARLA's raw data has it",
            path.display()
        )
    })
}

/// An ASCII PLY whose only element are vertices of numbers.
fn ply(path: &Path, text: &str) -> Checked<Vec<Record>> {
    let line_error =
        |line: usize, fault: String| Err(refused!("{} line {}: {fault}", path.display(), line + 1));
    let mut lines = text.lines().enumerate();
    let (columns, count) = match header(&mut lines) {
        Ok(found) => found,
        Err((line, fault)) => return line_error(line, fault),
    };
    let mut records = Vec::new();
    for (line, text) in lines.filter(|(_, text)| !text.trim().is_empty()) {
        let mut found: [Option<&str>; 5] = [None; 5];
        for (word, column) in text.split_ascii_whitespace().zip(&columns) {
            if let Some(column) = column {
                found[*column] = Some(word);
            }
        }
        if text.split_ascii_whitespace().nth(columns.len()).is_some() {
            let fault = format!("has more than the {} numbers of the header", columns.len());
            return line_error(line, fault);
        }
        let [x, y, z] = [0, 1, 2].map(|k| found[k].and_then(|word| word.parse::<f32>().ok()));
        let [object, tag] = [3, 4].map(|k| found[k].and_then(|word| word.parse::<u32>().ok()));
        let (Some(x), Some(y), Some(z), Some(object), Some(tag)) = (x, y, z, object, tag) else {
            let fault = format!("is no point: give {} numbers as the header says", columns.len());
            return line_error(line, fault);
        };
        records.push(left_handed([x, y, z], object, tag));
    }
    if records.len() as u64 != count {
        let fault = format!("{count} points are announced, and {} follow", records.len());
        return line_error(text.lines().count().saturating_sub(1), fault);
    }
    Ok(records)
}

/// Place in [`PROPERTIES`] of each column, and the number of points.
type PlyColumns = (Vec<Option<usize>>, u64);

/// Reads the header of a PLY; an error has the number of its line, from 0.
fn header<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<PlyColumns, (usize, String)> {
    let (mut columns, mut count, mut last) = (Vec::new(), None, 0);
    for (line, text) in lines {
        last = line;
        let words: Vec<&str> = text.split_ascii_whitespace().take(4).collect();
        match (line, &words[..]) {
            (0, ["ply"]) | (_, ["comment" | "obj_info", ..] | ["format", "ascii", "1.0"]) => {}
            (1.., ["element", "vertex", number]) if count.is_none() => {
                count = number.parse::<u64>().ok();
            }
            (1.., ["property", kind, name]) if *kind != "list" && count.is_some() => {
                columns.push(PROPERTIES.iter().position(|known| known == name));
            }
            (1.., ["end_header"]) => {
                let lacks =
                    PROPERTIES.iter().enumerate().find(|(k, _)| !columns.contains(&Some(*k)));
                return match (lacks, count) {
                    (Some((_, name)), _) => {
                        Err((line, format!("the header has no property {name}")))
                    }
                    (None, Some(count)) => Ok((columns, count)),
                    (None, None) => Err((line, "the header has no element vertex".to_owned())),
                };
            }
            _ => {
                let fault = "belongs to no ASCII PLY of vertices with x, y, z, CosAngle, ObjIdx and \
                             ObjTag, as save_to_disk of CARLA's semantic LiDAR writes it";
                return Err((line, fault.to_owned()));
            }
        }
    }
    Err((last, "the header does not end".to_owned()))
}

/// Columns of a transform, in metres and degrees.
const COLUMNS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
const MOST_COLUMNS: usize = 64;
/// Largest number: beyond, angles lose their degrees.
const MOST: f64 = 1e7;

/// Where the LiDAR stood.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimedPose {
    pub world_from_sensor: Pose,
    /// Seconds.
    pub time: Option<f64>,
}

/// Poses by frame, and notes on the table.
type PoseTable = (BTreeMap<u32, TimedPose>, Vec<Note>);

/// Columns of the table that are read, by their titles in the first row.
struct PoseColumns {
    /// Titles of the first row.
    count: usize,
    /// Frame, or a file whose name ends with it.
    key: usize,
    /// Places of [`COLUMNS`].
    places: [usize; 6],
    time: Option<usize>,
}

impl PoseColumns {
    /// Columns by their titles in the first row, and the unknown titles; an error names the fault of the row.
    fn of(titles: &str) -> Result<(Self, Vec<String>), String> {
        let titles = titles.to_ascii_lowercase();
        let titles: Vec<&str> = titles.split(',').map(plain).collect();
        let column = |name: &str| titles.iter().position(|title| *title == name);
        let wanted =
            "give a first row with frame (or file), x, y, z, roll, pitch, yaw, commas between them";
        let key = column("frame").or(column("file")).ok_or(wanted)?;
        if let Some(k) =
            (1..titles.len().min(MOST_COLUMNS)).find(|&k| titles[..k].contains(&titles[k]))
            && !titles[k].is_empty()
        {
            return Err(format!("has two columns {:?}; leave one out", short(titles[k])));
        }
        let mut places = [0; 6];
        for (place, name) in places.iter_mut().zip(COLUMNS) {
            *place = column(name).ok_or_else(|| format!("has no column {name}; {wanted}"))?;
        }
        let time = column("time").or(column("timestamp"));
        let known: Vec<usize> = [key].into_iter().chain(places).chain(time).collect();
        let unknown = (0..titles.len().min(MOST_COLUMNS))
            .filter(|k| !known.contains(k) && !titles[*k].is_empty());
        let unknown = unknown.map(|k| format!("`{}`", short(titles[k]))).collect();
        Ok((Self { count: titles.len(), key, places, time }, unknown))
    }

    /// Frame and pose of a row; an error names its fault.
    fn pose(&self, row: &str) -> Result<(u32, TimedPose), String> {
        let cells: Vec<&str> = row.split(',').take(MOST_COLUMNS + 1).map(plain).collect();
        if cells.iter().skip(self.count).any(|cell| !cell.is_empty()) {
            let wanted = "more cells than the first row; write decimals with a point, as 1.5";
            return Err(format!("has {wanted}"));
        }
        let cell = |place: usize| cells.get(place).copied().unwrap_or_default();
        let number = |place: usize| match cell(place).parse::<f64>() {
            Ok(number) if number.abs() <= MOST => Ok(number),
            _ => Err(format!("{:?} is no number within ±1e7", short(cell(place)))),
        };
        let key = cell(self.key);
        // A number is the frame itself: a point in it is no ending of a file.
        let frame = match key.parse::<f64>() {
            Ok(number) => Some(number as u32).filter(|frame| f64::from(*frame) == number),
            Err(_) => frame_of(Path::new(key)),
        };
        let frame = frame.ok_or_else(|| {
            let (name, most) = (short(key), u32::MAX);
            format!("{name:?} ends with no frame number up to {most}")
        })?;
        let mut six = [0.0; 6];
        for (value, place) in six.iter_mut().zip(self.places) {
            *value = number(place)?;
        }
        let pose = mirrored(&SensorPose::from_values(six), f64::to_radians);
        let time = self.time.map(number).transpose()?;
        Ok((frame, TimedPose { world_from_sensor: pose.ego_from_sensor(), time }))
    }
}

/// Reads the poses by frame. The world is CARLA's with y to the left.
pub(super) fn read_poses(path: &Path) -> Checked<PoseTable> {
    let text = sequence::read_text(path)?;
    let at = |line: usize| {
        move |fault: String| refused!("{} line {}: {fault}", path.display(), line + 1)
    };
    let lines = text.lines().flat_map(|line| line.split('\r'));
    let mut rows = lines.enumerate().filter(|(_, line)| !line.trim().is_empty());
    let titles = rows.next().map_or("", |(_, line)| line);
    let (columns, unknown) = PoseColumns::of(titles).map_err(at(0))?;
    let text = format!(
        "{}: columns {} are not known here, and not read.",
        path.display(),
        unknown.join(", ")
    );
    let notes = (!unknown.is_empty()).then(|| Note::fact(text)).into_iter().collect();
    let mut poses = BTreeMap::new();
    for (line, text) in rows {
        let (frame, stood) = columns.pose(text).map_err(at(line))?;
        if poses.insert(frame, stood).is_some() {
            return Err(at(line)(format!("frame {frame} comes twice; keep one row")));
        }
    }
    Ok((poses, notes))
}

/// A doubt about times that do not rise with the frames.
pub(super) fn backwards(
    path: &Path,
    frames: &BTreeMap<u32, (std::path::PathBuf, TimedPose)>,
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

/// Shortest step between frames whose direction is a heading, metres.
const STEP: f64 = 0.3;
/// Least edge of a box, metres.
const LEAST: f64 = 0.1;

/// Points of an actor, by frame, in the world.
#[derive(Debug, Default)]
pub(super) struct ActorPoints {
    pub tag: Option<(&'static str, Tag)>,
    pub frames: BTreeMap<u32, Vec<DVec3>>,
}

impl ActorPoints {
    pub(super) fn track(&self) -> Option<BoxTrack> {
        let (name, (class, _, kind)) = self.tag?;
        let middles: Vec<DVec2> = self.frames.values().map(|points| middle(points)).collect();
        let headings = headings(&middles, self.frames.values().next()?);
        let mut size = DVec3::splat(LEAST);
        let mut poses = Vec::new();
        for ((&frame, points), heading) in self.frames.iter().zip(headings) {
            let rotation = DMat3::from_rotation_z(heading);
            let own = points.iter().map(|&point| rotation.transpose() * point);
            let (low, high) = own.fold((DVec3::MAX, DVec3::MIN), |(low, high), point| {
                (low.min(point), high.max(point))
            });
            size = size.max(high - low);
            let translation = rotation * ((low + high) / 2.0);
            poses.push(TrackPose { frame, world_from_box: Pose { rotation, translation } });
        }
        let (name, size) = (name.to_owned(), size.to_array());
        Some(BoxTrack { name, kind, class: class?, size, poses })
    }
}

fn middle(points: &[DVec3]) -> DVec2 {
    points.iter().map(|point| point.truncate()).sum::<DVec2>() / points.len().max(1) as f64
}

/// Heading in each frame: along the way from the frame before to the one after, where that is a step; else the
/// last one known, or the first to come. An actor that never moves heads along the longest axis of its first points.
fn headings(middles: &[DVec2], first: &[DVec3]) -> Vec<f64> {
    let last = middles.len() - 1;
    let step = |k: usize| middles[(k + 1).min(last)] - middles[k.saturating_sub(1)];
    let known = |k: usize| Some(step(k)).filter(|step| step.length() > STEP).map(DVec2::to_angle);
    let start = (0..=last).find_map(known).unwrap_or_else(|| long_axis(first));
    let mut heading = start;
    let mut all = Vec::with_capacity(middles.len());
    for k in 0..=last {
        heading = known(k).unwrap_or(heading);
        all.push(heading);
    }
    all
}

/// Direction in which points seen from above spread most: the first axis of their covariance.
fn long_axis(points: &[DVec3]) -> f64 {
    let middle = middle(points);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let d = point.truncate() - middle;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    0.5 * maths::atan2(2.0 * xy, xx - yy)
}
