//! The voxels that beams traverse, in `f64`: sixteen beams step at a time, each by the rule of one alone.

use glam::DVec3;
use multiversion::multiversion;

use crate::psog::Roi;

/// Numbers closer than this are meant to be one: direction components and zero (cos 90° is 6e-17), grid
/// coordinates and whole numbers, metres at which a beam crosses planes (cos 45° and sin 45° differ in
/// the last digit).
pub(super) const ROUNDING: f64 = 1e-9;
/// Beams that walk at the same time.
const LANES: usize = 16;
/// Crossing of a lane without a beam, in metres.
const NEVER: f64 = 1e300;

/// Grid coordinates of a point, whole where they are meant to be.
pub(super) fn coordinates(roi: &Roi, point: DVec3) -> [f64; 3] {
    let (min, voxel) = (roi.min(), roi.voxel());
    [0, 1, 2].map(|a| {
        let p = (point[a] - min[a]) / voxel[a];
        if (p - p.round()).abs() < ROUNDING { p.round() } else { p }
    })
}

/// A beam in the voxel where it enters the grid.
///
/// Axes along which it goes backward are turned round, so that planes rise along every beam:
/// (i − p) · d⁻¹ is (−i + p) · |d⁻¹|, the same number.
struct Walk {
    /// Linear index of the voxel.
    voxel: i64,
    /// By axis: minus the origin, the next plane to cross, metres from one plane to the next, voxels of a step.
    minus: [f64; 3],
    plane: [f64; 3],
    along: [f64; 3],
    stride: [i64; 3],
    /// Metres at which it ends, and at which it leaves the grid.
    end: f64,
    exit: f64,
}

impl Walk {
    /// The start of a beam from grid coordinates `p`; `None` where it meets no voxel for 0 ≤ t ≤ `end`.
    fn new(roi: &Roi, p: [f64; 3], direction: DVec3, end: f64) -> Option<Self> {
        let (shape, voxel) = (roi.shape().map(i64::from), roi.voxel());
        // A level beam never crosses a plane.
        let is_level = [0, 1, 2].map(|a| direction[a] == 0.0);
        let along = [0, 1, 2].map(|a| voxel[a] / direction[a]);
        let crossing = |a: usize, i: i64| match is_level[a] {
            true => NEVER,
            false => (i as f64 - p[a]) * along[a],
        };
        let mut enter = 0.0_f64;
        for a in 0..3 {
            if direction[a] >= 0.0 && p[a] >= shape[a] as f64 || direction[a] <= 0.0 && p[a] < 0.0 {
                return None;
            }
            if p[a] < 0.0 {
                enter = enter.max(crossing(a, 0));
            } else if p[a] >= shape[a] as f64 {
                enter = enter.max(crossing(a, shape[a]));
            }
        }
        if enter > end {
            return None;
        }
        let forward = [0, 1, 2].map(|a| direction[a] >= 0.0);
        let step = forward.map(|f| if f { 1 } else { -1 });
        let cell = [0, 1, 2].map(|a| {
            // One voxel too early at most; then on to the one after every crossing up to `enter`.
            let guess = (p[a] + enter * direction[a] / voxel[a]).floor() as i64;
            let mut i = guess - step[a];
            while crossing(a, i + i64::from(forward[a])) <= enter + ROUNDING {
                i += step[a];
            }
            if is_level[a] { guess } else { i }
        });
        if (0..3).any(|a| !(0..shape[a]).contains(&cell[a])) {
            return None;
        }
        let strides = [shape[1] * shape[2], shape[2], 1];
        let exits = [0, 1, 2].map(|a| crossing(a, if forward[a] { shape[a] } else { 0 }));
        let plane = |a: usize| (step[a] * (cell[a] + i64::from(forward[a]))) as f64;
        Some(Self {
            voxel: (0..3).map(|a| cell[a] * strides[a]).sum(),
            minus: [0, 1, 2].map(|a| if forward[a] { -p[a] } else { p[a] }),
            plane: [0, 1, 2].map(|a| if is_level[a] { NEVER } else { plane(a) }),
            along: [0, 1, 2].map(|a| if is_level[a] { 1.0 } else { along[a].abs() }),
            stride: [0, 1, 2].map(|a| step[a] * strides[a]),
            end,
            exit: exits[0].min(exits[1]).min(exits[2]),
        })
    }
}

