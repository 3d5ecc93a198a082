//! SemanticKITTI frames against counts made with NumPy.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::datasets::{KittiSequence, LabelledSequence, PsogOptions, build_psog};
use sightline_scene::psog::{BuildReport, EntropyKind, Psog, PsogInfo, Roi, read_psog, write_psog};

/// Frames, voxels voted, ties, points in the region and points outside it.
fn numbers(report: &BuildReport) -> [u64; 5] {
    let BuildReport { frames, voxels_voted, ties, points_in, points_outside } = *report;
    [frames, voxels_voted, ties, points_in, points_outside]
}

fn real() -> PathBuf {
    Path::new(env!("REAL_DATA")).join("nc/semantickitti/sequences/00")
}

fn roi() -> Roi {
    Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap()
}

/// Frames per class, and a sum over all (voxel, class) that depends on where each stands.
fn digest(psog: &Psog) -> (Vec<u64>, u64) {
    let mut per_class = vec![0; psog.classes().len()];
    let mut sum = 0u64;
    for (row, &voxel) in psog.rows().zip(psog.index()) {
        for (class, &count) in row.iter().enumerate() {
            per_class[class] += u64::from(count);
            sum += (voxel * 31 + class as u64 * 7 + 1) * u64::from(count);
        }
    }
    (per_class, sum % (1 << 32))
}

/// Golden counts of frame 000000 of sequence 00, worked out with NumPy by this rule.
///
/// Points are in f64, with 1.73 m added to z, and pushed 1 mm away from (0, 0, 1.73). Their voxel is
/// floor((p − min) / 0.2). Labels are folded by the learning map of semantic-kitti.yaml, and class 0
/// is left out. Most votes win; on ties the lowest class wins.
#[test]
#[cfg_attr(not(has_kitti), ignore = "needs SemanticKITTI in ../shared/data or SIGHTLINE_DATA")]
fn golden_counts_of_one_frame() {
    let folder = real();
    let sequence = [KittiSequence::open(&folder).unwrap()];
    let options = PsogOptions { frames: Some(vec![0]), ..PsogOptions::new(roi()) };
    let (psog, report) = build_psog(&sequence, &options).unwrap();
    assert_eq!(numbers(&report), [1, 26_664, 67, 116_126, 3_656]);
    let (per_class, sum) = digest(&psog);
    assert_eq!(
        per_class,
        [1145, 0, 0, 0, 0, 0, 0, 61, 5355, 640, 3552, 0, 4312, 203, 9212, 565, 1411, 165, 43]
    );
    assert_eq!(sum, 2_352_782_942);
    assert_eq!(psog.entropy_total(EntropyKind::Segmentation), 0.0);
}

/// Golden counts of frames 0, 3, 6, 9 by the rule of `golden_counts_of_one_frame`. Each is merged from all four
/// through LiDAR poses Tr⁻¹·P·Tr (rotations made orthonormal from their first two columns), moving labels only
/// in their own frame; the entropies are NumPy's, in f64.
#[test]
#[cfg_attr(not(has_kitti), ignore = "needs SemanticKITTI in ../shared/data or SIGHTLINE_DATA")]
fn golden_counts_of_four_merged_frames() {
    let folder = real();
    let sequence = [KittiSequence::open(&folder).unwrap()];
    let (psog, report) = build_psog(&sequence, &PsogOptions::new(roi())).unwrap();
    assert_eq!(numbers(&report), [4, 214_274, 639, 1_855_536, 50_468]);
    let (per_class, sum) = digest(&psog);
    assert_eq!(
        per_class,
        [
            8893, 0, 0, 0, 0, 2, 0, 199, 48929, 7708, 27776, 0, 33100, 1360, 69463, 3563, 12106,
            962, 213
        ]
    );
    assert_eq!(sum, 2_208_765_626);

    let info = PsogInfo::new(&psog, Some(&report));
    assert_eq!((info.occupied, info.informative), (156_867, 153_031));
    let target = psog.class_id("car").unwrap();
    for (kind, numpy) in [
        (EntropyKind::Segmentation, 92_282.137_844_378_84),
        (EntropyKind::Detection { target }, 87_788.685_578_299_3),
        (EntropyKind::Bernoulli, 87_542.492_726_581_99),
    ] {
        let total = psog.entropy_total(kind);
        assert!((total / numpy - 1.0).abs() < 1e-8, "{kind:?}: {total}, NumPy {numpy}");
    }
    let parts: f64 = info.classes.iter().map(|c| c.entropy).sum();
    assert!(((parts + info.entropy_empty) / info.entropy_segmentation - 1.0).abs() < 1e-8);

    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("real.psog.npz");
    write_psog(std::fs::File::create(&path).unwrap(), &psog).unwrap();
    assert_eq!(read_psog(&path).unwrap(), psog);
}

/// SemanticKITTI's own voxel grid of the scan: 256 × 256 × 32 voxels of 0.2 m from (0, −25.6, −2.2)
/// in the LiDAR frame, a bit each, first bit highest. It lacks points beyond some 50 m and a few
/// others: 37 of our voxels, and we lack 1 of its 11 677.
#[test]
#[cfg_attr(not(has_kitti), ignore = "needs SemanticKITTI in ../shared/data or SIGHTLINE_DATA")]
fn voxels_are_those_of_the_data_set() {
    let folder = real();
    let bits = std::fs::read(folder.join("voxels/000000.bin")).unwrap();
    let roi = Roi::new([0.0, -25.6, -2.2], [0.2; 3], [256, 256, 32]).unwrap();
    let mut ours = vec![false; roi.voxel_count() as usize];
    for point in KittiSequence::open(&folder).unwrap().read(0).unwrap().points {
        if let Some(voxel) = roi.voxel_of(DVec3::from(point.map(f64::from))) {
            ours[voxel as usize] = true;
        }
    }
    let theirs = |v: usize| bits[v / 8] & (0x80 >> (v % 8)) != 0;
    let count = |f: &dyn Fn(usize) -> bool| (0..ours.len()).filter(|&v| f(v)).count();
    assert_eq!(count(&theirs), 11_677);
    assert!(count(&|v| ours[v] && !theirs(v)) <= 37);
    assert!(count(&|v| theirs(v) && !ours[v]) <= 1);
}
