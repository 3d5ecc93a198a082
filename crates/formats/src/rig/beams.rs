//! Sensor models that LiDARs of a rig name: beams in the words of other programs, optical centres, CARLA's fans.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{Rig, RigLidar};
use sightline_files::json::written;
use sightline_scene::vehicle::{Lidar, Vehicle};

/// Nearest range of Gazebo's LiDAR where a model has none, in metres.
const NEAREST: f64 = 0.01;

/// Models of a vehicle, for LiDARs of a rig. Without any, sensors that this program knows by name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Models(Vec<RigModel>);

/// A model of a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RigModel {
    /// `None` for the `lidar` of a scene.
    name: Option<String>,
    /// Its beams.
    pub lidar: Lidar,
    /// Nearest range in metres.
    min_range: f64,
    /// Turns a second.
    rate: f64,
    /// False where nothing states `rate`.
    has_rate: bool,
}

/// Beams of a LiDAR, as far as they are known.
pub(super) enum RigBeams<'a> {
    /// A model of a vehicle.
    Given(&'a RigModel),
    /// Fan of a sensor known by name.
    Known(Fan),
    /// A sensor known by name, whose channels are uneven.
    Uneven,
    Unknown,
}

impl From<&Vehicle> for Models {
    fn from(vehicle: &Vehicle) -> Self {
        let model = |of: &sightline_scene::vehicle::VehicleSensor| RigModel {
            name: (!of.name.is_none()).then(|| of.name.to_string()),
            lidar: of.lidar.clone(),
            min_range: of.response.min_range,
            rate: of.response.rate,
            has_rate: of.has_rate,
        };
        Self(vehicle.sensors.iter().map(model).collect())
    }
}

