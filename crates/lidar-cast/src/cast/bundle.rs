//! Single rays, and thin bundles of them, down the sixteen-wide tree: for beams that share no origin with others.
//!
//! A sensor that moves while it turns fires every column from a place of its own, and a beam that is wider than
//! a line is a bundle of rays. Sixteen boxes, or the boxes of sixteen triangles, are tested at once; the
//! rest goes to `Ray::intersect`, so the bits equal the reference's.
//!
//! A [`Firing`] is a group of rays that leave one place at one moment: the batches that a device casts for scans.

use multiversion::multiversion;

use super::sight::SightSphere;
use crate::bvh::bvh16::{BLOCK, Block16, Bvh16, Node16, WIDTH};
use crate::bvh::{Bvh, Hit, Ray, Triangle};
use crate::geom::Pose;
use crate::task::{DevicePose, beam_direction, beam_origin};

/// Rounding of a box's bounds, as a share of the largest coordinate: 2⁻²³ of each of middle, half extent and
/// origin, with room.
pub(super) const SLACK: f32 = 1e-6;
/// Rounding of a distance, as a share of it.
const STRETCH: f32 = 1e-6;

/// Parts of a tree that are left to visit, with where they begin; kept from ray to ray.
pub type TraversalStack = Vec<(f32, u32)>;

/// Where a tree lies for one sensor: the pose that takes the sensor's frame to the tree's, rounded, and
/// spheres around it that most beams and bundles miss.
#[derive(Debug, Clone, Copy)]
pub struct BundleOrigin {
    /// Takes the sensor's frame to the tree's.
    pub pose: DevicePose,
    /// The sphere that most beams miss.
    pub(crate) sight: SightSphere,
    wide: SightSphere,
}

impl BundleOrigin {
    /// For bundles of rays within `width` radians; none where the tree is empty or out of `range`.
    pub fn new(tree: &Bvh, pose: &Pose, range: f32, width: f32) -> Option<Self> {
        let pose = DevicePose::from(pose);
        let sight = SightSphere::new(&pose, tree, range)?;
        Some(Self { pose, sight, wide: sight.widened(width) })
    }
}

/// A tree as one sensor sees it, its faces numbered from `first_prim` on.
#[derive(Clone, Copy)]
pub struct BundleTree<'a> {
    /// The tree.
    pub tree: &'a Bvh,
    /// Added to the index of each face.
    pub first_prim: u32,
    /// Where it lies for the sensor.
    pub standing: &'a BundleOrigin,
}

/// Closest hits of a few beams, cast one by one: closer hits in some trees replace those known, and so do equally
/// close hits of a lower face. [`super::Caster::closer_hits`] does it for all beams of a sensor.
pub fn closer_hits_of_beams<'a>(
    targets: impl Iterator<Item = BundleTree<'a>>,
    directions: impl Iterator<Item = [f32; 3]> + Clone,
    hits: &mut [Hit],
    left: &mut TraversalStack,
) {
    for BundleTree { tree, first_prim, standing: BundleOrigin { pose, sight, .. } } in targets {
        let origin = beam_origin(pose);
        for (direction, hit) in directions.clone().zip(&mut *hits) {
            if !sight.misses(direction, hit.t) {
                let rays = [Ray::new(origin, beam_direction(pose, direction), hit.t)];
                descend(tree, first_prim, &rays, 0.0, std::slice::from_mut(hit), left);
            }
        }
    }
}

/// Closest hits of a ray bundle: `N` rays within `width` radians around `directions[0]`, which descend
/// together. Replaces hits as [`closer_hits_of_beams`] does.
pub fn closer_hits_of_bundle<'a, const N: usize>(
    targets: impl Iterator<Item = BundleTree<'a>>,
    directions: &[[f32; 3]; N],
    width: f32,
    hits: &mut [Hit; N],
    left: &mut TraversalStack,
) {
    for BundleTree { tree, first_prim, standing: BundleOrigin { pose, wide, .. } } in targets {
        let farthest = hits.iter().fold(0.0, |t: f32, hit| t.max(hit.t));
        if wide.misses(directions[0], farthest) {
            continue;
        }
        let origin = beam_origin(pose);
        let ray = |k: usize| Ray::new(origin, beam_direction(pose, directions[k]), hits[k].t);
        let rays: [Ray; N] = std::array::from_fn(ray);
        descend(tree, first_prim, &rays, width, hits, left);
    }
}

