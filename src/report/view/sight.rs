//! Voxels that hold information, the layouts that see them, and gains by class and distance.

use rayon::prelude::*;

use crate::cover::{BitOrder, Bitmaps};
use crate::engine::{Backend, BackendError};
use crate::maths;
use crate::problem::{Content, Entropy, OccupiedVoxel, Problem};
use crate::psog::{Roi, to_nats};
use crate::vehicle::Placement;

/// Metres between two rings of distance, and most rings.
const RING: f64 = 10.0;
const RINGS: usize = 8;

/// Information by one property of its voxels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InformationShare {
    /// Class, or range of distance.
    pub name: String,
    pub total: f64,
    /// Nats that each layout gains: the placement, then the baselines.
    pub gained: Vec<f64>,
}

/// Nats that a placement and its baselines gain, over the frames shown.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gains {
    /// By class, most information first; a voxel of several classes counts with the rarest of them.
    pub by_class: Vec<InformationShare>,
    /// By distance from the ego's origin, seen from above.
    pub by_distance: Vec<InformationShare>,
    /// Nats that each LiDAR of the placement would gain alone.
    pub alone: Vec<f64>,
    /// Nats that the scene holds.
    pub total: f64,
    /// Frames that this is a mean over.
    pub frames: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drawn {
    /// Linear index in the grid.
    pub index: u32,
    /// Share of the largest entropy.
    pub worth: f64,
    /// Position among the class names.
    pub class: u16,
}

/// Voxels that hold most information, and the layouts that see them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InformationView {
    /// Voxels drawn, most information first.
    pub voxels: Vec<Drawn>,
    /// A bit a LiDAR that sees it, `[frames shown][voxels]`.
    pub masks: Vec<Vec<u16>>,
    /// Share of the frames in which a layout sees it, `[placement and baselines][voxels]`.
    pub shares: Vec<Vec<f64>>,
    /// Gains over all voxels, drawn or not.
    pub gains: Gains,
    /// Voxels that hold information, and nats of those drawn.
    of: (usize, f64),
}

struct Voxel {
    drawn: Drawn,
    nats: f64,
    ring: usize,
}

impl InformationView {
    /// Looks at the `most` voxels with most information, in the frames `shown`.
    pub(crate) fn new(
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
        baselines: &[Placement],
        shown: &[usize],
        most: usize,
    ) -> Result<Self, BackendError> {
        let voxels = informative(problem.roi(), problem.content());
        let count = voxels.len().min(most);
        let mut gains = Gains::new(problem, &voxels, shown.len());
        let (mut shares, mut masks) = (Vec::new(), Vec::new());
        let mut alone = vec![0.0; placement.lidars.len()];
        let mut places = VoxelBits::default();
        for (layout, of) in std::iter::once(placement).chain(baselines).enumerate() {
            let mut seen = vec![0_u32; voxels.len()];
            for &frame in shown {
                let bitmaps = engine.bitmaps(&of.lidars, frame)?;
                places.fit(bitmaps.order, &voxels);
                let marks = Marks { bitmaps, places: &places };
                marks.count(&mut seen);
                if layout > 0 {
                    continue;
                }
                masks.push(marks.masks(count));
                // Each LiDAR's sum is taken in one order, so that threads change no bit.
                alone.par_iter_mut().enumerate().for_each(|(lidar, nats)| {
                    let gained: f64 = marks.of(lidar, &voxels).map(|voxel| voxel.nats).sum();
                    *nats += gained / shown.len() as f64;
                });
            }
            let mut share = vec![0.0; voxels.len()];
            for (&(_, voxel), &seen) in places.rising.iter().zip(&seen) {
                share[voxel as usize] = f64::from(seen) / shown.len() as f64;
            }
            gains.add(&voxels, &share);
            shares.push(share[..count].to_vec());
        }
        gains.alone = alone;
        gains.by_class.retain(|part| part.total > 0.0);
        gains.by_class.sort_by(|a, b| b.total.total_cmp(&a.total));
        let drawn = voxels[..count].iter();
        let of = (voxels.len(), drawn.clone().map(|voxel| voxel.nats).sum());
        Ok(Self { voxels: drawn.map(|v| v.drawn).collect(), masks, shares, gains, of })
    }

    /// Sentence on voxels that are not drawn; `None` where all are.
    pub(crate) fn left_out(&self) -> Option<String> {
        let (all, nats) = self.of;
        let drawn = self.voxels.len();
        (drawn < all).then(|| {
            format!(
                "Drawn are the {drawn} of {all} voxels that hold most: {:.0} % of the information.",
                100.0 * nats / self.gains.total
            )
        })
    }
}

/// Bits of voxels in the bitmaps of an engine.
#[derive(Default)]
struct VoxelBits {
    order: Option<BitOrder>,
    /// Bit of each voxel.
    bits: Vec<u32>,
    /// Bits rising, each with the number of its voxel: thousands of bitmaps are gone through.
    rising: Vec<(u32, u32)>,
}

impl VoxelBits {
    /// Finds them anew where another engine has taken over.
    fn fit(&mut self, order: BitOrder, voxels: &[Voxel]) {
        if self.order != Some(order) {
            self.order = Some(order);
            self.bits = voxels.par_iter().map(|voxel| order.bit_of(voxel.drawn.index)).collect();
            self.rising = self.bits.iter().copied().zip(0..).collect();
            self.rising.par_sort_unstable();
        }
    }
}

