//! Own bodies that carry mounts and the sensors on them.

use lidar_cast::geom::Pose;
use lidar_cast::sensor::Ride;
use sightline_files::json::check::{bad, refused};
use sightline_files::json::{Checked, Location, nearest, quoted};

use super::description::BodyDescription;
use super::parts::OwnBodies;
use super::route::Motion;
use super::{Coverage, Scene};
use crate::vehicle::{MountingDescription, SensorName, VehicleMount};

/// Mend of a `rides_on` that no body answers to.
const LEAVE_OUT: &str = "; leave it out for what stands on the first body";

/// Checks that each mount that rides on a body has one body of that name. It needs no more than names, and stands before
/// the checks of symmetry: a mount on a misspelt body has no mirror image.
pub(super) fn check_names(
    at: &Location,
    mounts: &[MountingDescription],
    bodies: &[BodyDescription],
) -> Checked<()> {
    let names = bodies.iter().filter_map(|body| body.name.as_deref());
    let names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    for (number, mount) in mounts.iter().enumerate() {
        let Some(carrier) = mount.rides_on.as_deref() else { continue };
        let count = names.iter().filter(|name| **name == carrier).count();
        // Names that are none are told where the mount is read.
        let is_name = SensorName::new(carrier).is_ok_and(|name| !name.is_none());
        if count == 1 || !is_name {
            continue;
        }
        let wanted = match (count, &names[..]) {
            (0, []) => format!(
                "a body of `bodies`, of which none has a name; name the one that carries the mount{LEAVE_OUT}"
            ),
            (0, _) => match nearest(carrier, names.iter().copied()) {
                Some(name) => format!("a body of `bodies`; did you mean `{name}`?"),
                None => format!("a body of `bodies`, which are {}{LEAVE_OUT}", quoted(&names)),
            },
            _ => format!("one body of `bodies`: {count} have that name; give each its own"),
        };
        let at = at.key("mounts").item(number).key("rides_on");
        return Err(bad(&at, format!("`{carrier}`"), wanted));
    }
    Ok(())
}

impl OwnBodies {
    /// Checks that coverage is of each frame where a mount rides on a body.
    pub(crate) fn check_carriers(
        mounts: &[VehicleMount],
        coverage: Coverage,
        at: impl Fn(usize) -> Location,
    ) -> Checked<()> {
        let rides = |mount: &VehicleMount| !mount.region.rides_on.is_none();
        match mounts.iter().position(rides).filter(|_| coverage == Coverage::Through) {
            Some(number) => {
                let told = "rides on a body, and beams that run through everything are of one frame; leave `rides_on` out, or \
                            give the scene geometry and \"coverage\": \"first-hit\"";
                Err(refused(&at(number), told))
            }
            None => Ok(()),
        }
    }
}

impl Scene {
    /// Pose of a body of the ego in frame 0, by its name: takes its own frame to the ego frame.
    pub fn carrier_pose(&self, name: SensorName) -> Option<Pose> {
        let moving = self.bodies.iter().map(|body| (&body.name, body.motion.pose(0)));
        let mut all = moving.chain(self.still.iter().map(|(name, pose)| (name, *pose)));
        all.find(|(known, _)| **known == name.as_str()).map(|(_, pose)| pose)
    }

    /// A copy whose own bodies are moved by `turn` in the ego frame, in every frame; the surroundings stay.
    #[must_use]
    pub fn with_bodies_turned(&self, turn: &Pose) -> Self {
        let mut scene = self.clone();
        scene.body.vertices.iter_mut().for_each(|vertex| *vertex = turn.apply(*vertex));
        scene.still.iter_mut().for_each(|(_, pose)| *pose = turn.compose(pose));
        for body in &mut scene.bodies {
            let poses = (0..self.frames).map(|t| turn.compose(&body.motion.pose(t)));
            body.motion = Motion::Poses(poses.collect());
        }
        scene
    }

    /// The bodies of the ego that may carry sensors: those with a name.
    pub(crate) fn rides(&self) -> Vec<Ride> {
        let moving = self.bodies.iter().map(|body| {
            let back = body.motion.pose(0).inverse();
            let poses = (0..self.frames).map(|t| body.motion.pose(t).compose(&back)).collect();
            (&body.name, poses)
        });
        let still = self.still.iter().map(|(name, _)| (name, vec![Pose::IDENTITY]));
        let named = moving.chain(still);
        named
            .filter_map(|(name, poses)| Some(Ride { body: SensorName::new(name).ok()?, poses }))
            .collect()
    }
}
