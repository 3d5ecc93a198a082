//! P-SOGs from virtual scans of every frame of a scene.

use glam::{DMat3, DVec3};
use multiversion::multiversion;
use rayon::prelude::*;

use super::rings::{Rings, table};
use lidar_cast::bvh::Hit;
use lidar_cast::cast::{Caster, TreeView};
use lidar_cast::geom::Pose;
use lidar_cast::grid::HIT_PUSH;
use sightline_scene::problem::{Instance, World, world_of};
use sightline_scene::psog::{BuildReport, FrameVotes, Psog, PsogBuilder, PsogError, Roi};
use sightline_scene::scene::{EgoBody, ScanSettings, Scene};
use sightline_scene::vehicle::BeamTable;

/// Frames that are scanned together: they share the scans of static geometry.
const FRAMES_TOGETHER: usize = 32;
/// Beams whose voxels are looked up at once.
const LANES: usize = 32;
/// No voxel: no grid has as many.
const OUTSIDE: u32 = u32::MAX;

/// Most beams of the scans of a frame whose spacing is given: minutes on a core.
const MOST_BEAMS: u64 = 100_000_000;

/// Builds the P-SOG of a scene from dense virtual scans.
///
/// For each frame, a spinning scanner is put above the ego position of that frame and of its
/// neighbours along the route, and casts into the world as it is in that frame. The paper merges the
/// scans of several frames in world coordinates instead, which smears moving actors.
/// The ego body is left out, as data sets leave out the points on it. Every hit is a labelled point
/// and votes for its class in its voxel.
///
/// Static geometry is cast once for each scanner position. Actors are cast on top of it for each frame.
///
/// `go_on` is asked before each band of rings of the frames that are scanned together, and after the last, with
/// the number of frames that are done. A no ends the scan, unless all frames are done.
///
/// # Errors
/// More beams, frames or voxels than a P-SOG holds; trees that do not fit into memory; [`PsogError::Stopped`] after a no.
pub fn scan_scene(
    scene: &Scene,
    roi: &Roi,
    settings: &ScanSettings,
    go_on: impl Fn(usize) -> bool,
) -> Result<(Psog, BuildReport), PsogError> {
    let mut builder = PsogBuilder::new(*roi, scene.classes().to_vec())?;
    let rings = Rings::new(settings, roi);
    let beams = rings.beams() * u64::from(settings.window);
    if let Some(spacing) = settings.spacing.filter(|_| beams > MOST_BEAMS) {
        return Err(PsogError::Refused(format!(
            "psog.scan.spacing: {spacing} m makes {beams} beams in each frame, at most {MOST_BEAMS} may be cast; give a wider \
             one, or leave it out"
        )));
    }
    let frames: Vec<usize> = (0..scene.frame_count()).collect();
    let scanner = VirtualScanner {
        scene,
        world: world_of(scene, &frames, settings.range as f32, EgoBody::Exclude)?,
        classes: scene.face_classes(EgoBody::Exclude),
        roi,
        settings,
        rings,
    };
    for (group, together) in frames.chunks(FRAMES_TOGETHER).enumerate() {
        let done = group * FRAMES_TOGETHER;
        let Some(votes) = scanner.scan(together, || go_on(done)) else {
            return Err(PsogError::Stopped { done, frames: frames.len() });
        };
        builder.frames(votes)?;
    }
    go_on(frames.len());
    builder.finish()
}

/// All that the frames of a scan share.
struct VirtualScanner<'a> {
    scene: &'a Scene,
    world: World,
    /// Class of each triangle.
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

impl VirtualScanner<'_> {
    /// The votes of some frames; `None` once `go_on`, which is asked before each band of rings, says no.
    fn scan(&self, frames: &[usize], go_on: impl Fn() -> bool) -> Option<Vec<FrameVotes>> {
        let of_frame = |&frame: &usize| stands(frame, self.scene.frame_count(), self.settings);
        let mut stands: Vec<usize> = frames.iter().flat_map(of_frame).collect();
        stands.sort_unstable();
        stands.dedup();
        let mut votes = vec![FrameVotes::new(); frames.len()];
        for rings in self.rings.bands() {
            if !go_on() {
                return None;
            }
            // A range that is no number is refused where settings are read, and every band has beams.
            let Ok(table) = table(rings, self.settings.range) else { continue };
            let band = Band { caster: Caster::new(&table), table };
            let fixed: Vec<Vec<Hit>> =
                stands.par_iter().map(|&stand| self.fixed_hits(&band, stand)).collect();
            votes.par_iter_mut().zip(frames).for_each(|(votes, frame)| {
                let (mut hits, mut voxels) = (Vec::new(), Vec::new());
                for stand in of_frame(frame) {
                    let Ok(place) = stands.binary_search(&stand) else { continue };
                    hits.clone_from(&fixed[place]);
                    self.vote(&band, *frame, stand, &mut hits, &mut voxels, votes);
                }
            });
        }
        Some(votes)
    }

    /// The static world, which is the first instance of every frame if it has a triangle, and actors.
    fn instances(&self, frame: usize) -> (&[Instance], &[Instance]) {
        let fixed = usize::from(self.scene.part_triangles(0) > 0);
        self.world.frames()[frame].instances().split_at(fixed)
    }

    /// Scanner pose in the ego frame of its stand: `height` metres above the origin.
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
}

