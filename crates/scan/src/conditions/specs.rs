//! The conditions there are: their names, keys, levels and limits.

/// Fault with the weather or the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Fog.
    Fog,
    /// Water on the ground.
    Wet,
    /// Falling snow.
    Snow,
    /// Falling rain.
    Rain,
    /// Motion blur.
    Blur,
    /// Crosstalk of sensors.
    Crosstalk,
    /// Incomplete echoes of vehicles.
    Echo,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Fog, Self::Wet, Self::Snow, Self::Rain, Self::Blur, Self::Crosstalk, Self::Echo];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fog => "fog",
            Self::Wet => "wet",
            Self::Snow => "snow",
            Self::Rain => "rain",
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
    /// At each level.
    pub levels: [f64; 3],
    /// Without a level.
    pub usual: f64,
}

const fn key(
    name: &'static str,
    unit: &'static str,
    limits: [f64; 2],
    levels: [f64; 3],
    usual: f64,
) -> Key {
    Key { name, unit, limits, levels, usual }
}

/// Keys of a condition.
///
/// Levels of fog are the thinnest and the thickest of the fogs that SemanticKITTI-C draws, and one between; those of
/// water, snow, crosstalk and echoes are that set's. Levels of rain lie within slight, moderate and heavy rain of
/// the WMO (below 2.5, 10 and 50 mm/h).
pub(super) fn keys(kind: Kind) -> &'static [Key] {
    const MOR: Key = key("mor", " m", [1.0, f64::INFINITY], [600.0, 200.0, 50.0], 200.0);
    const GAIN: Key = key("gain", "", [0.0, 1e3], [1.0; 3], 1.0);
    const WATER: Key = key("water", " mm", [0.0, 100.0], [0.2, 1.0, 1.2], 1.0);
    const SNOW: Key = key("rate", " mm/h", [0.0, 10.0], [0.5, 1.0, 2.5], 1.0);
    const SPEED: Key = key("speed", " m/s", [0.3, 5.0], [2.0, 1.6, 1.6], 1.6);
    const RAIN: Key = key("rate", " mm/h", [0.0, 200.0], [2.0, 5.0, 25.0], 5.0);
    const LEFT: Key = key("share", "", [0.0, 1.0], [0.25, 0.5, 1.0], 1.0);
    const SHARE: Key = key("share", "", [0.0, 1.0], [0.006, 0.008, 0.01], 0.008);
    const RATIO: Key = key("ratio", "", [0.0, 1.0], [0.75, 0.85, 0.95], 0.85);
    match kind {
        Kind::Fog => const { &[MOR, GAIN] },
        Kind::Wet => const { &[WATER] },
        Kind::Snow => const { &[SNOW, SPEED] },
        Kind::Rain => const { &[RAIN] },
        Kind::Blur => const { &[LEFT] },
        Kind::Crosstalk => const { &[SHARE] },
        Kind::Echo => const { &[RATIO] },
    }
}
