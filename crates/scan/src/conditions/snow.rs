//! Falling snow and rain, for each beam: the flakes or drops in its cone, those first whose echoes are strongest.
//!
//! [`Balls`] is the law of how many fall and how large they are. Echoes of two targets that come back within a
//! pulse's length of each other add up.

use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

use arrayvec::ArrayVec;
use lidar_cast::maths;

use super::fog::{LIGHT, interpolated, overlap};

/// Reflectance of a flake, as the snow of Hahner et al. 2022 takes it.
const FLAKE: f64 = 0.9;
/// Reflectance of a drop by the cross-section that it takes out of the light: π/S, with the lidar ratio S of rain.
const DROP: f64 = PI / LIDAR_RATIO;
/// Extinction over backscatter of drops of water at 905 nm, in sr: that of cloud droplets without drizzle, 18.8 ± 0.8
/// (O'Connor et al. 2004). None measured in rain was found.
///
/// It lies between the bounds of rain: Mie's series for perfect spheres of Marshall and Palmer's sizes gives 4.4 to 5.9
/// at 50 to 1 mm/h, nearly all of it glory, which drops that are not round lose. The two axial reflections alone give
/// 260; LISA (Kilic et al. 2021) has the front one, 0.02 of a drop's cross-section: 317.
const LIDAR_RATIO: f64 = 18.8;
/// Most flakes of a beam that are drawn one by one.
const MOST: usize = 12;

/// Snow or rain of one rate.
///
/// Rain is snow of other balls: its drops are few at the scale of a beam as well (at 10 mm/h four in the first 10 m of
/// 3 × 1.5 mrad), so that single drops decide, not a medium. Only their law and their reflectance differ.
///
/// Flakes are a Poisson process in space. One whose cross-section is smaller than the beam's takes its share
/// s = D²/(h·v·r²) of the light once its centre is in the cone; a larger one takes all of it, once the beam's
/// axis meets it. Either way a metre of air takes n·π/4·⟨D²⟩ of the light on the mean. A flake's echo has power
/// ρ·s·ξ(r)/r², ξ the overlap of beam and receiver near the sensor.
///
/// Flakes are drawn by falling echo, not by distance. The number of flakes with echoes above p is Poisson of
/// a mean that has a closed form. The strongest therefore comes from one number, and a beam costs the same
/// however many flakes are in it. Once none that is left can win, the rest takes its mean share of the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Falling {
    balls: Option<Balls>,
    /// ρ of its balls.
    reflectance: f64,
}

/// A flake or drop that sends back more than any other of its beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Flake {
    /// Metres along the beam.
    pub range: f64,
    /// Power in the unit of ρ·cos θ / r², behind nearer flakes.
    pub power: f64,
}

/// Effect of snow or rain on one beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FallEffect {
    /// Share of the light that goes as far as the beam does; a flake shades the way out and the way back
    /// alike, so it counts once.
    pub passed: f64,
    /// The flake of the strongest echo; none if none sends anything back.
    pub flake: Option<Flake>,
}

/// A flake drawn by itself.
#[derive(Debug, Clone, Copy)]
struct DrawnFlake {
    range: f64,
    /// Share of the beam's light that it takes.
    share: f64,
}

impl DrawnFlake {
    /// Echo power of the flake, in the unit of ρ·cos θ / r².
    fn power(&self, reflectance: f64) -> f64 {
        reflectance * self.share * overlap(self.range)
            / (self.range * self.range).max(f64::MIN_POSITIVE)
    }
}

impl Falling {
    /// Snow that falls at a rate in millimetres of water an hour and a speed in metres a second.
    pub(crate) fn snow(rate: f64, speed: f64) -> Self {
        Self { balls: Balls::flakes(rate, speed), reflectance: FLAKE }
    }

    /// Rain that falls at a rate in millimetres an hour.
    pub(crate) fn rain(rate: f64) -> Self {
        Self { balls: Balls::drops(rate), reflectance: DROP }
    }

