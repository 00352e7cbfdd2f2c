//! What is requested, but for what is used up when the sites are placed.

use super::fixtures::Fixture;
use crate::access::LabelOptions;
use crate::access::surface::explain::Remedies;
use crate::access::surface::{ContactTolerance, SurfaceOptions};
use crate::data::files::settings::{Blocking, PartSettings, SiteSettings};
use crate::data::files::tools::Tool;
use crate::geom::sites::{Normals, SiteOptions, VertexNormals};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Written with [`Outcome`](super::Outcome)s, except for the fixtures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Request {
    pub part: String,
    pub is_cloud: bool,
    pub origin: Option<DVec3>,
    pub tools: Vec<Tool>,
    /// Whether each tool has a folder of its own.
    pub has_folders: bool,
    /// Whether the tools are those that there are.
    pub is_library: bool,
    pub sites: Placement,
    pub region: Option<Region>,
    pub obstacles: Option<Blocking>,
    /// Once the sites are placed, with the table as the last.
    #[serde(skip)]
    pub fixtures: Vec<Fixture>,
    pub table_z_mm: Option<f64>,
    pub prove: bool,
    pub rest: bool,
    pub options: SurfaceOptions,
    pub published: LabelOptions,
}

/// Where the sites are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Placement {
    Spread(SiteOptions),
    /// The corners of the mesh; the seed is that of further obstacles.
    Vertices {
        seed: u64,
        normals: VertexNormals,
    },
}

/// How a region is named in files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Region {
    pub only: Vec<String>,
    pub except: Vec<String>,
}

impl Request {
    /// What blocks.
    pub fn blocking(&self) -> Blocking {
        match self.is_cloud {
            true => Blocking::Points(None),
            false => self.obstacles.unwrap_or(Blocking::Part),
        }
    }

    /// Of proposals.
    pub fn remedies(&self) -> Remedies {
        Remedies { only_this_tool: self.is_library, ..Remedies::default() }
    }

    /// The seed of the sites.
    pub fn seed(&self) -> u64 {
        match self.sites {
            Placement::Spread(SiteOptions { seed, .. }) | Placement::Vertices { seed, .. } => seed,
        }
    }

    /// What files hold of the mesh definition's options.
    pub fn part_settings(&self) -> PartSettings {
        let options = &self.options;
        // The table is the last of them.
        let n_tables = usize::from(self.table_z_mm.is_some());
        let n_fixtures = self.fixtures.len().saturating_sub(n_tables);
        let fixtures = self.fixtures[..n_fixtures].iter().map(|fixture| fixture.name.clone());
        PartSettings {
            fixtures: fixtures.collect(),
            table_z_mm: self.table_z_mm,
            search: Some(options.refinement.map_or(0, |refinement| refinement.n_kept)),
            prove: self.prove,
            tolerance_mm: match options.tolerance {
                ContactTolerance::Millimeters(mm) | ContactTolerance::AtMost(mm) => Some(mm),
                ContactTolerance::Tessellation => None,
            },
            finish_mm: Some(options.finish_mm),
        }
    }

    /// What files hold of the sites.
    pub fn site_settings(&self) -> SiteSettings {
        if self.is_cloud {
            return SiteSettings::as_given();
        }
        match self.sites {
            Placement::Vertices { seed, normals } => {
                let by_area = normals == VertexNormals::Area;
                SiteSettings {
                    vertex_normals: by_area.then(|| normals.to_string()),
                    ..SiteSettings::spread("vertices".into(), seed, None)
                }
            }
            Placement::Spread(SiteOptions { n_sites, seed, normals }) => {
                let smooth_deg = match normals {
                    // Degrees as people write them.
                    Normals::Smooth { crease_rad } => {
                        Some((crease_rad.to_degrees() * 1e9).round() / 1e9)
                    }
                    Normals::Face => None,
                };
                SiteSettings::spread(n_sites.to_string(), seed, smooth_deg)
            }
        }
    }
}
