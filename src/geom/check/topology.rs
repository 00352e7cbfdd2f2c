//! The topology of a mesh: which triangles meet at which edges and vertices.
//!
//! Triangles that use a corner twice have no sides to meet others at and are left out.

use crate::exec::par;
use crate::geom::Mesh;
use crate::geom::weld::{join, root};

/// One side of one triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Use {
    /// The edge's vertices, the lower index first.
    ends: [u32; 2],
    /// The triangle.
    pub(crate) face: u32,
    /// Which of its corners the side begins at.
    corner: u8,
    /// Whether the triangle passes the edge from the lower to the higher index.
    pub(crate) forward: bool,
}

impl Use {
    /// The edge's vertices, the lower index first.
    pub(crate) fn ends(&self) -> [u32; 2] {
        self.ends
    }

    /// Corners (3 × face + position) at the edge's lower and higher vertex.
    fn corners(&self) -> [u32; 2] {
        let here = 3 * self.face + u32::from(self.corner);
        let next = 3 * self.face + u32::from((self.corner + 1) % 3);
        if self.forward { [here, next] } else { [next, here] }
    }
}

/// All sides of all triangles, sorted by edge.
pub(crate) struct Topology {
    uses: Vec<Use>,
    n_triangles: usize,
}

impl Topology {
    pub(crate) fn of(mesh: &Mesh) -> Self {
        let mut uses = Vec::with_capacity(3 * mesh.triangles.len());
        for (face, triangle) in mesh.triangles.iter().enumerate() {
            if !has_three_corners(triangle) {
                continue;
            }
            for corner in 0..3 {
                let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
                let ends = [a.min(b), a.max(b)];
                let (face, corner) = (face as u32, corner as u8);
                uses.push(Use { ends, face, corner, forward: a < b });
            }
        }
        par::sort_by_key(&mut uses, |u| *u);
        Topology { uses, n_triangles: mesh.triangles.len() }
    }

    /// Whether no triangle has three different corners.
    pub(crate) fn is_empty(&self) -> bool {
        self.uses.is_empty()
    }

    /// The sides that meet at each edge, edge by edge.
    pub(crate) fn edges(&self) -> impl Iterator<Item = &[Use]> {
        self.uses.chunk_by(|a, b| a.ends == b.ends)
    }

    /// The edges that are not passed equally often in both directions: where the surface is open, or
    /// triangles face different sides.
    pub(crate) fn unbalanced(&self) -> impl Iterator<Item = &[Use]> {
        self.edges().filter(|uses| 2 * uses.iter().filter(|u| u.forward).count() != uses.len())
    }

    /// V − E + F over triangles with three different corners and the vertices they use.
    pub(crate) fn euler(&self, mesh: &Mesh) -> i64 {
        let mut used = vec![false; mesh.vertices.len()];
        self.uses.iter().flat_map(|u| u.ends).for_each(|v| used[v as usize] = true);
        let n_vertices = used.iter().filter(|u| **u).count() as i64;
        n_vertices - self.edges().count() as i64 + self.uses.len() as i64 / 3
    }

    /// The triangles of each piece that hangs together by edges; pieces by their first triangle.
    pub(crate) fn components(&self) -> Vec<Vec<u32>> {
        let mut parent: Vec<u32> = (0..self.n_triangles as u32).collect();
        for uses in self.edges() {
            uses.windows(2).for_each(|pair| join(&mut parent, pair[0].face, pair[1].face));
        }
        let mut number = vec![usize::MAX; self.n_triangles];
        let mut components: Vec<Vec<u32>> = Vec::new();
        let mut faces: Vec<u32> = self.uses.iter().map(|u| u.face).collect();
        faces.sort_unstable();
        faces.dedup();
        for face in faces {
            let root = root(&mut parent, face) as usize;
            if number[root] == usize::MAX {
                number[root] = components.len();
                components.push(Vec::new());
            }
            components[number[root]].push(face);
        }
        components
    }

    /// Vertices whose triangles do not all hang together by edges at that vertex.
    pub(crate) fn split_vertices(&self, mesh: &Mesh) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..3 * self.n_triangles as u32).collect();
        for uses in self.edges() {
            for pair in uses.windows(2) {
                let (first, second) = (pair[0].corners(), pair[1].corners());
                join(&mut parent, first[0], second[0]);
                join(&mut parent, first[1], second[1]);
            }
        }
        let mut fan = vec![u32::MAX; mesh.vertices.len()];
        let mut split = Vec::new();
        for (face, triangle) in mesh.triangles.iter().enumerate() {
            if !has_three_corners(triangle) {
                continue;
            }
            for (corner, vertex) in triangle.iter().enumerate() {
                let root = root(&mut parent, (3 * face + corner) as u32);
                let known = &mut fan[*vertex as usize];
                if *known == u32::MAX {
                    *known = root;
                } else if *known != root {
                    split.push(*vertex);
                }
            }
        }
        split.sort_unstable();
        split.dedup();
        split
    }
}

/// Whether no corner is used twice.
pub(crate) fn has_three_corners([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}