    /// Share of the light that a metre of air takes off a beam, in 1/m.
    pub(crate) fn extinction(&self) -> f64 {
        self.balls.map_or(0.0, |balls| balls.extinction())
    }

    /// Draws the flakes in a beam of `divergence` (full widths across and along, radians) up to `reach` metres.
    /// `draw` gives numbers from 0 to below 1.
    pub(crate) fn beam(
        &self,
        divergence: [f64; 2],
        reach: f64,
        mut draw: impl FnMut() -> f64,
    ) -> FallEffect {
        let Some(balls) = &self.balls else { return FallEffect { passed: 1.0, flake: None } };
        let width = (divergence[0] * divergence[1]).sqrt();
        let blocked = first_block(balls, width, reach, &mut draw);
        let mut fall = Fall::new(balls, self.reflectance, width, blocked.unwrap_or(reach));
        let last = blocked.map(|range| DrawnFlake { range, share: 1.0 });
        fall.add(last);
        while fall.next(&mut draw) {}
        FallEffect {
            passed: if blocked.is_some() { 0.0 } else { fall.passed() },
            flake: fall.best(),
        }
    }
}

/// Where the first flake stands that is larger than the beam; none before `reach`.
///
/// Along the axis they follow each other at a rate of μ·Q(3, w·r/D̄), μ the extinction, w the beam's width, Q the
/// upper incomplete gamma function; its integral is solved for by Newton's steps.
fn first_block(
    balls: &Balls,
    width: f64,
    reach: f64,
    draw: &mut impl FnMut() -> f64,
) -> Option<f64> {
    let (slope, rate) = (width / balls.mean, balls.extinction());
    let u = draw();
    // −ln(1 − u) is at least u, the integral at most 3: most beams end here.
    if u * slope >= 3.0 * rate {
        return None;
    }
    let wait = -maths::ln(1.0 - u) / rate;
    if slope == 0.0 {
        return (wait < reach).then_some(wait);
    }
    // ∫ Q(3, z) dz, concave: the steps come from below.
    let integral = |z: f64| 3.0 - maths::exp(-z) * (3.0 + z * (2.0 + 0.5 * z));
    let wanted = wait * slope;
    if wanted >= integral(slope * reach) {
        return None;
    }
    let mut z = wanted;
    for _ in 0..60 {
        let step = (wanted - integral(z)) / (maths::exp(-z) * (1.0 + z * (1.0 + 0.5 * z)));
        z += step;
        if step.abs() < 1e-9 * z {
            break;
        }
    }
    Some((z / slope).min(reach))
}

/// The flakes of one beam, drawn by falling echo.
///
/// With κ = √(p·w²/ρ), flakes with echoes above p are those with D > κ·r²; their number up to R is Poisson of mean
/// n·π/4·w²·R³·g(x), g(x) = ∫₀¹ t²·e^(−xt²) dt, x = κR²/D̄. At a given p, t = r/R is distributed as t⁴·e^(−xt²).
struct Fall<'a> {
    balls: &'a Balls,
    reflectance: f64,
    width: f64,
    reach: f64,
    /// n·π/4·w²·R³: three times the mean number of flakes.
    scale: f64,
    /// Sum of exponential steps so far.
    arrived: f64,
    /// x of the last flake: the rest is below.
    x: f64,
    drawn: ArrayVec<DrawnFlake, MOST>,
    /// Power of the strongest echo so far, shaded by the flakes drawn.
    strongest: f64,
}

impl<'a> Fall<'a> {
    fn new(balls: &'a Balls, reflectance: f64, width: f64, reach: f64) -> Self {
        let scale = balls.per_cubic_metre() * PI / 4.0 * width * width * reach.powi(3);
        Self {
            balls,
            reflectance,
            width,
            reach,
            scale,
            arrived: 0.0,
            x: f64::INFINITY,
            drawn: ArrayVec::new(),
            strongest: 0.0,
        }
    }

