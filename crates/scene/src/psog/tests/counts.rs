//! Counts a voxel and class.

use super::{names, small_psog, small_roi};
use crate::psog::{Psog, Roi};

#[test]
fn accessors() {
    let psog = small_psog();
    assert_eq!(psog.row(1), [1, 2]);
    assert_eq!(psog.rows().len(), 3);
    assert_eq!(psog.find(127), Some(2));
    assert_eq!(psog.find(4), None);
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
