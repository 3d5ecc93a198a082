//! Tables of the commands in a terminal: none is wider than 100 columns.

use crate::cli::*;
use crate::cli_study_rigs::street;

/// Longest line of a table in characters.
const WIDEST: usize = 100;
/// A name without a place to break it.
const LONG: &str = "roof-and-sides-with-a-name-that-somebody-chose-to-be-long";

/// Commands on the room and the hall, without rigs of their own.
const OF_ROOMS: [&str; 10] = [
    "optimize room.json hall.json --evaluations 4 --out run",
    "study lidars room.json --evaluations 4",
    "study channels room.json --evaluations 4",
    "study random room.json --evaluations 4 --random 4",
    "study tasks room.json --evaluations 4",
    "study height room.json --evaluations 4",
    "study transfer room.json hall.json --evaluations 4",
    "study loss room.json --evaluations 4",
    "study published room.json",
    "audit room.json",
];

/// Commands on the street and two rigs, one of them with a long name.
const OF_RIGS: [&str; 16] = [
    "score street.json wide.json --near-field --tolerance 0",
    "score street.json other.json wide.json --tolerance 0",
    "optimize street.json --front price,near_gain --evaluations 4 --out front",
    "audit street.json other.json wide.json",
    "study nearfield street.json wide.json",
    "study targets street.json wide.json",
    "study targets street.json wide.json --distances 5,10,20",
    "study redundancy street.json wide.json --target car",
    "study overlap street.json wide.json",
    "study sweep street.json wide.json:sides --of 0.z --from 0.6 --to 1 --values 2",
    "study tolerance street.json wide.json --steps 2",
    "study cost street.json --budget 12 --evaluations 4",
    "study voxels street.json wide.json",
    "study regions street.json wide.json",
    "study loss street.json wide.json",
    "study weather street.json wide.json",
];

/// Commands that take no `--frames`, or another engine.
const OTHERS: [&str; 5] = [
    "chart room.json --quick --placements 4 --backend cpu --out chart",
    "rig compare wide.json:sides wide.json:sides",
    "scene info street.json room.json",
    "devices",
    "verify room.json --frames 1 --random 2 --sample 100 --hostile 0",
];

#[test]
fn no_table_is_wider_than_a_hundred_columns() {
    let dir = street();
    let dir = dir.path();
    room(dir);
    change_as(dir, ["room.json", "hall.json"], |scene| scene["name"] = json!("hall"));
    change_as(dir, ["street.json", "other.json"], |scene| scene["name"] = json!("other"));
    let long = json!("left of the van, beside its sliding door");
    change(dir, "van.json", |van| van["require"][1]["name"] = long);
    change_as(dir, ["rigs.json", "wide.json"], |rigs| {
        let (roof, sides) =
            (rigs["placements"][0]["lidars"][0].clone(), rigs["placements"][1].clone());
        let mut all = sides["lidars"].list().clone();
        all.push(roof);
        rigs["placements"] = json!([sides, { "name": LONG, "lidars": all }]);
    });
    let fixed = "--frames 1 --backend cpu";
    let mut lines: Vec<String> = OF_ROOMS.map(|line| format!("{line} {fixed}")).to_vec();
    lines.extend(OF_RIGS.map(|line| format!("{line} {fixed}")));
    lines.extend(OTHERS.map(str::to_owned));
    let mut named = 0;
    for line in &lines {
        let (code, [text, told]) = ran(dir, line);
        assert!(matches!(code, Some(0 | 1)), "{line}: {told}");
        // Cells stand at least two blanks apart, words of a sentence one.
        let rows: Vec<&str> = text.lines().filter(|row| row.trim_start().contains("  ")).collect();
        assert!(rows.len() > 1, "{line}: no table\n{text}");
        let wide = rows.iter().find(|row| row.chars().count() > WIDEST);
        assert_eq!(wide, None, "{line}\n{text}");
        // The ends of a name that is cut tell it from others.
        let is_cut = |row: &&str| row.contains('…') && row.contains("be-long");
        named += usize::from(rows.iter().any(is_cut));
    }
    assert!(named >= 4, "{named} tables have the long name");
}
