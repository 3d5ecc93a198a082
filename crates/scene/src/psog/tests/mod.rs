//! Tests of the P-SOG and its files: counts by voxel and class, and entropies against closed forms.

mod npz;

use std::collections::BTreeMap;

use glam::DVec3;
use rand::{RngExt, seq::SliceRandom};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

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
        assert_begins!(got.unwrap_err(), wanted);
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
        assert_begins!(base.merge(&other).unwrap_err(), wanted);
    }
    let two = Psog::new(small_roi(), 1, names(&["a", "b"]), vec![], vec![]).unwrap();
    let at = "the P-SOGs differ at classes[1] (\"\" and \"b\")";
    assert_begins!(base.merge(&two).unwrap_err(), at);
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

#[test]
fn linear_index_is_c_order_and_turns_back() {
    let roi = small_roi();
    assert_eq!(roi.voxel_count(), 128);
    assert_eq!(roi.linear([2, 3, 1]), (2 * 16 + 3) * 2 + 1);
    for linear in 0..roi.voxel_count() {
        assert_eq!(roi.linear(roi.coords(linear)), linear);
    }
    assert_eq!(roi.coords(127), [3, 15, 1]);
    assert_eq!(roi.max(), [1.0, 2.0, 1.5]);
}

#[test]
fn boxes_are_half_open() {
    let roi = small_roi();
    let at = |x, y, z| roi.voxel_of(DVec3::new(x, y, z)).map(|v| roi.coords(v));
    assert_eq!(at(-1.0, -2.0, -0.5), Some([0, 0, 0]));
    assert_eq!(at(-0.5, -1.75, 0.5), Some([1, 1, 1]));
    let [x, y, z] = [-0.5_f64, -1.75, 0.5].map(f64::next_down);
    assert_eq!(at(x, y, z), Some([0, 0, 0]));
    assert_eq!(at(1.0, 0.0, 0.0), None);
    assert_eq!(at(0.0, 2.0, 0.0), None);
    assert_eq!(at(0.0, 0.0, 1.5), None);
    assert_eq!(at((-1.0_f64).next_up(), -2.0, -0.5), Some([0, 0, 0]));
    assert_eq!(at((-1.0_f64).next_down(), -2.0, -0.5), None);
    assert_eq!(at(f64::NAN, 0.0, 0.0), None);
    assert_eq!(at(f64::INFINITY, 0.0, 0.0), None);
}

/// −40 + 7·0.2 lies on a face, but (−38.6 − −40)/0.2 rounds to 6.999…: the face decides.
#[test]
fn faces_decide_where_division_rounds() {
    let roi = Roi::new([-40.0; 3], [0.2; 3], [400; 3]).unwrap();
    let mut divided_wrong = 0;
    for i in 0..400 {
        let face = -40.0 + f64::from(i) * 0.2;
        divided_wrong += u32::from((face + 40.0) / 0.2 < f64::from(i));
        let voxel = roi.voxel_of(DVec3::splat(face)).unwrap();
        assert_eq!(roi.coords(voxel), [i; 3], "face {i}");
        if i > 0 {
            let voxel = roi.voxel_of(DVec3::splat(face.next_down())).unwrap();
            assert_eq!(roi.coords(voxel), [i - 1; 3], "below face {i}");
        }
    }
    assert!(divided_wrong > 0, "the trap is not in this grid");
}

#[test]
fn a_point_lies_in_the_box_of_its_voxel() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let roi = Roi::new([-3.3, 0.1, 1e3], [0.1, 0.15, 0.2], [37, 11, 5]).unwrap();
    let (min, voxel, max) = (roi.min(), roi.voxel(), roi.max());
    for _ in 0..10_000 {
        let p: [f64; 3] =
            std::array::from_fn(|a| min[a] + (max[a] - min[a]) * rng.random_range(-0.1..1.1));
        let inside = (0..3).all(|a| p[a] >= min[a] && p[a] < max[a]);
        let found = roi.voxel_of(p.into());
        assert_eq!(found.is_some(), inside);
        if let Some(found) = found {
            let coords = roi.coords(found);
            for a in 0..3 {
                let [below, above] = [0, 1].map(|up| min[a] + f64::from(coords[a] + up) * voxel[a]);
                assert!(below <= p[a] && p[a] < above);
            }
        }
    }
}

