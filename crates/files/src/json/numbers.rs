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

/// A number with `decimals` decimals, without the sign of a −0.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

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
}
