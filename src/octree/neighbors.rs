//! Neighbors of every node in constant time, from those of its parent.

use crate::exec::par;

/// Nodes per task; any constant in the thousands will do.
const BLOCK: usize = 2048;

/// For child `octant` and neighbor `k`: which neighbor of the parent holds it, and as which child.
const STEPS: [[(u8, u8); 27]; 8] = steps();

const fn steps() -> [[(u8, u8); 27]; 8] {
    let mut table = [[(0, 0); 27]; 8];
    let mut i = 0;
    while i < 8 * 27 {
        let (octant, k) = (i / 27, i % 27);
        // Position among the 4 half-size cells that the parent and its neighbors offer, from 1 to 4.
        let x = (octant >> 2) + k / 9 + 1;
        let y = (octant >> 1 & 1) + k / 3 % 3 + 1;
        let z = (octant & 1) + k % 3 + 1;
        let parent = 9 * (x / 2) + 3 * (y / 2) + z / 2;
        table[octant][k] = (parent as u8, (4 * (x % 2) + 2 * (y % 2) + z % 2) as u8);
        i += 1;
    }
    table
}

/// The only nodes of depth 0 have no neighbors but themselves.
pub(super) fn of_roots(n_shapes: usize) -> Vec<[i32; 27]> {
    let alone = |n| std::array::from_fn(|k| if k == 13 { n as i32 } else { -1 });
    (0..n_shapes).map(alone).collect()
}

/// Around the children of each of the nodes `nonempty`, whose depth has `children` and `neigh`: first child
/// of every neighbor of the parent.
pub(super) fn of_parents(
    nonempty: &[u32],
    children: &[i32],
    neigh: &[[i32; 27]],
) -> Vec<[i32; 27]> {
    let first_child = |p: i32| match usize::try_from(p).map(|p| children[p]) {
        Ok(group @ 0..) => 8 * group,
        _ => -1,
    };
    nonempty.iter().map(|&parent| neigh[parent as usize].map(first_child)).collect()
}

/// Neighbors of the children that [`of_parents`] is about.
pub(super) fn of_children(siblings: &[[i32; 27]]) -> Vec<[i32; 27]> {
    let mut finer = vec![[-1; 27]; 8 * siblings.len()];
    par::for_each_block(&mut finer, BLOCK, |block, rows| {
        for (i, row) in rows.iter_mut().enumerate() {
            let n = block * BLOCK + i;
            for (neighbor, &(parent, octant)) in row.iter_mut().zip(&STEPS[n % 8]) {
                let first = siblings[n / 8][parent as usize];
                *neighbor = if first < 0 { -1 } else { first + i32::from(octant) };
            }
        }
    });
    finer
}
