//! From the surfaces that a beam meets to the returns that the sensor reports: power, threshold, noise, echoes.

use arrayvec::ArrayVec;
use glam::{DVec3, Vec3};
use sightline_scene::vehicle::Echoes;

use crate::conditions::{Flake, JoinedEcho, false_range};
use crate::fires::{BeamPlace, Chance, Purpose};
use crate::optics::{Optics, is_seen};
use crate::rim::{RAYS, Rims, ray_share};
use crate::station::SurfaceHit;
use crate::sweep::{FiredBeams, Sweeper};
use crate::{NO_CLASS, NO_INSTANCE, Return, Status};

/// Echo power, as a multiple of the threshold, below which range noise grows; and the most that it grows.
const STRONG: f64 = 9.0;
const MOST_NOISE: f64 = 3.0;

/// Turns the hits of one LiDAR in a frame into returns.
pub(super) struct Receiver<'a> {
    pub sweeper: &'a Sweeper,
    pub sweep: &'a FiredBeams,
    /// `None` if beams have no width.
    pub rims: Option<&'a Rims<'a>>,
    pub optics: &'a Optics,
    pub lidar: u16,
    /// True for geometry alone, without errors or weather.
    pub ideal: bool,
    pub seed: u64,
    pub frame: usize,
}

impl Receiver<'_> {
    /// Reports the returns of a beam, one at least.
    pub(crate) fn returns(&self, beam: &BeamPlace, mut report: impl FnMut(Return)) {
        let surface = self.sweep.surfaces[beam.fired];
        if self.ideal {
            let reflectance = &self.optics.reflectance;
            let reflectance = reflectance.of(surface.class, surface.instance, self.seed);
            let intensity = reflectance as f32 * surface.incidence;
            let status = if surface.is_hit() { Status::Hit } else { Status::Miss };
            let echo = Echo { range: f64::from(surface.t), power: 0.0, ray: Some(0), status };
            return report(self.record(beam, &[surface], &echo, echo.range, intensity));
        }
        let rays = self.rims.and_then(|rims| rims.rays(beam));
        let rays = rays.as_ref().map_or(std::slice::from_ref(&surface), |rays| &rays[..]);
        let number = beam.beam as u32;
        let chance = Chance::new(self.seed, self.frame as u32, u32::from(self.lidar), number);
        let mut echoes = EchoList::default();
        self.surfaces(rays, &mut echoes);
        self.weather(&chance, &surface, &mut echoes);
        let mut reported = None;
        for (k, wanted) in self.wanted(&chance, &echoes).into_iter().enumerate() {
            let Some(at) = wanted.filter(|&at| reported != Some(at)) else { continue };
            let echo = &echoes[at];
            report(self.measure(beam, rays, &chance, echo, k as u32));
            reported = Some(at);
        }
        if reported.is_none() {
            let status = if surface.is_hit() { Status::Lost } else { Status::Miss };
            let echo = Echo { range: f64::NAN, power: 0.0, ray: None, status };
            report(self.record(beam, rays, &echo, f64::NAN, 0.0));
        }
    }

    /// Echoes that the sensor reports, by their place in the list. Where the strongest is also the last, a dual sensor
    /// reports the second strongest too, as those of Velodyne (VLP-16 User Manual 63-9243, Dual Return Mode) and Hesai
    /// (Pandar64 User Manual, 3.1.2.2) do.
    fn wanted(&self, chance: &Chance, echoes: &[Echo]) -> [Option<usize>; 2] {
        let response = &self.sweeper.model.response;
        let seen = |at: usize| {
            let draw = || chance.draw(Purpose::Detection, at as u32);
            is_seen(response, echoes[at].power, draw) && echoes[at].range >= response.min_range
        };
        let all = 0..echoes.len();
        // The first of equal ones.
        let by_power = |a: &usize, b: &usize| echoes[*a].power.total_cmp(&echoes[*b].power);
        let strongest = || all.clone().rev().max_by(by_power).filter(|&at| seen(at));
        let last = || {
            let by_range = |a: &usize, b: &usize| echoes[*a].range.total_cmp(&echoes[*b].range);
            all.clone().filter(|&at| seen(at)).max_by(by_range)
        };
        match response.echoes {
            Echoes::Strongest => [strongest(), None],
            Echoes::Last => [last(), None],
            Echoes::Dual => match (strongest(), last()) {
                (Some(both), Some(last)) if both == last => {
                    let others = all.clone().rev().filter(|&at| at != both && seen(at));
                    [Some(both), others.max_by(by_power)]
                }
                both => both.into(),
            },
        }
    }

    /// Echoes of the surfaces that a beam's rays meet; those within a pulse's length are one.
    fn surfaces(&self, rays: &[SurfaceHit], echoes: &mut EchoList) {
        if let [only] = rays {
            if only.is_hit() {
                echoes.push(self.echo(only, 0, 1.0));
            }
            return;
        }
        let mut order: [u8; RAYS] = std::array::from_fn(|ray| ray as u8);
        order.sort_by(|&a, &b| rays[usize::from(a)].t.total_cmp(&rays[usize::from(b)].t));
        let pulse = self.sweeper.model.response.pulse;
        // Where the echo begins, and the most that one ray adds to it.
        let (mut from, mut most) = (f64::NEG_INFINITY, 0.0);
        for ray in order {
            let surface = &rays[usize::from(ray)];
            if !surface.is_hit() {
                continue;
            }
            let echo = self.echo(surface, ray, ray_share(ray.into()));
            match echoes.last_mut().filter(|_| echo.range - from <= pulse) {
                Some(joined) => {
                    joined.join(&echo);
                    if echo.power > most {
                        (most, joined.ray) = (echo.power, echo.ray);
                    }
                }
                None => {
                    (from, most) = (echo.range, echo.power);
                    echoes.push(echo);
                }
            }
        }
        if let [only] = &mut echoes[..]
            && rays.iter().all(SurfaceHit::is_hit)
        {
            // The whole beam meets surfaces close to its centre hit: the echo gets the centre's range.
            (only.range, only.ray) = (f64::from(rays[0].t), Some(0));
        }
    }

    /// Echo of a surface that gets `share` of the beam's power.
    fn echo(&self, surface: &SurfaceHit, ray: u8, share: f64) -> Echo {
        let (range, incidence) = (f64::from(surface.t), f64::from(surface.incidence));
        let (class, instance) = (surface.class, surface.instance);
        let power = share * self.optics.power(self.seed, class, instance, incidence, range);
        Echo { range, power, ray: Some(ray), status: Status::Hit }
    }

    /// Adds echoes of fog, snow and rain, and dims the surfaces behind snow and rain.
    fn weather(&self, chance: &Chance, surface: &SurfaceHit, echoes: &mut EchoList) {
        let model = &self.sweeper.model;
        let target = if surface.is_hit() { f64::from(surface.t) } else { f64::INFINITY };
        let surfaces = echoes.len();
        if let Some(fog) = &self.optics.weather.fog {
            let range = fog.soft_range(target, chance.draw(Purpose::FogRange, 0));
            echoes.push(Echo::of_medium(range, fog.soft_power(target), Status::Fog));
        }
        for (falling, purpose, status) in self.optics.weather.falls() {
            let reach = f64::from(model.table.range()).min(target);
            let fallen = falling.beam(model.response.divergence, reach, chance.draws(purpose));
            for echo in &mut echoes[..surfaces] {
                echo.power *= fallen.passed;
            }
            let Some(flake) = fallen.flake else { continue };
            let power = flake.power * self.optics.through_fog(flake.range);
            join(&Flake { power, ..flake }, status, surfaces, echoes);
        }
    }

    /// A return, with the errors of its measurement; the second is of another surface than the strongest.
    fn measure(
        &self,
        beam: &BeamPlace,
        rays: &[SurfaceHit],
        chance: &Chance,
        echo: &Echo,
        number: u32,
    ) -> Return {
        let response = &self.sweeper.model.response;
        let weak = (STRONG * response.threshold() / echo.power).sqrt().clamp(1.0, MOST_NOISE);
        let noise = response.noise * weak * chance.normal(Purpose::RangeNoise, number);
        let mut range = (echo.range + noise).max(0.0);
        let mut echo = *echo;
        if number == 1 && echo.status == Status::Hit {
            echo.status = Status::Second;
        }
        if chance.draw(Purpose::Crosstalk, 2 * number) < self.optics.weather.crosstalk {
            let draw = chance.draw(Purpose::Crosstalk, 2 * number + 1);
            range = false_range(response.min_range, range, draw);
            echo.status = Status::Crosstalk;
        }
        let intensity = (echo.power * echo.range * echo.range).clamp(0.0, 1.0) as f32;
        self.record(beam, rays, &echo, range, intensity)
    }

    /// The record of a return at a range.
    fn record(
        &self,
        beam: &BeamPlace,
        rays: &[SurfaceHit],
        echo: &Echo,
        range: f64,
        intensity: f32,
    ) -> Return {
        let is_point = echo.status.is_point();
        let (position, raw) =
            if is_point { self.positions(beam, rays, echo, range) } else { (Vec3::NAN, Vec3::NAN) };
        let labelled = matches!(echo.status, Status::Hit | Status::Second);
        let surface = echo.ray.filter(|_| labelled).map(|ray| &rays[usize::from(ray)]);
        Return {
            position: position.to_array(),
            raw: raw.to_array(),
            range: if is_point { range as f32 } else { f32::NAN },
            intensity: if is_point { intensity } else { 0.0 },
            time: if self.ideal { 0.0 } else { self.sweeper.time_of(beam) as f32 },
            lidar: self.lidar,
            channel: beam.channel as u16,
            column: beam.column as u32,
            class: surface.map_or(NO_CLASS, |surface| surface.class),
            clean_class: rays[0].class,
            instance: surface.map_or(NO_INSTANCE, |surface| surface.instance),
            incidence: surface.map_or(0.0, |surface| surface.incidence),
            status: echo.status,
        }
    }

    /// Where a return at a range comes from, and where it seems to come from if the sensor stood still.
    fn positions(
        &self,
        beam: &BeamPlace,
        rays: &[SurfaceHit],
        echo: &Echo,
        range: f64,
    ) -> (Vec3, Vec3) {
        let direction = self.sweeper.model.table.directions()[beam.beam].map(f64::from);
        let point = DVec3::from(direction) * range;
        let raw = self.sweep.station(0).start_from_sensor.apply(point).as_vec3();
        let own = &rays[0];
        let position = if echo.ray == Some(0) && range == f64::from(own.t) {
            // To the bit where nothing has moved it.
            own.position
        } else {
            let station = self.sweep.station(beam.firing);
            station.start_from_sensor.apply(point).as_vec3()
        };
        let blur = self.optics.weather.blur as f32;
        (position + (raw - position) * blur, raw)
    }
}

