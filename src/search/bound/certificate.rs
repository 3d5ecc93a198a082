//! Bounds on how far a result is from the best placement, in numbers and words.

use serde::Serialize;

use super::branch_and_bound::GainBound;
use super::sample::LipschitzBound;
use crate::json::spoken;

/// Bounds on how much better than the result another placement could be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// The paper's bound; `None` where nothing could be sampled.
    pub lipschitz: Option<LipschitzBound>,
    /// `lipschitz` in words.
    pub lipschitz_says: String,
    /// The bound on the grid; `None` for objectives that have none, or where it was not computed.
    pub gain: Option<GainBound>,
    /// `gain` in words, or why there is no bound.
    pub gain_says: String,
}

impl Certificate {
    /// Puts both bounds into words. `found` is the objective of the result; `gain` is the bound, or
    /// why there is none.
    pub fn new(
        lipschitz: Option<LipschitzBound>,
        gain: Result<GainBound, String>,
        found: f64,
    ) -> Self {
        let lipschitz_says = match &lipschitz {
            None => "nothing could be sampled on the grid".to_owned(),
            Some(LipschitzBound { c_m, k_g, delta, bound, samples }) => format!(
                "C_M + k_G·δ = {} + {} · {} = {}, from {samples} sampled \
                 placements: as large as the whole range of their scores, so it tells nothing about \
                 this result",
                spoken(*c_m),
                spoken(*k_g),
                spoken(*delta),
                spoken(*bound)
            ),
        };
        let (gain, gain_says) = match gain {
            Err(why) => (None, why),
            Ok(gain) => {
                let more = 100.0 * (gain.upper / found - 1.0);
                let poses = gain.poses;
                let says = if gain.upper <= found {
                    format!(
                        "no placement on the grid of {poses} sensor poses is better than the result"
                    )
                } else if found <= 0.0 {
                    format!(
                        "the best placement on the grid of {poses} sensor poses gains {} at most, \
                         the result nothing",
                        spoken(gain.upper)
                    )
                } else if gain.proven {
                    format!(
                        "the best placement on the grid of {poses} sensor poses is {more:.2} % better \
                         than the result (proven)"
                    )
                } else {
                    format!(
                        "the best placement on the grid of {poses} sensor poses is at most {more:.2} % \
                         better than the result"
                    )
                };
                (Some(gain), says)
            }
        };
        Self { lipschitz, lipschitz_says, gain, gain_says }
    }
}
