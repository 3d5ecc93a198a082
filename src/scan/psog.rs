//! P-SOGs from virtual scans of every frame of a scene.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use multiversion::multiversion;
use rayon::prelude::*;

use crate::bvh::Hit;
use crate::cast::{Caster, Part};
use crate::geom::Pose;
use crate::problem::{Instance, World};
use crate::psog::{BuildReport, FrameVotes, GridError, PUSH, Psog, PsogBuilder, Roi};
use crate::scene::{EgoBody, ScanSettings, Scene};
use crate::vehicle::{BeamTable, SensorError};

/// Frames that are scanned together: neighbours share the scans of what does not move.
const FRAMES_TOGETHER: usize = 32;
/// Beams of a band of rings, whose hits are held for every stand of the frames together.
const BAND_BEAMS: usize = 1 << 17;
/// Beams whose voxels are looked up at once.
const LANES: usize = 32;
/// No voxel: no grid has as many, see [`crate::psog::VOXEL_LIMIT`].
const OUTSIDE: u32 = u32::MAX;

/// Builds the P-SOG of a scene from dense virtual scans.
///
/// For each frame, a spinning scanner is put above the ego position of that frame and of its
/// neighbours along the route, and casts into the world as it is in that frame. The paper merges the
/// scans of several frames in world coordinates instead, which smears moving actors.
/// The ego body is left out, as data sets leave out the points on it. Every hit is a labelled point
/// and votes for its class in its voxel.
///
/// What does not move is cast once for each place where the scanner stands, and actors are cast on top of
/// that for each frame.
///
/// `done` is called after each frame.
///
/// # Errors
/// More frames or voxels than a P-SOG holds; trees that do not fit into memory.
pub fn scan_scene(
    scene: &Scene,
    roi: &Roi,
    settings: &ScanSettings,
    done: impl Fn(),
) -> Result<(Psog, BuildReport), GridError> {
    let mut builder = PsogBuilder::new(*roi, scene.classes().to_vec())?;
    let frames: Vec<usize> = (0..scene.frame_count()).collect();
    let scanner = Scanner {
        scene,
        world: World::of(scene, &frames, settings.range as f32, EgoBody::Exclude)?,
        classes: scene.face_classes(EgoBody::Exclude),
        roi,
        settings,
        rings: Rings::new(settings, roi),
    };
    for frames in frames.chunks(FRAMES_TOGETHER) {
        builder.frames(scanner.scan(frames))?;
        frames.iter().for_each(|_| done());
    }
    builder.finish()
}

/// All that the frames of a scan share.
struct Scanner<'a> {
    scene: &'a Scene,
    world: World,
    /// By triangle.
    classes: Vec<u16>,
    roi: &'a Roi,
    settings: &'a ScanSettings,
    rings: Rings,
}

/// Some rings of the scanner.
struct Band {
    table: BeamTable,
    caster: Caster,
}