    fn add(&mut self, flake: Option<DrawnFlake>) {
        let Some(flake) = flake else { return };
        self.drawn.push(flake);
        self.strongest = (0..self.drawn.len()).map(|k| self.power(k)).fold(0.0, f64::max);
    }

    /// Echo power of a flake drawn, in the light that the nearer ones leave to it.
    fn power(&self, k: usize) -> f64 {
        let nearer = self.drawn.iter().filter(|other| other.range < self.drawn[k].range);
        let light: f64 = nearer.map(|other| 1.0 - other.share).product();
        self.drawn[k].power(self.reflectance) * light
    }

    /// Draws the next flake; whether another may still win.
    fn next(&mut self, draw: &mut impl FnMut() -> f64) -> bool {
        self.arrived -= maths::ln(1.0 - draw());
        let share = 3.0 * self.arrived / self.scale;
        let is_flake = share < 1.0;
        if !is_flake || self.drawn.is_full() {
            // No flakes are left; or the limit of drawn flakes is reached, and the rest is haze.
            self.x = if is_flake { self.x } else { 0.0 };
            return false;
        }
        self.x = TABLES.threshold(share);
        let t = TABLES.place(self.x, draw());
        let range = self.reach * t;
        // D / (w·r) = x·t²·D̄ / (w·r).
        let across = self.x * t * self.balls.mean / (self.width * self.reach);
        let nominal = self.reflectance
            * (self.x * self.balls.mean / (self.width * self.reach.powi(2))).powi(2);
        // Larger flakes than the beam are drawn by themselves.
        if across <= 1.0 {
            self.add(Some(DrawnFlake { range, share: across * across }));
        }
        // Every flake not drawn yet is weaker than this one would be in full view.
        self.strongest < nominal
    }

    /// Share of the light that the flakes not drawn leave up to a range.
    fn haze(&self, range: f64) -> f64 {
        let x = self.x * (range / self.reach).powi(2);
        let all = self.balls.extinction() * range;
        maths::exp(-all * TABLES.mean_share(x))
    }

    fn passed(&self) -> f64 {
        let drawn: f64 = self.drawn.iter().map(|flake| 1.0 - flake.share).product();
        drawn * self.haze(self.reach)
    }

    fn best(&self) -> Option<Flake> {
        let by_power = |a: &usize, b: &usize| self.power(*a).total_cmp(&self.power(*b));
        let best = (0..self.drawn.len()).max_by(by_power)?;
        let DrawnFlake { range, .. } = self.drawn[best];
        let power = self.power(best) * self.haze(range);
        (power > 0.0).then_some(Flake { range, power })
    }
}

/// Density of snow relative to water.
const DENSITY: f64 = 0.1;

/// Drops of Marshall and Palmer in a cubic metre and a metre of diameter, and the slope of their number at
/// 1 mm/h, in 1/m.
const DROPS: f64 = 8e6;
const SLOPE: f64 = 4100.0;

/// Flakes or drops in the air: balls whose diameters are exponentially distributed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Balls {
    /// Mean diameter in metres.
    pub mean: f64,
    /// Share of the air's volume that they fill.
    pub volume: f64,
}

impl Balls {
    /// Flakes of Gunn and Marshall 1958, at a rate in millimetres of water an hour and a speed in metres a second; none
    /// at rate 0, or so few that they are not a number.
    pub(crate) fn flakes(rate: f64, speed: f64) -> Option<Self> {
        let rain = maths::pow(rate / (487.0 * DENSITY * 0.003 * speed), 1.5);
        let mean = 10e-3 / (25.5 * maths::pow(rain, -0.48));
        let volume = rate / (3.6e6 * DENSITY * speed);
        Self::some(mean, volume)
    }

