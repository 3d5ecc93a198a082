//! A rig handed over: a folder with its poses, bill of materials, masks and crop boxes of the own body, drawing and
//! sensor profiles.
//!
//! | file | holds |
//! |---|---|
//! | `rig` | the placement with everything that is computed about it |
//! | `tables` | poses and bill of materials |
//! | `mask` | masks of the beams that end at the own body |
//! | `png` | a grey picture as PNG |
//! | `crop` | crop boxes of the own body for Autoware |
//! | `readme` | the text about the folder |

mod mask;
mod rig;
mod tables;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Computing, RunError};
use crate::files::{Session, is_forced, safe_name, safe_names, writable_folder, write_folder};
use crate::report::handover::{DrawnLidar, DrawnMount, DrawnRig};
use crate::shared::FieldOfView;
use crate::vehicle::MAX_LIDARS;
use crate::vehicle::sensor_file::isaac_profile;
use mask::SelfHitMask;
use rig::HandoverRig;

/// A placement that is to be handed over.
#[derive(Debug, Clone, Default)]
pub struct HandoverRequest {
    /// A scene, none for level ground, and last a file of placements with the name of one of them behind a colon where
    /// there are several.
    pub files: Vec<String>,
    /// Folder to write.
    pub out: PathBuf,
    /// Frame of the scene, from 0.
    pub frame: u32,
    /// Metres that crop boxes reach beyond the body.
    pub margin: f64,
    /// Position of `base_link` in the ego frame, metres; crop boxes count from there.
    pub base_link: [f64; 3],
}

/// Summary of a folder that was written.
#[derive(Debug, Serialize)]
pub struct HandoverMade {
    /// The folder.
    pub out: PathBuf,
    /// Name of the placement.
    pub placement: String,
    /// Names of its files.
    pub files: Vec<String>,
    /// Of each LiDAR the beams that end at the own body, and all.
    pub own_beams: Vec<[usize; 2]>,
    /// Price of all sensors.
    pub price: f64,
}

/// Names and bytes of the files of the folder.
type Files = Vec<(String, Vec<u8>)>;

/// Writes the folder of a placement, whole or not at all.
///
/// # Errors
/// Files that cannot be read or written, several placements without a name, a frame that the scene does not have.
pub fn handover(
    request: &HandoverRequest,
    computing: &Computing<'_>,
) -> Result<HandoverMade, RunError> {
    let _session = Session::begin();
    writable_folder(&request.out)?;
    let rig = HandoverRig::new(request, computing)?;
    let masks = rig.masks();
    let (materials, price) = tables::materials(&rig);
    let mut files: Files = Vec::new();
    let mut add = |name: &str, bytes: Vec<u8>| files.push((name.to_owned(), bytes));
    add("poses.csv", tables::poses(&rig).into_bytes());
    add("materials.csv", materials.into_bytes());
    let drawing = drawn(&rig).drawing();
    add("drawing.svg", drawing.svg().into_bytes());
    add("drawing.pdf", drawing.pdf());
    if let Some(boxes) = mask::boxes(&rig, request.margin, request.base_link) {
        add("crop_boxes.yaml", boxes.into_bytes());
    }
    for (k, mask) in masks.iter().enumerate() {
        let mount =
            rig.mounts[k].as_deref().map_or(String::new(), |m| format!("-{}", safe_name(m)));
        add(&format!("mask-{k}{mount}.csv"), mask.csv().into_bytes());
        add(&format!("mask-{k}{mount}.png"), mask.png());
    }
    files.extend(profiles(&rig));
    let readme = tables::text(&rig, request, &masks, files.iter().map(|(name, _)| &**name))?;
    files.insert(0, ("README.txt".to_owned(), readme.into_bytes()));
    if !computing.watcher.goes_on() {
        return Err(RunError::Interrupted(format!(
            "{}: interrupted; nothing is written",
            request.out.display()
        )));
    }
    write_folder(&request.out, &files)?;
    if is_forced() {
        remove_stale_masks(&request.out, &files)?;
    }
    Ok(HandoverMade {
        out: request.out.clone(),
        placement: rig.placement.name.clone(),
        files: files.into_iter().map(|(name, _)| name).collect(),
        own_beams: masks.iter().map(SelfHitMask::counts).collect(),
        price,
    })
}

/// Removes masks that an earlier rig of more or other LiDARs has left in a folder: they would be taken for this one's.
fn remove_stale_masks(out: &Path, files: &Files) -> Result<(), RunError> {
    for entry in std::fs::read_dir(out).map_err(RunError::io(out))? {
        let entry = entry.map_err(RunError::io(out))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_stale = is_mask(&name) && files.iter().all(|(written, _)| *written != name);
        // Links and folders are nobody's but the user's.
        if is_stale && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            std::fs::remove_file(entry.path()).map_err(RunError::io(&entry.path()))?;
        }
    }
    Ok(())
}

/// True for a name that this command gives to a mask: `mask-3.csv`, `mask-3-roof.png`.
fn is_mask(name: &str) -> bool {
    let stem = name.strip_suffix(".csv").or_else(|| name.strip_suffix(".png"));
    let Some(rest) = stem.and_then(|stem| stem.strip_prefix("mask-")) else { return false };
    let (number, mount) = rest.split_once('-').unwrap_or((rest, "of no mount"));
    let is_number =
        number.parse::<usize>().is_ok_and(|k| k < MAX_LIDARS && k.to_string() == number);
    is_number && !mount.is_empty()
}

/// The rig as it is drawn.
fn drawn(rig: &HandoverRig) -> DrawnRig<'_> {
    let lidars = rig.placement.lidars.iter().enumerate().map(|(k, pose)| DrawnLidar {
        pose: *pose,
        ego_from_sensor: rig.poses[k],
        view: FieldOfView::of(rig.table(k)),
        model: rig.model_name(rig.models[k]),
        mount: rig.mounts[k].clone().unwrap_or_default(),
    });
    let vehicle = rig.scene().vehicle();
    let mounts = vehicle.mounts.iter().map(|mount| DrawnMount {
        name: if vehicle.is_nameless() { String::new() } else { mount.region.name.clone() },
        corners: mount.region.corners(),
    });
    DrawnRig {
        vehicle: rig.vehicle_name(),
        placement: &rig.placement.name,
        body: &rig.body,
        lidars: lidars.collect(),
        mounts: mounts.collect(),
        near: rig.near.as_ref().map(|(outline, near)| (outline, near)).map_err(Clone::clone),
    }
}

/// Isaac Sim's profile of each model that the rig has.
fn profiles(rig: &HandoverRig) -> Files {
    let used = rig.used_models();
    let names: Vec<String> = used.iter().map(|model| rig.model_name(*model)).collect();
    let files = safe_names(names.iter().map(|name| &**name)).into_iter();
    let profile = |((model, name), file): ((&usize, &String), String)| {
        let sensor = &rig.scene().vehicle().sensors[*model];
        let profile = isaac_profile(name, &sensor.lidar, &sensor.response);
        (format!("{file}.isaac.json"), format!("{profile:#}\n").into_bytes())
    };
    used.iter().zip(&names).zip(files).map(profile).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_masks_are_masks() {
        for mask in ["mask-0.csv", "mask-15-roof.png", "mask-3-front-left.csv"] {
            assert!(is_mask(mask), "{mask}");
        }
        for other in [
            "mask-16.csv",
            "mask-03.csv",
            "mask-a.png",
            "mask-1-.png",
            "mask-1.txt",
            "mask.csv",
            "my-mask-1.csv",
        ] {
            assert!(!is_mask(other), "{other}");
        }
    }
}
