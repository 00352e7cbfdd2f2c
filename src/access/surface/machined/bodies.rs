//! What is left, as bodies with a surface.
//!
//! A node that is left is *core* if its distance from the part and that from what is removed are together more than the
//! lattice's step: there the layer is thicker than that. A body is a set of core nodes that hang together, with the
//! nodes that are left within three steps of them. Its surface is where an implicit function is 0: outside of the part,
//! how far a place is above what tools leave; within, half a step below the part's surface, so that bodies and part
//! overlap and a union joins them.

use super::super::bvh::Bvh;
use super::super::triangle::nearest;
use super::grid::{Grid, Node};
use crate::exec::par;
use crate::geom::{Mesh, weld};
use glam::DVec3;
use std::collections::HashMap;

/// A body of what is left.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RestBody {
    /// Its surface, closed and outward; half a step of it is within the part.
    pub mesh: Mesh,
    /// Of what is outside of the part, mm³.
    pub volume_mm3: f64,
    /// Middle of that, mm.
    pub at_mm: DVec3,
}

/// The nodes of bodies, outside of the part, ascending by number.
pub struct Nodes {
    numbers: Vec<usize>,
    counts: [usize; 3],
}

/// Steps from core nodes to the rim of a body, where it is thin.
const GROWTH: usize = 3;
/// Nodes per task.
const TASK: usize = 4096;

impl Nodes {
    /// Of a grid.
    pub fn new(grid: &Grid, bvh: &Bvh) -> Self {
        let left = grid.left();
        let (counts, values, step) =
            (grid.lattice.counts, Values { grid, bvh }, grid.lattice.step_mm);
        let is_core = |at: &[usize; 3]| {
            let beside_part = || around(*at).any(|other| grid.node(other) == Node::Part);
            !beside_part() || values.to_removed(*at) + values.depth(grid.lattice.at(*at)) > step
        };
        let is_left = |at: &[usize; 3]| matches!(grid.node(*at), Node::Above(above) if above < 0.0);
        let core = par::map_blocks(left.len(), TASK, |range| {
            let core = left[range].iter().filter(|at| is_core(at));
            core.map(|at| number(counts, *at)).collect::<Vec<usize>>()
        });
        let mut numbers = sorted(core.into_iter().flatten().collect());
        for _ in 0..GROWTH {
            let near = par::map_blocks(numbers.len(), TASK, |range| {
                let beside = numbers[range].iter().flat_map(|n| around(place(counts, *n)));
                sorted(beside.filter(is_left).map(|at| number(counts, at)).collect())
            });
            numbers = sorted(near.into_iter().flatten().collect());
        }
        Nodes { numbers, counts }
    }

    /// The places of all nodes, mm.
    pub fn points(&self, grid: &Grid) -> Vec<DVec3> {
        self.numbers.iter().map(|n| grid.lattice.at(place(self.counts, *n))).collect()
    }

    /// Volume of all bodies, mm³.
    pub fn volume_mm3(&self, grid: &Grid, bvh: &Bvh) -> f64 {
        // Never minus zero.
        self.volumes(grid, bvh).iter().sum::<f64>() + 0.0
    }

    /// The volume of each node, mm³: of the cubes about it, the nodes in the part and those that are removed beside it
    /// what is between the surface of the part and that of what is left. A surface at a distance x from a node leaves
    /// `1/2 + x/step` of its cube, 0 to 1.
    fn volumes(&self, grid: &Grid, bvh: &Bvh) -> Vec<f64> {
        let (counts, values, step) = (self.counts, Values { grid, bvh }, grid.lattice.step_mm);
        let share = |x: f64| (0.5 + x / step).clamp(0.0, 1.0);
        let find = |n: usize| self.numbers.binary_search(&n).ok();
        let of = |n: &usize| {
            let at = place(counts, *n);
            let Node::Above(above) = grid.node(at) else { return 0.0 };
            let is_part = |at: [usize; 3]| grid.node(at) == Node::Part;
            let distance = match around(at).any(is_part) {
                true => values.depth(grid.lattice.at(at)),
                false => step,
            };
            let own = share(-f64::from(above)) - share(-distance);
            // Of a node beside several, the first has it.
            let is_first = |other: &[usize; 3]| {
                around(*other).map(|at| number(counts, at)).find(|n| find(*n).is_some()) == Some(*n)
            };
            let beside = around(at).filter(|other| find(number(counts, *other)).is_none());
            let beside = beside.filter(is_first).map(|other| match grid.node(other) {
                Node::Part => share(-values.depth(grid.lattice.at(other))),
                Node::Above(above) if above >= 0.0 => share(-f64::from(above)),
                _ => 0.0,
            });
            own + beside.sum::<f64>()
        };
        let cube = step.powi(3);
        let blocks = par::map_blocks(self.numbers.len(), TASK, |range| {
            self.numbers[range].iter().map(|n| cube * of(n)).collect::<Vec<f64>>()
        });
        blocks.into_iter().flatten().collect()
    }

