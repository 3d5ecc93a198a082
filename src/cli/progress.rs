use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::args::Talk;

/// A bar on stderr with rate and time left; nothing where stderr is no terminal.
pub fn bar(total: u64, unit: &str, talk: Talk) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if talk.quiet || !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        return bar;
    }
    let template =
        format!("{{bar:30}} {{pos}}/{{len}} {unit}, {{per_sec:.1}}, {{eta}} left {{wide_msg}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
