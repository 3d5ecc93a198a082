//! The rims of beams, where a beam is wider than the line in its middle.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::stage::Stage;
use super::sweep::{COLUMNS_A_TASK, Edge, Station, Surface, Sweep, Sweeper, walked};
use crate::bvh::Hit;
use crate::cast::{FiringWalk, Instructions, Left, Target, all_hit, closer_hits_of_bundle};
use crate::vehicle::{BeamGrid, BeamTable};

/// Rays that a beam is made of where its middle is not enough: the middle, and a ring of six on its rim.
pub(super) const RAYS: usize = 7;
/// Those on the rim.
const RING: usize = RAYS - 1;
/// Share of the beam's power in the middle; the ring has the rest.
const MIDDLE: f64 = 0.4;
/// A beam whose middle is enough.
const NONE: u32 = u32::MAX;

/// Share of a beam's power that goes with one of its rays.
pub(super) fn ray_share(ray: usize) -> f64 {
    if ray == 0 { MIDDLE } else { (1.0 - MIDDLE) / RING as f64 }
}

/// The rims of all beams of a sensor model.
pub(super) struct Rim {
    /// In the sensor frame, in the order in which beams fire.
    rings: Vec<[[f32; 3]; RING]>,
    /// The rays of an azimuth step, ring after ring; none of a list of directions, and
    /// of few channels.
    walk: Option<FiringWalk>,
}

/// What the rims of beams meet in a frame.
pub(super) struct Rims<'r> {
    rim: &'r Rim,
    /// Of each beam its place among the hits, or [`NONE`].
    places: Vec<u32>,
    hits: Vec<[Hit; RING]>,
}

impl Rim {
    /// None where beams have no width.
    pub fn new(sweeper: &Sweeper) -> Option<Self> {
        let model = sweeper.model();
        if sweeper.width <= 0.0 {
            return None;
        }
        let [across, along] = model.response.divergence.map(|width| width / 2.0);
        let ray = |k: usize| {
            // Round the ellipse of the half widths.
            let (sin, cos) = (TAU * (k as f64 + 1.5) / RING as f64).sin_cos();
            DVec3::new(1.0, (cos * across).tan(), (sin * along).tan()).normalize()
        };
        let rays: [DVec3; RING] = std::array::from_fn(ray);
        let directions = model.table.directions();
        let rings = (0..sweeper.firings()).into_par_iter().flat_map_iter(|firing| {
            let (from, step, count) = sweeper.beams_of(firing);
            let fired = directions[from..].iter().step_by(step).take(count);
            fired.map(|&middle| rays.map(|ray| (turn(middle) * ray).as_vec3().to_array()))
        });
        let walk = grid(&model.table, &rays);
        let walk = walk.and_then(|grid| FiringWalk::new(&grid, Instructions::Best));
        Some(Self { rings: rings.collect(), walk })
    }
}

/// Takes +x to a direction: Ry(−elevation), then Rz(azimuth).
fn turn(direction: [f32; 3]) -> DMat3 {
    let direction = DVec3::from(direction.map(f64::from));
    let (azimuth, across) = (direction.y.atan2(direction.x), direction.truncate().length());
    DMat3::from_rotation_z(azimuth) * DMat3::from_rotation_y(-direction.z.atan2(across))
}

/// The rays of all rims as a grid, those of a channel side by side.
fn grid(table: &BeamTable, rays: &[DVec3; RING]) -> Option<BeamGrid> {
    let grid = walked(table)?;
    let channels = grid.channels.iter().flat_map(|&(elevation, offset)| {
        let turn = DMat3::from_rotation_y(-elevation);
        rays.map(|ray| {
            let ray = turn * ray;
            let (azimuth, across) = (ray.y.atan2(ray.x), ray.truncate().length());
            (ray.z.atan2(across), offset + azimuth)
        })
    });
    Some(BeamGrid { channels: channels.collect(), ..grid.clone() })
}

