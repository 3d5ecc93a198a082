//! How much light goes through the surface of water.

/// Refractive indices of air and water in the near infrared, as the public wet ground takes them.
const AIR: f64 = 1.0003;
const WATER: f64 = 1.33;

/// Shares of light that water mirrors, by Fresnel's equations: polarized across the plane of incidence (s) and in
/// it (p). `cos` is the cosine of the angle of incidence in air. The rest passes; light that leaves the water along the
/// refracted angle has equal shares.
pub(super) fn mirrored(cos: f64) -> [f64; 2] {
    let cos = cos.clamp(0.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt() * AIR / WATER;
    let below = (1.0 - sin * sin).sqrt();
    let s = (AIR * cos - WATER * below) / (AIR * cos + WATER * below);
    let p = (WATER * cos - AIR * below) / (WATER * cos + AIR * below);
    [s * s, p * p]
}

/// Share of the power that comes back out of a full film on ground of `reflectance`, for s and p: in through the
/// surface, scattered, out again, with all that goes to and fro below it.
pub(super) fn through_film(reflectance: f64, cos: f64) -> [f64; 2] {
    mirrored(cos).map(|r| (1.0 - r) * reflectance * (1.0 - r) / (1.0 - reflectance * r))
}
