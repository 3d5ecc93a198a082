//! Formats told apart by name or content.

use std::str::FromStr;

use serde_json::Value;

use super::{RigError, RigFormat, Source, autoware, pandaset, tf, xml};

/// The format of a text.
///
/// # Errors
/// XML that does not parse, or a text of no format.
pub(super) fn format_of(source: &Source) -> Result<RigFormat, RigError> {
    let text = source.text.as_str();
    refuse_program(source)?;
    let unrecognised = || RigError::Unrecognised { file: source.file.clone() };
    if text.trim_start().starts_with('<') {
        let document = xml::parse(text, &source.file)?;
        return match document.root_element().tag_name().name() {
            "robot" => Ok(RigFormat::Urdf),
            "sdf" => Ok(RigFormat::Sdf),
            "launch" => Ok(RigFormat::Ros2Launch),
            _ => Err(unrecognised()),
        };
    }
    // From the rarest word to the commonest.
    let words = [
        ("\"spawn_point\"", RigFormat::CarlaObjects),
        ("\"lidars\"", RigFormat::Json),
        ("sensor.lidar.", RigFormat::Carla),
    ];
    if let Some((_, format)) = words.into_iter().find(|(word, _)| text.contains(word)) {
        return Ok(format);
    }
    // A text with keys is YAML, and its fault says more than the list of formats.
    let is_yaml =
        source.file.ends_with(".yaml") || source.file.ends_with(".yml") || text.contains(": ");
    let parsed = source.documents();
    let documents = parsed.map_err(|fault| if is_yaml { fault } else { unrecognised() })?;
    let is = |of: fn(&Value) -> bool| documents.iter().any(|document| of(&document.value));
    type Fits = fn(&Value) -> bool;
    let kinds: [(Fits, RigFormat); 3] = [
        (tf::holds_transforms, RigFormat::Tf),
        (pandaset::is_pandaset, RigFormat::Pandaset),
        (autoware::holds_frames, RigFormat::Autoware),
    ];
    kinds.into_iter().find(|(of, _)| is(*of)).map(|(_, format)| format).ok_or_else(unrecognised)
}

/// Refuses program source: only running it tells its sensors.
///
/// # Errors
/// A file named as a Python program, or with lines that begin like Python's.
pub(super) fn refuse_program(source: &Source) -> Result<(), RigError> {
    let named = source.file.ends_with(".py");
    let starts = ["import ", "from ", "def ", "class ", "#!/usr/bin/env python", "@"];
    let begins = |line: &str| starts.iter().any(|start| line.starts_with(start));
    let is_markup = source.text.trim_start().starts_with(['<', '{', '[']);
    if named || (!is_markup && source.text.lines().any(begins)) {
        return Err(RigError::Program { file: source.file.clone() });
    }
    Ok(())
}

impl FromStr for RigFormat {
    type Err = RigError;

    fn from_str(text: &str) -> Result<Self, RigError> {
        let found = Self::ALL.into_iter().find(|format| format.name() == text);
        found.ok_or_else(|| RigError::UnknownFormat { name: text.to_owned() })
    }
}
