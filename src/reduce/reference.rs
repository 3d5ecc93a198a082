//! Integer sums over covered voxels, a voxel at a time: the specification.

use rayon::prelude::*;

use crate::bvh::{Hit, NO_HIT};
use crate::problem::{Content, Tally};
use crate::vehicle::Placement;

/// Sums over the covered voxels of each placement in one frame.
///
/// `bitmaps` is `[sensors × words]` and `hits` `[sensors × directions]`, the sensors of all
/// placements in order.
///
/// CPU twin of `shaders/reduce_words.wgsl`, `reduce_occupied.wgsl` and `reduce_classes.wgsl`.
pub fn reduce(
    placements: &[Placement],
    content: &Content,
    bitmaps: &[u64],
    hits: Option<&[Hit]>,
    directions: usize,
) -> Vec<Tally> {
    let sensors: usize = placements.iter().map(|p| p.lidars.len()).sum();
    let words = bitmaps.len() / sensors.max(1);
    let first_sensor: Vec<usize> = placements
        .iter()
        .scan(0, |next, p| {
            let first = *next;
            *next += p.lidars.len();
            Some(first)
        })
        .collect();
    let tasks = placements.par_iter().zip(first_sensor);
    tasks
        .map(|(placement, first)| {
            let lidars = placement.lidars.len();
            let maps: Vec<&[u64]> =
                bitmaps[first * words..(first + lidars) * words].chunks(words).collect();
            let mut tally = Tally::zero(content.classes().len(), lidars);
            reduce_words(&maps, &mut tally);
            reduce_occupied(&maps, content, &mut tally);
            reduce_classes(&maps, content, &mut tally);
            tally.beams = (lidars * directions) as u64;
            if let Some(hits) = hits {
                let own = &hits[first * directions..(first + lidars) * directions];
                tally.hits = own.iter().filter(|hit| hit.prim != NO_HIT).count() as u64;
            }
            tally
        })
        .collect()
}

fn reduce_words(maps: &[&[u64]], tally: &mut Tally) {
    for word in 0..maps[0].len() {
        let union = maps.iter().fold(0, |or, map| or | map[word]);
        tally.covered += u64::from(union.count_ones());
    }
}

fn reduce_occupied(maps: &[&[u64]], content: &Content, tally: &mut Tally) {
    for voxel in content.occupied() {
        let (mut times, mut last) = (0, 0);
        for (lidar, map) in maps.iter().enumerate() {
            if is_set(map, voxel.index) {
                times += 1;
                last = lidar;
            }
        }
        if times == 0 {
            continue;
        }
        tally.covered_nonzero += 1;
        for (sum, entropy) in tally.entropy.iter_mut().zip(voxel.entropy) {
            *sum += u64::from(entropy);
        }
        if times == 1 {
            tally.unique[last] += u64::from(voxel.entropy[0]);
        }
    }
}

fn reduce_classes(maps: &[&[u64]], content: &Content, tally: &mut Tally) {
    for (class, count) in tally.by_class.iter_mut().enumerate() {
        let voxels = content.voxels_of_class(class).iter();
        *count = voxels.filter(|&&v| maps.iter().any(|map| is_set(map, v))).count() as u64;
    }
}

fn is_set(map: &[u64], voxel: u32) -> bool {
    map[voxel as usize >> 6] >> (voxel & 63) & 1 == 1
}
