//! Warnings of the OpenDRIVE library as errors, as notes, or passed over.

use std::collections::BTreeMap;
use std::mem::discriminant;

use xodr::Warning;

use crate::error::WorldError;
use sightline_files::Note;

/// How a warning is taken.
enum Taken {
    /// Part of the map would be missing.
    Error,
    /// The map contradicts itself; the library says how it is read.
    Told,
    /// Nothing of a world depends on it: speeds, rules, signals that belong together, versions.
    Passed,
}

fn taken(warning: &Warning) -> Taken {
    use Warning as W;
    match warning {
        W::RoadSkipped { .. }
        | W::GeometryDropped { .. }
        | W::LaneIdUnreadable { .. }
        | W::LaneOnWrongSide { .. }
        | W::LaneIdRepeated { .. }
        | W::LaneDropped { .. }
        | W::LaneSectionDropped { .. }
        | W::RecordDropped { .. }
        | W::RecordValueUnreadable { .. }
        | W::StripDropped { .. }
        | W::UnknownStripMode { .. }
        | W::UnknownTrafficRule { .. }
        | W::UnknownLaneDirection { .. }
        | W::JunctionIdRepeated { .. }
        | W::LaneLinkDropped { .. }
        | W::IncludeDropped { .. }
        | W::TooManyCopies { .. }
        | W::OutlineDropped { .. }
        | W::SkeletonDropped { .. }
        | W::JunctionObjectsDropped { .. }
        | W::ObjectDropped { .. }
        | W::RepeatDropped { .. }
        | W::SignalDropped { .. }
        | W::RoadMarkLineDropped { .. } => Taken::Error,
        W::NewerThanDeclared { .. }
        | W::SpeedLimitDropped { .. }
        | W::SpeedLimitDisagrees { .. }
        | W::AccessDropped { .. }
        | W::VisibilityDropped { .. }
        | W::NeighborDropped { .. }
        | W::PriorityDropped { .. }
        | W::SignalLinkDropped { .. }
        | W::JunctionReferenceDropped { .. }
        | W::UnknownJunctionGroupType { .. }
        | W::CrossPathDropped { .. }
        | W::BoundarySegmentDropped { .. }
        | W::BoundaryNotClosed { .. }
        | W::BoundaryClockwise { .. }
        | W::ElevationGridDropped { .. }
        | W::TransitionDropped { .. }
        | W::RoadSectionDropped { .. }
        | W::RailwayDropped { .. }
        | W::StructureDropped { .. }
        | W::ObjectSurfaceDropped { .. }
        | W::CrgHideIgnored { .. }
        | W::CrgDropped { .. } => Taken::Passed,
        _ => Taken::Told,
    }
}

/// One note for each kind of warning, with the first and the number of all.
///
/// # Errors
/// The first warning of a part that would be missing.
pub(super) fn notes(warnings: &[Warning], file: &str) -> Result<Vec<Note>, WorldError> {
    let mut kinds: BTreeMap<usize, (&Warning, usize)> = BTreeMap::new();
    let mut seen = Vec::new();
    for warning in warnings {
        match taken(warning) {
            Taken::Error => {
                return Err(WorldError::Part { file: file.to_owned(), what: warning.to_string() });
            }
            Taken::Passed => continue,
            Taken::Told => {}
        }
        let kind = discriminant(warning);
        let place = seen.iter().position(|known| *known == kind).unwrap_or_else(|| {
            seen.push(kind);
            seen.len() - 1
        });
        kinds.entry(place).or_insert((warning, 0)).1 += 1;
    }
    let told = |(first, count): &(&Warning, usize)| match count {
        1 => Note::fact(format!("{file}: {first}")),
        _ => Note::fact(format!("{file}: {first}; {} more are of the kind", count - 1)),
    };
    Ok(kinds.values().map(told).collect())
}
