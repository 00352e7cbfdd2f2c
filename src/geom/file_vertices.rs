//! The vertices of a mesh file beside those of the mesh that was made of it.
//!
//! Reading joins vertices and leaves out those that no face uses; repairs and unions of bodies drop vertices and make
//! new ones. A vertex keeps its place to the bit meanwhile, so it is found again by its place.

use super::{Mesh, origin};
use glam::DVec3;
use std::collections::HashMap;

/// In [`SiteVertices`]: no vertex, no site.
pub const NONE: i64 = -1;

/// The vertices of a file, each with its place in the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct FileVertices {
    /// The vertices of the mesh as it was read, mm.
    places: Vec<DVec3>,
    /// Per vertex of the file the number of its place; `u32::MAX` if no face uses it.
    of_vertex: Vec<u32>,
}

/// Which sites are at which vertices of a file, counted from 0.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SiteVertices {
    /// Per site, the first vertex of the file that is there, or [`NONE`].
    pub vertex_index: Vec<i64>,
    /// Per vertex of the file, the site that is there; [`NONE`] if no face with an area uses the vertex.
    pub site_of_vertex: Vec<i64>,
}

impl FileVertices {
    /// Of a mesh as it was read: `of_vertex` has per vertex of the file that of the mesh, `u32::MAX` for none.
    pub(crate) fn new(mesh: &Mesh, of_vertex: Vec<u32>) -> Self {
        FileVertices { places: mesh.vertices.clone(), of_vertex }
    }

    /// Number of vertices of the file.
    pub fn len(&self) -> usize {
        self.of_vertex.len()
    }

    /// Whether the file has none.
    pub fn is_empty(&self) -> bool {
        self.of_vertex.is_empty()
    }

    /// As [`origin::make_relative`].
    pub fn make_relative(&mut self, at: DVec3) {
        let vertices = std::mem::take(&mut self.places);
        let mut mesh = Mesh { vertices, triangles: Vec::new() };
        origin::make_relative(&mut mesh, at);
        self.places = mesh.vertices;
    }

    /// The order in which sites at `points` have that of the file, those that it lacks last, and the vertices of the
    /// sites in that order.
    pub fn of_sites(&self, points: &[DVec3]) -> (Vec<usize>, SiteVertices) {
        let key = |p: &DVec3| (*p + DVec3::ZERO).to_array().map(f64::to_bits);
        let mut site_at = HashMap::with_capacity(points.len());
        for (i, point) in points.iter().enumerate() {
            site_at.entry(key(point)).or_insert(i);
        }
        let of_place: Vec<Option<usize>> =
            self.places.iter().map(|p| site_at.get(&key(p)).copied()).collect();
        let of_vertex = |v: usize| of_place.get(self.of_vertex[v] as usize).copied().flatten();
        let mut first = vec![NONE; points.len()];
        for v in 0..self.len() {
            if let Some(site) = of_vertex(v).filter(|&site| first[site] == NONE) {
                first[site] = v as i64;
            }
        }
        let mut order: Vec<usize> = (0..points.len()).collect();
        // As unsigned numbers NONE is the greatest.
        order.sort_by_key(|&site| first[site] as u64);
        let mut row = vec![NONE; points.len()];
        order.iter().enumerate().for_each(|(k, &site)| row[site] = k as i64);
        let vertices = SiteVertices {
            vertex_index: order.iter().map(|&site| first[site]).collect(),
            site_of_vertex: (0..self.len())
                .map(|v| of_vertex(v).map_or(NONE, |s| row[s]))
                .collect(),
        };
        (order, vertices)
    }
}

impl SiteVertices {
    /// The first entry that names a site or vertex which there is not, or a site that is not that of its vertex.
    pub(crate) fn fault(&self) -> Option<(&'static str, usize)> {
        let (n_sites, n_vertices) = (self.vertex_index.len(), self.site_of_vertex.len());
        let within = |x: &i64, n: usize| *x == NONE || usize::try_from(*x).is_ok_and(|x| x < n);
        if let Some(v) = self.site_of_vertex.iter().position(|site| !within(site, n_sites)) {
            return Some(("site_of_vertex", v));
        }
        let fits = |(i, v): (usize, &i64)| match usize::try_from(*v) {
            Ok(v) => v < n_vertices && self.site_of_vertex[v] == i as i64,
            Err(_) => *v == NONE,
        };
        let fault = self.vertex_index.iter().enumerate().position(|pair| !fits(pair));
        fault.map(|i| ("vertex_index", i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    const UNUSED: u32 = u32::MAX;

    /// Vertices 0 and 3 are one, 1 is unused; the mesh lists those used in another order.
    fn file() -> FileVertices {
        let places = vec![dvec3(5.0, 0.0, 0.0), dvec3(-0.0, 0.0, 0.0), dvec3(0.0, 7.0, 0.0)];
        FileVertices { places, of_vertex: vec![1, UNUSED, 2, 1, 0] }
    }

    #[test]
    fn sites_come_in_the_order_of_the_file_and_name_its_first_vertex() {
        let new = dvec3(1.0, 1.0, 1.0);
        let points = [new, dvec3(5.0, 0.0, 0.0), dvec3(0.0, 7.0, 0.0), DVec3::ZERO];
        let (order, vertices) = file().of_sites(&points);
        assert_eq!(order, [3, 2, 1, 0]);
        assert_eq!(vertices.vertex_index, [0, 2, 4, NONE]);
        assert_eq!(vertices.site_of_vertex, [0, NONE, 1, 0, 2]);
        assert_eq!(vertices.fault(), None);
        let (_, without) = file().of_sites(&points[..2]);
        assert_eq!(without.site_of_vertex, [NONE, NONE, NONE, NONE, 0]);
    }

    #[test]
    fn vertices_of_a_part_far_away_are_found_about_its_local_origin() {
        let at = dvec3(10_000.25, 0.0, 0.0);
        let mut far = file();
        far.places.iter_mut().for_each(|p| *p += at);
        far.make_relative(at);
        let points = [DVec3::ZERO, dvec3(5.0, 0.0, 0.0)];
        assert_eq!(far.of_sites(&points).1.vertex_index, [0, 4]);
    }

    #[test]
    fn numbers_that_name_nothing_or_contradict_each_other_are_found() {
        let good = SiteVertices { vertex_index: vec![0, 2], site_of_vertex: vec![0, NONE, 1] };
        assert_eq!(good.fault(), None);
        for (vertex_index, site_of_vertex, fault) in [
            (vec![0, 2], vec![0, NONE, 2], ("site_of_vertex", 2)),
            (vec![0, 2], vec![0, -2, 1], ("site_of_vertex", 1)),
            (vec![0, 3], vec![0, NONE, 1], ("vertex_index", 1)),
            (vec![0, i64::MIN], vec![0, NONE, 1], ("vertex_index", 1)),
            (vec![2, 0], vec![0, NONE, 1], ("vertex_index", 0)),
        ] {
            assert_eq!(SiteVertices { vertex_index, site_of_vertex }.fault(), Some(fault));
        }
    }
}
