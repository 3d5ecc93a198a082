//! The conditions there are: their names, keys, levels and limits in either mode.

/// Whether a condition is computed for each beam, or changes a finished scan as Robo3D (Kong et al. 2023) does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Exact for each beam.
    Physical,
    /// By the public constants, so that results compare.
    Robo3d,
}

impl Mode {
    /// Both modes.
    pub const ALL: [Self; 2] = [Self::Physical, Self::Robo3d];

    /// As the user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Physical => "physical",
            Self::Robo3d => "robo3d",
        }
    }

    /// The other one.
    pub fn other(self) -> Self {
        match self {
            Self::Physical => Self::Robo3d,
            Self::Robo3d => Self::Physical,
        }
    }
}

/// What is wrong with the weather or the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Fog.
    Fog,
    /// Water on the ground.
    Wet,
    /// Falling snow.
    Snow,
    /// Motion blur.
    Blur,
    /// Crosstalk of sensors.
    Crosstalk,
    /// Incomplete echoes of vehicles.
    Echo,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Fog, Self::Wet, Self::Snow, Self::Blur, Self::Crosstalk, Self::Echo];

    /// As the user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fog => "fog",
            Self::Wet => "wet",
            Self::Snow => "snow",
            Self::Blur => "blur",
            Self::Crosstalk => "crosstalk",
            Self::Echo => "echo",
        }
    }
}

/// Names of the levels, weakest first.
pub(super) const LEVELS: [&str; 3] = ["light", "moderate", "heavy"];

/// A number that a condition takes.
#[derive(Debug, PartialEq)]
pub(super) struct Key {
    pub name: &'static str,
    pub unit: &'static str,
    /// Least and greatest value.
    pub limits: [f64; 2],
    /// At each level; without any it is left to chance unless it is given.
    pub levels: Option<[f64; 3]>,
    /// Without a level.
    pub usual: Option<f64>,
}

const fn key(
    name: &'static str,
    unit: &'static str,
    limits: [f64; 2],
    levels: [f64; 3],
    usual: f64,
) -> Key {
    Key { name, unit, limits, levels: Some(levels), usual: Some(usual) }
}

const WATER: Key = key("water", " mm", [0.0, 100.0], [0.2, 1.0, 1.2], 1.0);
const SPEED: Key = key("speed", " m/s", [0.3, 5.0], [2.0, 1.6, 1.6], 1.6);
const SHARE: Key = key("share", "", [0.0, 1.0], [0.006, 0.008, 0.01], 0.008);
const RATIO: Key = key("ratio", "", [0.0, 1.0], [0.75, 0.85, 0.95], 0.85);

/// Keys of a condition in a mode; levels of `robo3d` are those of SemanticKITTI-C, of motion blur those that its
/// scripts name.
pub(super) fn keys(kind: Kind, mode: Mode) -> &'static [Key] {
    // Beyond them the published range R*·r/U(r − 10, r + 10) divides by zero.
    const BETA: Key = key("beta", " 1/m", [0.0, 0.2], [0.008, 0.05, 0.2], 0.05);
    const ALPHA: Key =
        Key { name: "alpha", unit: " 1/m", limits: [0.0, 0.06], levels: None, usual: None };
    // The thinnest and the thickest fog that the public set draws, and one between.
    const MOR: Key = key("mor", " m", [1.0, f64::INFINITY], [600.0, 200.0, 50.0], 200.0);
    const GAIN: Key = key("gain", "", [0.0, 1e3], [1.0; 3], 1.0);
    const FLOOR: Key = key("floor", "", [0.0, 15.0], [0.3, 0.3, 0.7], 0.3);
    const RATE: Key = key("rate", " mm/h", [0.0, 10.0], [0.5, 1.0, 2.5], 1.0);
    const LEFT: Key = key("share", "", [0.0, 1.0], [0.25, 0.5, 1.0], 1.0);
    const SIGMA: Key = key("sigma", " m", [0.0, 10.0], [0.2, 0.25, 0.3], 0.25);
    match (kind, mode) {
        (Kind::Fog, Mode::Physical) => const { &[MOR, GAIN] },
        (Kind::Fog, Mode::Robo3d) => const { &[BETA, ALPHA] },
        (Kind::Wet, Mode::Physical) => const { &[WATER] },
        (Kind::Wet, Mode::Robo3d) => const { &[WATER, FLOOR] },
        (Kind::Snow, _) => const { &[RATE, SPEED] },
        (Kind::Blur, Mode::Physical) => const { &[LEFT] },
        (Kind::Blur, Mode::Robo3d) => const { &[SIGMA] },
        (Kind::Crosstalk, _) => const { &[SHARE] },
        (Kind::Echo, _) => const { &[RATIO] },
    }
}
