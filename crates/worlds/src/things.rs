//! Houses along the edges of streets, and roadside objects: trees, lamps, signs, lights, rails, benches, bins and goods.

use glam::{DVec2, DVec3};
use lidar_cast::maths;
use rand::RngExt;

use crate::network::{GroundRect, KERB, Lane, Line, Model, Post, Street, StripUse, class, left_of};
use crate::surfaces::{HOUSE, ROAD, THING, WALK, WorldDraft};

/// Metres of a storey.
const STOREY: f64 = 3.0;
/// Metres above a road from which a plate hangs over it.
const OVER_ROAD: f64 = 3.0;

impl WorldDraft<'_> {
    /// Builds houses along both edges of every street.
    pub(crate) fn build(&mut self) {
        let network = self.network;
        for street in &network.streets {
            [0, 1].into_iter().for_each(|side| self.side(street, side));
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
            let middle = edge.at(middle).truncate() + outward * (setback + 0.5 * depth);
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
                        if k % 2 == 0 && !self.mask.touches(&slab, ROAD) {
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
        if !self.mask.touches(&step, ROAD) {
            self.model.block(&step, [level - 0.1, level + 0.3], class::BUILDING);
        }
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

    /// Furnishes every street, junction and garden.
    pub(crate) fn furnish(&mut self) {
        let network = self.network;
        self.posts();
        for street in &network.streets {
            for side in 0..2 {
                self.kerb(street, side);
                self.behind(street, side);
            }
        }
        for strip in network.strips.iter().filter(|s| s.used == StripUse::Green) {
            let middle = strip.left.iter().zip(&strip.right).map(|(l, r)| (*l + *r) * 0.5);
            self.median(&Line::new(middle));
        }
    }

    fn chance(&mut self, p: f64) -> bool {
        self.rng.random_bool(p.clamp(0.0, 1.0))
    }

    fn clear(&self, p: DVec2, radius: f64, bits: u8) -> bool {
        !self.mask.touches(&GroundRect::new(p, DVec2::X, [radius; 2]), bits)
    }

    fn take(&mut self, p: DVec2, radius: f64) {
        self.mask.block(&GroundRect::new(p, DVec2::X, [radius; 2]), THING);
    }

    /// Height of the walk or the ground.
    fn ground(&self, edge: DVec3, p: DVec2, kerb: Option<f64>) -> DVec3 {
        p.extend(kerb.map_or_else(|| self.terrain.height(p), |kerb| edge.z + kerb))
    }

    /// Trees, lamps, signs and street furniture just behind the kerb.
    fn kerb(&mut self, street: &Street, side: usize) {
        let (edge, walk) = (&street.edges[side], street.walks[side]);
        let out = if side == 0 { 1.0 } else { -1.0 };
        let outward = |s: f64| left_of(edge.heading(s)) * out;
        let place = |s: f64, from_edge: f64| edge.at(s).truncate() + outward(s) * from_edge;
        let from_kerb = if walk > 0.0 { 0.9 - walk } else { 1.3 };
        let mut s = self.rng.random_range(2.0..9.0);
        while s < edge.length() {
            let (p, at) = (place(s, from_kerb), edge.at(s));
            let foot = self.ground(at, p, (walk > 0.0).then(|| street.kerb(side, s)));
            if self.clear(p, 0.0, ROAD | HOUSE | THING) {
                let [trees, lamps] = [self.style.trees, self.style.lamps]
                    .map(|gap| if gap > 0.0 { 6.0 / gap } else { 0.0 });
                match self.rng.random_range(0.0..1.0) {
                    r if r < trees && walk > 1.5 => self.tree(foot, 1.0),
                    // Objects of the map itself use up random numbers too, so that all others stay in place.
                    r if r < trees + lamps => {
                        let height = self.rng.random_range(5.0..9.0);
                        if !self.of_map.near(class::POLE, p) {
                            self.lamp(foot, -outward(s), height);
                        }
                    }
                    r if r < trees + lamps + 0.06 => {
                        // Boards look at those who come along on this side of the road.
                        let side = if (out < 0.0) != street.left_hand { -1.0 } else { 1.0 };
                        let lots = self.sign_lots();
                        if !self.of_map.near(class::TRAFFIC_SIGN, p) {
                            self.sign(foot, edge.heading(s) * side, lots);
                        }
                    }
                    r if r >= trees + lamps + 0.13 || walk <= 1.5 => {}
                    _ => self.small(foot, edge.heading(s)),
                }
            }
            s += self.rng.random_range(4.0..8.0);
        }
        if walk == 0.0 && self.style.speed[1] > 20.0 {
            self.rail(edge, out);
        }
    }

    /// Trees, bushes and goods behind the houses' line.
    fn behind(&mut self, street: &Street, side: usize) {
        let edge = &street.edges[side];
        let out = if side == 0 { 1.0 } else { -1.0 };
        let mut s = self.rng.random_range(0.0..8.0);
        while s < edge.length() {
            let far = self.rng.random_range(2.0..34.0);
            let p = edge.at(s).truncate() + left_of(edge.heading(s)) * (out * far);
            s += self.rng.random_range(0.5..1.5) * if self.style.goods { 9.0 } else { 3.5 };
            if !self.clear(p, 1.2, ROAD | WALK | HOUSE | THING) {
                continue;
            }
            let foot = p.extend(self.terrain.height(p));
            if self.style.goods && self.chance(0.75) {
                self.goods(foot, edge.heading(s));
            } else if self.chance(0.55) {
                let size = self.rng.random_range(0.7..1.4);
                self.tree(foot, size);
            } else {
                let radius = self.rng.random_range(0.4..1.2);
                let radii = DVec3::new(radius, radius, 0.8 * radius);
                self.model.leaves(foot + DVec3::Z * 0.6 * radius, radii, 60, &mut self.rng);
                self.take(p, radius);
            }
        }
    }

    fn tree(&mut self, foot: DVec3, size: f64) {
        if !self.clear(foot.truncate(), 0.0, ROAD | HOUSE) {
            return;
        }
        let trunk = size * self.rng.random_range(2.0..3.4);
        let radius = size * self.rng.random_range(0.10..0.22);
        self.model.pole(foot - DVec3::Z * 0.2, radius, trunk + 0.6, 6, class::VEGETATION);
        let wide = size * self.rng.random_range(1.3..2.4);
        let tall = wide * self.rng.random_range(0.9..1.7);
        let crown = foot + DVec3::Z * (trunk + 0.75 * tall);
        let leaves = (110.0 * size * wide) as usize;
        self.model.leaves(crown, DVec3::new(wide, wide, tall), leaves, &mut self.rng);
        self.take(foot.truncate(), 0.4);
        self.trees.push(foot.truncate());
    }

    fn lamp(&mut self, foot: DVec3, over_road: DVec2, height: f64) {
        self.model.pole(foot, 0.08, height, 6, class::POLE);
        let arm = GroundRect::new(foot.truncate() + over_road * 0.8, over_road, [0.9, 0.08]);
        let z = foot.z + height;
        self.model.block(&arm, [z - 0.12, z], class::POLE);
        self.take(foot.truncate(), 0.2);
    }

    /// Lower edge of a sign's board and half its height in metres, and whether it is round.
    fn sign_lots(&mut self) -> (f64, f64, bool) {
        let height = self.rng.random_range(2.1..2.6);
        let half = self.rng.random_range(0.28..0.42);
        (height, half, self.chance(0.4))
    }

    fn sign(&mut self, foot: DVec3, faces: DVec2, (height, half, round): (f64, f64, bool)) {
        self.model.pole(foot, 0.035, height + 0.6, 5, class::POLE);
        let board = GroundRect::new(foot.truncate() - faces * 0.06, faces, [0.015, half]);
        let (low, high) = (foot.z + height, foot.z + height + 2.0 * half);
        if round {
            // A round board is an octagon.
            let middle = board.middle.extend(0.5 * (low + high));
            let corner = |k: u32| {
                let (sin, cos) = maths::sin_cos(f64::from(k) * std::f64::consts::FRAC_PI_4);
                middle + (left_of(faces) * (half * cos)).extend(half * sin)
            };
            for k in 1..7 {
                self.model.triangle([corner(0), corner(k), corner(k + 1)], class::TRAFFIC_SIGN);
            }
        } else {
            self.model.block(&board, [low, high], class::TRAFFIC_SIGN);
        }
        self.take(foot.truncate(), 0.2);
    }

    fn light(&mut self, foot: DVec3, faces: DVec2) {
        self.model.pole(foot, 0.07, 3.6, 6, class::POLE);
        let board = GroundRect::new(foot.truncate() + faces * 0.2, faces, [0.14, 0.16]);
        self.model.block(&board, [foot.z + 2.5, foot.z + 3.45], class::TRAFFIC_LIGHT);
        let button = GroundRect { half: DVec2::splat(0.1), ..board };
        self.model.block(&button, [foot.z + 1.9, foot.z + 2.3], class::TRAFFIC_LIGHT);
        self.take(foot.truncate(), 0.2);
    }

    /// Signs and lights of the network, or at the lanes that lead into a junction.
    fn posts(&mut self) {
        let network = self.network;
        if !network.posts.is_empty() {
            return network.posts.iter().for_each(|post| self.brought_post(post));
        }
        let mut taken: Vec<DVec2> = Vec::new();
        for (foot, faces, light) in self.approaches() {
            let p = foot.truncate();
            if taken.iter().any(|t| t.distance(p) < 2.5) || !self.clear(p, 0.05, ROAD | HOUSE) {
                continue;
            }
            taken.push(p);
            self.post(foot, faces, light);
        }
    }

    /// A light, or a sign of usual size.
    fn post(&mut self, foot: DVec3, faces: DVec2, light: bool) {
        if light {
            return self.light(foot, faces);
        }
        let lots = self.sign_lots();
        self.sign(foot, faces, lots);
    }

    /// A signal of the map: a plate of its own size and height, on a post where it stands beside the road.
    fn brought_post(&mut self, post: &Post) {
        let (foot, faces) = (post.foot, post.faces);
        let on_road = !self.clear(foot.truncate(), 0.05, ROAD);
        let Some(plate) = post.plate else {
            match on_road {
                true => self.left_out += 1,
                false => self.post(foot, faces, post.light),
            }
            return;
        };
        if on_road && plate.low < foot.z + OVER_ROAD {
            self.left_out += 1;
            return;
        }
        let thick = if post.light { 0.14 } else { 0.015 };
        let half = [thick, 0.5 * plate.width];
        let board = GroundRect::new(foot.truncate() + faces * 0.2, faces, half);
        let class = if post.light { class::TRAFFIC_LIGHT } else { class::TRAFFIC_SIGN };
        self.model.block(&board, [plate.low, plate.low + plate.height], class);
        if !on_road {
            let height = plate.low + plate.height - foot.z;
            self.model.pole(foot, 0.05, height, 6, class::POLE);
            self.take(foot.truncate(), 0.2);
        }
    }

    fn approaches(&self) -> Vec<(DVec3, DVec2, bool)> {
        let lanes = &self.network.lanes;
        let leads = |lane: &&Lane| !lane.junction && lane.next.iter().any(|n| lanes[*n].junction);
        let lights = self.style.vehicles > 10;
        let lanes = lanes.iter().filter(leads);
        let found = lanes.filter_map(|lane| {
            let end = (lane.centre.length() - 1.0).max(0.0);
            let (at, heading) = (lane.centre.at(end), lane.centre.heading(end));
            let right = left_of(heading) * if lane.left_hand { 1.0 } else { -1.0 };
            let off = (2..60)
                .map(|k| 0.3 * f64::from(k))
                .find(|off| self.clear(at.truncate() + right * *off, 0.0, ROAD))?;
            let foot = at + (right * (off + 0.35)).extend(KERB);
            Some((foot, -heading, lights))
        });
        found.collect()
    }

    /// A bench, a bin, a box, a shelter.
    fn small(&mut self, foot: DVec3, ahead: DVec2) {
        let plot = |x: f64, y: f64| GroundRect::new(foot.truncate(), ahead, [0.5 * x, 0.5 * y]);
        let (z, class) = (foot.z, class::STATIC);
        match self.rng.random_range(0..4) {
            0 => {
                self.model.block(&plot(1.6, 0.4), [z + 0.4, z + 0.46], class);
                let back = plot(1.6, 0.06).part([-1.0, 1.0], [3.0, 5.0]);
                self.model.block(&back, [z + 0.5, z + 0.9], class);
                self.model.block(&plot(0.1, 0.4), [z, z + 0.4], class);
            }
            1 => self.model.pole(foot, 0.22, 0.9, 8, class),
            2 => self.model.block(&plot(0.9, 0.4), [z, z + 1.2], class),
            _ => self.model.pole(foot, 0.06, 1.0, 6, class::POLE),
        }
        self.take(foot.truncate(), 0.4);
    }

    /// Containers, pallets and heaps of a yard.
    fn goods(&mut self, foot: DVec3, ahead: DVec2) {
        let turned = if self.chance(0.5) { left_of(ahead) } else { ahead };
        let [x, y] = match self.rng.random_range(0..3) {
            0 => [6.1, 2.44],
            1 => [12.2, 2.44],
            _ => [1.2, 0.8],
        };
        let plot = GroundRect::new(foot.truncate(), turned, [0.5 * x, 0.5 * y]);
        let room = GroundRect { half: plot.half + 0.5, ..plot };
        if self.mask.touches(&room, ROAD | WALK | HOUSE | THING) {
            return;
        }
        if x < 2.0 {
            let height = self.rng.random_range(0.2..1.8);
            self.model.block(&plot, [foot.z, foot.z + height], class::OTHER);
        } else {
            let stacked = f64::from(self.rng.random_range(1..=3_u32));
            self.model.block(&plot, [foot.z, foot.z + 2.6 * stacked], class::STATIC);
        }
        self.mask.block(&plot, THING);
    }

    /// A guard rail along an edge, with posts.
    fn rail(&mut self, edge: &Line, out: f64) {
        self.barrier(&Line::new(edge.offset(out * 0.5)), class::GUARD_RAIL);
        if self.chance(0.5) {
            let fence_line = Line::new(edge.offset(out * 9.0));
            for s in (0..(fence_line.length() / 12.0) as u32).map(|k| 12.0 * f64::from(k)) {
                let middle = fence_line.at(s + 6.0).truncate();
                let line = GroundRect::new(middle, fence_line.heading(s + 6.0), [6.0, 0.4]);
                if !self.mask.touches(&line, ROAD | HOUSE) {
                    fence(&mut self.model, &line, self.terrain.height(middle), 2.0);
                }
            }
        }
    }

    /// A beam on posts along a line.
    fn barrier(&mut self, line: &Line, class: u16) {
        let mut s = 0.0;
        while s + 4.0 <= line.length() {
            let (a, b, ahead) = (line.at(s), line.at(s + 4.0), line.heading(s + 2.0));
            s += 4.0;
            if [a, b].iter().any(|p| self.of_map.near(class::GUARD_RAIL, p.truncate())) {
                continue;
            }
            let side = (left_of(ahead) * 0.06).extend(0.0);
            let [low, high] = [0.45, 0.78].map(|z| DVec3::Z * z);
            for side in [side, -side] {
                let [a, b] = [a + side, b + side];
                self.model.quad([a + low, b + low, b + high, a + high], class);
            }
            let top = [a - side, b - side, b + side, a + side].map(|p| p + high);
            self.model.quad(top, class);
            self.model.pole(a - DVec3::Z * 0.2, 0.06, 0.8, 4, class);
        }
    }

    fn median(&mut self, line: &Line) {
        if self.style.speed[1] > 20.0 {
            self.barrier(line, class::GUARD_RAIL);
            return;
        }
        let mut s = self.rng.random_range(3.0..9.0);
        while s < line.length() - 3.0 {
            self.tree(line.at(s), 0.6);
            s += self.rng.random_range(8.0..20.0);
        }
    }
}

/// Posts and two rails along the length of a plot.
fn fence(model: &mut Model, line: &GroundRect, z: f64, height: f64) {
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
