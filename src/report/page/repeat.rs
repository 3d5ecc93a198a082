//! How to repeat a run: its command and its settings.

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
                p {
                    "The same program (sightline " (run.sightline) "), the same files and the same backend give \
                     the same bytes, timings left aside."
                }
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
