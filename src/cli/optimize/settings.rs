//! From the options of `optimize` to the settings of a run.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use sightline::search::{FrameChoice, Settings, State};
use sightline::vehicle::{MountRules, SensorPose, Spacing, read_placements};

use super::{Args, Fidelity};
use crate::cli::error::Error;

/// Scene and rules that a run was begun with.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Begun {
    pub scene: PathBuf,
    /// Beside those of the scene.
    pub rules: MountRules,
}

/// All that a checkpoint holds.
#[derive(Serialize, Deserialize)]
pub(super) struct Saved {
    pub begun: Begun,
    pub run: State,
}

pub(super) fn begun(args: &Args) -> Result<Begun, Error> {
    let scene = args.scene.clone().expect("clap requires a scene or --resume");
    let scene = std::path::absolute(&scene).map_err(Error::io(&scene))?;
    Ok(Begun { scene, rules: args.rules.for_mount() })
}

/// The settings of a new run.
pub(super) fn of(args: &Args) -> Result<Settings, Error> {
    let mut settings = Settings {
        objective: args.objective.parse()?,
        method: args.method,
        evaluations: args.evaluations,
        population: args.population.map(|p| p as usize),
        delta: args.delta,
        seed: args.seed,
        frames: match (args.fidelity, args.frames) {
            (Fidelity::Full, _) => FrameChoice::All,
            (Fidelity::Auto, Some(frames)) => FrameChoice::Count(frames),
            (Fidelity::Auto, None) => FrameChoice::OnDemand,
        },
        target: args.target,
        ..Settings::default()
    };
    if let Some(file) = &args.baselines {
        settings.baselines = read_placements(file)?;
    }
    if let Some(file) = &args.inject {
        settings.starts = read_placements(file)?;
    }
    Ok(settings)
}

#[derive(clap::Args)]
pub(super) struct Rules {
    /// All LiDARs stand at one height
    #[arg(long, conflicts_with = "resume")]
    equal_height: bool,
    /// LiDARs come in pairs mirrored at the plane y = 0 (y, roll and yaw change sign); an odd one lies
    /// in it
    #[arg(long, conflicts_with = "resume")]
    symmetric: bool,
    /// Keep a pose field of all LiDARs at one value, in metres or radians, as z=2.5 or roll=0; may be
    /// given several times
    #[arg(long, value_name = "FIELD=VALUE", conflicts_with = "resume", value_parser = parse_fixed)]
    fix: Vec<(String, f64)>,
}

impl Rules {
    fn for_mount(&self) -> MountRules {
        MountRules {
            equal_height: self.equal_height,
            symmetric: self.symmetric,
            fixed: self.fix.clone(),
        }
    }
}

/// `--fix`: a pose field and its value.
fn parse_fixed(text: &str) -> Result<(String, f64), String> {
    let parts = text.split_once('=').map(|(field, value)| (field.trim(), value.trim().parse()));
    match parts {
        Some((field, Ok(value))) if SensorPose::FIELDS.contains(&field) => {
            Ok((field.to_owned(), value))
        }
        _ => Err(format!("write one of {} and a number, as z=2.5", SensorPose::FIELDS.join(", "))),
    }
}

/// `--delta`: metres, and radians where they differ, as `0.1` or `0.2,0.1`.
pub(super) fn parse_spacing(text: &str) -> Result<Spacing, String> {
    let (metres, radians) = text.split_once(',').unwrap_or((text, text));
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is no spacing; write metres and radians, as 0.1 or 0.2,0.1")),
    };
    Ok(Spacing { metres: number(metres)?, radians: number(radians)? })
}
