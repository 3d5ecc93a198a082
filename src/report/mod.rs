//! What a run leaves behind: JSON for programs, SVG charts and an HTML page for people.

mod chart;
mod html;
mod map;
mod plot;
mod record;
mod svg;

pub use chart::{ChartFrame, fidelity_csv, fidelity_svg, seconds};
pub use html::{Figures, certificate_in_words, methods_in_words, report_html};
pub use map::InformationMap;
pub use plot::{Axis, Plot, Series};
pub use record::{RunContext, RunRecord, RunTimes, peak_memory};
pub use svg::{convergence_svg, placement_svg};
