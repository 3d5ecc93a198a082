//! Facts of a sensor file, for programs and as text.

use maud::{Markup, html};
use serde::Serialize;

use super::columns::{WIDEST, align_columns, folded};
use super::svg::{ACCENT, Axes, FAINT, INK, SECOND, SOFT, Scale, number, page, px, scale, trimmed};
use crate::maths;
use crate::vehicle::sensor_file::{Beams, Measures, SensorPattern};

/// Most rows of the drawing of elevations.
const ROWS: f64 = 18.0;
/// Characters of its longest bar.
const BAR: usize = 40;

/// Facts of a sensor, angles in degrees. Facts of channels can be read again as a sensor file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct SensorFacts {
    /// Format of the file.
    pub format: String,
    /// Model, if the file states one.
    pub name: Option<String>,
    /// Channels; none for listed directions.
    pub channels: Option<usize>,
    /// Lowest and highest elevation.
    pub elevation: [f64; 2],
    /// Least and largest step from channel to channel, by elevation.
    pub spacing: Option<[f64; 2]>,
    /// The narrowest band of elevations that holds half of the channels or directions.
    pub half: [f64; 2],
    /// Least and largest azimuth offset of channels, or azimuth of directions.
    pub azimuth: [f64; 2],
    /// Azimuth steps of a turn, as given or stated.
    pub azimuth_steps: Option<u32>,
    /// Azimuths of the first and the last column that the sensor is set to look at; a whole turn if none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_window: Option<[f64; 2]>,
    /// Beams of a frame, where the azimuth steps are known.
    pub beams: Option<u64>,
    /// Ranges and errors, where the file states them.
    #[serde(flatten)]
    pub measures: Measures,
    /// Sentences about parts of the file: dropped, unknown, or most likely wrong.
    pub notes: Vec<String>,
    /// Elevation of each channel, in the order of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<Vec<f64>>,
    /// Azimuth offset of each channel, counter-clockwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_offset_deg: Option<Vec<f64>>,
}

/// Azimuth and elevation in degrees of each direction, or offset and elevation of each channel.
fn angles(beams: &Beams) -> Vec<[f64; 2]> {
    match beams {
        Beams::Channels(all) => all.iter().map(|c| [c.azimuth_offset, c.elevation]).collect(),
        Beams::Directions(all) => {
            let of = |[x, y, z]: &[f64; 3]| {
                [maths::atan2(*y, *x), maths::atan2(*z, maths::hypot(*x, *y))].map(f64::to_degrees)
            };
            all.iter().map(of).collect()
        }
    }
}

/// Elevations by bands of a round width, lowest first: the width, lower end and count of each, and the largest count.
fn bands(angles: &[[f64; 2]]) -> (f64, Vec<(f64, usize)>, usize) {
    let elevations = || angles.iter().map(|angle| angle[1]);
    let [low, high] = span(elevations());
    let raw = ((high - low) / ROWS).max(0.1);
    let widths = [0.1, 0.2, 0.5, 1.0, 2.0, 2.5, 5.0, 10.0];
    let width = widths.into_iter().find(|width| *width >= raw).unwrap_or(20.0);
    // An elevation on the border of two bands belongs to the upper one, rounded or not.
    let band = |e: f64| (e / width + 1e-9).floor() as i64;
    let mut counts: Vec<usize> = vec![0; (band(high) - band(low) + 1) as usize];
    elevations().for_each(|e| counts[(band(e) - band(low)) as usize] += 1);
    let most = counts.iter().copied().max().unwrap_or(1).max(1);
    let ends = (band(low)..).map(|k| k as f64 * width);
    (width, ends.zip(counts).collect(), most)
}

/// Least and largest value; zeros of none.
fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let fold = |[low, high]: [f64; 2], v: f64| [low.min(v), high.max(v)];
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], fold);
    if low <= high { [low, high] } else { [0.0; 2] }
}

