//! Rules on targets: distance and bearings at which a rig must detect them.

use std::path::Path;
use std::sync::Arc;

use super::description::RequirementDescription;
use crate::scene::Target;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Location};

/// Distance from which on a rule counts where it does not say, metres.
const FROM: f64 = 5.0;
/// Beams from which on a target is met where a rule does not say.
const BEAMS: u64 = 5;
/// Most beams of a rule.
const MOST_BEAMS: u64 = 100;
/// Farthest distance of a rule, metres.
const FARTHEST: f64 = 1000.0;

/// A target that must be met at a share of places on level ground around the vehicle, the own body in the way.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetRule {
    /// Name in reports.
    pub name: String,
    /// The target.
    pub target: Arc<Target>,
    /// Nearest distance from the ego origin to the middle of the target, metres.
    pub from: f64,
    /// Farthest distance, metres.
    pub within: f64,
    /// First and last bearing, degrees counter-clockwise from straight ahead; 360 apart for all round.
    pub bearings: [f64; 2],
    /// Beams of all LiDARs together from which on the target is met.
    pub beams: u32,
    /// Least share of the places at which it must be met, from 0 to 1.
    pub share: f64,
    /// The share must hold without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

impl TargetRule {
    /// Reads the rule at `at`; target files are in `dir`.
    pub(super) fn new(
        at: &Location,
        required: &RequirementDescription,
        target: &str,
        dir: &Path,
    ) -> Result<Self, DescriptionError> {
        let missing = |key, mend: &str| DescriptionError::Missing {
            at: Box::new(at.clone()),
            key,
            mend: mend.to_owned(),
        };
        const OWN: [&str; 7] =
            ["target", "from", "within", "bearing", "beams", "share", "without_any_one"];
        required.has_only(at, &OWN, |key| match key {
            "depth" => "it is of a `blind_zone`; a `target` has `within`",
            _ => "a `target` stands on the ground around the vehicle; leave the box out",
        })?;
        let target = Target::named_at(&at.key("target"), dir, target)?;
        let within = required.within.ok_or_else(|| {
            missing("within", "say up to which distance, `\"within\": 40` for example")
        })?;
        let from = required.from.unwrap_or(FROM.min(within.max(0.0)));
        if !(0.0..=FARTHEST).contains(&from) {
            return Err(bad(&at.key("from"), from, format!("metres from 0 to {FARTHEST}")));
        }
        if !(from..=FARTHEST).contains(&within) || within == 0.0 {
            let wanted = format!("metres from {from} (`from`) to {FARTHEST}");
            return Err(bad(&at.key("within"), within, wanted));
        }
        let [low, high] = required.bearing.unwrap_or([-180.0, 180.0]);
        let is_turn = (-360.0..=360.0).contains(&low) && low <= high && high - low <= 360.0;
        if !is_turn {
            let wanted = "[first, last] in degrees, the smaller first, at most a turn apart";
            return Err(bad(&at.key("bearing"), format!("{:?}", [low, high]), wanted));
        }
        let beams = required.beams.unwrap_or(BEAMS);
        let beams = check::count(&at.key("beams"), beams, 1, MOST_BEAMS)?;
        let name = required.named(at, format!("{} to {within} m", target.name))?;
        Ok(Self {
            name,
            target: Arc::new(target),
            from,
            within,
            bearings: [low, high],
            beams,
            share: required.share(at)?,
            without_any_one: required.without_any_one,
        })
    }
}