impl Rim {
    /// What the rims of those beams meet whose middles are not enough: that see an edge, but for those that
    /// see nothing nearer beside it and meet one triangle with all of their rays.
    pub fn meet(&self, sweeper: &Sweeper, stage: &Stage, sweep: &Sweep) -> Rims<'_> {
        let turn = Turn { sweeper, stage, sweep };
        let of_firing = |firing: usize| &self.rings[sweeper.fired_before(firing)..];
        let all = (0..sweeper.firings()).into_par_iter().with_min_len(COLUMNS_A_TASK);
        let wanted = all.map(|firing| (firing, turn.wanted(firing, of_firing(firing))));
        let wanted: Vec<(usize, Vec<usize>)> =
            wanted.filter(|(_, wanted)| !wanted.is_empty()).collect();
        let by_device = || {
            let firings = wanted.par_iter().map(|(firing, wanted)| {
                let rays = wanted.iter().flat_map(|&k| of_firing(*firing)[k]);
                turn.station(*firing).firing(stage, rays)
            });
            firings.collect()
        };
        let range = sweeper.model().table.range();
        let hits = match stage.device.closest_hits(range, by_device) {
            Some(hits) => hits.as_chunks().0.to_vec(),
            None => {
                let tasks = wanted.par_iter().with_min_len(COLUMNS_A_TASK);
                let cast = tasks.map_init(Left::new, |left, (firing, wanted)| {
                    self.cast(&turn, *firing, wanted, left)
                });
                cast.collect::<Vec<Vec<[Hit; RING]>>>().concat()
            }
        };
        let mut places = vec![NONE; sweep.surfaces.len()];
        let beams = wanted.iter().flat_map(|(firing, wanted)| {
            let (from, step, _) = sweeper.beams_of(*firing);
            wanted.iter().map(move |k| from + k * step)
        });
        beams.zip(0..).for_each(|(beam, place)| places[beam] = place);
        Rims { rim: self, places, hits }
    }

    /// What the rims of some beams meet that fire together, by the host.
    fn cast(
        &self,
        turn: &Turn<'_>,
        firing: usize,
        wanted: &[usize],
        left: &mut Left,
    ) -> Vec<[Hit; RING]> {
        let Turn { sweeper, stage, .. } = *turn;
        let (from, step, count) = sweeper.beams_of(firing);
        let station = turn.station(firing);
        let rings = &self.rings[sweeper.fired_before(firing)..][..count];
        let range = sweeper.model().table.range();
        let mut hits = vec![[Hit::none(f32::NEG_INFINITY); RING]; count];
        wanted.iter().for_each(|&k| hits[k] = [Hit::none(range); RING]);
        if let Some(walk) = &self.walk {
            let (rays, hits) = (rings.as_flattened(), hits.as_flattened_mut());
            walk.closer_hits(firing, station.walked(stage), |ray| rays[ray], hits);
        }
        let alone: Vec<Target<'_>> = station.alone(stage, self.walk.is_some()).collect();
        for &k in wanted.iter().filter(|_| !alone.is_empty()) {
            let middle = sweeper.model().table.directions()[from + k * step];
            let rays: [_; RAYS] =
                std::array::from_fn(|ray| if ray == 0 { middle } else { rings[k][ray - 1] });
            let mut found = [Hit::none(range); RAYS];
            found[1..].copy_from_slice(&hits[k]);
            let alone = alone.iter().copied();
            closer_hits_of_bundle(alone, &rays, sweeper.width, &mut found, left);
            hits[k].copy_from_slice(&found[1..]);
        }
        wanted.iter().map(|&k| hits[k]).collect()
    }
}

/// What beams have met in a frame.
#[derive(Clone, Copy)]
struct Turn<'a> {
    sweeper: &'a Sweeper,
    stage: &'a Stage,
    sweep: &'a Sweep,
}

impl<'a> Turn<'a> {
    /// Where the sensor is when some beams fire together.
    fn station(&self, firing: usize) -> &'a Station {
        self.sweeper.station_of(self.sweep, self.sweeper.beams_of(firing).0)
    }

    /// Of the beams that fire together, those whose rims are looked at; `rings` are theirs.
    fn wanted(&self, firing: usize, rings: &[[[f32; 3]; RING]]) -> Vec<usize> {
        let (from, step, count) = self.sweeper.beams_of(firing);
        (0..count).filter(|&k| self.needs_ring(from + k * step, &rings[k])).collect()
    }

    fn needs_ring(&self, beam: usize, ring: &[[f32; 3]; RING]) -> bool {
        let (edge, own) = (self.edge(beam), &self.sweep.surfaces[beam]);
        if edge != Edge::InFront || !own.is_hit() {
            return edge != Edge::None;
        }
        let station = self.sweeper.station_of(self.sweep, beam);
        let Some(target) = station.target_of(self.stage, own.prim) else { return true };
        let triangle = self.stage.things[self.stage.thing_of(own.prim)].triangle(own.prim);
        let table = &self.sweeper.model().table;
        let middle = [table.directions()[beam]];
        !(all_hit(&target, &middle, triangle, table.range())
            && all_hit(&target, ring, triangle, table.range()))
    }

    /// The edge between a beam and its neighbours; one that it sees behind before one in front.
    fn edge(&self, beam: usize) -> Edge {
        let (columns, channels) = self.sweeper.shape();
        let (channel, column) = (beam / columns, beam % columns);
        let turns = self.sweeper.model().table.grid().is_none_or(|grid| grid.turn);
        let surfaces = &self.sweep.surfaces;
        let here = &surfaces[beam];
        let beside = |step: usize| {
            let other = column + step;
            let inside = turns || (1..=columns).contains(&other);
            inside.then(|| channel * columns + (other + columns - 1) % columns)
        };
        let above = (channel + 1 < channels).then(|| beam + columns);
        let below = channel.checked_sub(1).map(|_| beam - columns);
        let all = [beside(0), beside(2), above, below];
        let edges = all.into_iter().flatten().map(|at| here.edge_to(&surfaces[at]));
        edges.max().unwrap_or(Edge::None)
    }
}

impl Rims<'_> {
    /// What the rays of a beam meet, the middle one as it is known; none where the middle is enough.
    pub fn rays(
        &self,
        sweeper: &Sweeper,
        stage: &Stage,
        sweep: &Sweep,
        beam: usize,
    ) -> Option<[Surface; RAYS]> {
        let hits = self.hits.get(self.places[beam] as usize)?;
        let firing = sweeper.firing_of(beam);
        let (from, step, _) = sweeper.beams_of(firing);
        let ring = &self.rim.rings[sweeper.fired_before(firing) + (beam - from) / step];
        let station = sweeper.station_of(sweep, beam);
        let mut surfaces = [sweep.surfaces[beam]; RAYS];
        for (surface, (&ray, hit)) in surfaces[1..].iter_mut().zip(ring.iter().zip(hits)) {
            *surface = station.met(stage, ray, hit).0;
        }
        Some(surfaces)
    }
}