impl Scanner<'_> {
    /// The votes of some frames.
    fn scan(&self, frames: &[usize]) -> Vec<FrameVotes> {
        let mut stands: Vec<usize> = frames.iter().flat_map(|&frame| self.stands(frame)).collect();
        stands.sort_unstable();
        stands.dedup();
        let mut votes = vec![FrameVotes::new(); frames.len()];
        for rings in self.rings.bands() {
            // A range that is no number is refused where settings are read, and every band has beams.
            let Ok(table) = table(rings, self.settings.range) else { continue };
            let band = Band { caster: Caster::new(&table), table };
            let fixed: Vec<Vec<Hit>> =
                stands.par_iter().map(|&stand| self.fixed_hits(&band, stand)).collect();
            votes.par_iter_mut().zip(frames).for_each(|(votes, &frame)| {
                let (mut hits, mut voxels) = (Vec::new(), Vec::new());
                for stand in self.stands(frame) {
                    let Ok(place) = stands.binary_search(&stand) else { continue };
                    hits.clone_from(&fixed[place]);
                    self.vote(&band, frame, stand, &mut hits, &mut voxels, votes);
                }
            });
        }
        votes
    }

    /// The static world, which is the first instance of every frame if it has a triangle, and actors.
    fn instances(&self, frame: usize) -> (&[Instance], &[Instance]) {
        let fixed = usize::from(self.scene.part_triangles(0) > 0);
        self.world.frames()[frame].instances().split_at(fixed)
    }

    /// Takes the scanner's frame to that of the ego, where the scanner stands above it.
    fn head(&self) -> Pose {
        let translation = DVec3::new(0.0, 0.0, self.settings.height);
        Pose { rotation: DMat3::IDENTITY, translation }
    }

    /// Hits of a band's beams from a stand in the static world.
    fn fixed_hits(&self, band: &Band, stand: usize) -> Vec<Hit> {
        let beams = band.table.directions().len();
        let mut hits = vec![Hit::none(self.settings.range as f32); beams];
        let (fixed, _) = self.instances(stand);
        band.caster.closer_hits(&parts(fixed, &self.head()), &mut hits);
        hits
    }

    /// Casts into the actors of a frame, on top of the hits in the static world, and adds the votes.
    fn vote(
        &self,
        band: &Band,
        frame: usize,
        stand: usize,
        hits: &mut [Hit],
        voxels: &mut Vec<u32>,
        votes: &mut FrameVotes,
    ) {
        let ego_from_world = self.scene.ego_pose(frame).inverse();
        let pose = ego_from_world.compose(&self.scene.ego_pose(stand)).compose(&self.head());
        let (_, actors) = self.instances(frame);
        band.caster.closer_hits(&parts(actors, &pose), hits);
        voxels.resize(hits.len(), OUTSIDE);
        voxels_of_hits(&pose, band.table.directions(), hits, self.roi, voxels);
        let found = voxels.iter().zip(&*hits).filter(|(_, hit)| hit.is_hit());
        votes.extend(found.map(|(&voxel, hit)| {
            ((voxel != OUTSIDE).then_some(voxel.into()), self.classes[hit.prim as usize])
        }));
    }

    /// Frames at whose ego poses the scanner stands for a frame.
    fn stands(&self, frame: usize) -> Vec<usize> {
        stands(frame, self.scene.frame_count(), self.settings)
    }
}

/// Trees with the poses that lead to them; `pose` takes the scanner's frame to that of the ego.
fn parts<'a>(instances: &'a [Instance], pose: &Pose) -> Vec<Part<'a>> {
    let part = |instance: &'a Instance| Part {
        bvh: &instance.tree,
        pose: instance.pose_of(pose),
        first_prim: instance.first_prim,
    };
    instances.iter().map(part).collect()
}

/// The voxel of each hit, [`PUSH`] behind it along its beam as [`Roi::voxel_of_hit`] has it; [`OUTSIDE`]
/// where there is none.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn voxels_of_hits(
    pose: &Pose,
    directions: &[[f32; 3]],
    hits: &[Hit],
    roi: &Roi,
    voxels: &mut [u32],
) {
    let rows = [0, 1, 2].map(|axis| pose.rotation.row(axis).to_array());
    let origin = pose.translation.to_array();
    let beams = directions.chunks(LANES).zip(hits.chunks(LANES));
    for (voxels, (directions, hits)) in voxels.chunks_mut(LANES).zip(beams) {
        let mut points = [[f64::INFINITY; LANES]; 3];
        for lane in 0..directions.len().min(hits.len()) {
            let [x, y, z] = directions[lane].map(f64::from);
            let t = f64::from(hits[lane].t) + PUSH;
            for axis in 0..3 {
                let [a, b, c] = rows[axis];
                points[axis][lane] = origin[axis] + (a * x + b * y + c * z) * t;
            }
        }
        let mut found = [OUTSIDE; LANES];
        roi.voxels_of(&points, &mut found);
        voxels.copy_from_slice(&found[..voxels.len()]);
    }
}

