//! Tables, bars and drawings of a page.

use maud::{Markup, PreEscaped, html};

/// A drawing that may be wider than the page; `label` tells in words what it shows.
pub(super) fn figure(svg: &str, label: &str) -> Markup {
    html! { figure.wide tabindex="0" role="group" aria-label=(label) { (PreEscaped(svg)) } }
}

/// A table that may be wider than the page; a row is a name and its cells, `best` rows stand out.
pub(super) fn table(caption: &str, titles: &[&str], rows: &[(bool, Vec<Markup>)]) -> Markup {
    html! {
        div.wide tabindex="0" role="group" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for title in titles { th scope="col" { (title) } } } }
                tbody {
                    @for (best, cells) in rows {
                        tr.best[*best] {
                            @for (index, cell) in cells.iter().enumerate() {
                                @if index == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A cell of text.
pub(super) fn text(text: impl AsRef<str>) -> Markup {
    html! { (text.as_ref()) }
}

/// A share as a bar, with a mark at another share.
pub(super) fn bar(share: f64, mark: Option<f64>) -> Markup {
    let per_cent = |share: f64| format!("{:.1}%", 100.0 * share.clamp(0.0, 1.0));
    html! {
        span.bar aria-hidden="true" {
            i style={ "width:" (per_cent(share)) } {}
            @if let Some(mark) = mark { b style={ "left:" (per_cent(mark)) } {} }
        }
    }
}

/// A difference as a bar from the middle, with the ends of its interval; all as shares of the widest.
pub(super) fn difference(value: f64, interval: Option<[f64; 2]>) -> Markup {
    let at = |value: f64| 50.0 + 48.0 * value.clamp(-1.0, 1.0);
    let (left, width) = (at(value.min(0.0)), 48.0 * value.abs().min(1.0));
    html! {
        span.bar.middle aria-hidden="true" {
            i.less[value < 0.0] style={ "left:" (format!("{left:.1}%")) ";width:" (format!("{width:.1}%")) } {}
            @if let Some([low, high]) = interval {
                b.span style={ "left:" (format!("{:.1}%", at(low))) ";width:" (format!("{:.1}%", at(high) - at(low))) } {}
            }
        }
    }
}