/// Adds a flake's or drop's echo to those of a beam, the first `surfaces` of which are of surfaces: the strongest
/// of these near it adds up with it.
fn join(flake: &Flake, status: Status, surfaces: usize, echoes: &mut EchoList) {
    let lit = echoes[..surfaces].iter_mut().map(|echo| {
        let joined = flake.join(echo.range, echo.power);
        (echo, joined)
    });
    let near = lit.filter(|(echo, joined)| echo.power > 0.0 && *joined != JoinedEcho::Apart);
    match near.max_by(|(a, _), (b, _)| a.power.total_cmp(&b.power)) {
        Some((echo, JoinedEcho::Target(power))) => echo.power = power,
        Some((echo, JoinedEcho::Flake(Flake { range, power }))) => {
            *echo = Echo::of_medium(range, power, status);
        }
        _ => echoes.push(Echo::of_medium(flake.range, flake.power, status)),
    }
}

/// Power that comes back from one distance.
#[derive(Debug, Clone, Copy)]
struct Echo {
    /// Metres.
    pub range: f64,
    /// Power in the unit of ρ·cos θ / r².
    pub power: f64,
    /// The beam's ray that brings most of it back from a surface; `None` of the medium.
    pub ray: Option<u8>,
    pub status: Status,
}

impl Echo {
    /// Echo of fog, snow or rain.
    fn of_medium(range: f64, power: f64, status: Status) -> Self {
        Self { range, power, ray: None, status }
    }

    /// Adds the power of another, and moves to the mean of both by power.
    fn join(&mut self, other: &Self) {
        let power = self.power + other.power;
        let share = if power > 0.0 { other.power / power } else { 0.0 };
        self.range += share * (other.range - self.range);
        self.power = power;
    }
}

/// The echoes of a beam: at most one of each of its rays, one of fog, of snow and of rain each.
type EchoList = ArrayVec<Echo, { RAYS + 3 }>;
