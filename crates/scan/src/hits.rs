//! Every beam of a batch of placements with its hit, as columns and as an `.npz` file.

use std::io::{Seek, Write};

use lidar_cast::bvh::Hit;
use lidar_cast::engine::OutOfMemory;
use lidar_cast::geom::TriangleSoup;
use lidar_cast::memory;
use sightline_scene::problem::{DevicePose, Problem, SensorBatch, beam_direction};
use sightline_scene::psog::write_npz;
use sightline_scene::vehicle::{Placement, SensorPose, UnknownSensor};

/// Beams that are cast in one batch: sensors that share directions are cast together.
const BEAMS_TOGETHER: usize = 16 << 20;

/// Name of the allocation in errors.
const BEAMS: &str = "hits of all beams cast at once";
/// Bytes of a beam in all columns.
const BEAM_BYTES: u64 = 40;

/// Columns of B beams, ordered by placement, LiDAR, channel, azimuth step; ego frame, metres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BeamHits {
    /// Origins in the ego frame, metres, `[B, 3]`.
    pub origin: Vec<f32>,
    /// Unit directions in the ego frame, `[B, 3]`.
    pub direction: Vec<f32>,
    /// Metres to the hit, infinite without one, `[B]`.
    pub distance: Vec<f32>,
    /// Triangle of the frame, [`NO_HIT`](lidar_cast::engine::NO_HIT) for none, `[B]`.
    pub triangle: Vec<u32>,
    /// Class of the triangle, 2¹⁶−1 for none, `[B]`.
    pub class: Vec<u16>,
    /// Position of the placement in the batch, `[B]`.
    pub placement: Vec<u32>,
    /// Position of the LiDAR in the placement, `[B]`.
    pub lidar: Vec<u16>,
}

impl BeamHits {
    /// Casts all beams of `placements` in the problem's first frame: `cast` returns the hits of the sensors in some poses, in order;
    /// `face_class` holds the class of each triangle.
    ///
    /// # Errors
    /// See `cast`, a sensor of a model that the vehicle does not have, and more beams than memory holds.
    pub fn of<E: From<UnknownSensor> + From<OutOfMemory>>(
        placements: &[Placement],
        problem: &Problem,
        face_class: &[u16],
        mut cast: impl FnMut(&[SensorPose]) -> Result<Vec<Hit>, E>,
    ) -> Result<Self, E> {
        let beams_of = |pose: &SensorPose| -> Result<usize, UnknownSensor> {
            Ok(problem.sensors().table(problem.sensors().number(pose)?).directions().len())
        };
        let mut all = 0;
        for pose in placements.iter().flat_map(|placement| &placement.lidars) {
            all += beams_of(pose)?;
        }
        let mut columns = Self::with_room(all)?;
        let beams = problem.sensors().most_beams();
        let sensors: Vec<(u32, u16, SensorPose)> = (0..)
            .zip(placements)
            .flat_map(|(p, placement)| {
                (0..).zip(&placement.lidars).map(move |(lidar, &pose)| (p, lidar, pose))
            })
            .collect();
        for sensors in sensors.chunks((BEAMS_TOGETHER / beams).max(1)) {
            let poses: Vec<SensorPose> = sensors.iter().map(|&(_, _, pose)| pose).collect();
            let hits = cast(&poses)?;
            let batch = SensorBatch::new(problem, &poses, None)?;
            let in_grid = batch.in_grid(&batch.ego_from_sensors(0));
            for (k, &(placement, lidar, _)) in sensors.iter().enumerate() {
                let (directions, hits) = (batch.table(k).directions(), &hits[batch.beams_of(k)]);
                columns.add(directions, &in_grid[k], hits, face_class);
                columns.placement.resize(columns.beams(), placement);
                columns.lidar.resize(columns.beams(), lidar);
            }
        }
        Ok(columns)
    }

