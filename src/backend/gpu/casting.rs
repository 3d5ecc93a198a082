use super::bundles::{Bundles, Four};
use super::device::Device;
use crate::backend::{BackendError, DevicePose, Problem};
use crate::bvh::{Candidate, Shafts};
use crate::geom::Aabb;

/// How closest hits are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Each beam goes down the tree of its frame.
    Tree,
    /// Beams are sorted by direction, and those of a shaft follow its list of candidates; see
    /// [`Shafts`].
    Shafts,
}

/// Beams of a frame that must have been cast since lists were made before they are made anew: about
/// as many as the tree takes in the time of making them.
const BEAMS_BEFORE_SHAFTS: u64 = 50_000;
/// Beams of a batch for which a face of the cube of directions is cut into as many shafts as its edge
/// has: enough of them share one to fill its blocks.
const BEAMS_OF_EDGE: f64 = 160.0;
/// Bounds of that edge.
const EDGES: [u32; 2] = [8, 64];
/// Beams that go down the tree in the time in which a block of beams follows a list.
const BEAMS_OF_BLOCK: u64 = 6;
/// Metres along an axis beyond which a box of origins holds too much of the scene for short lists.
const LARGEST_BOX: f32 = 4.0;
/// Share of the memory budget that lists may take.
const MEMORY_SHARE: u64 = 4;
/// Growth of the box of the origins seen so far, as a share of its size and in metres, so that later
/// origins seldom lie outside.
const GROWTH: f32 = 0.05;
const LEAST_GROWTH: f32 = 0.02;

/// A frame's lists on the device.
pub(super) struct ShaftBuffers {
    pub(super) starts: wgpu::Buffer,
    pub(super) candidates: wgpu::Buffer,
}

/// The lists of all frames, for the box of origins seen so far.
struct Lists {
    origins: Aabb,
    edge: u32,
    frames: Vec<ShaftBuffers>,
}

/// A chunk's beams by shaft, on the device.
pub(super) struct BundleBuffers {
    slots_held: u64,
    pub(super) workgroups: [u32; 3],
    pub(super) blocks: wgpu::Buffer,
    pub(super) beams: wgpu::Buffer,
    pub(super) slots: wgpu::Buffer,
}

/// Chooses how to cast, and keeps what casting by shafts needs.
#[derive(Default)]
pub(super) struct Caster {
    /// Says which, whatever it costs.
    told: Option<Casting>,
    /// Beams of each frame cast since lists were made, and most of a batch.
    beams: u64,
    largest: u64,
    /// Whether lists were found to take too much memory.
    unfit: bool,
    lists: Option<Lists>,
    bundles: Bundles,
    buffers: Option<BundleBuffers>,
}

impl Caster {
    pub(super) fn told(casting: Casting) -> Self {
        Self { told: Some(casting), ..Self::default() }
    }

    /// Chooses how beams of `poses` are cast and makes the lists where they are to be used and are
    /// not there yet; whether they are used.
    ///
    /// The tree costs nothing to begin with, lists cost little a beam, but their making pays only
    /// after many beams; and only where neighbouring invocations run in lockstep on a host's vector
    /// unit, which loads each lane's triangle one by one, are they sure to be faster.
    pub(super) fn choose(
        &mut self,
        device: &Device,
        problem: &Problem,
        poses: &[DevicePose],
        range: f32,
        memory: u64,
    ) -> Result<bool, BackendError> {
        let beams = poses.len() as u64 * problem.table().directions().len() as u64;
        self.beams += beams;
        self.largest = self.largest.max(beams);
        let edge = edge_for(self.largest);
        let allowed = self.told != Some(Casting::Tree) && !self.unfit;
        if !allowed || problem.geometry_frame_count() == 0 || range > problem.far_range() {
            return Ok(false);
        }
        let mut origins = Aabb::EMPTY;
        for pose in poses {
            origins.grow(pose.rows.map(|row| row[3]).into());
        }
        if let Some(lists) = &self.lists {
            let held = lists.origins;
            let inside = origins.min.cmpge(held.min).all() && origins.max.cmple(held.max).all();
            if inside && (edge <= 2 * lists.edge || self.beams < BEAMS_BEFORE_SHAFTS) {
                return Ok(true);
            }
            origins.merge(&held);
        }
        let pays = device.is_software()
            && self.beams >= BEAMS_BEFORE_SHAFTS
            && (origins.max - origins.min).max_element() <= LARGEST_BOX;
        if self.told.is_none() && !pays {
            return Ok(false);
        }
        self.beams = 0;
        let growth = GROWTH * (origins.max - origins.min) + LEAST_GROWTH;
        let origins = Aabb { min: origins.min - growth, max: origins.max + growth };
        self.lists = None;
        self.lists = Lists::new(device, problem, origins, edge, memory / MEMORY_SHARE)?;
        self.unfit = self.lists.is_none();
        Ok(!self.unfit)
    }

