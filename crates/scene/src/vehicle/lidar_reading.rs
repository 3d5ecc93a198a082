//! A LiDAR from its description in a scene, or from a sensor file.

use std::path::Path;

use super::Lidar;
use super::description::LidarDescription;
use super::sensor_file::{
    self, Beams, Channel, MAX_BEAMS, MAX_CHANNELS, Measures, NARROWEST, SensorFormat, SensorPattern,
};
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{self, Checked, DescriptionError, Location};

const MAX_STEPS: u64 = 100_000;

impl Lidar {
    /// Reads a LiDAR from a sensor file of any of the formats of [`sensor_file::read`].
    ///
    /// `azimuth_steps` a turn, for channels: a window in the file keeps only the steps inside it. `range` in
    /// metres.
    ///
    /// # Errors
    /// Like [`sensor_file::read`], and too many beams.
    pub fn from_sensor_file(path: &Path, azimuth_steps: u32, range: f64) -> Checked<Self> {
        let at = Location::top(&path.display().to_string());
        let pattern = sensor_file::read(path, None)?;
        let (steps, azimuth) = pattern.columns(azimuth_steps);
        match pattern.beams {
            Beams::Directions(directions) => Ok(Self::Directions { directions, range }),
            Beams::Channels(channels) => {
                spinning(&at, lists(&channels), u64::from(steps), azimuth, range)
            }
        }
    }

    /// Reads a LiDAR from JSON text, the value of a scene's `lidar`.
    ///
    /// File names are relative to `dir`; messages call the text `name_for_errors`. Returns the LiDAR and the sentences on
    /// it and on its sensor file: facts and doubts.
    ///
    /// # Errors
    /// Text that is no such object, numbers out of bounds, a sensor file that cannot be read.
    pub fn from_json(text: &str, dir: &Path, name_for_errors: &str) -> Checked<(Self, Vec<Note>)> {
        let top = Location::top(name_for_errors);
        let DescribedLidar { lidar, mut notes, .. } =
            DescribedLidar::new(&top, json::parse(text, name_for_errors)?, dir)?;
        let doubts = super::of_lidar("the LiDAR", &lidar);
        notes.extend(doubts.iter().map(|doubt| Note::doubt(format!("{top}: {doubt}"))));
        Ok((lidar, notes))
    }
}

/// A LiDAR as a scene or vehicle file describes it.
#[derive(Debug)]
pub(crate) struct DescribedLidar {
    pub(crate) lidar: Lidar,
    /// Ranges, noise and rate stated by the sensor file.
    pub measures: Measures,
    /// Sentences about the description and the sensor file.
    pub notes: Vec<Note>,
}

impl DescribedLidar {
    /// Reads a description; `dir` is where its sensor file is.
    pub(crate) fn new(at: &Location, lidar: LidarDescription, dir: &Path) -> Checked<Self> {
        let form = form(at, &lidar)?;
        let stated_range =
            lidar.range.map(|range| check::range(&at.key("range"), range)).transpose()?;
        let range = stated_range.ok_or_else(|| {
            check::missing(at, "range", "give the range in metres, 100 for example")
        });
        match form {
            "directions" => {
                no_turning(at, lidar.azimuth_steps, lidar.azimuth)?;
                let list = lidar.directions.unwrap_or_default();
                let directions = unit_vectors(&at.key("directions"), list)?;
                Ok(Self::plain(Lidar::Directions { directions, range: range? }))
            }
            "channels" => {
                let range = range?;
                let count = lidar.channels.unwrap_or(0);
                let channels = even_channels(at, count, lidar.fov)?;
                let steps = lidar.azimuth_steps.ok_or_else(|| no_steps(at, lidar.azimuth))?;
                let mut described =
                    Self::plain(spinning_in(at, channels, steps, lidar.azimuth, range)?);
                described.notes.extend(narrow_fov(at, count, lidar.fov));
                described.notes.extend(one_step(at, steps));
                Ok(described)
            }
            _ => {
                let file = dir.join(lidar.file.as_deref().unwrap_or_default());
                let pattern = file_pattern(at, &lidar, &file)?;
                let range = match (stated_range, pattern.measures.range) {
                    (None, Some(stated)) => stated,
                    _ => range?,
                };
                Self::of_pattern(at, &lidar, pattern, range)
            }
        }
    }

