//! Parts of every drawing: page, colours, signs of LiDARs, numbers as words, and axes with their ticks.

pub(super) use crate::json::trimmed;
use crate::maths;
use maud::{Markup, html};

pub(super) const INK: &str = "#1b2a3a";
pub(super) const FAINT: &str = "#c8d2dc";
const PALE: &str = "#e8edf2";
pub(super) const GREY: &str = "#8a97a5";
pub(super) const SOFT: &str = "#5a6b7b";
pub(super) const ACCENT: &str = "#d1495b";
pub(super) const SECOND: &str = "#2f7ebc";
/// One colour a LiDAR or series, white text on them: eight that the colour-blind tell apart (Okabe, Ito 2008), then eight
/// dark ones.
pub(super) const COLOURS: [&str; 16] = [
    "#d55e00", "#0072b2", "#009e73", "#b8568f", "#a67400", "#3a8fc7", "#7b5c3e", "#5a6b7b",
    "#7d1a0c", "#0b2f6b", "#004d36", "#5c1a56", "#574000", "#0f5560", "#33211a", "#1f2933",
];

/// Colour of a LiDAR, a series or a target by its number.
pub(super) fn colour(number: usize) -> &'static str {
    COLOURS[number % COLOURS.len()]
}

/// LiDARs at one place of a drawing, and where their numbers stand.
#[derive(Debug, Clone)]
pub(super) struct LidarSign {
    pub lidars: Vec<usize>,
    pub at: [f64; 2],
    pub label: [f64; 2],
}

impl LidarSign {
    /// Signs of LiDARs at some places. LiDARs less than `near` apart along both axes share one; a sign that touches another
    /// is moved to the right, `step` by `step`.
    pub(super) fn all(
        places: impl Iterator<Item = [f64; 2]>,
        near: f64,
        step: f64,
        touches: impl Fn(&Self, &Self) -> bool,
    ) -> Vec<Self> {
        let mut signs: Vec<Self> = Vec::new();
        for (lidar, at) in places.enumerate() {
            let is_there =
                |sign: &&mut Self| (0..2).all(|k: usize| (sign.at[k] - at[k]).abs() < near);
            match signs.iter_mut().find(is_there) {
                Some(sign) => sign.lidars.push(lidar),
                None => signs.push(Self { lidars: vec![lidar], at, label: at }),
            }
        }
        for k in 1..signs.len() {
            let (placed, rest) = signs.split_at_mut(k);
            while placed.iter().any(|other| touches(other, &rest[0])) {
                rest[0].label[0] += step;
            }
        }
        signs
    }

    /// `0`, or `0, 1` where several LiDARs lie behind one another.
    pub(super) fn words(&self) -> String {
        self.lidars.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
    }

    pub(super) fn colour(&self) -> &'static str {
        colour(self.lidars[0])
    }
}

/// A drawing of a size in pixels, to stand alone or in a page.
pub(super) fn page([width, height]: [f64; 2], title: &str, body: &Markup) -> String {
    let (width, height) = (width.to_string(), height.to_string());
    html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(width)
            height=(height) role="img" font-family="system-ui,sans-serif" font-size="13" fill=(INK) {
            title { (title) }
            rect width="100%" height="100%" fill="#fff" {}
            (body)
        }
    }
    .into_string()
        + "\n"
}

/// A coordinate to a tenth of a pixel.
pub(super) fn px(value: f64) -> String {
    format!("{value:.1}")
}

/// Corners of a polyline or polygon: `x,y x,y …`.
pub(super) fn corners(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let corners: Vec<String> = points.into_iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    corners.join(" ")
}

/// A number in three decimals at most; very small and large ones with an exponent.
pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        "0".into()
    } else if !(1e-3..1e5).contains(&magnitude) {
        format!("{value:.2e}")
    } else {
        trimmed(value, 3)
    }
}

pub(super) fn scale(value: f64, from: (f64, f64), to: (f64, f64)) -> f64 {
    to.0 + (value - from.0) / (from.1 - from.0) * (to.1 - to.0)
}

/// A place on an axis; without a text it gets a faint line alone.
pub(super) struct Tick {
    /// Value in the unit of the axis, before any logarithm.
    pub value: f64,
    pub text: Option<String>,
}

/// Values of one axis and the pixels that they are drawn at.
pub(super) struct Scale {
    /// Lowest and highest value, on a logarithmic axis their logarithms.
    pub range: (f64, f64),
    pixels: (f64, f64),
    is_log: bool,
}

impl Scale {
    pub(super) fn linear(range: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { range, pixels, is_log: false }
    }

