//! Tables, colored point clouds, pictures and curves of results.
//!
//! A [`PartView`] is what is shown, a [`Coloring`] says in which colors; [`picture`] and [`points`]
//! take both, [`folder`] writes all files of a report, [`tables`], [`scores`] and [`curves`] show
//! numbers; [`coverage`] is about several tools at once, [`library`] about all tools of a shop, [`setups`] about clampings, [`findings`] lists
//! regions, [`gate`] is about limits that a result must keep, [`explanation`] says why a site can or cannot be reached, [`page`] is a page with a 3-D view to send.

mod camera;
mod color;
pub mod coverage;
pub mod curves;
pub mod explanation;
pub mod export;
pub mod findings;
pub mod folder;
pub mod gate;
pub mod image;
pub mod library;
mod memory;
pub mod outlines;
pub mod page;
mod paint;
pub mod picture;
pub mod points;
mod raster;
pub mod scores;
pub mod section;
pub mod setups;
mod shade;
pub mod tables;

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
