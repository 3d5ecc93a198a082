//! The rims of beams, where a beam is wider than the line in its middle, and the rays that a beam is made of.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::fires::{BeamPlace, Fires};
use crate::stage::Stage;
use crate::station::{Edge, Faces, SurfaceHit};
use crate::sweep::{COLUMNS_A_TASK, FiredBeams, ScanDevice, Sweeper};
use lidar_cast::bvh::Hit;
use lidar_cast::cast::{self, BundleTree, Rays, TraversalStack, all_hit, closer_hits_of_bundle};
use lidar_cast::maths;
use sightline_scene::vehicle::SensorModel;

/// Place of a beam whose centre ray is enough.
const NONE: u32 = u32::MAX;

/// Hits of the beams' rim rays in one frame.
pub(super) struct Rims<'r> {
    turn: RimCaster<'r>,
    /// `None` if the sweep has cast the rims of all beams.
    cast: Option<RimHits>,
}

/// Hits of rim rays, cast for single beams.
struct RimHits {
    /// Place of each beam among `hits`, in firing order; [`NONE`] if its rim was not cast.
    places: Vec<u32>,
    hits: Vec<[Hit; RING]>,
}

impl<'r> Rims<'r> {
    /// Casts rim rays for beams at an edge, unless the beam sees the nearer surface and all its rays surely hit
    /// one triangle. `None` if beams have no width.
    pub(crate) fn meet(
        sweeper: &'r Sweeper,
        stage: &'r Stage,
        device: &'r ScanDevice,
        sweep: &'r FiredBeams,
    ) -> Option<Self> {
        if sweeper.width <= 0.0 {
            return None;
        }
        let turn = RimCaster { sweeper, stage, device, sweep };
        let cast = sweep.rims.is_none().then(|| {
            let all = (0..sweeper.fires.firings()).into_par_iter().with_min_len(COLUMNS_A_TASK);
            let wanted = |firing| sweeper.fires.together(firing).filter(|place| turn.wants(place));
            let wanted: Vec<BeamPlace> = all.flat_map_iter(wanted).collect();
            let mut places = vec![NONE; sweep.surfaces.len()];
            wanted.iter().zip(0..).for_each(|(place, at)| places[place.fired] = at);
            RimHits { places, hits: turn.cast(&wanted) }
        });
        Some(Self { turn, cast })
    }

    /// Hits of a beam's rim rays; `None` if its centre ray is enough.
    fn hits(&self, place: &BeamPlace) -> Option<&[Hit; RING]> {
        match (&self.cast, &self.turn.sweep.rims) {
            (Some(RimHits { places, hits }), _) => hits.get(places[place.fired] as usize),
            (None, Some(rims)) => self.turn.wants(place).then(|| &rims[place.fired]),
            (None, None) => None,
        }
    }

    /// Surfaces met by a beam's seven rays, the known centre ray first; `None` if the centre ray is enough.
    pub(crate) fn rays(&self, place: &BeamPlace) -> Option<[SurfaceHit; RAYS]> {
        let hits = self.hits(place)?;
        let RimCaster { sweeper, stage, sweep, .. } = self.turn;
        let rays = &sweeper.rays[place.fired];
        let mut faces = Faces::new(sweep.station(place.firing), stage);
        let mut surfaces = [sweep.surfaces[place.fired]; RAYS];
        for (k, hit) in hits.iter().enumerate() {
            surfaces[k + 1] = match faces.of(hit) {
                Some(face) => face.met(lane(rays, k + 1), hit).0,
                None => SurfaceHit::none(hit.t),
            };
        }
        Some(surfaces)
    }
}

/// Centre hits of a frame's beams, and the means to cast more rays.
#[derive(Clone, Copy)]
struct RimCaster<'a> {
    sweeper: &'a Sweeper,
    stage: &'a Stage,
    device: &'a ScanDevice,
    sweep: &'a FiredBeams,
}

