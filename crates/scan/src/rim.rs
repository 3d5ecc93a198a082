//! The rims of beams, where a beam is wider than the line in its middle.

use rayon::prelude::*;

use super::device::Device;
use super::fires::Place;
use super::rays::{RAYS, RING, lane, ring};
use super::stage::Stage;
use super::station::{Edge, Faces, Surface};
use super::sweep::{COLUMNS_A_TASK, Sweep, Sweeper};
use lidar_cast::bvh::Hit;
use lidar_cast::cast::{Left, Target, all_hit, closer_hits_of_bundle};

/// A beam whose middle is enough.
const NONE: u32 = u32::MAX;

/// Hits of the beams' rim rays in one frame.
pub(super) struct Rims<'r> {
    turn: Turn<'r>,
    /// None where the sweep knows the rims of all beams.
    cast: Option<Cast>,
}

/// Rims that were cast by themselves.
struct Cast {
    /// One for each beam, in the order in which they fire, its place among the hits, or [`NONE`].
    places: Vec<u32>,
    hits: Vec<[Hit; RING]>,
}

impl<'r> Rims<'r> {
    /// Casts rim rays for beams at an edge, unless the beam sees the nearer surface and all its rays surely hit
    /// one triangle. `None` if beams have no width.
    pub fn meet(
        sweeper: &'r Sweeper,
        stage: &'r Stage,
        device: &'r Device,
        sweep: &'r Sweep,
    ) -> Option<Self> {
        if sweeper.width <= 0.0 {
            return None;
        }
        let turn = Turn { sweeper, stage, device, sweep };
        let cast = sweep.rims.is_none().then(|| {
            let all = (0..sweeper.fires.firings()).into_par_iter().with_min_len(COLUMNS_A_TASK);
            let wanted = |firing| sweeper.fires.together(firing).filter(|place| turn.wants(place));
            let wanted: Vec<Place> = all.flat_map_iter(wanted).collect();
            let mut places = vec![NONE; sweep.surfaces.len()];
            wanted.iter().zip(0..).for_each(|(place, at)| places[place.fired] = at);
            Cast { places, hits: turn.cast(&wanted) }
        });
        Some(Self { turn, cast })
    }

    /// Hits of a beam's rim rays; `None` if its centre ray is enough.
    fn hits(&self, place: &Place) -> Option<&[Hit; RING]> {
        match (&self.cast, &self.turn.sweep.rims) {
            (Some(Cast { places, hits }), _) => hits.get(places[place.fired] as usize),
            (None, Some(rims)) => self.turn.wants(place).then(|| &rims[place.fired]),
            (None, None) => None,
        }
    }

    /// Surfaces met by a beam's seven rays, the known centre ray first; `None` if the centre ray is enough.
    pub fn rays(&self, place: &Place) -> Option<[Surface; RAYS]> {
        let hits = self.hits(place)?;
        let Turn { sweeper, stage, sweep, .. } = self.turn;
        let rays = &sweeper.rays[place.fired];
        let mut faces = Faces::new(sweep.station(place.firing), stage);
        let mut surfaces = [sweep.surfaces[place.fired]; RAYS];
        for (k, hit) in hits.iter().enumerate() {
            surfaces[k + 1] = match faces.of(hit) {
                Some(face) => face.met(lane(rays, k + 1), hit).0,
                None => Surface::none(hit.t),
            };
        }
        Some(surfaces)
    }
}

/// Centre hits of a frame's beams, and the means to cast more rays.
#[derive(Clone, Copy)]
struct Turn<'a> {
    sweeper: &'a Sweeper,
    stage: &'a Stage,
    device: &'a Device,
    sweep: &'a Sweep,
}

impl Turn<'_> {
    /// Casts the rim rays of `wanted` beams, which come in firing order.
    fn cast(&self, wanted: &[Place]) -> Vec<[Hit; RING]> {
        let Turn { sweeper, stage, device, sweep } = *self;
        let firings: Vec<&[Place]> = wanted.chunk_by(|a, b| a.firing == b.firing).collect();
        let by_device = || {
            let firings = firings.par_iter().map(|wanted| {
                let rays = wanted.iter().flat_map(|place| ring(&sweeper.rays[place.fired]));
                sweep.station(wanted[0].firing).firing(stage, rays)
            });
            firings.collect()
        };
        let range = sweeper.model().table.range();
        if let Some(hits) = device.closest_hits(range, by_device) {
            return hits.as_chunks().0.to_vec();
        }
        let tasks = firings.par_iter().with_min_len(COLUMNS_A_TASK);
        let cast = tasks.map_init(Left::new, |left, wanted| {
            let station = sweep.station(wanted[0].firing);
            let targets: Vec<Target<'_>> = station.targets(stage).collect();
            let bundle = |place: &Place| {
                let rays = &sweeper.rays[place.fired];
                let rays: [_; RAYS] = std::array::from_fn(|ray| lane(rays, ray));
                let mut found = [Hit::none(range); RAYS];
                let targets = targets.iter().copied();
                closer_hits_of_bundle(targets, &rays, sweeper.width, &mut found, left);
                std::array::from_fn(|k| found[k + 1])
            };
            wanted.iter().map(bundle).collect::<Vec<[Hit; RING]>>()
        });
        cast.collect::<Vec<_>>().concat()
    }

    /// True if the rim of a beam is looked at.
    fn wants(&self, place: &Place) -> bool {
        let Turn { sweeper, stage, sweep, .. } = *self;
        let (edge, own) = (self.edge(place), &sweep.surfaces[place.fired]);
        if edge != Edge::InFront || !own.is_hit() {
            return edge != Edge::None;
        }
        // Rays that are known to hit the triangle need not be asked again.
        let knows = |ray: usize| match &sweep.rims {
            Some(rims) => ray == 0 || rims[place.fired][ray - 1].prim == own.prim,
            None => false,
        };
        let mut unsure = (0..RAYS).filter(|&ray| !knows(ray)).peekable();
        if unsure.peek().is_none() {
            return false;
        }
        let Some((tree, pose)) = sweep.station(place.firing).tree_of(stage, own.prim) else {
            return true;
        };
        let triangle = stage.things[stage.thing_of(own.prim)].triangle(own.prim);
        let (range, rays) = (sweeper.model().table.range(), &sweeper.rays[place.fired]);
        !all_hit(tree, &pose, unsure.map(|ray| lane(rays, ray)), triangle, range)
    }

    /// The edge between a beam and those beside it; one that it sees behind before one in front.
    fn edge(&self, place: &Place) -> Edge {
        let surfaces = &self.sweep.surfaces;
        let here = &surfaces[place.fired];
        let edges = self.sweeper.fires.beside(place).map(|at| here.edge_to(&surfaces[at]));
        edges.max().unwrap_or(Edge::None)
    }
}
