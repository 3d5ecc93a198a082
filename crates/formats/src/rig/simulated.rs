//! `<sensor>` elements of Gazebo: LiDARs whose beams start at the sensor's own pose.

use roxmltree::Node;

use super::fields::{PHASE, number};
use super::frames::{Frame, Frames, Holds};
use super::{BASE_LINK, Models, Rig, RigError, RigLidar, known, xml};
use sightline_files::json::written;
use sightline_scene::vehicle::SensorPose;

/// Values of `type` that mean a LiDAR, in the versions of Gazebo.
const LIDARS: [&str; 4] = ["ray", "gpu_ray", "lidar", "gpu_lidar"];

/// Namespace of attributes that other programs pass over, and the prefix of it that is written.
const OWN: &str = "urn:sightline";
const PREFIX: &str = "sightline";

/// True if a `<sensor>` is a LiDAR.
pub(super) fn is_lidar(sensor: Node) -> bool {
    sensor.attribute("type").is_some_and(|kind| LIDARS.contains(&kind))
}

/// Adds a LiDAR for a `<sensor>` whose pose in the frame `link` is `optical`. Reads its model from a name
/// `FRAME-MODEL`, as in Velodyne's description, and its phase from this program's own attribute.
pub(super) fn add_sensor(
    frames: &mut Frames,
    sensor: Node,
    link: &str,
    optical: SensorPose,
    file: &str,
) -> Result<(), RigError> {
    let name = sensor.attribute("name").unwrap_or_default();
    let phase = sensor.attribute((OWN, PHASE));
    let place = || xml::place(sensor, file).key(PHASE);
    let phase = phase.map(|text| number(&place(), text)).transpose()?;
    let optical = SensorPose { phase, ..optical };
    let holds = if is_lidar(sensor) {
        let model = name.strip_prefix(link).and_then(|rest| rest.strip_prefix('-'));
        let model = model.filter(|model| !model.is_empty()).map(known::usual);
        Holds::Lidar { sensor: model, optical: Some(optical) }
    } else {
        Holds::Other
    };
    match frames.get_mut(link) {
        Some(frame) if link != BASE_LINK && !matches!(frame.holds, Holds::Lidar { .. }) => {
            frame.holds = holds;
        }
        // A second LiDAR of a link, or one of the base itself, has a frame of its own.
        _ if is_lidar(sensor) => frames.add(Frame {
            name: format!("{link}/{name}"),
            parent: link.to_owned(),
            pose: super::angles::IDENTITY,
            holds,
            at: xml::place(sensor, file),
        })?,
        _ => {}
    }
    Ok(())
}

/// The element that [`add_sensor`] reads, for a LiDAR `height` metres above its foot.
pub(super) fn sensor_element(
    lidar: &RigLidar,
    height: f64,
    models: &Models,
    indent: &str,
) -> String {
    let RigLidar { frame, sensor, pose } = lidar;
    let name = sensor.as_ref().map_or(frame.clone(), |sensor| format!("{frame}-{sensor}"));
    let phase = pose
        .phase
        .map(|phase| format!(" {PREFIX}:{PHASE}=\"{}\"", written(phase)))
        .unwrap_or_default();
    format!(
        "{indent}<sensor name=\"{}\" type=\"gpu_lidar\"{phase}>\n{indent}  <pose>0 0 {} 0 0 0</pose>\n{}\
         {indent}</sensor>\n",
        xml::escape(&name),
        written(height),
        models.gazebo(lidar, &format!("{indent}  "))
    )
}

/// Declaration of the XML namespace for phases; empty if no LiDAR of the rig has one.
pub(super) fn namespace(rig: &Rig) -> String {
    let phased = rig.lidars.iter().any(|lidar| lidar.pose.phase.is_some());
    if phased { format!(" xmlns:{PREFIX}=\"{OWN}\"") } else { String::new() }
}
