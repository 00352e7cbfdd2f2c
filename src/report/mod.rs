//! Tables, colored point clouds, pictures and curves of results.
//!
//! [`findings`] lists regions that no tool reaches, [`baseline`] those that are known, [`coverage`] is about several
//! tools at once, [`gate`] about the area that sites stand for, [`tables`] show numbers. `analysis` computes them and
//! writes all files of a report.

pub mod baseline;
mod camera;
mod color;
pub mod coverage;
#[doc(hidden)] // of the program
pub mod curves;
#[doc(hidden)] // of the program
pub mod explanation;
pub mod export;
pub mod findings;
#[doc(hidden)] // written by `analysis` and the program
pub mod folder;
pub mod gate;
#[doc(hidden)] // of the program
pub mod image;
#[doc(hidden)] // of the program
pub mod library;
mod memory;
#[doc(hidden)] // written by `analysis` and the program
pub mod outlines;
#[doc(hidden)] // written by `analysis` and the program
pub mod page;
mod paint;
#[doc(hidden)] // written by `analysis` and the program
pub mod picture;
#[doc(hidden)] // written by `analysis` and the program
pub mod points;
mod raster;
#[doc(hidden)] // of the program
pub mod scores;
#[doc(hidden)] // of the program
pub mod section;
#[doc(hidden)] // of the program
pub mod setups;
mod shade;
pub mod tables;
#[doc(hidden)] // of the program
pub mod tool_drawing;

#[doc(hidden)] // of the program
pub use color::{Class, Coloring, DARK_AND_LIGHT, Rgb};

use crate::geom::{Mesh, Sites};
use glam::DVec3;

/// What a picture or a point file shows.
#[derive(Debug, Clone, Copy)]
#[doc(hidden)] // written by `analysis` and the program
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
#[doc(hidden)] // written by `analysis` and the program
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
