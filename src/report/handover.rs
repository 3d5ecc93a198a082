//! The drawing of a rig for others: from above, from the right and from the front at one scale, with mounts, fields of
//! view and the blind zone on the ground.
//!
//! | file | holds |
//! |---|---|
//! | `draw` | a view on the sheet, with its measures, and the legend |
//! | `fans` | fields of view as areas |
//! | `labels` | places of words and numbers, so that none lies over another |

mod draw;
mod fans;
mod labels;

use glam::DVec3;

use self::fans::{cut, horizontal, is_on_its_side, numbered, vertical};
use super::drawing::{Drawing, Flat, Point, outline};
use crate::geom::Pose;
use crate::near_field::{Footprint, NearField};
use crate::shared::FieldOfView;
use crate::vehicle::SensorPose;

pub(crate) struct DrawnLidar {
    pub pose: SensorPose,
    /// The pose after a turn by the phase.
    pub ego_from_sensor: Pose,
    pub view: FieldOfView,
    /// Words for its model and its mount; may be empty.
    pub model: String,
    pub mount: String,
}

/// A box around a mount, in the ego frame, metres.
pub(crate) struct DrawnMount {
    /// May be empty.
    pub name: String,
    pub corners: [[f64; 3]; 2],
}

/// A rig with all that its drawing shows.
pub(crate) struct DrawnRig<'a> {
    /// Names of vehicle and placement.
    pub vehicle: &'a str,
    pub placement: &'a str,
    /// Triangles of the own body in the ego frame, metres.
    pub body: &'a [[[f32; 3]; 3]],
    pub lidars: Vec<DrawnLidar>,
    pub mounts: Vec<DrawnMount>,
    /// Outline on the ground and blind zone; or a sentence that says why there is none.
    pub near: Result<(&'a Footprint, &'a NearField), String>,
    /// Lines of the title block: tolerance, origin of the placement.
    pub about: Vec<String>,
    /// Requirements that it misses, in words, or why they were not looked at.
    pub warnings: Vec<String>,
}

impl DrawnRig<'_> {
    /// The drawing on a sheet of A3, across.
    pub(crate) fn drawing(&self) -> Drawing {
        let views = Views::of(self);
        let sheet = Sheet::of(&views, |room| {
            self.lidars.len() + self.about.len() + draw::warnings(self, room).len()
        });
        let Self { vehicle, placement, .. } = self;
        let title = "LiDARs from above, from the right and from the front";
        let mut drawing = Drawing::new(A3, &format!("{vehicle}, {placement}: {title}"));
        draw::top(&mut drawing, self, &views, &sheet);
        draw::side(&mut drawing, self, &views, &sheet);
        draw::front(&mut drawing, self, &views, &sheet);
        draw::scale_bar(&mut drawing, &sheet);
        draw::draw(&mut drawing, self, &sheet);
        drawing
    }
}

/// A3 across, millimetres.
const A3: [f64; 2] = [420.0, 297.0];
/// Millimetres at the sheet's edges.
const EDGE: f64 = 10.0;
/// Millimetres over each row of views, for its titles, and below, for measures.
const OVER: f64 = 7.0;
const BELOW: f64 = 11.0;
/// Millimetres between two views of a row, for a measure.
const BETWEEN: f64 = 14.0;
/// Least width of the legend.
const LEGEND: f64 = 135.0;
/// Height of the scale bar with its numbers.
const BAR: f64 = 8.0;
/// Millimetres on the vehicle that one on the sheet stands for.
const SCALES: [f64; 13] =
    [5.0, 10.0, 20.0, 25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 500.0, 1000.0, 2000.0];

/// A view on the sheet.
#[derive(Clone, Copy)]
struct Panel {
    /// Metres at the panel's left and lower edge.
    low: Flat,
    /// Metres at its right and upper edge.
    high: Flat,
    /// Its lower left corner on the sheet.
    corner: Point,
    /// Millimetres a metre.
    pub scale: f64,
}

impl Panel {
    /// Place on the sheet of metres to the right and upwards.
    pub(crate) fn at(&self, [right, up]: Flat) -> Point {
        [
            self.corner[0] + (right - self.low[0]) * self.scale,
            self.corner[1] - (up - self.low[1]) * self.scale,
        ]
    }

