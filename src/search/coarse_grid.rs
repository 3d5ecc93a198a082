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

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::search::settings::Settings;

    #[test]
    fn a_grid_without_a_given_spacing_is_the_finest_whose_poses_can_be_numbered() {
        // 6 by 2 by 2.5 m in all attitudes: 61 · 21 · 26 · 63 · 32 · 63 poses, more than 2³¹.
        let turn = [PI - 1e-3, FRAC_PI_2 - 1e-3, PI - 1e-3];
        let [roll, pitch, yaw] = turn;
        let free = |x: f64| {
            let (low, high) =
                ([-x, -1.0, 1.0, -roll, -pitch, -yaw], [x, 1.0, 3.5, roll, pitch, yaw]);
            Constraints::in_box(low, high, 2)
        };
        let settings = Settings::default();
        let (grid, spacing) = settings.grid(&free(3.0)).unwrap();
        assert_eq!(spacing, Spacing { metres: 0.2, radians: 0.2 });
        assert_eq!(grid.len(), 31 * 11 * 13 * 32 * 16 * 32);
        // A narrower mount keeps the spacing, and a given spacing is never widened.
        let (_, spacing) = settings.grid(&free(1.0)).unwrap();
        assert_eq!(spacing, Spacing { metres: 0.1, radians: 0.1 });
        let given = Settings { delta: Some(spacing), ..settings };
        let told = given.grid(&free(3.0)).unwrap_err().to_string();
        assert!(told.contains("widen --delta"), "{told}");
    }
}
