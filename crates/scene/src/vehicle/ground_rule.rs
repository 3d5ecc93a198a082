//! Rules on the ground near the vehicle: how much of it must be seen, and how near.

use super::description::RequirementDescription;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Location};

/// Farthest ground of a rule, metres from the outline of the own body.
pub const FARTHEST_GROUND: f64 = 10.0;

/// A side of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Before the front edge.
    Ahead,
    /// Behind the rear edge.
    Behind,
    /// Beside the left edge.
    Left,
    /// Beside the right edge.
    Right,
}

impl Side {
    /// Every side.
    pub const ALL: [Self; 4] = [Self::Ahead, Self::Behind, Self::Left, Self::Right];

    /// Its name in files and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ahead => "ahead",
            Self::Behind => "behind",
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// The side as a mirror at the plane y = 0 shows it.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
            other => other,
        }
    }
}

/// Ground that a rule asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GroundAsked {
    /// All ground up to a distance from the outline of the own body, metres. The share counts cells.
    Within(f64),
    /// The blind zone on one side ends within a distance from the edge, metres. The share counts lanes.
    BlindZone(Side, f64),
}

/// Ground near the vehicle that must be seen, as the near field measures it in a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundRule {
    /// Name in reports.
    pub name: String,
    /// Ground that it asks for.
    pub asked: GroundAsked,
    /// Least share of it, from 0 to 1.
    pub share: f64,
    /// The share must hold without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

impl GroundRule {
    /// Reads the rule at `at`; `None` where it is of another kind.
    pub(super) fn read(
        at: &Location,
        required: &RequirementDescription,
    ) -> Result<Option<Self>, DescriptionError> {
        let asked = match (required.ground, &required.blind_zone) {
            (None, None) => return Ok(None),
            (Some(_), Some(_)) => {
                return Err(misplaced(at, "blind_zone", "`ground` is another rule; write two"));
            }
            (Some(within), None) => GroundAsked::Within(distance(at, "ground", within)?),
            (None, Some(side)) => {
                let side = side_named(at, side)?;
                let depth = required.depth.ok_or_else(|| DescriptionError::Missing {
                    at: Box::new(at.clone()),
                    key: "depth",
                    mend: "say within how many metres the blind zone must end, `\"depth\": 2` for example"
                        .to_owned(),
                })?;
                GroundAsked::BlindZone(side, distance(at, "depth", depth)?)
            }
        };
        let (default, share) = match asked {
            GroundAsked::Within(metres) => (format!("ground to {metres} m"), required.share(at)?),
            GroundAsked::BlindZone(side, metres) => {
                let name = format!("blind zone {} to {metres} m", side.name());
                (name, required.share.unwrap_or(1.0))
            }
        };
        let own: &[&str] = match asked {
            GroundAsked::Within(_) => &["ground", "share", "without_any_one"],
            GroundAsked::BlindZone(..) => &["blind_zone", "depth", "share", "without_any_one"],
        };
        required.has_only(
            at,
            own,
            |_| "a rule on the ground has `ground` and `share`, or `blind_zone` and `depth`",
        )?;
        let name = required.named(at, default)?;
        let without_any_one = required.without_any_one;
        Ok(Some(Self { name, asked, share, without_any_one }))
    }
}

fn misplaced(at: &Location, key: &'static str, mend: &str) -> DescriptionError {
    DescriptionError::Misplaced { at: Box::new(at.clone()), key, mend: mend.to_owned() }
}

fn distance(at: &Location, key: &'static str, metres: f64) -> Result<f64, DescriptionError> {
    if metres > 0.0 && metres <= FARTHEST_GROUND {
        return Ok(metres);
    }
    let wanted = format!("metres from the own body, above 0 and at most {FARTHEST_GROUND}");
    Err(bad(&at.key(key), metres, wanted))
}

fn side_named(at: &Location, name: &str) -> Result<Side, DescriptionError> {
    let known = Side::ALL.iter().find(|side| side.name() == name);
    known.copied().ok_or_else(|| {
        bad(&at.key("blind_zone"), format!("`{name}`"), "a side: ahead, behind, left or right")
    })
}
