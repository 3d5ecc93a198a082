//! From the description of one primitive to its triangles.

use glam::DVec3;

use super::description::{BoxDescription, CylinderDescription, PlaneDescription, PrismDescription};
use super::polygon;
use super::solid::Solid;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};

pub fn cuboid(at: &Place, b: &BoxDescription, class: u16) -> Result<Solid, DescriptionError> {
    let yaw = check::radians(&at.key("yaw"), b.yaw)?;
    let one_of = |found| {
        let of = &["center, size", "foot, size", "min, max"];
        Err(DescriptionError::Choice { at: Box::new(at.clone()), found, of })
    };
    let (center, size) = match (b.center, b.foot, b.size, b.min, b.max) {
        (Some(center), None, Some(size), None, None) => {
            let center = check::point(&at.key("center"), center)?;
            (center.into(), DVec3::from(check::size(&at.key("size"), size)?))
        }
        (None, Some(foot), Some(size), None, None) => {
            let foot = DVec3::from(check::point(&at.key("foot"), foot)?);
            let size = DVec3::from(check::size(&at.key("size"), size)?);
            (foot + DVec3::Z * (size.z / 2.0), size)
        }
        (None, None, None, Some(min), Some(max)) => {
            check::point(&at.key("min"), min)?;
            check::point(&at.key("max"), max)?;
            for i in 0..3 {
                if min[i] >= max[i] {
                    let wanted = format!("above min ({})", min[i]);
                    return Err(bad(&at.key("max").item(i), max[i], wanted));
                }
            }
            let (min, max) = (DVec3::from(min), DVec3::from(max));
            ((min + max) / 2.0, max - min)
        }
        _ => {
            let mut found = Vec::new();
            found.extend(b.center.map(|_| "center"));
            found.extend(b.foot.map(|_| "foot"));
            found.extend(b.size.map(|_| "size"));
            found.extend(b.min.map(|_| "min"));
            found.extend(b.max.map(|_| "max"));
            return one_of(found);
        }
    };
    Ok(Solid::cuboid(center, size, yaw, class))
}

pub fn prism(at: &Place, p: &PrismDescription, class: u16) -> Result<Solid, DescriptionError> {
    let base = polygon::simple(&at.key("base"), &p.base)?;
    let z = at.key("z");
    for i in 0..2 {
        check::metres(&z.item(i), p.z[i])?;
    }
    if p.z[0] >= p.z[1] {
        return Err(bad(&z, format!("{:?}", p.z), "a range [bottom, top] with bottom < top"));
    }
    Ok(Solid::prism(&base, p.z, class))
}

pub fn cylinder(
    at: &Place,
    c: &CylinderDescription,
    class: u16,
) -> Result<Solid, DescriptionError> {
    let foot = check::point(&at.key("foot"), c.foot)?;
    let radius = check::length(&at.key("radius"), c.radius)?;
    let height = check::length(&at.key("height"), c.height)?;
    let sides = check::count(&at.key("sides"), c.sides.unwrap_or(12), 3, 256)?;
    Ok(Solid::cylinder(foot.into(), radius, height, sides, class))
}

pub fn plane(at: &Place, p: &PlaneDescription, class: u16) -> Result<Solid, DescriptionError> {
    for i in 0..2 {
        check::metres(&at.key("min").item(i), p.min[i])?;
        check::metres(&at.key("max").item(i), p.max[i])?;
        if p.min[i] >= p.max[i] {
            return Err(bad(&at.key("max").item(i), p.max[i], format!("above min ({})", p.min[i])));
        }
    }
    let z = check::metres(&at.key("z"), p.z)?;
    Ok(Solid::plane(p.min, p.max, z, class))
}