/// LiDARs that cover some voxels in a frame.
struct Marks<'a> {
    bitmaps: Bitmaps,
    places: &'a VoxelBits,
}

impl Marks<'_> {
    /// Counts one more for each voxel that any LiDAR covers, by rising bit.
    fn count(&self, seen: &mut [u32]) {
        let mut union: Vec<u64> = Vec::new();
        for words in self.bitmaps.sensors() {
            union.resize(words.len(), 0);
            union.iter_mut().zip(words).for_each(|(all, word)| *all |= word);
        }
        let covered = seen.par_iter_mut().zip(&self.places.rising);
        covered.for_each(|(seen, &(bit, _))| *seen += u32::from(is_set(&union, bit)));
    }

    fn of<'a>(&'a self, lidar: usize, voxels: &'a [Voxel]) -> impl Iterator<Item = &'a Voxel> {
        let words = self.bitmaps.sensors().nth(lidar).unwrap_or_default();
        let covered = move |&(_, &bit): &(&Voxel, &u32)| is_set(words, bit);
        voxels.iter().zip(&self.places.bits).filter(covered).map(|(voxel, _)| voxel)
    }

    /// A bit a LiDAR for each of the first voxels.
    fn masks(&self, count: usize) -> Vec<u16> {
        let mask = |&bit: &u32| {
            let sensors = self.bitmaps.sensors().enumerate();
            sensors.fold(0, |mask, (k, words)| mask | u16::from(is_set(words, bit)) << k)
        };
        self.places.bits[..count].par_iter().map(mask).collect()
    }
}

pub(crate) fn is_set(words: &[u64], bit: u32) -> bool {
    words[bit as usize / 64] >> (bit % 64) & 1 == 1
}

/// The voxels that hold information, most first.
fn informative(roi: &Roi, content: &Content) -> Vec<Voxel> {
    let occupied = content.occupied();
    let mut classes = vec![0_u16; occupied.len()];
    let mut order: Vec<usize> = (0..content.classes().len()).collect();
    order.sort_by_key(|&class| std::cmp::Reverse(content.voxels_of_class(class).len()));
    for class in order {
        let mut next = 0;
        for &index in content.voxels_of_class(class) {
            while next < occupied.len() && occupied[next].index < index {
                next += 1;
            }
            if let Some(slot) = classes.get_mut(next) {
                *slot = class as u16;
            }
        }
    }
    let entropy = |voxel: &OccupiedVoxel| Entropy::Classes.of(&voxel.entropy);
    let most = occupied.iter().map(entropy).max().unwrap_or(0).max(1);
    let informative = occupied.iter().zip(classes).filter(|(voxel, _)| entropy(voxel) > 0);
    let voxel = |(voxel, class): (&OccupiedVoxel, u16)| {
        let coords = roi.coords(u64::from(voxel.index));
        let [x, y] = [0, 1].map(|k| roi.min()[k] + (f64::from(coords[k]) + 0.5) * roi.voxel()[k]);
        let worth = f64::from(entropy(voxel)) / f64::from(most);
        Voxel {
            drawn: Drawn { index: voxel.index, worth, class },
            nats: to_nats(u64::from(entropy(voxel))),
            ring: ((maths::hypot(x, y) / RING) as usize).min(RINGS - 1),
        }
    };
    let mut voxels: Vec<Voxel> = informative.map(voxel).collect();
    voxels.sort_by(|a, b| b.nats.total_cmp(&a.nats).then(a.drawn.index.cmp(&b.drawn.index)));
    voxels
}

impl Gains {
    /// Totals by class and distance, before any layout is added.
    fn new(problem: &Problem, voxels: &[Voxel], frames: usize) -> Self {
        let part = |name: String| InformationShare { name, total: 0.0, gained: Vec::new() };
        let ring = |ring: usize| match ring + 1 {
            RINGS => format!("{:.0} m and more", ring as f64 * RING),
            next => format!("{:.0} to {:.0} m", ring as f64 * RING, next as f64 * RING),
        };
        let rings = voxels.iter().map(|voxel| voxel.ring + 1).max().unwrap_or(0);
        let mut gains = Self {
            by_class: problem.content().classes().iter().cloned().map(part).collect(),
            by_distance: (0..rings).map(|k| part(ring(k))).collect(),
            alone: Vec::new(),
            total: voxels.iter().map(|voxel| voxel.nats).sum(),
            frames,
        };
        for voxel in voxels {
            gains.by_class[usize::from(voxel.drawn.class)].total += voxel.nats;
            gains.by_distance[voxel.ring].total += voxel.nats;
        }
        gains
    }

    pub(crate) fn gained(&self) -> f64 {
        self.by_distance.iter().filter_map(|part| part.gained.first()).sum()
    }

    /// Adds a layout that sees each voxel in a share of the frames.
    fn add(&mut self, voxels: &[Voxel], shares: &[f64]) {
        let parts = self.by_class.iter_mut().chain(&mut self.by_distance);
        parts.for_each(|part| part.gained.push(0.0));
        for (voxel, share) in voxels.iter().zip(shares) {
            let parts = [
                &mut self.by_class[usize::from(voxel.drawn.class)],
                &mut self.by_distance[voxel.ring],
            ];
            for gained in parts.into_iter().filter_map(|part| part.gained.last_mut()) {
                *gained += share * voxel.nats;
            }
        }
    }
}
