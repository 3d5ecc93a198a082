//! Incomplete echoes as published: points of vehicles go missing, class by class.

use super::cloud::{Draws, points};
use crate::scan::{Scan, Status};
use crate::scene::ActorKind;

/// Fewest points of a class, and one more, of which any are taken.
const TOO_FEW: usize = 10;
/// What the public label sets call vehicles; a van is a car to them.
const VEHICLES: [&str; 8] =
    ["car", "truck", "bus", "trailer", "construction", "motorcycle", "bicycle", "other-vehicle"];

/// The group of vehicles that a class or a kind of actor belongs to.
fn group_of_name(name: &str) -> Option<usize> {
    let name = match name {
        "vehicle" | "moving-car" | "van" => "car",
        other => other,
    };
    VEHICLES.iter().position(|vehicle| *vehicle == name)
}

/// Takes ⌊ratio·n⌋ points of each group of vehicles with n > 10 points.
///
/// A point belongs to the kind of its actor, or else to its class.
pub(super) fn apply(scan: &mut Scan, draws: &Draws, ratio: f64) {
    let kinds: std::collections::HashMap<u16, ActorKind> =
        scan.boxes.iter().map(|tracked| (tracked.instance, tracked.kind)).collect();
    let by_class: Vec<_> = scan.classes.iter().map(|class| group_of_name(class)).collect();
    let mut groups = vec![Vec::new(); VEHICLES.len()];
    for k in points(scan) {
        let beam = &scan.returns[k];
        let class = || by_class.get(usize::from(beam.class)).copied().flatten();
        let group = match kinds.get(&beam.instance) {
            Some(ActorKind::Pedestrian | ActorKind::Animal) => None,
            Some(kind) => group_of_name(kind.name()).or_else(class),
            None => class(),
        };
        if let Some(group) = group {
            groups[group].push(k);
        }
    }
    for group in groups.iter().filter(|group| group.len() > TOO_FEW) {
        let wanted = (ratio * group.len() as f64).floor() as usize;
        for k in draws.choose(scan, group, wanted) {
            scan.returns[k].remove(Status::Dropped);
        }
    }
}
