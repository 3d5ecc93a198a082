//! Frame tree: parent links, their composition into one transform in `f64`, and the place of `base_link`.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DMat3, DQuat, DVec3};
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_files::json::Location;
use sightline_scene::vehicle::SensorPose;

use super::yaml::wrong;
use super::{Checked, FormatError, Rig, RigLidar, beams};
use crate::error::listed;

/// Content of a frame, as far as the file states it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FrameContent {
    /// A LiDAR, of a model that may be named.
    Lidar {
        /// Model, as the file names it.
        sensor: Option<String>,
        /// Where its beams start in the frame, where the file says so.
        optical: Option<SensorPose>,
    },
    Other,
    /// Unknown: the file does not say, so the frame's name decides.
    Unsaid,
}

#[derive(Debug, Clone)]
pub(super) struct RigFrame {
    pub(super) name: String,
    /// Empty for the root of the base.
    pub(super) parent: String,
    /// `parent_from_frame`.
    pub(super) pose: SensorPose,
    pub(super) holds: FrameContent,
    pub(super) at: Location,
}

/// Value of a [`MovingJoint`] at 0, in words.
pub(super) const AT_ZERO: &str = "0";

/// A joint that moves, in words.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MovingJoint {
    /// Name and kind.
    pub(super) joint: String,
    /// The value at which it is taken.
    pub(super) at: String,
}

/// All frames of a rig's files, in their order.
#[derive(Debug, Default)]
pub(super) struct FrameTree {
    list: Vec<RigFrame>,
    index: HashMap<String, usize>,
    /// Moving joints by the frame below each.
    moving: HashMap<String, MovingJoint>,
    /// The link above each link that a joint of SDF holds, and that joint where it moves.
    held: HashMap<String, (String, Option<MovingJoint>)>,
    /// Name that the files give the rig.
    pub(super) name: Option<String>,
    /// Model of a world that was read, in SDF.
    pub(super) model: Option<String>,
    /// Names of entries that are no LiDARs and have no frame.
    pub(super) left_out: Vec<String>,
    /// Notes for the user of the reading.
    pub(super) notes: Vec<Note>,
}

impl FrameTree {
    /// Adds a frame.
    ///
    /// # Errors
    /// A frame of this name is there already.
    pub(super) fn add(&mut self, frame: RigFrame) -> Checked<()> {
        if self.index.contains_key(&frame.name) {
            let name = &frame.name;
            let told = format!("the frame `{name}` is placed a second time; keep one of the two");
            return Err(FormatError::at(&frame.at, &told));
        }
        self.index.insert(frame.name.clone(), self.list.len());
        self.list.push(frame);
        Ok(())
    }

    /// Doubts elements that are not read where they stand, in words.
    pub(super) fn doubt_misplaced(&mut self, file: &str, told: Vec<String>) {
        let more = match told.len() {
            0 | 1 => String::new(),
            all => format!(" (and {} more)", all - 1),
        };
        self.notes.extend(
            told.first().map(|first| Note::doubt(format!("{file}: {first} is not read{more}"))),
        );
    }

    /// Says that a frame stands behind a joint that moves.
    pub(super) fn moves(&mut self, frame: &str, joint: MovingJoint) {
        self.moving.insert(frame.to_owned(), joint);
    }

    /// Says that a joint of SDF holds a link on another one; poses there do not follow joints.
    pub(super) fn holds(&mut self, child: &str, parent: String, moving: Option<MovingJoint>) {
        self.held.insert(child.to_owned(), (parent, moving));
    }

    /// The link of a frame and those above it, by the joints of SDF.
    fn holders<'a>(&'a self, frame: &'a str) -> Vec<&'a str> {
        // A frame `LINK/SENSOR` stands for a sensor of a link.
        let link = frame.rsplit_once('/').filter(|_| !self.held.contains_key(frame));
        let (mut next, mut found) = (link.map_or(frame, |(link, _)| link), Vec::new());
        while let Some((parent, _)) = self.held.get(next).filter(|_| !found.contains(&next)) {
            found.push(next);
            next = parent;
        }
        found
    }

