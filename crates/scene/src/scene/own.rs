//! Bodies of the own vehicle: the first, on which the sensors stand, and others in poses of their own.

use super::description::{BodyDescription, ShapeDescription};
use super::route::Motion;
use super::shapes::Builder;
use super::solid::Solid;
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Location};

/// A body that moves against the first: a trailer that bends, a wheel that is steered.
#[derive(Debug, Clone)]
pub struct OwnBody {
    pub name: String,
    /// Triangles in the body's own frame.
    pub parts: Solid,
    /// Takes the body's frame to the ego frame.
    pub motion: Motion,
    /// Where it is described.
    at: Location,
}

impl OwnBody {
    /// Checks for one pose a frame.
    ///
    /// # Errors
    /// Another number of poses.
    pub fn check_frames(&self, frames: usize) -> Result<(), DescriptionError> {
        match &self.motion {
            Motion::Poses(poses) if poses.len() != frames => {
                let found = format!("a list of {}", poses.len());
                let wanted =
                    format!("one pose for all frames, or one for each of the {frames} frame(s)");
                Err(bad(&self.at.key("poses"), found, wanted))
            }
            _ => Ok(()),
        }
    }

    /// Note on what takes the body as it stands in frame 0.
    pub fn note(&self) -> Note {
        Note::fact(format!(
            "{}: moves from frame to frame; the outline for the near field, its poles, and targets on level ground \
             take it as in frame 0",
            self.at
        ))
    }
}

/// All bodies of the own vehicle.
#[derive(Debug, Default)]
pub struct OwnBodies {
    /// The first body and those with one pose, in the ego frame.
    pub body: Solid,
    /// Bodies with a pose for each frame.
    pub moving: Vec<OwnBody>,
}

impl OwnBodies {
    /// Reads `body` and `bodies` of the object at `at`.
    ///
    /// # Errors
    /// A body without parts, triangles or poses; a shape that is wrong.
    pub fn new(
        builder: &mut Builder<'_>,
        at: &Location,
        first: &[ShapeDescription],
        others: &[BodyDescription],
    ) -> Result<Self, DescriptionError> {
        let body = builder.list(&at.key("body"), first)?;
        let mut own = Self { body, moving: Vec::new() };
        for (i, body) in others.iter().enumerate() {
            own.add(builder, at.key("bodies").item(i), body)?;
        }
        Ok(own)
    }

    fn add(
        &mut self,
        builder: &mut Builder<'_>,
        at: Location,
        body: &BodyDescription,
    ) -> Result<(), DescriptionError> {
        let name = check::name(&at.key("name"), body.name.clone().unwrap_or_default())?;
        if body.parts.is_empty() {
            let wanted = "a shape of the body; add one or leave the body out";
            return Err(bad(&at.key("parts"), "an empty list", wanted));
        }
        let Some(motion) = Motion::new(&at, body.poses.as_deref(), None, false)? else {
            return Err(DescriptionError::Missing {
                at: Box::new(at),
                key: "poses",
                mend:
                    "say where the body is in the ego frame, with one pose, or one for each frame"
                        .to_owned(),
            });
        };
        let parts = builder.list(&at.key("parts"), &body.parts)?;
        if !parts.has_area() {
            let wanted =
                "a body that beams can hit; give its mesh an extent, or leave the body out";
            return Err(bad(&at.key("parts"), "a list of triangles without an area", wanted));
        }
        match &motion {
            Motion::Poses(poses) if poses.len() == 1 => self.body.append(&parts, &poses[0]),
            _ => self.moving.push(OwnBody { name, parts, motion, at }),
        }
        Ok(())
    }

    /// True if no body has a triangle.
    pub fn is_empty(&self) -> bool {
        self.body.faces.is_empty() && self.moving.iter().all(|body| body.parts.faces.is_empty())
    }
}

/// All triangles of the own vehicle in a frame, in the ego frame.
pub fn standing(body: &Solid, moving: &[OwnBody], frame: usize) -> Solid {
    let mut all = Solid::default();
    all.append(body, &Pose::IDENTITY);
    moving.iter().for_each(|other| all.append(&other.parts, &other.motion.pose(frame)));
    all
}