    pub(crate) fn all(&self, points: &[Flat]) -> Vec<Point> {
        points.iter().map(|point| self.at(*point)).collect()
    }

    /// Left, right, upper and lower edge on the sheet.
    pub(crate) fn edges(&self) -> [f64; 4] {
        let ([left, lower], [right, upper]) = (self.at(self.low), self.at(self.high));
        [left, right, upper, lower]
    }
}

struct Sheet {
    /// One millimetre on the sheet stands for as many.
    pub one_to: f64,
    pub top: Panel,
    pub side: Panel,
    pub front: Panel,
    /// Upper left corner of the legend.
    pub legend: Point,
    /// Width of the legend, millimetres.
    pub room: f64,
    /// Left end of the scale bar.
    pub bar: Point,
}

/// Height of a legend with so many lines of LiDARs and of the title block.
fn legend_height(lines: usize) -> f64 {
    84.0 + 4.2 * lines as f64
}

fn size(view: &View) -> [f64; 2] {
    [0, 1].map(|k| view.high[k] - view.low[k])
}

impl Sheet {
    /// `lines` is the number of lines of LiDARs and of the title block in a legend of so many millimetres of width.
    pub(crate) fn of(views: &Views, lines: impl Fn(f64) -> usize) -> Self {
        let [top, side, front] = [&views.top, &views.side, &views.front].map(size);
        let room = |scale: f64| A3[0] - 2.0 * EDGE - BETWEEN - scale * top[0];
        let legend = |scale: f64| legend_height(lines(room(scale).max(LEGEND)));
        let free =
            [A3[0] - 2.0 * EDGE - BETWEEN, A3[1] - 2.0 * EDGE - 2.0 * OVER - 2.0 * BELOW - BAR];
        let fits = |one_to: f64| {
            let scale = 1000.0 / one_to;
            let width = scale * top[0] + (scale * front[0]).max(LEGEND);
            let height = (scale * top[1]).max(legend(scale)) + scale * side[1];
            width <= free[0] && height <= free[1]
        };
        let usual = SCALES.into_iter().find(|one_to| fits(*one_to));
        let larger =
            || (1..).map(|k| 5000.0 * f64::from(k)).take(10_000).find(|one_to| fits(*one_to));
        let one_to = usual.or_else(larger).unwrap_or(5e7);
        let scale = 1000.0 / one_to;
        let panel =
            |&View { low, high, .. }: &View, corner: Point| Panel { low, high, corner, scale };
        let first = EDGE + OVER + (scale * top[1]).max(legend(scale));
        let second = first + BELOW + OVER + scale * side[1];
        let right = EDGE + scale * top[0] + BETWEEN;
        Self {
            one_to,
            top: panel(&views.top, [EDGE, EDGE + OVER + scale * top[1]]),
            side: panel(&views.side, [EDGE, second]),
            front: panel(&views.front, [right, second]),
            legend: [right, EDGE],
            room: room(scale).max(LEGEND),
            bar: [EDGE, second + BELOW + BAR],
        }
    }
}

/// Metres from the body that the blind zone is drawn to.
const DRAWN: f64 = 5.0;
/// Metres around everything in a view.
const AROUND: f64 = 0.3;

/// Corners of the fields of view of a LiDAR, each with its number.
type Fans<'a> = &'a dyn Fn(usize, &DrawnLidar) -> Vec<(usize, Vec<DVec3>)>;

struct View {
    /// Metres to the right and upwards of a point of the ego frame.
    pub flat: fn(DVec3) -> Flat,
    /// Outline of the body, holes among its loops.
    pub outline: Vec<Vec<Flat>>,
    /// Fields of view: number of the LiDAR and the corners around it.
    pub fans: Vec<(usize, Vec<Flat>)>,
    /// Corners of the box around everything.
    pub low: Flat,
    pub high: Flat,
}

/// All views, and the blind zone as far as it is drawn.
struct Views {
    pub top: View,
    pub side: View,
    pub front: View,
    /// Corners of its outline; true where the line to the next one cuts a lane that goes on.
    pub zone: Vec<(Flat, bool)>,
    /// Corners of the box around the body, in which ground is not judged: a hole in the zone.
    pub around_body: Vec<Flat>,
}

/// Ahead is to the right, left is up.
fn above(point: DVec3) -> Flat {
    [point.x, point.y]
}

