//! Integer sums over covered voxels, a voxel at a time: the specification.

use crate::task::{Content, Entropy, Tally};

/// Sums over the voxels that one placement of `lidars` sensors covers in one frame; `bitmaps` is
/// `[lidars × words]`. Beams and hits are left at 0.
///
/// CPU twin of `shaders/reduce_words.wgsl`, `reduce_occupied.wgsl` and `reduce_classes.wgsl`.
pub fn reduce(lidars: usize, content: &Content, bitmaps: &[u64]) -> Tally {
    let maps: Vec<&[u64]> = bitmaps.chunks(bitmaps.len() / lidars.max(1)).collect();
    let mut tally = Tally::zero(content.set_count(), lidars);
    reduce_words(&maps, &mut tally);
    reduce_occupied(&maps, content, &mut tally);
    reduce_classes(&maps, content, &mut tally);
    tally
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
            tally.unique[last] += u64::from(Entropy::Classes.of(&voxel.entropy));
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
