//! Numbers as people write them: nine digits, no −0, no dust of rounding errors.

use serde_json::{Number, Value};

/// Decimals of metres and radians: nanometres, and nanoradians.
const DECIMALS: usize = 9;
/// Smallest metres or radians that are written: half of the last decimal.
const SMALLEST: f64 = 5e-10;
/// Significant digits of a difference between rigs.
const DIGITS: usize = 9;

/// Rounds metres or radians to nine decimals; −0 and rounding noise become 0.
pub fn written(value: f64) -> f64 {
    if value.abs() < SMALLEST {
        return 0.0;
    }
    format!("{value:.DECIMALS$}").parse().unwrap_or(value)
}

/// A number to nine significant digits; no −0.
fn nine_digits(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    format!("{value:.0$e}", DIGITS - 1).parse().unwrap_or(value)
}

/// A number of things, in words that agree: `1 frame`, `2 frames`, `2 boxes`.
pub fn counted(count: usize, thing: &str) -> String {
    let ending = match count {
        1 => "",
        _ if thing.ends_with('x') => "es",
        _ => "s",
    };
    format!("{count} {thing}{ending}")
}

/// Names in backquotes, with commas between them.
pub fn quoted<T: std::fmt::Display>(names: impl IntoIterator<Item = T>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Each of some things once, in the order in which they come.
pub fn distinct<T: PartialEq>(all: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut once: Vec<T> = Vec::new();
    for one in all {
        if !once.contains(&one) {
            once.push(one);
        }
    }
    once
}

/// A number with `decimals` decimals, without the sign of a −0.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
}

/// A number without the zeros at the end of its decimals.
pub fn trimmed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if text.contains('.') {
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    text
}

/// A number of five significant digits in a sentence: 0.42855, not 4.2855e-1; with an exponent where zeros would hide it.
pub fn spoken(value: f64) -> String {
    let text = format!("{value:.4e}");
    let plain = (1e-4..1e9).contains(&value.abs()) || value == 0.0;
    let short = text.parse().ok().filter(|_| plain);
    short.map_or(text, |value: f64| (value + 0.0).to_string())
}

/// A document with numbers of nine digits; whole numbers stay.
pub fn shortened(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            let short = number.as_f64().map(nine_digits).and_then(Number::from_f64);
            Value::Number(short.unwrap_or(number))
        }
        Value::Array(list) => list.into_iter().map(shortened).collect(),
        Value::Object(map) => map.into_iter().map(|(key, value)| (key, shortened(value))).collect(),
        other => other,
    }
}

/// Start of the tags that YAML itself defines; `!!` is short for it.
const CORE: &str = "tag:yaml.org,2002:";
/// Radians in one degree, computed as xacro does.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Unit tags, the quantity of each, and its size in metres or radians.
const UNITS: [(&str, Quantity, f64); 6] = [
    ("!radians", Quantity::Angle, 1.0),
    ("!degrees", Quantity::Angle, DEGREE),
    ("!meters", Quantity::Length, 1.0),
    ("!millimeters", Quantity::Length, 0.001),
    ("!foot", Quantity::Length, 0.3048),
    ("!inches", Quantity::Length, 0.0254),
];

/// Quantity that a key holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Radians.
    Angle,
    /// Metres.
    Length,
    /// A number without a unit.
    Bare,
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Angle => "an angle",
            Self::Length => "a length",
            Self::Bare => "a number without a unit",
        }
    }
}

/// Value of a scalar under a key of `quantity`, which is `None` if the key's quantity is unknown.
///
/// # Errors
/// A tag that is not known, or that does not fit the text or the key; in words.
pub(super) fn value(
    text: &str,
    is_plain: bool,
    tag: Option<&str>,
    quantity: Option<Quantity>,
) -> Result<Value, String> {
    let Some(tag) = tag else {
        return Ok(if is_plain { plain(text) } else { Value::from(text) });
    };
    if let Some((_, unit, factor)) = UNITS.into_iter().find(|(name, ..)| *name == tag) {
        let value = number(text.trim()).and_then(|number| number.as_f64());
        let value = value.ok_or_else(|| {
            format!(
                "{} stands behind `{tag}`, where a number belongs; only xacro computes expressions",
                shown(text)
            )
        })?;
        return match quantity {
            Some(wanted) if wanted != unit => Err(format!(
                "`{tag}` is the unit of {}, and {} belongs here",
                unit.name(),
                wanted.name()
            )),
            _ => Ok(Number::from_f64(value * factor).map_or(Value::Null, Value::Number)),
        };
    }
    let core = tag.strip_prefix(CORE).unwrap_or(if tag == "!" { "str" } else { "" });
    let read = plain(text);
    match core {
        "str" => Ok(Value::from(text)),
        "int" if read.is_i64() || read.is_u64() => Ok(read),
        "float" if read.is_number() => Ok(read),
        "bool" if read.is_boolean() => Ok(read),
        "null" if read.is_null() => Ok(read),
        "int" | "float" | "bool" | "null" => {
            Err(format!("{} is not what its tag `!!{core}` says", shown(text)))
        }
        _ => Err(unknown_tag(tag)),
    }
}

/// Checks the tag of a list (`seq`) or an object (`map`).
pub(super) fn check_collection(tag: &str, kind: &str) -> Result<(), String> {
    match tag.strip_prefix(CORE) {
        Some(name) if name == kind => Ok(()),
        _ if tag == "!" => Ok(()),
        _ if UNITS.iter().any(|(unit, ..)| *unit == tag) => {
            Err(format!("`{tag}` stands before a list or an object; write it before each number"))
        }
        _ => Err(unknown_tag(tag)),
    }
}

