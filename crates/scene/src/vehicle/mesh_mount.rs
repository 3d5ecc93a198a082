//! Mounts on a mesh: which of its triangles, the plane that they are heights over, their smoothed normals.
//!
//! Meshes that mirrored pairs stand on are made exact images of each other, or of themselves.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::Region;
use super::description::{FacingDescription, KeepOutDescription, MeshPatchDescription};
use super::equipment::VehicleMount;
use super::pairing::flipped;
use super::surface::{Facet, Image, Surface, frame_of_patch};
use crate::mesh::{self, Placing};
use crate::scene::clipped;
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location};

/// Widest angle from the direction that triangles face unless the mount says so, radians.
const FACING: f64 = std::f64::consts::FRAC_PI_3;
/// Least cosine between a triangle and the mean normal: steeper ones are no heights over its plane.
const STEEP: f64 = 0.1;
/// Vertices within this many metres are one.
const WELD: f64 = 1e-6;
const MOST_TRIANGLES: usize = 1_000_000;

/// The surface of a mount, its frame, and the files read. Bounds of the two fields in its plane are set; those
/// of the others are the caller's.
pub(super) fn patch(
    at: &Location,
    patch: &MeshPatchDescription,
    dir: &Path,
) -> Checked<(Region, Vec<PathBuf>)> {
    let file = dir.join(&patch.file);
    let MeshPatchDescription { scale, translate, roll, pitch, yaw, .. } = *patch;
    let axes = patch.axes.as_deref();
    let placing = Placing::new(at, axes, scale, translate, [roll, pitch, yaw])?;
    let facing = patch.facing.as_ref().map(|facing| direction(&at.key("facing"), facing));
    let facing = facing.transpose()?;
    let within = patch.within.as_ref().map(|KeepOutDescription { min, max }| {
        check::corners(&at.key("within"), *min, *max, ": the box would hold nothing")
    });
    let within = within.transpose()?;
    let raw = mesh::load(at, &file)?;
    let vertices = placing.vertices(at, &file, &raw)?;
    let facets = smoothed(&vertices, &raw.faces, facing);
    let facets = match within {
        None => facets,
        Some(within) => facets.iter().flat_map(|facet| cut(facet, within)).collect(),
    };
    if facets.is_empty() || facets.len() > MOST_TRIANGLES {
        let wanted = format!(
            "1 to {MOST_TRIANGLES} triangles to stand on: change `within` and `facing`, whose box and \
             direction are in the ego frame, or `scale` and `axes`"
        );
        let found = format!("{} with {} triangles there", patch.file, facets.len());
        return Err(bad(at, found, wanted));
    }
    let region = assembled(facets).map_err(|wanted| bad(at, &patch.file, wanted))?;
    Ok((region, raw.files))
}

fn direction(at: &Location, facing: &FacingDescription) -> Checked<(DVec3, f64)> {
    let here = at.key("direction");
    let direction = DVec3::from(check::point(&here, facing.direction)?).try_normalize();
    let Some(direction) = direction else {
        return Err(bad(&here, format!("{:?}", facing.direction), "a direction, [0, 0, 1] for up"));
    };
    let angle = facing.angle.unwrap_or(FACING);
    if !(angle > 0.0 && angle <= FRAC_PI_2 + check::ROUNDED) {
        return Err(bad(&at.key("angle"), angle, "an angle above 0 and at most π/2 radians"));
    }
    Ok((direction, maths::cos(angle.min(FRAC_PI_2))))
}

