//! Text as people read it: sentences and numbers of any length, hidden characters, lines of a terminal.

use crate::report::text::visible;

/// Longest sentence in characters, above a path of the longest that systems take.
const LONGEST: usize = 5_000;
/// Digits of a number that are printed whole; `f64` has 17 that count.
const DIGITS: usize = 40;

/// Breaks sentences of more than some columns between words; the lines that follow are indented by two more. Rows of a
/// table, which have wide gaps, stay whole.
pub(super) fn wrapped(text: &str, columns: usize) -> String {
    let lines = text.split('\n').map(|line| {
        let words = line.trim_start();
        if line.chars().count() <= columns || words.contains("  ") {
            return line.to_owned();
        }
        let indent = line.len() - words.len();
        let (mut lines, mut used) = (line[..indent].to_owned(), indent);
        for (index, word) in words.split(' ').enumerate() {
            let length = word.chars().count();
            if index > 0 && used + 1 + length > columns {
                lines += &format!("\n{}", " ".repeat(indent + 2));
                used = indent + 2;
            } else if index > 0 {
                lines.push(' ');
                used += 1;
            }
            lines += word;
            used += length;
        }
        lines
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Lines as a terminal may show them; see [`visible`].
pub(super) fn for_terminal(text: &str) -> String {
    let line = |line: &str| line.split('\t').map(visible).collect::<Vec<_>>().join("\t");
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// A text whose longer runs of digits are cut: 1e300 prints 301 of them.
pub(super) fn with_short_numbers(text: &str) -> String {
    let (mut short, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let digits = &rest[start..];
        let length = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        let shown = if length > DIGITS { 12 } else { length };
        short += &rest[..start + shown];
        if length > DIGITS {
            short += &format!("… ({length} digits)");
        }
        rest = &digits[length..];
    }
    short + rest
}

/// A sentence without its middle where it is long: names in files may have any length.
pub(super) fn with_short_middle(text: &str) -> String {
    let count = text.chars().count();
    if count <= LONGEST {
        return text.to_owned();
    }
    let (head, tail) = (2 * LONGEST / 3, LONGEST / 4);
    let start: String = text.chars().take(head).collect();
    let end: String = text.chars().skip(count - tail).collect();
    format!("{start}… ({} characters) …{end}", count - head - tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_sentences_go_on_in_indented_lines_and_rows_of_tables_stay_whole() {
        let text = "one two three\n  four five six\nname     gain %   M-SOG\n";
        let want = "one two\n  three\n  four\n    five\n    six\nname     gain %   M-SOG\n";
        assert_eq!(wrapped(text, 8), want);
        assert_eq!(wrapped(text, 25), text);
        assert_eq!(wrapped("a_word_that_is_too_long b", 8), "a_word_that_is_too_long\n  b");
    }

    #[test]
    fn a_long_name_is_cut_out_of_a_sentence() {
        let told = with_short_middle(&format!(
            "a.json: `{}` is no name; give another",
            "é".repeat(90_000)
        ));
        assert!(told.starts_with("a.json: `éé") && told.ends_with("é` is no name; give another"));
        assert!(told.chars().count() < LONGEST && told.contains("é… (8"), "{}", told.len());
        assert_eq!(with_short_middle("short"), "short");
    }

    #[test]
    fn numbers_of_hundreds_of_digits_are_cut() {
        let told = with_short_numbers(&format!("x = {}; give less than 100.25", 1e300));
        assert_eq!(told, "x = 100000000000… (301 digits); give less than 100.25");
        assert_eq!(with_short_numbers("é 12"), "é 12");
    }
}
