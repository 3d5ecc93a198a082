//! Fog in the air, for each beam, and the pulse echo of it: the integral of Rasshofer et al. 2011 over the pulse's length.

use std::f64::consts::TAU;

use lidar_cast::maths;

/// −ln 0.05: contrast left at the meteorological optical range (Koschmieder).
const CONTRAST: f64 = 2.995_732_273_553_991;
/// Backscatter of fog whose optical range is 1 m, in 1/sr (Rasshofer et al. 2011).
const BACKSCATTER: f64 = 0.046;
/// Calibration of the gain, as in the fog simulation that Robo3D builds on: in fog of this extinction (1/m) a target
/// of this reflectance is as bright as the fog at this range (metres).
const GAIN_REFLECTANCE: f64 = 0.3;
const GAIN_EXTINCTION: f64 = 0.06;
const GAIN_RANGE: f64 = 36.0;
/// Steps of the table of where light comes back from.
const STEPS: usize = 1024;

/// Fog of one density.
///
/// A target keeps e^(−2αr) of its power. The fog itself sends back g·β·(c/2)·I(α, r), with I the peak of the
/// pulse over the air before the target, and β tied to α: both follow from the optical range.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fog {
    alpha: f64,
    /// g·β·c/2.
    scale: f64,
    peaks: Peaks,
    /// Light from 0.9 m up to 1/s, by s from 1/0.9 down to 0.
    envelope: Vec<f64>,
}

impl Fog {
    /// Fog of a meteorological optical range in metres, infinite in clear air. `gain` multiplies its calibrated
    /// backscatter.
    pub(crate) fn new(optical_range: f64, gain: f64) -> Self {
        let alpha = CONTRAST / optical_range;
        let backscatter = |alpha: f64| BACKSCATTER * alpha / CONTRAST;
        let hard = GAIN_REFLECTANCE / (GAIN_RANGE * GAIN_RANGE)
            * maths::exp(-2.0 * GAIN_EXTINCTION * GAIN_RANGE);
        let soft = backscatter(GAIN_EXTINCTION)
            * (LIGHT / 2.0)
            * peak(GAIN_EXTINCTION, GAIN_RANGE).integral;
        Self {
            alpha,
            scale: gain * hard / soft * backscatter(alpha) * (LIGHT / 2.0),
            peaks: Peaks::new(alpha),
            envelope: envelope(alpha),
        }
    }

    /// Share of a target's power that is left at a range in metres, there and back.
    pub(crate) fn attenuation(&self, range: f64) -> f64 {
        maths::exp(-2.0 * self.alpha * range)
    }

    /// Power that the fog before a target sends back, in the unit of ρ·cos θ / r²; the target's range in metres
    /// is infinite if there is none.
    pub(crate) fn soft_power(&self, target: f64) -> f64 {
        self.scale * self.peaks.before(target).integral
    }

    /// Where before a target the fog sends light back from, by `u` from 0 to below 1: distributed as
    /// e^(−2αx)·ξ(x)/x².
    pub(crate) fn soft_range(&self, target: f64, u: f64) -> f64 {
        if target <= BLIND {
            return target;
        }
        let light = u * interpolated(&self.envelope, place_of(target));
        let above = self.envelope.partition_point(|&sum| sum <= light).clamp(1, STEPS);
        let (a, b) = (self.envelope[above - 1], self.envelope[above]);
        let share = if b > a { (light - a) / (b - a) } else { 0.0 };
        let place = (above - 1) as f64 + share;
        (1.0 / ((1.0 - place / STEPS as f64) / BLIND)).min(target)
    }
}

/// Place in the table of a distance in metres.
fn place_of(range: f64) -> f64 {
    (1.0 - BLIND / range) * STEPS as f64
}

/// Value of a table at a place from 0 to its last entry.
pub(super) fn interpolated(table: &[f64], place: f64) -> f64 {
    let below = (place as usize).min(table.len() - 2);
    table[below] + (place - below as f64) * (table[below + 1] - table[below])
}

/// ∫ e^(−2αx)·ξ(x)/x² dx from 0.9 m on; with s = 1/x the integrand is all but even.
fn envelope(alpha: f64) -> Vec<f64> {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for step in 0..STEPS {
        let x = BLIND / (1.0 - (step as f64 + 0.5) / STEPS as f64);
        sum += maths::exp(-2.0 * alpha * x) * overlap(x);
        sums.push(sum);
    }
    sums
}

