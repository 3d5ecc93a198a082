//! The LiDAR model of a scene with all its numbers resolved, and its response to light.

use std::collections::HashSet;

use glam::DVec3;
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check};

use super::description::{OtherSensorDescription, ResponseDescription};
use super::doubts::{of_angles, of_degrees, of_measures};
use super::lidar_reading::other;
use super::sensor_file::Measures;
use super::{BeamTable, Echoes, Response, SensorError, SensorPose};

/// The LiDAR that every sensor of a placement is.
#[derive(Debug, Clone, PartialEq)]
pub enum Lidar {
    /// Spinning sensor: channels that turn about z.
    Spinning {
        /// Elevation of each channel in degrees, in the order of the data sheet.
        elevations: Vec<f64>,
        /// Azimuth offset of each channel in degrees, counter-clockwise; as many as elevations.
        azimuth_offsets: Vec<f64>,
        /// Azimuth steps, A: a turn's, or the sector's.
        azimuth_steps: u32,
        /// Horizontal field of view `[from, to]` in degrees, counter-clockwise, less than a turn: step j points
        /// at from + j · (to − from)/(A − 1), a single one at from. A whole turn for `None`.
        azimuth: Option<[f64; 2]>,
        /// Range in metres.
        range: f64,
    },
    /// Fixed list of beams, for patterns that do not repeat by turning.
    Directions {
        /// Unit vectors in the sensor frame.
        directions: Vec<[f64; 3]>,
        /// Range in metres.
        range: f64,
    },
}

impl Lidar {
    /// Range in metres.
    pub fn range(&self) -> f64 {
        match self {
            Self::Spinning { range, .. } | Self::Directions { range, .. } => *range,
        }
    }

    pub(super) fn turns(&self) -> bool {
        matches!(self, Self::Spinning { azimuth: None, .. })
    }

    /// Beams of one sensor in one frame.
    pub fn beam_count(&self) -> usize {
        match self {
            Self::Spinning { elevations, azimuth_steps, .. } => {
                elevations.len() * *azimuth_steps as usize
            }
            Self::Directions { directions, .. } => directions.len(),
        }
    }

    /// Beam table of the sensor.
    pub fn table(&self) -> Result<BeamTable, SensorError> {
        match self {
            Self::Spinning { elevations, azimuth_offsets, azimuth_steps, range, .. } => {
                let channels: Vec<(f64, f64)> =
                    elevations.iter().copied().zip(azimuth_offsets.iter().copied()).collect();
                match self.sector() {
                    Some(sector) => BeamTable::sector(&channels, sector, *azimuth_steps, *range),
                    None => BeamTable::spinning(&channels, *azimuth_steps, *range),
                }
            }
            Self::Directions { directions, range } => {
                BeamTable::from_directions(directions.iter().map(|&d| d.into()), *range)
            }
        }
    }

    /// Azimuth of the first step and from step to step, in degrees, of a sensor that does not turn.
    pub fn sector(&self) -> Option<[f64; 2]> {
        match self {
            Self::Spinning { azimuth: Some([from, to]), azimuth_steps, .. } => {
                Some([*from, (to - from) / f64::from((*azimuth_steps).max(2) - 1)])
            }
            _ => None,
        }
    }

    /// The sensor with one of `divisor` azimuth steps, spread over the same field of view, or with every
    /// `divisor`-th of listed directions.
    #[must_use]
    pub fn thinned(&self, divisor: u32) -> Self {
        let mut thin = self.clone();
        match &mut thin {
            Self::Spinning { azimuth_steps, .. } => {
                *azimuth_steps = azimuth_steps.div_ceil(divisor);
            }
            Self::Directions { directions, .. } => {
                *directions = directions.iter().step_by(divisor as usize).copied().collect();
            }
        }
        thin
    }

    /// Degrees between two neighbouring azimuth steps; of listed directions, a turn by their number.
    pub fn azimuth_step(&self) -> f64 {
        match (self, self.sector()) {
            (_, Some([_, step])) => step,
            (Self::Spinning { azimuth_steps, .. }, _) => 360.0 / f64::from(*azimuth_steps),
            (Self::Directions { directions, .. }, _) => 360.0 / directions.len() as f64,
        }
    }
}

