//! Doubts about the size of a body, and the scale of its mesh.

use glam::DVec3;

use super::super::description::{PoseDescription, ShapeDescription};
use super::{Scene, Solid, around, extent, height_at_origin};
use crate::vehicle::FARTHEST_ON_VEHICLE;
use sightline_files::json::Location;

/// Longest and shortest body of a vehicle, in metres.
const BODY: [f64; 2] = [0.3, 30.0];
/// Least metres of a body that stands still beside others.
const LAMP: f64 = 0.03;
/// Metres between which most vehicles are long.
const USUAL: [f64; 2] = [1.5, 25.0];
/// Metres between which a body is long that is taken for one in centimetres.
const CENTIMETRES: [f64; 2] = [2.0, 25.0];
/// Scales of meshes: metres, millimetres, centimetres, inches, feet.
const SCALES: [f64; 5] = [1.0, 0.001, 0.01, 0.0254, 0.3048];
/// Scale of the smallest unit that meshes of vehicles are drawn in: millimetres.
const LEAST_UNIT: f64 = 0.001;

/// Scales that the meshes of the first body are given.
#[derive(Debug, Default)]
pub(in crate::scene) struct BodyScales {
    /// `None` where other bodies stand in it, too.
    pub first: Option<f64>,
    /// Scale of each shape of the first body; `None` of one that is no mesh or has none.
    pub parts: Vec<Option<f64>>,
    /// True if a body was told to be of a wrong size by its own name, or to stand far from the vehicle.
    pub told: bool,
}

impl BodyScales {
    pub(in crate::scene) fn of(first: &[ShapeDescription]) -> Self {
        let parts = first.iter().map(scale_of_mesh).collect();
        Self { first: scale_of(first), parts, told: false }
    }
}

/// Doubts about the size of a body that stands still beside others, and of its shapes: it may be a lamp.
pub(in crate::scene) fn of_still_body(
    who: &str,
    solid: &Solid,
    shapes: &[ShapeDescription],
) -> Vec<String> {
    of_body_from(LAMP, who, solid, shapes)
}

/// Doubts about the size of a body that moves, and of its shapes.
pub(in crate::scene) fn of_moving_body(
    who: &str,
    solid: &Solid,
    shapes: &[ShapeDescription],
) -> Vec<String> {
    of_body_from(BODY[0], who, solid, shapes)
}

fn of_body_from(least: f64, who: &str, solid: &Solid, shapes: &[ShapeDescription]) -> Vec<String> {
    let (scale, scales) = (scale_of(shapes), shapes.iter().map(scale_of_mesh));
    let size = too_large(who, solid, scale).or_else(|| smaller_than(least, who, solid, scale));
    let mut all: Vec<String> = size.into_iter().collect();
    all.extend(tiny_parts(who, solid, &scales.collect::<Vec<_>>()));
    all
}

/// A doubt about the first pose of a body that stands far from its vehicle.
pub(in crate::scene) fn far(at: &Location, poses: &[PoseDescription]) -> Option<String> {
    let of_pose = |(k, pose): (usize, &PoseDescription)| {
        let each = [("x", pose.x), ("y", pose.y), ("z", pose.z)];
        let (key, metres) =
            each.into_iter().find(|(_, metres)| metres.abs() > FARTHEST_ON_VEHICLE)?;
        Some(format!(
            "{}: {metres} m is far from the vehicle; lengths are in metres, {metres} mm are {} m",
            at.key("poses").item(k).key(key),
            metres / 1000.0
        ))
    };
    poses.iter().enumerate().find_map(of_pose)
}

/// True if a body is far larger or smaller than a vehicle.
pub(super) fn is_odd(solid: &Solid) -> bool {
    let longest = extent(solid).map_or(1.0, DVec3::max_element);
    !(BODY[0]..=BODY[1]).contains(&longest)
}

fn scale_of_mesh(shape: &ShapeDescription) -> Option<f64> {
    shape.mesh.as_ref()?.scale
}