/// From the right side: ahead is to the right.
fn aside(point: DVec3) -> Flat {
    [point.x, point.z]
}

/// From ahead: the vehicle's left is to the right.
fn ahead(point: DVec3) -> Flat {
    [point.y, point.z]
}

impl Views {
    pub(crate) fn of(rig: &DrawnRig<'_>) -> Self {
        let (zone, around_body) = match &rig.near {
            Ok((footprint, near)) => {
                let [[back, right], [front, left]] = footprint.bounds();
                let corners = vec![[back, right], [front, right], [front, left], [back, left]];
                (near.zone.outline(footprint, DRAWN), corners)
            }
            Err(_) => (Vec::new(), Vec::new()),
        };
        let corners = zone.iter().map(|(corner, _)| *corner).chain([[0.0; 2]]);
        let corners: Vec<Flat> = corners.collect();
        let level = |k: usize, lidar: &DrawnLidar| match is_on_its_side(lidar) {
            true => numbered(k, cut(lidar, [DVec3::X, DVec3::Y])),
            false => vec![(k, horizontal(lidar))],
        };
        let upright = |axis: DVec3| {
            move |k: usize, lidar: &DrawnLidar| match is_on_its_side(lidar) {
                true => numbered(k, cut(lidar, [axis, DVec3::Z])),
                false => {
                    let both = [axis, -axis].into_iter();
                    numbered(k, both.filter_map(|towards| vertical(lidar, towards)).collect())
                }
            }
        };
        let mut views = Self {
            top: View::of(rig, above, &level, &corners),
            side: View::of(rig, aside, &upright(DVec3::X), &[[0.0; 2]]),
            front: View::of(rig, ahead, &upright(DVec3::Y), &[[0.0; 2]]),
            zone,
            around_body,
        };
        // The legend begins a gap to the right of the view, which has room for the arrow's name alone.
        views.top.high[0] = views.top.high[0].max(draw::arrow_end(&views.top.outline));
        // The views from above and from the right stand one over the other, those upright side by side.
        let side = &mut views.side;
        for (other, k) in [(&mut views.top, 0), (&mut views.front, 1)] {
            let (low, high) = (side.low[k].min(other.low[k]), side.high[k].max(other.high[k]));
            (side.low[k], other.low[k]) = (low, low);
            (side.high[k], other.high[k]) = (high, high);
        }
        views
    }
}

impl View {
    fn of(rig: &DrawnRig<'_>, flat: fn(DVec3) -> Flat, fans: Fans<'_>, more: &[Flat]) -> Self {
        let corner = |corner: [f32; 3]| flat(DVec3::from(corner.map(f64::from)));
        let body: Vec<[Flat; 3]> = rig.body.iter().map(|t| t.map(corner)).collect();
        let fans = rig.lidars.iter().enumerate().flat_map(|(k, lidar)| fans(k, lidar));
        let fans: Vec<(usize, Vec<Flat>)> =
            fans.map(|(k, fan)| (k, fan.into_iter().map(flat).collect())).collect();
        let outline = outline(&body);
        let mounts = rig.mounts.iter().flat_map(|mount| mount.corners);
        let lines = outline.iter().chain(fans.iter().map(|(_, fan)| fan)).flatten();
        let lidars = rig.lidars.iter().map(|lidar| lidar.ego_from_sensor.translation);
        let places = mounts.map(DVec3::from).chain(lidars).map(flat);
        let points = lines.chain(more).copied().chain(places);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for k in 0..2 {
                low[k] = low[k].min(point[k] - AROUND);
                high[k] = high[k].max(point[k] + AROUND);
            }
        }
        Self { flat, outline, fans, low, high }
    }
}

#[cfg(test)]
mod tests {
    use super::draw::broken;

    #[test]
    fn long_warnings_are_broken_between_words_and_told_to_their_end() {
        let words = "NOT MET: car from 10 to 80 m, any one LiDAR lost: 1.6 % seen, 95.0 % required";
        assert_eq!(broken(words, 200), [words]);
        let lines = broken(words, 40);
        assert!(
            lines.len() == 3 && lines.iter().all(|line| line.chars().count() <= 40),
            "{lines:?}"
        );
        let told: Vec<&str> = lines.iter().flat_map(|line| line.split_whitespace()).collect();
        assert_eq!(told.join(" "), words);
    }
}
