//! Rules on the overlap of LiDARs: how much of their surfaces pairs must share, so that all can be calibrated.

use super::description::RequirementDescription;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};

/// Name of a rule that gives itself none.
const NAME: &str = "overlap of LiDARs";

/// Overlap by which pairs must connect every LiDAR to every other one, in each scene.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlapRule {
    /// Name in reports.
    pub name: String,
    /// Least overlap of a pair that counts, from 0 to 1: surface voxels that both have hits in, as a share of those of
    /// the one that has fewer.
    pub share: f64,
    /// The others must stay connected without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

impl OverlapRule {
    /// Reads the rule at `at`; `None` where it is of another kind.
    pub(super) fn read(
        at: &Place,
        required: &RequirementDescription,
    ) -> Result<Option<Self>, DescriptionError> {
        let Some(share) = required.overlap else { return Ok(None) };
        for (key, there) in [
            ("min", required.min.is_some()),
            ("max", required.max.is_some()),
            ("without", !required.without.is_empty()),
            ("target", required.target.is_some()),
            ("from", required.from.is_some()),
            ("within", required.within.is_some()),
            ("bearing", required.bearing.is_some()),
            ("beams", required.beams.is_some()),
            ("ground", required.ground.is_some()),
            ("blind_zone", required.blind_zone.is_some()),
            ("depth", required.depth.is_some()),
            ("share", required.share.is_some()),
        ] {
            if there {
                let mend = match key {
                    "share" => "`overlap` itself is the share; leave `share` out",
                    _ => "a rule on overlap has `overlap` alone; write two rules",
                };
                let mend = mend.to_owned();
                return Err(DescriptionError::Misplaced { at: Box::new(at.clone()), key, mend });
            }
        }
        if !(share > 0.0 && share <= 1.0) {
            let wanted = "a share of the surface voxels of two LiDARs, above 0 and at most 1, 0.05 for example";
            return Err(bad(&at.key("overlap"), share, wanted));
        }
        let name = match &required.name {
            Some(name) => check::name(&at.key("name"), name.clone())?,
            None => NAME.to_owned(),
        };
        Ok(Some(Self { name, share, without_any_one: required.without_any_one }))
    }
}