    /// The bodies, the largest first.
    pub fn bodies(&self, grid: &Grid, bvh: &Bvh) -> Vec<RestBody> {
        let (counts, values) = (self.counts, Values { grid, bvh });
        // With the skin within the part.
        let skin = par::map_blocks(self.numbers.len(), TASK, |range| {
            let beside = self.numbers[range].iter().flat_map(|n| around(place(counts, *n)));
            let inner = beside.filter(|at| grid.node(*at) == Node::Part);
            sorted(inner.map(|at| number(counts, at)).collect())
        });
        let skin = sorted(skin.into_iter().flatten().collect());
        let value = |n: &usize| values.at(place(counts, *n));
        let of_nodes = of_each(&self.numbers, value);
        let mut within: Vec<(usize, f64)> = of_each(&skin, value)
            .into_iter()
            .zip(&skin)
            .filter(|(value, _)| *value > 0.0)
            .map(|(value, n)| (*n, value))
            .collect();
        within.extend(self.numbers.iter().copied().zip(of_nodes));
        within.sort_unstable_by_key(|(n, _)| *n);
        let (body_of, n_bodies) = components(&within, counts);
        let find = |n: usize| within.binary_search_by_key(&n, |(n, _)| *n).ok();
        // Nodes of one cell are of one body.
        let mut cells: Vec<(usize, u32)> = Vec::with_capacity(2 * within.len());
        for ((n, _), body) in within.iter().zip(&body_of) {
            cells.extend((0..8).map(|corner| (n - number(counts, offset(corner)), *body)));
        }
        cells.sort_unstable();
        cells.dedup();
        let corners_of = |cell: usize| -> [usize; 8] {
            std::array::from_fn(|corner| cell + number(counts, offset(corner)))
        };
        let beyond = cells.iter().flat_map(|(cell, _)| corners_of(*cell));
        let beyond = sorted(beyond.filter(|n| find(*n).is_none()).collect());
        let of_beyond = of_each(&beyond, |n| -values.at(place(counts, *n)).abs());
        let mut surfaces: Vec<Surface> = (0..n_bodies).map(|_| Surface::default()).collect();
        for (cell, body) in &cells {
            let numbers = corners_of(*cell);
            let at = numbers.map(|n| grid.lattice.at(place(counts, n)));
            let of = numbers.map(|n| match (find(n), beyond.binary_search(&n)) {
                (Some(k), _) => within[k].1,
                (None, Ok(k)) => of_beyond[k],
                (None, Err(_)) => -grid.lattice.step_mm,
            });
            surfaces[*body as usize].add_cell(&numbers, &at, &of);
        }
        let mut sums = vec![(0.0, 0usize, DVec3::ZERO); n_bodies];
        for (n, volume) in self.numbers.iter().zip(self.volumes(grid, bvh)) {
            let body = find(*n).map_or(0, |k| body_of[k]);
            let (volumes, n_nodes, sum) = &mut sums[body as usize];
            *volumes += volume;
            *n_nodes += 1;
            *sum += grid.lattice.at(place(counts, *n));
        }
        let body = |(surface, (volume_mm3, n, sum)): (Surface, (f64, usize, DVec3))| RestBody {
            mesh: surface.mesh,
            volume_mm3,
            at_mm: sum / n as f64,
        };
        let mut bodies: Vec<RestBody> = surfaces.into_iter().zip(sums).map(body).collect();
        bodies.sort_by(|a, b| b.volume_mm3.total_cmp(&a.volume_mm3));
        bodies
    }
}

/// Of every node, ascending by number, which set of nodes it hangs together with, side by side or in a corner; and
/// how many such sets there are.
fn components(nodes: &[(usize, f64)], counts: [usize; 3]) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..nodes.len() as u32).collect();
    for (k, (n, _)) in nodes.iter().enumerate() {
        for other in around(place(counts, *n)).map(|at| number(counts, at)).filter(|o| o < n) {
            if let Ok(other) = nodes.binary_search_by_key(&other, |(n, _)| *n) {
                weld::join(&mut parent, k as u32, other as u32);
            }
        }
    }
    let mut body = vec![u32::MAX; nodes.len()];
    let mut n_bodies = 0;
    for k in 0..nodes.len() {
        let root = weld::root(&mut parent, k as u32) as usize;
        if body[root] == u32::MAX {
            body[root] = n_bodies;
            n_bodies += 1;
        }
        body[k] = body[root];
    }
    (body, n_bodies as usize)
}

fn of_each(numbers: &[usize], value: impl Fn(&usize) -> f64 + Sync) -> Vec<f64> {
    let blocks = par::map_blocks(numbers.len(), TASK, |range| {
        numbers[range].iter().map(&value).collect::<Vec<f64>>()
    });
    blocks.into_iter().flatten().collect()
}

