//! Mounts on meshes that mirrored pairs stand on: made exact images of each other, or of themselves.

use std::sync::Arc;

use glam::DVec3;

use super::Region;
use super::equipment::VehicleMount;
use super::mesh_mount::{assembled, cut};
use super::mirror::flipped;
use super::surface::{Facet, Image, Surface};
use lidar_cast::geom::Pose;

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
            let outer = own.foot(own.axes().map(|k| corner[k])).point;
            let point = back.apply(flipped(from.apply(outer)));
            let foot = surface.foot(surface.axes().map(|k| point[k]));
            foot.off <= OFF && (foot.point[along] - point[along]).abs() <= OFF
        })
    };
    on(a, b) && on(b, a)
}

/// A region with the surface and the extent of another one, and its own ranges beside these.
fn on_surface(own: &Region, of: Region) -> Region {
    let mut region = Region { lower: own.lower, upper: own.upper, name: own.name.clone(), ..of };
    let axes = region.surface.as_ref().map_or([0, 1], |surface| surface.axes());
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
    let mut mirrored = Surface::new(surface.axes(), flat.collect())?;
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
