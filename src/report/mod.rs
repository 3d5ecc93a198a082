//! What a run leaves behind: JSON for programs, SVG charts and an HTML page for people.
//!
//! | file | holds |
//! |---|---|
//! | `record` | all of `result.json` |
//! | `words` | the findings of a run as sentences |
//! | `table` | columns of scores |
//! | `svg` | parts of every drawing: page, colours, axes |
//! | `plot`, `convergence`, `study` | plain charts of some series |
//! | `chart`, `chart_labels`, `chart_table`, `chart_words` | cost against ranking error |
//! | `placement`, `map` | a placement on its vehicle, and what it sees from above |
//! | `table`, `text` | the one table of scores, tables as text |
//! | `html` | the page |

mod chart;
mod chart_labels;
mod chart_table;
mod chart_words;
mod convergence;
mod html;
mod map;
mod placement;
mod plot;
mod record;
mod study;
mod svg;
mod table;
mod text;
mod words;

pub use chart::fidelity_svg;
pub use chart_table::{ChartFrame, fidelity_csv, seconds};
pub use chart_words::chart_words;
pub use convergence::convergence_svg;
pub use html::{Figures, report_html};
pub use map::InformationMap;
pub use placement::placement_svg;
pub use plot::{Axis, Plot, Series};
pub use record::{RunContext, RunRecord, RunTimes, peak_memory};
pub use study::study_plot;
pub use table::{ScoreColumn, optional};
pub use text::{align_columns, findings_text, poses_text, scores_text, study_text};
pub use words::{certificate_in_words, methods_in_words, verdict};
