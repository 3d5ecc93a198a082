//! Corruptions that shift points: motion blur and crosstalk.

use glam::DVec3;

use super::cloud::{Draws, origins, points};
use crate::scan::chance::{Chance, Purpose};
use crate::scan::{Scan, Status};

/// Jitter of a point along x, y and z, in units of the shift's deviation.
const JITTER: DVec3 = DVec3::new(0.1, 0.1, 0.05);
/// Deviation of crosstalk in metres, and in units of intensity.
const CROSSTALK: f64 = 3.0;

/// Three normal numbers, from the `k`-th on.
fn normals(chance: &Chance, k: u32) -> DVec3 {
    DVec3::from([k, k + 1, k + 2].map(|k| chance.normal(Purpose::Corruption, k)))
}

/// One shift of the whole cloud a frame, and a jitter of each point; the published cut at 30 deviations of the
/// jitter never acts and is left out.
pub(super) fn blur(scan: &mut Scan, draws: &Draws, sigma: f64) {
    if sigma == 0.0 {
        return;
    }
    let (chances, origins) = (draws.returns(scan), origins(scan));
    let whole = normals(&draws.frame(), 0);
    for k in points(scan) {
        let by = (whole + normals(&chances[k], 0) * JITTER) * sigma;
        let origin = origins[usize::from(scan.returns[k].lidar)];
        scan.returns[k].shift(by.as_vec3(), origin);
    }
}

/// ⌊share·N⌋ of N points get 3·N(0, 1) onto x, y, z and the intensity.
pub(super) fn crosstalk(scan: &mut Scan, draws: &Draws, share: f64) {
    let points = points(scan);
    let wanted = (share * points.len() as f64).floor() as usize;
    let (chances, origins) = (draws.returns(scan), origins(scan));
    for k in draws.choose(scan, &points, wanted) {
        let beam = &mut scan.returns[k];
        // Numbers 0 and 1 have chosen the point.
        let by = normals(&chances[k], 1) * CROSSTALK;
        beam.intensity += (chances[k].normal(Purpose::Corruption, 4) * CROSSTALK) as f32;
        beam.shift(by.as_vec3(), origins[usize::from(beam.lidar)]);
        beam.detach(Status::Crosstalk);
    }
}
