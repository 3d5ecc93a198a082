//! Maps of a scene seen from above: information with the part that a placement gains, and the LiDARs that see a column.

use std::collections::BTreeMap;
use std::fmt::Write;

use maud::{Markup, html};

use super::drawing::{Flat, outline};
use super::svg::{FAINT, INK, LidarSign, colour, corners, page, px};
use super::view::sight::is_set;
use crate::engine::{Backend, BackendError};
use crate::json::counted;
use crate::problem::{Content, Entropy, Problem, spread};
use crate::psog::{Roi, to_nats};
use crate::search::Scored;
use crate::vehicle::{Constraints, Placement};

/// Cells along the longer side of the map.
const CELLS: u32 = 160;
/// Frames that a map averages over.
const FRAMES: u32 = 4;
/// Pixels of the longer side of the map.
const SIZE: f64 = 640.0;
/// Steps of each of the two colour scales: information, and the share of it that is gained.
const STEPS: u32 = 6;

/// Numbers of LiDARs that are told apart: none, one, two, three and more.
const NUMBERS: [&str; 4] = ["no LiDAR", "1", "2", "3 or more"];
/// Colours of these.
const NUMBER_COLOURS: [&str; 4] = ["#c9cfd6", "#e8a33d", "#5d9bd1", "#174a7c"];

/// Information of a scene seen from above: nats in each column of voxels, the nats that are gained, and the LiDARs that
/// cover a voxel of the column.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InformationMap {
    cells: [u32; 2],
    /// Lower corner and size of the region in metres.
    min: [f64; 2],
    size: [f64; 2],
    /// Σ H of a cell's voxels, in nats.
    total: Vec<f64>,
    /// Σ c(v) H of a cell's voxels, in nats.
    gained: Vec<f64>,
    /// Sum over frames of the LiDARs that cover an occupied voxel of a cell.
    lidars: Vec<u32>,
    /// Frames that were added.
    frames: u32,
    /// Loops around the own body from above, metres.
    body: Vec<Vec<Flat>>,
}

impl InformationMap {
    /// The map of a placement's gain, over a few frames spread evenly.
    pub(crate) fn of(
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
    ) -> Result<Self, BackendError> {
        let (roi, content) = (problem.roi(), problem.content());
        let mut map = Self::new(roi, content);
        let frames = spread(problem.frame_count(), Some(FRAMES));
        for &frame in &frames {
            // Only the occupied voxels: the list of all that are covered is ten times as long.
            let bitmaps = engine.bitmaps(&placement.lidars, frame)?;
            let covered = |words: &[u64], voxel: u32| is_set(words, bitmaps.order.bit_of(voxel));
            let covers = |voxel| bitmaps.sensors().any(|words| covered(words, voxel));
            map.add_frame(roi, content, covers, frames.len());
            for words in bitmaps.sensors() {
                map.add_lidar(roi, content, |voxel| covered(words, voxel));
            }
            map.frames += 1;
        }
        Ok(map)
    }

    /// The map with the outline of the own body, whose triangles are given in the ego frame, metres.
    #[must_use]
    pub(crate) fn with_body(self, body: &[[[f32; 3]; 3]]) -> Self {
        let flat = |[x, y, _]: [f32; 3]| [x, y].map(f64::from);
        let from_above: Vec<_> = body.iter().map(|triangle| triangle.map(flat)).collect();
        Self { body: outline(&from_above), ..self }
    }

    /// Adds a LiDAR to the cells of which it covers an occupied voxel in a frame.
    fn add_lidar(&mut self, roi: &Roi, content: &Content, covers: impl Fn(u32) -> bool) {
        let covered = content.occupied().iter().filter(|voxel| covers(voxel.index));
        let cells = covered.map(|voxel| self.cell_of(roi, u64::from(voxel.index)));
        let mut cells: Vec<usize> = cells.collect();
        cells.sort_unstable();
        cells.dedup();
        cells.into_iter().for_each(|cell| self.lidars[cell] += 1);
    }

