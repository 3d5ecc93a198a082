//! Reports of runs: JSON for programs, SVG charts and an HTML page for people.
//!
//! | file | holds |
//! |---|---|
//! | `record` | all of `result.json`; a run as text; convergence of the search |
//! | `words` | the findings of a run as sentences |
//! | `warnings` | kinds of warnings, also shared ones; places that a placement does not see, as a list where that is much |
//! | `next_steps` | steps to take next where a result misses requirements |
//! | `svg` | parts of every drawing: page, colours, signs of LiDARs, axes |
//! | `plot`, `study` | plain charts of some series |
//! | `sensor` | facts of a sensor file, its pattern as SVG |
//! | `audit` | audits as text |
//! | `chart`, `chart_text` | cost against ranking error |
//! | `columns` | tables of at most 100 columns of a terminal |
//! | `coverage` | ground near the vehicle, things by the number of LiDARs that see them, overlap of pairs |
//! | `drawing` | a drawing as a list of shapes, written as SVG and PDF |
//! | `handover` | the drawing of a rig in three views |
//! | `losses` | near gain and margins of requirements without each LiDAR |
//! | `targets` | distances at which targets are met, by bearing |
//! | `map` | a placement on its vehicle, and the information that it gains from above |
//! | `tables` | tables of scores and studies as CSV; gains in each of several scenes |
//! | `run_tables` | results of searches and audits as CSV |
//! | `rigs` | price, range card and order of rigs below their scores; two rigs compared, as text and as CSV |
//! | `text` | tables and answers of commands as text |
//! | `front` | the front of two or three objectives: `result.json`, table, drawing |
//! | `view` | the 3-D view of a page |
//! | `page` | the page |

pub(crate) mod audit;
pub(crate) mod chart;
pub(crate) mod chart_text;
pub(crate) mod columns;
pub(crate) mod coverage;
mod drawing;
pub(crate) mod front;
pub(crate) mod handover;
mod losses;
pub(crate) mod map;
mod next_steps;
mod page;
pub(crate) mod plot;
pub(crate) mod record;
pub(crate) mod rigs;
pub(crate) mod run_tables;
pub(crate) mod sensor;
pub(crate) mod study;
mod svg;
pub(crate) mod tables;
pub(crate) mod targets;
pub(crate) mod text;
mod view;
mod warnings;
pub(crate) mod words;

pub use front::FrontRecord;
pub(crate) use map::{InformationMap, placement_svg};
pub(crate) use next_steps::next_in_words;
pub(crate) use page::{Figures, Looks, Subject, report_html, view_html};
pub use page::{found_html, front_html, near_record};
pub(crate) use plot::{Axis, Plot, Series};
pub(crate) use record::convergence_svg;
pub use record::{NearRecord, RunRecord, RunTimes, SceneRecord};
pub(crate) use rigs::rigs_text;
pub(crate) use tables::{ScoreColumn, optional};
pub(crate) use text::scores_text;
pub(crate) use words::{
    certificate_in_words, judged, methods_in_words, run_verdict, spread_in_words,
};
