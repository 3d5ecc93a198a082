//! Ends of the beams of each LiDAR, by frame.

use crate::engine::{Backend, BackendError};
use crate::problem::{Problem, SensorBatch};
use crate::vehicle::Placement;

/// Most beams of a LiDAR drawn on a page, over its scenes; of more, every second, third and so on is drawn.
const BEAMS: usize = 1200;

/// Ends of beams in the ego frame, metres; beams that hit nothing are left out where beams end at hits.
#[derive(Debug, Clone, PartialEq)]
pub struct BeamEnds {
    /// `[frames][lidars]`.
    pub ends: Vec<Vec<Vec<[f32; 3]>>>,
    /// Largest step over the LiDARs: one in `every` beams is drawn.
    pub every: usize,
    /// Upper bound on the coordinates of all ends.
    pub reach: f32,
}

impl BeamEnds {
    /// The beams of a placement in some frames of a scene, on a page with `scenes` scenes.
    pub fn new(
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
        frames: &[usize],
        scenes: usize,
    ) -> Result<Self, BackendError> {
        let batch = SensorBatch::new(problem, &placement.lidars, None)?;
        let far = placement
            .lidars
            .iter()
            .flat_map(|l| [l.x, l.y, l.z])
            .fold(0.0, |m: f64, v| m.max(v.abs()));
        let mut beams = Self { ends: vec![], every: 1, reach: problem.far_range() + far as f32 };
        for &frame in frames {
            let hits = match problem.geometry(frame) {
                Some(_) => Some(engine.hits(&placement.lidars, frame)?),
                None => None,
            };
            let mut of_frame = Vec::new();
            for (lidar, pose) in batch.ego_from_sensors(frame).iter().enumerate() {
                let directions = batch.table(lidar).directions();
                let every = directions.len().div_ceil(BEAMS.div_ceil(scenes)).max(1);
                beams.every = beams.every.max(every);
                let own = hits.as_ref().map(|hits| &hits[batch.beams_of(lidar)]);
                let end = |beam: usize| {
                    let hit = own.map(|hits| hits[beam]).filter(|hit| hit.is_hit());
                    let missed = (!problem.ends_at_hits()).then(|| batch.range(lidar));
                    let along = glam::DVec3::from(directions[beam].map(f64::from));
                    let t = if problem.ends_at_hits() { hit.map(|hit| hit.t) } else { missed }?;
                    Some(pose.apply(along * f64::from(t)).as_vec3().to_array())
                };
                of_frame.push((0..directions.len()).step_by(every).filter_map(end).collect());
            }
            beams.ends.push(of_frame);
        }
        Ok(beams)
    }
}
