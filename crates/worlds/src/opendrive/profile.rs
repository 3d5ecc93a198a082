//! Heights across a road that its lanes lose: lanes are flat between their edges.

use roxmltree::Node;

use super::document::number_or_0;
use super::stations::{Cubic, cubic, inside};

/// Heights across a road beside its banking, from its `<lateralProfile>`.
#[derive(Debug, Default)]
pub(super) struct Profile {
    /// Heights across the road at places along it, by `s` in metres, each a row of cubics by the `t` where it begins.
    places: Vec<(f64, Vec<Cubic>)>,
    /// True if the road has a `<crossSectionSurface>`, whose heights are not read.
    pub section: bool,
}

impl Profile {
    /// The profile of a road that has one that can bend across a lane.
    pub fn of(road: Node<'_, '_>) -> Option<Self> {
        let parts = |name| inside(road, "lateralProfile").flat_map(move |n| inside(n, name));
        let record = |n| (number_or_0(n, "s"), cubic(n, "t"));
        let mut records: Vec<(f64, Cubic)> = parts("shape").map(record).collect();
        records.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.0.total_cmp(&b.1.0)));
        let places = records
            .chunk_by(|a, b| a.0 == b.0)
            .map(|rows| (rows[0].0, rows.iter().map(|(_, row)| *row).collect()))
            .collect();
        let section = parts("crossSectionSurface").next().is_some();
        Some(Self { places, section }).filter(|p| p.section || !p.places.is_empty())
    }

    /// Largest height in metres between the surface at `s` and the chord between two places across the road, `t` in metres.
    pub fn gap(&self, s: f64, [right, left]: [f64; 2]) -> f64 {
        let [low, high] = [right, left].map(|t| self.height(s, t));
        let off = |t: f64| {
            let chord = low + (high - low) * (t - right) / (left - right);
            (self.height(s, t) - chord).abs()
        };
        let breaks = self.places.iter().flat_map(|(_, rows)| rows.iter().map(|(t, _)| *t));
        let quarters = [0.25, 0.5, 0.75].map(|share| right + (left - right) * share);
        let inside = breaks.chain(quarters).filter(|t| *t > right && *t < left);
        inside.map(off).fold(0.0, f64::max)
    }

    /// Height in metres at `s` and `t`: linear along the road between places, the last cubic that begins before `t` across it.
    fn height(&self, s: f64, t: f64) -> f64 {
        let across = |rows: &[Cubic]| {
            let begun = rows.partition_point(|(start, _)| *start <= t);
            let (start, [a, b, c, d]) = rows[begun.saturating_sub(1)];
            let along = if begun == 0 { 0.0 } else { t - start };
            a + along * (b + along * (c + along * d))
        };
        let next = self.places.partition_point(|(place, _)| *place <= s);
        let before = next.checked_sub(1).map(|i| &self.places[i]);
        match (before, self.places.get(next)) {
            (None, None) => 0.0,
            (Some((_, rows)), None) | (None, Some((_, rows))) => across(rows),
            (Some((from, first)), Some((to, second))) => {
                let (first, second) = (across(first), across(second));
                first + (second - first) * (s - from) / (to - from)
            }
        }
    }
}
