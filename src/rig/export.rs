//! From a rig to the files of another program.

use serde_json::Value;

use super::{
    Fan, Mounting, NamedText, Rig, RigError, RigFormat, RigLidar, autoware, carla, carla_objects,
    known, launch, placements, sdf, urdf,
};

/// Most LiDARs that CARLA's leaderboard lets an agent have.
const LEADERBOARD_LIDARS: usize = 2;
/// Farthest that they may stand from the vehicle's origin, in metres.
const LEADERBOARD_RADIUS: f64 = 3.0;

/// A rig in another format.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// One file, or the two of Autoware.
    pub files: Vec<NamedText>,
    /// What the format cannot say, in sentences.
    pub warnings: Vec<String>,
}

/// Writes a rig. `scene_fan` is the scene's sensor, for LiDARs without a sensor that is known: `None` without
/// a scene, `Some(None)` where its channels are uneven. Only CARLA's formats ask for it.
///
/// # Errors
/// A rig that no placement could be, or a format that is read only.
pub fn export(
    rig: &Rig,
    format: RigFormat,
    mounting: &Mounting,
    scene_fan: Option<Option<Fan>>,
) -> Result<Exported, RigError> {
    rig.validate()?;
    let fan = |lidar: &RigLidar| {
        let known = lidar.sensor.as_deref().and_then(known::fan);
        known.or(scene_fan).flatten()
    };
    let one = |name: &str, text| vec![NamedText { name: name.to_owned(), text }];
    let files = match format {
        RigFormat::Autoware => autoware::write(rig, mounting),
        RigFormat::Urdf => one("rig.urdf", urdf::write(rig, mounting)),
        RigFormat::Sdf => one("rig.sdf", sdf::write(rig, mounting)),
        RigFormat::Ros2Launch => one("rig.launch.xml", launch::write(rig, mounting)),
        RigFormat::Carla => one("sensors.json", pretty(&carla::write(rig, mounting, fan))),
        RigFormat::CarlaObjects => {
            one("objects.json", pretty(&carla_objects::write(rig, mounting, fan)))
        }
        RigFormat::Json => one("placements.json", pretty(&placements::rig_json(&[rig]))),
        RigFormat::Tf | RigFormat::Pandaset => return Err(RigError::ReadOnly { format }),
    };
    let mut warnings = Vec::new();
    if matches!(format, RigFormat::Carla | RigFormat::CarlaObjects) {
        warnings.extend(rig.lidars.iter().filter_map(|lidar| unsaid_fan(lidar, scene_fan)));
    }
    if format == RigFormat::Carla {
        warnings.extend(leaderboard(rig, mounting));
    }
    if matches!(format, RigFormat::Autoware | RigFormat::Ros2Launch) {
        let moved = |lidar: &&RigLidar| {
            mounting.height(&lidar.frame, lidar.sensor.as_deref()).unwrap_or(0.0) != 0.0
        };
        warnings.extend(rig.lidars.iter().find(moved).map(|lidar| {
            format!(
                "`{}` and others are written as the feet of their sensors, which this format does not \
                 name; import them with --sensor or --optical-height",
                lidar.frame
            )
        }));
    }
    warnings.extend(lost_phases(rig, format));
    Ok(Exported { files, warnings })
}

/// What a format without a place for phases loses.
fn lost_phases(rig: &Rig, format: RigFormat) -> Option<String> {
    let phased: Vec<&str> =
        rig.lidars.iter().filter(|l| l.pose.phase.is_some()).map(|l| l.frame.as_str()).collect();
    (format == RigFormat::Ros2Launch && !phased.is_empty()).then(|| {
        format!(
            "a launch file has no place for the phases of {}, which are left out; keep the placement beside it",
            phased.join(", ")
        )
    })
}

fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}

/// What CARLA cannot be told of a LiDAR's beams.
fn unsaid_fan(lidar: &RigLidar, scene_fan: Option<Option<Fan>>) -> Option<String> {
    let frame = &lidar.frame;
    let known = lidar.sensor.as_deref().and_then(known::fan);
    match (known.or(scene_fan), &lidar.sensor) {
        (Some(Some(_)), _) => None,
        (Some(None), sensor) => Some(format!(
            "`{frame}`: CARLA casts channels at even steps only, and those of {} are uneven; its channels and \
             field of view are left out, and CARLA takes its own",
            sensor.as_deref().filter(|_| known.is_some()).unwrap_or("the scene's sensor")
        )),
        (None, _) => Some(format!(
            "`{frame}`: its beams are not known, so CARLA takes its own; name its sensor, or a scene with \
             --scene"
        )),
    }
}

/// What CARLA's leaderboard would refuse.
fn leaderboard(rig: &Rig, mounting: &Mounting) -> Vec<String> {
    let mut warnings = Vec::new();
    if rig.lidars.len() > LEADERBOARD_LIDARS {
        let count = rig.lidars.len();
        warnings.push(format!(
            "CARLA's leaderboard takes at most {LEADERBOARD_LIDARS} LiDARs, here are {count}; other users of \
             its API take them all"
        ));
    }
    for lidar in &rig.lidars {
        let far = mounting.to_base(&lidar.pose).position().length();
        if far > LEADERBOARD_RADIUS {
            let frame = &lidar.frame;
            warnings.push(format!(
                "`{frame}`: stands {far:.2} m from the vehicle's origin; CARLA's leaderboard takes at most \
                 {LEADERBOARD_RADIUS} m"
            ));
        }
    }
    warnings
}
