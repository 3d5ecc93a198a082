//! Joints of URDF: at given values, or at rest, the value nearest to 0 that `<limit>` and `<mimic>` allow.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use lidar_cast::geom::Pose;
use lidar_cast::sensor::nearest;
use sightline_files::json::has_no_prefix;

/// A joint of a URDF, as far as its rest depends on it.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfJoint {
    /// Its name; empty without one.
    pub name: String,
    turns: bool,
    /// True along an axis.
    slides: bool,
    /// Unit vector in the joint's frame.
    axis: DVec3,
    /// Lowest and highest value, in radians or metres.
    limits: [f64; 2],
    mimic: Option<Mimic>,
}

#[derive(Debug, Clone, PartialEq)]
struct Mimic {
    joint: String,
    multiplier: f64,
    offset: f64,
}

impl UrdfJoint {
    /// Reads a joint of a `kind` of URDF; `get` gives an attribute of a child element, by tag and key.
    ///
    /// # Errors
    /// An axis, limit or mimic that is no number, in words for a message that names the joint.
    pub fn read<'a>(
        name: &str,
        kind: &str,
        get: impl Fn(&str, &str) -> Option<&'a str>,
    ) -> Result<Self, String> {
        let number = |tag: &str, key: &str, or: f64| match get(tag, key) {
            None => Ok(or),
            Some(text) => text.trim().parse().ok().filter(|v: &f64| !v.is_nan()).ok_or_else(|| {
                let text: String = text.chars().take(40).collect();
                format!("{key} of <{tag}>, {text:?}, is no number; correct it")
            }),
        };
        let (turns, slides) = (["continuous", "revolute"].contains(&kind), kind == "prismatic");
        let mut joint = Self {
            name: name.to_owned(),
            turns,
            slides,
            axis: DVec3::X,
            limits: [f64::NEG_INFINITY, f64::INFINITY],
            mimic: None,
        };
        if !turns && !slides {
            return Ok(joint);
        }
        if kind != "continuous" {
            let limits = [number("limit", "lower", 0.0)?, number("limit", "upper", 0.0)?];
            // Limits the wrong way round allow nothing, and say nothing.
            joint.limits = if limits[0] <= limits[1] { limits } else { joint.limits };
        }
        if let Some(of) = get("mimic", "joint") {
            let finite = |key: &str, or: f64| {
                number("mimic", key, or).and_then(|value| match value.is_finite() {
                    true => Ok(value),
                    false => Err(format!("{key} of <mimic> is not finite; correct it")),
                })
            };
            let (multiplier, offset) = (finite("multiplier", 1.0)?, finite("offset", 0.0)?);
            joint.mimic = Some(Mimic { joint: of.to_owned(), multiplier, offset });
        }
        if let Some(text) = get("axis", "xyz") {
            let read: Option<Vec<f64>> = text.split_whitespace().map(|v| v.parse().ok()).collect();
            let read = read.and_then(|read| <[f64; 3]>::try_from(read).ok()).map(DVec3::from);
            // A joint at 0 needs no axis: one of no length is told where it counts.
            joint.axis = read.and_then(DVec3::try_normalize).unwrap_or(DVec3::ZERO);
        }
        Ok(joint)
    }

    /// Refuses attributes that an axis, a limit or a mimic lacks in URDF: without the right one, the joint would stand elsewhere.
    /// `names` gives the attributes of a child element, by its tag.
    ///
    /// # Errors
    /// The element, the attribute and the right ones, in words for a message that names the joint.
    pub fn refuse_others<'a>(names: impl Fn(&str) -> Vec<&'a str>) -> Result<(), String> {
        const KNOWN: [(&str, &[&str]); 3] = [
            ("axis", &["xyz"]),
            ("mimic", &["joint", "multiplier", "offset"]),
            ("limit", &["lower", "upper"]),
        ];
        for (tag, known) in KNOWN {
            // A limit has further ones, of speed and force.
            let is_slip =
                |name: &str| tag != "limit" || known.iter().any(|k| k.eq_ignore_ascii_case(name));
            let is_odd =
                |name: &&str| !known.contains(name) && has_no_prefix(name) && is_slip(name);
            if let Some(odd) = names(tag).into_iter().find(is_odd) {
                let odd: String = odd.chars().take(40).collect();
                let known = known.join(", ");
                return Err(format!(
                    "<{tag}> has {odd:?}, which is not read; its attributes are {known}"
                ));
            }
        }
        Ok(())
    }

    /// Value of each joint that is given one by its name, in radians or metres.
    ///
    /// # Errors
    /// Words on a name that no joint has, or on a value that its joint cannot have.
    pub fn given(joints: &[Self], values: &[(String, f64)]) -> Result<Vec<Option<f64>>, String> {
        let mut given = vec![None; joints.len()];
        for (name, value) in values {
            let found = joints.iter().position(|joint| joint.name == *name);
            let Some(k) = found else {
                let near = nearest(name, joints.iter().map(|joint| joint.name.as_str()));
                let mend = near.map(|near| format!("did you mean `{near}`?"));
                let mend = mend.unwrap_or_else(|| "take it out of `joints`".to_owned());
                return Err(format!("no joint is called {name:?}; {mend}"));
            };
            let (joint, [low, high]) = (&joints[k], joints[k].limits);
            let words = joint.words(*value);
            if !(joint.turns || joint.slides) {
                return Err(format!("`{name}` does not move; take it out of `joints`"));
            }
            if let Some(Mimic { joint: of, .. }) = &joint.mimic {
                return Err(format!("`{name}` mimics `{of}`; give that one a value"));
            }
            if !(low..=high).contains(value) {
                let limits = format!("its limits are {low} and {}", joint.words(high));
                return Err(format!("`{name}` cannot stand at {words}; {limits}"));
            }
            if joint.turns && value.abs() > TAU {
                return Err(format!(
                    "`{name}` at {words} is more than a turn; angles are in radians"
                ));
            }
            given[k] = Some(*value);
        }
        Ok(given)
    }

    /// Values of joints, in radians or metres: the given one, or the mimicked joint's, scaled and shifted, or at rest, the value
    /// nearest to 0 within the limits.
    ///
    /// # Errors
    /// Number of a joint, and the fault in words: its name comes twice, it mimics no joint, or itself, or moves along no axis.
    pub fn values(joints: &[Self], given: &[Option<f64>]) -> Result<Vec<f64>, (usize, String)> {
        let mut by_name: HashMap<&str, usize> = HashMap::new();
        for (k, UrdfJoint { name, .. }) in joints.iter().enumerate() {
            if by_name.insert(name, k).is_some() && !name.is_empty() {
                return Err((k, "comes twice; give each joint a name of its own".to_owned()));
            }
        }
        let value = |start: usize| {
            let (mut at, mut factor, mut sum) = (start, 1.0, 0.0);
            for _ in 0..joints.len() {
                let joint = &joints[at];
                let Some(Mimic { joint: of, multiplier, offset }) = &joint.mimic else {
                    // Minus zero is told as 0.
                    let rest = 0.0_f64.max(joint.limits[0]).min(joint.limits[1]);
                    let stands = given.get(at).copied().flatten().unwrap_or(rest);
                    return Ok(sum + factor * stands + 0.0);
                };
                (sum, factor) = (sum + factor * offset, factor * multiplier);
                let Some(&next) = by_name.get(of.as_str()) else {
                    return Err(format!("mimics {of:?}, which is no joint; correct its name"));
                };
                at = next;
            }
            Err("mimics itself; take its <mimic> out".to_owned())
        };
        let checked = |k: usize| {
            let value = value(k)?;
            match value.is_finite() && (value == 0.0 || joints[k].axis != DVec3::ZERO) {
                true => Ok(value),
                false => Err(format!("stands at {value}, along an axis that is no direction")),
            }
        };
        (0..joints.len()).map(|k| checked(k).map_err(|words| (k, words))).collect()
    }

    /// Takes the child's frame to the joint's, where the joint stands at a value.
    pub fn pose(&self, value: f64) -> Pose {
        match (value == 0.0, self.turns) {
            (true, _) => Pose::IDENTITY,
            (_, true) => Pose {
                rotation: DMat3::from_axis_angle(self.axis, value),
                translation: DVec3::ZERO,
            },
            (_, false) => Pose { rotation: DMat3::IDENTITY, translation: self.axis * value },
        }
    }

    /// A value in words, with its unit: `0.7 rad`.
    pub fn words(&self, value: f64) -> String {
        format!("{value} {}", if self.turns { "rad" } else { "m" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(name: &str, kind: &str, values: &[(&str, &str, &'static str)]) -> UrdfJoint {
        let get = |tag: &str, key: &str| {
            values.iter().find(|(t, k, _)| (*t, *k) == (tag, key)).map(|(.., value)| *value)
        };
        UrdfJoint::read(name, kind, get).unwrap()
    }

    #[test]
    fn attributes_that_a_joint_lacks_are_refused() {
        let told = |tag: &str, all: &[&'static str]| {
            let names = |of: &str| if of == tag { all.to_vec() } else { Vec::new() };
            UrdfJoint::refuse_others(names).err().unwrap_or_default()
        };
        assert_eq!(told("axis", &["xyz", "drake.a"]), "");
        assert_eq!(told("limit", &["lower", "effort", "jerk"]), "");
        let axis = "<axis> has \"Xyz\", which is not read; its attributes are xyz";
        assert_eq!(told("axis", &["Xyz"]), axis);
        assert_holds!(told("limit", &["effort", "Lower"]), "<limit> has \"Lower\",");
        assert_holds!(told("mimic", &["joint", "multiply"]), "are joint, multiplier, offset");
    }

    #[test]
    fn joints_rest_where_limits_and_mimics_allow() {
        let limit = [("limit", "lower", ".5"), ("limit", "upper", "1"), ("axis", "xyz", "0 0 2")];
        let follows = |of: &'static str| {
            [("mimic", "joint", of), ("mimic", "multiplier", "-2"), ("mimic", "offset", "0.7")]
        };
        let joints = [
            joint("a", "prismatic", &limit),
            joint("b", "revolute", &follows("a")),
            joint("c", "revolute", &follows("b")),
            joint("d", "continuous", &limit),
            joint("e", "revolute", &[("limit", "lower", "-2"), ("limit", "upper", "-1")]),
        ];
        let rest = UrdfJoint::values(&joints, &[]).unwrap();
        assert!(rest.iter().zip([0.5, -0.3, 1.3, 0.0, -1.0]).all(|(a, b)| (a - b).abs() < 1e-12));
        assert_eq!(joints[0].pose(rest[0]).translation, DVec3::new(0.0, 0.0, 0.5));
        // About x, as no axis is given: y goes to cos .3 and −sin .3.
        let turned = joints[1].pose(rest[1]).rotation * DVec3::Y;
        assert!((turned - DVec3::new(0.0, 0.3_f64.cos(), -(0.3_f64.sin()))).length() < 1e-12);
        let fault = |joints: &[UrdfJoint]| UrdfJoint::values(joints, &[]).unwrap_err().1;
        assert!(fault(&[joint("a", "revolute", &follows("a"))]).starts_with("mimics itself"));
        assert_begins!(fault(&[joint("a", "fixed", &[]), joint("a", "fixed", &[])]), "comes twice");
        assert!(fault(&[joint("a", "revolute", &follows("z"))]).contains("which is no joint"));
        let bad = [limit[0], limit[1], ("axis", "xyz", "0 0 0")];
        assert!(fault(&[joint("a", "prismatic", &bad)]).contains("no direction"));
    }
}
