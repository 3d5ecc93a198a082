//! P-SOGs from virtual scans of every frame of a scene.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::bundle::{Bundle, OUTSIDE};
use crate::bvh::Hit;
use crate::cast::{PACKET_RAYS, Packet, Scratch, Sight};
use crate::geom::Pose;
use crate::problem::{DevicePose, Frame, Instance, World};
use crate::psog::{BuildReport, FrameVotes, GridError, Psog, PsogBuilder, Roi};
use crate::scene::{EgoBody, ScanSettings, Scene};

/// Builds the P-SOG of a scene from dense virtual scans.
///
/// For each frame, a spinning scanner is put above the ego position of that frame and of its
/// neighbours along the route, and casts into the world as it is in that frame. The paper merges the
/// scans of several frames in world coordinates instead, which smears moving actors.
/// The ego body is left out, as data sets leave out the points on it. Every hit is a labelled point
/// and votes for its class in its voxel. Behind the grid no scan looks, so that only some of the
/// points outside are counted.
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
        bundles: bundles(&scan_rings(settings, roi)),
    };
    // No more at a time than threads: a frame's votes take memory.
    for frames in frames.chunks(rayon::current_num_threads()) {
        let votes = frames.par_iter().map(|&frame| scanner.scan(frame));
        for votes in votes.collect::<Vec<_>>() {
            builder.frame(votes)?;
            done();
        }
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
    bundles: Vec<Bundle>,
}

/// Where the scanner stands in a frame, and what it sees from there.
struct Stand<'a> {
    /// In the ego frame.
    pose: Pose,
    /// Instances in reach: poses that lead to their frames, and spheres around them.
    seen: Vec<(&'a Instance, Pose, Sight)>,
}

impl Scanner<'_> {
    /// The votes of one frame.
    fn scan(&self, frame: usize) -> FrameVotes {
        let ego_from_world = self.scene.ego_pose(frame).inverse();
        let mut votes = FrameVotes::new();
        for stand in stands(frame, self.scene.frame_count(), self.settings) {
            let ego_from_stand = ego_from_world.compose(&self.scene.ego_pose(stand));
            let head = DVec3::new(0.0, 0.0, self.settings.height);
            let pose = Pose { translation: ego_from_stand.apply(head), ..ego_from_stand };
            let stand = self.stand(&self.world.frames()[frame], pose);
            let parts = self.bundles.par_chunks(BUNDLES_PER_TASK).map(|bundles| {
                let mut scan = Scan::new(&bundles[0]);
                bundles.iter().for_each(|bundle| scan.cast(bundle, &stand, self));
                scan.votes
            });
            for part in parts.collect::<Vec<_>>() {
                votes.append(part);
            }
        }
        votes.sort();
        votes
    }

    fn stand<'f>(&self, frame: &'f Frame, pose: Pose) -> Stand<'f> {
        let range = self.settings.range as f32;
        let seen = frame.instances().iter().filter_map(|instance| {
            let to_instance = instance.pose_from(&pose);
            let sight = Sight::new(&DevicePose::from(&to_instance), &instance.tree, range)?;
            Some((instance, to_instance, sight))
        });
        let seen = seen.collect();
        Stand { pose, seen }
    }
}

/// Bundles of one parallel task.
const BUNDLES_PER_TASK: usize = 64;

/// Working memory of a task, and the voxels it has found.
struct Scan {
    /// The bundle in the ego frame, and in that of an instance.
    turned: [Bundle; 2],
    packet: Packet,
    scratch: Scratch,
    hits: [Hit; PACKET_RAYS],
    votes: FrameVotes,
}

impl Scan {
    fn new(bundle: &Bundle) -> Self {
        Self {
            turned: [bundle.clone(), bundle.clone()],
            packet: Packet::default(),
            scratch: Scratch::default(),
            hits: [Hit::none(0.0); PACKET_RAYS],
            votes: FrameVotes::new(),
        }
    }

    /// Casts a bundle into all instances in reach, each replacing the hits that it is closer to, and adds
    /// the votes.
    fn cast(&mut self, bundle: &Bundle, stand: &Stand<'_>, scanner: &Scanner<'_>) {
        let Self { turned: [ahead, turned], packet, scratch, hits, votes } = self;
        let (roi, origin) = (scanner.roi, stand.pose.translation);
        ahead.turn(bundle, &stand.pose.rotation);
        // Points behind the grid get no vote; the margin is many times the rounding.
        let reach = ahead.reach(origin, roi) * 1.0001 + 0.01;
        let range = scanner.settings.range as f32;
        let range = range.min(reach as f32);
        hits.fill(Hit::none(range));
        for (instance, pose, sight) in &stand.seen {
            if bundle.misses(sight) {
                continue;
            }
            turned.turn(bundle, &pose.rotation);
            turned.each_way(|part, lanes| {
                part.gather(pose.translation, range, packet);
                packet.set_hits(lanes.iter().map(|&lane| hits[lane]));
                instance.tree.closer_hits(packet, instance.first_prim, scratch);
                lanes.iter().zip(packet.hits()).for_each(|(&lane, hit)| hits[lane] = hit);
            });
        }
        let t = hits.map(|hit| f64::from(hit.t));
        let mut voxels = [OUTSIDE; PACKET_RAYS];
        ahead.voxels_of_hits(origin, &t, roi, &mut voxels);
        let hits = voxels.iter().zip(&*hits).take(bundle.len()).filter(|(_, hit)| hit.is_hit());
        votes.extend(hits.map(|(&voxel, hit)| {
            ((voxel != OUTSIDE).then_some(voxel.into()), scanner.classes[hit.prim as usize])
        }));
    }
}

