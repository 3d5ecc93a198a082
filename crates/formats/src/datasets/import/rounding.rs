//! Lengths as scenes have them.

/// Metres to a tenth of a millimetre: more digits are noise.
pub(super) fn rounded(metres: f64) -> f64 {
    (metres * 1e4).round() / 1e4
}