impl SensorFacts {
    /// Facts of a pattern, with `steps` azimuth steps a turn where they are given.
    pub(crate) fn of(pattern: &SensorPattern, steps: Option<u32>) -> Self {
        let angles = angles(&pattern.beams);
        let is_listed = matches!(pattern.beams, Beams::Directions(_));
        let mut sorted: Vec<f64> = angles.iter().map(|angle| angle[1]).collect();
        sorted.sort_by(f64::total_cmp);
        let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
        let held = sorted.len().div_ceil(2);
        let half = sorted.windows(held.max(1)).map(|held| [held[0], held[held.len() - 1]]);
        let half = half.min_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        let azimuth_steps = steps.or(pattern.azimuth_steps).filter(|_| !is_listed);
        let (columns, azimuth_window) = azimuth_steps.map_or((None, pattern.azimuth), |steps| {
            let (columns, window) = pattern.columns(steps);
            (Some(columns), window)
        });
        let beams = match columns {
            Some(columns) => Some(angles.len() as u64 * u64::from(columns)),
            None => is_listed.then_some(angles.len() as u64),
        };
        let list = |of: usize| (!is_listed).then(|| angles.iter().map(|a| a[of]).collect());
        Self {
            format: pattern.format.to_string(),
            name: pattern.model.clone(),
            channels: (!is_listed).then_some(angles.len()),
            elevation: span(sorted.iter().copied()),
            spacing: (!is_listed && sorted.len() > 1).then(|| span(gaps)),
            half: half.unwrap_or_default(),
            azimuth: span(angles.iter().map(|angle| angle[0])),
            azimuth_steps,
            azimuth_window,
            beams,
            measures: pattern.measures,
            notes: pattern.notes.iter().map(ToString::to_string).collect(),
            elevation_deg: list(1),
            azimuth_offset_deg: list(0),
        }
    }
}

