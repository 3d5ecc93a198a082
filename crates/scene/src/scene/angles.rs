//! Doubts about angles of a scene file: degrees where radians are meant.

use std::f64::consts::TAU;

use super::description::{PoseDescription, SceneDescription, ShapeDescription};
use crate::vehicle;
use sightline_files::Note;
use sightline_files::json::Place;

/// Doubts about the angles that a scene file states.
pub(super) fn of_angles(top: &Place, scene: &SceneDescription) -> Vec<Note> {
    let mut doubts = of_shapes(&top.key("static"), &scene.world);
    for (name, shapes) in &scene.shapes.0 {
        doubts.extend(of_shapes(&top.key("shapes").key(name), shapes));
    }
    let ego = scene.ego.iter().map(|ego| (top.key("ego"), &ego.poses));
    let actors = scene.actors.iter().enumerate();
    let actors = actors.map(|(i, actor)| (top.key("actors").item(i), &actor.poses));
    let turned = ego.chain(actors).filter_map(|(at, poses)| track(&at, poses.as_deref()?));
    doubts.extend(first_three(turned.collect()));
    for (i, actor) in scene.actors.iter().enumerate() {
        doubts.extend(of_shapes(&top.key("actors").item(i).key("parts"), &actor.parts));
    }
    if let Some(ego) = &scene.ego {
        doubts.extend(of_shapes(&top.key("ego").key("body"), &ego.body));
    }
    if let Some(mount) = &scene.mount {
        let angles = [("roll", mount.roll), ("pitch", mount.pitch), ("yaw", mount.yaw)];
        let told = angles.iter().filter_map(|(key, range)| {
            vehicle::of_angles(&top.key("mount").key(key).to_string(), range)
        });
        doubts.extend(told.map(Note::doubt));
    }
    doubts
}

/// Doubts about the angles of meshes. Boxes and copies are turned by whole radians, too.
pub(super) fn of_shapes(at: &Place, shapes: &[ShapeDescription]) -> Vec<Note> {
    let mut doubts = Vec::new();
    for (i, shape) in shapes.iter().enumerate() {
        if let Some(mesh) = &shape.mesh {
            for (key, angle) in [("roll", mesh.roll), ("pitch", mesh.pitch), ("yaw", mesh.yaw)] {
                let what = at.item(i).key("mesh").key(key).to_string();
                doubts.extend(vehicle::of_angles(&what, &[angle]));
            }
        }
    }
    first_three(doubts.into_iter().map(Note::doubt).collect())
}

/// A doubt about the angles of a way. Headings may go on past a turn, step by step.
fn track(at: &Place, poses: &[PoseDescription]) -> Option<Note> {
    let yaw: Vec<f64> = poses.iter().map(|pose| pose.yaw).collect();
    let leaps = |two: &[f64]| {
        let step = two[1] - two[0];
        (step - TAU * (step / TAU).round()).abs() > 1.0
    };
    let more_than_a_turn = |yaw: &f64| yaw.abs() > TAU + 1e-6;
    let whole = yaw.iter().all(|yaw| yaw.fract() == 0.0) && yaw.iter().any(|yaw| yaw.abs() >= 2.0);
    let in_degrees = whole
        || yaw.first().is_some_and(more_than_a_turn)
        || (yaw.iter().any(more_than_a_turn) && yaw.windows(2).any(leaps));
    let worst = yaw.iter().copied().find(|yaw| in_degrees && yaw.abs() >= 2.0);
    let tilt =
        poses.iter().flat_map(|pose| [pose.roll, pose.pitch]).find(|a| vehicle::is_degrees(*a));
    let (key, angle) = worst.map(|yaw| ("yaw", yaw)).or(tilt.map(|tilt| ("a tilt", tilt)))?;
    Some(Note::doubt(format!(
        "{}: {key} of {angle} rad; degrees? {angle}° are {:.4} rad",
        at.key("poses"),
        angle.to_radians()
    )))
}

/// The first three doubts of a list; things of one file share one mistake.
fn first_three(mut doubts: Vec<Note>) -> Vec<Note> {
    doubts.truncate(3);
    doubts
}