/// A road at z = 0.5, a voxel face, seen from above and from below.
#[test]
fn a_hit_is_pushed_along_its_beam() {
    let roi = small_roi();
    let hit = |origin: [f64; 3], point: [f64; 3]| {
        roi.voxel_of_hit(origin.into(), point.into()).map(|v| roi.coords(v)[2])
    };
    let road = [0.1, 0.1, 0.5];
    assert_eq!(hit([0.1, 0.1, 1.4], road), Some(0));
    assert_eq!(hit([0.1, 0.1, -0.4], road), Some(1));
    // A millimetre, no more: 0.9 mm above the face ends below it, 1.1 mm does not.
    assert_eq!(hit([0.1, 0.1, 1.4], [0.1, 0.1, 0.5009]), Some(0));
    assert_eq!(hit([0.1, 0.1, 1.4], [0.1, 0.1, 0.5011]), Some(1));
    assert_eq!(hit(road, road), Some(1), "a point at its own origin stays");
}

#[test]
fn bounds_of_a_scene_become_a_shape() {
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    assert_eq!(roi.shape(), [400, 400, 30]);
    let roi = Roi::from_bounds([0.0; 3], [40.0, 40.0, 6.0], [0.1, 0.15, 0.2]).unwrap();
    assert_eq!(roi.shape(), [400, 267, 30], "the last voxel reaches past the end");
}

#[test]
fn bad_grids_are_refused() {
    let new = Roi::new;
    let (m, v, s) = ([0.0; 3], [0.2; 3], [10; 3]);
    let cases = [
        (new([0.0, f64::NAN, 0.0], v, s), "roi_min along y is NaN; give a finite number of metres"),
        (new(m, [0.2, 0.2, f64::INFINITY], s), "voxel along z is inf"),
        (
            new(m, [-0.2, 0.2, 0.2], s),
            "voxel along x is -0.2 m; give an edge above 0, at most 1000000 m",
        ),
        (new(m, [0.0, 0.2, 0.2], s), "voxel along x is 0 m"),
        (new(m, v, [10, 0, 10]), "shape along y is 0"),
        (new(m, v, [1 << 25, 1, 1]), "shape along x is 33554432 voxels, at most 16777216 fit"),
        (new(m, v, [2048, 2048, 513]), "the grid has 2151677952 voxels, at most 2147483648 fit"),
        (new([1e16, 0.0, 0.0], v, s), "voxel along x is 0.2 m, too fine for coordinates near 1"),
        (
            new(m, [2e6, 1.0, 1.0], s),
            "voxel along x is 2000000 m; give an edge above 0, at most 1000000 m",
        ),
        (
            Roi::from_bounds([0.0; 3], [1.0, -1.0, 1.0], v),
            "the region of interest ends at -1 m along y, before or where it begins (0 m)",
        ),
        (Roi::from_bounds([0.0; 3], [1e9, 1.0, 1.0], v), "shape along x is 5000000000 voxels"),
        (Roi::from_bounds([0.0; 3], [1.0; 3], [0.0; 3]), "voxel along x is 0 m"),
    ];
    for (got, wanted) in cases {
        assert_begins!(got.unwrap_err(), wanted);
    }
    assert!(new(m, v, [2048, 2048, 512]).is_ok(), "2³¹ voxels fit");
}

type Vote = (Option<u64>, u16);

fn build(frames: &[Vec<Vote>]) -> (Psog, BuildReport) {
    let mut builder = PsogBuilder::new(small_roi(), names(&["a", "b", "c"])).unwrap();
    for frame in frames {
        let mut votes = FrameVotes::new();
        votes.extend(frame.iter().copied());
        builder.frame(votes).unwrap();
    }
    builder.finish().unwrap()
}

#[test]
fn majority_wins_and_ties_go_to_the_lowest_class() {
    let at = |voxel, classes: &[u16]| classes.iter().map(move |&c| (Some(voxel), c)).collect();
    let frame: Vec<Vec<Vote>> = vec![
        at(7, &[2, 1, 2]),              // c
        at(8, &[2, 1, 1, 2]),           // b and c tie: b
        at(9, &[2, 1, 0]),              // all tie: a
        at(10, &[2, 1, 0, 2]),          // c, though a and b tie
        at(11, &[0, 0, 1, 1, 2, 2, 2]), // c
        vec![(None, 0), (None, 1)],
    ];
    let (psog, report) = build(&[frame.concat(), vec![], at(8, &[1])]);
    assert_eq!(psog.frames(), 3);
    assert_eq!(psog.index(), [7, 8, 9, 10, 11]);
    assert_eq!(psog.counts(), [0, 0, 1, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1]);
    assert_eq!((report.frames, report.voxels_voted, report.ties), (3, 6, 2));
    assert_eq!((report.points_in, report.points_outside), (22, 2));
    assert_eq!(report.tie_share(), 2.0 / 6.0);
}

