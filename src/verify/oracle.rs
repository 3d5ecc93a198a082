//! Brute force in `f64` over all triangles, and the reasons why a hit in `f32` may differ from it.

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::bvh::{Bvh, Hit, Triangle};
use crate::cast::closest_hit_in;
use crate::engine::BackendError;
use crate::geom::Pose;
use crate::problem::{Frame, Problem};
use crate::vehicle::{Placement, UnknownSensor};

/// A beam that passes an edge closer than this is grazing: rounding may decide either way. Metres at
/// ranges up to 100 m; `f32` keeps a hundredth of it there.
pub(crate) const EDGE_TOLERANCE: f64 = 5e-4;
/// Distances closer than this count as a tie, in metres and as a share of the distance.
const TIE_TOLERANCE: f64 = 1e-4;
/// Growth of both tolerances with each metre between the sensor and the origin of a tree's frame: twice the spacing
/// of `f32` there.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// Comparison of one beam of the reference with brute force in `f64`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Explanation {
    /// Both find one triangle at one distance, or both find none.
    Same,
    /// The two triangles are equally far, or one is at the very end of the range or where the beam starts.
    Tie,
    /// The beam passes within `EDGE_TOLERANCE` of an edge of one of the two triangles.
    Grazing,
    /// None of these.
    Unexplained,
}

/// Counts of explanations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Agreement {
    /// Beams of the sample.
    pub beams: u64,
    /// Beams that differ at an edge.
    pub grazing: u64,
    /// Beams that differ between triangles of equal distance.
    pub tie: u64,
    /// Beams that differ without a reason.
    pub unexplained: u64,
}

/// A triangle as a beam meets it, in `f64` and with formulas of its own (Möller, Trumbore 1997).
struct Meeting {
    /// Metres along the beam to the triangle's plane; not finite for a beam in the plane.
    t: f64,
    inside: bool,
    /// Least distance in metres between the beam's line and the lines of the triangle's edges.
    edge: f64,
}

fn meet(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Meeting {
    let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|v| Vec3::from(v).as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    let s = origin - a;
    let q = s.cross(e1);
    let (u, v) = (s.dot(p) / det, direction.dot(q) / det);
    let edge = [(a, b), (b, c), (c, a)].map(|(from, to)| {
        let normal = direction.cross(to - from);
        let length = normal.length();
        if length > 0.0 { (origin - from).dot(normal).abs() / length } else { 0.0 }
    });
    Meeting {
        t: e2.dot(q) / det,
        inside: det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0,
        edge: edge.into_iter().fold(f64::INFINITY, f64::min),
    }
}

/// A tree and a beam in its frame.
struct Cast<'a> {
    tree: &'a Bvh,
    first_prim: u32,
    origin: DVec3,
    direction: DVec3,
}

/// Compares a hit of the reference in one tree with all triangles in `f64`.
pub fn explain(bvh: &Bvh, origin: Vec3, direction: Vec3, range: f32, hit: Hit) -> Explanation {
    let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
    explain_casts(&[Cast { tree: bvh, first_prim: 0, origin, direction }], range, hit)
}

/// Compares a hit of the reference in a frame with all triangles in `f64`; poses are not rounded.
pub(crate) fn explain_in(
    frame: &Frame,
    ego_from_sensor: &Pose,
    direction: [f32; 3],
    range: f32,
    hit: Hit,
) -> Explanation {
    let casts = frame.instances().iter().map(|instance| {
        let Pose { rotation, translation: origin } = instance.pose_from(ego_from_sensor);
        let direction = rotation * DVec3::from(direction.map(f64::from));
        Cast { tree: &instance.tree, first_prim: instance.first_prim, origin, direction }
    });
    explain_casts(&casts.collect::<Vec<_>>(), range, hit)
}

