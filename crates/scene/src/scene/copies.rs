//! Where the copies of a shape stand.

use glam::DVec3;

use super::description::ShapeDescription;
use lidar_cast::geom::Pose;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};

const MAX_COPIES: u64 = 100_000;

/// Poses of the copies of a shape; without `at` and `repeat` one copy in place.
pub(super) fn copies(at: &Place, shape: &ShapeDescription) -> Result<Vec<Pose>, DescriptionError> {
    match (&shape.at, &shape.repeat) {
        (None, None) => Ok(vec![Pose::IDENTITY]),
        (Some(_), Some(_)) => Err(DescriptionError::Misplaced {
            at: Box::new(at.clone()),
            key: "repeat",
            mend: "`at` already says where the copies stand; keep one of the two".to_owned(),
        }),
        (Some(list), None) => {
            let at = at.key("at");
            if list.is_empty() || list.len() as u64 > MAX_COPIES {
                let wanted = format!("1 to {MAX_COPIES} positions");
                return Err(bad(&at, format!("a list of {}", list.len()), wanted));
            }
            list.iter()
                .enumerate()
                .map(|(i, p)| {
                    let here = at.item(i);
                    let (xyz, yaw) = match **p {
                        [x, y, z, yaw] => ([x, y, z], check::radians(&here.item(3), yaw)?),
                        [x, y, z] => ([x, y, z], 0.0),
                        [x, y] => ([x, y, 0.0], 0.0),
                        _ => {
                            let value = format!("a list of {} numbers", p.len());
                            return Err(bad(&here, value, "[x, y], [x, y, z] or [x, y, z, yaw]"));
                        }
                    };
                    Ok(Pose::new(check::point(&here, xyz)?.into(), 0.0, 0.0, yaw))
                })
                .collect()
        }
        (None, Some(repeat)) => {
            let at = at.key("repeat");
            let count = check::count(&at.key("count"), repeat.count, 1, MAX_COPIES)?;
            let step = DVec3::from(check::point(&at.key("step"), repeat.step)?);
            let far = (step * f64::from(count)).abs().max_element();
            check::metres(&at.key("step"), far)?;
            let nth = |i| Pose { translation: step * f64::from(i), ..Pose::IDENTITY };
            Ok((0..count).map(nth).collect())
        }
    }
}