/// Triangles that face a direction within a cosine, all of them without one, with normals at the corners that
/// are means over the triangles around, by area. A triangle has two sides, of which the one counts that faces
/// the direction.
fn smoothed(vertices: &[DVec3], faces: &[[u32; 3]], facing: Option<(DVec3, f64)>) -> Vec<Facet> {
    let key = |v: DVec3| (v / WELD).round().to_array().map(|metres| metres as i64);
    let mut sums: HashMap<[i64; 3], DVec3> = HashMap::new();
    let mut kept = Vec::new();
    for face in faces {
        let corners = face.map(|v| vertices[v as usize]);
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let Some(normal) = area.try_normalize() else { continue };
        let area = match facing {
            None => area,
            Some((direction, least)) if normal.dot(direction).abs() < least => continue,
            Some((direction, _)) => area * normal.dot(direction).signum(),
        };
        corners.iter().for_each(|&corner| *sums.entry(key(corner)).or_default() += area);
        kept.push((corners, area));
    }
    let normal = |corner: DVec3, area: DVec3| sums[&key(corner)].try_normalize().unwrap_or(area);
    let facet = |(corners, area): ([DVec3; 3], DVec3)| {
        let own = area.normalize_or(DVec3::Z);
        Facet { corners, normals: corners.map(|corner| normal(corner, own)) }
    };
    kept.into_iter().map(facet).collect()
}

/// The part of a triangle within a box, as triangles.
fn cut(facet: &Facet, within: [[f64; 3]; 2]) -> Vec<Facet> {
    let ring = [0, 1, 2].map(|k| [facet.corners[k], facet.normals[k]]);
    let ring = clipped(ring.to_vec(), within);
    let fan = (2..ring.len()).map(|k| [ring[0], ring[k - 1], ring[k]]);
    fan.map(|ring| Facet { corners: ring.map(|c| c[0]), normals: ring.map(|c| c[1]) }).collect()
}

/// The region of facets in the ego frame: heights over the plane of their mean normal. The error is a wish in words.
fn assembled(facets: Vec<Facet>) -> Result<Region, &'static str> {
    // Twice the vector of each area, outward as the normals are.
    let areas = facets.iter().map(|facet| {
        let [a, b, c] = facet.corners;
        let (area, normal) = ((b - a).cross(c - a), facet.normals.iter().sum::<DVec3>());
        if area.dot(normal) < 0.0 { -area } else { area }
    });
    let areas: Vec<DVec3> = areas.collect();
    let (sum, whole) = (areas.iter().sum::<DVec3>(), areas.iter().map(|a| a.length()).sum::<f64>());
    let Some(normal) = sum.try_normalize().filter(|_| sum.length() > 0.1 * whole) else {
        return Err(
            "a patch with an outer side: its normals cancel out; say with `facing` which triangles \
                    are meant, those that look up for example",
        );
    };
    let weighted = facets
        .iter()
        .zip(&areas)
        .map(|(facet, area)| (facet.corners.iter().sum::<DVec3>() / 3.0) * area.length());
    let middle = weighted.sum::<DVec3>() / whole;
    let (frame, axes) = frame_of_patch(normal, middle);
    let back = frame.inverse();
    let kept =
        facets.iter().zip(&areas).filter(|(_, area)| area.dot(normal) > STEEP * area.length());
    let moved = kept.map(|(facet, _)| facet.moved(&back));
    let Some(surface) = Surface::new(axes, moved.collect()) else {
        return Err("a patch with an area; all its triangles are thin or steep");
    };
    let (mut lower, mut upper) = ([0.0; 6], [0.0; 6]);
    for &field in &axes {
        let values = || surface.corners().map(|corner| corner[field]);
        lower[field] = values().fold(f64::MAX, f64::min);
        upper[field] = values().fold(f64::MIN, f64::max);
    }
    let (ego_from_region, surface) = (Some(frame), Some(Arc::new(surface)));
    Ok(Region { ego_from_region, lower, upper, surface, ..Region::default() })
}

/// Metres that a patch may be off the image of another one, or of itself, and still stand for it: meshes are
/// rarely symmetric to the last digit.
pub(super) const OFF: f64 = 0.005;
/// Metres from the plane y = 0 within which a corner lies in it.
const IN_PLANE: f64 = 1e-9;

