//! Crop boxes of the own body in the parameters of Autoware's `crop_box_filter`.

use std::fmt::Write;

use super::rig::HandoverRig;

/// Lower and upper corner, metres.
type Corners = [[f64; 3]; 2];

/// A node for the box around the whole body, and where the body has several shapes one for each: a ROS 2 parameter file.
/// Boxes reach `margin` metres beyond the body and count from `base_link`, whose position in the ego frame is given.
/// `None` without a body.
pub(super) fn boxes(rig: &HandoverRig, margin: f64, base_link: [f64; 3]) -> Option<String> {
    let around = |triangles: &[[[f32; 3]; 3]]| {
        let corners = triangles.iter().flatten().map(|corner| corner.map(f64::from));
        let each = corners.map(|corner| [corner, corner]);
        let all = each.reduce(|[low, high]: Corners, [corner, _]| {
            [[0, 1, 2].map(|k| low[k].min(corner[k])), [0, 1, 2].map(|k| high[k].max(corner[k]))]
        })?;
        Some(grown(all, margin, base_link))
    };
    let body = around(&rig.body)?;
    let mut text = format!(
        "# Crop boxes of the own body of {}, placement {}, for Autoware's crop_box_filter: one node a box.\n\
         # Metres in base_link, which stands at {base_link:?} in the frame of poses.csv; margin {margin} m.\n\
         # negative: true removes the points inside of the box.\n\
         # A cloud that is not in base_link yet: name its frame in input_pointcloud_frame.\n",
        word(rig.vehicle_name()),
        word(&rig.placement.name)
    );
    node(&mut text, "crop_box_filter_self", &body);
    let shapes = rig.scene().body_shapes();
    if shapes.len() > 1 {
        text += "\n# The same body shape by shape: these nodes one after the other, in place of the one above, leave more\n\
                 # of what is near.\n";
        let shapes = shapes.into_iter().map(|shape| around(&rig.body[shape]));
        for (k, shape) in shapes.enumerate() {
            if let Some(corners) = shape {
                node(&mut text, &format!("crop_box_filter_self_{k}"), &corners);
            }
        }
    }
    Some(text)
}

/// A name that cannot end its line.
fn word(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// A box with a margin around it, counted from elsewhere; corners are rounded outwards to millimetres.
fn grown([low, high]: Corners, margin: f64, base_link: [f64; 3]) -> Corners {
    // A millimetre that rounding alone makes is none.
    let out = |value: f64| (1000.0 * value - 1e-4).ceil() / 1000.0;
    [0, 1, 2]
        .map(|k| [-out(-(low[k] - margin - base_link[k])), out(high[k] + margin - base_link[k])])
        .into_iter()
        .enumerate()
        .fold([[0.0; 3]; 2], |[mut lower, mut upper], (k, [from, to])| {
            (lower[k], upper[k]) = (from, to);
            [lower, upper]
        })
}

fn node(text: &mut String, name: &str, [low, high]: &Corners) {
    let _ = write!(
        text,
        "/**/{name}:\n  ros__parameters:\n    input_pointcloud_frame: base_link\n    input_frame: base_link\n    \
         output_frame: base_link\n"
    );
    for (side, corner) in [("min", low), ("max", high)] {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(corner) {
            // ROS tells a number with a point from a whole one, and wants the former.
            let _ = writeln!(text, "    {side}_{axis}: {:.3}", value + 0.0);
        }
    }
    text.push_str("    negative: true\n");
}
