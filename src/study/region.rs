//! A part of the region of interest by distance, by direction, or a box.

use crate::maths;

/// A part of the region of interest, by the centres of its voxels in the ego frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Subregion {
    /// Name of its column.
    pub name: String,
    extent: Extent,
}

#[derive(Debug, Clone, PartialEq)]
enum Extent {
    /// Horizontal distance from the ego origin, in metres: from, up to.
    Ring(f64, f64),
    /// Angle between forward (0) and rear (π), on either side: from, up to.
    Sector(f64, f64),
    /// Lower and upper corner, in metres.
    Box([f64; 3], [f64; 3]),
}

/// Distances in metres that part near, middle and far.
const RINGS: [f64; 2] = [10.0, 25.0];
/// Angles from forward that part front, side and rear.
const SECTORS: [f64; 2] = [std::f64::consts::FRAC_PI_4, 3.0 * std::f64::consts::FRAC_PI_4];

impl Subregion {
    /// Near, middle and far; front, side and rear.
    pub(super) fn standard() -> Vec<Self> {
        let [near, far] = RINGS;
        let [front, rear] = SECTORS;
        let ring =
            |name: &str, from, to| Self { name: name.into(), extent: Extent::Ring(from, to) };
        let sector =
            |name: &str, from, to| Self { name: name.into(), extent: Extent::Sector(from, to) };
        vec![
            ring("near", 0.0, near),
            ring("middle", near, far),
            ring("far", far, f64::INFINITY),
            sector("front", 0.0, front),
            sector("side", front, rear),
            sector("rear", rear, f64::INFINITY),
        ]
    }

    /// A box from its corners, in metres.
    pub fn of_box(name: &str, min: [f64; 3], max: [f64; 3]) -> Self {
        Self { name: name.to_owned(), extent: Extent::Box(min, max) }
    }

    /// True if a point of the ego frame lies in the region; lower ends belong to it, upper ends do not.
    pub(super) fn holds(&self, point: [f64; 3]) -> bool {
        let [x, y, _] = point;
        match &self.extent {
            Extent::Ring(from, to) => (*from..*to).contains(&maths::hypot(x, y)),
            Extent::Sector(from, to) => (*from..*to).contains(&maths::atan2(y.abs(), x)),
            Extent::Box(min, max) => (0..3).all(|k| (min[k]..max[k]).contains(&point[k])),
        }
    }
}