/// Metres a second.
pub(super) const LIGHT: f64 = 299_792_458.0;
/// Half width of the pulse in seconds.
const HALF_WIDTH: f64 = 20e-9;
/// Metres of air that are in the pulse at once.
const LENGTH: f64 = LIGHT * HALF_WIDTH;
/// Metres within which the receiver sees nothing of the beam, and from which on all of it.
const BLIND: f64 = 0.9;
const OPEN: f64 = 1.0;
/// Metres beyond which no fog adds to the peak.
const FARTHEST: f64 = 8.0;
/// Steps a metre of the sums, and of the table by distance of the target.
const FINE: f64 = 1000.0;
const COARSE: f64 = 50.0;

/// Share of the beam that the receiver sees at a distance in metres.
pub(super) fn overlap(range: f64) -> f64 {
    ((range - BLIND) / (OPEN - BLIND)).clamp(0.0, 1.0)
}

/// Peak of the pulse that fog sends back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Peak {
    /// max over R of ∫ sin²(πt/2τ)·e^(−2αx)·ξ(x)/x² dt, x = R − ct/2 up to the target, in s/m².
    pub integral: f64,
    /// R of the peak in metres.
    pub range: f64,
}

/// Sums over x of h = e^(−2αx)·ξ(x)/x² and of h·cos kx and h·sin kx, k = 2π/cτ: with sin² = ½(1 − cos) they give the
/// integral for any R from two places each.
struct PulseSums(Vec<[f64; 3]>);

impl PulseSums {
    fn new(alpha: f64) -> Self {
        let cells = ((FARTHEST - BLIND) * FINE) as usize;
        let mut sums = vec![[0.0; 3]];
        let mut sum = [0.0; 3];
        for cell in 0..cells {
            let x = BLIND + (cell as f64 + 0.5) / FINE;
            let h = maths::exp(-2.0 * alpha * x) * overlap(x) / (x * x) / FINE;
            let (sin, cos) = maths::sin_cos(TAU / LENGTH * x);
            sum = [sum[0] + h, sum[1] + h * cos, sum[2] + h * sin];
            sums.push(sum);
        }
        Self(sums)
    }

    fn at(&self, x: f64) -> [f64; 3] {
        let place = ((x - BLIND) * FINE).clamp(0.0, (self.0.len() - 1) as f64);
        let below = (place as usize).min(self.0.len() - 2);
        let share = place - below as f64;
        std::array::from_fn(|k| {
            self.0[below][k] + share * (self.0[below + 1][k] - self.0[below][k])
        })
    }

    /// The integral at R, for a target.
    fn integral(&self, range: f64, target: f64) -> f64 {
        let (from, to) = (self.at(range - LENGTH), self.at(range.min(target)));
        let (sin, cos) = maths::sin_cos(TAU / LENGTH * range);
        let part = |k: usize| to[k] - from[k];
        ((part(0) - cos * part(1) - sin * part(2)) / LIGHT).max(0.0)
    }

    /// The greatest integral: the best of a grid, then by golden sections around it.
    fn peak(&self, target: f64) -> Peak {
        let step = 0.1;
        let places = (0..((FARTHEST - BLIND) / step) as usize).map(|k| BLIND + k as f64 * step);
        let best =
            places.max_by(|&a, &b| self.integral(a, target).total_cmp(&self.integral(b, target)));
        let best = best.unwrap_or(BLIND);
        let (mut low, mut high) = (best - step, best + step);
        const GOLDEN: f64 = 0.618_033_988_749_895;
        while high - low > 1e-5 {
            let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
            if self.integral(a, target) < self.integral(b, target) { low = a } else { high = b }
        }
        let range = 0.5 * (low + high);
        Peak { integral: self.integral(range, target), range }
    }
}

/// Peak for fog of an extinction in 1/m before a target at `target` metres.
pub(super) fn peak(alpha: f64, target: f64) -> Peak {
    PulseSums::new(alpha).peak(target)
}

/// Peaks by distance of the target, tabulated.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Peaks(Vec<Peak>);

impl Peaks {
    /// For fog of an extinction in 1/m.
    pub(crate) fn new(alpha: f64) -> Self {
        let sums = PulseSums::new(alpha);
        let places = 0..=((FARTHEST - BLIND) * COARSE) as usize;
        Self(places.map(|k| sums.peak(BLIND + k as f64 / COARSE)).collect())
    }

    /// Peak before a target at `target` metres; infinite if there is none.
    pub(crate) fn before(&self, target: f64) -> Peak {
        let last = self.0.len() - 1;
        let place = ((target - BLIND) * COARSE).max(0.0);
        if place >= last as f64 {
            return self.0[last];
        }
        let (below, share) = (place as usize, place.fract());
        let (a, b) = (self.0[below], self.0[below + 1]);
        Peak {
            integral: a.integral + share * (b.integral - a.integral),
            range: a.range + share * (b.range - a.range),
        }
    }
}