fn explain_casts(casts: &[Cast<'_>], range: f32, hit: Hit) -> Explanation {
    let range = f64::from(range);
    let mut best: Option<(u32, Meeting)> = None;
    let mut ours: Option<Meeting> = None;
    let mut spare = 0.0_f64;
    for &Cast { tree, first_prim, origin, direction } in casts {
        for triangle in &tree.triangles {
            let prim = first_prim + triangle.prim;
            let meeting = meet(triangle, origin, direction);
            if prim == hit.prim {
                ours = Some(meet(triangle, origin, direction));
            }
            if meeting.inside && meeting.t > 0.0 && meeting.t <= range {
                let closer = best
                    .as_ref()
                    .is_none_or(|(held, b)| meeting.t < b.t || (meeting.t == b.t && prim < *held));
                if closer {
                    best = Some((prim, meeting));
                }
            }
        }
        spare = spare.max(ROUNDING * origin.length());
    }
    let near = |a: f64, b: f64| (a - b).abs() <= TIE_TOLERANCE * (1.0 + a.abs()) + spare;
    let graze = |meeting: &Option<Meeting>| {
        meeting.as_ref().is_some_and(|m| m.edge <= EDGE_TOLERANCE + spare || !m.t.is_finite())
    };
    let best_prim = best.as_ref().map(|(prim, _)| *prim);
    let theirs = best.map(|(_, meeting)| meeting);
    let our_t = f64::from(hit.t);
    if best_prim == ours.as_ref().map(|_| hit.prim)
        && theirs.as_ref().is_none_or(|m| near(m.t, our_t))
    {
        return Explanation::Same;
    }
    let at_end = |t: f64| near(t, range) || t.abs() <= TIE_TOLERANCE;
    let tie = match (&ours, &theirs) {
        // A sensor on a surface is before or behind it, as its rounded pose has it.
        (Some(a), Some(b)) => near(a.t, our_t) && (near(b.t, our_t) || near(b.t, 0.0)),
        (Some(m), None) | (None, Some(m)) => at_end(m.t),
        (None, None) => false,
    };
    if tie {
        Explanation::Tie
    } else if graze(&ours) || graze(&theirs) {
        Explanation::Grazing
    } else {
        Explanation::Unexplained
    }
}

/// Explains a random sample of the reference's beams of `placements` in the frames with geometry.
///
/// # Errors
/// A sensor that cannot be placed.
pub(super) fn sample_reference(
    problem: &Problem,
    placements: &[Placement],
    sample: u64,
    seed: u64,
) -> Result<Agreement, BackendError> {
    let frames = problem.geometry_frame_count();
    if frames == 0 || placements.is_empty() {
        return Ok(Agreement::default());
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let picks: Vec<_> = (0..sample)
        .map(|_| {
            let placement = &placements[rng.random_range(0..placements.len())];
            let pose = placement.lidars[rng.random_range(0..placement.lidars.len())];
            let model = problem.sensors().number(&pose)?;
            let table = problem.sensors().table(model);
            let direction = table.directions()[rng.random_range(0..table.directions().len())];
            let frame = rng.random_range(0..frames);
            let number = problem.number_of(frame);
            let sensor = problem.sensors().ego_from_sensor(model, &pose, number);
            Ok((frame, sensor, direction, table.range()))
        })
        .collect::<Result<_, UnknownSensor>>()?;
    let explanations: Vec<Explanation> = picks
        .par_iter()
        .filter_map(|(frame, sensor, direction, range)| {
            let frame = problem.geometry(*frame)?;
            let hit = closest_hit_in(frame, sensor, *direction, *range);
            Some(explain_in(frame, sensor, *direction, *range, hit))
        })
        .collect();
    let count = |kind| explanations.iter().filter(|e| **e == kind).count() as u64;
    Ok(Agreement {
        beams: explanations.len() as u64,
        grazing: count(Explanation::Grazing),
        tie: count(Explanation::Tie),
        unexplained: count(Explanation::Unexplained),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::NO_HIT;
    use crate::geom::TriangleSoup;

    /// A unit square at x = 5 in two triangles, and one behind it at x = 6.
    fn bvh() -> Bvh {
        let mut soup = TriangleSoup::default();
        for x in [5.0, 6.0] {
            soup.append(&TriangleSoup {
                vertices: vec![[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 1.0, 1.0], [x, 0.0, 1.0]],
                faces: vec![[0, 1, 2], [0, 2, 3]],
                face_class: vec![0, 0],
            });
        }
        Bvh::build(&soup, 10.0)
    }

    #[test]
    fn each_difference_gets_its_explanation() {
        let bvh = bvh();
        let towards = |y: f32, z: f32, t: f32, prim: u32| {
            explain(&bvh, Vec3::new(0.0, y, z), Vec3::X, 10.0, Hit { t, prim })
        };
        assert_eq!(towards(0.7, 0.2, 5.0, 0), Explanation::Same);
        assert_eq!(towards(3.0, 0.2, 10.0, NO_HIT), Explanation::Same);
        // On the diagonal both triangles of the front square are equally far.
        assert_eq!(towards(0.5, 0.5, 5.0, 1), Explanation::Tie);
        // Beside the edge by a tenth of a millimetre.
        assert_eq!(towards(0.5, -1e-4, 5.0, 0), Explanation::Grazing);
        // A sensor on the front square, but for rounding, that looks at the one behind.
        let on_it = Cast {
            tree: &bvh,
            first_prim: 0,
            origin: DVec3::new(5.0 - 1e-14, 0.7, 0.2),
            direction: DVec3::X,
        };
        assert_eq!(explain_casts(&[on_it], 10.0, Hit { t: 1.0, prim: 2 }), Explanation::Tie);
        // Planted errors: the square behind, a miss, a hit that is none, a wrong distance.
        assert_eq!(towards(0.7, 0.2, 6.0, 2), Explanation::Unexplained);
        assert_eq!(towards(0.7, 0.2, 10.0, NO_HIT), Explanation::Unexplained);
        assert_eq!(towards(3.0, 0.2, 5.0, 0), Explanation::Unexplained);
        assert_eq!(towards(0.7, 0.2, 5.1, 0), Explanation::Unexplained);
    }
}
