//! Beams of the models that LiDARs of a rig name, in the words of other programs.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{Fan, Rig, RigLidar, known};
use sightline_files::json::written;
use sightline_scene::vehicle::{Lidar, Vehicle};

/// Nearest range of Gazebo's LiDAR where a model has none, in metres.
const NEAREST: f64 = 0.01;

/// Models of a vehicle, for LiDARs of a rig. Without any, sensors that this program knows by name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Models(Vec<Model>);

#[derive(Debug, Clone, PartialEq)]
struct Model {
    /// `None` for the `lidar` of a scene.
    name: Option<String>,
    lidar: Lidar,
    min_range: f64,
}

/// Beams of a LiDAR, as far as they are known.
pub(super) enum Beams<'a> {
    /// Beams from a vehicle.
    Given(&'a Lidar, f64),
    /// Fan of a sensor known by name.
    Known(Fan),
    /// A sensor known by name, whose channels are uneven.
    Uneven,
    /// Nothing says them.
    Unknown,
}

impl From<&Vehicle> for Models {
    fn from(vehicle: &Vehicle) -> Self {
        let model = |of: &sightline_scene::vehicle::VehicleSensor| Model {
            name: (!of.name.is_none()).then(|| of.name.to_string()),
            lidar: of.lidar.clone(),
            min_range: of.response.min_range,
        };
        Self(vehicle.sensors.iter().map(model).collect())
    }
}

impl Models {
    /// Names of the models that have one.
    pub(super) fn names(&self) -> Vec<String> {
        self.0.iter().filter_map(|model| model.name.clone()).collect()
    }

    /// Number of models.
    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// Beams of a LiDAR: of its own model, or of the only one where it names none.
    pub(super) fn of(&self, lidar: &RigLidar) -> Beams<'_> {
        let found = match (&lidar.sensor, &self.0[..]) {
            (Some(name), all) => all.iter().find(|model| model.name.as_ref() == Some(name)),
            (None, [only]) => Some(only),
            (None, _) => None,
        };
        match (found, lidar.sensor.as_deref().and_then(known::fan)) {
            (Some(model), _) => Beams::Given(&model.lidar, model.min_range),
            (None, Some(Some(fan))) => Beams::Known(fan),
            (None, Some(None)) => Beams::Uneven,
            (None, None) => Beams::Unknown,
        }
    }

    /// The fan of a LiDAR, even where its channels are not; `None` where it has none or its beams are not known.
    pub(super) fn fan(&self, lidar: &RigLidar) -> Option<Fan> {
        match self.of(lidar) {
            Beams::Given(lidar, _) => Fan::of(lidar),
            Beams::Known(fan) => Some(fan),
            Beams::Uneven | Beams::Unknown => None,
        }
    }

    /// `<lidar>` of Gazebo: samples, angles in radians and ranges in metres. Empty where the beams are not known.
    pub(super) fn gazebo(&self, lidar: &RigLidar, indent: &str) -> String {
        let Some(fan) = self.fan(lidar) else { return String::new() };
        let nearest = match self.of(lidar) {
            Beams::Given(_, min_range) if min_range > 0.0 => min_range,
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
            format!("{indent}<update_rate>{}</update_rate>\n{indent}<lidar>\n", Fan::RATE);
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
        let used = |model: &&Model| {
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