/// Marks the voxels that beams from grid coordinates `p` traverse for 0 ≤ t ≤ their end, in metres.
///
/// Crossings that coincide are taken at once, and a crossing at the very start or end counts.
pub(super) fn mark(roi: &Roi, p: [f64; 3], beams: &[(DVec3, f64)], bitmap: &mut [u64]) {
    let share = beams.len().div_ceil(LANES);
    // A lane takes neighbouring beams one after the other; beside each other they would mark the same words.
    let mut left: [_; LANES] = std::array::from_fn(|lane| {
        let begin = (lane * share).min(beams.len());
        beams[begin..(begin + share).min(beams.len())].iter()
    });
    let mut lanes = Lanes::new();
    let mut walking = LANES;
    while walking > 0 {
        for (lane, left) in left.iter_mut().enumerate() {
            if lanes.ended.0[lane] == 0 {
                continue;
            }
            let walk = left.find_map(|&(direction, end)| Walk::new(roi, p, direction, end));
            walking -= usize::from(walk.is_none() && lanes.mask.0[lane] != 0);
            lanes.put(lane, walk.as_ref());
        }
        if walking > 0 {
            walk(&mut lanes, bitmap);
        }
    }
}

/// A number of each lane.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct PerLane<T>([T; LANES]);

/// Numbers of [`Walk`] of each lane.
#[derive(Clone, Copy)]
struct Lanes {
    voxel: PerLane<i64>,
    minus: [PerLane<f64>; 3],
    plane: [PerLane<f64>; 3],
    along: [PerLane<f64>; 3],
    stride: [PerLane<i64>; 3],
    end: PerLane<f64>,
    exit: PerLane<f64>,
    /// 1 where there is a beam.
    mask: PerLane<u64>,
    /// Other than 0 where the beam has ended.
    ended: PerLane<u64>,
}

impl Lanes {
    fn new() -> Self {
        let (zero, never, one) =
            (PerLane([0.0; LANES]), PerLane([NEVER; LANES]), PerLane([1.0; LANES]));
        Self {
            voxel: PerLane([0; LANES]),
            minus: [zero; 3],
            plane: [never; 3],
            along: [one; 3],
            stride: [PerLane([0; LANES]); 3],
            end: never,
            exit: PerLane([f64::INFINITY; LANES]),
            mask: PerLane([1; LANES]),
            ended: PerLane([1; LANES]),
        }
    }

    /// A beam for a lane that is free, or none, for which it then never ends.
    fn put(&mut self, lane: usize, walk: Option<&Walk>) {
        self.mask.0[lane] = u64::from(walk.is_some());
        self.ended.0[lane] = 0;
        self.voxel.0[lane] = walk.map_or(0, |walk| walk.voxel);
        self.end.0[lane] = walk.map_or(f64::INFINITY, |walk| walk.end);
        self.exit.0[lane] = walk.map_or(f64::INFINITY, |walk| walk.exit);
        for a in 0..3 {
            self.minus[a].0[lane] = walk.map_or(0.0, |walk| walk.minus[a]);
            self.plane[a].0[lane] = walk.map_or(NEVER, |walk| walk.plane[a]);
            self.along[a].0[lane] = walk.map_or(1.0, |walk| walk.along[a]);
            self.stride[a].0[lane] = walk.map_or(0, |walk| walk.stride[a]);
        }
    }
}

