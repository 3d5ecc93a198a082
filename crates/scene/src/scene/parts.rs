//! The rigid parts of a scene, each in a frame of its own, and where they stand in each frame.
//!
//! Parts come in the order of [`Scene::frame`]: static world, actors as listed, ego body, bodies of the ego that move. The static world's frame has
//! its origin in the middle of the ego's way, an actor's in the middle of its box, both rounded to whole metres:
//! coordinates are moved there in `f64` before they are rounded to `f32`.
//!
//! A tracker sees the actors among them as boxes with kinds, also between two frames. A part, an actor, a body or a frame
//! that the scene does not have is a panic.

use std::ops::Range;

use glam::DVec3;
use lidar_cast::geom::{Glide, Pose, TriangleSoup};
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check, counted};

use super::description::{BodyDescription, ShapeDescription};
use super::route::Motion;
use super::shapes::Builder;
use super::solid::{Solid, around};
use super::{ActorKind, EgoBody, Scene, doubts};

/// Owner of a rigid part: it moves with this.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartOwner {
    /// The static world.
    World,
    /// An actor, by its index in the scene.
    Actor(usize),
    /// The ego vehicle, whose body the part is.
    Ego,
    /// A body of the ego vehicle that moves against the first, by its index among those.
    EgoBody(usize),
}

/// Poses of a body that are looked at for doubts.
const MOST_POSES: usize = 40;

/// Share of the smaller volume of two bodies from which on no hitch explains that they overlap.
const MOST_SHARED: f64 = 0.5;

/// End of a note on a body that moves in frames, and not on level ground.
const HELD_STILL: &str = "level ground takes the body as in frame 0";

impl Scene {
    /// Number of the part that is the body of the ego vehicle, the first of its bodies.
    pub fn body_part(&self) -> usize {
        1 + self.actors.len()
    }

    /// Numbers of the parts that are bodies of the ego vehicle: the last ones.
    pub(crate) fn own_parts(&self) -> Range<usize> {
        self.body_part()..self.body_part() + 1 + self.bodies.len()
    }

    /// True if bodies of the ego vehicle move against each other.
    pub fn has_moving_bodies(&self) -> bool {
        !self.bodies.is_empty()
    }

    /// Numbers of all parts, the empty ones among them, with or without the bodies of the ego vehicle.
    pub fn parts(&self, body: EgoBody) -> Range<usize> {
        let own = self.own_parts();
        0..if body == EgoBody::Include { own.end } else { own.start }
    }

    /// Owner of a part.
    pub fn owner(&self, part: usize) -> PartOwner {
        let own = self.own_parts();
        assert!(part < own.end, "part {part} of {}", own.end);
        match part {
            0 => PartOwner::World,
            part if part < own.start => PartOwner::Actor(part - 1),
            part if part == own.start => PartOwner::Ego,
            part => PartOwner::EgoBody(part - own.start - 1),
        }
    }

    fn solid(&self, part: usize) -> &Solid {
        match self.owner(part) {
            PartOwner::World => &self.world,
            PartOwner::Actor(actor) => &self.actors[actor].parts,
            PartOwner::Ego => &self.body,
            PartOwner::EgoBody(body) => &self.bodies[body].parts,
        }
    }

    /// Triangles of a part in its own frame, in metres; the same for all frames of the scene.
    pub fn part(&self, part: usize) -> TriangleSoup {
        let mut soup = TriangleSoup::default();
        let part_from_owner = Pose { translation: -self.origins[part], ..Pose::IDENTITY };
        self.solid(part).append_to(&mut soup, &part_from_owner);
        soup
    }

    /// Number of triangles of a part.
    pub fn part_triangles(&self, part: usize) -> usize {
        self.solid(part).faces.len()
    }

    /// Takes the frame of each part's owner to the ego frame of frame `t`.
    fn owner_poses(&self, t: usize) -> Vec<Pose> {
        let ego_from_world = self.ego_pose(t).inverse();
        let mut poses = vec![ego_from_world];
        let actors = self.actors.iter().map(|actor| actor.motion.pose(t));
        poses.extend(actors.map(|world_from_actor| ego_from_world.compose(&world_from_actor)));
        poses.push(Pose::IDENTITY);
        poses.extend(self.bodies.iter().map(|body| body.motion.pose(t)));
        poses
    }

    /// Triangles of frame `t` in the ego frame, in metres.
    ///
    /// Order: static world, actors as listed, ego body, bodies of the ego that move; face ids are the same in every frame.
    /// The copy is as large as the scene: engines take [`Scene::part`] once and [`Scene::part_poses`] a frame.
    pub fn frame(&self, t: usize, body: EgoBody) -> TriangleSoup {
        let mut soup = TriangleSoup::default();
        for (part, ego_from_owner) in self.parts(body).zip(self.owner_poses(t)) {
            self.solid(part).append_to(&mut soup, &ego_from_owner);
        }
        soup
    }

