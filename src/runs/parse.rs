//! Values of options from text, each with the sentence that refuses another one.

use std::fmt::Display;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::datasets::CarlaTags;
use crate::job::MOST_ABOUT;
use crate::search::Method;
use crate::study::{Kind, Subregion};
use crate::vehicle::{FARTHEST_ON_VEHICLE, SensorPose, Spacing};

/// A whole number, as of a seed.
pub(crate) fn whole<T: FromStr>(text: &str) -> Result<T, String> {
    let most = u128::MAX >> (128 - 8 * size_of::<T>());
    text.parse().map_err(|_| format!("give a whole number from 0 to {most}"))
}

/// A count of something without which nothing is done.
pub(crate) fn at_least_one(text: &str) -> Result<u64, String> {
    text.parse()
        .ok()
        .filter(|n| *n > 0)
        .ok_or(format!("give a whole number from 1 to {}", u64::MAX))
}

/// A number below, at or above 0; `example` is one that fits the option.
pub(crate) fn number_as(example: &'static str) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let found = text.parse().ok().filter(|value: &f64| value.is_finite());
        found.ok_or_else(|| format!("give a number, as {example}"))
    }
}

/// Largest price that is taken for one: dearer ones are slips.
const MOST_PRICE: f64 = 1e12;

/// A price of at most 1e12.
pub(crate) fn price(text: &str) -> Result<f64, String> {
    let found = number_as("12000")(text)?;
    if found <= MOST_PRICE { Ok(found) } else { Err("give a price up to 1e12, as 12000".into()) }
}

/// Metres above 0.
pub(crate) fn metres(text: &str) -> Result<f64, String> {
    number_that(|metres| metres > 0.0 && metres.is_finite(), "metres above 0, as 0.1")(text)
}

/// A number that `is_good`; `wanted` names them.
pub(crate) fn number_that(
    is_good: fn(f64) -> bool,
    wanted: impl Display + Clone,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let found = text.trim().parse().ok().filter(|number| is_good(*number));
        found.ok_or_else(|| format!("give {wanted}"))
    }
}

/// Position of `base_link` in the ego frame, metres.
pub(crate) fn base_link(text: &str) -> Result<[f64; 3], String> {
    let fault = || "give X or X,Y,Z in metres, as in -1.4,0,0".to_owned();
    let numbers =
        text.split(',').map(|word| word.trim().parse().ok().filter(|v: &f64| v.is_finite()));
    let numbers = numbers.collect::<Option<Vec<f64>>>().ok_or_else(fault)?;
    if let Some(far) = numbers.iter().find(|v| v.abs() > FARTHEST_ON_VEHICLE) {
        let metres = far / 1000.0;
        return Err(format!("{far} m is far from any vehicle; {far} mm are {metres} m"));
    }
    match numbers[..] {
        [x] => Ok([x, 0.0, 0.0]),
        [x, y, z] => Ok([x, y, z]),
        _ => Err(fault()),
    }
}

/// Kinds of study by name, with the question that each answers.
pub(crate) fn kinds() -> impl TypedValueParser<Value = Kind> {
    let values = Kind::ALL.map(|(_, name, answers)| PossibleValue::new(name).help(answers));
    PossibleValuesParser::new(values).try_map(|name| Kind::from_str(&name))
}

/// A region: its name and two corners, metres.
pub(crate) fn parse_box(text: &str) -> Result<Subregion, String> {
    let wrong = || {
        format!("`{text}` is no box; write NAME:x0,y0,z0,x1,y1,z1 in metres, lower corner first")
    };
    let (name, numbers) = text.split_once(':').ok_or_else(wrong)?;
    let numbers: Vec<f64> = numbers
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| wrong()))
        .collect::<Result<_, _>>()?;
    let [x0, y0, z0, x1, y1, z1] = numbers[..] else { return Err(wrong()) };
    if name.is_empty() || !(x0 < x1 && y0 < y1 && z0 < z1) {
        return Err(wrong());
    }
    Ok(Subregion::of_box(name, [x0, y0, z0], [x1, y1, z1]))
}

/// Point of the ground about which a body tilts, metres of the ego frame.
pub(crate) fn tilt_about(text: &str) -> Result<[f64; 2], String> {
    let metres = |text: &str| text.trim().parse::<f64>().ok().filter(|m| m.abs() <= MOST_ABOUT);
    let found = text.split_once(',').and_then(|(x, y)| Some([metres(x)?, metres(y)?]));
    found.ok_or(format!("give x,y in metres within ±{MOST_ABOUT}, as 1.5,0"))
}

/// Longest time that a search may be given, in seconds.
const MOST_SECONDS: f64 = 1e9;

/// A time limit in seconds.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=MOST_SECONDS).contains(&seconds) => Ok(seconds),
        _ => Err(format!("give 0 to {MOST_SECONDS} seconds, as 30")),
    }
}

/// A method of searching.
pub(crate) fn method(text: &str) -> Result<Method, String> {
    match text {
        "both" => Ok(Method::Both),
        "cma" => Ok(Method::Cma),
        "swaps" => Ok(Method::Swaps),
        _ => Err("write both, cma or swaps".into()),
    }
}

/// A pose field and its value.
pub(crate) fn fixed(text: &str) -> Result<(String, f64), String> {
    let parts = text.split_once('=').map(|(field, value)| (field.trim(), value.trim().parse()));
    match parts {
        Some((field, Ok(value))) if SensorPose::FIELDS.contains(&field) => {
            Ok((field.to_owned(), value))
        }
        _ => Err(format!("write one of {} and a number, as z=2.5", SensorPose::FIELDS.join(", "))),
    }
}

/// A spacing: metres, and radians where they differ, as `0.1` or `0.2,0.1`.
pub(crate) fn spacing(text: &str) -> Result<Spacing, String> {
    let (metres, radians) = text.split_once(',').unwrap_or((text, text));
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is no spacing; write metres and radians, as 0.1 or 0.2,0.1")),
    };
    Ok(Spacing { metres: number(metres)?, radians: number(radians)? })
}

/// Two sides of an equals sign.
fn sides(text: &str) -> Option<(&str, &str)> {
    text.rsplit_once('=').filter(|(name, value)| !name.is_empty() && !value.is_empty())
}

/// A name, and metres of at most 10 above or below its foot.
pub(crate) fn optical_height(text: &str) -> Result<(String, f64), String> {
    let parsed = sides(text).and_then(|(name, value)| Some((name.to_owned(), value.parse().ok()?)));
    let small = parsed.filter(|(_, height): &(String, f64)| height.abs() <= 10.0);
    small.ok_or_else(|| "give NAME=METRES, as in VLP-16=0.0377".to_owned())
}

/// A frame and the model of its sensor.
pub(crate) fn sensor_in_frame(text: &str) -> Result<(String, String), String> {
    let parsed = sides(text).map(|(frame, name)| (frame.to_owned(), name.to_owned()));
    parsed.ok_or_else(|| "give FRAME=MODEL, as in lidar_0=VLP-16".to_owned())
}

/// Versions of CARLA by the first one of each, with the tags that their points have.
pub(crate) fn carla_tags() -> impl TypedValueParser<Value = CarlaTags> {
    let values = [("0.9.10", "0 to 22"), ("0.9.14", "0 to 28")];
    let values = values.map(|(name, tags)| PossibleValue::new(name).help(tags));
    PossibleValuesParser::new(values).map(|name| match &*name {
        "0.9.10" => CarlaTags::Until0913,
        _ => CarlaTags::Since0914,
    })
}