    /// Frames whose poses lie between two frames, from the second one on; the root's own is none.
    pub(super) fn way(&self, base: &str, frame: &str) -> Vec<&RigFrame> {
        let up = |from: &str| {
            let mut way: Vec<&RigFrame> = Vec::new();
            let mut next = self.get(from);
            while let Some(frame) = next.filter(|_| way.len() <= self.list.len()) {
                way.push(frame);
                next = self.get(&frame.parent);
            }
            way
        };
        let (one, other) = (up(frame), up(base));
        let apart = |way: &[&'_ RigFrame], common: &[&'_ RigFrame]| -> HashSet<String> {
            let common: HashSet<&str> = common.iter().map(|frame| frame.name.as_str()).collect();
            let names = way.iter().map(|frame| frame.name.clone());
            names.filter(|name| !common.contains(name.as_str())).collect()
        };
        let (mine, its) = (apart(&one, &other), apart(&other, &one));
        let all = one.into_iter().filter(|frame| mine.contains(&frame.name));
        all.chain(other.into_iter().filter(|frame| its.contains(&frame.name))).collect()
    }

    /// Joints that move between two frames.
    pub(super) fn moving_between(&self, base: &str, frame: &str) -> Vec<&MovingJoint> {
        let (mine, its) = (self.holders(frame), self.holders(base));
        let one = mine.iter().filter(|link| !its.contains(*link));
        let links = one.chain(its.iter().filter(|link| !mine.contains(*link)));
        let held = links.filter_map(|link| self.held.get(*link)?.1.as_ref());
        let way = self.way(base, frame).into_iter();
        way.filter_map(|frame| self.moving.get(&frame.name)).chain(held).collect()
    }

    /// Makes a frame of the root that the base hangs on, so that a LiDAR may stand there.
    pub(super) fn add_root(&mut self, base: &str) {
        let Some(base) = self.get(base) else { return };
        let Ok((_, root)) = self.climb(base, None) else { return };
        if root.is_empty() {
            return;
        }
        let (name, at) = (root.to_owned(), base.at.clone());
        let (parent, holds) = (String::new(), FrameContent::Unsaid);
        self.index.insert(name.clone(), self.list.len());
        self.list.push(RigFrame { name, parent, pose: IDENTITY, holds, at });
    }

    /// Checks that no frames hang on each other.
    ///
    /// # Errors
    /// The first loop.
    pub(super) fn refuse_loops(&self) -> Checked<()> {
        // Each frame is marked with the number of the chain that came to it first.
        let mut marks = vec![0; self.list.len()];
        for start in 0..self.list.len() {
            let mut next = Some(start);
            while let Some(at) = next.filter(|&at| marks[at] == 0) {
                marks[at] = start + 1;
                next = self.index.get(&self.list[at].parent).copied();
            }
            if let Some(at) = next.filter(|&at| marks[at] == start + 1) {
                self.climb(&self.list[at], None)?;
            }
        }
        Ok(())
    }

    pub(super) fn all(&self) -> &[RigFrame] {
        &self.list
    }

    pub(super) fn get(&self, name: &str) -> Option<&RigFrame> {
        self.index.get(name).map(|&at| &self.list[at])
    }

    pub(super) fn get_mut(&mut self, name: &str) -> Option<&mut RigFrame> {
        self.index.get(name).map(|&at| &mut self.list[at])
    }

    /// True if a frame of this name is placed, or something hangs on it.
    pub(super) fn mentions(&self, name: &str) -> bool {
        self.get(name).is_some() || self.list.iter().any(|frame| frame.parent == name)
    }

    /// Every frame that is mentioned, each once.
    pub(super) fn names(&self) -> Vec<String> {
        let mut seen = HashSet::new();
        let names = self.list.iter().flat_map(|frame| [&frame.parent, &frame.name]);
        names.filter(|name| !name.is_empty() && seen.insert(*name)).cloned().collect()
    }

