//! Entropies against closed forms.

use super::{names, small_psog, small_roi};
use crate::psog::{
    BuildReport, ENTROPY_ONE, EntropyKind, EntropyTable, Psog, PsogInfo, fixed, to_nats,
};

const LN2: f64 = std::f64::consts::LN_2;

/// T = 4, three classes, class 0 the target. By hand, in multiples of ln 2: −¼ ln ¼ = ½ ln 2,
/// −½ ln ½ = ½ ln 2, −¾ ln ¾ = ¾ (2 ln 2 − ln 3).
#[test]
fn entropies_by_hand() {
    let three = 0.75 * (2.0 * LN2 - 3f64.ln());
    let (half, quarter) = (0.5 * LN2, 0.5 * LN2);
    #[rustfmt::skip]
    let cases = [
        // counts     segmentation         detection         Bernoulli
        ([0, 0, 0], 0.0,                   0.0,              0.0),
        ([4, 0, 0], 0.0,                   0.0,              0.0),
        ([2, 0, 0], 2.0 * half,            2.0 * half,       2.0 * half),
        ([0, 2, 2], 2.0 * half,            0.0,              0.0),
        ([1, 1, 1], 4.0 * quarter,         2.0 * quarter + half, quarter + three),
        ([0, 1, 0], quarter + three,       quarter + three,  quarter + three),
        ([1, 3, 0], quarter + three,       quarter + three,  0.0),
        ([1, 1, 2], 2.0 * quarter + half,  quarter + three,  0.0),
    ];
    let table = EntropyTable::new(4);
    let kinds =
        [EntropyKind::Segmentation, EntropyKind::Detection { target: 0 }, EntropyKind::Bernoulli];
    for (row, seg, det, ber) in cases {
        for (kind, wanted) in kinds.into_iter().zip([seg, det, ber]) {
            let got = table.entropy(&row, kind);
            assert!((got - wanted).abs() < 1e-15, "{row:?} {kind:?}: {got}, wanted {wanted}");
        }
    }
}

#[test]
fn terms_beyond_the_table() {
    let table = EntropyTable::new(200_000);
    assert!((table.term(100_000) - 0.5 * LN2).abs() < 1e-15);
    assert!((table.term(50_000) - 0.5 * LN2).abs() < 1e-15);
    assert_eq!(table.term(200_000), 0.0);
    assert!((table.entropy(&[50_000, 50_000], EntropyKind::Bernoulli) - LN2).abs() < 1e-15);
}

#[test]
fn fixed_point_holds_the_largest_entropy() {
    assert_eq!(ENTROPY_ONE, 268_435_456.0);
    assert_eq!(fixed(LN2), 186_065_279); // 0.693147180559945 · 2²⁸ = 186 065 279.4
    assert_eq!(fixed(1.0), 1 << 28);
    assert!(65_537f64.ln() * ENTROPY_ONE < f64::from(u32::MAX));
    assert_eq!(to_nats(3 << 28), 3.0);
}

/// Rows [4, 0], [1, 2] and [0, 3] of T = 4: 0, then ¼, ½, empty ¼, then ¾, empty ¼.
#[test]
fn totals_and_info() {
    let psog = small_psog();
    let three = 0.75 * (2.0 * LN2 - 3f64.ln());
    let seg = 1.5 * LN2 + 0.5 * LN2 + three;
    assert!((psog.entropy_total(EntropyKind::Segmentation) - seg).abs() < 1e-8);
    let sum: u64 = psog.entropies(EntropyKind::Segmentation).into_iter().map(u64::from).sum();
    assert_eq!(to_nats(sum), psog.entropy_total(EntropyKind::Segmentation));

    let report = BuildReport { voxels_voted: 10, ties: 1, ..Default::default() };
    let info = PsogInfo::new(&psog, Some(&report));
    assert_eq!((info.occupied, info.informative, info.voxels), (3, 2, 128));
    assert_eq!(info.tie_share, Some(0.1));
    assert_eq!((info.min, info.max), ([-1.0, -2.0, -0.5], [1.0, 2.0, 1.5]));
    assert_eq!(info.memory_bytes, 3 * 8 + 6 * 2);
    assert_eq!(info.entropy_detection, None);
    let parts = [info.classes[0].entropy, info.classes[1].entropy, info.entropy_empty];
    for (got, wanted) in parts.into_iter().zip([0.5 * LN2, 0.5 * LN2 + three, LN2]) {
        assert!((got - wanted).abs() < 1e-15);
    }
    assert_eq!([info.classes[0].voxels, info.classes[1].voxels], [2, 2]);
    assert!((info.entropy_bernoulli - 2.0 * (0.5 * LN2 + three)).abs() < 1e-8);
    assert_eq!(PsogInfo::new(&psog, None).tie_share, None);
}

#[test]
fn detection_is_about_cars_else_vehicles() {
    let psog =
        |classes: &[&str]| Psog::new(small_roi(), 1, names(classes), vec![], vec![]).unwrap();
    assert_eq!(psog(&["vehicle", "car"]).detection_target(), Some(1));
    assert_eq!(psog(&["road", "vehicle"]).detection_target(), Some(1));
    assert_eq!(psog(&["road"]).detection_target(), None);
}

/// Rows without entropy are listed but not informative: all empty, and one class always.
#[test]
fn informative_voxels_differ_between_frames() {
    let counts = vec![0, 0, 2, 0, 1, 1, 0, 1];
    let psog = Psog::new(small_roi(), 2, names(&["a", "b"]), vec![0, 1, 2, 3], counts).unwrap();
    let info = PsogInfo::new(&psog, None);
    assert_eq!((info.occupied, info.informative), (3, 2));
}
