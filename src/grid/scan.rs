use glam::DVec3;
use rayon::prelude::*;

use super::{BuildReport, FrameVotes, GridError, Psog, PsogBuilder, Roi};
use crate::bvh::{Bvh, Ray};
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
    let directions = scan_directions(settings);
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
            votes.par_extend(directions.par_iter().filter_map(|&direction| {
                let direction = ego_from_stand.rotation * direction;
                let t_max = settings.range as f32;
                let hit = bvh.closest_hit(&Ray::new(origin.as_vec3(), direction.as_vec3(), t_max));
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

/// Unit directions of the scanner, in the ego frame of where it stands.
fn scan_directions(settings: &ScanSettings) -> Vec<DVec3> {
    let [lower, upper] = settings.fov.map(f64::to_radians);
    let between = f64::from(settings.channels.max(2) - 1);
    let elevations =
        (0..settings.channels).map(|k| lower + f64::from(k) * (upper - lower) / between);
    elevations
        .flat_map(|elevation| {
            (0..settings.azimuth_steps).map(move |j| {
                let turn = std::f64::consts::TAU * f64::from(j) / f64::from(settings.azimuth_steps);
                Pose::new(DVec3::ZERO, 0.0, -elevation, turn).rotation * DVec3::X
            })
        })
        .collect()
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
