//! Tables, colored point clouds, pictures and pages of results.
//!
//! [`coverage`] is about several tools at once, [`tables`](crate::tables) show numbers, [`findings`](crate::findings)
//! lists regions that no tool reaches. `analysis` computes the results and writes all files of a report.

pub mod coverage;
#[doc(hidden)] // of the program
pub mod explanation;
pub mod export;
#[doc(hidden)] // written by `analysis` and the program
pub mod folder;
#[doc(hidden)] // of the program
pub mod library;
#[doc(hidden)] // written by `analysis` and the program
pub mod page;
#[doc(hidden)] // written by `analysis` and the program
pub mod points;
#[doc(hidden)] // of the program
pub mod scores;
#[doc(hidden)] // of the program
pub mod setups;
#[doc(hidden)] // of the program
pub mod tool_drawing;

#[doc(hidden)] // of the program
pub use crate::render::{
    Class, Coloring, DARK_AND_LIGHT, PartView, Rgb, Scene, curves, image, outlines, picture,
    section,
};