    /// Takes each part's frame to the ego frame of frame `t`; the ego's bodies come last.
    pub fn part_poses(&self, t: usize) -> Vec<Pose> {
        let mut poses = self.owner_poses(t);
        for (pose, &origin) in poses.iter_mut().zip(&self.origins) {
            pose.translation = pose.apply(origin);
        }
        poses
    }

    /// Number of triangles of a frame; the ego's bodies come last.
    pub fn triangles(&self, body: EgoBody) -> usize {
        self.parts(body).map(|part| self.part_triangles(part)).sum()
    }

    /// Class of every triangle of a frame, by its number; the same in every frame.
    pub fn face_classes(&self, body: EgoBody) -> Vec<u16> {
        self.parts(body).flat_map(|part| self.solid(part).classes.iter().copied()).collect()
    }

    /// True if bodies of the ego vehicle have a pose for each frame, and level ground took them as in frame 0.
    pub fn has_bodies_held_still(&self) -> bool {
        self.notes.iter().any(|note| note.to_string().ends_with(HELD_STILL))
    }

    /// Triangles of the ego's bodies in frame 0, in the ego frame; none where the scene has no geometry.
    pub fn body(&self) -> Vec<[[f32; 3]; 3]> {
        self.body_in(0)
    }

    /// Triangles of the ego's bodies in a frame, in the ego frame; none where the scene has no geometry.
    pub fn body_in(&self, frame: usize) -> Vec<[[f32; 3]; 3]> {
        let mut soup = TriangleSoup::default();
        standing(&self.body, &self.bodies, frame).append_to(&mut soup, &Pose::IDENTITY);
        (0..soup.faces.len() as u32).map(|prim| soup.corners(prim)).collect()
    }

    /// Triangles of [`Self::body_in`] by the shape of the bodies' lists that they are of, in that order; the same in every
    /// frame.
    pub fn body_shapes(&self) -> Vec<Range<usize>> {
        let ends = standing(&self.body, &self.bodies, 0).ends;
        let starts = std::iter::once(0).chain(ends.iter().copied());
        let shapes = starts.zip(&ends).map(|(start, &end)| start..end);
        shapes.filter(|shape| !shape.is_empty()).collect()
    }

    /// Tracks of the actors as listed; one without triangles is a box without extent.
    pub fn tracks(&self) -> Vec<Track> {
        let track = |actor: &super::Actor| {
            let vertices = actor.parts.vertices.iter().copied();
            let [low, high] = around(vertices).unwrap_or_default();
            Track {
                name: actor.name.clone(),
                kind: actor.kind,
                class: actor.parts.classes.first().copied().unwrap_or_default(),
                size: high - low,
                center: (low + high) / 2.0,
            }
        };
        self.actors.iter().map(track).collect()
    }

    /// How an actor, counted as listed, moves from frame `t` to the next: takes its frame to the world's.
    pub fn actor_glide(&self, actor: usize, t: usize) -> Glide {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.actors[actor].motion.glide(t)
    }

    /// A body of the ego that moves in words, by its index among those: its name, else its number.
    pub(crate) fn own_body_in_words(&self, body: usize) -> String {
        match self.own_body_name(body) {
            "" => format!("body {body} that moves"),
            name => format!("body `{name}`"),
        }
    }

    /// Name of a body of the ego that moves, by its index among those; may be empty.
    pub fn own_body_name(&self, body: usize) -> &str {
        &self.bodies[body].name
    }

    /// Motion of a moving body of the ego, by its index in `bodies`, from frame `t` to the next. It takes the body's frame
    /// to the ego frame.
    pub fn own_body_glide(&self, body: usize, t: usize) -> Glide {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.bodies[body].motion.glide(t)
    }

    /// How the ego moves from frame `t` to the next: takes its frame to the world's.
    pub fn ego_glide(&self, t: usize) -> Glide {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.ego.glide(t)
    }

    /// Origin of a part's frame in the frame of its owner: world, actor or ego.
    pub fn part_origin(&self, part: usize) -> DVec3 {
        self.origins[part]
    }
}

/// Farthest that the ego may get from the middle of its way, in metres: `f32` keeps 2 mm there.
const FARTHEST: f64 = 5.0e4;