    /// A LiDAR without a sensor file.
    fn plain(lidar: Lidar) -> Self {
        Self { lidar, measures: Measures::default(), notes: Vec::new() }
    }

    /// Beams of a sensor file. Numbers of the description count; the file fills the gaps.
    fn of_pattern(
        at: &Location,
        lidar: &LidarDescription,
        mut pattern: SensorPattern,
        range: f64,
    ) -> Checked<Self> {
        let mut notes = std::mem::take(&mut pattern.notes);
        let measures = pattern.measures;
        notes.extend(other(at, "range", range, measures.range));
        let channels = match &mut pattern.beams {
            Beams::Directions(directions) => {
                no_turning(at, lidar.azimuth_steps, lidar.azimuth)?;
                let directions = std::mem::take(directions);
                return Ok(Self {
                    lidar: Lidar::Directions { directions, range },
                    measures,
                    notes,
                });
            }
            Beams::Channels(channels) => lists(channels),
        };
        let lidar = if let Some(sector) = lidar.azimuth {
            // Columns stated by a file are columns of a whole turn.
            let steps = lidar.azimuth_steps.ok_or_else(|| no_steps(at, Some(sector)))?;
            notes.extend(pattern.azimuth.filter(|stated| *stated != sector).map(|stated| {
                let at = at.key("azimuth");
                Note::fact(format!(
                    "{at}: {sector:?} degrees; the sensor file states {stated:?}. The first counts."
                ))
            }));
            spinning_in(at, channels, steps, Some(sector), range)?
        } else {
            let stated = pattern.azimuth_steps;
            let steps =
                lidar.azimuth_steps.or(stated.map(u64::from)).ok_or_else(|| no_steps(at, None))?;
            let steps = check::count(&at.key("azimuth_steps"), steps, 1, MAX_STEPS)?;
            notes.extend(other(at, "azimuth_steps", f64::from(steps), stated.map(f64::from)));
            let (steps, azimuth) = pattern.columns(steps);
            spinning(at, channels, u64::from(steps), azimuth, range)?
        };
        Ok(Self { lidar, measures, notes })
    }
}

/// The key that says where the beams come from; keys that belong to another one are refused.
fn form(at: &Location, lidar: &LidarDescription) -> Checked<&'static str> {
    let mut found = Vec::new();
    found.extend(lidar.channels.map(|_| "channels"));
    found.extend(lidar.file.as_ref().map(|_| "file"));
    found.extend(lidar.directions.as_ref().map(|_| "directions"));
    let [form] = found[..] else {
        return Err(check::choice(at, &found, &["channels", "file", "directions"]));
    };
    spare(at, "fov", lidar.fov.is_some() && form != "channels", "it belongs to `channels`")?;
    let of_file = "it belongs to `file`";
    spare(at, "azimuth_offsets", lidar.azimuth_offsets.is_some() && form != "file", of_file)?;
    spare(at, "window", lidar.window.is_some() && form != "file", of_file)?;
    Ok(form)
}

/// Error of a LiDAR without azimuth steps, which are those of a turn or of a sector.
fn no_steps(at: &Location, azimuth: Option<[f64; 2]>) -> DescriptionError {
    let mend = match azimuth.map(|[from, to]| to - from).filter(|across| *across > 0.0) {
        None => format!("of one channel in a turn: {IN_A_TURN}"),
        // The first and the last measurement point at the two ends of a sector.
        Some(across) => format!(
            "of one channel across `azimuth`: {across} / horizontal resolution + 1, {:.0} for 0.2°",
            (across / 0.2).round() + 1.0
        ),
    };
    check::missing(at, "azimuth_steps", format!("give the measurements {mend}"))
}

