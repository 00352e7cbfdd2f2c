//! Parts and their sites.

use super::Args;
use crate::dataset::mesh_files;
use crate::output::Output;
use deepmill::data::generated;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites};
use deepmill::{Error, Result, par};

/// Seed of everything random.
pub const SEED: u64 = 1;

/// One part.
#[derive(Clone)]
pub struct Part {
    pub name: String,
    pub mesh: Mesh,
}

impl Part {
    /// Near-uniform sites, always the same.
    pub fn sites(&self, n_sites: usize) -> Result<Sites> {
        sample(&self.mesh, &SiteOptions::default().with_n_sites(n_sites).with_seed(SEED))
    }
}

/// Generated parts; the families take turns.
pub fn generate(n: u64) -> Vec<Part> {
    par::map(n as usize, |i| {
        let name = format!("{}-{i:04}", generated::family_of(i as u64).name());
        Part { name, mesh: generated::mixed_part(SEED, i as u64) }
    })
}

/// The user's meshes, in the order of their names.
pub fn read(args: &Args, output: &Output) -> Result<Vec<Part>> {
    let mut parts = Vec::new();
    for path in &args.parts {
        for file in mesh_files(path)? {
            let mesh = args.mesh.read_bodies(&file, false, output)?;
            let stem = file.file_stem().unwrap_or_default();
            parts.push(Part { name: stem.to_string_lossy().into_owned(), mesh });
        }
    }
    match parts.len() {
        0 | 1 => {
            let remedy = "one part is for training, another for testing";
            Err(Error::argument("--parts", parts.len(), "two meshes or more", remedy))
        }
        _ => Ok(parts),
    }
}
