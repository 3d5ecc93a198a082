//! Everything of a scene that is not geometry: ROI, coverage mode, origin of the P-SOG.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use crate::vehicle::Vehicle;

use super::description::{PsogDescription, RoiDescription, ScanDescription};
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location};

/// Largest distance in metres from the top of the ROI up to the mount.
const MOUNT_HEADROOM: f64 = 10.0;
/// Most voxels along one axis.
const MAX_AXIS: f64 = 16_777_216.0;
const MAX_VOXELS: u64 = 1 << 31;

/// Highest scanner and longest range, in metres.
const HIGHEST: f64 = 100.0;
const FARTHEST: f64 = 1000.0;

/// The region of interest of a scene: a box around the ego, cut into voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoiBounds {
    /// Lower corner in the ego frame, metres.
    pub min: [f64; 3],
    /// Upper corner of the scene file, metres; the last voxels reach past it where an extent is no whole
    /// number of voxels.
    pub max: [f64; 3],
    /// Edge lengths of a voxel, metres.
    pub voxel: [f64; 3],
    /// Voxels along x, y and z: extent / voxel, rounded when that is within 1e-6 (relative) of a
    /// whole number and rounded up otherwise; at least 1 each, at most 2³¹ in all.
    pub shape: [u32; 3],
}

impl RoiBounds {
    pub(crate) fn new(at: &Location, roi: &RoiDescription) -> Checked<Self> {
        let empty = ": the ROI would have no voxels; give max > min";
        let [min, max] = check::corners(at, roi.min, roi.max, empty)?;
        let voxel = check::size(&at.key("voxel"), roi.voxel)?;
        let mut shape = [0u32; 3];
        for i in 0..3 {
            let exact = (max[i] - min[i]) / voxel[i];
            let whole = exact.round();
            let n = if (exact - whole).abs() <= 1e-6 * whole { whole } else { exact.ceil() };
            if n > MAX_AXIS {
                let wanted =
                    format!("large enough: {n} voxels lie along this axis, at most {MAX_AXIS} may");
                return Err(bad(&at.key("voxel").item(i), voxel[i], wanted));
            }
            shape[i] = n as u32;
        }
        let count = shape.iter().map(|&n| u64::from(n)).try_fold(1u64, u64::checked_mul);
        match count {
            Some(n) if n <= MAX_VOXELS => Ok(Self { min, max, voxel, shape }),
            _ => {
                let (count, mend) =
                    (count.unwrap_or(u64::MAX), "take a smaller ROI or larger voxels");
                Err(check::too_many(at, "voxels", count, MAX_VOXELS, mend))
            }
        }
    }

    /// Checks that every mount lies in the ROI of `scene` sideways, and that the box around all touches it in z or stands
    /// at most `MOUNT_HEADROOM` above. `place` is where each mount is written.
    pub(super) fn check_mounts(
        &self,
        scene: &Location,
        vehicle: &Vehicle,
        place: impl Fn(usize) -> Location,
    ) -> Checked<()> {
        let [lowest, highest] = vehicle.corners().map(|corner| corner[2]);
        let over = lowest <= self.max[2] + MOUNT_HEADROOM && highest >= self.min[2];
        for (k, mount) in vehicle.mounts.iter().enumerate() {
            let [min, max] = mount.region.corners();
            let inside = |i: usize| self.min[i] <= min[i] && max[i] <= self.max[i];
            let fits = [('x', inside(0)), ('y', inside(1)), ('z', over)];
            if let Some((axis, _)) = fits.into_iter().find(|(_, fits)| !fits) {
                let told = format!(
                    "the mount runs from {min:?} to {max:?}, outside of the region of {} ({:?} to {:?}) in {axis}; {}",
                    scene.file,
                    self.min,
                    self.max,
                    in_metres(min.iter().chain(&max))
                );
                return Err(check::refused(&place(k), told));
            }
        }
        Ok(())
    }
}

/// Metres from the origin from which on a place of a vehicle was written in millimetres.
const MILLIMETRES: f64 = 100.0;

/// Mend of a mount with some coordinates that lies outside the ROI.
fn in_metres<'a>(coordinates: impl Iterator<Item = &'a f64>) -> String {
    let farthest = |far: f64, v: &f64| if v.abs() > far.abs() { *v } else { far };
    let far = coordinates.fold(0.0, farthest);
    if far.abs() < MILLIMETRES {
        return "move the mount or enlarge the `roi`".to_owned();
    }
    check::millimetres(far)
}

/// Voxels that a beam covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coverage {
    /// Every voxel up to the range of the LiDAR.
    Through,
    /// Every voxel up to the first surface, its voxel included.
    FirstHit,
}

impl Coverage {
    pub(crate) fn new(at: &Location, name: Option<&str>, has_geometry: bool) -> Checked<Self> {
        match (name, has_geometry) {
            (None, true) | (Some("first-hit"), true) => Ok(Self::FirstHit),
            (None, false) | (Some("through"), _) => Ok(Self::Through),
            (Some("first-hit"), false) => {
                let wanted = "possible without geometry; add `static`, `actors` or `ego.body`, or \
                              write \"through\"";
                Err(bad(at, "\"first-hit\"", wanted))
            }
            (Some(other), _) => Err(bad(at, format!("{other:?}"), "\"first-hit\" or \"through\"")),
        }
    }
}

/// Default field of view (degrees), window and stride.
const DEFAULT_SCAN: ([f64; 2], u32, u32) = ([-50.0, 20.0], 5, 1);

