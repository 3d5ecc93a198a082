//! The layouts of Table 7 of Place3D (NeurIPS 2024), in the ego frame.

use serde::Deserialize;

use super::Placement;

const TABLE_7: &str = include_str!("../../../../scenes/placements.json");

/// The eleven hand-made layouts of four LiDARs of Table 7 of Place3D: the baselines where no others are
/// given.
pub fn table_7() -> Vec<Placement> {
    #[derive(Deserialize)]
    struct File {
        placements: Vec<Placement>,
    }
    let file: File = serde_json::from_str(TABLE_7).expect("a test reads the committed file");
    file.placements
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_committed_layouts_can_be_read() {
        let layouts = super::table_7();
        assert_eq!(layouts.len(), 11);
        assert!(layouts.iter().all(|layout| layout.lidars.len() == 4));
    }
}