impl Models {
    /// Names of the models that have one.
    pub(super) fn names(&self) -> Vec<String> {
        self.0.iter().filter_map(|model| model.name.clone()).collect()
    }

    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// Beams of a LiDAR: of its own model, or of the only one where it names none.
    pub(super) fn of(&self, lidar: &RigLidar) -> RigBeams<'_> {
        let found = match (&lidar.sensor, &self.0[..]) {
            (Some(name), all) => all.iter().find(|model| model.name.as_ref() == Some(name)),
            (None, [only]) => Some(only),
            (None, _) => None,
        };
        match (found, lidar.sensor.as_deref().and_then(find)) {
            (Some(model), _) => RigBeams::Given(model),
            (None, Some(known)) => known.fan.map_or(RigBeams::Uneven, RigBeams::Known),
            (None, None) => RigBeams::Unknown,
        }
    }

    /// The fan of a LiDAR, also of uneven channels; `None` if it has no fan, or its beams are not known.
    pub(super) fn fan(&self, lidar: &RigLidar) -> Option<Fan> {
        match self.of(lidar) {
            RigBeams::Given(RigModel { lidar, rate, .. }) => {
                Fan::of(lidar).map(|fan| Fan { rate: *rate, ..fan })
            }
            RigBeams::Known(fan) => Some(fan),
            RigBeams::Uneven | RigBeams::Unknown => None,
        }
    }

    /// True for a LiDAR whose fan is written with the usual turns a second, since nothing states another number.
    pub(super) fn turns_as_usual(&self, lidar: &RigLidar) -> bool {
        match self.of(lidar) {
            RigBeams::Given(model) => !model.has_rate && Fan::of(&model.lidar).is_some(),
            RigBeams::Known(_) => true,
            RigBeams::Uneven | RigBeams::Unknown => false,
        }
    }

    /// `<lidar>` of Gazebo: samples, angles in radians and ranges in metres. Empty where the beams are not known.
    pub(super) fn gazebo(&self, lidar: &RigLidar, indent: &str) -> String {
        let Some(fan) = self.fan(lidar) else { return String::new() };
        let nearest = match self.of(lidar) {
            RigBeams::Given(RigModel { min_range, .. }) if *min_range > 0.0 => *min_range,
            _ => NEAREST,
        };
        let steps = fan.azimuth_steps;
        // Step 0 of a turn looks ahead, and the last one ends a step before the first.
        let [from, to] = fan.azimuth.unwrap_or_else(|| {
            let step = 360.0 / f64::from(steps);
            let from = -step * f64::from(steps / 2);
            [from, from + step * f64::from(steps.max(1) - 1)]
        });
        let mut text =
            format!("{indent}<update_rate>{}</update_rate>\n{indent}<lidar>\n", fan.rate);
        let _ = writeln!(text, "{indent}  <scan>");
        for (axis, samples, from, to) in
            [("horizontal", steps, from, to), ("vertical", fan.channels, fan.lower, fan.upper)]
        {
            let [from, to] = [from, to].map(|angle| written(angle.to_radians()));
            let _ = writeln!(
                text,
                "{indent}    <{axis}><samples>{samples}</samples><resolution>1</resolution>\
                 <min_angle>{from}</min_angle><max_angle>{to}</max_angle></{axis}>"
            );
        }
        let _ = writeln!(
            text,
            "{indent}  </scan>\n{indent}  <range><min>{nearest}</min><max>{}</max>\
             <resolution>0.001</resolution></range>\n{indent}</lidar>",
            fan.range
        );
        text
    }

    /// Models of the LiDARs of a rig beside a format that has no place for them; `None` where none is named.
    pub(super) fn document(&self, rig: &Rig) -> Option<Value> {
        let named = |lidar: &RigLidar| Some((lidar.frame.clone(), json!(lidar.sensor.as_ref()?)));
        let lidars: serde_json::Map<String, Value> = rig.lidars.iter().filter_map(named).collect();
        if lidars.is_empty() {
            return None;
        }
        let used = |model: &&RigModel| {
            rig.lidars.iter().any(|lidar| lidar.sensor.is_some() && lidar.sensor == model.name)
        };
        let models = self.0.iter().filter(used);
        let models: serde_json::Map<String, Value> = models
            .filter_map(|model| Some((model.name.clone()?, described(&model.lidar))))
            .collect();
        Some(json!({ "lidars": lidars, "models": models }))
    }
}

/// All numbers of a LiDAR: elevations and azimuths in degrees, range in metres.
fn described(lidar: &Lidar) -> Value {
    let all = |values: &[f64]| values.iter().copied().map(written).collect::<Vec<f64>>();
    match lidar {
        Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range } => json!({
            "elevations": all(elevations),
            "azimuth_offsets": all(azimuth_offsets),
            "azimuth_steps": azimuth_steps,
            "azimuth": azimuth.unwrap_or([0.0, 360.0]),
            "range": range,
        }),
        Lidar::Directions { directions, range } => {
            json!({ "directions": directions, "range": range })
        }
    }
}

/// Largest difference of two elevations that are told apart, in degrees.
const SAME_DEGREES: f64 = 1e-3;
/// Turns a second of a LiDAR that says nothing else.
pub(super) const TURNS_A_SECOND: f64 = 10.0;

/// Facts known of a sensor by its name.
struct KnownSensor {
    name: &'static str,
    /// Optical centre above the foot in metres: `*_base_scan_joint` of Velodyne's description.
    optical_height: f64,
    fan: Option<Fan>,
}

/// Numbers of Velodyne's data sheets; the VLS-128 has uneven channels.
const KNOWN: [KnownSensor; 2] = [
    KnownSensor {
        name: "VLP-16",
        optical_height: 0.0377,
        fan: Some(Fan {
            channels: 16,
            lower: -15.0,
            upper: 15.0,
            range: 100.0,
            azimuth_steps: 1875,
            azimuth: None,
            rate: TURNS_A_SECOND,
            is_even: true,
            is_straight: true,
        }),
    },
    KnownSensor { name: "VLS-128", optical_height: 0.06611, fan: None },
];

