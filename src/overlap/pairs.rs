//! Pairs that connect LiDARs, from a symmetric matrix of how much each pair shares.

/// Two LiDARs and how much they share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair {
    /// Positions in the placement, the lower first.
    pub lidars: [usize; 2],
    /// Entry of the matrix.
    pub shared: f64,
}

/// All pairs, the largest shares first; of equal ones the lower LiDARs first.
fn pairs(shared: &[Vec<f64>]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (a, row) in shared.iter().enumerate() {
        let above = row.iter().enumerate().skip(a + 1);
        pairs.extend(above.map(|(b, &shared)| Pair { lidars: [a, b], shared }));
    }
    pairs.sort_by(|a, b| b.shared.total_cmp(&a.shared));
    pairs
}

/// Pairs that join LiDARs which stronger pairs have not joined, and that share anything (Kruskal 1956).
pub(crate) fn chain(shared: &[Vec<f64>]) -> Vec<Pair> {
    let mut group: Vec<usize> = (0..shared.len()).collect();
    let joins = |pair: &Pair| {
        let [a, b] = pair.lidars.map(|lidar| group[lidar]);
        group.iter_mut().filter(|of| **of == b).for_each(|of| *of = a);
        a != b
    };
    pairs(shared).into_iter().filter(|pair| pair.shared > 0.0).filter(joins).collect()
}

/// LiDARs that pairs of at least `least` connect; the largest group first, of equal ones that of the lowest LiDAR.
pub(crate) fn groups(shared: &[Vec<f64>], least: f64) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (lidar, row) in shared.iter().enumerate() {
        let is_joined = |group: &Vec<usize>| group.iter().any(|&other| row[other] >= least);
        let (joined, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(is_joined);
        let mut group = joined.concat();
        group.push(lidar);
        group.sort_unstable();
        groups = apart;
        groups.push(group);
    }
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group[0]));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(count: usize, pairs: &[(usize, usize, f64)]) -> Vec<Vec<f64>> {
        let mut shared = vec![vec![0.0; count]; count];
        for &(a, b, of_pair) in pairs {
            (shared[a][b], shared[b][a]) = (of_pair, of_pair);
        }
        shared
    }

    #[test]
    fn a_chain_connects_what_no_single_pair_does() {
        let shared =
            matrix(5, &[(0, 3, 900.0), (3, 1, 600.0), (0, 1, 500.0), (2, 4, 700.0), (1, 2, 80.0)]);
        assert_eq!(groups(&shared, 500.0), [vec![0, 1, 3], vec![2, 4]]);
        assert_eq!(groups(&shared, 80.0), [vec![0, 1, 2, 3, 4]]);
        assert_eq!(groups(&shared, 650.0), [vec![0, 3], vec![2, 4], vec![1]]);
        let chain = chain(&shared);
        let told: Vec<_> = chain.iter().map(|pair| (pair.lidars, pair.shared)).collect();
        assert_eq!(told, [([0, 3], 900.0), ([2, 4], 700.0), ([1, 3], 600.0), ([1, 2], 80.0)]);
    }

    #[test]
    fn the_weakest_pair_of_the_chain_is_the_largest_number_that_connects() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let of = |a: usize| (a + 1..6).map(move |b| (a, b));
            let mut voxels = || f64::from(rng.random_range(0..40_u32)).max(8.0) - 8.0;
            let pairs = (0..6).flat_map(of).map(|(a, b)| (a, b, voxels()));
            let shared = matrix(6, &pairs.collect::<Vec<_>>());
            let connects = |least: u32| groups(&shared, f64::from(least)).len() == 1;
            let most = (1..40).rev().find(|&least| connects(least)).map_or(0.0, f64::from);
            let chain = chain(&shared);
            let weakest = chain.last().filter(|_| chain.len() == 5);
            assert_eq!(weakest.map_or(0.0, |pair| pair.shared), most);
        }
    }
}
