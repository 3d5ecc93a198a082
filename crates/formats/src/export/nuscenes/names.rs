//! Names of scenes that the devkit's splits know, as numbers from–to.

use crate::export::Split;

/// Scenes of v1.0-mini.
const MINI: [&[u16]; 2] = [&[61, 553, 655, 757, 796, 1077, 1094, 1100], &[103, 916]];

type Ranges = &'static [(u16, u16)];

const TRAIN: Ranges = &[
    (1, 2),
    (4, 11),
    (19, 34),
    (41, 76),
    (120, 135),
    (138, 139),
    (149, 152),
    (154, 155),
    (157, 168),
    (170, 185),
    (187, 188),
    (190, 196),
    (199, 200),
    (202, 204),
    (206, 214),
    (218, 220),
    (222, 222),
    (224, 264),
    (283, 306),
    (315, 318),
    (321, 321),
    (323, 324),
    (328, 328),
    (347, 386),
    (388, 403),
    (405, 408),
    (410, 459),
    (461, 465),
    (467, 469),
    (471, 472),
    (474, 480),
    (499, 502),
    (504, 515),
    (517, 518),
    (525, 539),
    (541, 546),
    (566, 566),
    (568, 568),
    (570, 578),
    (580, 580),
    (582, 600),
    (639, 679),
    (681, 681),
    (683, 689),
    (695, 698),
    (700, 701),
    (703, 719),
    (726, 728),
    (730, 731),
    (733, 741),
    (744, 744),
    (746, 747),
    (749, 752),
    (757, 765),
    (767, 769),
    (786, 787),
    (789, 792),
    (803, 806),
    (808, 813),
    (815, 817),
    (819, 822),
    (847, 856),
    (858, 858),
    (860, 866),
    (868, 873),
    (875, 878),
    (880, 880),
    (882, 903),
    (945, 945),
    (947, 947),
    (949, 949),
    (952, 953),
    (955, 961),
    (975, 984),
    (988, 992),
    (994, 1025),
    (1044, 1058),
    (1074, 1102),
    (1104, 1110),
];
const VAL: Ranges = &[
    (3, 3),
    (12, 18),
    (35, 36),
    (38, 39),
    (92, 110),
    (221, 221),
    (268, 278),
    (329, 332),
    (344, 346),
    (519, 524),
    (552, 565),
    (625, 627),
    (629, 630),
    (632, 638),
    (770, 771),
    (775, 775),
    (777, 778),
    (780, 784),
    (794, 800),
    (802, 802),
    (904, 917),
    (919, 931),
    (962, 963),
    (966, 969),
    (971, 972),
    (1059, 1073),
];
const TEST: Ranges = &[
    (77, 91),
    (111, 119),
    (140, 140),
    (142, 148),
    (265, 266),
    (279, 282),
    (307, 314),
    (333, 343),
    (481, 498),
    (547, 551),
    (601, 604),
    (606, 624),
    (827, 831),
    (833, 842),
    (844, 846),
    (932, 933),
    (935, 943),
    (1026, 1043),
];

/// Version of the set for scenes of a split; `counts` is the number of scenes by split.
pub(super) fn version(counts: [usize; 3], split: Split) -> &'static str {
    match split {
        Split::Test => "v1.0-test",
        _ if is_mini(counts) => "v1.0-mini",
        _ => "v1.0-trainval",
    }
}

/// True if train and val fit into v1.0-mini.
fn is_mini([train, val, _]: [usize; 3]) -> bool {
    train <= MINI[0].len() && val <= MINI[1].len()
}

/// Names of scenes for each split; `counts` is the number of scenes by split.
pub(in crate::export) fn scene_names(counts: [usize; 3]) -> [Vec<String>; 3] {
    let name = |number: u16| format!("scene-{number:04}");
    let all = |ranges: Ranges| ranges.iter().flat_map(|&(a, b)| a..=b).map(name).collect();
    let [mut train, mut val, test]: [Vec<String>; 3] = [all(TRAIN), all(VAL), all(TEST)];
    if is_mini(counts) {
        [train, val] = MINI.map(|list| list.iter().copied().map(name).collect());
    }
    [train, val, test]
}