/// Distance of neighbouring points of one scan pose in voxel edges, where nothing else is said. The
/// poses of a window fill each other's gaps: five leave nine points in a face of a voxel where they are
/// rarest.
const SPACING: f64 = 0.75;

/// Rings and azimuth steps that a scan has at most, however large the ROI and small its voxels.
const MAX_STEPS: f64 = 16_384.0;

/// Directions of the scanner: rings of one elevation each, from the lowest on.
struct Rings(Vec<Ring>);

/// A turn of the scanner.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ring {
    /// Radians.
    elevation: f64,
    azimuth_steps: u32,
}

impl Rings {
    fn new(settings: &ScanSettings, roi: &Roi) -> Self {
        let spacing = settings.spacing.unwrap_or(SPACING * roi.voxel()[0].max(roi.voxel()[1]));
        let reach =
            roi.min()[..2].iter().chain(&roi.max()[..2]).fold(0.0f64, |r, x| r.max(x.abs()));
        let view = View { height: settings.height, top: roi.max()[2], reach };
        let step = (spacing / reach).max(TAU / MAX_STEPS);
        let all_around = (TAU / step).ceil();
        let ring = |(elevation, extent): (f64, f64)| {
            // In quarters of an octave, so that rings side by side go into one table.
            let quarters = (4.0 * (reach / extent).log2()).floor().clamp(0.0, 32.0);
            let spaced = (all_around * (-quarters / 4.0).exp2()).ceil() as u32;
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

    /// Rings of as many steps side by side, of about [`BAND_BEAMS`] beams in all.
    fn bands(&self) -> impl Iterator<Item = &[Ring]> {
        let alike = self.0.chunk_by(|a, b| a.azimuth_steps == b.azimuth_steps);
        alike.flat_map(|rings| rings.chunks((BAND_BEAMS / rings[0].azimuth_steps as usize).max(1)))
    }
}

/// The beams of some rings of as many steps, in the frame of the scanner.
fn table(rings: &[Ring], range: f64) -> Result<BeamTable, SensorError> {
    let channels: Vec<_> = rings.iter().map(|ring| (ring.elevation.to_degrees(), 0.0)).collect();
    BeamTable::spinning(&channels, rings.first().map_or(0, |ring| ring.azimuth_steps), range)
}

/// What a scanner looks at: level ground `height` below it, up to `top` above that ground and `reach`
/// away, in metres.
struct View {
    height: f64,
    top: f64,
    reach: f64,
}

impl View {
    /// How far away a beam of this elevation is between the ground and the top, at most `reach`.
    fn extent(&self, elevation: f64) -> f64 {
        let drop = if elevation < 0.0 { self.height } else { self.height - self.top };
        let extent = drop / (-elevation).tan();
        if extent > 0.0 { extent.min(self.reach) } else { self.reach }
    }

    /// Elevations whose rings lie `spacing` apart on the ground, and on what stands there: each with its
    /// extent, rising, no two farther apart than `step` at the horizon.
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
            let radius = if next < 0.0 { self.height / (-next).tan() } else { f64::INFINITY };
            let on_ground = -(self.height / (radius + spacing)).atan();
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

/// Frames at whose ego poses the scanner stands: the frame itself and as many before as after it,
/// `stride` frames apart, as far as the route goes.
fn stands(frame: usize, frames: usize, settings: &ScanSettings) -> Vec<usize> {
    let half = i64::from(settings.window / 2);
    let steps = -half..i64::from(settings.window) - half;
    steps
        .map(|k| frame as i64 + k * i64::from(settings.stride))
        .filter(|stand| (0..frames as i64).contains(stand))
        .map(|stand| stand as usize)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Ray;
    use crate::problem::{beam_direction, beam_origin};
    use crate::scene::PsogSource;

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

    fn directions(settings: &ScanSettings, roi: &Roi) -> Vec<[f32; 3]> {
        let rings = Rings::new(settings, roi);
        let tables = rings.bands().map(|rings| table(rings, settings.range).unwrap());
        tables.flat_map(|table| table.directions().to_vec()).collect()
    }

    /// The ego turns and tilts, stands outside the grid at last, and walls stand behind the grid.
    #[test]
    fn the_grid_is_that_of_rays_cast_one_by_one() {
        let text = r#"{
            "sightline": 1, "name": "turning", "coverage": "first-hit", "frames": 4,
            "roi": { "min": [-4, -3, 0], "max": [4, 3, 3], "voxel": [0.5, 0.5, 0.5] },
            "psog": { "scan": { "window": 3, "spacing": 0.4, "range": 9 } },
            "lidar": { "channels": 8, "fov": [-30, 10], "azimuth_steps": 60, "range": 20 },
            "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 2 },
            "ego": { "poses": [{ "x": 0, "y": 0 }, { "x": 0.5, "y": 0.2, "yaw": 0.3, "pitch": 0.1 },
                               { "x": 1, "y": 0.7, "yaw": 0.8, "roll": -0.1 }, { "x": 7, "y": 2, "yaw": 1.2 }] },
            "static": [
                { "class": "ground", "plane": { "min": [-12, -12], "max": [12, 12], "z": 0.1 } },
                { "class": "pole", "cylinder": { "foot": [2, 1, 0], "radius": 0.3, "height": 2, "sides": 7 } },
                { "class": "wall", "box": { "center": [3.9, 0, 1.5], "size": [0.2, 6, 3] } },
                { "class": "building", "box": { "center": [-5, 3.3, 1.5], "size": [0.2, 6, 3] } }]
        }"#;
        let scene = Scene::from_json(text, std::path::Path::new(""), "turning.json").unwrap();
        let roi = Roi::new([-4.0, -3.0, 0.0], [0.5; 3], [16, 12, 6]).unwrap();
        let PsogSource::Scan(settings) = scene.psog_source() else { panic!("a scan") };
        let (psog, report) = scan_scene(&scene, &roi, settings, || ()).unwrap();

        let mut builder = PsogBuilder::new(roi, scene.classes().to_vec()).unwrap();
        let frames = [0, 1, 2, 3];
        let world = World::of(&scene, &frames, settings.range as f32, EgoBody::Exclude).unwrap();
        let classes = scene.face_classes(EgoBody::Exclude);
        for frame in frames {
            let mut votes = FrameVotes::new();
            for stand in stands(frame, 4, settings) {
                let pose = scene.ego_pose(frame).inverse().compose(&scene.ego_pose(stand));
                let origin = pose.apply(DVec3::new(0.0, 0.0, settings.height));
                let pose = Pose { translation: origin, ..pose };
                for direction in &directions(settings, &roi) {
                    let mut hit = Hit::none(settings.range as f32);
                    for instance in world.frames()[frame].instances() {
                        let pose = instance.pose_of(&pose);
                        let there = beam_direction(&pose, *direction);
                        let ray = Ray::new(beam_origin(&pose), there, hit.t);
                        instance.tree.closer_hit(&ray, instance.first_prim, &mut hit);
                    }
                    if hit.is_hit() {
                        let direction = pose.rotation * DVec3::from(direction.map(f64::from));
                        let point = origin + direction * f64::from(hit.t);
                        let class = classes[hit.prim as usize];
                        votes.push(roi.voxel_of_hit(origin, point), class);
                    }
                }
            }
            builder.frame(votes).unwrap();
        }
        let (one_by_one, seen) = builder.finish().unwrap();
        assert_eq!(psog, one_by_one);
        assert_eq!(report, seen);
        assert!(psog.index().len() > 300, "{} voxels", psog.index().len());
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
