//! Rules on the overlap of LiDARs: how much of their surfaces pairs must share, so that all can be calibrated.

use super::description::RequirementDescription;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Location};

/// Name of a rule that gives itself none.
const NAME: &str = "overlap of LiDARs";

/// Overlap by which pairs must connect every LiDAR to every other one, in each scene.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlapRule {
    /// Name in reports.
    pub name: String,
    /// Least overlap of a pair that counts, from 0 to 1: surface voxels that both have hits in, as a share of the voxels of
    /// the LiDAR that has fewer.
    pub share: f64,
    /// The others must stay connected without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

impl OverlapRule {
    /// Reads the rule at `at`; `None` where it is of another kind.
    pub(super) fn read(
        at: &Location,
        required: &RequirementDescription,
    ) -> Result<Option<Self>, DescriptionError> {
        let Some(share) = required.overlap else { return Ok(None) };
        required.has_only(at, &["overlap", "without_any_one"], |key| match key {
            "share" => "`overlap` itself is the share; leave `share` out",
            _ => "a rule on overlap has `overlap` alone; write two rules",
        })?;
        if !(share > 0.0 && share <= 1.0) {
            let wanted = "a share of the surface voxels of two LiDARs, above 0 and at most 1, 0.05 for example";
            return Err(bad(&at.key("overlap"), share, wanted));
        }
        let name = required.named(at, NAME.to_owned())?;
        Ok(Some(Self { name, share, without_any_one: required.without_any_one }))
    }
}
