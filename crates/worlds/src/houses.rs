//! Houses along the edges of streets: walls, roofs, bays and things in front of them.

use glam::DVec2;
use rand::RngExt;

use crate::network::{GroundRect, Model, Street, class, left_of};
use crate::surfaces::{HOUSE, ROAD, THING, WALK, WorldDraft};

/// Metres of a storey.
const STOREY: f64 = 3.0;

impl WorldDraft<'_> {
    /// Builds houses along both edges of every street.
    pub(crate) fn build(&mut self) {
        let network = self.network;
        for street in &network.streets {
            self.side(street, 0);
            self.side(street, 1);
        }
    }

    fn side(&mut self, street: &Street, side: usize) {
        let (house, edge) = (self.style.house, &street.edges[side]);
        // A road without a walk is no street: houses keep away from it.
        let back = if street.walks[side] > 0.0 || self.style.goods { 0.0 } else { 12.0 };
        let mut s = self.rng.random_range(0.0..6.0);
        while s < edge.length() - 4.0 {
            let width = self.between(house.width).min(edge.length() - s);
            let depth = self.between(house.depth);
            let setback = self.between(house.setback).max(back);
            let gap = self.between(house.gap);
            let middle = s + 0.5 * width;
            s += width + gap;
            if width < 6.0 || !self.rng.random_bool(house.built) {
                continue;
            }
            let ahead = edge.heading(middle);
            let outward = if side == 0 { left_of(ahead) } else { -left_of(ahead) };
            let foot = edge.at(middle).truncate();
            let middle = foot + outward * (setback + 0.5 * depth);
            // Its left is away from the street, so that y = -1 is the front.
            let plot = GroundRect::new(middle, -left_of(outward), [0.5 * width, 0.5 * depth]);
            let room = GroundRect { half: plot.half + DVec2::new(0.0, 0.5), ..plot };
            if self.mask.touches(&room, ROAD | WALK | HOUSE) {
                continue;
            }
            self.mask.block(&plot, HOUSE);
            self.house(&plot);
            self.front(&plot, setback);
            self.houses.push(plot.corners());
        }
    }

    fn between(&mut self, [low, high]: [f64; 2]) -> f64 {
        if high > low { self.rng.random_range(low..high) } else { low }
    }

    fn house(&mut self, plot: &GroundRect) {
        let [low, high] = self.style.house.storeys;
        let storeys = f64::from(self.rng.random_range(low..=high));
        let ground = plot.corners().map(|p| self.terrain.height(p));
        let foot = ground.iter().copied().fold(f64::INFINITY, f64::min) - 0.2;
        let level = self.terrain.height(plot.middle);
        let eaves = level + STOREY * storeys + self.rng.random_range(0.0..1.5);
        let part = match self.rng.random_range(0..3) {
            // A wing is lower than the house.
            0 => {
                let cut = self.rng.random_range(-0.3..0.3);
                let low = level + STOREY * (storeys - 1.0).max(1.0);
                self.model.block(&plot.part([cut, 1.0], [-0.6, 0.9]), [foot, low], class::BUILDING);
                plot.part([-1.0, cut], [-1.0, 1.0])
            }
            _ => *plot,
        };
        self.model.block(&part, [foot, eaves], class::BUILDING);
        if self.rng.random_bool(self.style.house.pitched) {
            let ridge = eaves + part.half.min_element() * self.rng.random_range(0.5..1.0);
            let hip = if self.rng.random_bool(0.3) { 0.4 } else { 0.0 };
            let roof = GroundRect { half: part.half * 1.05, ..part };
            self.model.roof(&roof, [eaves, ridge], hip, class::BUILDING);
        } else {
            let shed = part.part([-0.5, -0.1], [-0.3, 0.3]);
            self.model.block(&shed, [eaves, eaves + 1.6], class::BUILDING);
        }
        self.relief(&part, level, storeys);
    }

    /// Window recesses as bands between piers, bays and a step at the door.
    fn relief(&mut self, plot: &GroundRect, level: f64, storeys: f64) {
        let axes = (plot.half.x / 1.6).floor().max(1.0) as u32;
        let pier = 0.18 / plot.half.y;
        let style = self.rng.random_range(0..3);
        for k in 0..axes {
            let at = |f: f64| -1.0 + 2.0 * (f64::from(k) + f) / f64::from(axes);
            match style {
                // Piers in front of the wall.
                0 => {
                    let pier = plot.part([at(0.0), at(0.25)], [-1.0 - pier, -1.0]);
                    self.model.block(&pier, [level, level + STOREY * storeys], class::BUILDING);
                }
                // Balconies.
                1 => {
                    for storey in 1..storeys as u32 {
                        let z = level + STOREY * f64::from(storey);
                        let depth = 1.1 / plot.half.y;
                        let slab = plot.part([at(0.2), at(0.8)], [-1.0 - depth, -1.0]);
                        if k % 2 == 0 && !self.over_road(&slab) {
                            self.model.block(&slab, [z, z + 0.95], class::BUILDING);
                        }
                    }
                }
                // Window sills.
                _ => {
                    for storey in 0..storeys as u32 {
                        let z = level + STOREY * f64::from(storey) + 0.9;
                        let sill = plot.part([at(0.25), at(0.75)], [-1.0 - pier, -1.0]);
                        self.model.block(&sill, [z, z + 0.15], class::BUILDING);
                    }
                }
            }
        }
        let depth = 0.6 / plot.half.y;
        let door = self.rng.random_range(-0.7..0.5);
        let step = plot.part([door, door + 0.2], [-1.0 - depth, -1.0]);
        if !self.over_road(&step) {
            self.model.block(&step, [level - 0.1, level + 0.3], class::BUILDING);
        }
    }

    fn over_road(&self, plot: &GroundRect) -> bool {
        self.mask.touches(plot, ROAD)
    }

    /// A hedge, a fence or a wall at the edge of a front garden.
    fn front(&mut self, plot: &GroundRect, setback: f64) {
        if setback < 2.5 {
            return;
        }
        let out = -1.0 - (setback - 0.6) / plot.half.y;
        let line = plot.part([-1.1, 0.6], [out, out + 0.5 / plot.half.y]);
        if self.mask.touches(&line, ROAD | WALK | HOUSE) {
            return;
        }
        let z = self.terrain.height(line.middle);
        let (hedges, fences) = (self.style.hedges, self.style.fences);
        match self.rng.random_range(0.0..1.0) {
            r if r < hedges => {
                let height = self.rng.random_range(0.9..2.0);
                self.model.block(&line, [z - 0.2, z + height], class::VEGETATION);
            }
            r if r < hedges + fences => fence(&mut self.model, &line, z, 1.1),
            r if r < hedges + 1.4 * fences => {
                let thin = line.part([-1.0, 1.0], [-0.3, 0.3]);
                self.model.block(&thin, [z - 0.2, z + 1.0], class::WALL);
            }
            _ => return,
        }
        self.mask.block(&line, THING);
    }
}

/// Posts and two rails along the length of a plot.
pub(crate) fn fence(model: &mut Model, line: &GroundRect, z: f64, height: f64) {
    let posts = (2.0 * line.half.x / 1.5).ceil().max(1.0) as u32;
    for k in 0..=posts {
        let at = 2.0 * f64::from(k) / f64::from(posts) - 1.0;
        let half = 0.05 / line.half.x;
        let post = line.part([at - half, at + half], [-0.15, 0.15]);
        model.block(&post, [z - 0.2, z + height], class::FENCE);
    }
    let slats = (height / 0.45).ceil() as u32;
    for k in 1..=slats {
        let top = z + height * f64::from(k) / f64::from(slats);
        model.block(&line.part([-1.0, 1.0], [-0.05, 0.05]), [top - 0.12, top], class::FENCE);
    }
}