    /// Pose of one frame in another; `None` without a connection.
    pub(super) fn between(&self, base: &str, frame: &str) -> Option<SensorPose> {
        match (self.get(frame), self.get(base)) {
            (Some(frame), _) => self.in_base(base, frame).ok(),
            // The root of the tree is placed by no entry.
            (None, Some(base)) => Some(inverse(&self.in_base(frame, base).ok()?)),
            (None, None) => None,
        }
    }

    /// Pose of a frame in the base, wherever in the tree that stands.
    ///
    /// # Errors
    /// A loop, or no connection.
    pub(super) fn in_base(&self, base: &str, frame: &RigFrame) -> Checked<SensorPose> {
        let (pose, end) = self.climb(frame, Some(base))?;
        if end == base {
            return Ok(pose);
        }
        // Base and frame may have a common ancestor.
        if let Some(base) = self.get(base) {
            let (base_pose, base_end) = self.climb(base, None)?;
            if base_end == end {
                return Ok(compose(&inverse(&base_pose), &pose));
            }
        }
        let (RigFrame { at, name, .. }, known) = (frame, listed(&self.names()));
        Err(refused!(
            "{at}: the frame `{name}` has the parent `{end}`, which no transform connects with `{base}`; read the file of \
             that transform, too (in ROS and Apollo `frame_id: {base}`, `child_frame_id: {end}`), or give --base-frame \
             {end}; there are {known}"
        ))
    }

    /// Pose of a frame in the one at the end of its chain, which is the first called `stop`.
    fn climb<'a>(
        &'a self,
        frame: &'a RigFrame,
        stop: Option<&str>,
    ) -> Checked<(SensorPose, &'a str)> {
        let (mut pose, mut at) = (IDENTITY, frame.name.as_str());
        for _ in 0..=self.list.len() {
            match self.get(at).filter(|_| Some(at) != stop) {
                Some(link) => (pose, at) = (compose(&link.pose, &pose), &link.parent),
                None => return Ok((pose, at)),
            }
        }
        // More steps than frames: from here on the chain repeats itself.
        let mut frames = vec![at.to_owned()];
        let mut next = at;
        while let Some(link) = self.get(next).filter(|link| link.parent != at) {
            next = &link.parent;
            frames.push(next.to_owned());
        }
        let (at, frames) = (&frame.at, listed(&frames));
        Err(refused!("{at}: the frames {frames} hang on each other in a loop; break it"))
    }
}

/// Offsets from the frames of a file to the optical centres in the ego frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mounting {
    /// Position of `base_link` in the ego frame, in metres; its axes are the ego frame's.
    pub base_link: [f64; 3],
    /// Optical centre above the foot along the sensor's own z, in metres, by frame or sensor.
    pub optical_heights: BTreeMap<String, f64>,
}

impl Mounting {
    /// Height of the optical centre above the foot as given for the frame, for its sensor, or as known.
    pub(super) fn height(&self, frame: &str, sensor: Option<&str>) -> Option<f64> {
        let known = || sensor.and_then(beams::optical_height);
        self.given_height(frame, sensor).or_else(known)
    }

    /// Height as given for the frame or for its sensor.
    pub(super) fn given_height(&self, frame: &str, sensor: Option<&str>) -> Option<f64> {
        let given = |name: &str| {
            let same = |(key, height): (&String, &f64)| beams::same(key, name).then_some(*height);
            self.optical_heights.iter().find_map(same)
        };
        self.optical_heights.get(frame).copied().or_else(|| sensor.and_then(given))
    }

    /// The first name with a height that is neither a frame nor a sensor of a rig, so that the height does nothing.
    pub fn unused(&self, rig: &Rig) -> Option<&str> {
        let is_used = |name: &str| {
            rig.lidars.iter().any(|lidar| {
                let sensor = lidar.sensor.as_deref();
                lidar.frame == name || sensor.is_some_and(|sensor| beams::same(name, sensor))
            })
        };
        self.optical_heights.keys().map(String::as_str).find(|name| !is_used(name))
    }

