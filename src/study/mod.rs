//! Questions that take many runs: how many LiDARs, which sensor, what if one fails.

mod loss;
mod published;
mod region;
mod table;

pub use loss::{after_worst_loss, most_robust, without_each};
pub use published::{PUBLISHED, TASKS, results_of};
pub use region::{Region, RegionGain, gains_by_region};
pub use table::{Row, Table, knee};