    /// An axis of equal factors; `range` holds logarithms to base 10.
    pub(super) fn log(range: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { range, pixels, is_log: true }
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        scale(if self.is_log { maths::log10(value) } else { value }, self.range, self.pixels)
    }

    /// Round numbers along the axis: about six, or on a logarithmic axis 1, 2, …, 9 times powers of ten,
    /// of which 1, and where there is room 2 and 5, are written out by `name`.
    pub(super) fn ticks(&self, name: fn(f64) -> String) -> Vec<Tick> {
        let (low, high) = self.range;
        if !self.is_log {
            let round = round_numbers(low, high, 6).into_iter();
            return round.map(|value| Tick { value, text: Some(name(value)) }).collect();
        }
        let is_named = |digit: u32| digit == 1 || high - low < 2.2 && [2, 5].contains(&digit);
        let powers = low.floor() as i32..=high.ceil() as i32;
        let all = powers.flat_map(|power| {
            (1..10).map(move |digit| {
                let value = f64::from(digit) * 10_f64.powi(power);
                Tick { value, text: is_named(digit).then(|| name(value)) }
            })
        });
        all.filter(|tick| (low..=high).contains(&maths::log10(tick.value))).collect()
    }
}

/// About `count` round numbers within a range.
fn round_numbers(low: f64, high: f64, count: usize) -> Vec<f64> {
    let raw = (high - low) / count as f64;
    let power = maths::pow(10_f64, maths::log10(raw).floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw);
    let step = step.unwrap_or(raw);
    let first = (low / step).ceil() as i64;
    (first..).map(|k| k as f64 * step).take_while(|t| *t <= high + step * 1e-9).collect()
}

/// The frame of a chart: x to the right, y upwards.
pub(super) struct Axes {
    pub x: Scale,
    pub y: Scale,
}

impl Axes {
    pub(super) fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    /// Both axes with ticks: lines across for y, and for x where it is logarithmic, else short marks.
    /// `turned` names stand aslant.
    pub(super) fn draw(&self, x: &[Tick], y: &[Tick], turned: bool) -> Markup {
        let (left, right) = self.x.pixels;
        let (bottom, top) = self.y.pixels;
        let style = |tick: &Tick| if tick.text.is_some() { (FAINT, ".7") } else { (PALE, ".6") };
        html! {
            @for tick in y {
                @let (at, (colour, width)) = (self.y.at(tick.value), style(tick));
                path d={ "M" (left) " " (px(at)) "H" (right) } stroke=(colour) stroke-width=(width) {}
                @if let Some(text) = &tick.text {
                    text x=(left - 8.0) y=(px(at + 4.5)) text-anchor="end" { (text) }
                }
            }
            @for tick in x {
                @let (at, (colour, width)) = (px(self.x.at(tick.value)), style(tick));
                @if self.x.is_log {
                    path d={ "M" (at) " " (top) "V" (bottom) } stroke=(colour) stroke-width=(width) {}
                } @else {
                    path d={ "M" (at) " " (bottom) "v5" } stroke=(INK) {}
                }
                @if let Some(text) = &tick.text {
                    @let slant = turned.then(|| format!("rotate(-30 {at} {:.1})", bottom + 18.0));
                    text x=(at) y=(px(bottom + 20.0)) transform=[slant]
                        text-anchor=(if turned { "end" } else { "middle" }) { (text) }
                }
            }
            path d={ "M" (left) " " (top) "V" (bottom) "H" (right) } fill="none" stroke=(INK) {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_and_powers_of_ten() {
        let linear = Scale::linear((-0.3, 1.1), (0.0, 140.0));
        let values: Vec<f64> = linear.ticks(number).iter().map(|t| t.value).collect();
        assert_eq!(values, [0.0, 0.5, 1.0]);
        assert!((linear.at(0.4) - 70.0).abs() < 1e-9);
        let log = Scale::log((-3.0, 0.0), (0.0, 300.0));
        assert!((log.at(0.1) - 200.0).abs() < 1e-9);
        let named: Vec<String> =
            log.ticks(|v| trimmed(v, 6)).into_iter().filter_map(|t| t.text).collect();
        assert_eq!(named, ["0.001", "0.01", "0.1", "1"]);
        assert_eq!(log.ticks(number).len(), 28);
    }

    #[test]
    fn names_cannot_break_out_of_their_text() {
        let body = html! { text { ("</text><script>") } };
        let page = page([1.0, 1.0], "a < \"b\"", &body);
        assert!(page.contains("<title>a &lt; &quot;b&quot;</title>"), "{page}");
        assert!(
            page.contains("&lt;/text&gt;&lt;script&gt;") && !page.contains("<script"),
            "{page}"
        );
    }
}
