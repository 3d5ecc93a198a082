//! A curved surface that sensors stand on: triangles as heights over a plane of their own.

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};

use lidar_cast::geom::Pose;
use lidar_cast::maths;

/// Most cells of the lookup grid along one axis.
const MOST_CELLS: f64 = 128.0;
/// Most cells that a triangle touches, on average.
const MOST_TOUCHED: usize = 32;
/// Share of a triangle by which a point may lie beside it and still counts as on it.
const ON_EDGE: f64 = 1e-9;

/// Triangles over the plane of two axes of a region; each point has one height along the third axis.
///
/// Where triangles lie one above the other, the outermost counts. A point over none of them is moved to the
/// nearest one that is, so that every point of the plane has a foot on the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Fields of a pose that count along the plane: 0 and 1 on a roof, 1 and 2 on a side.
    pub(super) axes: [usize; 2],
    facets: Vec<Facet>,
    /// Numbers of the facets that touch each cell, in rows.
    cells: Vec<Vec<u32>>,
    /// Cells along both axes.
    count: [usize; 2],
    /// The plane's lower corner, and the size of a cell.
    low: DVec2,
    size: DVec2,
    pub(super) image: Image,
}

/// Which surface is seen in a mirror at the plane y = 0, where pairs stand on it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Image {
    /// None that is known.
    None,
    /// Symmetric: the surface itself.
    Itself,
    /// Another one, which it was made of.
    Of(Arc<Surface>),
}

// Total equality, since no number of a surface is NaN. It lets pointers to one surface be compared first.
impl Eq for Surface {}

/// A triangle of a surface, in the region's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Facet {
    pub corners: [DVec3; 3],
    /// Outward normals at the corners.
    pub normals: [DVec3; 3],
}

/// Where a sensor stands on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Foot {
    /// Position in the region's frame.
    pub point: DVec3,
    /// Outward unit normal there, in the region's frame.
    pub normal: DVec3,
    /// Metres in the plane from the requested point; 0 over a triangle.
    pub off: f64,
}

impl Facet {
    /// Point and normal at barycentric coordinates.
    fn at(&self, weights: [f64; 3], off: f64) -> Foot {
        let mix = |of: &[DVec3; 3]| of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2];
        Foot { point: mix(&self.corners), normal: mix(&self.normals).normalize_or(DVec3::Z), off }
    }
}

/// Barycentric coordinates of a point of the plane.
fn weights([a, b, c]: [DVec2; 3], point: DVec2) -> [f64; 3] {
    let whole = (b - a).perp_dot(c - a);
    let (to_b, to_c) = ((c - b).perp_dot(point - b), (a - c).perp_dot(point - c));
    let (first, second) = (to_b / whole, to_c / whole);
    [first, second, 1.0 - first - second]
}

impl Surface {
    /// Facets with an area as seen along the axis that is none of `axes`; `None` without any.
    pub(super) fn new(axes: [usize; 2], facets: Vec<Facet>) -> Option<Self> {
        let flat = |point: DVec3| DVec2::from(axes.map(|k| point[k]));
        let area = |facet: &Facet| {
            let [a, b, c] = facet.corners.map(flat);
            (b - a).perp_dot(c - a).abs()
        };
        let facets: Vec<Facet> = facets.into_iter().filter(|facet| area(facet) > 1e-10).collect();
        let corners = || facets.iter().flat_map(|facet| facet.corners.map(flat));
        let low = corners().reduce(DVec2::min)?;
        let high = corners().reduce(DVec2::max)?;
        let mut along = (facets.len() as f64).sqrt().clamp(1.0, MOST_CELLS) as usize;
        let (cells, size, image) = (vec![], high - low, Image::None);
        let mut surface = Self { axes, facets, cells, count: [1; 2], low, size, image };
        loop {
            surface.count = [along; 2];
            surface.size = ((high - low) / along as f64).max(DVec2::splat(1e-9));
            let touched: usize =
                (0..surface.facets.len()).map(|k| surface.cells_of(k).count()).sum();
            // Long thin triangles touch every cell: fewer cells then.
            if along == 1 || touched <= MOST_TOUCHED * surface.facets.len() {
                break;
            }
            along /= 2;
        }
        surface.cells = vec![Vec::new(); along * along];
        for number in 0..surface.facets.len() {
            for cell in surface.cells_of(number) {
                surface.cells[cell].push(number as u32);
            }
        }
        Some(surface)
    }

    /// Cells that the box around a facet touches.
    fn cells_of(&self, facet: usize) -> impl Iterator<Item = usize> + use<> {
        let corners = self.flat(facet);
        let from = self.cell(corners.into_iter().fold(DVec2::MAX, DVec2::min));
        let to = self.cell(corners.into_iter().fold(DVec2::MIN, DVec2::max));
        let columns = self.count[0];
        (from[1]..=to[1]).flat_map(move |row| (from[0]..=to[0]).map(move |x| row * columns + x))
    }

    /// True if a mirror at the plane y = 0 shows one as the other.
    pub(super) fn is_image_of(self: &Arc<Self>, other: &Arc<Self>) -> bool {
        match (&self.image, &other.image) {
            (Image::Itself, _) => Arc::ptr_eq(self, other),
            (Image::Of(one), _) if Arc::ptr_eq(one, other) => true,
            (_, Image::Of(one)) => Arc::ptr_eq(one, self),
            _ => false,
        }
    }

    /// Triangles in the region's frame.
    pub(super) fn facets(&self) -> impl Iterator<Item = &Facet> {
        self.facets.iter()
    }

    /// Corners of all facets, in the region's frame.
    pub(super) fn corners(&self) -> impl Iterator<Item = DVec3> {
        self.facets.iter().flat_map(|facet| facet.corners)
    }

