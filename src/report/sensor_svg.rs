//! The beams of a sensor as a drawing: azimuth × elevation, and counts by elevation.

use maud::{Markup, html};

use super::sensor::{SensorFacts, angles, bands};
use super::svg::{ACCENT, Axes, FAINT, INK, SECOND, SOFT, Scale, number, page, px, scale};
use crate::vehicle::sensor_file::{Beams, SensorPattern};

/// Pixels of the plot of beams.
const LEFT: f64 = 64.0;
const TOP: f64 = 82.0;
const WIDTH: f64 = 600.0;
const HEIGHT: f64 = 360.0;
/// Left end and width of the bars beside it.
const BARS: [f64; 2] = [690.0, 150.0];
/// Pixels of the whole.
const ALL: [f64; 2] = [900.0, 500.0];
/// Most dots that are drawn.
const DOTS: usize = 24_000;
/// Colour of the beams of the other azimuth steps.
const NEXT: &str = "#8fb6d9";
/// Azimuth steps to each side of the offsets.
const NEIGHBOURS: f64 = 6.0;

/// Dots at (azimuth, elevation) in degrees.
struct Dots {
    /// Beams of one azimuth step, drawn on top.
    first: Vec<[f64; 2]>,
    others: Vec<[f64; 2]>,
    words: String,
}

/// Draws a pattern as SVG, with `facts` that [`SensorFacts::of`] gave.
pub fn sensor_svg(pattern: &SensorPattern, facts: &SensorFacts) -> String {
    let angles = angles(&pattern.beams);
    let dots = dots(&pattern.beams, &angles, facts.azimuth_steps);
    let all = || dots.first.iter().chain(&dots.others);
    let axes = Axes {
        x: Scale::linear(range(all().map(|dot| dot[0])), (LEFT, LEFT + WIDTH)),
        y: Scale::linear(range(all().map(|dot| dot[1])), (TOP + HEIGHT, TOP)),
    };
    let name = facts.name.as_deref().unwrap_or(&facts.format);
    let name: String = name.chars().take(40).collect();
    let title = match (facts.channels, facts.beams) {
        (Some(channels), Some(beams)) => {
            format!("{name}: {channels} channels, {beams} beams a frame")
        }
        (Some(channels), None) => format!("{name}: {channels} channels"),
        (None, beams) => format!("{name}: {} beams a frame", beams.unwrap_or(0)),
    };
    // Small dots for many beams, so that each stands alone; one step is told from its neighbours.
    let small = |count: usize| if count < 4000 { "3" } else { "1.5" };
    let (first, colour) = match (dots.others.is_empty(), dots.first.len()) {
        (false, _) => ("5", ACCENT),
        (true, 0..600) => ("5", SECOND),
        (true, many) => (small(many), SECOND),
    };
    let body = html! {
        text x=(LEFT) y="22" font-weight="600" font-size="15" { (title) }
        text x=(LEFT) y="44" fill=(SOFT) { @if facts.name.is_some() { (facts.format) "; " } (dots.words) }
        (axes.draw(&axes.x.ticks(number), &axes.y.ticks(number), false))
        (points(&dots.others, &axes, NEXT, small(dots.others.len())))
        (points(&dots.first, &axes, colour, first))
        (bars(&angles, &axes, facts.channels.is_some()))
        text x=(LEFT) y=(TOP - 8.0) font-size="12" fill=(SOFT) { "elevation, degrees" }
        text x=(LEFT + WIDTH / 2.0) y=(TOP + HEIGHT + 42.0) text-anchor="middle" {
            "azimuth, degrees counter-clockwise from ahead"
        }
    };
    page(ALL, &title, &body)
}

