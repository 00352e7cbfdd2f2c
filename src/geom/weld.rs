//! Welding: vertices closer than a tolerance become one.
//!
//! Corners within the tolerance of each other are one vertex, and so are those of a chain of such
//! pairs. The vertex lies on the least of its corners (by x, then y, then z), so neither the joining
//! nor its outcome depends on the order of the file (but see `CROWD`). Cost: O(n) expected, through a
//! grid of cells a few tolerances wide.

use super::Mesh;
use super::mesh::WITHIN_1E12_MM;
use crate::{Error, Result};
use glam::DVec3;
use std::collections::HashMap;

/// Default tolerance, as a fraction of the bounding box's diagonal. Of the parts we tried, those
/// with gaps close anywhere from 1e-9 to 1e-5, and the first detail is lost at 1e-4; f32 files
/// round at 6e-8.
pub const DEFAULT_TOLERANCE: f64 = 1e-6;

/// Width of a grid cell in tolerances: wide enough that most points need to look into one only.
const CELL: f64 = 8.0;
/// Points of a cell that are compared with a new one. Parts have one or two in a cell; this keeps a
/// hostile file with a million points in one from taking forever.
const CROWD: usize = 256;

/// The mesh with corners joined that lie within `tolerance` times the diagonal of each other.
///
/// Triangles keep their order and number, so some may have a corner twice now. Vertices keep their order, each in the
/// place of the first that a triangle uses; vertices without a triangle are left out.
///
/// # Errors
/// If the tolerance is not a number from 0 to 1, a face names a missing vertex, or a vertex is not finite or beyond
/// 10¹² mm.
pub fn weld(mesh: &Mesh, tolerance: f64) -> Result<Mesh> {
    weld_with_map(mesh, tolerance).map(|(welded, _)| welded)
}

/// [`weld`], and per vertex the one that it has become; `u32::MAX` for those that no triangle uses.
///
/// # Errors
/// As [`weld`].
pub(crate) fn weld_with_map(mesh: &Mesh, tolerance: f64) -> Result<(Mesh, Vec<u32>)> {
    if !(0.0..=1.0).contains(&tolerance) {
        let expected = "a fraction of the diagonal, 0 to 1";
        return Err(Error::argument("weld", tolerance, expected, "1e-6 suits most files"));
    }
    mesh.check_within(&WITHIN_1E12_MM)?;
    let vertices: Vec<DVec3> = mesh.vertices.iter().map(|v| *v + 0.0).collect();
    let (distinct, of_vertex) = distinct(&vertices);
    let cluster = clusters(&distinct, tolerance * mesh.diagonal());
    let mut place = vec![None::<DVec3>; distinct.len()];
    for (point, root) in distinct.iter().zip(&cluster) {
        let least = &mut place[*root as usize];
        *least = Some(least.map_or(*point, |l| if precedes(*point, l) { *point } else { l }));
    }
    let mut used = vec![false; vertices.len()];
    mesh.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
    let mut new_index = vec![u32::MAX; distinct.len()];
    let mut welded = Mesh::default();
    let mut map = vec![u32::MAX; vertices.len()];
    for (v, _) in used.iter().enumerate().filter(|(_, used)| **used) {
        let root = cluster[of_vertex[v] as usize] as usize;
        if new_index[root] == u32::MAX {
            new_index[root] = welded.vertices.len() as u32;
            welded.vertices.extend(place[root]);
        }
        map[v] = new_index[root];
    }
    welded.triangles = mesh.triangles.iter().map(|t| t.map(|v| map[v as usize])).collect();
    Ok((welded, map))
}

fn precedes(a: DVec3, b: DVec3) -> bool {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)).is_lt()
}

/// The different positions in order of appearance, and which one each vertex has.
fn distinct(vertices: &[DVec3]) -> (Vec<DVec3>, Vec<u32>) {
    let mut known = HashMap::with_capacity(vertices.len() / 2);
    let mut distinct = Vec::new();
    let index = vertices.iter().map(|v| {
        *known.entry(v.to_array().map(f64::to_bits)).or_insert_with(|| {
            distinct.push(*v);
            distinct.len() as u32 - 1
        })
    });
    let index = index.collect();
    (distinct, index)
}

/// For every point the representative (lowest index) of its chain of near neighbors.
fn clusters(points: &[DVec3], distance: f64) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..points.len() as u32).collect();
    if !(distance > 0.0 && distance.is_finite()) {
        return parent;
    }
    let cell = |p: DVec3| (p / (CELL * distance)).floor().to_array().map(|c| c as i64);
    // A little more than the distance, so that rounding never hides a neighboring cell.
    let reach = DVec3::splat(1.001 * distance);
    let mut last_of_cell: HashMap<[i64; 3], u32> = HashMap::with_capacity(points.len());
    let mut previous = vec![u32::MAX; points.len()];
    for (i, point) in points.iter().enumerate() {
        let (low, high) = (cell(*point - reach), cell(*point + reach));
        let cells = (low[0]..=high[0]).flat_map(|x| {
            (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z]))
        });
        for key in cells {
            let mut other = last_of_cell.get(&key).copied().unwrap_or(u32::MAX);
            for _ in 0..CROWD {
                let Some(position) = points.get(other as usize) else { break };
                if position.distance(*point) <= distance {
                    join(&mut parent, other, i as u32);
                }
                other = previous[other as usize];
            }
        }
        if let Some(before) = last_of_cell.insert(cell(*point), i as u32) {
            previous[i] = before;
        }
    }
    (0..points.len() as u32).map(|i| root(&mut parent, i)).collect()
}

