//! Frame tree: parent links, and their composition into one transform.

use std::collections::{HashMap, HashSet};

use super::RigError;
use super::angles::{IDENTITY, compose, inverse};
use sightline_files::Note;
use sightline_files::json::Place;
use sightline_scene::vehicle::SensorPose;

/// Content of a frame, as far as the file states it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Holds {
    /// A LiDAR, of a model that may be named.
    Lidar {
        /// Model, as the file names it.
        sensor: Option<String>,
        /// Where its beams start in the frame, where the file says so.
        optical: Option<SensorPose>,
    },
    /// Something else.
    Other,
    /// Nothing: the name must tell.
    Unsaid,
}

/// A frame and where it hangs.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) name: String,
    pub(super) parent: String,
    /// `parent_from_frame`.
    pub(super) pose: SensorPose,
    pub(super) holds: Holds,
    pub(super) at: Place,
}

/// All frames of a rig's files, in their order.
#[derive(Debug, Default)]
pub(super) struct Frames {
    list: Vec<Frame>,
    index: HashMap<String, usize>,
    /// Joints that move, in words, by the frame behind each.
    moving: HashMap<String, String>,
    /// Name that the files give the rig.
    pub(super) name: Option<String>,
    /// Names of entries that are no LiDARs and have no frame.
    pub(super) left_out: Vec<String>,
    /// Notes for the user of the reading.
    pub(super) notes: Vec<Note>,
}

impl Frames {
    /// Adds a frame.
    ///
    /// # Errors
    /// A frame of this name is there already.
    pub(super) fn add(&mut self, frame: Frame) -> Result<(), RigError> {
        if self.index.contains_key(&frame.name) {
            let Frame { name, at, .. } = frame;
            return Err(RigError::Twice { at: Box::new(at), frame: name });
        }
        self.index.insert(frame.name.clone(), self.list.len());
        self.list.push(frame);
        Ok(())
    }

    /// Says that a frame stands behind a joint that moves.
    pub(super) fn moves(&mut self, frame: &str, joint: String) {
        self.moving.insert(frame.to_owned(), joint);
    }

    /// Joints that move between two frames, in words.
    pub(super) fn moving_between(&self, base: &str, frame: &str) -> Vec<&str> {
        let up = |from: &str| {
            let mut way: Vec<String> = Vec::new();
            let mut at = Some(from);
            while let Some(name) = at.filter(|_| way.len() <= self.list.len()) {
                way.push(name.to_owned());
                at = self.get(name).map(|frame| frame.parent.as_str());
            }
            way
        };
        let (one, other) = (up(frame), up(base));
        let apart = |way: &[String], common: &[String]| -> Vec<String> {
            way.iter().filter(|name| !common.contains(name)).cloned().collect()
        };
        let way = apart(&one, &other).into_iter().chain(apart(&other, &one));
        way.filter_map(|name| self.moving.get(&name).map(String::as_str)).collect()
    }

    pub(super) fn all(&self) -> &[Frame] {
        &self.list
    }

    pub(super) fn get(&self, name: &str) -> Option<&Frame> {
        self.index.get(name).map(|&at| &self.list[at])
    }

    pub(super) fn get_mut(&mut self, name: &str) -> Option<&mut Frame> {
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
        names.filter(|name| seen.insert(*name)).cloned().collect()
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
    pub(super) fn in_base(&self, base: &str, frame: &Frame) -> Result<SensorPose, RigError> {
        let (pose, end) = self.climb(frame, Some(base))?;
        if end == base {
            return Ok(pose);
        }
        // The base hangs somewhere itself, and the frame beside it.
        if let Some(base) = self.get(base) {
            let (base_pose, base_end) = self.climb(base, None)?;
            if base_end == end {
                return Ok(compose(&inverse(&base_pose), &pose));
            }
        }
        Err(RigError::Unconnected {
            at: Box::new(frame.at.clone()),
            frame: frame.name.clone(),
            parent: end.to_owned(),
            base: base.to_owned(),
            known: self.names(),
        })
    }

    /// Pose of a frame in the one at the end of its chain, which is the first called `stop`.
    fn climb<'a>(
        &'a self,
        frame: &'a Frame,
        stop: Option<&str>,
    ) -> Result<(SensorPose, &'a str), RigError> {
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
        Err(RigError::Loop { at: Box::new(frame.at.clone()), frames })
    }
}
