//! From a rig to the files of another program.

use serde_json::Value;

use super::beams::{Models, RigBeams};
use super::{
    Fan, Mounting, NamedText, Rig, RigError, RigFormat, RigLidar, carla, launch, model, sdf, yaml,
};

/// Models of LiDARs beside Autoware's files.
pub const MODELS_FILE: &str = "models.json";
/// Most LiDARs that CARLA's leaderboard lets an agent have.
const LEADERBOARD_LIDARS: usize = 2;
/// Farthest that they may stand from the vehicle's origin, in metres.
const LEADERBOARD_RADIUS: f64 = 3.0;

/// A rig in another format.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// One file, or the two of Autoware.
    pub files: Vec<NamedText>,
    /// Sentences about parts of the rig that the format cannot hold.
    pub warnings: Vec<String>,
}

/// Writes a rig. `models` are its vehicle's or scene's: the simulators' formats carry their beams.
///
/// # Errors
/// A rig that no placement could be, or a format that is read only.
pub fn export(
    rig: &Rig,
    format: RigFormat,
    mounting: &Mounting,
    models: &Models,
) -> Result<Exported, RigError> {
    rig.validate()?;
    check_models(rig, models)?;
    let fan = |lidar: &RigLidar| models.fan(lidar);
    let one = |name: &str, text| vec![NamedText { name: name.to_owned(), text }];
    let files = match format {
        RigFormat::Autoware => {
            let mut files = yaml::write_autoware(rig, mounting);
            let text = models.document(rig).map(|document| pretty(&document));
            files.extend(text.map(|text| NamedText { name: MODELS_FILE.to_owned(), text }));
            files
        }
        RigFormat::Urdf => one("rig.urdf", sdf::write_urdf(rig, mounting, models)),
        RigFormat::Sdf => one("rig.sdf", sdf::write(rig, mounting, models)),
        RigFormat::Ros2Launch => one("rig.launch.xml", launch::write(rig, mounting)),
        RigFormat::Carla => one("sensors.json", pretty(&carla::write(rig, mounting, fan))),
        RigFormat::CarlaObjects => {
            one("objects.json", pretty(&carla::write_objects(rig, mounting, fan)))
        }
        RigFormat::Json => one("placements.json", pretty(&model::rig_json(&[rig]))),
        RigFormat::Tf | RigFormat::Pandaset => return Err(RigError::ReadOnly { format }),
    };
    let mut warnings = Vec::new();
    if let Some(program) = simulator(format) {
        let unsaid = |lidar| unsaid_beams(lidar, models, program);
        warnings.extend(rig.lidars.iter().filter_map(unsaid));
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
    warnings.extend(lost_models(rig, format));
    Ok(Exported { files, warnings })
}

/// Warning about phases that the format has no place for.
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

/// Refuses LiDARs without a model where there are several, and models that are none of them.
fn check_models(rig: &Rig, models: &Models) -> Result<(), RigError> {
    let known = models.names();
    for lidar in &rig.lidars {
        let frame = lidar.frame.clone();
        match (&lidar.sensor, models.of(lidar)) {
            (None, _) if models.count() > 1 => {
                return Err(RigError::UnnamedModel { frame, known });
            }
            (Some(sensor), RigBeams::Unknown) if !known.is_empty() => {
                let sensor = sensor.clone();
                return Err(RigError::UnknownModel { frame, sensor, known });
            }
            _ => {}
        }
    }
    Ok(())
}

/// The simulator that casts the beams of a format.
fn simulator(format: RigFormat) -> Option<&'static str> {
    match format {
        RigFormat::Carla | RigFormat::CarlaObjects => Some("CARLA"),
        RigFormat::Urdf | RigFormat::Sdf => Some("Gazebo"),
        _ => None,
    }
}

/// Warning about a LiDAR whose beams a simulator cannot reproduce.
fn unsaid_beams(lidar: &RigLidar, models: &Models, program: &str) -> Option<String> {
    let frame = &lidar.frame;
    let of = lidar.sensor.as_deref().unwrap_or("the scene's sensor");
    let said = match models.of(lidar) {
        RigBeams::Known(_) => return None,
        RigBeams::Given(given, _) => match Fan::of(given) {
            Some(fan) if !fan.is_even => format!(
                "{program} casts channels at even steps only, and those of {of} are uneven; only their number, \
                 the lowest and the highest are kept"
            ),
            Some(fan) if program == "CARLA" && !fan.is_centred() => format!(
                "{program} casts a sector to both sides of straight ahead, and that of {of} is not; turn the \
                 LiDAR by its middle in CARLA"
            ),
            Some(_) => return None,
            None => format!(
                "{of} has a list of directions, which {program} cannot cast; its beams are left out, and \
                 {program} takes its own"
            ),
        },
        RigBeams::Uneven => format!(
            "{program} casts channels at even steps only, and those of {of} are uneven; its channels and field \
             of view are left out, and {program} takes its own"
        ),
        RigBeams::Unknown => format!(
            "its beams are not known, so {program} takes its own; name its sensor, and give --vehicle or \
             --scene"
        ),
    };
    Some(format!("`{frame}`: {said}"))
}

/// Warning about model names that the format has no place for.
fn lost_models(rig: &Rig, format: RigFormat) -> Option<String> {
    let (what, kept) = match format {
        RigFormat::Autoware => (
            "YAML files have",
            format!(
                "with --out they are in {MODELS_FILE}, which `rig import` of the folder reads; else "
            ),
        ),
        RigFormat::Ros2Launch => ("a launch file has", String::new()),
        RigFormat::Carla | RigFormat::CarlaObjects => ("CARLA has", String::new()),
        _ => return None,
    };
    let named =
        |lidar: &RigLidar| Some(format!("--sensor {}={}", lidar.frame, lidar.sensor.as_ref()?));
    let options: Vec<String> = rig.lidars.iter().filter_map(named).collect();
    (!options.is_empty()).then(|| {
        format!("{what} no place for names of models; {kept}import them with {}", options.join(" "))
    })
}

/// Warnings about limits of CARLA's leaderboard: number of LiDARs, distance from the vehicle's origin.
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