    fn flat(&self, facet: usize) -> [DVec2; 3] {
        self.facets[facet].corners.map(|corner| DVec2::from(self.axes.map(|k| corner[k])))
    }

    /// Column and row of the cell of a point, or of the nearest one.
    fn cell(&self, point: DVec2) -> [usize; 2] {
        let at = (point - self.low) / self.size;
        [0, 1].map(|k| (at[k].max(0.0) as usize).min(self.count[k] - 1))
    }

    /// The axis along which heights count.
    pub(super) fn along(&self) -> usize {
        3 - self.axes[0] - self.axes[1]
    }

    /// Where a sensor over a point of the plane stands.
    pub(super) fn foot(&self, point: [f64; 2]) -> Foot {
        let point = DVec2::from(point);
        self.over(point).unwrap_or_else(|| {
            let nearest = self.nearest(point);
            // Where the nearest triangle ends, another one may lie farther out.
            let over = self.over(DVec2::from(self.axes.map(|k| nearest.point[k])));
            Foot { off: nearest.off, ..over.unwrap_or(nearest) }
        })
    }

    /// The outermost foot over a point; `None` over no triangle.
    fn over(&self, point: DVec2) -> Option<Foot> {
        let [column, row] = self.cell(point);
        let mut best: Option<Foot> = None;
        for &number in &self.cells[row * self.count[0] + column] {
            let weights = weights(self.flat(number as usize), point);
            if weights.iter().all(|weight| *weight >= -ON_EDGE) {
                let foot = self.facets[number as usize].at(weights, 0.0);
                if best.as_ref().is_none_or(|best| self.is_nearer(&foot, best)) {
                    best = Some(foot);
                }
            }
        }
        best
    }

    /// The foot nearest to a point over no triangle, found in rings of cells around it.
    fn nearest(&self, point: DVec2) -> Foot {
        let [column, row] = self.cell(point);
        let mut best: Option<Foot> = None;
        let inside = point.clamp(self.low, self.low + self.size * self.count[0] as f64);
        for ring in 0..self.count[0] {
            // Cells of this ring are at least so far from the point.
            let within = (ring as f64 - 1.0).max(0.0) * self.size.min_element();
            let reach = maths::hypot(within, point.distance(inside));
            if best.as_ref().is_some_and(|best| best.off < reach) {
                break;
            }
            let columns = column.saturating_sub(ring)..=(column + ring).min(self.count[0] - 1);
            for x in columns {
                for y in row.saturating_sub(ring)..=(row + ring).min(self.count[1] - 1) {
                    if x.abs_diff(column).max(y.abs_diff(row)) != ring {
                        continue;
                    }
                    for &number in &self.cells[y * self.count[0] + x] {
                        let foot = self.on_edge(number as usize, point);
                        let nearer = |best: &Foot| self.is_nearer(&foot, best);
                        if best.as_ref().is_none_or(nearer) {
                            best = Some(foot);
                        }
                    }
                }
            }
        }
        best.unwrap_or(Foot { point: DVec3::ZERO, normal: DVec3::Z, off: f64::INFINITY })
    }

    /// True if a foot is nearer than another, or as near and farther out.
    fn is_nearer(&self, foot: &Foot, than: &Foot) -> bool {
        let height = |foot: &Foot| foot.point[self.along()];
        foot.off < than.off || foot.off == than.off && height(foot) > height(than)
    }

    /// The point of a facet's edges that is nearest in the plane.
    fn on_edge(&self, facet: usize, point: DVec2) -> Foot {
        let corners = self.flat(facet);
        let mut best = self.facets[facet].at([1.0, 0.0, 0.0], f64::INFINITY);
        for k in 0..3 {
            let next = (k + 1) % 3;
            let way = corners[next] - corners[k];
            let share = (point - corners[k]).dot(way) / way.length_squared().max(1e-300);
            let share = share.clamp(0.0, 1.0);
            let mut weights = [0.0; 3];
            (weights[k], weights[next]) = (1.0 - share, share);
            let foot = self.facets[facet].at(weights, point.distance(corners[k] + way * share));
            if self.is_nearer(&foot, &best) {
                best = foot;
            }
        }
        best
    }

    /// Frame of a sensor at rest on a foot, in the ego frame.
    pub(super) fn rest(&self, ego_from_region: &Pose, foot: &Foot, offset: f64) -> Pose {
        let mut point = foot.point;
        point[self.along()] += offset;
        let on_roof = self.along() == 2;
        let rotation = rest(ego_from_region.rotation * foot.normal, on_roof);
        Pose { rotation, translation: ego_from_region.apply(point) }
    }
}

/// Axes of a sensor at rest on a patch: on a roof z along the normal and x ahead, on a side x along the
/// normal and z up, as near as may be.
fn rest(normal: DVec3, on_roof: bool) -> DMat3 {
    let [x, y, z] = if on_roof {
        let up = normal;
        let y = up.cross(DVec3::X).normalize_or(DVec3::Y);
        [y.cross(up), y, up]
    } else {
        let y = DVec3::Z.cross(normal).normalize_or(DVec3::Y);
        [normal, y, normal.cross(y)]
    };
    DMat3::from_cols(x, y, z)
}

/// Frame of a patch with a normal, and the fields of a pose that count along its plane: a patch within 45° of level is a
/// roof.
pub(super) fn frame_of_patch(normal: DVec3, middle: DVec3) -> (Pose, [usize; 2]) {
    let on_roof = normal.z.abs() >= std::f64::consts::FRAC_1_SQRT_2;
    let frame = Pose { rotation: rest(normal, on_roof), translation: middle };
    (frame, if on_roof { [0, 1] } else { [1, 2] })
}