/// Tells whether rays of one origin all hit one triangle of a tree.
pub fn all_hit(
    tree: &Bvh,
    pose: &DevicePose,
    mut directions: impl Iterator<Item = [f32; 3]>,
    triangle: &Triangle,
    range: f32,
) -> bool {
    let origin = beam_origin(pose);
    directions.all(|direction| {
        let ray = Ray::new(origin, beam_direction(pose, direction), range);
        let mut hit = Hit::none(range);
        ray.intersect(triangle, tree.pad, 0, &mut hit);
        hit.is_hit()
    })
}

/// Closer hits of rays that start together and lie within `width` radians of the first.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
pub(super) fn descend(
    bvh: &Bvh,
    first_prim: u32,
    rays: &[Ray],
    width: f32,
    hits: &mut [Hit],
    left: &mut TraversalStack,
) {
    let tree = &bvh.bvh16;
    let Some(first) = rays.first().filter(|_| !tree.nodes.is_empty()) else { return };
    let tube = RayBundle::new(first, width, bvh);
    let farthest = |hits: &[Hit]| hits.iter().fold(0.0, |t: f32, hit| t.max(hit.t));
    tube.visit(tree, farthest(hits), left, |block, reach| {
        let block = &tree.blocks[block];
        let mut begins = [0.0; WIDTH];
        let mut seen = tube.triangles(block, *reach, &mut begins) & block.valid;
        while seen != 0 {
            let slot = seen.trailing_zeros() as usize % WIDTH;
            seen &= seen - 1;
            let triangle = block.triangle(slot);
            let closer = rays.iter().zip(&mut *hits).filter(|(_, hit)| begins[slot] <= hit.t);
            for (ray, hit) in closer {
                ray.intersect(&triangle, bvh.pad, first_prim, hit);
            }
        }
        *reach = farthest(hits);
    });
}

/// A ray and all that lies within an angle around it.
struct RayBundle<'a> {
    ray: &'a Ray,
    width: f32,
    /// Metres by which boxes grow for rounding.
    slack: f32,
    /// Metres by which boxes grow for each metre that they lie away.
    around: f32,
}

impl<'a> RayBundle<'a> {
    /// The rays within `width` radians of one, on their way down a tree.
    fn new(ray: &'a Ray, width: f32, bvh: &Bvh) -> Self {
        let largest = bvh.bvh16.largest + ray.origin.abs().max_element();
        Self { ray, width, slack: SLACK * largest + bvh.pad, around: SLACK + width }
    }

    /// Goes down a tree from near to far: blocks go to `block`, which may lower the distance that is still looked at;
    /// below 0 it ends the search.
    #[inline(always)]
    fn visit(
        &self,
        tree: &Bvh16,
        mut reach: f32,
        left: &mut TraversalStack,
        mut block: impl FnMut(usize, &mut f32),
    ) {
        if tree.nodes.is_empty() {
            return;
        }
        // A root with one child is passed over: rays that go down the tree have met its box.
        let root = &tree.nodes[0];
        left.clear();
        left.push((0.0, if root.valid == 1 { root.children[0] } else { 0 }));
        while let Some((near, child)) = left.pop() {
            if near > reach {
                continue;
            }
            if child & BLOCK != 0 {
                block((child ^ BLOCK) as usize, &mut reach);
                continue;
            }
            let node = &tree.nodes[child as usize];
            let mut begins = [0.0; WIDTH];
            let mut seen = self.children(node, reach, &mut begins) & node.valid;
            let from = left.len();
            while seen != 0 {
                let slot = seen.trailing_zeros() as usize % WIDTH;
                seen &= seen - 1;
                // The nearest on top.
                let mut at = left.len();
                while at > from && left[at - 1].0 < begins[slot] {
                    at -= 1;
                }
                left.insert(at, (begins[slot], node.children[slot]));
            }
        }
    }

