//! Rules of a mount, and the ways in which a placement breaks them.

use std::cmp::Ordering;
use std::sync::Arc;

use glam::DVec3;

use super::doubts::{likely_degrees, outside_in_words, stands_on};
use super::pairing::{SLACK, not_mirrored};
use super::{Placement, Region, SensorName, SensorPose};
use crate::scene::around;
use sightline_files::json::counted;

/// Rules for a placement: a region and a model for each LiDAR, distances, keep-out boxes, ties.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Constraints {
    /// One a LiDAR of a placement.
    pub slots: Vec<Slot>,
    /// Least distance between two LiDARs, in metres.
    pub min_distance: f64,
    /// Lower and upper corners of the boxes in the ego frame that LiDARs keep out of, in metres; faces are
    /// allowed.
    pub keep_out: Vec<[[f64; 3]; 2]>,
    /// Rules that tie the LiDARs of a placement together. Mirrored pairs come first, the two LiDARs of a
    /// pair side by side.
    pub ties: Ties,
    /// Model of LiDARs that name none.
    pub first: SensorName,
    /// Mounts that hold no LiDAR: their `count` is 0.
    pub closed: Vec<Arc<Region>>,
}

/// Region, model and phase allowed to one LiDAR of a placement.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Where it may stand.
    pub region: Arc<Region>,
    /// Its model; none: the vehicle's first.
    pub sensor: SensorName,
    /// Bounds in radians, lowest and highest, of the phase at which the search locks it; `None` where the
    /// search leaves the phase alone.
    pub phase: Option<[f64; 2]>,
    /// Further models that a given placement may have here; a search puts `sensor` here and no other.
    pub others: Vec<OtherModel>,
}

/// A further model that a slot allows to given placements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherModel {
    /// Its name.
    pub sensor: SensorName,
    /// Bounds in radians, lowest and highest, of the phase at which it is locked; `None` where any phase will do.
    pub phase: Option<[f64; 2]>,
}

impl Slot {
    /// The phase of a sensor that names none.
    pub(super) fn phase_at_rest(&self) -> Option<f64> {
        self.phase.map(|[from, to]| 0.0_f64.clamp(from, to))
    }

    /// Bounds of the phase of a model, in radians; `None` where the slot does not allow the model at all.
    fn allows(&self, sensor: SensorName) -> Option<Option<[f64; 2]>> {
        if self.sensor == sensor {
            return Some(self.phase);
        }
        self.others.iter().find(|other| other.sensor == sensor).map(|other| other.phase)
    }
}

impl Constraints {
    /// Bounds alone: `lidars` LiDARs of the first model in a box of the ego frame, with lower and upper
    /// bounds of x, y, z (m), roll, pitch and yaw (rad).
    pub fn in_box(lower: [f64; 6], upper: [f64; 6], lidars: usize) -> Self {
        let region = Arc::new(Region { lower, upper, ..Region::default() });
        let sensor = SensorName::default();
        let slot = Slot { region, sensor, phase: None, others: Vec::new() };
        Self { slots: vec![slot; lidars], ..Self::default() }
    }

    /// Number of LiDARs of a placement.
    pub fn lidars(&self) -> usize {
        self.slots.len()
    }

    /// A copy with `lidars` slots, each equal to the first.
    pub fn with_lidars(&self, lidars: usize) -> Self {
        let slots = self.slots.first().map(|slot| vec![slot.clone(); lidars]);
        Self { slots: slots.unwrap_or_default(), ..self.clone() }
    }

    /// A copy with every region changed.
    pub fn with_regions(&self, change: impl Fn(&mut Region)) -> Self {
        let mut changed = self.clone();
        let held = changed.slots.iter_mut().map(|slot| &mut slot.region);
        held.chain(&mut changed.closed).for_each(|region| change(Arc::make_mut(region)));
        changed
    }

    /// Different slots in order of their first LiDAR, and how many LiDARs have each.
    pub fn kinds(&self) -> Vec<(&Slot, usize)> {
        let mut kinds: Vec<(&Slot, usize)> = Vec::new();
        for slot in &self.slots {
            // Slots of one kind are neighbours in most lists: the last kind is looked at first.
            match kinds.iter_mut().rev().find(|(known, _)| *known == slot) {
                Some((_, count)) => *count += 1,
                None => kinds.push((slot, 1)),
            }
        }
        kinds
    }