/// The scale that all shapes are given, which are meshes; else `None`.
fn scale_of(shapes: &[ShapeDescription]) -> Option<f64> {
    let first = scale_of_mesh(shapes.first()?)?;
    shapes.iter().all(|shape| scale_of_mesh(shape) == Some(first)).then_some(first)
}

/// A doubt about a body that is far larger than a vehicle.
pub(in crate::scene) fn too_large(who: &str, solid: &Solid, scale: Option<f64>) -> Option<String> {
    let longest = extent(solid)?.max_element();
    if longest <= BODY[1] {
        return None;
    }
    Some(scale.map_or_else(
        || {
            let [(unit, parts, scale), (_, _, other)] = units(longest);
            format!(
                "the {who} is {longest:.1} m large; lengths are in metres, {longest:.0} {unit} would be {:.2} m: divide the \
                 numbers of its shapes by {parts}, or give its mesh `\"scale\": {scale}`, or {other}",
                longest / parts
            )
        },
        |scale| format!("the {who} is {longest:.1} m large {}", of_scale(longest, scale, "smaller")),
    ))
}

/// Units of a length far too large for metres, the likelier first: a short name, how many make a metre, and the scale of a
/// mesh, with the unit for the second. Centimetres where they make a vehicle, and millimetres make a toy.
fn units(longest: f64) -> [(&'static str, f64, &'static str); 2] {
    let is_vehicle = (CENTIMETRES[0]..=CENTIMETRES[1]).contains(&(longest / 100.0));
    match is_vehicle && longest / 1000.0 < 1.0 {
        true => [("cm", 100.0, "0.01"), ("mm", 1000.0, "0.001 for millimetres")],
        false => [("mm", 1000.0, "0.001"), ("cm", 100.0, "0.01 for centimetres")],
    }
}

/// A doubt about a body that is far smaller than a vehicle.
pub(super) fn too_small(who: &str, solid: &Solid, scale: Option<f64>) -> Option<String> {
    smaller_than(BODY[0], who, solid, scale)
}

fn smaller_than(least: f64, who: &str, solid: &Solid, scale: Option<f64>) -> Option<String> {
    let longest = extent(solid)?.max_element();
    if longest >= least {
        return None;
    }
    Some(scale.map_or_else(
        || {
            format!(
                "the {who} is {longest:.4} m large; lengths are in metres: give its mesh a larger `scale`"
            )
        },
        |scale| format!("the {who} is {longest:.4} m large {}", of_scale(longest, scale, "larger")),
    ))
}

/// Doubts about shapes of a body that a scale below any unit's has made tiny beside the rest. A small part alone, as a
/// mirror, is none.
pub(super) fn tiny_parts(who: &str, solid: &Solid, scales: &[Option<f64>]) -> Vec<String> {
    // Named shapes have further ends of their own parts.
    let all = extent(solid).filter(|_| solid.ends.len() == scales.len());
    let Some(all) = all.map(DVec3::max_element) else { return Vec::new() };
    let starts = std::iter::once(0).chain(solid.ends.iter().copied());
    let shapes = starts.zip(&solid.ends).zip(scales).enumerate();
    let tiny = shapes.filter_map(|(k, ((start, end), scale))| {
        let scale = scale.filter(|scale| *scale < LEAST_UNIT)?;
        let corners = solid.faces.get(start..*end)?.iter().flatten();
        let [low, high] = around(corners.map(|v| solid.vertices[*v as usize]))?;
        let longest = (high - low).max_element();
        (longest < BODY[0] && 10.0 * longest < all).then(|| {
            format!(
                "part {k} of the {who} is {longest:.4} m large {}",
                of_scale(longest, scale, "larger")
            )
        })
    });
    tiny.collect()
}

/// Words on a scale, and on the one that would make a vehicle of a body of a length.
fn of_scale(longest: f64, scale: f64, other: &str) -> String {
    let length = |other: &f64| longest / scale * other;
    let fits = |other: &f64| (USUAL[0]..=USUAL[1]).contains(&length(other));
    let mend = SCALES.iter().find(|other| fits(other)).map_or_else(
        || format!("give its mesh a {other} one"),
        |other| format!("`\"scale\": {other}` would make it {:.2} m", length(other)),
    );
    format!("with the `scale` of {scale} that its mesh has; lengths are in metres: {mend}")
}

