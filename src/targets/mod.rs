//! Targets at range: how many beams of a rig meet a car, a child, a tyre, at which distance and bearing.
//!
//! A target stands alone on level ground, with the own body in the way, or in a frame of a scene, with all that is
//! there. A beam counts if its closest hit is the target. Distances are from the origin of the ego frame to the
//! middle of the target in plan, bearings in degrees counter-clockwise from straight ahead; the target's own axis
//! lies along x.
//!
//! | file | holds |
//! |---|---|
//! | `apart` | rules on overlap that no rig on some poses meets |
//! | `beams` | beams of a placement on targets |
//! | `bodies` | the own bodies in every pose that they take, and scenes, for rules |
//! | `bounded` | upper bounds on the shares of rules, for the bound of a search |
//! | `by_scene` | rules in each of several scenes |
//! | `card` | the range card, and blind sectors |
//! | `finder` | beams of a sensor model near a direction |
//! | `ground` | ground of a scene below a place, and whether a target has room there |
//! | `missing` | places of a rule that are not met, in words |
//! | `on_ground` | a vehicle on the ground of a scene alone, for range cards |
//! | `places` | places of a rule on targets, and a look at places closer together |
//! | `plan` | the own body from above: places that it takes |
//! | `reach` | rules on targets and ground that no rig on some poses meets, or that no place or cell counts for |
//! | `relief` | ground of a scene that is not level |
//! | `rules` | rules on targets, near ground and overlap, and how far they are met |
//! | `sight` | beams of LiDARs at the places of rules and of a car all round |
//! | `table` | the study: beams by distance and bearing, the range of first detection |

mod all_round;
mod apart;
mod beams;
mod bodies;
mod bounded;
mod by_scene;
mod card;
mod finder;
mod ground;
mod missing;
mod on_ground;
mod places;
mod plan;
mod reach;
mod relief;
mod rules;
mod sight;
mod table;

pub(crate) use all_round::CarAllRound;
pub use beams::{PlacedTarget, Receiving, TargetSite};
pub(crate) use bodies::BodyPoses;
pub use card::{BearingRanges, BlindSector, CARD_BEAMS, RangeCard, TargetRanges, card_bearings};
pub use ground::GroundBelow;
pub(crate) use missing::missed_places;
pub use on_ground::CardGround;
pub(crate) use on_ground::stands_in_words;
pub(crate) use places::{look_between, places_of};
pub(crate) use reach::{MountPoses, OutOfReach, check_counting};
pub(crate) use relief::Relief;
pub use sight::{CAR_WEIGHT, Cars, Sight, SightBeams};
pub use table::{Detection, TargetQuestion, TargetRow, TargetTable, is_bearing, is_distance};

#[cfg(test)]
mod tests;