/// Channels over a vertical field of view, which turn: all that CARLA and Gazebo can be told of a LiDAR.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fan {
    /// Number of channels.
    pub channels: u32,
    /// Lowest elevation in degrees.
    pub lower: f64,
    /// Highest elevation in degrees.
    pub upper: f64,
    /// Range in metres.
    pub range: f64,
    /// Azimuth steps of a turn, or of the sector.
    pub azimuth_steps: u32,
    /// First and last azimuth in degrees of a LiDAR that looks over a sector.
    pub azimuth: Option<[f64; 2]>,
    /// Turns a second.
    pub rate: f64,
    /// True if the channels are evenly spaced. The programs cast them so.
    pub is_even: bool,
    /// True if all channels look the same way. The programs cast them so.
    pub is_straight: bool,
}

impl Fan {
    /// The fan of a sensor at the usual ten turns a second; `None` of one whose beams are a list of directions.
    pub(super) fn of(lidar: &Lidar) -> Option<Self> {
        let Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range } = lidar
        else {
            return None;
        };
        let mut sorted = elevations.clone();
        sorted.sort_by(f64::total_cmp);
        let (lower, upper) = (*sorted.first()?, *sorted.last()?);
        let gap = (upper - lower) / (sorted.len().max(2) - 1) as f64;
        let even = |(k, e): (usize, &f64)| (lower + gap * k as f64 - e).abs() <= SAME_DEGREES;
        let is_straight = azimuth_offsets.iter().all(|offset| offset.abs() <= SAME_DEGREES);
        Some(Self {
            channels: sorted.len() as u32,
            lower,
            upper,
            range: *range,
            azimuth_steps: *azimuth_steps,
            azimuth: *azimuth,
            rate: TURNS_A_SECOND,
            is_even: sorted.iter().enumerate().all(even),
            is_straight,
        })
    }

    pub(super) fn points_a_second(&self) -> u64 {
        let beams = u64::from(self.channels) * u64::from(self.azimuth_steps);
        (beams as f64 * self.rate).round() as u64
    }

    /// Horizontal field of view in degrees.
    pub(super) fn horizontal(&self) -> f64 {
        self.azimuth.map_or(360.0, |[from, to]| to - from)
    }

    /// True if it looks to both sides alike.
    pub(super) fn is_centred(&self) -> bool {
        self.azimuth.is_none_or(|[from, to]| (from + to).abs() <= SAME_DEGREES)
    }
}

/// True if two names mean one sensor: `VLP16`, `vlp-16` and `VLP 16` do.
pub(super) fn same(a: &str, b: &str) -> bool {
    let letters = |name: &str| {
        let kept = name.chars().filter(|c| c.is_ascii_alphanumeric());
        kept.map(|c| c.to_ascii_lowercase()).collect::<String>()
    };
    letters(a) == letters(b)
}

fn find(name: &str) -> Option<&'static KnownSensor> {
    KNOWN.iter().find(|known| same(known.name, name))
}

/// Optical centre of a sensor above its foot, in metres.
pub(super) fn optical_height(name: &str) -> Option<f64> {
    find(name).map(|known| known.optical_height)
}

/// A sensor's name as this program writes it, and any other name as it is.
pub(super) fn usual(name: &str) -> String {
    find(name).map_or(name, |known| known.name).to_owned()
}

/// The known sensor of a fan.
pub(super) fn of_fan(channels: f64, lower: f64, upper: f64) -> Option<String> {
    let near = |a: f64, b: f64| (a - b).abs() <= SAME_DEGREES;
    let fits = |fan: &Fan| {
        f64::from(fan.channels) == channels && near(fan.lower, lower) && near(fan.upper, upper)
    };
    KNOWN
        .iter()
        .find(|known| known.fan.as_ref().is_some_and(fits))
        .map(|known| known.name.to_owned())
}