    /// Pose in the ego frame of a pose in `base_link`.
    pub(super) fn to_ego(&self, pose: &SensorPose) -> SensorPose {
        self.moved(pose, 1.0)
    }

    /// Pose in `base_link` of a pose in the ego frame.
    pub(super) fn to_base(&self, pose: &SensorPose) -> SensorPose {
        self.moved(pose, -1.0)
    }

    fn moved(&self, pose: &SensorPose, sign: f64) -> SensorPose {
        let [x, y, z] = self.base_link.map(|v| sign * v);
        SensorPose { x: pose.x + x, y: pose.y + y, z: pose.z + z, ..*pose }
    }

    /// Pose of the foot in `base_link`, with the sensor's phase, and height of the optical centre above it.
    pub(super) fn foot(&self, lidar: &RigLidar) -> (SensorPose, f64) {
        let RigLidar { frame, sensor, pose } = lidar;
        let height = self.height(frame, sensor.as_deref()).unwrap_or(0.0);
        let foot = compose(&self.to_base(pose), &up(-height));
        (SensorPose { phase: pose.phase, ..foot }, height)
    }
}

pub(super) const IDENTITY: SensorPose = SensorPose::from_values([0.0; 6]);

/// Largest distance of a quaternion's squared length from 1; tf2 leaves out transforms beyond it.
const LENGTH_TOLERANCE: f64 = 1e-2;

/// Pose of a position and a quaternion x, y, z, w. One of another length than 1 is most likely four other numbers, and an error
/// at `at`.
pub(super) fn of_quaternion(
    position: [f64; 3],
    xyzw: [f64; 4],
    at: &Location,
) -> Checked<SensorPose> {
    let square: f64 = xyzw.iter().map(|v| v * v).sum();
    // NaN is within no tolerance.
    let is_unit = (square - 1.0).abs() <= LENGTH_TOLERANCE;
    if !is_unit {
        let length = format!("a quaternion of length {}", square.sqrt());
        return Err(wrong(at, length, "a quaternion of length 1"));
    }
    let rotation = DMat3::from_quat(DQuat::from_array(xyzw).normalize());
    Ok(SensorPose::from(&Pose { rotation, translation: DVec3::from(position) }))
}

/// `a_from_c` of `a_from_b` and `b_from_c`. Angles that need no computing stay as written.
pub(super) fn compose(outer: &SensorPose, inner: &SensorPose) -> SensorPose {
    let turns = |pose: &SensorPose| [pose.roll, pose.pitch, pose.yaw] != [0.0; 3];
    let product = outer.ego_from_sensor().compose(&inner.ego_from_sensor());
    let pose = SensorPose::from(&product);
    let [roll, pitch, yaw] = match (turns(outer), turns(inner)) {
        (false, _) => [inner.roll, inner.pitch, inner.yaw],
        (true, false) => [outer.roll, outer.pitch, outer.yaw],
        (true, true) => return pose,
    };
    SensorPose { roll, pitch, yaw, ..pose }
}

/// `b_from_a` of `a_from_b`.
fn inverse(pose: &SensorPose) -> SensorPose {
    SensorPose::from(&pose.ego_from_sensor().inverse())
}

/// A point up a sensor's own z, in its frame.
pub(super) fn up(height: f64) -> SensorPose {
    SensorPose { z: height, ..IDENTITY }
}

/// Angle between two rotations, in radians.
pub(super) fn turn(a: &DMat3, b: &DMat3) -> f64 {
    // |A − B|² = 8 sin²(angle/2): exact for small angles, where the arc cosine is not.
    let columns = (0..3).map(|k| a.col(k).distance_squared(b.col(k)));
    let half_sine = (columns.sum::<f64>() / 8.0).sqrt();
    2.0 * maths::asin(half_sine.min(1.0))
}

/// Angle between two directions of unit length, in radians.
pub(super) fn tilt(a: DVec3, b: DVec3) -> f64 {
    2.0 * maths::asin((a.distance(b) / 2.0).min(1.0))
}