/// Trees with their sensor poses; `pose` takes the scanner's frame to the ego's.
fn parts<'a>(instances: &'a [Instance], pose: &Pose) -> Vec<TreeView<'a>> {
    let part = |instance: &'a Instance| TreeView {
        bvh: &instance.tree,
        pose: instance.pose_of(pose),
        first_prim: instance.first_prim,
    };
    instances.iter().map(part).collect()
}

/// The voxel of each hit, [`HIT_PUSH`] behind it along its beam as [`Roi::voxel_of_hit`] has it; [`OUTSIDE`]
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
            let t = f64::from(hits[lane].t) + HIT_PUSH;
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
    use std::cell::RefCell;

    use super::super::rings::tests::directions;
    use super::*;
    use lidar_cast::bvh::Ray;
    use sightline_scene::problem::{beam_direction, beam_origin};
    use sightline_scene::scene::PsogSource;

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
                { "class": "building", "box": { "center": [-5, 3.3, 1.5], "size": [0.2, 6, 3] } }],
            "actors": [{ "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.1], "size": [2, 1, 1] } }],
                         "route": { "points": [[-3, -2], [3, 1]], "spacing": 1.5 } }]
        }"#;
        let scene = Scene::from_json(text, std::path::Path::new(""), "turning.json").unwrap();
        let roi = Roi::new([-4.0, -3.0, 0.0], [0.5; 3], [16, 12, 6]).unwrap();
        let PsogSource::Scan(settings) = scene.psog_source() else { panic!("a scan") };
        let (psog, report) = scan_scene(&scene, &roi, settings, |_| true).unwrap();

        let mut builder = PsogBuilder::new(roi, scene.classes().to_vec()).unwrap();
        let frames = [0, 1, 2, 3];
        let world = world_of(&scene, &frames, settings.range as f32, EgoBody::Exclude).unwrap();
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
                        votes.extend([(roi.voxel_of_hit(origin, point), class)]);
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
    fn a_scan_that_is_told_to_stop_begins_no_band_more() {
        let text = r#"{
            "sightline": 1, "name": "long", "coverage": "first-hit", "frames": 70,
            "roi": { "min": [-4, -3, 0], "max": [4, 3, 3], "voxel": [0.5, 0.5, 0.5] },
            "lidar": { "channels": 8, "fov": [-30, 10], "azimuth_steps": 60, "range": 20 },
            "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 2 },
            "ego": { "route": { "points": [[0, 0], [60, 0]], "spacing": 0.5 } },
            "static": [{ "class": "ground", "plane": { "min": [-12, -12], "max": [72, 12], "z": 0 } }]
        }"#;
        let scene = Scene::from_json(text, std::path::Path::new(""), "long.json").unwrap();
        let roi = Roi::new([-4.0, -3.0, 0.0], [0.5; 3], [16, 12, 6]).unwrap();
        let PsogSource::Scan(settings) = scene.psog_source() else { panic!("a scan") };
        let asked = RefCell::new(Vec::new());
        let scan = |last: usize| {
            asked.borrow_mut().clear();
            let go_on = |done| {
                asked.borrow_mut().push(done);
                asked.borrow().len() < last
            };
            scan_scene(&scene, &roi, settings, go_on)
        };
        let (whole, _) = scan(usize::MAX).unwrap();
        let questions = asked.borrow().clone();
        // Each group of frames asks equally often, and the end once.
        let bands = questions.iter().filter(|&&done| done == 0).count();
        assert!(bands > 1, "{questions:?}");
        let of = |done| vec![done; bands];
        assert_eq!(questions, [of(0), of(32), of(64), vec![70]].concat());
        for last in [1, bands, bands + 2, 3 * bands] {
            let done = questions[last - 1];
            let Err(PsogError::Stopped { done: kept, frames: 70 }) = scan(last) else {
                panic!("not stopped at question {last}");
            };
            assert_eq!((kept, &asked.borrow()[..]), (done, &questions[..last]));
        }
        // A no after the last frame comes too late.
        assert_eq!(scan(questions.len()).unwrap().0, whole);
    }
}
