//! Directions of the virtual scanner: rings as dense as a grid of voxels asks for.

use std::f64::consts::TAU;

use lidar_cast::maths;
use sightline_scene::psog::Roi;
use sightline_scene::scene::ScanSettings;
use sightline_scene::vehicle::{BeamTable, SensorError};

/// Beams of a band of rings, whose hits are held for every stand of the frames scanned together.
const BAND_BEAMS: usize = 1 << 17;

/// Default distance of neighbouring points of one scan pose, in voxel edges. The poses of a window fill each other's gaps:
/// with five, the sparsest voxel face has nine points.
const SPACING: f64 = 0.75;

/// Rings and azimuth steps that a scan has at most, however large the ROI and small its voxels.
const MAX_STEPS: f64 = 16_384.0;

/// Directions of the scanner: rings of one elevation each, from the lowest on.
pub(super) struct Rings(Vec<Ring>);

/// A turn of the scanner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ring {
    /// Radians.
    elevation: f64,
    azimuth_steps: u32,
}

impl Rings {
    pub(super) fn new(settings: &ScanSettings, roi: &Roi) -> Self {
        let spacing = settings.spacing.unwrap_or(SPACING * roi.voxel()[0].max(roi.voxel()[1]));
        let reach =
            roi.min()[..2].iter().chain(&roi.max()[..2]).fold(0.0f64, |r, x| r.max(x.abs()));
        let view = ResolvedSpace { height: settings.height, top: roi.max()[2], reach };
        let step = (spacing / reach).max(TAU / MAX_STEPS);
        let all_around = (TAU / step).ceil();
        let ring = |(elevation, extent): (f64, f64)| {
            // Steps of a quarter octave, so that rings side by side go into one table.
            let quarters = (4.0 * maths::log2(reach / extent)).floor().clamp(0.0, 32.0);
            let spaced = (all_around * maths::exp2(-quarters / 4.0)).ceil() as u32;
            Ring { elevation, azimuth_steps: settings.azimuth_steps.unwrap_or(spaced) }
        };
        let [lower, upper] = settings.fov.map(f64::to_radians);
        Self(match settings.channels {
            Some(channels) => {
                let between = f64::from(channels.max(2) - 1);
                let elevations =
                    (0..channels).map(|k| lower + f64::from(k) * (upper - lower) / between);
                elevations.map(|elevation| ring((elevation, reach))).collect()
            }
            None => {
                let spacing = spacing.max(reach / MAX_STEPS);
                view.elevations(lower, upper, spacing, step).into_iter().map(ring).collect()
            }
        })
    }

    /// Beams of all rings.
    pub(super) fn beams(&self) -> u64 {
        self.0.iter().map(|ring| u64::from(ring.azimuth_steps)).sum()
    }

    /// Rings of as many steps side by side, of about [`BAND_BEAMS`] beams in all.
    pub(super) fn bands(&self) -> impl Iterator<Item = &[Ring]> {
        let alike = self.0.chunk_by(|a, b| a.azimuth_steps == b.azimuth_steps);
        alike.flat_map(|rings| rings.chunks((BAND_BEAMS / rings[0].azimuth_steps as usize).max(1)))
    }
}

/// The beams of some rings of as many steps, in the frame of the scanner.
pub(super) fn table(rings: &[Ring], range: f64) -> Result<BeamTable, SensorError> {
    let channels: Vec<_> = rings.iter().map(|ring| (ring.elevation.to_degrees(), 0.0)).collect();
    BeamTable::spinning(&channels, rings.first().map_or(0, |ring| ring.azimuth_steps), range)
}

/// Space that a scanner must resolve: level ground `height` below it, up to `top` above the ground and
/// `reach` away, in metres.
struct ResolvedSpace {
    height: f64,
    top: f64,
    reach: f64,
}

impl ResolvedSpace {
    /// How far away a beam of this elevation is between the ground and the top, at most `reach`.
    fn extent(&self, elevation: f64) -> f64 {
        let drop = if elevation < 0.0 { self.height } else { self.height - self.top };
        let extent = drop / maths::tan(-elevation);
        if extent > 0.0 { extent.min(self.reach) } else { self.reach }
    }