impl Scene {
    /// The doubt about an own body far larger than a vehicle, with its file.
    pub fn large_body(&self) -> Option<&str> {
        self.large_body.as_deref()
    }

    /// True if the own body, seen from above, lies at a place of the ego frame.
    pub fn body_covers(&self, [x, y]: [f64; 2]) -> bool {
        let place = DVec3::new(x, y, 0.0);
        let covers = |face: &[u32; 3]| {
            height_at_origin(face.map(|v| self.body.vertices[v as usize] - place)).is_some()
        };
        self.body.faces.iter().any(covers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_that_is_given_is_told_with_the_one_that_fits() {
        let long = |metres: f64| Solid {
            vertices: vec![DVec3::ZERO, DVec3::X * metres, DVec3::ONE],
            faces: vec![[0, 1, 2]],
            ..Solid::default()
        };
        let large = |metres, scale| too_large("ego body", &long(metres), scale);
        assert_eq!(
            large(60.0, Some(0.01)).unwrap(),
            "the ego body is 60.0 m large with the `scale` of 0.01 that its mesh has; lengths are in metres: \
             `\"scale\": 0.001` would make it 6.00 m"
        );
        assert_ends!(large(6000.0, None).unwrap(), "`\"scale\": 0.001`, or 0.01 for centimetres");
        assert_eq!(
            large(450.0, None).unwrap(),
            "the ego body is 450.0 m large; lengths are in metres, 450 cm would be 4.50 m: divide the numbers of its shapes by \
             100, or give its mesh `\"scale\": 0.01`, or 0.001 for millimetres"
        );
        // 1.9 m or 0.19 m, and 12 m or 1.2 m: millimetres, as before.
        for (metres, told) in
            [(190.0, "190 mm would be 0.19 m"), (1200.0, "1200 mm would be 1.20 m")]
        {
            assert_holds!(large(metres, None).unwrap(), told, "by 1000, or");
        }
        assert!(large(1e9, Some(1.0)).unwrap().ends_with("give its mesh a smaller one"));
        assert_eq!(large(30.0, Some(0.01)), None);
        let small =
            Solid { vertices: vec![DVec3::ZERO, DVec3::X * 0.006, DVec3::Y * 0.002], ..long(1.0) };
        let small = |scale| too_small("ego body", &small, scale).unwrap();
        assert_eq!(
            small(Some(0.001)),
            "the ego body is 0.0060 m large with the `scale` of 0.001 that its mesh has; lengths are in metres: \
             `\"scale\": 1` would make it 6.00 m"
        );
        assert!(small(None).ends_with("give its mesh a larger `scale`"));
    }

    #[test]
    fn a_part_far_smaller_than_any_unit_makes_it_is_doubted() {
        // A part of 0.2 m beside one of 6 m.
        let part = |metres: f64| [DVec3::ZERO, DVec3::X * metres, DVec3::Y * 0.1];
        let solid = Solid {
            vertices: [part(0.2), part(6.0)].concat(),
            faces: vec![[0, 1, 2], [3, 4, 5]],
            ends: vec![1, 2],
            ..Solid::default()
        };
        let told = |scales: [Option<f64>; 2]| tiny_parts("ego body", &solid, &scales).join("; ");
        assert_eq!(
            told([Some(0.0001), None]),
            "part 0 of the ego body is 0.2000 m large with the `scale` of 0.0001 that its mesh has; lengths are in metres: \
             `\"scale\": 0.001` would make it 2.00 m"
        );
        // A mirror in millimetres or metres, and a long part in micrometres.
        for scales in [[Some(0.001), None], [None, None], [Some(1.0), Some(1e-6)]] {
            assert_eq!(told(scales), "");
        }
    }
}