    /// Corners of the smallest box around all regions, in the ego frame.
    pub fn corners(&self) -> [[f64; 3]; 2] {
        let corners = self.slots.iter().flat_map(|slot| slot.region.corners());
        around(corners.map(DVec3::from)).unwrap_or_default().map(|corner| corner.to_array())
    }

    /// True if a slot is for a sensor of this model.
    fn has_model(&self, slot: usize, pose: &SensorPose) -> bool {
        self.slots[slot].allows(self.model_of(pose)).is_some()
    }

    fn model_of(&self, pose: &SensorPose) -> SensorName {
        if pose.sensor.is_none() { self.first } else { pose.sensor }
    }

    /// A slot for each LiDAR of a placement, by its model and where it stands: the nearest ones where it
    /// has too many of a kind. Slots that are alike go to LiDARs in the order of their fields.
    pub(super) fn slots_of(&self, lidars: &[SensorPose]) -> Vec<Option<usize>> {
        let mut free: Vec<bool> = vec![true; self.slots.len()];
        let mut chosen = vec![None; lidars.len()];
        let mut order: Vec<usize> = (0..lidars.len()).collect();
        order.sort_by(|&a, &b| in_order(&lidars[a], &lidars[b]));
        // LiDARs that stand in a region come first; the others take the remaining slots.
        for must_fit in [true, false] {
            for &lidar in &order {
                let pose = &lidars[lidar];
                if chosen[lidar].is_some() {
                    continue;
                }
                let off = |slot: usize| -> f64 {
                    self.slots[slot].region.outside(pose).iter().map(|(_, by)| by).sum()
                };
                let fits = |slot: &usize| free[*slot] && self.has_model(*slot, pose);
                let nearest = (0..self.slots.len())
                    .filter(fits)
                    .map(|slot| (slot, off(slot)))
                    .min_by(|a, b| a.1.total_cmp(&b.1))
                    .filter(|(_, off)| !must_fit || *off == 0.0);
                if let Some((slot, _)) = nearest {
                    free[slot] = false;
                    chosen[lidar] = Some(slot);
                } else if must_fit {
                    let mut tried = vec![false; self.slots.len()];
                    self.make_room(lidar, lidars, &mut chosen, &mut tried);
                    chosen.iter().flatten().for_each(|&slot| free[slot] = false);
                }
            }
        }
        chosen
    }

    /// Gives a LiDAR a slot that it fits; the LiDAR that held the slot moves to another one that it fits, and so on. Slots
    /// in `tried` stay as they are. False if there is no such slot.
    fn make_room(
        &self,
        lidar: usize,
        lidars: &[SensorPose],
        chosen: &mut [Option<usize>],
        tried: &mut [bool],
    ) -> bool {
        let pose = &lidars[lidar];
        for slot in 0..self.slots.len() {
            let is_open = !tried[slot] && self.has_model(slot, pose);
            if !is_open || !self.slots[slot].region.outside(pose).is_empty() {
                continue;
            }
            tried[slot] = true;
            let holder = chosen.iter().position(|taken| *taken == Some(slot));
            if holder.is_none_or(|holder| self.make_room(holder, lidars, chosen, tried)) {
                chosen[lidar] = Some(slot);
                return true;
            }
        }
        false
    }

    /// The mount that each LiDAR of a placement stands on, by its model and pose: the nearest free one; `None` where none
    /// is left for its model.
    pub fn mounts_of(&self, lidars: &[SensorPose]) -> Vec<Option<&Region>> {
        let slots = self.slots_of(lidars).into_iter();
        slots.map(|slot| slot.map(|slot| &*self.slots[slot].region)).collect()
    }

    /// The LiDARs of a placement in the order of the slots; `None` unless each slot has one.
    pub fn in_slots(&self, lidars: &[SensorPose]) -> Option<Vec<SensorPose>> {
        if lidars.len() != self.slots.len() {
            return None;
        }
        let mut by_slot: Vec<(usize, SensorPose)> = Vec::new();
        for (slot, pose) in self.slots_of(lidars).into_iter().zip(lidars) {
            by_slot.push((slot?, *pose));
        }
        by_slot.sort_by_key(|(slot, _)| *slot);
        Some(by_slot.into_iter().map(|(_, pose)| pose).collect())
    }