/// The usual response, with the numbers that a sensor file states in place of the usual ones.
pub(super) fn stated(range: f64, measures: &Measures) -> Response {
    let usual = Response::usual(range);
    Response {
        rate: measures.rate.unwrap_or(usual.rate),
        rated_range: measures.rated_range.unwrap_or(usual.rated_range),
        noise: measures.noise.unwrap_or(usual.noise),
        // A range cut short by a scene leaves the sensor nothing nearer.
        min_range: measures.min_range.unwrap_or(usual.min_range).min(range),
        ..usual
    }
}

/// Reads the `response` of a sensor model whose beams go `range` metres. Its numbers count, then the sensor
/// file's; differences between the two are notes.
pub(super) fn read(
    at: &Location,
    written: Option<&ResponseDescription>,
    range: f64,
    measures: &Measures,
    notes: &mut Vec<Note>,
) -> Checked<Response> {
    let usual = stated(range, measures);
    let Some(written) = written else { return Ok(usual) };
    let given = [written.noise, written.rated_range, written.rate];
    notes.extend(of_measures(|key| at.key(key).to_string(), given).into_iter().map(Note::doubt));
    let both = [
        ("rate", written.rate, measures.rate),
        ("rated_range", written.rated_range, measures.rated_range),
        ("noise", written.noise, measures.noise),
        ("min_range", written.min_range, measures.min_range),
    ];
    notes
        .extend(both.into_iter().filter_map(|(key, given, stated)| other(at, key, given?, stated)));
    let between = |key: &str, value: Option<f64>, usual: f64, low: f64, high: f64| {
        let value = check::within(at, key, Some(value.unwrap_or(usual)), low, high);
        value.map(|value| value.unwrap_or(usual))
    };
    let widths = written.divergence.unwrap_or(usual.divergence);
    let width = |k: usize| {
        let at = at.key("divergence").item(k);
        if (0.0..=0.1).contains(&widths[k]) {
            return Ok(widths[k]);
        }
        Err(bad(&at, widths[k], "a width in radians from 0 to 0.1; 3 mrad is 0.003"))
    };
    let echoes = match written.echoes.as_deref() {
        None => usual.echoes,
        Some("strongest") => Echoes::Strongest,
        Some("last") => Echoes::Last,
        Some("dual") => Echoes::Dual,
        Some(other) => {
            let wanted = "\"strongest\", \"last\" or \"dual\"";
            return Err(bad(&at.key("echoes"), format!("{other:?}"), wanted));
        }
    };
    Ok(Response {
        rate: check::rate(&at.key("rate"), written.rate.unwrap_or(usual.rate))?,
        rated_range: between("rated_range", written.rated_range, usual.rated_range, 0.1, 1e5)?,
        softness: between("softness", written.softness, usual.softness, 0.0, 1.0)?,
        noise: between("noise", written.noise, usual.noise, 0.0, 10.0)?,
        divergence: [width(0)?, width(1)?],
        pulse: between("pulse", written.pulse, usual.pulse, 0.0, 100.0)?,
        echoes,
        min_range: between("min_range", written.min_range, usual.min_range, 0.0, range)?,
    })
}

/// Technology of the sensors in `sensors`, which no other sensor has.
pub const LIDAR: &str = "lidar";
/// Most other sensors of a vehicle.
const MOST: usize = 64;
/// Longest word for a technology, in letters.
const MOST_LETTERS: usize = 16;
/// Farthest coordinate of a sensor from the ego origin, metres.
const FARTHEST: f64 = 100.0;
/// Longest range, metres.
const LONGEST: f64 = 1000.0;
/// Field of view in degrees, across and up, below which it is most likely in radians.
const NARROW: f64 = 3.2;
/// Largest field of view across and up, degrees.
const WIDEST: [f64; 2] = [360.0, 180.0];

/// A camera, a radar or another sensor that is no LiDAR: a cone in a fixed pose.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherSensor {
    /// Name in reports, one of its own on the vehicle.
    pub name: String,
    /// Lower-case word for sensors that count as one technology: `camera`, `radar`.
    pub technology: String,
    /// Sensor-to-ego transform; the cone's axis is the sensor's x.
    pub ego_from_sensor: Pose,
    /// Whole angles of view in degrees: of azimuth, at most 360, and of elevation, at most 180.
    pub fov: [f64; 2],
    /// Range in metres.
    pub range: f64,
}

