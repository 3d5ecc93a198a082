//! Occupied cells to few blocks, greedily.

use std::collections::HashSet;

/// Cell numbers along x, y and z.
pub(super) type Cell = [i32; 3];

/// A block of cells from `low` up to and without `high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    pub low: Cell,
    pub high: Cell,
}

/// Blocks that hold every cell once and nothing else: from the least cell on, each grows along `axes` in
/// their order as far as whole layers of free cells reach.
pub(super) fn merge(mut cells: HashSet<Cell>, axes: &[usize]) -> Vec<Block> {
    let mut order: Vec<Cell> = cells.iter().copied().collect();
    order.sort_unstable();
    let mut blocks = Vec::new();
    for low in order {
        if !cells.contains(&low) {
            continue;
        }
        let mut block = Block { low, high: low.map(|v| v + 1) };
        for &axis in axes {
            while layer(&block, axis).all(|cell| cells.contains(&cell)) {
                block.high[axis] += 1;
            }
        }
        inside(block.low, block.high).for_each(|cell| {
            cells.remove(&cell);
        });
        blocks.push(block);
    }
    blocks
}

/// The cells beyond the upper face of a block.
fn layer(block: &Block, axis: usize) -> impl Iterator<Item = Cell> {
    let (mut low, mut high) = (block.low, block.high);
    (low[axis], high[axis]) = (high[axis], high[axis] + 1);
    inside(low, high)
}

fn inside(low: Cell, high: Cell) -> impl Iterator<Item = Cell> {
    let [x, y, z] = [0, 1, 2].map(|axis| low[axis]..high[axis]);
    x.flat_map(move |i| {
        let z = z.clone();
        y.clone().flat_map(move |j| z.clone().map(move |k| [i, j, k]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every cell lies in one block, and no block holds another cell.
    #[test]
    fn blocks_are_the_cells() {
        let mut state = 7_u32;
        let mut random = |most: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 16) % most) as i32
        };
        for axes in [&[1, 0][..], &[2, 1, 0]] {
            let cells: HashSet<Cell> =
                (0..400).map(|_| [random(9), random(9) - 4, random(5)]).collect();
            let blocks = merge(cells.clone(), axes);
            let held: Vec<Cell> = blocks.iter().flat_map(|b| inside(b.low, b.high)).collect();
            assert_eq!(held.len(), cells.len(), "{axes:?}");
            assert_eq!(held.into_iter().collect::<HashSet<_>>(), cells, "{axes:?}");
            assert!(blocks.len() < cells.len(), "{axes:?}");
            assert!(axes.contains(&2) || blocks.iter().all(|b| b.high[2] == b.low[2] + 1));
        }
        let full: HashSet<Cell> = inside([0, 0, 0], [3, 4, 5]).collect();
        assert_eq!(merge(full, &[2, 1, 0]), [Block { low: [0; 3], high: [3, 4, 5] }]);
    }
}
