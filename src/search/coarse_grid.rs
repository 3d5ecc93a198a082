//! Grids whose poses are few enough, by a multiple of the spacing.

use crate::vehicle::{Constraints, PoseGrid, PoseGridError, Spacing};

/// Poses of a grid that needs no widening.
const FEW_POSES: u64 = 100;
/// Largest multiple of a spacing: beyond it no mount has two poses along a field.
const MOST_TIMES: u32 = 1000;

/// The finest grid of at most `most` poses, or of a few where `most` is less, whose spacing is a multiple of the given
/// one, `least` times or more; and that spacing. All its poses are on the grid of the given spacing.
///
/// # Errors
/// A spacing that is not positive.
pub(crate) fn coarse_grid(
    constraints: &Constraints,
    spacing: Spacing,
    least: u32,
    most: u64,
) -> Result<(PoseGrid, Spacing), PoseGridError> {
    let mut times = least;
    loop {
        let Spacing { metres, radians } = spacing;
        let (metres, radians) = (metres * f64::from(times), radians * f64::from(times));
        let wider = Spacing { metres, radians };
        match PoseGrid::new(constraints, wider) {
            Ok(grid) if u64::from(grid.len()) <= most.max(FEW_POSES) => return Ok((grid, wider)),
            Ok(_) | Err(PoseGridError::TooManyPoses { .. }) if times < MOST_TIMES => times += 1,
            made => return Ok((made?, wider)),
        }
    }
}