/// Origin of the static world's frame: the middle of the box around the ego's places.
///
/// # Errors
/// A way so long that `f32` cannot hold the world along all of it.
pub(super) fn middle_of_way(
    at: &Location,
    ego: &Motion,
    frames: usize,
    world: &Solid,
) -> Checked<DVec3> {
    let places = || (0..frames).map(|t| ego.pose(t).translation);
    let [low, high] = around(places()).unwrap_or_default();
    let middle = (0.5 * (low + high)).round();
    let far = places().map(|place| (place - middle).abs().max_element()).fold(0.0, f64::max);
    if far > FARTHEST && !world.faces.is_empty() {
        let at = at.key(if matches!(ego, Motion::Poses(_)) { "poses" } else { "route" });
        let value = format!("a way that leads {far:.0} m from its middle");
        let wanted = "one within 50000 m, where coordinates keep 2 mm; cut the scene into several";
        return Err(bad(&at, value, wanted));
    }
    Ok(middle)
}

/// Origin of a moving part's frame: the middle of its box.
pub(super) fn middle(part: &Solid) -> DVec3 {
    let [low, high] = around(part.vertices.iter().copied()).unwrap_or_default();
    (0.5 * (low + high)).round()
}

/// An actor as a box on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Name in the scene file; may be empty, and several may share it.
    pub name: String,
    /// Kind of file.
    pub kind: ActorKind,
    /// Class of its first triangle.
    pub class: u16,
    /// Extent along its own x (forward), y and z in metres.
    pub size: DVec3,
    /// Middle of the box in the actor's frame.
    pub center: DVec3,
}

/// A body that moves against the first: a trailer that bends, a wheel that is steered.
#[derive(Debug, Clone)]
pub(crate) struct OwnBody {
    pub name: String,
    /// Triangles in the body's own frame.
    pub parts: Solid,
    /// Takes the body's frame to the ego frame.
    pub motion: Motion,
    at: Location,
}

impl OwnBody {
    /// Checks for one pose a frame of the scene at `scene`.
    pub(crate) fn check_frames(&self, scene: &Location, frames: usize) -> Checked<()> {
        match &self.motion {
            Motion::Poses(poses) if poses.len() != frames => {
                let found = format!("a list of {}", poses.len());
                let wanted = format!(
                    "one pose for all frames, or one for each of the {} of {}; for scenes of several lengths give one pose, or \
                     list the poses in each scene under `ego.bodies`, and leave `body` and `bodies` out of the vehicle",
                    counted(frames, "frame"),
                    scene.file
                );
                Err(bad(&self.at.key("poses"), found, wanted))
            }
            _ => Ok(()),
        }
    }

    /// Note for commands that take the body as it stands in frame 0.
    pub(crate) fn note(&self) -> Note {
        Note::fact(format!(
            "{}: moves from frame to frame. The near field, the range card and `study targets` on level ground take it as in \
             frame 0. Requirements on targets take each of its poses",
            self.at
        ))
    }
}

/// All bodies of the own vehicle.
#[derive(Debug, Default)]
pub(crate) struct OwnBodies {
    /// The first body and those with one pose, in the ego frame.
    pub body: Solid,
    /// Bodies with a pose for each frame.
    pub moving: Vec<OwnBody>,
    /// Names of bodies that keep one pose, and that pose.
    pub still: Vec<(String, Pose)>,
    /// Bodies that cover the first one, of a wrong size or far from it.
    pub doubts: Vec<Note>,
    /// Doubts about the first body alone, until another one joins it.
    first: Vec<Note>,
    /// True if another body stands in `body`, too.
    pub joined: bool,
    /// True if a body was told to be of a wrong size, or far from the vehicle.
    pub told: bool,
}

impl OwnBodies {
    /// Reads `body` and `bodies` of the object at `at`.
    pub(crate) fn new(
        builder: &mut Builder<'_>,
        at: &Location,
        first: &[ShapeDescription],
        others: &[BodyDescription],
    ) -> Checked<Self> {
        let body = builder.own_list(&at.key("body"), first)?;
        if !first.is_empty() {
            check_area(&at.key("body"), &body)?;
        }
        let alone = doubts::of_still_body("ego's first body", &body, first);
        let filled = doubts::Filled::of(&body).filter(|_| !others.is_empty());
        let mut own = Self { body, first: in_file(at, alone), ..Self::default() };
        for (i, body) in others.iter().enumerate() {
            own.add(builder, at.key("bodies").item(i), body, filled.as_ref())?;
        }
        Ok(own)
    }

    /// Adds a body as it stands in a pose to the first, which is looked at by itself before.
    fn join(&mut self, parts: &Solid, pose: &Pose) {
        self.body.append(parts, pose);
        let first = std::mem::take(&mut self.first);
        self.told |= !first.is_empty();
        self.doubts.extend(first);
        self.joined = true;
    }

