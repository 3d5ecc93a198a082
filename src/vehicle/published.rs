//! The placements that were published: the baselines that everything is compared with.

use serde::Deserialize;

use super::Placement;

/// `scenes/placements.json`, as it is committed.
const TABLE_7: &str = include_str!("../../scenes/placements.json");

/// The layouts of Table 7 of the paper (Place3D, NeurIPS 2024), in the order of the table.
///
/// # Panics
/// Never: the file is part of the program, and a test reads it.
pub fn published_placements() -> Vec<Placement> {
    #[derive(Deserialize)]
    struct File {
        placements: Vec<Placement>,
    }
    let file: File = serde_json::from_str(TABLE_7).expect("scenes/placements.json is committed whole");
    file.placements
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_placements_can_be_read() {
        let published = published_placements();
        let names: Vec<&str> = published.iter().map(|p| p.name.as_str()).collect();
        assert!(names.starts_with(&["Center", "Line"]) && names.contains(&"Ours-det"), "{names:?}");
        for placement in &published {
            placement.validate().unwrap();
        }
    }
}
