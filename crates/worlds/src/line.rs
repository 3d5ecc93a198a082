//! Polylines in space: length, points along them, offsets, and curves from point to point.

use glam::{DVec2, DVec3};

/// A polyline with the length up to each of its points, in metres in plan.
#[derive(Debug, Clone, Default)]
pub struct Line {
    points: Vec<DVec3>,
    along: Vec<f64>,
}

impl Line {
    /// Measures `points`; those that repeat the one before are left out.
    pub fn new(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut line = Self::default();
        points.into_iter().for_each(|p| line.push(p));
        line
    }

    fn push(&mut self, p: DVec3) {
        match (self.points.last(), self.along.last()) {
            (Some(&last), Some(&along)) => {
                let step = (p - last).truncate().length();
                if step > 1e-3 {
                    self.points.push(p);
                    self.along.push(along + step);
                }
            }
            _ => {
                self.points.push(p);
                self.along.push(0.0);
            }
        }
    }

    /// Goes on along `other`.
    pub fn extend(&mut self, other: &Self) {
        other.points.iter().for_each(|&p| self.push(p));
    }

    /// The points.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Metres along the line up to each of its points.
    pub fn along(&self) -> &[f64] {
        &self.along
    }

    /// Whole length.
    pub fn length(&self) -> f64 {
        self.along.last().copied().unwrap_or(0.0)
    }

    /// The point at `s`; the end segments go on straight.
    pub fn at(&self, s: f64) -> DVec3 {
        let Some(last) = self.points.len().checked_sub(2) else {
            return self.points.first().copied().unwrap_or_default();
        };
        let i = self.along.partition_point(|&a| a <= s).saturating_sub(1).min(last);
        let share = (s - self.along[i]) / (self.along[i + 1] - self.along[i]);
        self.points[i] + (self.points[i + 1] - self.points[i]) * share
    }

    /// Unit direction in plan at `s`, of the chord half a metre to both sides.
    pub fn heading(&self, s: f64) -> DVec2 {
        let chord = self.at(s + 0.5) - self.at(s - 0.5);
        chord.truncate().normalize_or(DVec2::X)
    }

    /// The line with its points in reverse order.
    pub fn reversed(&self) -> Self {
        Self::new(self.points.iter().rev().copied())
    }

    /// The part from `from` to `to`.
    pub fn part(&self, from: f64, to: f64) -> Self {
        let inner = self.points.iter().zip(&self.along);
        let inner = inner.filter(|(_, a)| **a > from && **a < to).map(|(p, _)| *p);
        Self::new(std::iter::once(self.at(from)).chain(inner).chain([self.at(to)]))
    }

    /// The line `to_left` metres to the left, point by point.
    pub fn offset(&self, to_left: f64) -> Vec<DVec3> {
        let n = self.points.len();
        let side = |i: usize| {
            let before = self.points[i.saturating_sub(1)];
            let after = self.points[(i + 1).min(n - 1)];
            left_of((after - before).truncate().normalize_or(DVec2::X))
        };
        (0..n).map(|i| self.points[i] + (side(i) * to_left).extend(0.0)).collect()
    }
}

/// The direction a quarter turn to the left.
pub fn left_of(direction: DVec2) -> DVec2 {
    DVec2::new(-direction.y, direction.x)
}

/// A cubic from `a` along `from_a` to `b` along `into_b` (unit directions), in steps of about `step` metres.
pub fn curve(a: DVec3, from_a: DVec2, b: DVec3, into_b: DVec2, step: f64) -> Line {
    let reach = 0.4 * (b - a).truncate().length();
    let (p, q) = (a + (from_a * reach).extend(0.0), b - (into_b * reach).extend(0.0));
    let pieces = ((b - a).length() / step).ceil().clamp(2.0, 2000.0) as usize;
    Line::new((0..=pieces).map(|i| {
        let t = i as f64 / pieces as f64;
        let u = 1.0 - t;
        a * (u * u * u) + p * (3.0 * u * u * t) + q * (3.0 * u * t * t) + b * (t * t * t)
    }))
}
