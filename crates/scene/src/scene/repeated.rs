//! Notes that differ in the number of an entry alone, as one.

use sightline_files::Note;

/// Most further places that a note names.
const MOST_NAMED: usize = 8;

/// Notes in their order; of those that say one thing of several entries of a list, the first names the others.
pub(super) fn folded(notes: Vec<Note>) -> Vec<Note> {
    let mut kept: Vec<(Note, Vec<String>)> = Vec::new();
    for note in notes {
        let alike = kept.iter_mut().find(|(first, _)| is_alike(first, &note));
        match (alike, parts(note.text())) {
            (Some((_, others)), Some([_, path, _])) => others.push(path.to_owned()),
            _ => kept.push((note, Vec::new())),
        }
    }
    kept.into_iter().map(|(note, others)| with_others(note, others)).collect()
}

/// File, place and words of a note; `None` without a place that has a number.
fn parts(text: &str) -> Option<[&str; 3]> {
    let (file, rest) = text.split_once(": ")?;
    let (path, words) = rest.split_once(": ")?;
    (path.contains('[') && !path.contains(' ')).then_some([file, path, words])
}

/// A place without its numbers.
fn without_numbers(path: &str) -> String {
    path.split('[').map(|part| part.trim_start_matches(|c: char| c.is_ascii_digit())).collect()
}

fn is_alike(first: &Note, other: &Note) -> bool {
    let (Some(a), Some(b)) = (parts(first.text()), parts(other.text())) else { return false };
    let same_words = first.is_doubt() == other.is_doubt() && [a[0], a[2]] == [b[0], b[2]];
    same_words && a[1] != b[1] && without_numbers(a[1]) == without_numbers(b[1])
}

fn with_others(note: Note, mut others: Vec<String>) -> Note {
    let Some([file, path, words]) = parts(note.text()).filter(|_| !others.is_empty()) else {
        return note;
    };
    let more = others.len().saturating_sub(MOST_NAMED);
    others.truncate(MOST_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let text = format!("{file}: {path} (likewise {}{more}): {words}", others.join(", "));
    if note.is_doubt() { Note::doubt(text) } else { Note::fact(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_that_differ_in_a_number_alone_are_one() {
        let fact = |text: &str| Note::fact(text);
        let notes = vec![
            fact("v.json: bodies[0]: moves from frame to frame"),
            fact("v.json: bodies[1]: moves from frame to frame"),
            fact("v.json: mounts[0]: moves from frame to frame"),
            Note::doubt("v.json: bodies[3]: moves from frame to frame"),
            fact("v.json: bodies[2]: stands still"),
            fact("v.json: bodies[12]: moves from frame to frame"),
            fact("w.json: bodies[2]: moves from frame to frame"),
            fact("v.json: has no body: give it one"),
            fact("v.json: has no body: give it one"),
        ];
        let told = folded(notes).iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(
            told,
            [
                "v.json: bodies[0] (likewise bodies[1], bodies[12]): moves from frame to frame",
                "v.json: mounts[0]: moves from frame to frame",
                "v.json: bodies[3]: moves from frame to frame",
                "v.json: bodies[2]: stands still",
                "w.json: bodies[2]: moves from frame to frame",
                "v.json: has no body: give it one",
                "v.json: has no body: give it one",
            ]
        );
        let many =
            (0..12).map(|k| Note::doubt(format!("v.json: actors[{k}]: too large"))).collect();
        let told = folded(many);
        assert!(told.len() == 1 && told[0].is_doubt(), "{told:?}");
        assert!(told[0].text().ends_with("actors[8] and 3 more): too large"), "{told:?}");
    }
}
