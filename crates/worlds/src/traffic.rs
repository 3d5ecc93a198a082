//! Who moves where, frame by frame: each is planned against those planned before and keeps its distance.

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::network::{Line, Network, left_of};
use lidar_cast::maths;

/// Metres that no two boxes come nearer than.
const CLEARANCE: f64 = 0.25;
/// Seconds of a vehicle's own speed that it keeps free ahead, and metres at rest.
const HEADWAY: f64 = 1.0;
const STANDSTILL: f64 = 1.5;
/// Metres a second squared.
const BRAKE: f64 = 5.0;
const GAS: f64 = 2.0;
const SIDEWAYS: f64 = 2.2;

/// Where something stands in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActorPose {
    pub at: DVec3,
    pub yaw: f64,
    pub pitch: f64,
}

/// Something planned: a stand a frame, or one for all.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// Length, width, height.
    pub size: [f64; 3],
    pub stands: Vec<ActorPose>,
    /// Metres kept free ahead in each frame.
    ahead: Vec<f64>,
}

impl Trajectory {
    /// Something at rest.
    pub fn parked(size: [f64; 3], stand: ActorPose) -> Self {
        Self { size, stands: vec![stand], ahead: vec![0.0] }
    }

    /// Something that walks at its own speed and keeps nothing free.
    pub fn walking(size: [f64; 3], stands: Vec<ActorPose>) -> Self {
        Self { size, ahead: vec![0.0; stands.len()], stands }
    }

    /// The stand in frame `t`.
    pub fn stand(&self, t: usize) -> &ActorPose {
        &self.stands[t.min(self.stands.len() - 1)]
    }

    /// Plan view of the box in frame `t`: grown by `grow`, and by `ahead` metres to the front.
    fn rect(&self, t: usize, grow: f64, ahead: f64) -> Rect {
        let stand = self.stand(t);
        let direction = DVec2::from_angle(stand.yaw);
        let half = DVec2::new(0.5 * (self.size[0] + ahead) + grow, 0.5 * self.size[1] + grow);
        let middle = stand.at.truncate() + direction * (0.5 * ahead);
        Rect { middle, direction, half, low: stand.at.z, high: stand.at.z + self.size[2] }
    }

    fn ahead(&self, t: usize) -> f64 {
        self.ahead[t.min(self.ahead.len() - 1)]
    }
}

#[derive(Debug, Clone, Copy)]
struct Rect {
    middle: DVec2,
    direction: DVec2,
    half: DVec2,
    low: f64,
    high: f64,
}

impl Rect {
    fn overlaps(&self, other: &Self) -> bool {
        let apart = other.middle - self.middle;
        let reach = self.half.length() + other.half.length();
        if apart.length_squared() > reach * reach || self.low > other.high || other.low > self.high
        {
            return false;
        }
        let axes = [self, other].map(|r| [r.direction, left_of(r.direction)]);
        let shadow = |r: &Self, axis: DVec2| {
            r.half.x * r.direction.dot(axis).abs() + r.half.y * left_of(r.direction).dot(axis).abs()
        };
        let separates =
            |axis: &DVec2| apart.dot(*axis).abs() > shadow(self, *axis) + shadow(other, *axis);
        !axes.iter().flatten().any(separates)
    }
}

/// All that has been planned.
#[derive(Debug, Default)]
pub struct Traffic {
    pub tracks: Vec<Trajectory>,
    pub frames: usize,
}

impl Traffic {
    /// True if `track` keeps clear of all others in every frame, and they keep their distance from it.
    pub fn fits(&self, track: &Trajectory) -> bool {
        let near = |other: &&Trajectory| {
            let apart = other.stand(0).at - track.stand(0).at;
            apart.length() < 60.0 + 6.0 * (self.frames as f64)
        };
        self.tracks.iter().filter(near).all(|other| {
            let still = track.stands.len() == 1 && other.stands.len() == 1;
            (0..if still { 1 } else { self.frames }).all(|t| {
                let mine = track.rect(t, 0.5 * CLEARANCE, 0.0);
                let others = other.rect(t, 0.5 * CLEARANCE, 0.0);
                let [my_way, their_way] =
                    [track.rect(t, 0.0, track.ahead(t)), other.rect(t, 0.0, other.ahead(t))];
                !mine.overlaps(&others) && !my_way.overlaps(&others) && !their_way.overlaps(&mine)
            })
        })
    }

