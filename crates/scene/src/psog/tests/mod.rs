//! Tests of the P-SOG and its files: counts by voxel and class, and entropies against closed forms.

mod npz;
mod roi;
mod vote;

use super::*;

const LN2: f64 = std::f64::consts::LN_2;

/// A grid of 4 × 16 × 2 voxels of 0.5 × 0.25 × 1 m from (−1, −2, −0.5).
fn small_roi() -> Roi {
    Roi::new([-1.0, -2.0, -0.5], [0.5, 0.25, 1.0], [4, 16, 2]).unwrap()
}

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|&n| n.to_owned()).collect()
}

/// Three voxels, two classes, T = 4; the P-SOG in `tests/data/numpy_*.npz`.
fn small_psog() -> Psog {
    let counts = vec![4, 0, 1, 2, 0, 3];
    Psog::new(small_roi(), 4, names(&["road", "véhicule"]), vec![3, 5, 127], counts).unwrap()
}

#[test]
fn accessors() {
    let psog = small_psog();
    assert_eq!(psog.row(1), [1, 2]);
    assert_eq!(psog.rows().len(), 3);
    assert_eq!(psog.class_id("véhicule"), Some(1));
    assert_eq!(psog.class_id("empty"), None);
}

#[test]
fn broken_rules_are_named() {
    let new = |frames, classes: &[&str], index: &[u64], counts: &[u16]| {
        Psog::new(small_roi(), frames, names(classes), index.to_vec(), counts.to_vec())
    };
    let ab = &["a", "b"][..];
    let cases = [
        (new(0, ab, &[], &[]), "frames is 0;"),
        (new(1, &[], &[], &[]), "classes is empty;"),
        (new(1, &["a", ""], &[], &[]), "classes[1] is \"\";"),
        (new(1, &["a\nb"], &[], &[]), "classes[0] is \"a\\nb\";"),
        (new(1, &["empty"], &[], &[]), "classes[0] is \"empty\";"),
        (new(1, &["a", "b", "a"], &[], &[]), "classes[2] repeats the name \"a\" of classes[0];"),
        (new(1, ab, &[1], &[1]), "counts has 1 values; 1 voxels × 2 classes need 2"),
        (
            new(1, ab, &[128], &[1, 0]),
            "index[0] is 128, but the grid has 128 voxels, so the last index is 127",
        ),
        (new(1, ab, &[5, 5], &[1, 0, 1, 0]), "index[1] is 5, not above index[0] = 5;"),
        (new(1, ab, &[5, 4], &[1, 0, 1, 0]), "index[1] is 4, not above index[0] = 5;"),
        (
            new(3, ab, &[5, 6], &[1, 2, 2, 2]),
            "counts[1] (voxel 6) adds up to 4 frames, but frames is 3;",
        ),
    ];
    for (got, wanted) in cases {
        let message = got.unwrap_err().to_string();
        assert!(message.starts_with(wanted), "{message}\n  wanted {wanted}");
    }
    assert!(new(3, ab, &[], &[]).is_ok(), "an empty world is a P-SOG");
}

#[test]
fn merging_adds_counts_and_frames() {
    let left = small_psog();
    let right =
        Psog::new(left.roi().to_owned(), 2, left.classes().to_vec(), vec![0, 5], vec![1, 1, 2, 0])
            .unwrap();
    for merged in [left.merge(&right).unwrap(), right.merge(&left).unwrap()] {
        assert_eq!(merged.frames(), 6);
        assert_eq!(merged.index(), [0, 3, 5, 127]);
        assert_eq!(merged.counts(), [1, 1, 4, 0, 3, 2, 0, 3]);
    }
}

#[test]
fn unlike_psogs_do_not_merge() {
    let a = names(&["a"]);
    let psog = |roi: Roi, frames, classes: &[&str], count| {
        Psog::new(roi, frames, names(classes), vec![1], vec![count]).unwrap()
    };
    let base = Psog::new(small_roi(), 60_000, a, vec![1], vec![60_000]).unwrap();
    let moved = Roi::new([-1.0, -2.0, 0.5], [0.5, 0.25, 1.0], [4, 16, 2]).unwrap();
    let longer = Roi::new([-1.0, -2.0, -0.5], [0.5, 0.25, 1.0], [4, 16, 3]).unwrap();
    let cases = [
        (
            psog(moved, 1, &["a"], 1),
            "the P-SOGs have different roi_min ([-1.0, -2.0, -0.5] and [-1.0, -2.0, 0.5])",
        ),
        (psog(longer, 1, &["a"], 1), "the P-SOGs have different shape"),
        (psog(small_roi(), 1, &["b"], 1), "the P-SOGs differ at classes[0] (\"a\" and \"b\")"),
        (
            psog(small_roi(), 6000, &["a"], 5536),
            "voxel 1 would have class \"a\" in 65536 frames, at most 65535 fit",
        ),
        (psog(small_roi(), u32::MAX, &["a"], 1), "the merged P-SOG would have 4295027295 frames"),
    ];
    for (other, wanted) in cases {
        let message = base.merge(&other).unwrap_err().to_string();
        assert!(message.starts_with(wanted), "{message}\n  wanted {wanted}");
    }
    let two = Psog::new(small_roi(), 1, names(&["a", "b"]), vec![], vec![]).unwrap();
    let message = base.merge(&two).unwrap_err().to_string();
    assert!(message.starts_with("the P-SOGs differ at classes[1] (\"\" and \"b\")"), "{message}");
    assert!(base.merge(&psog(small_roi(), 6000, &["a"], 5535)).is_ok());
}

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
