//! What of the part would have to be otherwise so that the tool reaches a region.
//!
//! # Definition
//!
//! **Inner corner.** The *rolled ball* of radius ρ at a site is the ball outside of the part, which no triangle
//! enters by more than its gouge tolerance, whose middle is nearest to the site. If it touches two or more faces of
//! the part at places where these are smooth, the site is in an inner corner, and a fillet of radius ρ would replace
//! it by the point of the ball nearest to it. The fillet **frees** the site if the tool touches that point, with its
//! normal, free of the part: that is labeled. The tool does not cut the fillet itself because what of the tool is in
//! the corner has nowhere a greater radius of curvature, in the plane across the corner, than the fillet:
//!
//! ```text
//! ball end:               ρ = radius of the ball, for any corner and direction
//! bull nose, flat end:    ρ = radius of the tip's corner, where the corner runs across the direction (floor and wall)
//!                         ρ = radius of the cutter, where it runs along the direction (wall and wall)
//! ```
//!
//! The radius that the corner has is exact for a fillet between planes: from the middle of the ball the surface is at
//! the distance `D` along the bisector of the two normals, the planes' edge at `k·ρ`, so `r = (k·ρ − D) / (k − 1)`.
//! It is 0 where other rays do not meet that fillet, as in a chamfer.
//!
//! **Width.** At a site of a wall, or at a wall beside a site of a floor, the ray along the wall's normal meets the
//! opposite wall after the *width* `w`. Where that is less than the tool is wide, a tool thinner by `2·R + 2·τ − w`
//! is labeled at the sites of the region: by what it reaches in the part the tool itself would reach in one whose
//! walls were as much farther apart.
//!
//! **Height in the way.** Of the directions in which tip and cutter are free, the one is taken in which a step of
//! shank, holder or spindle penetrates a face least. All of the part that is above the lower end of that step and
//! connected there with this face is cut off, and the sites are labeled against what is left. It must end in a face
//! across the direction, and be no more than a fifth of the surface.

mod ball;
mod corner;
mod height;
mod thin;
mod width;

use super::labels::{SurfaceLabels, SurfaceOptions};
use super::obstacles::TriangleObstacles;
use crate::Result;
use crate::answers::SiteAnswer;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, Cutter};
use crate::tool::directions::Directions;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A length of the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
#[doc(hidden)] // of findings
pub enum PartLength {
    /// Radius of an inner corner; 0 of a sharp one.
    CornerRadius,
    /// Distance of opposite walls.
    SlotWidth,
    /// Diameter of a bore.
    BoreDiameter,
    /// How far something reaches into the height of a step of the tool; 0 when it is lower by as much.
    HeightInTheWay,
}

/// A length of the part that would have to be another, and what that frees.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of findings
pub struct PartChange {
    /// Which length.
    pub kind: PartLength,
    /// What it is, mm.
    pub from_mm: f64,
    /// What the tool needs, mm.
    pub to_mm: f64,
    /// A site that it frees, mm; of what blocks, where that is.
    pub at_mm: DVec3,
    /// How deep the slot or bore is there, mm.
    pub depth_mm: Option<f64>,
    /// Share of the sites looked at that it frees.
    pub share: f64,
}

/// Most sites of a region that are looked at.
const N_SITES: usize = 192;

/// Sites that a tool does not reach, and how they are labeled.
struct Region<'a> {
    obstacles: &'a TriangleObstacles,
    /// Of the region, and a normal of unit length for each.
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    tool: &'a Assembly,
    clearance_mm: f64,
    cutter: Cutter,
    directions: &'a Directions,
    options: SurfaceOptions,
}

impl TriangleObstacles {
    /// The lengths of the part that would have to be others so that `tool` reaches sites of `members`, the one that
    /// frees most first; none if nothing is found, or for a tool given by its profile.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    ///
    /// # Panics
    /// If a member is no site.
    #[doc(hidden)] // for findings
    pub fn part_changes(
        &self,
        (sites, members): (&Sites, &[u32]),
        (tool, clearance_mm): (&Assembly, f64),
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Vec<PartChange>> {
        if tool.profile().is_some() || members.is_empty() {
            return Ok(Vec::new());
        }
        let n = members.len().min(N_SITES);
        let few = (0..n).map(|k| members[(2 * k + 1) * members.len() / (2 * n)] as usize);
        let few: Vec<usize> = few.collect();
        let region = Region {
            obstacles: self,
            points: few.iter().map(|&i| sites.points[i].as_dvec3()).collect(),
            normals: few.iter().map(|&i| sites.normals[i].as_dvec3().normalize()).collect(),
            tool,
            clearance_mm,
            cutter: tool.with_clearance(clearance_mm)?.cutter()?,
            directions,
            options: SurfaceOptions { refinement: None, ..*options },
        };
        let mut found = region.corners()?;
        found.extend(region.width()?);
        found.extend(region.heights((sites, members))?);
        found.sort_by(|a, b| b.share.total_cmp(&a.share));
        Ok(found)
    }
}

impl Region<'_> {
    /// Number of sites.
    fn n(&self) -> usize {
        self.points.len()
    }

    /// Answers of a cutter at places of a surface with their normals, against the triangles as they are.
    fn label(
        &self,
        cutter: &Cutter,
        places: &[(DVec3, DVec3)],
        directions: &Directions,
    ) -> Result<SurfaceLabels> {
        let (points, normals): (Vec<Vec3>, Vec<Vec3>) =
            places.iter().map(|(p, n)| (p.as_vec3(), n.as_vec3())).unzip();
        let sites = Sites { points, normals, faces: Vec::new() };
        let options = self.options.for_few(sites.len());
        self.obstacles.surface_labels(&sites, cutter, directions, &options)
    }

    /// Whether the tool reaches each of these places.
    fn reaches(&self, places: &[(DVec3, DVec3)], directions: &Directions) -> Result<Vec<bool>> {
        if places.is_empty() {
            return Ok(Vec::new());
        }
        let labels = self.label(&self.cutter, places, directions)?;
        Ok(labels.answers.iter().map(|answer| *answer == SiteAnswer::Accessible).collect())
    }
}

/// To a hundredth of a millimeter.
fn rounded(mm: f64) -> f64 {
    (100.0 * mm).round() / 100.0 + 0.0
}

#[cfg(test)]
mod tests;