/// Distance of neighbouring points of one scan pose in voxel edges, where nothing else is said. The
/// poses of a window fill each other's gaps: five leave two points in a voxel where they are rarest.
const SPACING: f64 = 1.5;

/// Rings and azimuth steps that a scan has at most, however large the ROI and small its voxels.
const MAX_STEPS: f64 = 16_384.0;

/// Rings of a bundle. Fewer lie nearer each other along the ring, more nearer across: eight leave the
/// fewest triangles to be tested.
const RINGS: usize = 8;

/// Cuts rings into patches of neighbours; the rays of a chunk lie side by side.
fn bundles(rings: &[Vec<DVec3>]) -> Vec<Bundle> {
    let steps = rings.first().map_or(0, Vec::len);
    let patches = rings.chunks(RINGS).flat_map(|band| {
        (0..steps).step_by(PACKET_RAYS / RINGS).map(move |first| {
            let steps = first..steps.min(first + PACKET_RAYS / RINGS);
            let rays = steps.flat_map(|step| band.iter().map(move |ring| ring[step]));
            Bundle::new(rays).with_cone()
        })
    });
    patches.collect()
}

/// Unit directions of the scanner, ring by ring, in the ego frame of where it stands.
fn scan_rings(settings: &ScanSettings, roi: &Roi) -> Vec<Vec<DVec3>> {
    let spacing = settings.spacing.unwrap_or(SPACING * roi.voxel()[0].max(roi.voxel()[1]));
    let reach = roi.min()[..2].iter().chain(&roi.max()[..2]).fold(0.0f64, |r, x| r.max(x.abs()));
    let step = (spacing / reach).max(TAU / MAX_STEPS);
    let elevations = match settings.channels {
        Some(channels) => even_elevations(channels, settings.fov),
        None => ring_elevations(settings, spacing, reach, step),
    };
    let azimuth_steps = settings.azimuth_steps.unwrap_or((TAU / step).ceil() as u32);
    elevations
        .into_iter()
        .map(|elevation| {
            let ring = (0..azimuth_steps).map(|j| {
                let turn = TAU * f64::from(j) / f64::from(azimuth_steps);
                Pose::new(DVec3::ZERO, 0.0, -elevation, turn).rotation * DVec3::X
            });
            ring.collect()
        })
        .collect()
}

fn even_elevations(channels: u32, fov: [f64; 2]) -> Vec<f64> {
    let [lower, upper] = fov.map(f64::to_radians);
    let between = f64::from(channels.max(2) - 1);
    (0..channels).map(|k| lower + f64::from(k) * (upper - lower) / between).collect()
}

/// Elevations whose rings on level ground lie `spacing` apart up to `reach`, then rise by `step`.
///
/// Evenly spaced channels leave gaps on far ground that no voxel of a usual size bridges: at 40 m and
/// from 2.8 m up, one degree is 10 m. A wall farther away than the scanner is high is met at least as
/// densely as the ground.
fn ring_elevations(settings: &ScanSettings, spacing: f64, reach: f64, step: f64) -> Vec<f64> {
    let [lower, upper] = settings.fov.map(f64::to_radians);
    let spacing = spacing.max(reach / MAX_STEPS);
    let mut elevations = vec![lower];
    let mut last = lower;
    while last + step < upper {
        // Where the ring of `last` lies on the ground; endless from the horizon upwards.
        let radius = if last < 0.0 { settings.height / (-last).tan() } else { f64::INFINITY };
        let on_ground = -(settings.height / (radius + spacing)).atan();
        last = if radius < reach && on_ground > last { on_ground } else { last + step };
        elevations.push(last);
    }
    elevations
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
                for direction in scan_rings(settings, &roi).concat() {
                    let mut hit = Hit::none(settings.range as f32);
                    for instance in world.frames()[frame].instances() {
                        let pose = instance.pose_from(&pose);
                        let there = pose.rotation * direction;
                        let ray = Ray::new(pose.translation.as_vec3(), there.as_vec3(), hit.t);
                        instance.tree.closer_hit(&ray, instance.first_prim, &mut hit);
                    }
                    if hit.is_hit() {
                        let point = origin + pose.rotation * direction * f64::from(hit.t);
                        let class = classes[hit.prim as usize];
                        votes.push(roi.voxel_of_hit(origin, point), class);
                    }
                }
            }
            builder.frame(votes).unwrap();
        }
        let (one_by_one, seen) = builder.finish().unwrap();
        assert_eq!(psog, one_by_one);
        assert_eq!((report.points_in, report.ties), (seen.points_in, seen.ties));
        assert!(report.points_outside < seen.points_outside, "looked behind the grid");
        assert!(psog.index().len() > 300, "{} voxels", psog.index().len());
    }

    #[test]
    fn points_closer_than_voxels_leave_none_of_the_ground_out() {
        let roi = Roi::new([-20.0, -20.0, -0.5], [0.2; 3], [200, 200, 30]).unwrap();
        let mut met = vec![false; 200 * 200];
        let settings = ScanSettings { spacing: Some(0.14), ..settings() };
        for direction in scan_rings(&settings, &roi).iter().flatten().filter(|d| d.z < 0.0) {
            let on_ground = *direction * (2.8 / -direction.z);
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
        assert!(scan_rings(&fine, &roi).concat().len() < 3 * MAX_STEPS as usize);
        let below = ScanSettings { height: -1.0, azimuth_steps: Some(1), ..settings() };
        let flat = Roi::new([-10.0, -10.0, -1.0], [0.5; 3], [40, 40, 4]).unwrap();
        assert_eq!(
            scan_rings(&below, &flat).concat().len(),
            17,
            "steps of 0.075 rad over 70 degrees"
        );
    }
}