    /// Drops of Marshall and Palmer 1948 at a rate in millimetres an hour: N(D) = N₀·e^(−ΛD), N₀ = 8000 m⁻³ mm⁻¹,
    /// Λ = 4.1·R^(−0.21) mm⁻¹.
    ///
    /// A ball stands for the cross-section that its drop takes out of the light: twice the drop's (Q = 2, van de
    /// Hulst 1957), so that its diameter is √2 of the drop's.
    pub(crate) fn drops(rate: f64) -> Option<Self> {
        let slope = SLOPE * maths::pow(rate, -0.21);
        let mean = std::f64::consts::SQRT_2 / slope;
        Self::some(mean, DROPS / slope * PI * mean.powi(3))
    }

    fn some(mean: f64, volume: f64) -> Option<Self> {
        (volume > 0.0 && mean > 0.0).then_some(Self { mean, volume })
    }

    /// Share of the light that a metre of air takes off a beam: n·π/4·E[D²] with n = volume / (π/6·E[D³]), and
    /// E[Dᵏ] = k!·mean of the exponential distribution.
    pub(crate) fn extinction(&self) -> f64 {
        0.5 * self.volume / self.mean
    }

    /// Balls in a cubic metre.
    pub(crate) fn per_cubic_metre(&self) -> f64 {
        self.volume / (PI * self.mean.powi(3))
    }
}

/// cτ of the snow, τ = 10 ns: the length of a pulse's echo in metres.
pub(super) const LENGTH: f64 = LIGHT * 10e-9;
/// Metres between peak and target from which on an echo belongs to the snow before it.
pub(super) const APART: f64 = 0.2;

/// Sum of a flake's echo and a target's echo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum JoinedEcho {
    /// Two echoes with peaks of their own.
    Apart,
    /// One from the target, of this power.
    Target(f64),
    /// One from the snow.
    Flake(Flake),
}

impl Flake {
    /// Adds the flake's echo and a target's echo.
    ///
    /// P₁·sin²(πx/L) + P₂·sin²(π(x − δ)/L) has one peak where |δ| < L/2, in the part where both are on. With φ = 2πδ/L
    /// its height is ½(P₁ + P₂ + |P₁ + P₂·e^(−iφ)|). It lies L·ψ/2π behind the first's, tan ψ = P₂·sin φ/(P₁ + P₂·cos
    /// φ). Where they are farther apart, each peaks while the other is off. A peak that misses the target by less than
    /// 0.2 m is the target's, as in the published rule.
    pub(crate) fn join(&self, target: f64, power: f64) -> JoinedEcho {
        let apart = target - self.range;
        if apart.abs() >= LENGTH / 2.0 {
            return JoinedEcho::Apart;
        }
        let (sin, cos) = maths::sin_cos(TAU * apart / LENGTH);
        let (along, across) = (self.power + power * cos, power * sin);
        let peak = 0.5 * (self.power + power + maths::hypot(along, across));
        let range = self.range + LENGTH / TAU * maths::atan2(across, along);
        if (range - target).abs() < APART {
            JoinedEcho::Target(peak)
        } else {
            JoinedEcho::Flake(Flake { range, power: peak })
        }
    }
}

/// Steps of each table.
const STEPS: usize = 1024;
const GUIDES: usize = 512;
/// z of P(5/2, z) and of the mean share up to which the tables go.
const WIDEST: f64 = 36.0;
const WIDEST_MEAN: f64 = 400.0;

/// Tables of the functions of a fall that have no closed form; all snow shares them.
pub(super) struct SnowTables {
    /// x·q² by q = g'^(1/3), g' = 3·g(x).
    threshold: Vec<f64>,
    /// P(5/2, w²) by w.
    gamma: Vec<f64>,
    /// Start of the search in `gamma`, by P.
    guide: Vec<u16>,
    /// ∫₀¹ P(3, x·t²) dt by √x.
    mean_share: Vec<f64>,
}

static TABLES: LazyLock<SnowTables> = LazyLock::new(SnowTables::new);