    /// No beams yet, and memory for `beams` of them.
    fn with_room(beams: usize) -> Result<Self, OutOfMemory> {
        memory::check(BEAMS, beams as u64 * BEAM_BYTES)?;
        Ok(Self {
            origin: memory::room(3 * beams, BEAMS)?,
            direction: memory::room(3 * beams, BEAMS)?,
            distance: memory::room(beams, BEAMS)?,
            triangle: memory::room(beams, BEAMS)?,
            class: memory::room(beams, BEAMS)?,
            placement: memory::room(beams, BEAMS)?,
            lidar: memory::room(beams, BEAMS)?,
        })
    }

    /// Adds the beams of a sensor.
    fn add(
        &mut self,
        directions: &[[f32; 3]],
        pose: &DevicePose,
        hits: &[Hit],
        face_class: &[u16],
    ) {
        for (&direction, hit) in directions.iter().zip(hits) {
            self.origin.extend(pose.rows.map(|row| row[3]));
            self.direction.extend(beam_direction(pose, direction).to_array());
            self.distance.push(if hit.is_hit() { hit.t } else { f32::INFINITY });
            self.triangle.push(hit.prim);
            let class = if hit.is_hit() { face_class[hit.prim as usize] } else { u16::MAX };
            self.class.push(class);
        }
    }

    /// Beams B.
    pub fn beams(&self) -> usize {
        self.distance.len()
    }

    /// Beams that hit a surface within range.
    pub fn hits(&self) -> usize {
        self.distance.iter().filter(|t| t.is_finite()).count()
    }

    /// Positions of hits in the ego frame, each with the class of its surface.
    pub fn points(&self) -> impl Iterator<Item = (u16, [f32; 3])> {
        let beams = self.origin.chunks_exact(3).zip(self.direction.chunks_exact(3));
        let beams = beams.zip(self.distance.iter().zip(&self.class));
        let hits = beams.filter(|(_, (distance, _))| distance.is_finite());
        hits.map(|((origin, direction), (&distance, &class))| {
            (class, std::array::from_fn(|k| origin[k] + distance * direction[k]))
        })
    }

    /// Writes the columns and the triangles that were cast into as an `.npz` archive, uncompressed.
    ///
    /// | array | dtype, shape | holds |
    /// |---|---|---|
    /// | `origin`, `direction` | f32 \[B, 3\] | beams in the ego frame |
    /// | `distance` | f32 \[B\] | metres to the hit; inf: none within range |
    /// | `triangle` | u32 \[B\] | triangle hit; 2³²−1: none |
    /// | `class` | u16 \[B\] | class of the triangle; 2¹⁶−1: none |
    /// | `placement`, `lidar` | u32 \[B\], u16 \[B\] | positions in the batch and in the placement |
    /// | `vertices`, `faces`, `face_class` | f32 \[V, 3\], u32 \[F, 3\], u16 \[F\] | triangles of the frame |
    pub fn write(&self, out: impl Write + Seek, soup: &TriangleSoup) -> std::io::Result<()> {
        let beams = self.beams() as u64;
        write_npz(out, false, |npz| {
            npz.put("origin", &[beams, 3], &self.origin)?;
            npz.put("direction", &[beams, 3], &self.direction)?;
            npz.put("distance", &[beams], &self.distance)?;
            npz.put("triangle", &[beams], &self.triangle)?;
            npz.put("class", &[beams], &self.class)?;
            npz.put("placement", &[beams], &self.placement)?;
            npz.put("lidar", &[beams], &self.lidar)?;
            npz.put("vertices", &[soup.vertices.len() as u64, 3], soup.vertices.as_flattened())?;
            npz.put("faces", &[soup.faces.len() as u64, 3], soup.faces.as_flattened())?;
            npz.put("face_class", &[soup.face_class.len() as u64], &soup.face_class)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_beams_than_memory_holds_are_an_error() {
        let error = BeamHits::with_room(1 << 50).unwrap_err().to_string();
        assert_holds!(error, "hits of all beams cast at once", "fewer placements");
        assert_eq!(BeamHits::with_room(7).unwrap().beams(), 0);
    }
}
