//! Pictures: cameras, rasters, colors, sections, curves.

mod camera;
pub mod color;
pub mod curves;
pub mod image;
pub mod memory;
pub mod outlines;
pub mod paint;
pub mod picture;
pub mod raster;
pub mod section;
mod shade;

pub use color::{Class, Coloring, DARK_AND_LIGHT, Rgb};

use crate::geom::{Mesh, Sites};
use glam::DVec3;

/// What a picture or a point file shows.
#[derive(Debug, Clone, Copy)]
pub struct PartView<'a> {
    /// Name for titles, usually the file's.
    pub name: &'a str,
    /// The surface, mm; without it the sites are drawn as small discs.
    pub mesh: Option<&'a Mesh>,
    /// The sites that carry the labels, mm.
    pub sites: &'a Sites,
    /// The cutter in words, for titles and metadata.
    pub cutter: &'a str,
    /// Outlines of what blocks beside the part, mm ([`outlines`]).
    pub outlines: &'a [[DVec3; 2]],
}

/// What pictures show beside the answers.
#[derive(Debug, Clone, Copy, Default)]
pub struct Scene<'a> {
    /// The surface, mm; without it the sites are drawn as small discs.
    pub mesh: Option<&'a Mesh>,
    /// Outlines of what blocks beside it, mm ([`outlines`]).
    pub outlines: &'a [[DVec3; 2]],
}

impl<'a> From<Option<&'a Mesh>> for Scene<'a> {
    fn from(mesh: Option<&'a Mesh>) -> Self {
        Scene { mesh, outlines: &[] }
    }
}
