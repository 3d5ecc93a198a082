//! Names that become files and folders.

use std::collections::HashSet;

/// Most bytes of a name, so that endings fit into the 255 of file systems.
const LONGEST: usize = 200;
/// Names that Windows keeps for devices, with any ending.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// A name that no file system takes for a path: letters, digits, `-`, `_` and, inside, `.`.
pub fn safe_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    let mut name = name.trim_matches('.').to_owned();
    while name.len() > LONGEST {
        name.pop();
    }
    let stem = name.split('.').next().unwrap_or_default().to_lowercase();
    let is_port = |port: &str| stem.strip_prefix(port).is_some_and(|n| n.len() == 1);
    if name.is_empty() || DEVICES.contains(&&*stem) || is_port("com") || is_port("lpt") {
        name.insert(0, '_');
    }
    name
}

/// A safe name for each name. Later ones get a number where they are equal, also but for their case.
pub fn safe_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut taken = HashSet::new();
    let free = |name: &str| {
        let name = safe_name(name);
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        let mut all = std::iter::once(name.clone()).chain(numbered);
        all.find(|name| taken.insert(name.to_lowercase())).unwrap_or(name)
    };
    names.into_iter().map(free).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_never_leave_their_folder() {
        for (name, safe) in [
            ("highway", "highway"),
            ("a-b_c.d", "a-b_c.d"),
            ("Straße", "Straße"),
            ("../../x", "_.._x"),
            ("/any/where", "_any_where"),
            ("..", "_"),
            (".", "_"),
            ("", "_"),
            (".hidden", "hidden"),
            ("x.", "x"),
            ("nul", "_nul"),
            ("Com1.txt", "_Com1.txt"),
            ("com10", "com10"),
            ("C:\\x\n\0", "C__x__"),
        ] {
            assert_eq!(safe_name(name), safe, "{name:?}");
        }
        assert!(safe_name(&"é".repeat(500)).len() <= LONGEST);
        assert_eq!(safe_names(["a", "A", "a-2", "..", "."]), ["a", "A-2", "a-2-2", "_", "_-2"]);
    }
}