/// Beams to draw: channels near azimuth 0 alone, since the pattern repeats; listed directions all, thinned.
fn dots(beams: &Beams, angles: &[[f64; 2]], steps: Option<u32>) -> Dots {
    if let Beams::Directions(_) = beams {
        let every = angles.len().div_ceil(DOTS).max(1);
        let first: Vec<_> = angles.iter().copied().step_by(every).collect();
        let words = match every {
            1 => "every beam".to_owned(),
            _ => format!("one of {every} beams"),
        };
        return Dots { first, others: Vec::new(), words };
    }
    let first = angles.to_vec();
    let Some(steps) = steps else {
        return Dots {
            first,
            others: Vec::new(),
            words: "the beams of one azimuth step".to_owned(),
        };
    };
    let step = 360.0 / f64::from(steps);
    let offsets = || angles.iter().map(|angle| angle[0]);
    let low = offsets().fold(f64::INFINITY, f64::min) - NEIGHBOURS * step;
    let high = offsets().fold(f64::NEG_INFINITY, f64::max) + NEIGHBOURS * step;
    let mut others = Vec::new();
    if (high - low) / step * angles.len() as f64 <= DOTS as f64 {
        for [offset, elevation] in angles {
            let columns = ((low - offset) / step).ceil() as i64..=((high - offset) / step) as i64;
            let near = columns.filter(|j| *j != 0 && j.unsigned_abs() < u64::from(steps));
            others.extend(near.map(|j| [offset + j as f64 * step, *elevation]));
        }
    }
    let words = format!("one azimuth step in red, repeated every {}°", number(step));
    Dots { first, others, words }
}

/// Dots as one path: a line of no length with round ends each.
fn points(dots: &[[f64; 2]], axes: &Axes, colour: &str, size: &str) -> Markup {
    let mut path = String::new();
    for dot in dots {
        let (x, y) = axes.at((dot[0], dot[1]));
        path += &format!("M{x:.1} {y:.1}h0");
    }
    html! {
        path d=(path) stroke=(colour) stroke-width=(size) stroke-linecap="round" fill="none" {}
    }
}

/// Channels or beams by bands of elevation, beside the plot and on its axis.
fn bars(angles: &[[f64; 2]], axes: &Axes, is_channels: bool) -> Markup {
    let elevations: Vec<f64> = angles.iter().map(|angle| angle[1]).collect();
    let (width, bands) = bands(&elevations);
    let most = bands.iter().map(|(_, count)| *count).max().unwrap_or(1).max(1);
    let (top, bottom) = (TOP, TOP + HEIGHT);
    html! {
        text x=(BARS[0]) y=(TOP - 8.0) font-size="12" fill=(SOFT) {
            (if is_channels { "channels" } else { "beams" }) " in " (number(width)) "°"
        }
        @for (low, count) in &bands {
            @let from = axes.y.at(low + width).clamp(top, bottom);
            @let to = axes.y.at(*low).clamp(top, bottom);
            @let long = scale(*count as f64, (0.0, most as f64), (0.0, BARS[1]));
            @if *count > 0 {
                rect x=(BARS[0]) y=(px(from + 0.5)) width=(px(long)) height=(px((to - from - 1.0).max(0.5)))
                    fill=(FAINT) {}
                text x=(px(BARS[0] + long + 5.0)) y=(px(0.5 * (from + to) + 4.0)) font-size="11" { (count) }
            }
        }
        path d={ "M" (BARS[0]) " " (top) "V" (bottom) } stroke=(INK) {}
    }
}

/// The range of values with 4 % of margin at both ends, at least a degree wide.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    let margin = (0.04 * (high - low)).max(0.5);
    (low - margin, high + margin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::sensor_file::{Channel, SensorFormat};

    #[test]
    fn the_first_step_and_its_neighbours_are_drawn() {
        let channel = |elevation| Channel { elevation, azimuth_offset: 0.0 };
        let beams = Beams::Channels([-10.0, 0.0, 10.0].map(channel).to_vec());
        let pattern = SensorPattern {
            model: Some("a < b".to_owned()),
            azimuth_steps: Some(360),
            ..SensorPattern::new(SensorFormat::Table, beams)
        };
        let svg = sensor_svg(&pattern, &SensorFacts::of(&pattern, None));
        // Six steps to each side of the first one, for each of three channels.
        assert_eq!(svg.matches("h0").count(), 3 * 13, "{svg}");
        // The azimuth 0 and the elevation 0 stand in the middle of the plot.
        assert!(svg.contains("M364.0 262.0h0"), "{svg}");
        assert!(svg.contains("a &lt; b: 3 channels, 1080 beams a frame"));
        let beams = Beams::Directions(vec![[1.0, 0.0, 0.0]; 30_000]);
        let many = SensorPattern { beams, ..pattern };
        let svg = sensor_svg(&many, &SensorFacts::of(&many, None));
        assert!(svg.contains("one of 2 beams") && svg.matches("h0").count() == 15_000);
    }
}
