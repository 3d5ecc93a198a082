//! Interface of all data sets: frames, poses, labelled points, things that move.

use super::DatasetError;
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_scene::scene::ActorKind;

/// Meaning of a point's label.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointLabel {
    /// Position in [`LabelledSequence::classes`]; `None` for labels that do not vote.
    pub class: Option<u16>,
    /// The thing may have moved while it was recorded, so its points belong to one frame only.
    pub moving: bool,
    /// The point lies on a thing that [`LabelledSequence::tracks`] follows.
    pub on_track: bool,
}

/// One scan with its labels, in the sensor frame, metres.
#[derive(Debug, Clone)]
pub struct LabelledScan {
    /// Coordinates `[N]`, all finite.
    pub points: Vec<[f32; 3]>,
    /// Meaning of each point's label `[N]`.
    pub labels: Vec<PointLabel>,
}

/// A box on its way through a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxTrack {
    /// Category, as the data set calls it.
    pub name: String,
    /// Its kind in a scene.
    pub kind: ActorKind,
    /// Position in [`LabelledSequence::classes`].
    pub class: u16,
    /// Largest extent along its own x (forward), y and z over all frames, metres.
    pub size: [f64; 3],
    /// Where the box stood, by rising frame, at most once a frame.
    pub poses: Vec<TrackPose>,
}

/// A track in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPose {
    /// Number of the frame.
    pub frame: u32,
    /// Middle of the box; takes its own frame to the world.
    pub world_from_box: Pose,
}

impl BoxTrack {
    /// Farthest that a thing at rest seems to move, metres: boxes are drawn by hand.
    const AT_REST: f64 = 0.5;

    /// True if the box stays where it was first seen.
    pub fn at_rest(&self) -> bool {
        let places = || self.poses.iter().map(|pose| pose.world_from_box.translation);
        let first = places().next();
        first.is_none_or(|first| places().all(|place| place.distance(first) <= Self::AT_REST))
    }
}

/// Frames of one recording, each a labelled scan, in one world.
pub trait LabelledSequence {
    /// Name of the recording.
    fn name(&self) -> String;

    /// Class names; a class is a position in this list.
    fn classes(&self) -> Vec<String>;

    /// Numbers of the frames that have a scan, rising.
    fn frames(&self) -> Vec<u32>;

    /// Frames a second, where the data set says so.
    fn rate(&self) -> Option<f64>;

    /// Pose of the sensor on the vehicle at a frame; the ego frame stands on the ground.
    ///
    /// # Errors
    /// The frame is not there.
    fn ego_from_sensor(&self, frame: u32) -> Result<Pose, DatasetError>;

    /// Pose of the sensor in the world at a frame.
    ///
    /// # Errors
    /// The frame is not there.
    fn world_from_sensor(&self, frame: u32) -> Result<Pose, DatasetError>;

    /// Boxes that the data set follows through its frames.
    ///
    /// # Errors
    /// Like [`Self::read`], where boxes are made from points.
    fn tracks(&self) -> Result<Vec<BoxTrack>, DatasetError>;

    /// Sentences about the files: passed over, taken in place of a default, or most likely wrong.
    fn notes(&self) -> &[Note] {
        &[]
    }

    /// Reads the scan and the labels of a frame.
    ///
    /// # Errors
    /// A frame that is not there, files that are cut short or do not fit each other, a coordinate that is
    /// not finite, an unknown label.
    fn read(&self, frame: u32) -> Result<LabelledScan, DatasetError>;
}
