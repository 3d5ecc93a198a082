//! Static transforms of ROS 1 and ROS 2, as `ros2 topic echo /tf_static` prints them.

use serde_json::Value;

use super::angles::of_quaternion;
use super::fields::{Fields, wrong};
use super::frames::{Frame, Frames, Holds};
use super::{RigError, Source};
use sightline_files::json::Place;
use sightline_scene::vehicle::SensorPose;

/// Key of a message's list of transforms.
const LIST: &str = "transforms";
/// Key that a transform has, and nothing else.
const CHILD: &str = "child_frame_id";
/// Keys of a header that are passed over: a static transform holds at all times.
const PASSED_HEADER: [&str; 2] = ["seq", "stamp"];

/// True if a document is a message of transforms, a list of them, or one.
pub(super) fn holds_transforms(document: &Value) -> bool {
    let is_one = |value: &Value| value.get(CHILD).is_some();
    let any = |list: &Value| list.as_array().is_some_and(|list| list.iter().any(is_one));
    is_one(document) || any(document) || document.get(LIST).is_some_and(any)
}

/// Reads the transforms of every document.
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    for document in source.documents()? {
        let top = Place::top(&source.file);
        read_message(&document.value, top, frames).map_err(|error| error.at_line(&document))?;
    }
    Ok(())
}

fn read_message(message: &Value, at: Place, frames: &mut Frames) -> Result<(), RigError> {
    if message.get(CHILD).is_some() {
        return add(transform(message, at)?, frames);
    }
    let (list, at) = if message.is_array() {
        (message, at)
    } else {
        let fields = Fields::of(message, at.clone())?;
        fields.refuse_others(&[LIST], &[])?;
        (fields.value(LIST)?, at.key(LIST))
    };
    let Some(list) = list.as_array() else {
        return Err(wrong(&at, list, "a list of transforms"));
    };
    for (i, value) in list.iter().enumerate() {
        add(transform(value, at.item(i))?, frames)?;
    }
    Ok(())
}

/// Adds a frame; several publishers may send one transform, so the same twice is one.
fn add(frame: Frame, frames: &mut Frames) -> Result<(), RigError> {
    let is_same = |old: &Frame| old.parent == frame.parent && old.pose == frame.pose;
    if frames.get(&frame.name).is_some_and(is_same) { Ok(()) } else { frames.add(frame) }
}

/// A frame of one transform.
fn transform(value: &Value, at: Place) -> Result<Frame, RigError> {
    if value == "..." {
        let wanted = "a transform (`ros2 topic echo --full-length` prints all)";
        return Err(wrong(&at, "...", wanted));
    }
    let fields = Fields::of(value, at.clone())?;
    fields.refuse_others(&["header", CHILD, "transform"], &[])?;
    let (header, transform) = (fields.inner("header")?, fields.inner("transform")?);
    header.refuse_others(&["frame_id"], &PASSED_HEADER)?;
    transform.refuse_others(&["translation", "rotation"], &[])?;
    let pose = pose(&transform.inner("translation")?, &transform.inner("rotation")?)?;
    // Names of ROS 1 may begin with a slash.
    let name = |fields: &Fields, key: &str| {
        fields.text(key).map(|name| name.strip_prefix('/').unwrap_or(name).to_owned())
    };
    let (name, parent) = (name(&fields, CHILD)?, name(&header, "frame_id")?);
    Ok(Frame { name, parent, pose, holds: Holds::Unsaid, at })
}

fn pose(translation: &Fields, rotation: &Fields) -> Result<SensorPose, RigError> {
    translation.refuse_others(&["x", "y", "z"], &[])?;
    rotation.refuse_others(&["x", "y", "z", "w"], &[])?;
    let [x, y, z] = ["x", "y", "z"].map(|key| translation.number(key));
    let [qx, qy, qz, qw] = ["x", "y", "z", "w"].map(|key| rotation.number(key));
    of_quaternion([x?, y?, z?], [qx?, qy?, qz?, qw?], &rotation.at)
}
