//! Tables for a terminal: columns of equal width, lines of at most 100 characters.

use super::text::{shortened, visible};

/// Longest line of a table in characters.
pub(crate) const WIDEST: usize = 100;
/// Longest cell of a table in characters: two names of placements and the words between them.
pub(super) const LONGEST_CELL: usize = 140;
/// Characters that the first column may have in a table that is too wide.
const FIRST: usize = 32;
/// Blanks between two columns.
const GAP: usize = 2;

/// A column of a table: the lines of each cell, the title first.
struct Column {
    cells: Vec<Vec<String>>,
    width: usize,
}

impl Column {
    fn new(cells: Vec<Vec<String>>) -> Self {
        let width = longest(&cells);
        Self { cells, width }
    }

    /// Breaks the title between words, down to the width of the cells below it.
    fn fold_title(&mut self) {
        let Some((title, below)) = self.cells.split_first_mut() else { return };
        let text = title.join(" ");
        let word = text.split_whitespace().map(length).max().unwrap_or(0);
        *title = folded(&text, word.max(longest(below)));
        self.width = longest(&self.cells);
    }

    /// Breaks every cell that is wider than `width`.
    fn fold(&mut self, width: usize) {
        for (row, lines) in self.cells.iter_mut().enumerate() {
            *lines = lines.iter().flat_map(|line| folded(line, width)).collect();
            let widest = lines.iter().map(|line| length(line)).max().unwrap_or(0);
            // Lines of a cell begin below each other, those of a title end there.
            if row > 0 {
                lines.iter_mut().for_each(|line| *line = format!("{line:<widest$}"));
            }
        }
        self.width = longest(&self.cells);
    }
}

fn length(text: &str) -> usize {
    text.chars().count()
}

fn longest(cells: &[Vec<String>]) -> usize {
    cells.iter().flatten().map(|line| length(line)).max().unwrap_or(0)
}

fn behind(columns: &[Column]) -> usize {
    columns.iter().map(|column| GAP + column.width).sum()
}

/// A text in lines of at most `width` characters: broken between words, and longer words without their middle.
pub(crate) fn folded(text: &str, width: usize) -> Vec<String> {
    if length(text) <= width {
        return vec![text.to_owned()];
    }
    in_lines(text.split_whitespace().map(|word| without_middle(word, width)), width, "")
}

/// Words in lines of at most `width` characters; lines after the first begin with `indent`.
pub(super) fn in_lines(
    words: impl Iterator<Item = String>,
    width: usize,
    indent: &str,
) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words {
        match lines.last_mut() {
            Some(line) if length(line) + 1 + length(&word) <= width => {
                *line += &format!(" {word}");
            }
            Some(_) => lines.push(format!("{indent}{word}")),
            None => lines.push(word),
        }
    }
    lines
}

/// A word of at most `most` characters: its start, an ellipsis and its end, which tells names apart.
fn without_middle(word: &str, most: usize) -> String {
    let (count, most) = (length(word), most.max(1));
    if count <= most {
        return word.to_owned();
    }
    let end = word.chars().skip(count - (most - 1) / 2);
    word.chars().take(most / 2).chain(['…']).chain(end).collect()
}

/// Brings columns closer to [`WIDEST`]: titles take several lines, then long cells do.
fn narrow(columns: &mut [Column]) {
    let Some((first, rest)) = columns.split_first_mut() else { return };
    if first.width + behind(rest) > WIDEST {
        rest.iter_mut().for_each(Column::fold_title);
    }
    if first.width + behind(rest) > WIDEST {
        first.fold(WIDEST.saturating_sub(behind(rest)).max(FIRST));
        let room = WIDEST.saturating_sub(first.width + GAP);
        rest.iter_mut().for_each(|column| column.fold(room));
    }
}

/// Columns in groups of at most `widest` characters, each with the first column.
fn groups(columns: &[Column], widest: usize) -> Vec<Vec<&Column>> {
    let Some((first, rest)) = columns.split_first() else { return Vec::new() };
    let (mut groups, mut group, mut used) = (Vec::new(), vec![first], first.width);
    for column in rest {
        if group.len() > 1 && used + GAP + column.width > widest {
            groups.push(std::mem::replace(&mut group, vec![first]));
            used = first.width;
        }
        group.push(column);
        used += GAP + column.width;
    }
    groups.push(group);
    groups
}

