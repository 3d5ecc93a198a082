//! Majority votes and their ties.

use std::collections::BTreeMap;

use rand::{RngExt, seq::SliceRandom};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::{names, small_roi};
use crate::psog::{FrameVotes, Psog, PsogBuilder};

type Vote = (Option<u64>, u16);

fn build(frames: &[Vec<Vote>]) -> (Psog, crate::psog::BuildReport) {
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
        let message = builder.frame(votes).unwrap_err().to_string();
        assert!(message.starts_with(wanted), "{message}");
    }
    let message = builder.finish().unwrap_err().to_string();
    assert!(message.starts_with("frames is 0"), "{message}");
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
    let message = builder.frame(vote()).unwrap_err().to_string();
    assert!(message.starts_with("frame 65536 is one too many"), "{message}");
    let (psog, _) = builder.finish().unwrap();
    assert_eq!((psog.index(), psog.counts()), (&[127][..], &[0, u16::MAX][..]));
}