/// Walks until a lane's beam ends.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
#[allow(clippy::needless_range_loop)]
fn walk(lanes: &mut Lanes, bitmap: &mut [u64]) {
    let Lanes { voxel, minus, plane, along, stride, end, exit, mask, ended } = lanes;
    let ([mx, my, mz], [ax, ay, az], [sx, sy, sz]) = (*minus, *along, *stride);
    let [mut px, mut py, mut pz] = *plane;
    let mut at = *voxel;
    let mut over = PerLane([0_u64; LANES]);
    loop {
        for i in 0..LANES {
            bitmap[(at.0[i] >> 6) as usize] |= mask.0[i] << (at.0[i] & 63);
        }
        let mut any = 0;
        for i in 0..LANES {
            let x = (px.0[i] + mx.0[i]) * ax.0[i];
            let y = (py.0[i] + my.0[i]) * ay.0[i];
            let z = (pz.0[i] + mz.0[i]) * az.0[i];
            let xy = if x < y { x } else { y };
            let t = if xy < z { xy } else { z };
            let until = t + ROUNDING;
            over.0[i] = if t > end.0[i] { 1 } else { 0 } | if until >= exit.0[i] { 1 } else { 0 };
            any |= over.0[i];
            let (on_x, on_y, on_z) = (x <= until, y <= until, z <= until);
            px.0[i] += if on_x { 1.0 } else { 0.0 };
            py.0[i] += if on_y { 1.0 } else { 0.0 };
            pz.0[i] += if on_z { 1.0 } else { 0.0 };
            let by_x = if on_x { sx.0[i] } else { 0 };
            let by_y = if on_y { sy.0[i] } else { 0 };
            let by_z = if on_z { sz.0[i] } else { 0 };
            at.0[i] = at.0[i].wrapping_add(by_x).wrapping_add(by_y).wrapping_add(by_z);
        }
        if any != 0 {
            break;
        }
    }
    (*plane, *voxel, *ended) = ([px, py, pz], at, over);
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// One beam, a step at a time: the definition.
    fn walk_one(roi: &Roi, origin: DVec3, direction: DVec3, end: f64, mut mark: impl FnMut(usize)) {
        let shape = roi.shape().map(i64::from);
        let (min, voxel) = (roi.min(), roi.voxel());
        let p = [0, 1, 2].map(|a| {
            let p = (origin[a] - min[a]) / voxel[a];
            if (p - p.round()).abs() < ROUNDING { p.round() } else { p }
        });
        // When the beam crosses plane i of an axis; a level beam never does.
        let along =
            [0, 1, 2].map(|a| if direction[a] == 0.0 { 0.0 } else { voxel[a] / direction[a] });
        let crossing = |a: usize, i: i64| match along[a] {
            0.0 => f64::INFINITY,
            along => (i as f64 - p[a]) * along,
        };
        let mut enter = 0.0_f64;
        for a in 0..3 {
            if direction[a] >= 0.0 && p[a] >= shape[a] as f64 || direction[a] <= 0.0 && p[a] < 0.0 {
                return;
            }
            if p[a] < 0.0 {
                enter = enter.max(crossing(a, 0));
            } else if p[a] >= shape[a] as f64 {
                enter = enter.max(crossing(a, shape[a]));
            }
        }
        if enter > end {
            return;
        }
        let forward = [0, 1, 2].map(|a| direction[a] >= 0.0);
        // Plane ahead of a voxel.
        let ahead = |a: usize, i: i64| crossing(a, if forward[a] { i + 1 } else { i });
        let step = forward.map(|f| if f { 1 } else { -1 });
        let mut cell = [0, 1, 2].map(|a| {
            // One voxel too early at most; then on to the one after every crossing up to `enter`.
            let guess = (p[a] + enter * direction[a] / voxel[a]).floor() as i64;
            let mut i = guess - step[a];
            while ahead(a, i) <= enter + ROUNDING {
                i += step[a];
            }
            if direction[a] == 0.0 { guess } else { i }
        });
        let mut next = [0, 1, 2].map(|a| ahead(a, cell[a]));
        while (0..3).all(|a| (0..shape[a]).contains(&cell[a])) {
            mark(((cell[0] * shape[1] + cell[1]) * shape[2] + cell[2]) as usize);
            let t = next[0].min(next[1]).min(next[2]);
            if t > end {
                return;
            }
            for a in 0..3 {
                if next[a] <= t + ROUNDING {
                    cell[a] += step[a];
                    next[a] = ahead(a, cell[a]);
                }
            }
        }
    }

    fn cells(origin: [f64; 3], direction: [f64; 3], end: f64) -> Vec<[u32; 3]> {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 4, 4]).unwrap();
        let (mut seen, direction) = (vec![0], DVec3::from(direction).normalize());
        mark(&roi, coordinates(&roi, origin.into()), &[(direction, end)], &mut seen);
        let mut in_order = Vec::new();
        walk_one(&roi, origin.into(), direction, end, |v| in_order.push(v));
        assert_eq!(seen[0], in_order.iter().fold(0, |bits, v| bits | 1 << v));
        in_order.iter().map(|&v| roi.coords(v as u64)).collect()
    }

    #[test]
    fn a_beam_walks_as_the_definition_says() {
        let row = [[0, 1, 2], [1, 1, 2], [2, 1, 2], [3, 1, 2]];
        assert_eq!(cells([0.5, 1.5, 2.5], [1.0, 0.0, 0.0], 100.0), row);
        assert_eq!(cells([0.5, 1.0, 2.0], [1.0, 0.0, 0.0], 100.0), row);
        assert_eq!(cells([-2.0, 1.5, 2.5], [1.0, 0.0, 0.0], 3.5), row[..2]);
        assert!(cells([-2.0, 1.5, 2.5], [-1.0, 0.0, 0.0], 100.0).is_empty());
        assert!(cells([-2.0, 4.0, 2.5], [1.0, 0.0, 0.0], 100.0).is_empty());
        // Going back from a face leaves the voxel above it at once.
        assert_eq!(cells([2.0, 0.5, 0.5], [-1.0, 0.0, 0.0], 9.0), [[1, 0, 0], [0, 0, 0]]);
        assert_eq!(
            cells([3.5, 3.5, 1.5], [-1.0, -1.0, 0.0], 100.0),
            [[3, 3, 1], [2, 2, 1], [1, 1, 1], [0, 0, 1]]
        );
        // At 45° through edges, from inside and from outside, where cos and sin differ by rounding.
        let (sin, cos) = std::f64::consts::FRAC_PI_4.sin_cos();
        assert_ne!(sin, cos);
        let diagonal = [[0, 0, 1], [1, 1, 1], [2, 2, 1], [3, 3, 1]];
        assert_eq!(cells([0.3, 0.3, 1.5], [cos, sin, 0.0], 100.0), diagonal);
        assert_eq!(cells([-1.7, -1.7, 1.5], [cos, sin, 0.0], 100.0), diagonal);
        assert_eq!(cells([0.5, 0.5, 0.5], [0.0, 1.0, 0.0], 1.5), [[0, 0, 0], [0, 1, 0], [0, 2, 0]]);
        assert_eq!(cells([0.5, 0.5, 0.5], [0.0, 1.0, 0.0], 1.4999), [[0, 0, 0], [0, 1, 0]]);
    }

    #[test]
    fn beams_side_by_side_mark_what_each_marks_alone() {
        let roi = Roi::new([-3.0, -2.0, -1.0], [0.3, 0.2, 0.25], [20, 23, 9]).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut voxels, mut missed) = (0, 0);
        for _ in 0..200 {
            let within = rng.random_range(0..3) > 0;
            let far = if within { 0.9 } else { 4.0 };
            let origin = DVec3::from([0; 3].map(|_| rng.random_range(-far..far)));
            // Some go along an axis, some along diagonals; their number is no multiple of the lanes.
            let count = rng.random_range(0..40);
            let beams = (0..count).map(|_| {
                let way = [0; 3].map(|_| f64::from(rng.random_range(-2..3)));
                let fine = [0; 3].map(|_| rng.random_range(-1.0..1.0));
                let way = if rng.random_range(0..2) == 0 { way } else { fine };
                let way = DVec3::from(way).try_normalize().unwrap_or(DVec3::X);
                (way, rng.random_range(0.0..8.0))
            });
            let beams: Vec<(DVec3, f64)> = beams.collect();
            let words = roi.voxel_count().div_ceil(64) as usize;
            let (mut marked, mut wanted) = (vec![0_u64; words], vec![0_u64; words]);
            mark(&roi, coordinates(&roi, origin), &beams, &mut marked);
            for &(direction, end) in &beams {
                let before = voxels;
                walk_one(&roi, origin, direction, end, |v| {
                    wanted[v >> 6] |= 1 << (v & 63);
                    voxels += 1;
                });
                missed += usize::from(voxels == before);
            }
            assert_eq!(marked, wanted, "{origin} {beams:?}");
        }
        assert!(voxels > 5000 && missed > 100, "{voxels} voxels, {missed} beams beside the grid");
    }
}