impl OtherSensor {
    /// Position in the ego frame, metres.
    pub fn position(&self) -> DVec3 {
        self.ego_from_sensor.translation
    }

    /// True if a point of the ego frame, in metres, is in range and in the field of view.
    ///
    /// Azimuth and elevation count in the sensor's own frame, which tilts with it. Each is at most half an angle of
    /// view.
    pub fn holds(&self, point: DVec3) -> bool {
        let away = point - self.position();
        let [x, y, z] = (self.ego_from_sensor.rotation.transpose() * away).to_array();
        let within = |angle: f64, view: f64| 2.0 * angle.to_degrees().abs() <= view;
        away.length() <= self.range
            && within(maths::atan2(y, x), self.fov[0])
            && within(maths::atan2(z, maths::hypot(x, y)), self.fov[1])
    }

    /// Unit directions that fill its field of view evenly in angle, in the ego frame: `count` by `count`.
    pub fn directions(&self, count: usize) -> impl Iterator<Item = DVec3> + '_ {
        let angle =
            move |k: usize, view: f64| view.to_radians() * ((k as f64 + 0.5) / count as f64 - 0.5);
        (0..count * count).map(move |k| {
            let (azimuth, elevation) =
                (angle(k / count, self.fov[0]), angle(k % count, self.fov[1]));
            let ((sin, cos), (up, level)) = (maths::sin_cos(azimuth), maths::sin_cos(elevation));
            self.ego_from_sensor.rotation * DVec3::new(level * cos, level * sin, up)
        })
    }

    /// Reads the list at `at`; `notes` takes likely mistakes.
    pub(super) fn read_all(
        at: &Location,
        list: Vec<OtherSensorDescription>,
        notes: &mut Vec<Note>,
    ) -> Checked<Vec<Self>> {
        if list.len() > MOST {
            let found = format!("a list of {}", list.len());
            return Err(bad(at, found, format!("at most {MOST} entries; leave some out")));
        }
        let mut names = HashSet::new();
        let mut all = Vec::new();
        for (i, described) in list.into_iter().enumerate() {
            let at = at.item(i);
            let sensor = Self::new(&at, described, notes)?;
            if !names.insert(sensor.name.clone()) {
                let wanted = "a name of its own; it is used twice";
                return Err(bad(&at.key("name"), format!("`{}`", sensor.name), wanted));
            }
            all.push(sensor);
        }
        Ok(all)
    }

    fn new(
        at: &Location,
        described: OtherSensorDescription,
        notes: &mut Vec<Note>,
    ) -> Checked<Self> {
        let OtherSensorDescription { name, technology, fov, range, .. } = described;
        let name = check::name(&at.key("name"), name)?;
        if name.trim().is_empty() {
            return Err(bad(&at.key("name"), format!("{name:?}"), "a name"));
        }
        let technology = word(&at.key("technology"), technology)?;
        let metres = [("x", described.x), ("y", described.y), ("z", described.z)];
        for (key, value) in metres {
            if !(-FARTHEST..=FARTHEST).contains(&value) {
                let wanted = format!("metres within {FARTHEST} m of the ego frame's origin");
                return Err(bad(&at.key(key), value, wanted));
            }
        }
        let radians = [described.roll, described.pitch, described.yaw];
        for (key, value) in SensorPose::FIELDS[3..].iter().zip(radians) {
            check::radians(&at.key(key), value)?;
            notes.extend(of_angles(&at.key(key).to_string(), &[value]).map(Note::doubt));
        }
        for (k, most) in WIDEST.into_iter().enumerate() {
            if !(fov[k] > 0.0 && fov[k] <= most) {
                let wanted = format!("an angle above 0 and at most {most} degrees");
                return Err(bad(&at.key("fov").item(k), fov[k], wanted));
            }
        }
        notes.extend(view_in_radians(&at.key("fov"), fov));
        if !(range > 0.0 && range <= LONGEST) {
            let wanted = format!("a range above 0 and at most {LONGEST} m");
            return Err(bad(&at.key("range"), range, wanted));
        }
        let [x, y, z] = metres.map(|(_, value)| value);
        let [roll, pitch, yaw] = radians;
        let ego_from_sensor = Pose::new(DVec3::new(x, y, z), roll, pitch, yaw);
        Ok(Self { name, technology, ego_from_sensor, fov, range })
    }
}

