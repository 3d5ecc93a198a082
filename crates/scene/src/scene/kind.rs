//! Kinds of actors, finer than classes: a detector is trained to find them.

use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Kind of an actor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ActorKind {
    /// Passenger car.
    Car,
    /// Delivery van.
    Van,
    /// Lorry, with its load.
    Truck,
    /// Bus or tram.
    Bus,
    /// Trailer behind a truck or a car.
    Trailer,
    /// Excavator, crane, forklift and the like.
    Construction,
    /// Motorcycle with its rider.
    Motorcycle,
    /// Bicycle with its rider.
    Bicycle,
    /// Person on foot.
    Pedestrian,
    /// Animal.
    Animal,
    /// Anything else that moves.
    Other,
}

impl ActorKind {
    /// All kinds with their names in scene files.
    pub const NAMES: [(Self, &'static str); 11] = [
        (Self::Car, "car"),
        (Self::Van, "van"),
        (Self::Truck, "truck"),
        (Self::Bus, "bus"),
        (Self::Trailer, "trailer"),
        (Self::Construction, "construction"),
        (Self::Motorcycle, "motorcycle"),
        (Self::Bicycle, "bicycle"),
        (Self::Pedestrian, "pedestrian"),
        (Self::Animal, "animal"),
        (Self::Other, "other"),
    ];

    /// Name in scene files.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(kind, _)| *kind == self).map_or("other", |(_, name)| name)
    }

    /// The kind of an actor whose first triangle has `class`: as written, or guessed from the class.
    pub(super) fn read(
        at: &Place,
        written: Option<&str>,
        class: Option<&str>,
    ) -> Result<Self, DescriptionError> {
        let Some(written) = written else {
            return Ok(match class {
                Some("vehicle" | "car" | "moving-car") => Self::Car,
                Some("pedestrian" | "person" | "moving-person") => Self::Pedestrian,
                _ => Self::Other,
            });
        };
        let found = Self::NAMES.iter().find(|(_, name)| *name == written);
        found.map(|(kind, _)| *kind).ok_or_else(|| {
            let known: Vec<&str> = Self::NAMES.iter().map(|(_, name)| *name).collect();
            bad(at, format!("{written:?}"), format!("a kind of actor: {}", known.join(", ")))
        })
    }
}
