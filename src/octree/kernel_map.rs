//! Kernel maps: lists of the pairs (input row, output row) that meet at each kernel offset.
//!
//! Output rows are cut into blocks of constant length. For each block and each kernel offset the map
//! lists the pairs (input row, output row within the block) that exist, output rows ascending, so
//! that a missing neighbor costs nothing. The block length depends on the number of rows only.

use crate::exec::par;
use crate::simd::gemm::block::MAX_ROWS as MAX_BLOCK;
use std::ops::Range;

/// Shortest block of a map that has several; blocks are multiples of it.
const MIN_BLOCK: usize = 64;
/// Such maps are cut into about this many blocks, to keep several threads busy to the end.
const MIN_BLOCKS: usize = 32;

/// Pairs of input and output rows for every block of output rows and every kernel offset.
///
/// ```
/// use deepmill::octree::KernelMap;
///
/// let gather = KernelMap::gather(&[3, 1], 4); // outputs 0, 1 read inputs 3, 1 of four
/// assert_eq!(gather.pairs(0, 0), (&[3, 1][..], &[0, 1][..]));
/// let mut neigh = [[-1; 27]; 2]; // two nodes side by side in z
/// (neigh[0][13], neigh[0][14], neigh[1][12], neigh[1][13]) = (0, 1, 0, 1);
/// let conv = KernelMap::convolution(&neigh, vec![]);
/// assert_eq!((conv.n_offsets(), conv.n_pairs()), (27, 4)); // what is missing costs nothing
/// assert_eq!(conv.pairs(0, 14), (&[1][..], &[0][..])); // at this offset node 0 reads node 1
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KernelMap {
    n_inputs: usize,
    n_outputs: usize,
    n_offsets: usize,
    block_len: usize,
    starts: Vec<usize>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    siblings: Vec<[i32; 27]>,
}

impl KernelMap {
    /// The 27 offsets of a 3×3×3 convolution over nodes with neighbors `neigh` (−1: missing), and what
    /// [`KernelMap::siblings`] returns.
    ///
    /// # Panics
    /// If there are siblings, but not for every eight nodes, or a neighbor is not a node.
    pub fn convolution(neigh: &[[i32; 27]], siblings: Vec<[i32; 27]>) -> Self {
        assert!(siblings.is_empty() || 8 * siblings.len() == neigh.len(), "groups of eight nodes");
        KernelMap { siblings, ..Self::from_rows(neigh.len(), neigh.len(), |n| neigh[n]) }
    }

    /// One offset: input `i` goes to output `rows[i]` of `n_outputs`; `rows` ascends strictly.
    ///
    /// # Panics
    /// If a row is not below `n_outputs`, or does not ascend.
    pub fn scatter(rows: &[u32], n_outputs: usize) -> Self {
        assert!(rows.is_sorted_by(|a, b| a < b), "rows must ascend strictly");
        assert_below(rows, n_outputs);
        let mut input_of = vec![-1; n_outputs];
        for (i, &row) in rows.iter().enumerate() {
            input_of[row as usize] = i as i32;
        }
        Self::from_rows(rows.len(), n_outputs, |n| [input_of[n]])
    }

    /// One offset: input `rows[i]` of `n_inputs` goes to output `i`.
    ///
    /// # Panics
    /// If a row is not below `n_inputs`.
    pub fn gather(rows: &[u32], n_inputs: usize) -> Self {
        assert_below(rows, n_inputs);
        Self::from_rows(n_inputs, rows.len(), |n| [rows[n] as i32])
    }

    fn from_rows<const K: usize>(
        n_inputs: usize,
        n_outputs: usize,
        row: impl Fn(usize) -> [i32; K] + Sync,
    ) -> Self {
        let block_len = block_len(n_outputs);
        let blocks = par::map_blocks(n_outputs, block_len, |range| Block::new(range, &row));
        blocks.iter().for_each(|block| assert_below(&block.inputs, n_inputs));
        let n_pairs = blocks.iter().map(|block| block.inputs.len()).sum();
        let (mut inputs, mut outputs) = (Vec::with_capacity(n_pairs), Vec::with_capacity(n_pairs));
        let mut starts = Vec::with_capacity(blocks.len() * K + 1);
        starts.push(0);
        for block in &blocks {
            starts.extend(block.ends.iter().map(|end| inputs.len() + end));
            inputs.extend_from_slice(&block.inputs);
            outputs.extend_from_slice(&block.outputs);
        }
        let siblings = Vec::new();
        KernelMap {
            n_inputs,
            n_outputs,
            n_offsets: K,
            block_len,
            starts,
            inputs,
            outputs,
            siblings,
        }
    }

