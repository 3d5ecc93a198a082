//! What a run leaves behind: JSON for programs, SVG charts and an HTML page for people.

mod chart;
mod chart_words;
mod html;
mod map;
mod plot;
mod record;
mod study;
mod svg;

pub use chart::{ChartFrame, fidelity_csv, fidelity_svg, seconds};
pub use chart_words::chart_words;
pub use html::{Figures, certificate_in_words, methods_in_words, report_html};
pub use map::InformationMap;
pub use plot::{Axis, Plot, Series};
pub use record::{LeftOut, MethodRecord, ModelledRun, RunRecord, RunTimes, Scored};
pub use study::study_plot;
pub use svg::{convergence_svg, placement_svg};