    pub(crate) fn new(roi: &Roi, content: &Content) -> Self {
        let (min, max, shape) = (roi.min(), roi.max(), roi.shape());
        let longer = shape[0].max(shape[1]);
        let cells = [0, 1].map(|k| (shape[k] * CELLS.min(longer)).div_ceil(longer).max(1));
        let count = (cells[0] * cells[1]) as usize;
        let mut map = Self {
            cells,
            min: [min[0], min[1]],
            size: [max[0] - min[0], max[1] - min[1]],
            total: vec![0.0; count],
            gained: vec![0.0; count],
            lidars: vec![0; count],
            frames: 0,
            body: Vec::new(),
        };
        for voxel in content.occupied() {
            let cell = map.cell_of(roi, u64::from(voxel.index));
            map.total[cell] += to_nats(u64::from(Entropy::Classes.of(&voxel.entropy)));
        }
        map
    }

    fn cell_of(&self, roi: &Roi, voxel: u64) -> usize {
        let (coords, shape) = (roi.coords(voxel), roi.shape());
        let [i, j] =
            [0, 1].map(|k| u64::from(coords[k]) * u64::from(self.cells[k]) / u64::from(shape[k]));
        (i * u64::from(self.cells[1]) + j) as usize
    }

    /// Adds the voxels covered in one of `frames` frames; `covers` is true for the linear index of a covered voxel.
    pub(crate) fn add_frame(
        &mut self,
        roi: &Roi,
        content: &Content,
        covers: impl Fn(u32) -> bool,
        frames: usize,
    ) {
        for voxel in content.occupied() {
            if covers(voxel.index) {
                let cell = self.cell_of(roi, u64::from(voxel.index));
                self.gained[cell] +=
                    to_nats(u64::from(Entropy::Classes.of(&voxel.entropy))) / frames as f64;
            }
        }
    }

    /// The map as SVG: grey where information is, the redder the more of it is gained; `placement`'s
    /// LiDARs as dots. Forward is to the right, left is up.
    pub(crate) fn svg(&self, placement: &Placement) -> String {
        let most = self.total.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let colour = |i, j| self.colour(i, j, most);
        let rgb = |(information, share)| rgb(information, share);
        self.drawn("Information gained, seen from above", placement, colour, rgb, &self.legend())
    }

    /// The columns that hold information by the number of LiDARs that cover a voxel of them, a mean over frames, rounded.
    pub(crate) fn lidars_svg(&self, placement: &Placement) -> String {
        let number = |i: u32, j: u32| {
            let cell = (i * self.cells[1] + j) as usize;
            let mean = f64::from(self.lidars[cell]) / f64::from(self.frames.max(1));
            (self.total[cell] > 0.0).then_some(mean.round().min(3.0) as usize)
        };
        let legend = html! {
            @for (index, (words, colour)) in NUMBERS.iter().zip(NUMBER_COLOURS).enumerate() {
                rect x=(100 * index) width="14" height="14" fill=(colour) {}
                text x=(100 * index + 20) y="12" { (words) }
            }
            rect x="500" y=".5" width="12" height="13" fill="#fff" stroke=(FAINT) {}
            text x="518" y="12" { "no information" }
            text x="0" y="34" {
                "LiDARs that see a column, mean of " (counted(self.frames as usize, "frame")) ", rounded; "
                (format!("{:.0}", self.size[0])) " m across, forward is right"
            }
        };
        let rgb = |number: usize| NUMBER_COLOURS[number].to_owned();
        self.drawn("Columns by the number of LiDARs that see them", placement, number, rgb, &legend)
    }