    /// Adds a track that fits.
    pub fn add(&mut self, track: Trajectory) -> bool {
        let fits = self.fits(&track);
        if fits {
            self.tracks.push(track);
        }
        fits
    }

    /// Drives along `way` from `start` metres at `speed`, slower in bends and behind obstacles.
    pub fn drive(
        &self,
        way: &Line,
        start: f64,
        speed: f64,
        rate: f64,
        size: [f64; 3],
    ) -> Trajectory {
        let mut track = Trajectory { size, stands: Vec::new(), ahead: Vec::new() };
        let (mut s, mut v) = (start, speed.min(bend_speed(way, start)));
        for t in 0..self.frames {
            let free = self.free_ahead(way, s, v, t, size);
            let stop = (2.0 * BRAKE * 0.6 * (free - STANDSTILL).max(0.0)).sqrt();
            let follow = ((free - STANDSTILL) / HEADWAY).max(0.0).min(stop.max(0.0));
            let wanted = speed.min(bend_speed(way, s)).min(follow);
            if t == 0 {
                v = wanted;
            }
            track.stands.push(stand_on(way, s, size[0]));
            track.ahead.push(v * 0.5 * HEADWAY);
            v = wanted.clamp(v - BRAKE / rate, v + GAS / rate).max(0.0);
            s += v / rate;
        }
        track
    }

    /// Metres from the front to the nearest box on the way in frame `t`, at most a stopping distance.
    fn free_ahead(&self, way: &Line, s: f64, v: f64, t: usize, size: [f64; 3]) -> f64 {
        let look = STANDSTILL + v * HEADWAY * 1.5 + v * v / (2.0 * BRAKE * 0.6) + 4.0;
        let here = way.at(s).truncate();
        let reach = look + size[0] + 15.0;
        let near = self
            .tracks
            .iter()
            .filter(|o| o.stand(t).at.truncate().distance_squared(here) < reach * reach);
        let near: Vec<Rect> = near.map(|o| o.rect(t, 0.15, 0.0)).collect();
        if near.is_empty() {
            return look;
        }
        let front = s + 0.5 * size[0];
        let steps = (look / 1.0).ceil() as usize;
        (0..steps)
            .map(|k| k as f64 + 0.5)
            .find(|d| {
                let at = way.at(front + d);
                let probe = Rect {
                    middle: at.truncate(),
                    direction: way.heading(front + d),
                    half: DVec2::new(0.5, 0.5 * size[1] + 0.1),
                    low: at.z,
                    high: at.z + size[2],
                };
                near.iter().any(|r| r.overlaps(&probe))
            })
            .map_or(look, |d| d - 0.5)
    }
}

/// The stand of a vehicle whose middle is `s` metres along a way: axles on the line, pitch with it.
pub fn stand_on(way: &Line, s: f64, length: f64) -> ActorPose {
    let (rear, front) = (way.at(s - 0.3 * length), way.at(s + 0.3 * length));
    let chord = front - rear;
    let at = (rear + front) * 0.5;
    let flat = chord.truncate();
    let yaw = if flat.length() > 1e-6 { flat.to_angle() } else { 0.0 };
    // A nose up is a negative pitch about y to the left.
    ActorPose { at, yaw, pitch: -maths::atan2(chord.z, flat.length().max(1e-6)) }
}

/// Metres a second in the sharpest bend just ahead.
fn bend_speed(way: &Line, s: f64) -> f64 {
    let turn = |d: f64| {
        let angle = way.heading(s + d).angle_to(way.heading(s + d + 3.0)).abs();
        angle / 3.0
    };
    let sharpest = [0.0, 4.0, 8.0, 12.0].into_iter().map(turn).fold(0.0, f64::max);
    (SIDEWAYS / sharpest.max(1e-3)).sqrt().max(2.5)
}

/// A way along lanes from `first`, at least `length` metres where lanes go on; branches by lot.
pub fn way(network: &Network, first: usize, length: f64, rng: &mut ChaCha8Rng) -> Line {
    let mut line = network.lanes[first].centre.clone();
    let mut lane = first;
    for _ in 0..1000 {
        let next = &network.lanes[lane].next;
        if line.length() >= length || next.is_empty() {
            break;
        }
        lane = next[rng.random_range(0..next.len())];
        line.extend(&network.lanes[lane].centre);
    }
    line
}