/// Makes patches of meshes that are about mirror images at the plane y = 0 exact ones: of a patch over the plane
/// its left half counts on both sides, of two the first one.
pub(super) fn mirror_meshes(mounts: &mut [VehicleMount]) {
    for first in 0..mounts.len() {
        let region = mounts[first].region.clone();
        let Some(surface) = region.surface.as_ref().filter(|s| s.image == Image::None) else {
            continue;
        };
        if are_images(&region, &region) {
            mounts[first].region = own_image(&region).map_or(region, Arc::new);
            continue;
        }
        let others = first + 1..mounts.len();
        if let Some(other) = others.into_iter().find(|&k| are_images(&region, &mounts[k].region)) {
            let image = image(&region, surface, &mounts[other].region);
            mounts[other].region = image.map_or(region, Arc::new);
        }
    }
}

/// True if each patch, mirrored, lies on the other: tested at the outermost points of all corners.
fn are_images(a: &Region, b: &Region) -> bool {
    let on = |from: &Region, to: &Region| {
        let parts = from.surface.as_ref().zip(from.ego_from_region);
        let others = to.surface.as_ref().zip(to.ego_from_region);
        let Some(((own, from), (surface, to))) = parts.zip(others) else { return false };
        let (along, back) = (surface.along(), to.inverse());
        own.corners().all(|corner| {
            let outer = own.foot(own.axes.map(|k| corner[k])).point;
            let point = back.apply(flipped(from.apply(outer)));
            let foot = surface.foot(surface.axes.map(|k| point[k]));
            foot.off <= OFF && (foot.point[along] - point[along]).abs() <= OFF
        })
    };
    on(a, b) && on(b, a)
}

/// A region with the surface and the extent of another one, and its own ranges beside these.
fn on_surface(own: &Region, of: Region) -> Region {
    let mut region = Region { lower: own.lower, upper: own.upper, name: own.name.clone(), ..of };
    let axes = region.surface.as_ref().map_or([0, 1], |surface| surface.axes);
    for field in axes {
        (region.lower[field], region.upper[field]) = (of.lower[field], of.upper[field]);
    }
    region
}

/// The left half of a patch and its image, as one.
fn own_image(region: &Region) -> Option<Region> {
    let (surface, frame) = region.surface.as_ref().zip(region.ego_from_region)?;
    let half = [[f64::MIN, 0.0, f64::MIN], [f64::MAX; 3]];
    let left = surface.facets().flat_map(|facet| cut(&facet.moved(&frame), half));
    let left: Vec<Facet> = left.map(level_at_the_plane).collect();
    let both = left.iter().copied().chain(left.iter().map(Facet::flipped)).collect();
    let mut made = assembled(both).ok()?;
    Arc::make_mut(made.surface.as_mut()?).image = Image::Itself;
    Some(on_surface(region, made))
}

/// A facet whose normals lean to no side where it meets its image.
fn level_at_the_plane(mut facet: Facet) -> Facet {
    for (corner, normal) in facet.corners.into_iter().zip(&mut facet.normals) {
        if corner.y.abs() <= IN_PLANE {
            *normal = DVec3 { y: 0.0, ..*normal }.normalize_or(*normal);
        }
    }
    facet
}

/// The image of a region, in place of another one.
fn image(region: &Region, surface: &Arc<Surface>, other: &Region) -> Option<Region> {
    let mut made = region.mirrored();
    let flat = surface.facets().map(|facet| facet.flipped());
    let mut mirrored = Surface::new(surface.axes, flat.collect())?;
    mirrored.image = Image::Of(surface.clone());
    made.surface = Some(Arc::new(mirrored));
    Some(on_surface(other, made))
}

impl Facet {
    /// Mirrored at the plane y = 0 of its frame.
    fn flipped(&self) -> Self {
        Self { corners: self.corners.map(flipped), normals: self.normals.map(flipped) }
    }

    /// Moved into the frame that a pose leads to.
    fn moved(&self, pose: &Pose) -> Self {
        Self {
            corners: self.corners.map(|corner| pose.apply(corner)),
            normals: self.normals.map(|normal| pose.rotation * normal),
        }
    }
}