    /// Cells in their colours, the LiDARs of a placement as dots, a legend below.
    fn drawn<C: Copy + Ord>(
        &self,
        title: &str,
        placement: &Placement,
        colour: impl Fn(u32, u32) -> Option<C>,
        rgb: impl Fn(C) -> String,
        legend: &Markup,
    ) -> String {
        let scale = SIZE / self.size[0].max(self.size[1]);
        let (width, height) = (self.size[0] * scale, self.size[1] * scale);
        let cell = [width / f64::from(self.cells[0]), height / f64::from(self.cells[1])];
        // Runs of equal colour along x, in cells and grouped by colour to keep the file small.
        let mut runs: BTreeMap<C, String> = BTreeMap::new();
        for j in 0..self.cells[1] {
            let mut i = 0;
            while i < self.cells[0] {
                let (first, of_run) = (i, colour(i, j));
                while i < self.cells[0] && colour(i, j) == of_run {
                    i += 1;
                }
                if let Some(of_run) = of_run {
                    let path = runs.entry(of_run).or_default();
                    let _ = write!(path, "M{first} {j}h{}", i - first);
                }
            }
        }
        // The middle of the lowest row, y up.
        let [wide, high] = cell.map(|side| format!("{side:.4}"));
        let to_pixels =
            format!("translate(0 {}) scale({wide} -{high})", px(height - 0.5 * cell[1]));
        let at = |[x, y]: Flat| ((x - self.min[0]) * scale, height - (y - self.min[1]) * scale);
        let drawing = html! {
            g transform=(to_pixels) stroke-width="1.04" {
                @for (of_run, path) in runs { path d=(path) stroke=(rgb(of_run)) {} }
            }
            @for edge in &self.body {
                polygon points=(corners(edge.iter().map(|corner| at(*corner)))) fill="none" stroke=(INK) {}
            }
            @for (x, y) in placement.lidars.iter().map(|pose| at([pose.x, pose.y])) {
                circle cx=(px(x)) cy=(px(y)) r="3" fill="#1f5fa8" stroke="#fff" {}
            }
            g transform={ "translate(0 " (px(height + 8.0)) ")" } { (legend) }
        };
        page([width.round(), (height + 50.0).round()], title, &drawing)
    }

    fn legend(&self) -> Markup {
        let scales = [("unseen", 0), ("half gained", STEPS / 2), ("gained", STEPS)];
        // Six steps of 12 pixels and 90 for the words.
        let left = |scale: usize| scale as f64 * (12.0 * f64::from(STEPS) + 90.0);
        html! {
            @for (index, (words, share)) in scales.into_iter().enumerate() {
                @for step in 1..=STEPS {
                    rect x=(left(index) + 12.0 * f64::from(step - 1)) width="12" height="14"
                        fill=(rgb(step, share)) {}
                }
                text x=(left(index) + 12.0 * f64::from(STEPS) + 6.0) y="12" { (words) }
            }
            rect x="500" y=".5" width="12" height="13" fill="#fff" stroke=(FAINT) {}
            text x="518" y="12" { "no information" }
            text x="0" y="34" {
                "darker: more nats; " (format!("{:.0}", self.size[0]))
                " m across, forward is right; LiDARs blue, own body outlined"
            }
        }
    }

    /// (information step, gained step) of a cell; `None` where no information is.
    fn colour(&self, i: u32, j: u32, most: f64) -> Option<(u32, u32)> {
        let cell = (i * self.cells[1] + j) as usize;
        let total = self.total[cell];
        if total <= 0.0 {
            return None;
        }
        let steps = f64::from(STEPS);
        let information = ((total / most).sqrt() * steps).ceil().clamp(1.0, steps) as u32;
        let share = (self.gained[cell] / total * steps).round().clamp(0.0, steps) as u32;
        Some((information, share))
    }
}

/// Colour of a cell: grey for unseen to red for gained, darker for more information.
fn rgb(information: u32, share: u32) -> String {
    let depth = 0.25 + 0.75 * f64::from(information) / f64::from(STEPS);
    let share = f64::from(share) / f64::from(STEPS);
    let mix = |grey: f64, red: f64| {
        let full = grey + (red - grey) * share;
        (255.0 - (255.0 - full) * depth).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(120.0, 190.0), mix(135.0, 30.0), mix(150.0, 50.0))
}

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

/// Half of the height of a sign, pixels.
const SIGN: f64 = 9.0;
/// Pixels of a character of a sign.
const SIGN_LETTER: f64 = 7.0;

