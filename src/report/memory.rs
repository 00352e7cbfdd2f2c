//! Upper estimates of what pictures, pages and findings take: what does not fit into the memory is refused before it is begun.

use super::findings::Finding;
use super::raster::{Fragment, Surface};
use crate::Result;
use crate::geom::{Mesh, Sites};
use crate::memory::{product, require};

/// Views, pixels and the file of a picture.
const IMAGES_BYTES: u64 = 20 << 20;
/// Scripts and styles of a page, and the words of its tables.
const WORDS_BYTES: u64 = 4 << 20;
/// A finding among all, while they are sorted, and as JSON.
const FINDING_BYTES: usize = 4 * size_of::<Finding>();
const FINDING_JSON_BYTES: usize = 4096;

/// How much there is to draw.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    n_sites: usize,
    n_triangles: usize,
    n_vertices: usize,
}

impl Extent {
    /// Of sites, and of the surface if there is one.
    pub fn of(mesh: Option<&Mesh>, sites: &Sites) -> Self {
        let (n_triangles, n_vertices) =
            mesh.map_or((0, 0), |mesh| (mesh.triangles.len(), mesh.vertices.len()));
        Extent { n_sites: sites.len(), n_triangles, n_vertices }
    }

    fn bytes(&self, of_site: usize, of_triangle: usize, of_vertex: usize) -> u64 {
        let Extent { n_sites, n_triangles, n_vertices } = *self;
        sum([
            product([n_sites, of_site]),
            product([n_triangles, of_triangle]),
            product([n_vertices, of_vertex]),
        ])
    }

    /// Triangles that are drawn.
    pub fn n_drawn(&self) -> usize {
        match self.n_triangles {
            0 => Surface::n_triangles_of_sites(self.n_sites),
            n => n,
        }
    }

    /// What is drawn, with its corners in the picture: the surface and the sites by place, or else a disc for each site.
    fn surface(&self) -> u64 {
        self.bytes(if self.n_triangles > 0 { 64 } else { 704 }, 96, 64)
    }

    /// A picture that is made of so many samples at a time.
    pub fn require_for_picture(&self, n_samples: usize) -> Result<()> {
        let samples = product([n_samples, size_of::<Fragment>()]);
        let needed = sum([self.surface(), samples, IMAGES_BYTES]);
        require("the picture", needed, "draw no picture, or take fewer sites or a simpler mesh")
    }

    /// A glTF file of so many triangles.
    pub fn require_for_gltf(&self, n_triangles: usize) -> Result<()> {
        let needed = self.surface().saturating_add(product([n_triangles, 384]));
        require(
            "the glTF file",
            needed,
            "write no glTF file, or take fewer sites or a simpler mesh",
        )
    }

    /// A page with so many bytes of numbers in its tabs, and findings.
    pub fn require_for_page(&self, n_bytes: usize, n_findings: usize) -> Result<()> {
        let needed = sum([
            self.bytes(256, 768, 64),
            product([n_bytes, 8]),
            product([n_findings, FINDING_JSON_BYTES]),
            WORDS_BYTES,
        ]);
        require("the page", needed, "write no page, or take fewer sites, tools or a simpler mesh")
    }

    /// Regions of sites, before it is known how many.
    pub fn require_for_regions(&self) -> Result<()> {
        require("finding the regions", self.bytes(256, 64, 0), "take fewer sites")
    }
}

/// So many regions, before they are described.
pub(super) fn require_for_findings(n_regions: usize) -> Result<()> {
    require("the findings", product([n_regions, FINDING_BYTES]), "take fewer sites")
}

/// The files of so many findings.
pub(super) fn require_for_findings_files(n_findings: usize) -> Result<()> {
    let needed = product([n_findings, FINDING_JSON_BYTES]);
    require("writing the findings", needed, "take fewer sites")
}

fn sum(terms: impl IntoIterator<Item = u64>) -> u64 {
    terms.into_iter().fold(0, u64::saturating_add)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_every_memory_is_refused() {
        let many = Extent { n_sites: usize::MAX / 1000, n_triangles: 0, n_vertices: 0 };
        let few = Extent { n_sites: 1000, ..many };
        for refused in [
            many.require_for_picture(100),
            many.require_for_gltf(many.n_drawn()),
            many.require_for_page(100, 1),
            many.require_for_regions(),
            few.require_for_picture(usize::MAX),
            few.require_for_gltf(usize::MAX),
            few.require_for_page(usize::MAX, 1),
            few.require_for_page(1, usize::MAX),
            require_for_findings(usize::MAX / 2),
            require_for_findings_files(usize::MAX / 2),
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
