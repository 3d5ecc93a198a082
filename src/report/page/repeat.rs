//! The command and the settings that repeat a run.

use maud::{Markup, html};

use super::subject::Subject;
use crate::report::RunRecord;

/// The command, and every setting behind it.
pub(super) fn repeat(subject: &Subject<'_>, run: Option<&RunRecord>) -> Markup {
    html! {
        section aria-labelledby="repeat" {
            h2 #repeat { "How to repeat it" }
            pre.wide tabindex="0" role="group" aria-label="Command" { code { (subject.command) } }
            @if let Some(run) = run {
                p { (promise(run)) }
                details {
                    summary { "Every setting" }
                    pre.wide tabindex="0" role="group" aria-label="Settings" {
                        code { (format!("{:#}", run.settings)) }
                    }
                }
            }
        }
    }
}

/// Sentence on how close a repeated run comes to this one.
fn promise(run: &RunRecord) -> String {
    let mut words =
        format!("Needed: sightline {}, the same files and the same backend. ", run.sightline);
    words += if run.settings["max_seconds"].is_number() {
        "Time ended this run, and a repeated one may come further or less far: its result can differ. Give \
         --evaluations in place of --max-seconds for a run that repeats to the byte."
    } else if run.stopped.starts_with("interrupted") {
        "This run was interrupted. The command runs to the end, and its result can differ."
    } else {
        "They give the same bytes, timings left aside."
    };
    words
}