    /// Bytes that sorting takes on the device: of one sensor's beams, and of blocks that are not full.
    pub(super) fn bytes(&self, problem: &Problem) -> [u64; 2] {
        let shafts = self.lists.as_ref().map_or(0, |lists| Shafts::count(lists.edge));
        Bundles::bytes(problem.table().directions().len() as u64, shafts)
    }

    /// Sorts a chunk's beams and uploads them, where the tree would not be faster for so few; whether
    /// it did.
    pub(super) fn load(
        &mut self,
        device: &Device,
        problem: &Problem,
        poses: &[DevicePose],
    ) -> Result<bool, BackendError> {
        let Some(Lists { edge, .. }) = self.lists else { return Ok(false) };
        let directions = problem.table().directions();
        let beams = (poses.len() * directions.len()) as u64;
        self.bundles.sort(poses, directions, edge);
        let slots = self.bundles.slots.len() as u64;
        let blocks = slots / Bundles::BLOCK;
        if self.told.is_none() && blocks * BEAMS_OF_BLOCK > beams {
            return Ok(false);
        }
        if self.buffers.as_ref().is_none_or(|buffers| buffers.slots_held < slots) {
            self.buffers = None;
            let most = Bundles::most_slots(beams, Shafts::count(edge));
            self.buffers = Some(BundleBuffers::new(device, most)?);
        }
        if let Some(buffers) = &mut self.buffers {
            buffers.workgroups = self.bundles.workgroups;
            device.write(&buffers.blocks, &self.bundles.blocks);
            device.write(&buffers.beams, &self.bundles.beams);
            device.write(&buffers.slots, &self.bundles.slots);
        }
        Ok(true)
    }

    /// What a frame's beams are cast with, where it is by shafts.
    pub(super) fn frame(&self, frame: usize) -> Option<(&ShaftBuffers, &BundleBuffers)> {
        Some((&self.lists.as_ref()?.frames[frame], self.buffers.as_ref()?))
    }
}

/// The power of two that suits batches of so many beams.
fn edge_for(beams: u64) -> u32 {
    let edge = (beams as f64 / BEAMS_OF_EDGE).sqrt().max(1.0);
    (1 << edge.log2().round() as u32).clamp(EDGES[0], EDGES[1])
}

impl Lists {
    fn new(
        device: &Device,
        problem: &Problem,
        origins: Aabb,
        edge: u32,
        memory: u64,
    ) -> Result<Option<Self>, BackendError> {
        let frames = problem.geometry_frame_count();
        let starts = 4 * (Shafts::count(edge) as u64 + 1);
        let bytes = (memory / frames as u64).saturating_sub(starts).min(device.max_binding());
        let most = (bytes / size_of::<Candidate>() as u64) as usize;
        let mut buffers = Vec::with_capacity(frames);
        for bvh in (0..frames).filter_map(|frame| problem.geometry(frame)) {
            let Some(shafts) = Shafts::build(bvh, &origins, problem.far_range(), edge, most) else {
                return Ok(None);
            };
            buffers.push(ShaftBuffers {
                starts: device.upload("starts of shafts", &shafts.starts)?,
                candidates: device.upload("candidates of shafts", &shafts.candidates)?,
            });
        }
        Ok(Some(Self { origins, edge, frames: buffers }))
    }
}

impl BundleBuffers {
    fn new(device: &Device, slots: u64) -> Result<Self, BackendError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            slots_held: slots,
            workgroups: [0; 3],
            blocks: device.buffer("blocks of beams", Bundles::block_bytes(slots), usage)?,
            beams: device.buffer("sorted beams", slots / 4 * size_of::<Four>() as u64, usage)?,
            slots: device.buffer("slots of beams", 4 * slots, usage)?,
        })
    }
}