fn unknown_tag(tag: &str) -> String {
    let tag = tag.strip_prefix(CORE).map_or_else(|| tag.to_owned(), |name| format!("!!{name}"));
    let units = quoted(UNITS.map(|(name, ..)| name));
    format!("the tag {} is not known; units are {units}", shown(&tag))
}

/// A text in quotes, shortened.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    let more = if short.len() < text.len() { "…" } else { "" };
    format!("`{}{more}`", short.escape_debug())
}

/// Value of a plain scalar. Texts that YAML 1.1 and 1.2 read as different numbers stay texts: `010`, `0o7`,
/// `1_000`, `1:30`.
fn plain(text: &str) -> Value {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => Value::Null,
        "true" | "True" | "TRUE" => Value::Bool(true),
        "false" | "False" | "FALSE" => Value::Bool(false),
        _ => number(text).map_or_else(|| Value::from(text), Value::Number),
    }
}

fn number(text: &str) -> Option<Number> {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    if let Some(hex) = digits.strip_prefix("0x") {
        let is_hex = !hex.is_empty() && hex.bytes().all(|b| b.is_ascii_hexdigit());
        return u64::from_str_radix(hex, 16)
            .ok()
            .filter(|_| is_hex && digits == text)
            .map(Number::from);
    }
    if !digits.bytes().all(|b| b.is_ascii_digit() || b".eE+-".contains(&b)) {
        return None;
    }
    if digits.bytes().all(|b| b.is_ascii_digit()) {
        if digits.len() > 1 && digits.starts_with('0') {
            return None;
        }
        // `-0` keeps its sign as a fraction alone.
        if let (Ok(whole), false) = (text.parse::<i64>(), text == "-0") {
            return Some(whole.into());
        }
        if let Ok(whole) = text.parse::<u64>() {
            return Some(whole.into());
        }
    }
    text.parse().ok().and_then(Number::from_f64)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn counts_and_things_agree() {
        let told = [counted(1, "frame"), counted(0, "frame"), counted(1, "box"), counted(2, "box")];
        assert_eq!(told, ["1 frame", "0 frames", "1 box", "2 boxes"]);
    }

    #[test]
    fn numbers_have_nine_decimals_and_no_dust() {
        for (value, text) in [
            (-0.0, "0"),
            (6.9e-18, "0"),
            (-4.9e-10, "0"),
            (0.1 + 0.2, "0.3"),
            (-1.000_000_000_04, "-1"),
            (std::f64::consts::FRAC_PI_2, "1.570796327"),
            (123_456.789_012_3, "123456.7890123"),
            (1e-9, "0.000000001"),
        ] {
            assert_eq!(written(value).to_string(), text);
        }
        assert_eq!(written(-0.0).to_bits(), 0);
    }

    #[test]
    fn texts_have_no_negative_zero() {
        for (value, decimals, text) in [
            (-0.0004, 3, "0.000"),
            (-0.0, 0, "0"),
            (-0.3, 0, "0"),
            (-0.0006, 3, "-0.001"),
            (1.25, 1, "1.2"),
        ] {
            assert_eq!(fixed(value, decimals), text);
        }
    }

    #[test]
    fn sentences_have_five_digits_and_few_exponents() {
        for (value, text) in [
            (0.428_549_3, "0.42855"),
            (-0.0, "0"),
            (-6.632_39e-7, "-6.6324e-7"),
            (20.5, "20.5"),
            (53_234.6, "53235"),
        ] {
            assert_eq!(spoken(value), text);
        }
    }

    #[test]
    fn documents_have_nine_digits() {
        let value = json!({"a": [1.0 / 3.0, -0.0, 2.0, 7, -6.632_394_361_889_102e-7], "b": null});
        let text = r#"{"a":[0.333333333,0.0,2.0,7,-6.63239436e-7],"b":null}"#;
        assert_eq!(shortened(value).to_string(), text);
    }

    #[test]
    fn plain_numbers_are_those_of_every_yaml() {
        let same = [("1", json!(1)), ("-2.5", json!(-2.5)), ("+3", json!(3)), (".5", json!(0.5))];
        let more =
            [("1.", json!(1.0)), ("0x10", json!(16)), ("1e3", json!(1e3)), ("~", json!(null))];
        for (text, wanted) in same.into_iter().chain(more) {
            assert_eq!(plain(text), wanted, "{text}");
        }
        for text in
            ["010", "0o7", "1_000", "1:30", ".inf", "nan", "inf", "0x", "1e999", "-", "e5", "yes"]
        {
            assert_eq!(plain(text), json!(text));
        }
    }

    #[test]
    fn units_are_metres_and_radians_of_a_fitting_quantity() {
        let read = |tag, text, quantity| value(text, true, Some(tag), quantity);
        assert_eq!(read("!degrees", "40", Some(Quantity::Angle)), Ok(json!(40.0 * DEGREE)));
        assert_eq!(read("!millimeters", "900", Some(Quantity::Length)), Ok(json!(0.9)));
        assert_eq!(read("!foot", "10", None), Ok(json!(3.048)));
        let fails = |tag, text, quantity| read(tag, text, quantity).unwrap_err();
        assert!(fails("!degrees", "40", Some(Quantity::Length)).contains("a length belongs"));
        assert!(fails("!inches", "1", Some(Quantity::Bare)).contains("without a unit"));
        assert!(fails("!degrees", "2*45", None).contains("`2*45`"));
        assert!(fails("!grad", "1", None).contains("`!grad` is not known"));
        assert!(fails("tag:yaml.org,2002:binary", "AA==", None).contains("`!!binary`"));
        assert!(fails("tag:yaml.org,2002:int", "up", None).contains("`!!int`"));
    }
}