/// Words on the measurements of a channel that turns.
const IN_A_TURN: &str = "360 / horizontal resolution in degrees, 1800 for 0.2°";

/// A note on a number that the sensor file states otherwise; the description's own counts.
pub(super) fn other(at: &Location, key: &str, given: f64, stated: Option<f64>) -> Option<Note> {
    let stated = stated.filter(|stated| (stated - given).abs() > 1e-9 * given.abs())?;
    let at = at.key(key);
    Some(Note::fact(format!("{at}: {given}; the sensor file states {stated}. The first counts.")))
}

/// A doubt about a field of view that looks like radians, or has no height.
fn narrow_fov(at: &Location, channels: u64, fov: Option<[f64; 2]>) -> Option<Note> {
    let [low, high] = fov.filter(|_| channels > 1)?;
    let at = at.key("fov");
    let view = high - low;
    if view == 0.0 {
        return Some(Note::doubt(format!(
            "{at}: all {channels} channels look at one elevation, {low}°; give the lowest and the highest"
        )));
    }
    let text = format!(
        "{at}: {view:.3} degrees for {channels} channels: radians? Write degrees, {view:.3} rad are {:.1}°",
        view.to_degrees()
    );
    (view < NARROWEST && view > 0.0).then(|| Note::doubt(text))
}

/// A doubt about a LiDAR that measures once in a turn.
fn one_step(at: &Location, steps: u64) -> Option<Note> {
    (steps == 1).then(|| {
        Note::doubt(format!(
            "{}: 1, so that each channel is one beam; give the measurements of one channel in a turn: {IN_A_TURN}",
            at.key("azimuth_steps")
        ))
    })
}

/// Elevations and azimuth offsets in degrees, as many.
type Channels = (Vec<f64>, Vec<f64>);

fn lists(channels: &[Channel]) -> Channels {
    channels.iter().map(|channel| (channel.elevation, channel.azimuth_offset)).unzip()
}

/// Channels that turn, or sweep the horizontal field of view of a description.
fn spinning_in(
    at: &Location,
    channels: Channels,
    steps: u64,
    azimuth: Option<[f64; 2]>,
    range: f64,
) -> Checked<Lidar> {
    let azimuth = azimuth.map(|azimuth| sector(&at.key("azimuth"), azimuth)).transpose()?;
    spinning(at, channels, steps, azimuth, range)
}

fn spinning(
    at: &Location,
    (elevations, azimuth_offsets): Channels,
    steps: u64,
    azimuth: Option<[f64; 2]>,
    range: f64,
) -> Checked<Lidar> {
    let azimuth_steps = check::count(&at.key("azimuth_steps"), steps, 1, MAX_STEPS)?;
    let beams = elevations.len() as u64 * steps;
    if beams > MAX_BEAMS {
        let mend = "take fewer channels or azimuth steps";
        return Err(check::too_many(at, "beams", beams, MAX_BEAMS, mend));
    }
    Ok(Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range })
}

/// A horizontal field of view in degrees that is less than a turn.
fn sector(at: &Location, [from, to]: [f64; 2]) -> Checked<[f64; 2]> {
    for (i, angle) in [from, to].into_iter().enumerate() {
        if !(-360.0..=360.0).contains(&angle) {
            return Err(bad(&at.item(i), angle, "an azimuth from -360 to 360 degrees"));
        }
    }
    let found = format!("{:?}", [from, to]);
    if to - from >= 360.0 {
        let wanted = "less than a turn: leave `azimuth` out for a sensor that turns";
        return Err(bad(at, found, wanted));
    }
    if from < to {
        return Ok([from, to]);
    }
    let meant = check::rising_sector([from, to]).map_or_else(String::new, |[first, last]| {
        format!("; from {from}° to {to}° is [{first}, {last}]")
    });
    Err(bad(at, found, format!("a range [from, to] with from < to, counter-clockwise{meant}")))
}

