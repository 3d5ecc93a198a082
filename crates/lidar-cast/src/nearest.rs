//! The name that was probably meant.

/// Names longer than this have no similar name: comparing takes time with both lengths.
const LONGEST_NAME: usize = 256;
/// Smallest Jaro–Winkler similarity of a slip and the name that was meant.
const LEAST_SIMILARITY: f64 = 0.7;

/// Most similar name of `known`, if `name` may be a slip for it.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    let lower = name.to_lowercase();
    known
        .into_iter()
        .filter(|known| known.len() <= LONGEST_NAME)
        .map(|k| (strsim::jaro_winkler(&lower, &k.to_lowercase()), k))
        .filter(|(likeness, _)| *likeness > LEAST_SIMILARITY)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k.to_owned())
}
