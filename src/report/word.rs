//! A text as one word of a shell, for commands that are shown to be copied.

/// A text as one word of a shell: as it is, or between quotes where a shell would take it apart.
pub fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-/:=,+%".contains(c);
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(word("scenes/a-b_1.json"), "scenes/a-b_1.json");
        assert_eq!(word("0.5*m_sog + s_mig"), "'0.5*m_sog + s_mig'");
        assert_eq!(word("it's"), r"'it'\''s'");
        assert_eq!(word(""), "''");
        assert_eq!(word("7"), "7");
    }
}