/// Facts and a drawing of the elevations as text.
pub(crate) fn sensor_text(pattern: &SensorPattern, facts: &SensorFacts) -> String {
    let number = |v: f64| trimmed(v, 3);
    let range = |[low, high]: [f64; 2]| match low == high {
        true => format!("{}°", number(low)),
        false => format!("{}° to {}°", number(low), number(high)),
    };
    let mut lines = vec![("format", facts.format.clone())];
    lines.extend(facts.name.clone().map(|name| ("model", name)));
    lines.extend(facts.channels.map(|count| ("channels", count.to_string())));
    lines.push(("elevations", range(facts.elevation)));
    lines.extend(facts.spacing.map(|gaps| ("spacing", range(gaps))));
    lines.push(("densest half", range(facts.half)));
    let title = if facts.channels.is_some() { "azimuth offsets" } else { "azimuths" };
    lines.push((title, range(facts.azimuth)));
    if facts.channels.is_some() {
        let unknown = || "not stated; give --azimuth-steps".to_owned();
        let steps = facts.azimuth_steps.map_or_else(unknown, |steps| format!("{steps} a turn"));
        lines.push(("azimuth steps", steps));
        lines.extend(facts.azimuth_window.map(|window| ("azimuth window", range(window))));
    }
    lines.extend(facts.beams.map(|beams| ("beams a frame", beams.to_string())));
    let Measures { range: most, min_range, rated_range, noise, rate } = facts.measures;
    let metres = |value: Option<f64>| value.map(|value| format!("{} m", number(value)));
    let names = ["range", "closest range", "range at 10 %", "range noise"];
    let stated = names.into_iter().zip([most, min_range, rated_range, noise].map(metres));
    lines.extend(stated.filter_map(|(name, value)| Some((name, value?))));
    lines.extend(rate.map(|rate| ("frames a second", number(rate))));
    lines.extend(facts.notes.iter().map(|note| ("note", note.clone())));
    let width = lines.iter().map(|(key, _)| key.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for (key, value) in &lines {
        for (k, line) in folded(value, WIDEST - width - 2).iter().enumerate() {
            text += &format!("{:<width$}  {line}\n", if k == 0 { *key } else { "" });
        }
    }
    format!("{text}\n{}", drawing(pattern, facts.channels.is_some()))
}

/// A bar for each band of elevations, highest first.
fn drawing(pattern: &SensorPattern, is_channels: bool) -> String {
    let (width, bands, most) = bands(&angles(&pattern.beams));
    let what = if is_channels { "channels" } else { "beams" };
    let mut rows = vec![vec!["elevation".to_owned(), what.to_owned()]];
    let mut bars = vec![String::new()];
    for (low, count) in bands.iter().rev() {
        let ends = [*low, low + width].map(|end| trimmed(end + 0.0, 1));
        rows.push(vec![format!("{:>5}° to {:>5}°", ends[0], ends[1]), count.to_string()]);
        bars.push("█".repeat((count * BAR).div_ceil(most)));
    }
    let table = align_columns(&rows);
    let lines = table.lines().zip(bars).map(|(line, bar)| format!("{line}  {bar}"));
    lines.map(|line| format!("{}\n", line.trim_end())).collect()
}

/// Pixels of the plot of beams.
const LEFT: f64 = 64.0;
const TOP: f64 = 82.0;
const WIDTH: f64 = 600.0;
const HEIGHT: f64 = 360.0;
/// Left end and width of the bars beside it.
const BARS: [f64; 2] = [690.0, 150.0];
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
pub(crate) fn sensor_svg(pattern: &SensorPattern, facts: &SensorFacts) -> String {
    let angles = angles(&pattern.beams);
    let dots = dots(&pattern.beams, &angles, facts.azimuth_steps);
    let all = || dots.first.iter().chain(&dots.others);
    let axes = Axes {
        x: Scale::linear(range(all().map(|dot| dot[0])), (LEFT, LEFT + WIDTH)),
        y: Scale::linear(range(all().map(|dot| dot[1])), (TOP + HEIGHT, TOP)),
    };
    let name = facts.name.as_deref().unwrap_or(&facts.format);
    let name: String = name.chars().take(40).collect();
    let channels = facts.channels.map(|count| format!("{count} channels"));
    let beams = facts.beams.map(|count| format!("{count} beams a frame"));
    let counts: Vec<String> = channels.into_iter().chain(beams).collect();
    let title = format!("{name}: {}", counts.join(", "));
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
        let (others, words) = (Vec::new(), "the beams of one azimuth step".to_owned());
        return Dots { first, others, words };
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
    let (width, bands, most) = bands(angles);
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

    fn pattern(beams: Beams) -> SensorPattern {
        let notes = vec![crate::Note::fact("Something is dropped.")];
        SensorPattern { notes, ..SensorPattern::new(SensorFormat::Hesai, beams) }
    }

    #[test]
    fn facts_of_channels_are_counted_by_hand() {
        let channel = |elevation, azimuth_offset| Channel { elevation, azimuth_offset };
        let all = [(-10.0, 1.0), (2.0, -3.0), (0.0, 0.0), (1.0, 0.0), (15.0, 0.0)];
        let beams = Beams::Channels(all.map(|(e, o)| channel(e, o)).to_vec());
        let pattern = pattern(beams);
        let facts = SensorFacts::of(&pattern, Some(100));
        assert_eq!((facts.channels, facts.beams), (Some(5), Some(500)));
        assert_eq!((facts.elevation, facts.azimuth), ([-10.0, 15.0], [-3.0, 1.0]));
        assert_eq!((facts.spacing, facts.half), (Some([1.0, 13.0]), [0.0, 2.0]));
        let text = sensor_text(&pattern, &facts);
        assert!(text.contains("note             Something is dropped.\n"), "{text}");
        // 25 degrees in bands of two: three channels lie in two bands.
        assert!(text.contains("    0° to     2°         2  ████"), "{text}");
        assert_eq!(text.matches('█').count(), 40 + 3 * 20, "{text}");
        let facts = SensorFacts::of(&pattern, None);
        assert!(sensor_text(&pattern, &facts).contains("give --azimuth-steps"));
    }

    #[test]
    fn facts_of_directions_are_their_angles() {
        let half = 0.5_f64.sqrt();
        let beams = Beams::Directions(vec![[1.0, 0.0, 0.0], [0.0, half, -half]]);
        let facts = SensorFacts::of(&pattern(beams), Some(100));
        assert_eq!((facts.channels, facts.azimuth_steps, facts.beams), (None, None, Some(2)));
        assert!((facts.elevation[0] + 45.0).abs() < 1e-12 && facts.elevation[1] == 0.0);
        assert!((facts.azimuth[1] - 90.0).abs() < 1e-12 && facts.azimuth[0] == 0.0);
        assert_eq!(facts.elevation_deg, None);
    }

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
