//! Bars on stderr.

use std::fmt::Write;
use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::args::Talk;

/// A bar on stderr with rate and time left; nothing where stderr is no terminal.
pub fn bar(total: u64, unit: &str, talk: Talk) -> ProgressBar {
    // With the message of `optimize` in 80 columns.
    let template =
        format!("{{bar:16}} {{pos}}/{{len}} {unit}, {{rate}}/s, {{eta}} left {{wide_msg}}");
    styled(total, &template, talk)
}

/// A bar for work that is not counted in steps: its share and the time left.
pub fn share(total: u64, talk: Talk) -> ProgressBar {
    styled(total, "{bar:16} {percent} %, {eta} left {wide_msg}", talk)
}

fn styled(total: u64, template: &str, talk: Talk) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if talk.quiet || !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        return bar;
    }
    let rate = |state: &ProgressState, out: &mut dyn Write| {
        let _ = write!(out, "{:.1}", state.per_sec());
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.with_key("rate", rate).progress_chars("=> "));
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