    /// Elevations whose rings lie `spacing` apart on the ground and on things there: each with its extent,
    /// rising, no two farther apart than `step` at the horizon.
    ///
    /// Evenly spaced channels leave gaps on far ground that no voxel of a usual size bridges: at 40 m and
    /// from 2.8 m up, one degree is 10 m. A wall farther away than the scanner is high is met at least as
    /// densely as the ground.
    fn elevations(&self, lower: f64, upper: f64, spacing: f64, step: f64) -> Vec<(f64, f64)> {
        let mut elevations = Vec::new();
        let mut next = lower;
        loop {
            elevations.push((next, self.extent(next)));
            // Where the ring lies on the ground; endless from the horizon upwards.
            let radius = if next < 0.0 { self.height / maths::tan(-next) } else { f64::INFINITY };
            let on_ground = -maths::atan(self.height / (radius + spacing));
            next = if radius < self.reach && on_ground > next {
                on_ground
            } else {
                next + step.max(spacing / self.extent(next))
            };
            if next >= upper + step {
                return elevations;
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use glam::DVec3;

    use super::*;

    fn settings() -> ScanSettings {
        ScanSettings {
            channels: None,
            fov: [-50.0, 20.0],
            azimuth_steps: None,
            spacing: None,
            range: 100.0,
            height: 2.8,
            window: 5,
            stride: 1,
        }
    }

    /// All of them, ring by ring.
    pub(crate) fn directions(settings: &ScanSettings, roi: &Roi) -> Vec<[f32; 3]> {
        let rings = Rings::new(settings, roi);
        let tables = rings.bands().map(|rings| table(rings, settings.range).unwrap());
        tables.flat_map(|table| table.directions().to_vec()).collect()
    }

    #[test]
    fn points_closer_than_voxels_leave_none_of_the_ground_out() {
        let roi = Roi::new([-20.0, -20.0, -0.5], [0.2; 3], [200, 200, 30]).unwrap();
        let mut met = vec![false; 200 * 200];
        let settings = ScanSettings { spacing: Some(0.14), ..settings() };
        let directions = directions(&settings, &roi);
        let directions = directions.iter().map(|d| DVec3::from(d.map(f64::from)));
        for direction in directions.filter(|d| d.z < 0.0) {
            let on_ground = direction * (2.8 / -direction.z);
            let [i, j] = [on_ground.x, on_ground.y].map(|x| ((x + 20.0) / 0.2).floor());
            if (0.0..200.0).contains(&i) && (0.0..200.0).contains(&j) {
                met[i as usize * 200 + j as usize] = true;
            }
        }
        // All but those under the lowest channel, and past the reach in the corners.
        for (index, met) in met.iter().enumerate() {
            let centre = |k: usize| (k as f64 + 0.5) * 0.2 - 20.0;
            let radius = centre(index / 200).hypot(centre(index % 200));
            assert!(*met || !(2.7..20.0).contains(&radius), "voxel {index} at {radius} m");
        }
    }

    #[test]
    fn no_setting_asks_for_more_than_the_cap() {
        let roi = Roi::new([-1e6, -1e6, 0.0], [2e3, 2e3, 1.0], [1000, 1000, 1]).unwrap();
        let fine = ScanSettings { spacing: Some(1e-6), azimuth_steps: Some(1), ..settings() };
        assert!(Rings::new(&fine, &roi).0.len() < 3 * MAX_STEPS as usize);
        let below = ScanSettings { height: -1.0, azimuth_steps: Some(1), ..settings() };
        let flat = Roi::new([-10.0, -10.0, -1.0], [0.5; 3], [40, 40, 4]).unwrap();
        let rings = Rings::new(&below, &flat).0.len();
        assert_eq!(rings, 33, "steps of 0.0375 rad over 70 degrees, more near the top");
    }
}
