//! Sample sites: near-uniform points on a surface, with outward normals.
//!
//! [`sample`] starts from a stratified placement ([`start`]) and lets the points repel each other
//! along the surface ([`relax`]) until their spacing is even; `docs/sites.md` says why and how well.

mod normals;
mod relax;
mod start;
mod surface;

use crate::geom::Mesh;
use crate::{Error, Result};
use glam::Vec3;
use surface::Surface;

/// Points on a surface with outward unit normals; all vectors have the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sites {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Outward unit normals.
    pub normals: Vec<Vec3>,
    /// Face each site lies on; empty for a point cloud without a mesh.
    pub faces: Vec<u32>,
}

impl Sites {
    /// Number of sites.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// Which normal a sampled site carries.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Normals {
    /// The outward normal of the face the site lies on.
    #[default]
    Face,
    /// For smooth parts: corner normals interpolated over the face. A corner's normal is the
    /// angle-weighted mean over the faces around it that are turned by less than `crease_rad`
    /// from the site's face, so edges sharper than that stay sharp.
    Smooth {
        /// Greatest angle between two faces that count as one smooth surface.
        crease_rad: f64,
    },
}

/// How [`sample`] places its sites.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SiteOptions {
    /// Number of sites, at least 1.
    pub n_sites: usize,
    /// Seed of the random stream (purpose [`Sites`](crate::rng::Purpose::Sites)).
    pub seed: u64,
    /// Which normal each site carries.
    pub normals: Normals,
}

impl Default for SiteOptions {
    /// 7,000 sites as in the paper, seed 0, face normals.
    fn default() -> Self {
        SiteOptions { n_sites: 7000, seed: 0, normals: Normals::Face }
    }
}

/// Most sites that [`sample`] accepts.
pub const MAX_SITES: usize = 50_000_000;

/// Near-uniform sites on `mesh`, the same for every thread count.
///
/// # Errors
/// If `n_sites` is 0 or above [`MAX_SITES`], a face names a missing vertex, a vertex is not finite,
/// or the mesh has no area.
pub fn sample(mesh: &Mesh, options: &SiteOptions) -> Result<Sites> {
    if options.n_sites == 0 || options.n_sites > MAX_SITES {
        let expected = format!("1 to {MAX_SITES}");
        return Err(Error::argument("sites", options.n_sites, expected, "choose another number"));
    }
    let surface = Surface::build(mesh)?;
    let mut places = start::place(&surface, options.n_sites, options.seed);
    relax::relax(&surface, &mut places);
    let normals = match options.normals {
        Normals::Face => places.iter().map(|p| surface.normals[p.face as usize]).collect(),
        Normals::Smooth { crease_rad } => normals::smooth(&surface, &places, crease_rad),
    };
    Ok(Sites {
        points: places.iter().map(|p| p.point.as_vec3()).collect(),
        normals: normals.iter().map(|n| n.as_vec3().normalize()).collect(),
        faces: places.iter().map(|p| p.face).collect(),
    })
}

/// The vertices of `mesh` as sites, in their order, for users who remesh themselves.
///
/// The normal is the mean of the normals of the faces around the vertex, weighted by their angle
/// there; the face is the one among these whose normal is nearest to it (ties: lowest index).
/// Vertices that no face with area uses are left out.
///
/// # Errors
/// As [`sample`].
pub fn from_vertices(mesh: &Mesh) -> Result<Sites> {
    let surface = Surface::build(mesh)?;
    Ok(normals::vertex_sites(&surface))
}