impl SnowTables {
    fn new() -> Self {
        let step = |k: usize| k as f64 / STEPS as f64;
        // 3·∫₀¹ t²·e^(−xt²) dt.
        let g = |x: f64| match x < 1e-3 {
            true => 1.0 - 0.6 * x + 3.0 / 14.0 * x * x,
            false => {
                let w = x.sqrt();
                (0.75 * PI.sqrt() * maths::erf(w) - 1.5 * w * maths::exp(-x)) / (x * w)
            }
        };
        let threshold = (0..=STEPS).map(|k| {
            let q = step(k);
            let product = |x: f64| x * q * q;
            if k == 0 {
                return maths::pow(3.0 * PI.sqrt() / 4.0, 2.0 / 3.0);
            }
            let (mut low, mut high) = (0.0, 2.0 / (q * q));
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if g(middle) > q.powi(3) { low = middle } else { high = middle }
            }
            product(0.5 * (low + high))
        });
        let gamma = (0..=STEPS).map(|k| {
            let w = step(k) * WIDEST.sqrt();
            let tail = maths::exp(-w * w) * w * (1.0 + 2.0 / 3.0 * w * w);
            (maths::erf(w) - 2.0 / PI.sqrt() * tail).max(0.0)
        });
        let mean_share = (0..=STEPS).map(|k| {
            let x = (step(k) * WIDEST_MEAN.sqrt()).powi(2);
            let p = |z: f64| 1.0 - maths::exp(-z) * (1.0 + z * (1.0 + 0.5 * z));
            (0..400).map(|i| p(x * ((f64::from(i) + 0.5) / 400.0).powi(2))).sum::<f64>() / 400.0
        });
        let gamma: Vec<f64> = gamma.collect();
        let guide = (0..GUIDES).map(|k| {
            let below = gamma.partition_point(|&p| p <= k as f64 / GUIDES as f64);
            below.clamp(1, STEPS) as u16
        });
        Self {
            threshold: threshold.collect(),
            guide: guide.collect(),
            mean_share: mean_share.collect(),
            gamma,
        }
    }

    /// x above which a share of the flakes has its echoes.
    pub(crate) fn threshold(&self, share: f64) -> f64 {
        // At q = 10⁻⁶ echoes are stronger than any in ten thousand years of snow.
        let q = f64::from(maths::cbrtf(share as f32)).max(1e-6);
        at(&self.threshold, q) / (q * q)
    }

    /// t = r/R of a flake with its echo at x.
    pub(crate) fn place(&self, x: f64, u: f64) -> f64 {
        if x < 0.01 {
            return maths::pow(u, 0.2);
        }
        let widest = x.sqrt();
        let steps = widest / WIDEST.sqrt() * STEPS as f64;
        let part =
            u * if steps >= STEPS as f64 { 1.0 } else { at(&self.gamma, steps / STEPS as f64) };
        let bucket = (part * GUIDES as f64) as usize;
        let mut above = usize::from(self.guide[bucket.min(GUIDES - 1)]);
        while above < STEPS && self.gamma[above] <= part {
            above += 1;
        }
        let (a, b) = (self.gamma[above - 1], self.gamma[above]);
        let share = if b > a { (part - a) / (b - a) } else { 0.0 };
        let w = ((above - 1) as f64 + share) / STEPS as f64 * WIDEST.sqrt();
        (w / widest).min(1.0)
    }

    /// Share of the mean extinction up to R that is left to flakes with echoes below x.
    fn mean_share(&self, x: f64) -> f64 {
        if x >= WIDEST_MEAN {
            // 1 − ∫₀^∞ Q(3, v²) dv / √x; the integral is 15√π/16.
            return 1.0 - 15.0 * PI.sqrt() / 16.0 / x.sqrt();
        }
        at(&self.mean_share, (x / WIDEST_MEAN).sqrt())
    }
}

/// Value of a table at a place from 0 to 1.
fn at(table: &[f64], place: f64) -> f64 {
    interpolated(table, place * (table.len() - 1) as f64)
}
