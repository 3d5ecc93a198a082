//! Tables as CSV (RFC 4180): commas, a line a row, quotes where a cell needs them, numbers in full precision.

/// Rows of cells as CSV.
pub fn csv<R, C>(rows: impl IntoIterator<Item = R>) -> String
where
    R: IntoIterator<Item = C>,
    C: AsRef<str>,
{
    let mut text = String::new();
    for row in rows {
        for (k, cell) in row.into_iter().enumerate() {
            if k > 0 {
                text.push(',');
            }
            push(&mut text, cell.as_ref());
        }
        text.push('\n');
    }
    text
}

/// Adds a cell. An apostrophe goes before text that a spreadsheet would take for a formula, but not before a number.
fn push(text: &mut String, cell: &str) {
    let is_formula = cell.starts_with(['=', '+', '-', '@', '\t', '\r']);
    let guard = if is_formula && cell.parse::<f64>().is_err() { "'" } else { "" };
    if cell.contains(['"', ',', '\n', '\r']) {
        *text += &format!("\"{guard}{}\"", cell.replace('"', "\"\""));
    } else {
        *text += guard;
        *text += cell;
    }
}

/// A number in full precision, no minus before a zero; empty where there is none.
pub fn number(value: impl Into<Option<f64>>) -> String {
    value.into().map_or_else(String::new, |value| (value + 0.0).to_string())
}

/// A number with at most so many decimals, no zeros at their end and no minus before a zero.
pub fn rounded(value: f64, decimals: i32) -> String {
    let factor = 10_f64.powi(decimals);
    let scaled = (value * factor).round() / factor;
    // Numbers so large have no decimals.
    let scaled = if scaled.is_finite() { scaled } else { value };
    (scaled + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        let rows = [["a", "b,c"], ["say \"so\"", "two\nlines"]];
        assert_eq!(csv(rows), "a,\"b,c\"\n\"say \"\"so\"\"\",\"two\nlines\"\n");
    }

    #[test]
    fn text_is_no_formula() {
        for (text, cell) in
            [("=1+1", "'=1+1"), ("-2.5", "-2.5"), ("@a,b", "\"'@a,b\""), ("\tx", "'\tx")]
        {
            assert_eq!(csv([[text]]), format!("{cell}\n"));
        }
    }

    #[test]
    fn numbers_keep_their_decimals_and_zero_has_no_sign() {
        assert_eq!(rounded(1.1 * 1000.0, 6), "1100");
        assert_eq!(rounded(0.1_f64.to_degrees(), 9), "5.729577951");
        assert_eq!(
            (number(-0.0), number(None), number(-1e-9)),
            ("0".into(), String::new(), "-0.000000001".into())
        );
        assert_eq!((rounded(-1e-12, 9), rounded(1e300, 9)), ("0".to_owned(), 1e300.to_string()));
    }
}
