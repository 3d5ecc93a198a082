//! The guard of placements of which a LiDAR looks at the own vehicle.

use crate::engine::{Backend, BackendError};
use crate::problem::{Problem, SensorBatch};
use crate::scene::{EgoBody, Scene};
use crate::score::{Guard, MOST_SELF_HITS};
use crate::vehicle::Placement;

/// Most placements for which scores include the guard by default: it takes casts of its own.
pub const FEW_PLACEMENTS: usize = 64;

/// Share of each LiDAR's beams that end at the own body in the first frame of a problem of the scene;
/// zeros where beams end at nothing. The body stands nearest and is the same in every frame, so that one
/// frame tells; of bodies that move the largest share of all frames counts.
///
/// # Errors
/// A sensor of a model that the vehicle does not have, or as [`Backend::hits`].
pub fn own_shares(
    scene: &Scene,
    problem: &Problem,
    engine: &mut dyn Backend,
    placement: &Placement,
) -> Result<Vec<f64>, BackendError> {
    let own = scene.triangles(EgoBody::Exclude);
    if !problem.ends_at_hits() || scene.triangles(EgoBody::Include) == own {
        return Ok(vec![0.0; placement.lidars.len()]);
    }
    let batch = SensorBatch::new(problem, &placement.lidars, None)?;
    let frames = match scene.has_moving_bodies() {
        true => problem.distinct_frames().into_iter().map(|(frame, _)| frame).collect(),
        false => vec![0],
    };
    let mut shares = vec![0.0_f64; batch.len()];
    for frame in frames {
        let hits = engine.hits(&placement.lidars, frame)?;
        for (lidar, share) in shares.iter_mut().enumerate() {
            let hits = &hits[batch.beams_of(lidar)];
            let own = hits.iter().filter(|hit| hit.is_hit() && hit.prim as usize >= own);
            *share = share.max(own.count() as f64 / hits.len() as f64);
        }
    }
    Ok(shares)
}

/// The guards of a placement's LiDARs that waste more than a quarter of their beams on the own vehicle.
///
/// Needs hits of its own: tallies count those of all LiDARs together, whatever is hit. So a search does
/// not know this guard; it is for placements that are reported.
///
/// # Errors
/// A device that fails, a sensor that the vehicle does not have.
pub fn self_hits(
    scene: &Scene,
    problem: &Problem,
    engine: &mut dyn Backend,
    placement: &Placement,
) -> Result<Vec<Guard>, BackendError> {
    let shares = own_shares(scene, problem, engine, placement)?;
    let much = shares.into_iter().enumerate().filter(|(_, share)| *share > MOST_SELF_HITS);
    Ok(much.map(|(lidar, share)| Guard::SelfHit { lidar, share }).collect())
}
