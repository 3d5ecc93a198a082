//! Reports of runs: JSON for programs, SVG charts and an HTML page for people.
//!
//! | file | holds |
//! |---|---|
//! | `record` | all of `result.json` |
//! | `words`, `record_text` | the findings of a run as sentences, all findings as text |
//! | `by_scene` | gains in each of several scenes |
//! | `table` | columns of scores |
//! | `svg` | parts of every drawing: page, colours, axes |
//! | `plot`, `plot_labels`, `convergence`, `study`, `sweep` | plain charts of some series |
//! | `sensor`, `sensor_svg` | facts of a sensor file |
//! | `chart`, `chart_labels`, `chart_table`, `chart_text`, `chart_words` | cost against ranking error |
//! | `audit`, `verification`, `psog`, `rig` | results of these commands as text |
//! | `near_field` | ground near the vehicle that placements see |
//! | `drawing` | a drawing as a list of shapes, written as SVG and PDF |
//! | `handover` | the drawing of a rig in three views |
//! | `room` | how far pose fields may be off until a requirement breaks |
//! | `shared` | things by the number of LiDARs that see them, overlap of pairs |
//! | `targets` | distances at which targets are met, by bearing |
//! | `placement`, `map` | a placement on its vehicle, and the information that it gains from above |
//! | `tables` | tables of scores and studies as CSV |
//! | `table`, `text` | the one table of scores, tables as text |
//! | `front` | the front of two or three objectives: `result.json`, table, drawing |
//! | `against` | the result against every baseline, with intervals |
//! | `word` | a text as one word of a shell |
//! | `view` | the 3-D view of a page |
//! | `page` | the page |

pub(crate) mod chart;
pub(crate) mod chart_text;
pub(crate) mod coverage;
mod drawing;
pub(crate) mod front;
pub(crate) mod handover;
pub(crate) mod map;
mod page;
pub(crate) mod plot;
pub(crate) mod record;
pub(crate) mod sensor;
pub(crate) mod study;
mod svg;
pub(crate) mod tables;
pub(crate) mod targets;
pub(crate) mod text;
mod view;
pub(crate) mod words;

pub use front::{FrontContext, FrontRecord};
pub(crate) use map::{InformationMap, placement_svg};
pub(crate) use page::{Figures, Looks, Subject, front_html, report_html, view_html};
pub(crate) use plot::{Axis, Plot, Series};
pub(crate) use record::convergence_svg;
pub use record::{RunContext, RunRecord, RunTimes, SceneRecord};
pub(crate) use tables::{ScoreColumn, optional};
pub use text::scores_text;
pub(crate) use words::{certificate_in_words, judged, methods_in_words, spread_in_words, verdict};