    /// Broken rules; empty for a placement that keeps all.
    pub fn violations(&self, placement: &Placement) -> Vec<Violation> {
        let mut found = Vec::new();
        let alike = self.kinds().len() == 1;
        let slots = if alike { Vec::new() } else { self.slots_of(&placement.lidars) };
        for (lidar, pose) in placement.lidars.iter().enumerate() {
            let slot = if alike { Some(0) } else { slots[lidar] };
            let Some(slot) = slot.filter(|&slot| self.has_model(slot, pose)) else {
                let none = Violation::NoPlace { lidar, sensor: pose.sensor };
                found.push(self.on_closed(lidar, pose, none.amount()).unwrap_or(none));
                continue;
            };
            self.off_mount(lidar, pose, slot, &mut found);
        }
        for (a, first) in placement.lidars.iter().enumerate() {
            for (b, second) in placement.lidars.iter().enumerate().skip(a + 1) {
                let by = self.min_distance - first.position().distance(second.position());
                if by > SLACK {
                    found.push(Violation::TooClose { lidars: [a, b], by });
                }
            }
        }
        for (lidar, pose) in placement.lidars.iter().enumerate() {
            let inside = self.depths(pose.position().to_array());
            found.extend(inside.map(|(keep_out, by)| Violation::KeptOut { lidar, keep_out, by }));
        }
        if self.ties.equal_height {
            let heights = placement.lidars.iter().map(|pose| pose.z);
            let by = heights.clone().fold(f64::MIN, f64::max) - heights.fold(f64::MAX, f64::min);
            found.extend((by > SLACK).then_some(Violation::UnequalHeight { by }));
        }
        if self.ties.symmetric {
            found.extend(not_mirrored(&placement.lidars));
        }
        found
    }

    /// Broken bounds of a LiDAR: outside its mount, on a mount that does not take it, at another phase.
    fn off_mount(&self, lidar: usize, pose: &SensorPose, slot: usize, found: &mut Vec<Violation>) {
        let region = &self.slots[slot].region;
        if pose.rides_on != region.rides_on {
            let (mount, rides_on) = (region.own_name().to_owned(), region.rides_on);
            found.push(Violation::CarriedOtherwise { lidar, mount, rides_on });
        }
        let outside = |(field, by)| {
            let mount = region.own_name().to_owned();
            let degrees = likely_degrees(region, pose, field);
            Violation::OutsideMount { lidar, mount, field, by, degrees }
        };
        let off = region.outside(pose);
        let mut regions = self.slots.iter().map(|slot| &slot.region);
        match regions.find(|region| !off.is_empty() && region.outside(pose).is_empty()) {
            Some(other) => {
                let of_mount: Vec<&Slot> =
                    self.slots.iter().filter(|slot| slot.region.name == other.name).collect();
                let mut takes: Vec<SensorName> = Vec::new();
                for slot in &of_mount {
                    let models = slot.others.iter().map(|other| other.sensor);
                    takes.extend(std::iter::once(slot.sensor).chain(models));
                }
                takes.sort_unstable_by_key(ToString::to_string);
                takes.dedup();
                let (mount, room) = (other.name.clone(), of_mount.len());
                let by = off.iter().map(|(_, by)| by).sum();
                let sensor = self.model_of(pose);
                found.push(Violation::NotTaken { lidar, sensor, mount, takes, room, by });
            }
            None if off.is_empty() => {}
            None => match self.on_closed(lidar, pose, off.iter().map(|(_, by)| by).sum()) {
                Some(closed) => found.push(closed),
                None => found.extend(off.into_iter().map(outside)),
            },
        }
        let bounds = self.slots[slot].allows(self.model_of(pose)).flatten();
        if let (Some([from, to]), Some(phase)) = (bounds, pose.phase) {
            let by = (from - phase).max(phase - to);
            found.extend((by > SLACK).then(|| outside(("phase", by))));
        }
    }

    /// The broken rule of a LiDAR on a mount that holds none; `by` is its distance from the nearest other place.
    fn on_closed(&self, lidar: usize, pose: &SensorPose, by: f64) -> Option<Violation> {
        let mount = self.closed.iter().find(|region| stands_on(region, pose))?.name.clone();
        let (sensor, takes, room) = (self.model_of(pose), Vec::new(), 0);
        Some(Violation::NotTaken { lidar, sensor, mount, takes, room, by })
    }