/// A doubt about a field of view that is most likely in radians: narrow both ways, or parts of π.
fn view_in_radians(at: &Location, fov: [f64; 2]) -> Option<Note> {
    let [across, up] = fov;
    let narrow = (across.max(up) < NARROW).then(|| {
        let degrees = across.to_degrees();
        format!("{at}: {across}° by {up}°; radians? {across} rad are {degrees:.1}°")
    });
    narrow.or_else(|| of_degrees(&at.to_string(), &fov)).map(Note::doubt)
}

/// A word for a technology; `lidar` is taken.
fn word(at: &Location, word: String) -> Checked<String> {
    let is_word = (1..=MOST_LETTERS).contains(&word.len())
        && word.bytes().all(|letter| letter.is_ascii_lowercase());
    if !is_word {
        let wanted = format!(
            "a word of 1 to {MOST_LETTERS} letters a to z, \"camera\" or \"radar\" for example"
        );
        return Err(bad(at, format!("{word:?}"), wanted));
    }
    if word == LIDAR {
        let wanted =
            "another technology; a LiDAR has its model in `sensors` and its pose in a placement";
        return Err(bad(at, format!("{word:?}"), wanted));
    }
    Ok(word)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn sensor(fov: [f64; 2]) -> OtherSensor {
        let ego_from_sensor = Pose::new(DVec3::new(1.0, 2.0, 3.0), 0.0, 0.0, FRAC_PI_2);
        OtherSensor { name: "a".into(), technology: "b".into(), ego_from_sensor, fov, range: 10.0 }
    }

    #[test]
    fn a_point_is_in_the_cone_by_azimuth_elevation_and_range() {
        let sensor = sensor([60.0, 20.0]);
        // The axis is the ego frame's y.
        let at = |ahead: f64, right: f64, up: f64| DVec3::new(1.0 + right, 2.0 + ahead, 3.0 + up);
        let [a, e] = [30_f64, 10.0].map(|half| half.to_radians().tan());
        for (ahead, right, up, held) in [
            (9.99, 0.0, 0.0, true),
            (10.01, 0.0, 0.0, false),
            (-5.0, 0.0, 0.0, false),
            (5.0, 4.99 * a, 0.0, true),
            (5.0, -5.01 * a, 0.0, false),
            (5.0, 0.0, -4.99 * e, true),
            (5.0, 0.0, 5.01 * e, false),
        ] {
            assert_eq!(sensor.holds(at(ahead, right, up)), held, "{ahead} {right} {up}");
        }
        // The elevation counts from the plane of x and y: at the side the cone is as high as ahead.
        let far = 5.0 * (1.0 + a * a).sqrt();
        assert!(sensor.holds(at(5.0, 4.99 * a, 0.99 * e * far)));
        assert!(!sensor.holds(at(5.0, 4.99 * a, 1.01 * e * far)));
        assert!(sensor.holds(sensor.position()));
    }

    #[test]
    fn directions_fill_the_view() {
        for fov in [[60.0, 20.0], [360.0, 180.0]] {
            let sensor = sensor(fov);
            let all: Vec<DVec3> = sensor.directions(8).collect();
            assert_eq!(all.len(), 64);
            for direction in all {
                assert!((direction.length() - 1.0).abs() < 1e-12);
                assert!(sensor.holds(sensor.position() + direction));
            }
        }
        // The outermost of four by four lie three quarters of half a view from the axis: 22.5° across, 7.5° down.
        let sensor = sensor([60.0, 20.0]);
        let corner = sensor.directions(4).next().unwrap();
        let (across, up) = (22.5_f64.to_radians(), -7.5_f64.to_radians());
        let wanted = DVec3::new(up.cos() * across.sin(), up.cos() * across.cos(), up.sin());
        assert!((corner - wanted).length() < 1e-12, "{corner} {wanted}");
    }

    #[test]
    fn fields_of_view_in_radians_are_doubted() {
        let at = Location::top("v.json").key("fov");
        let told = |fov| view_in_radians(&at, fov).map(|note| note.text().to_owned());
        let narrow = told([1.05, 0.6]).unwrap();
        assert_eq!(narrow, "v.json: fov: 1.05° by 0.6°; radians? 1.05 rad are 60.2°");
        assert_eq!([told([60.0, 2.0]), told([4.0, 3.0])], [None, None]);
    }
}