/// Ascending, each once.
fn sorted(mut numbers: Vec<usize>) -> Vec<usize> {
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

fn number([nx, ny, _]: [usize; 3], [i, j, k]: [usize; 3]) -> usize {
    (k * ny + j) * nx + i
}

fn place([nx, ny, _]: [usize; 3], n: usize) -> [usize; 3] {
    [n % nx, n / nx % ny, n / nx / ny]
}

/// The places from one before to one behind along each axis; there are such, as outermost nodes are never left.
fn around([i, j, k]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..27).map(move |n| [i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1])
}

/// Of a corner of a cell.
fn offset(corner: usize) -> [usize; 3] {
    [corner & 1, corner >> 1 & 1, corner >> 2 & 1]
}

/// The implicit function of bodies, mm: positive within.
struct Values<'a> {
    grid: &'a Grid,
    bvh: &'a Bvh,
}

/// Values nearer to 0 than this share of a step are moved away from it, so that no triangle shrinks to a point.
const LEAST: f64 = 0.02;

impl Values<'_> {
    /// At a node of a body, of the part, or, whatever its sign, beyond.
    fn at(&self, at: [usize; 3]) -> f64 {
        let (step, p) = (self.grid.lattice.step_mm, self.grid.lattice.at(at));
        let within_stock = self.grid.within_stock(p);
        let value = match self.grid.node(at) {
            // Half a step below the surface.
            Node::Part => (0.5 * step - self.depth(p)).min(within_stock),
            Node::Removed => -if within_stock < 0.0 { -within_stock } else { step },
            Node::Above(above) => (-f64::from(above)).min(within_stock),
        };
        let sign = if value > 0.0 { 1.0 } else { -1.0 };
        sign * value.abs().clamp(LEAST * step, step)
    }

    /// How far a node that is left is from what is removed, at most a step, mm: along the lattice's edges and
    /// diagonals, between values clipped to a step.
    fn to_removed(&self, at: [usize; 3]) -> f64 {
        let (step, own) = (self.grid.lattice.step_mm, self.at(at));
        let to = |other: [usize; 3]| {
            let value = match self.grid.node(other) {
                Node::Part => return step,
                _ => -self.at(other),
            };
            let apart = self.grid.lattice.at(at).distance(self.grid.lattice.at(other));
            if value > 0.0 { apart * own / (own + value) } else { step }
        };
        around(at).map(to).fold(step, f64::min)
    }

    /// How far a point is from the surface of the part, at most a step, mm.
    fn depth(&self, p: DVec3) -> f64 {
        let mut depth = self.grid.lattice.step_mm;
        self.bvh.near(p, depth, |place| {
            depth = depth.min(nearest(p, self.bvh.triangle(place)).distance(p));
            false
        });
        depth
    }
}

/// A surface by tetrahedra.
#[derive(Default)]
struct Surface {
    mesh: Mesh,
    /// The vertex on every edge, by its lower node and its way to the other.
    of_edge: HashMap<(usize, usize), u32>,
}

/// A cell in tetrahedra from its first corner to its last along three axes, all turned alike.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
/// Even orders of a tetrahedron's corners: by the one that is alone.
const ALONE: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]];
/// The same, by the two that are together.
const PAIRS: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];

impl Surface {
    fn add_cell(&mut self, numbers: &[usize; 8], at: &[DVec3; 8], values: &[f64; 8]) {
        let inside: u32 = (0..8).map(|k| u32::from(values[k] > 0.0) << k).sum();
        if inside == 0 || inside == 255 {
            return;
        }
        for corners in TETRAHEDRA {
            let within: Vec<usize> = (0..4).filter(|k| values[corners[*k]] > 0.0).collect();
            let mut edge = |a: usize, b: usize| {
                let [a, b] = if corners[a] < corners[b] {
                    [corners[a], corners[b]]
                } else {
                    [corners[b], corners[a]]
                };
                *self.of_edge.entry((numbers[a], b - a)).or_insert_with(|| {
                    let share = values[a] / (values[a] - values[b]);
                    self.mesh.vertices.push(at[a].lerp(at[b], share));
                    self.mesh.vertices.len() as u32 - 1
                })
            };
            match within[..] {
                [alone] => {
                    let [a, b, c, d] = ALONE[alone];
                    let triangle = [edge(a, b), edge(a, c), edge(a, d)];
                    self.mesh.triangles.push(triangle);
                }
                [_, _, _] => {
                    let alone = 6 - within.iter().sum::<usize>();
                    let [a, b, c, d] = ALONE[alone];
                    let triangle = [edge(a, b), edge(a, d), edge(a, c)];
                    self.mesh.triangles.push(triangle);
                }
                [first, second] => {
                    let is_pair = |order: &&[usize; 4]| order[0] == first && order[1] == second;
                    let Some(&[a, b, c, d]) = PAIRS.iter().find(is_pair) else { continue };
                    let [ac, ad, bd, bc] = [edge(a, c), edge(a, d), edge(b, d), edge(b, c)];
                    self.mesh.triangles.extend([[ac, ad, bd], [ac, bd, bc]]);
                }
                _ => {}
            }
        }
    }
}