    /// Doubts about the size of a body beside the first, and about its places.
    fn doubt(
        &mut self,
        at: &Location,
        who: &str,
        parts: &Solid,
        body: &BodyDescription,
        still: bool,
    ) {
        let of_size = if still { doubts::of_still_body } else { doubts::of_moving_body };
        let mut told = in_file(at, of_size(who, parts, &body.parts));
        told.extend(doubts::far(at, body.poses.as_deref().unwrap_or_default()).map(Note::doubt));
        self.told |= !told.is_empty();
        self.doubts.extend(told);
    }

    /// Adds a body beside the first.
    fn add(
        &mut self,
        builder: &mut Builder<'_>,
        at: Location,
        body: &BodyDescription,
        first: Option<&doubts::Filled>,
    ) -> Checked<()> {
        let name = check::name(&at.key("name"), body.name.clone().unwrap_or_default())?;
        if body.parts.is_empty() {
            let wanted = "a shape of the body; add one or leave the body out";
            return Err(bad(&at.key("parts"), "an empty list", wanted));
        }
        // A heading may go on past a turn, a body that bends does not.
        for (k, pose) in body.poses.iter().flatten().enumerate() {
            check::radians(&at.key("poses").item(k).key("yaw"), pose.yaw)?;
        }
        let Some(motion) = Motion::new(&at, body.poses.as_deref(), None, false)? else {
            let mend =
                "say where the body is in the ego frame, with one pose, or one for each frame";
            return Err(check::missing(&at, "poses", mend));
        };
        let parts = builder.own_list(&at.key("parts"), &body.parts)?;
        check_area(&at.key("parts"), &parts)?;
        self.doubts.extend(first.and_then(|first| covers(&at, &parts, &motion, first)));
        let still = match &motion {
            Motion::Poses(poses) if poses.len() == 1 => Some(poses[0]),
            _ => None,
        };
        let number = self.moving.len();
        let who = match (&*name, still) {
            ("", Some(_)) => format!("ego's body at {}", at.path),
            ("", None) => format!("ego's body {number} that moves"),
            (name, _) => format!("ego's body `{name}`"),
        };
        self.doubt(&at, &who, &parts, body, still.is_some());
        match still {
            Some(pose) => {
                self.join(&parts, &pose);
                self.still.push((name, pose));
            }
            None => self.moving.push(OwnBody { name, parts, motion, at }),
        }
        Ok(())
    }

    /// Puts bodies with a pose for each frame where they are in frame 0, with a note for each.
    pub(crate) fn hold_still(&mut self) -> Vec<Note> {
        let mut notes = Vec::new();
        for OwnBody { name, parts, motion, at } in std::mem::take(&mut self.moving) {
            let Motion::Poses(poses) = motion else { continue };
            self.join(&parts, &poses[0]);
            self.still.push((name, poses[0]));
            let count = poses.len();
            notes.push(Note::fact(format!(
                "{at}: has {count} poses, one for each frame; {HELD_STILL}"
            )));
        }
        notes
    }

    /// True if no body has a triangle.
    pub(crate) fn is_empty(&self) -> bool {
        self.body.faces.is_empty() && self.moving.iter().all(|body| body.parts.faces.is_empty())
    }
}

/// Doubts about the file of a place.
fn in_file(at: &Location, doubts: Vec<String>) -> Vec<Note> {
    doubts.into_iter().map(|doubt| Note::doubt(format!("{}: {doubt}", at.file))).collect()
}

/// A doubt about a body that takes up most of the room of the first one, or lies in it for the most part, in one of its
/// poses.
fn covers(at: &Location, parts: &Solid, motion: &Motion, first: &doubts::Filled) -> Option<Note> {
    let Motion::Poses(poses) = motion else { return None };
    let body = doubts::Filled::of(parts)?;
    let mut shares = poses.iter().take(MOST_POSES).map(|pose| first.shared(&body, pose));
    let (pose, share) = shares.by_ref().enumerate().find(|(_, share)| *share > MOST_SHARED)?;
    Some(Note::doubt(format!(
        "{}: {:.0} % of the smaller one of this body and the first body lie in both; `x`, `y` and `yaw` say where the \
         origin of its own shapes lies in the ego frame",
        at.key("poses").item(pose),
        100.0 * share
    )))
}

/// Refuses a body whose triangles are lines and points.
fn check_area(at: &Location, body: &Solid) -> Checked<()> {
    if body.has_area() {
        return Ok(());
    }
    let wanted = "a body that beams can hit; give its mesh an extent, or leave the body out";
    Err(bad(at, "a list of triangles without an area", wanted))
}

/// All triangles of the own vehicle in a frame, in the ego frame.
pub(super) fn standing(body: &Solid, moving: &[OwnBody], frame: usize) -> Solid {
    let mut all = Solid::default();
    all.append(body, &Pose::IDENTITY);
    moving.iter().for_each(|other| all.append(&other.parts, &other.motion.pose(frame)));
    all
}
