//! Upper estimates of what pictures, pages and findings take: what does not fit into the memory is refused before it is
//! begun.

use super::raster::{Fragment, Surface};
use crate::Result;
use crate::exec::memory::{product, require};
use crate::geom::{Mesh, Sites};

/// The views, the picture and its file.
const IMAGES_BYTES: u64 = 20 << 20;
/// A triangle that is drawn: 48 for corners and normals; while these are made, 12 each for its area, its normal and
/// lists of the faces at corners.
const TRIANGLE_BYTES: usize = 96;
/// A vertex: 24, as many in the picture, 8 for those lists.
const VERTEX_BYTES: usize = 64;
/// A site in the grid where colors are looked up: 40.
const SITE_BYTES: usize = 64;
/// A site that is drawn as a disc: 8 corners of 24 + 24, 6 triangles of 48.
const DISC_BYTES: usize = 704;
/// A triangle of a glTF file: 3 corners of 40, twice 96 of the file, and what holds these.
const GLTF_TRIANGLE_BYTES: usize = 384;
/// A triangle of a page, by its three vertices: the surface, their numbers by place and normal, and as numbers of the
/// page.
const PAGE_TRIANGLE_BYTES: usize = 768;
/// A site of a page: its place and normal as numbers of the page, its area, and the tree that finds that.
const PAGE_SITE_BYTES: usize = 256;
/// A byte of numbers: in a block that doubles when it is full, deflated, in base64, in the page.
const PAGE_NUMBER_BYTES: usize = 8;
/// Scripts, styles and tables of a page.
const PAGE_WORDS_BYTES: u64 = 4 << 20;

/// How much there is to draw.
#[derive(Clone, Copy)]
pub struct PartSize {
    n_sites: usize,
    n_triangles: usize,
    n_vertices: usize,
}

impl PartSize {
    /// Of sites, and of the surface if there is one.
    pub fn of(mesh: Option<&Mesh>, sites: &Sites) -> Self {
        let (n_triangles, n_vertices) =
            mesh.map_or((0, 0), |mesh| (mesh.triangles.len(), mesh.vertices.len()));
        PartSize { n_sites: sites.len(), n_triangles, n_vertices }
    }

    fn bytes(&self, site: usize, triangle: usize, vertex: usize) -> u64 {
        let PartSize { n_sites, n_triangles, n_vertices } = *self;
        let terms = [(n_sites, site), (n_triangles, triangle), (n_vertices, vertex)];
        sum(terms.map(|(n, bytes)| product([n, bytes])))
    }

    /// Triangles that are drawn.
    pub fn n_drawn(&self) -> usize {
        match self.n_triangles {
            0 => Surface::n_triangles_of_sites(self.n_sites),
            n => n,
        }
    }

    /// The surface with its corners in the picture, and the sites by place; without a surface a disc for each site.
    fn drawn(&self) -> u64 {
        let site = if self.n_triangles > 0 { SITE_BYTES } else { DISC_BYTES };
        self.bytes(site, TRIANGLE_BYTES, VERTEX_BYTES)
    }

    /// A picture whose views have so many samples each.
    pub fn require_for_picture(&self, n_samples: usize) -> Result<()> {
        let samples = product([n_samples, size_of::<Fragment>()]);
        let needed = sum([self.drawn(), samples, IMAGES_BYTES]);
        require("the picture", needed, "draw no picture, or take fewer sites or a simpler mesh")
    }

    /// A glTF file of so many triangles.
    pub fn require_for_gltf(&self, n_triangles: usize) -> Result<()> {
        let needed = sum([self.drawn(), product([n_triangles, GLTF_TRIANGLE_BYTES])]);
        let remedy = "write no glTF file, or take fewer sites or a simpler mesh";
        require("the glTF file", needed, remedy)
    }

    /// A page with so many bytes of numbers in its tabs, and of findings.
    pub fn require_for_page(&self, n_number_bytes: usize, findings_bytes: u64) -> Result<()> {
        let needed = sum([
            self.bytes(PAGE_SITE_BYTES, PAGE_TRIANGLE_BYTES, VERTEX_BYTES),
            product([n_number_bytes, PAGE_NUMBER_BYTES]),
            findings_bytes,
            PAGE_WORDS_BYTES,
        ]);
        require("the page", needed, "write no page, or take fewer sites, tools or a simpler mesh")
    }
}

fn sum(terms: impl IntoIterator<Item = u64>) -> u64 {
    terms.into_iter().fold(0, u64::saturating_add)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_every_memory_is_refused() {
        let many = PartSize { n_sites: usize::MAX / 1000, n_triangles: 0, n_vertices: 0 };
        let few = PartSize { n_sites: 1000, ..many };
        for refused in [
            many.require_for_picture(100),
            many.require_for_gltf(many.n_drawn()),
            many.require_for_page(100, 1),
            few.require_for_picture(usize::MAX),
            few.require_for_gltf(usize::MAX),
            few.require_for_page(usize::MAX, 1),
            few.require_for_page(1, u64::MAX),
        ] {
            if cfg!(target_os = "linux") {
                let message = refused.unwrap_err().to_string();
                assert!(message.contains(" bytes, the limit is "), "{message}");
            }
        }
        few.require_for_picture(100).unwrap();
        few.require_for_page(1000, 10).unwrap();
    }
}
