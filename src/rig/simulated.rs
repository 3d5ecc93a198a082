//! `<sensor>` elements of Gazebo: LiDARs whose beams start at the sensor's own pose.

use roxmltree::Node;

use super::frames::{Frame, Frames, Holds};
use super::{BASE_LINK, RigError, known, xml};
use crate::vehicle::SensorPose;

/// Values of `type` that mean a LiDAR, in the versions of Gazebo.
const LIDARS: [&str; 4] = ["ray", "gpu_ray", "lidar", "gpu_lidar"];

/// Whether a `<sensor>` is a LiDAR.
pub(super) fn is_lidar(sensor: Node) -> bool {
    sensor.attribute("type").is_some_and(|kind| LIDARS.contains(&kind))
}

/// Notes a `<sensor>` whose pose is `optical` in the frame `link`. Of a LiDAR named `FRAME-MODEL`, as
/// Velodyne's own description has it, the model is read.
pub(super) fn add_sensor(
    frames: &mut Frames,
    sensor: Node,
    link: &str,
    optical: SensorPose,
    file: &str,
) -> Result<(), RigError> {
    let name = sensor.attribute("name").unwrap_or_default();
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
    frame: &str,
    sensor: Option<&str>,
    height: f64,
    indent: &str,
) -> String {
    let name = sensor.map_or(frame.to_owned(), |sensor| format!("{frame}-{sensor}"));
    format!(
        "{indent}<sensor name=\"{}\" type=\"gpu_lidar\">\n{indent}  <pose>0 0 {height} 0 0 0</pose>\n\
         {indent}</sensor>\n",
        xml::escape(&name)
    )
}