/// Settings of the dense virtual scans from which a P-SOG is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanSettings {
    /// Evenly spaced elevation channels; `None` spaces their rings on level ground by [`Self::spacing`],
    /// up to the edge of the ROI.
    pub channels: Option<u32>,
    /// Lowest and highest elevation, degrees.
    pub fov: [f64; 2],
    /// Azimuth steps a turn; `None` spaces points by [`Self::spacing`] at the edge of the ROI.
    pub azimuth_steps: Option<u32>,
    /// Distance of neighbouring points in metres; `None` is 3/4 of the larger horizontal edge of a voxel.
    pub spacing: Option<f64>,
    /// Range in metres.
    pub range: f64,
    /// Height of the scanner in the ego frame, metres.
    pub height: f64,
    /// Scan poses merged into one frame's grid.
    pub window: u32,
    /// Frames between two scan poses of a window.
    pub stride: u32,
}

impl ScanSettings {
    /// Default settings for a scene.
    pub fn default_of(scene: &super::Scene) -> Self {
        Self {
            channels: None,
            fov: DEFAULT_SCAN.0,
            azimuth_steps: None,
            spacing: None,
            range: scene.vehicle().longest_range(),
            height: scene.vehicle().corners()[1][2],
            window: DEFAULT_SCAN.1,
            stride: DEFAULT_SCAN.2,
        }
    }

    fn new(at: &Location, scan: &ScanDescription, lidar_range: f64, highest: f64) -> Checked<Self> {
        let count = |key, value: Option<u64>, hi| {
            value.map(|value| check::count(&at.key(key), value, 1, hi)).transpose()
        };
        let spacing = scan.spacing.map(|s| check::length(&at.key("spacing"), s)).transpose()?;
        Ok(Self {
            channels: count("channels", scan.channels, 1024)?,
            fov: check::fov(&at.key("fov"), scan.fov.unwrap_or(DEFAULT_SCAN.0))?,
            azimuth_steps: count("azimuth_steps", scan.azimuth_steps, 100_000)?,
            spacing,
            range: check::range(&at.key("range"), scan.range.unwrap_or(lidar_range))?,
            height: check::metres(&at.key("height"), scan.height.unwrap_or(highest))?,
            window: count("window", scan.window, 1000)?.unwrap_or(DEFAULT_SCAN.1),
            stride: count("stride", scan.stride, 10_000)?.unwrap_or(DEFAULT_SCAN.2),
        })
    }
}

/// Source of a scene's P-SOG.
#[derive(Debug, Clone, PartialEq)]
pub enum PsogSource {
    /// P-SOG file, its path resolved against the folder of the scene; not opened yet.
    File(PathBuf),
    /// Virtual scans of the scene's own geometry.
    Scan(ScanSettings),
}

impl PsogSource {
    pub(crate) fn new(
        top: &Location,
        psog: Option<&PsogDescription>,
        has_geometry: bool,
        dir: &Path,
        lidar_range: f64,
        highest: f64,
    ) -> Checked<Self> {
        let at = top.key("psog");
        let mend = "a scene without geometry needs a P-SOG file, write `\"psog\": { \"file\": … }`";
        let scan = match psog {
            None if has_geometry => &ScanDescription::default(),
            None => {
                return Err(check::missing(top, "psog", mend));
            }
            Some(PsogDescription { file: Some(file), scan: None }) => {
                return Ok(Self::File(dir.join(file)));
            }
            Some(PsogDescription { file: None, scan: Some(scan) }) => scan,
            Some(PsogDescription { file, .. }) => {
                let found = if file.is_some() { &["file", "scan"][..] } else { &[] };
                return Err(check::choice(&at, found, &["file", "scan"]));
            }
        };
        if !has_geometry {
            return Err(check::misplaced(&at, "scan", mend));
        }
        ScanSettings::new(&at.key("scan"), scan, lidar_range, highest).map(Self::Scan)
    }
}

pub(super) fn doubts_of_scan(psog: &PsogSource) -> Vec<String> {
    let PsogSource::Scan(scan) = psog else { return Vec::new() };
    let mut doubts = Vec::new();
    let metres = [("height", scan.height, HIGHEST), ("range", scan.range, FARTHEST)];
    for (key, value, _) in metres.into_iter().filter(|(_, value, most)| value.abs() > *most) {
        doubts.push(format!(
            "psog.scan.{key} is {value} m; lengths are in metres, {value} mm are {} m",
            value / 1000.0
        ));
    }
    let [low, high] = scan.fov;
    if low.abs().max(high.abs()) <= FRAC_PI_2 && low < high {
        doubts.push(format!(
            "psog.scan.fov is {low}° to {high}°; radians? {low} to {high} rad are {:.1}° to {:.1}°",
            low.to_degrees(),
            high.to_degrees()
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    fn told(scan: &str) -> String {
        crate::scene::tests::told(&format!(
            r#""lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}}, "frames": 3,
            "mount": {{"min": [-1, -0.6, 2], "max": [1, 0.6, 2.2], "lidars": 1}}, "psog": {{"scan": {{{scan}}}}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]"#
        ))
    }

    #[test]
    fn heights_in_millimetres_and_views_in_radians_are_doubted() {
        assert_eq!(told(r#""height": 2.8, "fov": [-50, 20], "range": 60"#), "");
        let high = told(r#""height": 2000"#);
        assert_holds!(high, "psog.scan.height is 2000 m; lengths are in metres, 2000 mm are 2 m");
        assert_holds!(told(r#""fov": [-0.9, 0.35]"#), "psog.scan.fov is -0.9° to 0.35°; radians?");
    }
}