/// Half of the width of a sign of some LiDARs, pixels.
fn half_width(lidars: &[usize]) -> f64 {
    let letters: usize = lidars.iter().map(|lidar| lidar.to_string().len() + 2).sum();
    SIGN.max(0.5 * SIGN_LETTER * (letters - 2) as f64 + 5.0)
}

/// Signs of LiDARs at some pixels: those behind one another share one, others that would lie on a sign stand beside it.
fn sharing(places: impl Iterator<Item = (f64, f64)>) -> Vec<LidarSign> {
    let lies_on = |other: &LidarSign, sign: &LidarSign| {
        let room = half_width(&other.lidars) + half_width(&sign.lidars);
        (other.label[0] - sign.label[0]).abs() < room
            && (other.label[1] - sign.label[1]).abs() < 2.0 * SIGN
    };
    LidarSign::all(places.map(|(x, y)| [x, y]), 1.0, 0.5 * SIGN, lies_on)
}

/// Path around a box. A flat one, which SVG draws as no rectangle, is a line: a way back would fill gaps between dashes.
fn around(near: (f64, f64), far: (f64, f64)) -> String {
    let (wide, high) = (far.0 - near.0, far.1 - near.1);
    let way = format!("M{} {}h{}v{}", px(near.0), px(near.1), px(wide), px(high));
    if wide.min(high) < 1.0 { way } else { format!("{way}h{}z", px(-wide)) }
}