    /// Number of rows read.
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Number of rows written.
    pub fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    /// Number of kernel offsets.
    pub fn n_offsets(&self) -> usize {
        self.n_offsets
    }

    /// Output rows per block; the last block may be shorter.
    pub fn block_len(&self) -> usize {
        self.block_len
    }

    /// Number of blocks.
    pub fn n_blocks(&self) -> usize {
        self.n_outputs.div_ceil(self.block_len.max(1))
    }

    /// Number of pairs: a convolution does `2·n_pairs·c_in·c_out` floating-point operations.
    pub fn n_pairs(&self) -> usize {
        self.inputs.len()
    }

    /// If the rows of this convolution are known to be the children of some parents, eight after eight: for
    /// each parent, the first child of each of its 27 neighbors (−1: missing). Else empty.
    pub fn siblings(&self) -> &[[i32; 27]] {
        &self.siblings
    }

    /// Input rows, and output rows counted from the block's first, of one block and offset.
    ///
    /// # Panics
    /// If there is no such block or offset.
    pub fn pairs(&self, block: usize, offset: usize) -> (&[u32], &[u32]) {
        assert!(offset < self.n_offsets);
        let i = block * self.n_offsets + offset;
        let range = self.starts[i]..self.starts[i + 1];
        (&self.inputs[range.clone()], &self.outputs[range])
    }
}

/// Kernels gather these rows unchecked.
fn assert_below(rows: &[u32], n: usize) {
    assert!(i32::try_from(n).is_ok(), "{n} rows, more than a map can name");
    if let Some(row) = rows.iter().copied().max() {
        assert!((row as usize) < n, "row {row} of {n} rows");
    }
}

/// The lists of one block, offset after offset.
struct Block<const K: usize> {
    ends: [usize; K],
    inputs: Vec<u32>,
    outputs: Vec<u32>,
}

impl<const K: usize> Block<K> {
    fn new(range: Range<usize>, row: impl Fn(usize) -> [i32; K]) -> Self {
        let len = range.len();
        let rows: Vec<[i32; K]> = range.map(row).collect();
        let mut block = Block { ends: [0; K], inputs: vec![0; K * len], outputs: vec![0; K * len] };
        let mut n = 0;
        for k in 0..K {
            for (local, row) in rows.iter().enumerate() {
                // Written in any case and kept if it exists: faster than an unpredictable branch.
                block.inputs[n] = row[k] as u32;
                block.outputs[n] = local as u32;
                n += usize::from(row[k] >= 0);
            }
            block.ends[k] = n;
        }
        block.inputs.truncate(n);
        block.outputs.truncate(n);
        block
    }
}

/// Maps that fit one block have one: work on them is shared by columns.
fn block_len(n_outputs: usize) -> usize {
    match n_outputs {
        0..=MAX_BLOCK => MAX_BLOCK,
        n => (n / MIN_BLOCKS).next_multiple_of(MIN_BLOCK).clamp(MIN_BLOCK, MAX_BLOCK),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_existing_pair_is_listed_once_in_its_block() {
        for n in [1usize, 31, 256, 257, 700, 3000] {
            let neigh: Vec<[i32; 27]> = (0..n)
                .map(|r| {
                    std::array::from_fn(|k| {
                        if (r + k) % 3 == 0 { -1 } else { ((r * 7 + k) % n) as i32 }
                    })
                })
                .collect();
            let map = KernelMap::convolution(&neigh, vec![]);
            let mut rebuilt = vec![-1; 27 * n];
            for block in 0..map.n_blocks() {
                for k in 0..27 {
                    let (inputs, outputs) = map.pairs(block, k);
                    assert!(outputs.windows(2).all(|w| w[0] < w[1]));
                    for (&i, &o) in inputs.iter().zip(outputs) {
                        rebuilt[27 * (block * map.block_len() + o as usize) + k] = i as i32;
                    }
                }
            }
            assert_eq!(rebuilt, neigh.as_flattened());
            assert_eq!(map.n_pairs(), neigh.iter().flatten().filter(|&&i| i >= 0).count());
        }
    }
}