impl RimCaster<'_> {
    /// Casts the rim rays of `wanted` beams, which come in firing order.
    fn cast(&self, wanted: &[BeamPlace]) -> Vec<[Hit; RING]> {
        let RimCaster { sweeper, stage, device, sweep } = *self;
        let firings: Vec<&[BeamPlace]> = wanted.chunk_by(|a, b| a.firing == b.firing).collect();
        let by_device = || {
            let firings = firings.par_iter().map(|wanted| {
                let rays = wanted.iter().flat_map(|place| ring(&sweeper.rays[place.fired]));
                sweep.station(wanted[0].firing).firing(stage, rays)
            });
            firings.collect()
        };
        let range = sweeper.model.table.range();
        if let Some(hits) = device.closest_hits(range, by_device) {
            return hits.as_chunks().0.to_vec();
        }
        let tasks = firings.par_iter().with_min_len(COLUMNS_A_TASK);
        let cast = tasks.map_init(TraversalStack::new, |left, wanted| {
            let station = sweep.station(wanted[0].firing);
            let targets: Vec<BundleTree<'_>> = station.targets(stage).collect();
            let bundle = |place: &BeamPlace| {
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

    /// True if a beam needs its rim rays.
    fn wants(&self, place: &BeamPlace) -> bool {
        let RimCaster { sweeper, stage, sweep, .. } = *self;
        let (edge, own) = (self.edge(place), &sweep.surfaces[place.fired]);
        if edge != Edge::InFront || !own.is_hit() {
            return edge != Edge::None;
        }
        // Rays that are known to hit the triangle need no test.
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
        let (range, rays) = (sweeper.model.table.range(), &sweeper.rays[place.fired]);
        !all_hit(tree, &pose, unsure.map(|ray| lane(rays, ray)), triangle, range)
    }

    /// Edge between a beam and its neighbours. If there are several, [`Edge::Behind`] wins over [`Edge::InFront`].
    fn edge(&self, place: &BeamPlace) -> Edge {
        let surfaces = &self.sweep.surfaces;
        let here = &surfaces[place.fired];
        let edges = self.sweeper.fires.beside(place).map(|at| here.edge_to(&surfaces[at]));
        edges.max().unwrap_or(Edge::None)
    }
}

/// Rays that a beam is made of where its middle is not enough: the middle, and a ring of six on its rim.
pub(super) const RAYS: usize = 7;
/// Rays on the rim.
pub(super) const RING: usize = RAYS - 1;
/// Share of the beam's power in the middle; the ring has the rest.
const MIDDLE: f64 = 0.4;

/// Share of a beam's power that goes with one of its rays.
pub(super) fn ray_share(ray: usize) -> f64 {
    if ray == 0 { MIDDLE } else { (1.0 - MIDDLE) / RING as f64 }
}

/// Middle and rim of each beam of a sensor, in the order in which beams fire: lane 0 is the middle, the next six are
/// on the rim, all others repeat the middle.
pub(super) fn rays_of(model: &SensorModel, fires: &Fires) -> Vec<Rays> {
    let [across, along] = model.response.divergence.map(|width| width / 2.0);
    let ray = |k: usize| {
        // Round the ellipse of the half widths.
        let (sin, cos) = maths::sin_cos(TAU * (k as f64 + 1.5) / RING as f64);
        DVec3::new(1.0, maths::tan(cos * across), maths::tan(sin * along)).normalize()
    };
    let ring: [DVec3; RING] = std::array::from_fn(ray);
    let is_wide = across > 0.0 || along > 0.0;
    let rays = |place: BeamPlace| {
        let middle = model.table.directions()[place.beam];
        let mut rays = middle.map(|x| [x; cast::RAYS]);
        if is_wide {
            let turn = turn(middle);
            for (k, ray) in ring.iter().enumerate() {
                let ray = (turn * *ray).as_vec3().to_array();
                (0..3).for_each(|axis| rays[axis][k + 1] = ray[axis]);
            }
        }
        rays
    };
    let firings = (0..fires.firings()).into_par_iter();
    firings.flat_map_iter(|firing| fires.together(firing).map(rays)).collect()
}

pub(super) fn lane(rays: &Rays, lane: usize) -> [f32; 3] {
    [rays[0][lane], rays[1][lane], rays[2][lane]]
}

/// The rays on the rim.
fn ring(rays: &Rays) -> [[f32; 3]; RING] {
    std::array::from_fn(|k| lane(rays, k + 1))
}

/// Takes +x to a direction: Ry(−elevation), then Rz(azimuth).
fn turn(direction: [f32; 3]) -> DMat3 {
    let direction = DVec3::from(direction.map(f64::from));
    let (azimuth, across) = (maths::atan2(direction.y, direction.x), direction.truncate().length());
    DMat3::from_rotation_z(azimuth) * DMat3::from_rotation_y(-maths::atan2(direction.z, across))
}