/// Refuses a key that has no meaning beside the others.
fn spare(at: &Location, key: &'static str, there: bool, mend: &str) -> Checked<()> {
    if there { Err(check::misplaced(at, key, mend)) } else { Ok(()) }
}

fn no_turning(at: &Location, steps: Option<u64>, azimuth: Option<[f64; 2]>) -> Checked<()> {
    let mend = "listed directions are not repeated by turning";
    spare(at, "azimuth_steps", steps.is_some(), mend)?;
    spare(at, "azimuth", azimuth.is_some(), mend)
}

/// Elevations and offsets of `count` channels spread evenly over `fov`; one channel takes the lower end.
fn even_channels(at: &Location, count: u64, fov: Option<[f64; 2]>) -> Checked<Channels> {
    if count == 0 {
        let wanted = "a number of channels: a LiDAR without channels casts no beam; give 1 to 1024";
        return Err(bad(&at.key("channels"), 0, wanted));
    }
    let n = check::count(&at.key("channels"), count, 1, MAX_CHANNELS as u64)?;
    let mend = "give the vertical field of view in degrees, [-24.8, 2.0] for example";
    let fov = fov.ok_or_else(|| check::missing(at, "fov", mend))?;
    let [lower, upper] = check::fov(&at.key("fov"), fov)?;
    let step = |k: u32| f64::from(k) * (upper - lower) / f64::from(n.max(2) - 1);
    Ok(((0..n).map(|k| lower + step(k)).collect(), vec![0.0; n as usize]))
}

/// The sensor file of a description, with its offsets counter-clockwise.
fn file_pattern(at: &Location, lidar: &LidarDescription, file: &Path) -> Checked<SensorPattern> {
    let sign = match lidar.azimuth_offsets.as_deref() {
        None | Some("counter-clockwise") => 1.0,
        Some("clockwise") => -1.0,
        Some(other) => {
            let wanted = "\"counter-clockwise\" or \"clockwise\"";
            return Err(bad(&at.key("azimuth_offsets"), format!("{other:?}"), wanted));
        }
    };
    if let Some([from, to]) = lidar.window
        && !(from < to && to - from <= 1e6)
    {
        let found = format!("{:?}", [from, to]);
        let wanted =
            format!("a window [from, to] in seconds with from < to{}", check::swapped([from, to]));
        return Err(bad(&at.key("window"), found, wanted));
    }
    let read = sensor_file::read(file, lidar.window);
    let mut pattern = read.map_err(|error| error.of_file(at.key("file")))?;
    let knows_signs = pattern.format != SensorFormat::Table;
    let mend = "a vendor's file says which way it counts; leave it out";
    spare(at, "azimuth_offsets", lidar.azimuth_offsets.is_some() && knows_signs, mend)?;
    pattern.notes.retain(|note| lidar.azimuth_offsets.is_none() || !sensor_file::is_on_sign(note));
    if let Beams::Channels(channels) = &mut pattern.beams {
        channels.iter_mut().for_each(|channel| channel.azimuth_offset *= sign);
    }
    Ok(pattern)
}

fn unit_vectors(at: &Location, mut list: Vec<[f64; 3]>) -> Checked<Vec<[f64; 3]>> {
    if list.is_empty() || list.len() as u64 > MAX_BEAMS {
        let wanted = format!("1 to {MAX_BEAMS} directions");
        return Err(bad(at, format!("a list of {}", list.len()), wanted));
    }
    for (i, d) in list.iter_mut().enumerate() {
        // Scaling by the largest component first keeps squares from vanishing or overflowing.
        let largest = d.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if largest == 0.0 {
            let wanted = "a direction: its length is 0; give a vector that points somewhere";
            return Err(bad(&at.item(i), format!("{d:?}"), wanted));
        }
        let scaled = d.map(|v| v / largest);
        let norm = scaled.iter().map(|v| v * v).sum::<f64>().sqrt();
        *d = scaled.map(|v| v / norm);
    }
    Ok(list)
}