/// Lines of a row: the first column to the left, others to the right.
fn lines(group: &[&Column], row: usize) -> Vec<String> {
    let height = group.iter().map(|column| column.cells[row].len()).max().unwrap_or(0);
    let line = |at: usize| {
        let cells = group.iter().enumerate().map(|(k, column)| {
            let lines = &column.cells[row];
            // Titles end on the last line, other cells begin on the first.
            let above = if row == 0 { height - lines.len() } else { 0 };
            let cell = at.checked_sub(above).and_then(|at| lines.get(at));
            let cell = cell.map_or("", String::as_str);
            let space = " ".repeat(column.width - length(cell));
            if k == 0 { format!("{cell}{space}") } else { format!("{space}{cell}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    (0..height).map(line).collect()
}

/// Lines of equal columns, the first column to the left and numbers to the right; the first row has the titles. A table
/// wider than [`WIDEST`] has titles and long cells on several lines, then becomes several tables with the first column
/// in each.
pub(crate) fn align_columns(rows: &[Vec<String>]) -> String {
    align_with_notes(rows, &[])
}

/// Like [`align_columns`], of titles and the rows below them.
pub(crate) fn table_text(titles: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let titles = titles.iter().map(|title| (*title).to_owned()).collect();
    align_columns(&std::iter::once(titles).chain(rows).collect::<Vec<_>>())
}

/// Like [`align_columns`], with lines below rows: `notes` has the lines of each row behind the titles.
pub(crate) fn align_with_notes(rows: &[Vec<String>], notes: &[Vec<String>]) -> String {
    let count = rows.iter().map(Vec::len).max().unwrap_or(0);
    let cell = |row: &Vec<String>, column: usize| {
        let cell = row.get(column).map_or("", String::as_str);
        vec![shortened(&visible(cell), LONGEST_CELL)]
    };
    let column = |k: usize| Column::new(rows.iter().map(|row| cell(row, k)).collect());
    let mut columns: Vec<Column> = (0..count).map(column).collect();
    narrow(&mut columns);
    // Tables as wide as each other, in place of full ones and a rest.
    let tables = groups(&columns, WIDEST).len();
    let even = (0..WIDEST).find(|&widest| groups(&columns, widest).len() == tables);
    let groups = groups(&columns, even.unwrap_or(WIDEST));
    let text = |(k, group): (usize, &Vec<&Column>)| {
        let mut all: Vec<String> = Vec::new();
        for row in 0..rows.len() {
            all.extend(lines(group, row));
            let below = row.checked_sub(1).filter(|_| k == 0).and_then(|row| notes.get(row));
            all.extend(below.into_iter().flatten().cloned());
        }
        all.iter().map(|line| format!("{line}\n")).collect::<String>()
    };
    groups.iter().enumerate().map(text).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(all: &[&[&str]]) -> Vec<Vec<String>> {
        all.iter().map(|row| row.iter().map(|cell| (*cell).to_owned()).collect()).collect()
    }

    #[test]
    fn a_table_holds_cells_of_any_length_and_shows_every_character() {
        let long = "x".repeat(70_000);
        let text = align_columns(&rows(&[
            &["a", long.as_str()],
            &[long.as_str(), "b\u{202e}c\u{2028}\u{1b}"],
        ]));
        assert!(text.lines().all(|line| length(line) <= WIDEST), "{text}");
        let last = text.lines().last().unwrap();
        assert!(last.starts_with("xxx") && last.contains("xx…xx"), "{text}");
        assert!(last.ends_with("  b\\u{202e}c\\u{2028}\\u{1b}"), "{text}");
        assert_eq!(align_columns(&[]), "");
    }

    #[test]
    fn titles_of_a_wide_table_take_several_lines() {
        let titles: Vec<&str> = ["rig"].into_iter().chain(["a long title 0"; 8]).collect();
        let cells: Vec<&str> = ["mine"].into_iter().chain(["12345"; 8]).collect();
        let text = align_columns(&rows(&[&titles[..], &cells[..]]));
        let line =
            |first: &str, cell: &str| format!("{first:4}{}\n", format!("{cell:>7}").repeat(8));
        let want = [line("", "a"), line("", "long"), line("", "title"), line("rig", "0")];
        assert_eq!(text, want.concat() + &line("mine", "12345"));
    }

    #[test]
    fn a_table_that_stays_too_wide_becomes_several_and_the_first_has_the_notes() {
        let name = format!("start{}end", "-".repeat(60));
        let titles = ["rig", "a", "b", "c", "d"];
        let number = "123456789012345678";
        let row = [name.as_str(), number, number, number, number];
        let text =
            align_with_notes(&rows(&[&titles[..], &row[..]]), &[vec!["  ! a note".to_owned()]]);
        assert!(text.lines().all(|line| length(line) <= WIDEST), "{text}");
        let tables: Vec<&str> = text.split("\n\n").collect();
        // Three numbers would fit beside the name: two and two are more even than three and one.
        assert_eq!(tables.len(), 2, "{text}");
        for table in &tables {
            assert_eq!(table.matches(number).count(), 2, "{text}");
            assert!(table.contains("\nstart-") && table.contains("-end  "), "{text}");
        }
        assert!(tables[0].ends_with("\n  ! a note") && !tables[1].contains("note"), "{text}");
    }

    #[test]
    fn words_are_broken_between_and_names_keep_their_ends() {
        let words = "fog:mor=50 and rain:rate=25";
        assert_eq!(folded(words, 14), ["fog:mor=50 and", "rain:rate=25"]);
        assert_eq!(folded("placement-one", 9), ["plac…-one"]);
        assert_eq!(folded(words, 27), [words]);
    }
}