#[test]
fn wrong_votes_are_refused_and_leave_no_trace() {
    let mut builder = PsogBuilder::new(small_roi(), names(&["a", "b"])).unwrap();
    for (vote, wanted) in [
        ((Some(3), 2), "a point of frame 0 votes for class 2, but there are 2 classes"),
        ((Some(128), 1), "a point of frame 0 votes in voxel 128, but the grid has 128"),
        ((Some(1 << 50), 1), "a point of frame 0 votes in voxel 4294967295"),
    ] {
        let mut votes = FrameVotes::new();
        votes.extend([(Some(5), 0), vote]);
        assert_begins!(builder.frame(votes).unwrap_err(), wanted);
    }
    assert_begins!(builder.finish().unwrap_err(), "frames is 0");
}

fn random_frames(seed: u64, frames: usize) -> Vec<Vec<Vote>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..frames)
        .map(|_| {
            let points = rng.random_range(0..400);
            (0..points)
                .map(|_| {
                    let voxel = rng.random_range(0..140u64);
                    ((voxel < 128).then_some(voxel), rng.random_range(0..3))
                })
                .collect()
        })
        .collect()
}

/// Brute force: tallies in maps, winner by scanning the classes from the lowest.
#[test]
fn agrees_with_counting_in_maps() {
    for seed in 0..20 {
        let frames = random_frames(seed, 1 + seed as usize);
        let mut counts: BTreeMap<u64, [u16; 3]> = BTreeMap::new();
        let mut ties = 0;
        for frame in &frames {
            let mut tally: BTreeMap<u64, [u32; 3]> = BTreeMap::new();
            for &(voxel, class) in frame {
                if let Some(voxel) = voxel {
                    tally.entry(voxel).or_default()[usize::from(class)] += 1;
                }
            }
            for (voxel, votes) in tally {
                let most = *votes.iter().max().unwrap();
                let winner = votes.iter().position(|&v| v == most).unwrap();
                ties += u64::from(votes.iter().filter(|&&v| v == most).count() > 1);
                counts.entry(voxel).or_default()[winner] += 1;
            }
        }
        let (psog, report) = build(&frames);
        assert_eq!(psog.index(), counts.keys().copied().collect::<Vec<_>>());
        assert_eq!(psog.counts(), counts.values().copied().flatten().collect::<Vec<_>>());
        assert_eq!(report.ties, ties);
    }
}

#[test]
fn order_of_votes_and_frames_does_not_matter() {
    let mut frames = random_frames(99, 13);
    let whole = build(&frames);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..5 {
        frames.iter_mut().for_each(|f| f.shuffle(&mut rng));
        frames.shuffle(&mut rng);
        assert_eq!(build(&frames), whole);
    }
}

#[test]
fn two_merged_halves_are_the_whole() {
    let frames = random_frames(5, 17);
    let (whole, report) = build(&frames);
    for cut in [1, 8, 16] {
        let (left, left_report) = build(&frames[..cut]);
        let (right, right_report) = build(&frames[cut..]);
        assert_eq!(left.merge(&right).unwrap(), whole);
        assert_eq!(left_report.add(&right_report), report);
    }
}

#[test]
fn a_count_holds_65_535_frames_and_no_more() {
    let mut builder = PsogBuilder::new(small_roi(), names(&["a", "b"])).unwrap();
    let vote = || {
        let mut votes = FrameVotes::new();
        votes.extend([(Some(127), 1)]);
        votes
    };
    for _ in 0..65_535 {
        builder.frame(vote()).unwrap();
    }
    assert_begins!(builder.frame(vote()).unwrap_err(), "frame 65536 is one too many");
    let (psog, _) = builder.finish().unwrap();
    assert_eq!((psog.index(), psog.counts()), (&[127][..], &[0, u16::MAX][..]));
}
