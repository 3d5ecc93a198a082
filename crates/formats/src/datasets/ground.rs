//! Checks of a sequence by its labelled road: LiDAR height above the road, and whether the vehicle is upright.

use glam::{DVec3, Vec3};

use super::{DatasetError, LabelledScan, LabelledSequence};
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_scene::scene::Ground;

/// Within this radius of the LiDAR the road tells its height, metres.
pub(super) const NEAR: f64 = 10.0;
/// Fewest points of a road that may contradict a stated height.
const LEAST_POINTS: usize = 10;
/// Scans that are looked at for a road.
const MOST_SCANS: usize = 10;
/// Metres by which a road may lie off the ground of the ego frame: it is not flat, and a car sways.
const OFF: f64 = 0.3;
/// Longest median step between two frames, metres: half a second at 360 km/h.
const LONGEST_STEP: f64 = 50.0;
/// Least share of the vehicle's up axis that points up.
const UPRIGHT: f64 = 0.7;

/// The road near the LiDAR in one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Road {
    /// Its points within [`NEAR`].
    pub points: usize,
    /// Median of their depth below the LiDAR, metres.
    pub depth: f64,
    /// Metres of height that hold the middle four fifths of them.
    pub spread: f64,
}

impl Road {
    /// The road among depths below the LiDAR; `None` of no depth.
    pub fn of(mut depths: Vec<f64>) -> Option<Self> {
        depths.sort_by(f64::total_cmp);
        let share = |share: usize| {
            depths.get((depths.len() * share / 10).min(depths.len().saturating_sub(1)))
        };
        Some(Self {
            points: depths.len(),
            depth: *depths.get(depths.len() / 2)?,
            spread: share(9)? - share(1)?,
        })
    }

    /// True if it has enough points to contradict a stated height.
    pub fn is_sure(&self) -> bool {
        self.points >= LEAST_POINTS
    }
}

/// True if a class is road, which says where the ground is.
pub(super) fn is_road(class: &str) -> bool {
    Ground::of(class) == Some(Ground::Road)
}

/// The road of the first scans that have one, and its frame. `ego_from_sensor` turns points upright.
pub(super) fn road(sequence: &dyn LabelledSequence) -> Result<Option<(u32, Road)>, DatasetError> {
    let classes = sequence.classes();
    for frame in sequence.frames().into_iter().take(MOST_SCANS) {
        let upright = Pose { translation: DVec3::ZERO, ..sequence.ego_from_sensor(frame)? };
        let LabelledScan { points, labels } = sequence.read(frame)?;
        let near = points.iter().zip(&labels).filter_map(|(&point, label)| {
            let at = upright.apply(Vec3::from(point).as_dvec3());
            let is_near =
                is_road(&classes[usize::from(label.class?)]) && maths::hypot(at.x, at.y) <= NEAR;
            is_near.then_some(0.0 - at.z)
        });
        if let Some(road) = Road::of(near.collect()) {
            return Ok(Some((frame, road)));
        }
    }
    Ok(None)
}

/// Doubts about a sequence: a road that lies off the ground, a vehicle that is not upright, poses that move it
/// sideways or by leaps. `option` names the option that gives the LiDAR's height, where there is one.
///
/// # Errors
/// Errors of reading the first scans.
pub(super) fn doubts(
    sequence: &dyn LabelledSequence,
    option: Option<&str>,
) -> Result<Vec<Note>, DatasetError> {
    let name = sequence.name();
    let mut notes = Vec::new();
    if let Some((frame, road)) = road(sequence)?.filter(|(_, road)| road.is_sure()) {
        let height = sequence.ego_from_sensor(frame)?.translation.z;
        if (road.depth - height).abs() > OFF {
            let mend =
                option.map(|option| format!("; {option} gives another height")).unwrap_or_default();
            notes.push(Note::doubt(format!(
                "{name}: the LiDAR stands {height:.2} m above the ground, and the road of frame {frame} lies \
                 {:.2} m below it; {height:.2} m counts{mend}.",
                road.depth
            )));
        }
    }
    let frames = sequence.frames();
    let mut egos = Vec::with_capacity(frames.len());
    for &frame in &frames {
        let ego_from_sensor = sequence.ego_from_sensor(frame)?;
        egos.push(sequence.world_from_sensor(frame)?.compose(&ego_from_sensor.inverse()));
    }
    if let Some(k) = egos.iter().position(|ego| ego.rotation.z_axis.z < UPRIGHT) {
        let tilt = maths::acos(egos[k].rotation.z_axis.z.clamp(-1.0, 1.0)).to_degrees();
        notes.push(Note::doubt(format!(
            "{name}: the vehicle of frame {} leans by {tilt:.0} degrees; check the order of its quaternion (w, x, y, z) \
             or the axes of its pose.",
            frames[k]
        )));
    } else {
        notes.extend(sideways(&name, &egos));
    }
    notes.extend(leaps(&name, &frames, &egos));
    Ok(notes)
}

/// A doubt where the median step of a vehicle from one frame number to the next is longer than any vehicle drives.
fn leaps(name: &str, frames: &[u32], egos: &[Pose]) -> Option<Note> {
    let pairs = egos.windows(2).zip(frames.windows(2));
    let mut steps: Vec<f64> = pairs
        .map(|(ego, frame)| {
            let way = (ego[1].translation - ego[0].translation).length();
            way / f64::from(frame[1].abs_diff(frame[0]).max(1))
        })
        .collect();
    steps.sort_by(f64::total_cmp);
    let step = *steps.get(steps.len() / 2)?;
    let text = format!(
        "{name}: the vehicle moves {step:.0} m from frame to frame; positions are in metres: centimetres, or millimetres?"
    );
    (step > LONGEST_STEP).then(|| Note::doubt(text))
}

/// A doubt where the median way of a vehicle leads sideways.
fn sideways(name: &str, egos: &[Pose]) -> Option<Note> {
    const STEP: f64 = 0.3;
    let mut angles: Vec<f64> = egos
        .windows(2)
        .map(|pair| (pair[0].rotation.x_axis, pair[1].translation - pair[0].translation))
        .filter(|(_, way)| way.truncate().length() > STEP)
        .map(|(ahead, way)| ahead.truncate().angle_to(way.truncate()).to_degrees().abs())
        .collect();
    angles.sort_by(f64::total_cmp);
    let angle = *angles.get(angles.len() / 2)?;
    let text = format!(
        "{name}: the vehicle moves {angle:.0} degrees off its own heading over {} steps; check the unit of the angles and \
         the axes of the poses.",
        angles.len()
    );
    (angles.len() >= 5 && (45.0..=135.0).contains(&angle)).then(|| Note::doubt(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaps_are_told_by_the_frame() {
        let at = |x: f64| Pose { translation: DVec3::new(x, 0.0, 0.0), ..Pose::IDENTITY };
        let egos = [at(0.0), at(100.0), at(200.0)];
        let said = leaps("drive", &[0, 1, 2], &egos).unwrap();
        assert!(
            said.is_doubt() && said.text().contains("moves 100 m from frame to frame"),
            "{said}"
        );
        // Every tenth frame of a drive is no leap, nor is one gap.
        assert_eq!(leaps("drive", &[0, 10, 20], &egos), None);
        assert_eq!(leaps("drive", &[0, 1, 2, 3], &[at(0.0), at(1.0), at(2.0), at(400.0)]), None);
    }
}
