//! Sensors that rigs name: their optical centres and the fans that CARLA can cast.

use sightline_scene::vehicle::Lidar;

/// Largest difference of two elevations that are told apart, in degrees.
const SAME_DEGREES: f64 = 1e-3;
/// Turns a second of a LiDAR that says nothing else.
const TURNS_A_SECOND: f64 = 10.0;

/// Facts known of a sensor by its name.
struct Known {
    name: &'static str,
    /// Optical centre above the foot in metres: `*_base_scan_joint` of Velodyne's description.
    optical_height: f64,
    fan: Option<Fan>,
}

/// Numbers of Velodyne's data sheets; the VLS-128 has uneven channels.
const KNOWN: [Known; 2] = [
    Known {
        name: "VLP-16",
        optical_height: 0.0377,
        fan: Some(Fan {
            channels: 16,
            lower: -15.0,
            upper: 15.0,
            range: 100.0,
            azimuth_steps: 1875,
            azimuth: None,
            is_even: true,
        }),
    },
    Known { name: "VLS-128", optical_height: 0.06611, fan: None },
];

/// Channels over a vertical field of view, which turn: all that CARLA and Gazebo can be told of a LiDAR.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fan {
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
    /// True if the channels are evenly spaced, and all look the same way. The programs cast them so.
    pub is_even: bool,
}

impl Fan {
    /// Turns a second.
    pub(super) const RATE: f64 = TURNS_A_SECOND;

    /// The fan of a sensor; `None` of one whose beams are a list of directions.
    pub fn of(lidar: &Lidar) -> Option<Self> {
        let Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range } = lidar
        else {
            return None;
        };
        let mut sorted = elevations.clone();
        sorted.sort_by(f64::total_cmp);
        let (lower, upper) = (*sorted.first()?, *sorted.last()?);
        let gap = (upper - lower) / (sorted.len().max(2) - 1) as f64;
        let even = |(k, e): (usize, &f64)| (lower + gap * k as f64 - e).abs() <= SAME_DEGREES;
        let straight = azimuth_offsets.iter().all(|offset| offset.abs() <= SAME_DEGREES);
        Some(Self {
            channels: sorted.len() as u32,
            lower,
            upper,
            range: *range,
            azimuth_steps: *azimuth_steps,
            azimuth: *azimuth,
            is_even: straight && sorted.iter().enumerate().all(even),
        })
    }

    /// Beams a second, at ten turns a second.
    pub fn points_a_second(&self) -> u64 {
        u64::from(self.channels) * u64::from(self.azimuth_steps) * TURNS_A_SECOND as u64
    }

    /// Horizontal field of view in degrees.
    pub fn horizontal(&self) -> f64 {
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

fn find(name: &str) -> Option<&'static Known> {
    KNOWN.iter().find(|known| same(known.name, name))
}

/// Optical centre of a sensor above its foot, in metres.
pub(super) fn optical_height(name: &str) -> Option<f64> {
    find(name).map(|known| known.optical_height)
}

/// Fan of a sensor that is known, `Some(None)` where its channels are uneven.
pub(super) fn fan(name: &str) -> Option<Option<Fan>> {
    find(name).map(|known| known.fan)
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