pub(crate) fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

pub(crate) fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::torus;
    use crate::numeric::rng::{Purpose, Stream};

    /// Every triangle with corners of its own, each moved by at most `noise` mm.
    fn soup(mesh: &Mesh, noise: f64) -> Mesh {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let mut soup = Mesh::default();
        for f in 0..mesh.triangles.len() {
            let n = soup.vertices.len() as u32;
            soup.triangles.push([n, n + 1, n + 2]);
            for corner in mesh.corners(f) {
                let mut shift = || stream.range(-noise, noise) / 2.0;
                soup.vertices.push(corner + DVec3::new(shift(), shift(), shift()));
            }
        }
        soup
    }

    #[test]
    fn a_noisy_soup_becomes_the_torus_it_was() {
        let torus = torus(3.0, 1.0, 30, 20);
        for (noise, tolerance) in [(0.0, 0.0), (0.0, 1e-6), (1e-6, 1e-6), (1e-4, 1e-4)] {
            let welded = weld(&soup(&torus, noise), tolerance).unwrap();
            assert_eq!(welded.vertices.len(), torus.vertices.len());
            assert_eq!(welded.triangles.len(), torus.triangles.len());
            assert!((welded.volume() / torus.volume() - 1.0).abs() < 1e-3);
        }
        assert_eq!(
            weld(&soup(&torus, 1e-6), 0.0).unwrap().vertices.len(),
            3 * torus.triangles.len()
        );
    }

    #[test]
    fn the_order_of_triangles_does_not_change_the_vertices() {
        let mut soup = soup(&torus(3.0, 1.0, 12, 9), 1e-5);
        let sorted = |mesh: &Mesh| {
            let mut vertices: Vec<_> = mesh.vertices.iter().map(|v| v.to_array()).collect();
            vertices.sort_by(|a, b| a.partial_cmp(b).unwrap());
            vertices
        };
        let before = sorted(&weld(&soup, 1e-4).unwrap());
        soup.triangles.reverse();
        soup.vertices.reverse();
        let n = soup.vertices.len() as u32 - 1;
        soup.triangles.iter_mut().flatten().for_each(|v| *v = n - *v);
        assert_eq!(sorted(&weld(&soup, 1e-4).unwrap()), before);
    }

    #[test]
    fn neighbors_are_joined_across_cell_borders_and_signs_of_zero() {
        let vertices = vec![
            DVec3::new(0.0, 0.0, 0.0),
            DVec3::new(-0.0, -2.7e-16, 1e-9),
            DVec3::new(10.0, 0.0, 0.0),
            DVec3::new(0.0, 10.0, 0.0),
            DVec3::new(5.0, 5.0, 5.0),
        ];
        let mesh = Mesh { vertices, triangles: vec![[0, 2, 3], [1, 3, 2]] };
        let welded = weld(&mesh, 1e-6).unwrap();
        assert_eq!(welded.triangles, [[0, 1, 2], [0, 2, 1]]);
        assert_eq!(welded.vertices.len(), 3);
    }

    #[test]
    fn vertices_keep_their_order_whatever_the_order_of_the_faces() {
        // Vertex 1 is unused, 4 repeats 2, and the faces begin at the end.
        let xs = [3.0, 9.0, 1.0, 2.0, 1.0, 5.0];
        let vertices = xs.map(|x| DVec3::new(x, x * x, 0.0)).to_vec();
        let mesh = Mesh { vertices, triangles: vec![[5, 4, 3], [3, 2, 0]] };
        let (welded, map) = weld_with_map(&mesh, 1e-6).unwrap();
        let found: Vec<f64> = welded.vertices.iter().map(|v| v.x).collect();
        assert_eq!(found, [3.0, 1.0, 2.0, 5.0]);
        assert_eq!(welded.triangles, [[3, 1, 2], [2, 1, 0]]);
        assert_eq!(map, [0, u32::MAX, 1, 2, 1, 3]);
    }

    #[test]
    fn missing_vertices_and_impossible_tolerances_are_refused() {
        let mut mesh = crate::geom::solids::cuboid(DVec3::ONE);
        for tolerance in [-1.0, f64::NAN, 1.1, f64::INFINITY] {
            assert!(weld(&mesh, tolerance).unwrap_err().to_string().starts_with("weld is"));
        }
        mesh.triangles[2][0] = 8;
        assert!(weld(&mesh, 0.0).unwrap_err().to_string().starts_with("face 2"));
    }
}