/// The placement from above and from the right, with the mount's box and the ego body's outline.
///
/// `body` holds the triangles of the ego body in the ego frame, in metres.
pub(crate) fn placement_svg(
    placement: &Scored,
    constraints: &Constraints,
    body: &[[[f32; 3]; 3]],
) -> String {
    let views = ViewScale::new(constraints, body);
    let lidars = &placement.placement.lidars;
    let places = |view: fn(&ViewScale, [f64; 3]) -> (f64, f64)| {
        sharing(lidars.iter().map(|pose| view(&views, [pose.x, pose.y, pose.z])))
    };
    let signs = [places(ViewScale::above), places(ViewScale::aside)].concat();
    // From above a box begins at its left side, from the right at its top.
    let boxes = |[low, high]: [[f64; 3]; 2]| {
        [
            (views.above([low[0], high[1], 0.0]), views.above([high[0], low[1], 0.0])),
            (views.aside([low[0], 0.0, high[2]]), views.aside([high[0], 0.0, low[2]])),
        ]
    };
    let kinds = constraints.kinds();
    let boxes = kinds.iter().flat_map(|(slot, _)| boxes(slot.region.corners()));
    let unit = px(views.scale);
    let drawing = html! {
        @for triangle in body {
            @for view in [ViewScale::above, ViewScale::aside] {
                polygon points=(corners(triangle.map(|c| view(&views, c.map(f64::from))))) fill=(BODY)
                    stroke=(BODY) stroke-width=".5" {}
            }
        }
        @for (near, far) in boxes {
            path d=(around(near, far)) fill="none" stroke=(INK) stroke-dasharray="5 4" {}
        }
        path d={ "M20 " (px(views.ground_y)) "H840" } stroke=(FAINT) {}
        text x="20" y="20" { "from above (forward is right)" }
        text x="20" y=(px(views.above_y + (views.half_y + 0.4) * views.scale)) { "from the right" }
        path d={ "M20 505h" (unit) "m0 -4v8m-" (unit) " 0v-8" } stroke=(INK) fill="none" {}
        text x=(px(28.0 + views.scale)) y="510" { "1 m" }
        rect x=(px(90.0 + views.scale)) y="498" width="22" height="13" fill="none" stroke=(INK) stroke-dasharray="5 4" {}
        text x=(px(118.0 + views.scale)) y="510" { "box around a mount" }
        circle cx=(px(270.0 + views.scale)) cy="505" r="7" fill=(colour(0)) {}
        text x=(px(282.0 + views.scale)) y="510" { "LiDAR by its number" }
        @for sign in signs.iter().filter(|sign| sign.at != sign.label) {
            @let ([x, y], own) = (sign.at, sign.colour());
            path d={ "M" (px(x)) " " (px(y)) "H" (px(sign.label[0])) } stroke=(own) {}
            circle cx=(px(x)) cy=(px(y)) r="2.5" fill=(own) {}
        }
        @for sign in &signs {
            @let ([x, y], half) = (sign.label, half_width(&sign.lidars));
            rect x=(px(x - half)) y=(px(y - SIGN)) width=(px(2.0 * half)) height=(px(2.0 * SIGN)) rx=(SIGN)
                fill=(sign.colour()) {}
            text x=(px(x)) y=(px(y + 4.5)) fill="#fff" text-anchor="middle" font-weight="600" { (sign.words()) }
        }
    };
    page(ALL, "The placement from above and from the right", &drawing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::OccupiedVoxel;
    use crate::psog::fixed;

    #[test]
    fn a_flat_mount_is_one_line() {
        assert_eq!(around((10.0, 20.0), (40.0, 25.0)), "M10.0 20.0h30.0v5.0h-30.0z");
        assert_eq!(around((10.0, 20.0), (40.0, 20.0)), "M10.0 20.0h30.0v0.0");
    }

    #[test]
    fn gained_nats_fall_into_their_cells() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 2, 3]).unwrap();
        let occupied =
            [0, 1, 13].map(|index| OccupiedVoxel { index, entropy: [fixed(0.5), 0, 0, 0] });
        let content = Content::new(vec!["a".into()], occupied.to_vec(), &[vec![]], false);
        let mut map = InformationMap::new(&roi, &content);
        // Voxels 0 and 1 share the column (0, 0); voxel 13 is (2, 0, 1).
        map.add_frame(&roi, &content, |voxel| [1, 2, 13].contains(&voxel), 2);
        assert_eq!(map.cells, [4, 2]);
        assert_eq!(map.total, [1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0]);
        assert_eq!(map.gained, [0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0]);
        let svg = map.svg(&Placement { name: "x".into(), lidars: vec![] });
        assert_eq!(svg.matches("<path").count(), 2, "{svg}");
        assert!(svg.contains(">no information<") && !svg.contains("<polygon"), "{svg}");
        // A body of 2 × 1 m: 160 pixels a metre, y up from 320.
        let [low, high] = [[1.0, 0.5, 0.0], [3.0, 1.5, 0.0]];
        let far = [high[0], low[1], 0.0];
        let body = [[low, far, high], [low, high, [low[0], high[1], 0.0]]];
        let svg = map.with_body(&body).svg(&Placement { name: "x".into(), lidars: vec![] });
        let points = svg.split_once("<polygon points=\"").unwrap().1.split_once('"').unwrap().0;
        let numbers = points.split([' ', ',']).map(|number| number.parse::<f64>().unwrap());
        let mut numbers: Vec<i32> = numbers.map(|number| number.round() as i32).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, [80, 80, 160, 160, 240, 240, 480, 480], "{points}");
    }

    #[test]
    fn lidars_behind_one_another_share_a_sign_and_no_sign_lies_on_another() {
        let places = [(10.0, 10.0), (12.0, 11.0), (10.4, 9.8), (300.0, 10.0), (22.0, 20.0)];
        let signs = sharing(places.into_iter());
        let lidars: Vec<&[usize]> = signs.iter().map(|sign| &sign.lidars[..]).collect();
        assert_eq!(lidars, [&[0, 2][..], &[1], &[3], &[4]]);
        assert_eq!((signs[2].label, signs[2].at), ([300.0, 10.0], [300.0, 10.0]));
        for (k, a) in signs.iter().enumerate() {
            for b in &signs[..k] {
                // Widths by hand: `0, 2` takes four letters of 7 pixels and 10 more, one number 18.
                let wide = |sign: &LidarSign| if sign.lidars.len() == 2 { 19.0 } else { 9.0 };
                let apart = (a.label[0] - b.label[0]).abs() >= wide(a) + wide(b);
                let (a, b) = (a.label, b.label);
                assert!(apart || (a[1] - b[1]).abs() >= 18.0, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn sixteen_lidars_have_sixteen_colours() {
        let mut colours: Vec<&str> = (0..16).map(colour).collect();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), 16);
    }
}
