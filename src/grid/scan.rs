use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{BuildReport, FrameVotes, GridError, Psog, PsogBuilder, Roi};
use crate::bvh::{Bvh, Hit, Packet, Scratch, major_axis};
use crate::geom::Pose;
use crate::scene::{EgoBody, ScanSettings, Scene};

/// Builds the P-SOG of a scene from dense virtual scans.
///
/// For each frame, a spinning scanner is put above the ego position of that frame and of its
/// neighbours along the route, and casts into the world as it is in that frame: what the paper
/// reaches by merging the scans of several frames in world coordinates, without smearing what moves.
/// The ego body is left out, as data sets leave out the points on it. Every hit is a labelled point
/// and votes for its class in its voxel.
///
/// `done` is called after each frame.
///
/// # Errors
/// More frames or voxels than a P-SOG holds.
pub fn scan_scene(
    scene: &Scene,
    roi: &Roi,
    settings: &ScanSettings,
    done: impl Fn(),
) -> Result<(Psog, BuildReport), GridError> {
    let mut builder = PsogBuilder::new(*roi, scene.classes().to_vec())?;
    let directions = scan_directions(settings, roi);
    let frames = scene.frame_count();
    for frame in 0..frames {
        let soup = scene.frame(frame, EgoBody::Exclude);
        let bvh = Bvh::build(&soup, settings.range as f32);
        let ego_from_world = scene.ego_pose(frame).inverse();
        let mut votes = FrameVotes::new();
        for stand in stands(frame, frames, settings) {
            let ego_from_stand = ego_from_world.compose(&scene.ego_pose(stand));
            let above = DVec3::new(0.0, 0.0, settings.height);
            let origin = ego_from_stand.apply(above);
            let turned = directions.par_chunks(RAYS_PER_TASK).flat_map_iter(|directions| {
                let turned: Vec<DVec3> =
                    directions.iter().map(|&d| ego_from_stand.rotation * d).collect();
                let hits = cast(&bvh, origin, &turned, settings.range as f32);
                turned.into_iter().zip(hits)
            });
            votes.par_extend(turned.filter_map(|(direction, hit)| {
                hit.is_hit().then(|| {
                    let point = origin + direction * f64::from(hit.t);
                    (roi.voxel_of_hit(origin, point), soup.face_class[hit.prim as usize])
                })
            }));
        }
        builder.frame(votes)?;
        done();
    }
    builder.finish()
}

/// Rays of one parallel task.
const RAYS_PER_TASK: usize = 4096;
/// Rays that are cast together; neighbours of a ring go roughly the same way.
const RAYS_PER_PACKET: usize = 32;

/// Closest hits of rays from one origin, in order.
fn cast(bvh: &Bvh, origin: DVec3, directions: &[DVec3], range: f32) -> Vec<Hit> {
    let origin = origin.as_vec3();
    let rays: Vec<(Vec3, Vec3)> = directions.iter().map(|d| (origin, d.as_vec3())).collect();
    // What the rays of a fast packet have in common.
    let way =
        |direction: Vec3| (major_axis(direction), direction.signum().to_array().map(f32::to_bits));
    let mut packet = Packet::default();
    let mut scratch = Scratch::default();
    let mut hits = Vec::with_capacity(rays.len());
    for same_way in rays.chunk_by(|a, b| way(a.1) == way(b.1)) {
        for rays in same_way.chunks(RAYS_PER_PACKET) {
            packet.gather(rays.len(), range, |lane| rays[lane]);
            bvh.closest_hits(&mut packet, &mut scratch);
            hits.extend(packet.hits());
        }
    }
    hits
}

/// Distance of neighbouring points of one scan pose in voxel edges, where nothing else is said. The
/// poses of a window fill each other's gaps: five leave two points in a voxel where they are rarest.
const SPACING: f64 = 1.5;

/// Rings and azimuth steps that a scan has at most, however large the ROI and small its voxels.
const MAX_STEPS: f64 = 16_384.0;

/// Unit directions of the scanner, in the ego frame of where it stands.
fn scan_directions(settings: &ScanSettings, roi: &Roi) -> Vec<DVec3> {
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
        .flat_map(|elevation| {
            (0..azimuth_steps).map(move |j| {
                let turn = TAU * f64::from(j) / f64::from(azimuth_steps);
                Pose::new(DVec3::ZERO, 0.0, -elevation, turn).rotation * DVec3::X
            })
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

    #[test]
    fn points_closer_than_voxels_leave_none_of_the_ground_out() {
        let roi = Roi::new([-20.0, -20.0, -0.5], [0.2; 3], [200, 200, 30]).unwrap();
        let mut met = vec![false; 200 * 200];
        let settings = ScanSettings { spacing: Some(0.14), ..settings() };
        for direction in scan_directions(&settings, &roi).iter().filter(|d| d.z < 0.0) {
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
        assert!(scan_directions(&fine, &roi).len() < 3 * MAX_STEPS as usize);
        let below = ScanSettings { height: -1.0, azimuth_steps: Some(1), ..settings() };
        let flat = Roi::new([-10.0, -10.0, -1.0], [0.5; 3], [40, 40, 4]).unwrap();
        assert_eq!(scan_directions(&below, &flat).len(), 17, "steps of 0.075 rad over 70 degrees");
    }
}