    /// Keep-out boxes around a point, and its depth in each.
    fn depths(&self, point: [f64; 3]) -> impl Iterator<Item = (usize, f64)> {
        let depths = self.keep_out.iter().enumerate().map(move |(index, [min, max])| {
            let to_face = (0..3).map(|k| (point[k] - min[k]).min(max[k] - point[k]));
            (index, to_face.fold(f64::MAX, f64::min))
        });
        depths.filter(|&(_, by)| by > SLACK)
    }

    /// True if a pose lies outside of every keep-out box.
    pub fn is_clear(&self, pose: &SensorPose) -> bool {
        self.depths(pose.position().to_array()).next().is_none()
    }

    /// Rules without the ties.
    pub fn untied(&self) -> Self {
        Self { ties: Ties::default(), ..self.clone() }
    }

    /// Rules that leave no phase to the search: sensors are where those are that name none.
    pub fn without_phases(&self) -> Self {
        let mut changed = self.clone();
        for slot in &mut changed.slots {
            slot.phase = None;
            slot.others.iter_mut().for_each(|other| other.phase = None);
        }
        changed
    }
}

/// Rules between the LiDARs of a placement; a search keeps them by having fewer variables.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Ties {
    /// All LiDARs stand at one height.
    pub equal_height: bool,
    /// LiDARs come in pairs mirrored at the plane y = 0: y, roll and yaw change sign. An odd one lies in
    /// the plane, with roll and yaw 0.
    pub symmetric: bool,
}

impl Ties {
    /// True if any rule ties LiDARs together.
    pub fn any(&self) -> bool {
        self.equal_height || self.symmetric
    }
}

/// Order of poses: by x, then y, z, roll, pitch, yaw.
fn in_order(a: &SensorPose, b: &SensorPose) -> Ordering {
    let fields = a.values().into_iter().zip(b.values());
    fields.fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(&b)))
}

/// One broken rule of a placement. `lidar` is the index of a LiDAR, `sensor` its model, `mount` the name of the mount that
/// it stands on; `by` is the distance from keeping the rule, in m or rad.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the enum and its variants tell the fields")]
pub enum Violation {
    /// A LiDAR lies outside the bounds of `field`: `x`, `y`, `z`, `roll`, `pitch`, `yaw` or `phase`. The mount of a scene
    /// has an empty name. `degrees` is the angle of the pose where it is most likely one in degrees.
    OutsideMount { lidar: usize, mount: String, field: &'static str, by: f64, degrees: Option<f64> },
    /// A LiDAR stands on a mount that takes other models, or is full with `room` LiDARs. `by` leads to the nearest free
    /// mount for its model.
    NotTaken {
        lidar: usize,
        sensor: SensorName,
        mount: String,
        takes: Vec<SensorName>,
        room: usize,
        by: f64,
    },
    /// A LiDAR stands on a mount that the own body `rides_on` carries, or none, and rides on another, or on none.
    CarriedOtherwise { lidar: usize, mount: String, rides_on: SensorName },
    /// No slot is left for a LiDAR of its model.
    NoPlace { lidar: usize, sensor: SensorName },
    /// Two LiDARs are closer than allowed.
    TooClose { lidars: [usize; 2], by: f64 },
    /// A LiDAR lies inside a keep-out box, by metres from its nearest face.
    KeptOut { lidar: usize, keep_out: usize, by: f64 },
    /// The LiDARs stand at different heights against the rule, from the lowest to the highest.
    UnequalHeight { by: f64 },
    /// A LiDAR has no mirror image among the others, and does not lie in the plane of symmetry. The image of `partner` is
    /// nearest to it, which may be the LiDAR itself. `models` names both models where they differ, `field` is farthest off,
    /// by `off`. `by` sums up the differences of all fields, over both LiDARs where each is nearest to the other's image.
    NotMirrored {
        lidar: usize,
        partner: usize,
        models: Option<[SensorName; 2]>,
        field: &'static str,
        off: f64,
        by: f64,
    },
}

impl Violation {
    /// Distance from keeping the rule, in m or rad.
    pub fn amount(&self) -> f64 {
        match self {
            Self::OutsideMount { by, .. }
            | Self::NotTaken { by, .. }
            | Self::TooClose { by, .. }
            | Self::KeptOut { by, .. }
            | Self::UnequalHeight { by }
            | Self::NotMirrored { by, .. } => *by,
            // Farther than anything that a move of a LiDAR mends.
            Self::NoPlace { .. } | Self::CarriedOtherwise { .. } => 1e3,
        }
    }

