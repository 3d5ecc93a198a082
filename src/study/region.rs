use crate::problem::Content;
use crate::psog::{Roi, to_nats};

/// A part of the region of interest, by the centres of its voxels in the ego frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// For tables.
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

impl Region {
    /// Near, middle and far; front, side and rear.
    pub fn standard() -> Vec<Self> {
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

    /// Whether a point of the ego frame lies in it; lower ends belong to it, upper ends do not.
    pub fn holds(&self, point: [f64; 3]) -> bool {
        let [x, y, _] = point;
        match &self.extent {
            Extent::Ring(from, to) => (*from..*to).contains(&x.hypot(y)),
            Extent::Sector(from, to) => (*from..*to).contains(&y.abs().atan2(x)),
            Extent::Box(min, max) => (0..3).all(|k| (min[k]..max[k]).contains(&point[k])),
        }
    }
}

/// Information of one region: all there is, and what was gained of it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RegionGain {
    /// Σ H over the region's voxels, in nats.
    pub total: f64,
    /// Σ c(v) H over them, in nats.
    pub gained: f64,
}

/// Gains by region; `covered` holds the rising voxel indices of each frame.
pub fn gains_by_region(
    roi: &Roi,
    content: &Content,
    regions: &[Region],
    covered: &[Vec<u64>],
) -> Vec<RegionGain> {
    let mut gains = vec![RegionGain::default(); regions.len()];
    let (min, edge) = (roi.min(), roi.voxel());
    for voxel in content.occupied() {
        let index = u64::from(voxel.index);
        let coords = roi.coords(index);
        let centre = [0, 1, 2].map(|k| min[k] + (f64::from(coords[k]) + 0.5) * edge[k]);
        let frames = covered.iter().filter(|frame| frame.binary_search(&index).is_ok()).count();
        let share = frames as f64 / covered.len() as f64;
        let worth = to_nats(u64::from(voxel.entropy[0]));
        for (gain, region) in gains.iter_mut().zip(regions) {
            if region.holds(centre) {
                gain.total += worth;
                gain.gained += share * worth;
            }
        }
    }
    gains
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::OccupiedVoxel;
    use crate::psog::fixed;

    #[test]
    fn regions_part_the_plane() {
        let regions = Region::standard();
        let of = |x: f64, y: f64| -> Vec<&str> {
            let held = regions.iter().filter(|r| r.holds([x, y, 1.0]));
            held.map(|r| r.name.as_str()).collect()
        };
        assert_eq!(of(5.0, 1.0), ["near", "front"]);
        assert_eq!(of(0.0, -10.0), ["middle", "side"]);
        assert_eq!(of(-30.0, 4.0), ["far", "rear"]);
        assert_eq!(of(-3.0, 0.0), ["near", "rear"], "straight back too");
        let kerb = Region::of_box("kerb", [0.0, -4.0, 0.0], [10.0, -3.0, 0.3]);
        assert!(kerb.holds([0.0, -3.5, 0.1]) && !kerb.holds([10.0, -3.5, 0.1]));
    }

    #[test]
    fn gains_are_means_over_frames() {
        let roi = Roi::new([0.0, -1.0, 0.0], [10.0, 2.0, 1.0], [3, 1, 1]).unwrap();
        let voxel = |index| OccupiedVoxel { index, entropy: [fixed(1.0); 3] };
        let content =
            Content::new(vec!["a".into()], vec![voxel(0), voxel(2)], &[vec![0, 2]], false);
        let covered = [vec![0, 1, 2], vec![0]];
        let gains = gains_by_region(&roi, &content, &Region::standard()[..3], &covered);
        let gain = |total, gained| RegionGain { total, gained };
        assert_eq!(gains, [gain(1.0, 1.0), gain(0.0, 0.0), gain(1.0, 0.5)]);
    }
}