    /// A bit for each box of a node that begins within `reach`, and where they begin.
    #[inline(always)]
    fn children(&self, node: &Node16, reach: f32, begins: &mut [f32; WIDTH]) -> u16 {
        self.boxes(&node.middle, &node.half, reach, begins)
    }

    /// A bit for each triangle of a block whose box begins within `reach`, and where they begin.
    #[inline(always)]
    fn triangles(&self, block: &Block16, reach: f32, begins: &mut [f32; WIDTH]) -> u16 {
        let (mut middle, mut half) = ([[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3]);
        for axis in 0..3 {
            for slot in 0..WIDTH {
                let [a, b, c] = [0, 1, 2].map(|corner: usize| block.corners[corner][axis][slot]);
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                middle[axis][slot] = 0.5 * low + 0.5 * high;
                half[axis][slot] = 0.5 * (high - low);
            }
        }
        self.boxes(&middle, &half, reach, begins)
    }

    /// A bit for each box that the tube meets within `reach`.
    #[inline(always)]
    fn boxes(
        &self,
        middle: &[[f32; WIDTH]; 3],
        half: &[[f32; WIDTH]; 3],
        reach: f32,
        begins: &mut [f32; WIDTH],
    ) -> u16 {
        let (origin, inverse) = (self.ray.origin.to_array(), self.ray.inverse.to_array());
        let mut grown = [self.slack; WIDTH];
        if self.width > 0.0 {
            for axis in 0..3 {
                for slot in 0..WIDTH {
                    let away = (middle[axis][slot] - origin[axis]).abs() + half[axis][slot];
                    grown[slot] += self.around * away;
                }
            }
        }
        let (mut near, mut far) = ([0.0_f32; WIDTH], [f32::MAX; WIDTH]);
        for axis in 0..3 {
            let steep = inverse[axis].abs();
            for slot in 0..WIDTH {
                let at = (middle[axis][slot] - origin[axis]) * inverse[axis];
                let wide = (half[axis][slot] + grown[slot]) * steep;
                // Comparisons, as `max` and `min` look for numbers that are none.
                let (begin, end) = (at - wide, at + wide);
                near[slot] = if begin > near[slot] { begin } else { near[slot] };
                far[slot] = if end < far[slot] { end } else { far[slot] };
            }
        }
        let mut seen = 0;
        for slot in 0..WIDTH {
            begins[slot] = near[slot] * (1.0 - STRETCH);
            let meets = begins[slot] <= far[slot] * (1.0 + STRETCH) && begins[slot] <= reach;
            seen |= u16::from(meets) << slot;
        }
        seen
    }
}

/// Rays that leave one place at the same moment, and the trees as that place sees them.
pub struct Firing<'a> {
    /// Trees that the rays may meet.
    pub targets: Vec<BundleTree<'a>>,
    /// Unit directions in the sensor's frame.
    pub rays: Vec<[f32; 3]>,
}

/// Casts firings.
pub trait FiringCaster: Send {
    /// Closest hit of every ray up to `range`, in order, with the bits of [`Firing::closest_hit`].
    ///
    /// # Errors
    /// Reason of the device, as a sentence.
    fn closest_hits(&mut self, firings: &[Firing<'_>], range: f32) -> Result<Vec<Hit>, String>;
}

impl Firing<'_> {
    /// The closest hit of a ray of a direction, by the reference's way down each tree.
    ///
    /// CPU twin of `shaders/cast_closest.wgsl` where its sensors are firings.
    pub fn closest_hit(&self, direction: [f32; 3], range: f32) -> Hit {
        let mut hit = Hit::none(range);
        for target in &self.targets {
            let pose = &target.standing.pose;
            let ray = Ray::new(beam_origin(pose), beam_direction(pose, direction), hit.t);
            target.tree.closer_hit(&ray, target.first_prim, &mut hit);
        }
        hit
    }
}