    /// The rule in words, angles in degrees.
    pub fn in_degrees(&self) -> String {
        // Whoever reads in degrees has written degrees.
        let mut told = self.clone();
        if let Self::OutsideMount { degrees, .. } = &mut told {
            *degrees = None;
        }
        let words = told.to_string();
        match self {
            Self::OutsideMount { by, .. } => {
                let degrees = format!(" is {:.2}° outside ", by.to_degrees());
                words.replacen(&format!(" is {by:.3} rad outside "), &degrees, 1)
            }
            Self::NotMirrored { off, .. } => {
                let degrees = format!(" is off by {:.2}° ", off.to_degrees());
                words.replacen(&format!(" is off by {off:.3} rad "), &degrees, 1)
            }
            _ => words,
        }
    }
}

/// Words for a mount whose `count` is 0.
pub(super) const HOLDS_NONE: &str = "holds no LiDAR (`count` is 0)";

/// The body that carries a mount, up to the mount's name.
fn carrier_in_words(body: SensorName) -> String {
    match body.as_str() {
        "" => "leave `rides_on` out, since no body carries".to_owned(),
        body => format!("add `{body}` as its `rides_on`, which carries"),
    }
}

fn unit_of(field: &str) -> &'static str {
    if matches!(field, "x" | "y" | "z") { "m" } else { "rad" }
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutsideMount { lidar, mount, field, by, degrees } => {
                let name = if mount.is_empty() { "" } else { " " };
                let (far, doubt) = outside_in_words(*by, unit_of(field), *degrees);
                write!(f, "LiDAR {lidar}: {field} is {far} outside the mount{name}{mount}{doubt}")
            }
            Self::NotTaken { lidar, sensor, mount, takes, room, .. } => {
                write!(f, "LiDAR {lidar}: it stands on mount {mount}, which ")?;
                if *room == 0 {
                    return f.write_str(HOLDS_NONE);
                }
                if takes.contains(sensor) {
                    return write!(f, "holds {} at most", counted(*room, "LiDAR"));
                }
                let takes: Vec<String> = takes.iter().map(|model| format!("`{model}`")).collect();
                write!(f, "takes {}, not `{sensor}`", takes.join(" or "))
            }
            Self::CarriedOtherwise { lidar, mount, rides_on } => {
                write!(f, "LiDAR {lidar}: {} mount {mount}", carrier_in_words(*rides_on))
            }
            Self::NoPlace { lidar, sensor } => {
                let named = format!("`{sensor}`");
                let one = if sensor.is_none() { "sensor without a name" } else { &named };
                write!(f, "LiDAR {lidar}: there is no mount for one more {one}")
            }
            Self::TooClose { lidars: [a, b], by } => {
                write!(f, "LiDARs {a} and {b} are {by:.3} m too close")
            }
            Self::KeptOut { lidar, keep_out, by } => {
                write!(f, "LiDAR {lidar} is {by:.3} m inside of keep_out[{keep_out}]")
            }
            Self::UnequalHeight { by } => {
                write!(f, "heights differ by {by:.3} m, and are to be equal")
            }
            Self::NotMirrored { lidar, partner, models: Some([own, other]), .. } => {
                let (a, b) = (lidar.min(partner), lidar.max(partner));
                let [first, second] = if a == lidar { [own, other] } else { [other, own] };
                let told = "a mirrored pair at the plane y = 0 has one model";
                write!(f, "LiDARs {a} and {b}: {told}, not `{first}` and `{second}`")
            }
            Self::NotMirrored { lidar, partner, field, off, .. } => {
                match lidar == partner {
                    true => write!(f, "LiDAR {lidar}")?,
                    false => write!(f, "LiDARs {} and {}", lidar.min(partner), lidar.max(partner))?,
                }
                let unit = unit_of(field);
                write!(
                    f,
                    ": {field} is off by {off:.3} {unit} from a mirror image at the plane y = 0"
                )
            }
        }
    }
}
