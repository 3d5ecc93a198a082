//! Drawing of a placement on its vehicle.

use maud::html;

use super::svg::{COLOURS, FAINT, INK, corners, page, px};
use crate::search::Scored;
use crate::vehicle::Constraints;

/// Pixels of the whole.
const ALL: [f64; 2] = [860.0, 520.0];
const BODY: &str = "#e4eaf0";

/// Metres to pixels in the two views; forward is to the right in both.
struct ViewScale {
    scale: f64,
    centre_x: f64,
    /// Pixel of y = 0 from above, of z = 0 from the right.
    above_y: f64,
    ground_y: f64,
    half_y: f64,
}

impl ViewScale {
    /// Views that show the mount and the vehicle near it.
    fn new(constraints: &Constraints, body: &[[[f32; 3]; 3]]) -> Self {
        let [low, high] = constraints.corners();
        // Half a car beyond the mount is enough to see where things are.
        let reach = |k: usize| {
            let mount = low[k].abs().max(high[k].abs());
            let corners = body.iter().flatten().map(|corner| f64::from(corner[k].abs()) + 0.1);
            corners.fold(mount + 0.4, f64::max).min(mount + 6.0)
        };
        let (half_x, half_y) = (reach(0), reach(1));
        let top = high[2] + 0.4;
        let scale = (800.0 / (2.0 * half_x)).min(460.0 / (2.0 * half_y + top + 0.6));
        let above_y = 30.0 + half_y * scale;
        let ground_y = above_y + (half_y + 0.5 + top) * scale;
        Self { scale, centre_x: ALL[0] / 2.0, above_y, ground_y, half_y }
    }

    fn above(&self, [x, y, _]: [f64; 3]) -> (f64, f64) {
        (self.centre_x + x * self.scale, self.above_y - y * self.scale)
    }

    fn aside(&self, [x, _, z]: [f64; 3]) -> (f64, f64) {
        (self.centre_x + x * self.scale, self.ground_y - z * self.scale)
    }
}

/// The placement from above and from the right, with the mount's box and the ego body's outline.
///
/// `body` holds the triangles of the ego body in the ego frame, in metres.
pub fn placement_svg(
    placement: &Scored,
    constraints: &Constraints,
    body: &[[[f32; 3]; 3]],
) -> String {
    let views = ViewScale::new(constraints, body);
    let both = |point: [f64; 3]| [views.above(point), views.aside(point)];
    // From above a box begins at its left side, from the right at its top.
    let boxes: Vec<_> = constraints
        .kinds()
        .iter()
        .flat_map(|(slot, _)| {
            let [low, high] = slot.region.corners();
            [
                (views.above([low[0], high[1], 0.0]), views.above([high[0], low[1], 0.0])),
                (views.aside([low[0], 0.0, high[2]]), views.aside([high[0], 0.0, low[2]])),
            ]
        })
        .collect();
    let unit = px(views.scale);
    let drawing = html! {
        @for triangle in body {
            @for view in [ViewScale::above, ViewScale::aside] {
                polygon points=(corners(triangle.map(|c| view(&views, c.map(f64::from))))) fill=(BODY)
                    stroke=(BODY) stroke-width=".5" {}
            }
        }
        @for (near, far) in boxes {
            rect x=(px(near.0)) y=(px(near.1)) width=(px(far.0 - near.0)) height=(px(far.1 - near.1))
                fill="none" stroke=(INK) stroke-dasharray="5 4" {}
        }
        path d={ "M20 " (px(views.ground_y)) "H840" } stroke=(FAINT) {}
        text x="20" y="20" { "from above (forward is right)" }
        text x="20" y=(px(views.above_y + (views.half_y + 0.4) * views.scale)) { "from the right" }
        path d={ "M20 505h" (unit) "m0 -4v8m-" (unit) " 0v-8" } stroke=(INK) fill="none" {}
        text x=(px(28.0 + views.scale)) y="510" { "1 m" }
        @for (index, pose) in placement.placement.lidars.iter().enumerate() {
            @for (x, y) in both([pose.x, pose.y, pose.z]) {
                circle cx=(px(x)) cy=(px(y)) r="9" fill=(COLOURS[index % COLOURS.len()]) {}
                text x=(px(x)) y=(px(y + 4.5)) fill="#fff" text-anchor="middle" font-weight="600" {
                    (index)
                }
            }
        }
    };
    page(ALL, "The placement from above and from the right", &drawing)
}
