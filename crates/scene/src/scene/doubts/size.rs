//! Doubts about the size of a body, and the scale of its mesh.

use glam::DVec3;

use super::super::description::{BodyDescription, ShapeDescription};
use super::{Scene, Solid, extent, height_at_origin};

/// Longest and shortest body of a vehicle, in metres.
const BODY: [f64; 2] = [0.3, 30.0];
/// Metres between which most vehicles are long.
const USUAL: [f64; 2] = [1.5, 25.0];
/// Scales of meshes: metres, millimetres, centimetres, inches, feet.
const SCALES: [f64; 5] = [1.0, 0.001, 0.01, 0.0254, 0.3048];

/// Scales that the meshes of bodies are given: of the first body, and of each beside it.
#[derive(Debug, Default)]
pub(in crate::scene) struct BodyScales {
    pub first: Option<f64>,
    pub others: Vec<Option<f64>>,
}

impl BodyScales {
    pub(in crate::scene) fn of(first: &[ShapeDescription], others: &[BodyDescription]) -> Self {
        let others = others.iter().map(|body| scale_of(&body.parts)).collect();
        Self { first: scale_of(first), others }
    }
}

/// The scale that all shapes are given, which are meshes; else `None`.
fn scale_of(shapes: &[ShapeDescription]) -> Option<f64> {
    let scale = |shape: &ShapeDescription| shape.mesh.as_ref()?.scale;
    let first = scale(shapes.first()?)?;
    shapes.iter().all(|shape| scale(shape) == Some(first)).then_some(first)
}

/// A doubt about a body that is far larger than a vehicle.
pub(in crate::scene) fn too_large(who: &str, solid: &Solid, scale: Option<f64>) -> Option<String> {
    let longest = extent(solid)?.max_element();
    if longest <= BODY[1] {
        return None;
    }
    Some(scale.map_or_else(
        || {
            format!(
                "the {who} is {longest:.1} m large; lengths are in metres, {longest:.0} mm would be {:.2} m: divide the \
                 numbers of its shapes by 1000, or give its mesh `\"scale\": 0.001`, or 0.01 for centimetres",
                longest / 1000.0
            )
        },
        |scale| format!("the {who} is {longest:.1} m large {}", of_scale(longest, scale, "smaller")),
    ))
}

/// A doubt about a body that is far smaller than a vehicle.
pub(super) fn too_small(who: &str, solid: &Solid, scale: Option<f64>) -> Option<String> {
    let longest = extent(solid)?.max_element();
    if longest >= BODY[0] {
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
}
