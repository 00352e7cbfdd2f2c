//! Walls of a part that are thinner than a limit.

use crate::access::surface::TriangleObstacles;
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::spacing::areas_on;
use crate::geom::{Mesh, regions};
use crate::{Error, Result};
use glam::DVec3;
use serde::Serialize;

/// A connected region of the surface on thin walls.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ThinWall {
    /// Its area, mm².
    pub area_mm2: f64,
    /// Least thickness, mm.
    pub least_mm: f64,
    /// Where that is, mm.
    pub at_mm: DVec3,
}

/// All of a part that is thinner than a limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ThinWalls {
    /// The limit, mm.
    pub limit_mm: f64,
    /// Area of the sides of thinner walls, mm²: a wall has two.
    pub area_mm2: f64,
    /// As a share of the surface.
    pub area_share: f64,
    /// Least thickness of all, mm; `None` if no site is on a wall.
    pub least_mm: Option<f64>,
    /// Number of sites of the surface that were measured.
    pub n_sites: usize,
    /// The regions, the greatest first.
    pub walls: Vec<ThinWall>,
}

impl ThinWalls {
    /// Those of a closed mesh that faces outward, measured at `n_sites` sites.
    ///
    /// # Errors
    /// If the limit is not positive and finite, or as [`sample`] and [`TriangleObstacles::new`].
    pub fn of(mesh: &Mesh, limit_mm: f64, n_sites: usize) -> Result<Self> {
        if !(limit_mm > 0.0 && limit_mm < f64::INFINITY) {
            let remedy = "give the least thickness that a wall may have, in mm";
            return Err(Error::argument("thin wall", limit_mm, "a positive length", remedy));
        }
        let sites = sample(mesh, &SiteOptions { n_sites, ..SiteOptions::default() })?;
        let thickness = TriangleObstacles::new(mesh, &[])?.thickness(&sites);
        let areas = areas_on(&sites, Some(mesh))?;
        let marks: Vec<Option<u8>> =
            thickness.iter().map(|t| (*t < limit_mm).then_some(0)).collect();
        let of_site = regions::regions(&sites, Some(mesh), &areas, &marks)?;
        let all = (0..sites.len()).filter_map(|i| of_site[i].map(|region| (region, i)));
        let mut members: Vec<(u32, usize)> = all.collect();
        members.sort_unstable();
        let region = |members: &[(u32, usize)]| {
            let thinner = |a: usize, b: usize| if thickness[b] < thickness[a] { b } else { a };
            let thinnest = members.iter().map(|(_, i)| *i).reduce(thinner).unwrap_or_default();
            ThinWall {
                area_mm2: members.iter().map(|(_, i)| areas[*i]).sum(),
                least_mm: thickness[thinnest],
                at_mm: sites.points[thinnest].as_dvec3(),
            }
        };
        let mut walls: Vec<ThinWall> = members.chunk_by(|a, b| a.0 == b.0).map(region).collect();
        walls.sort_by(|a, b| b.area_mm2.total_cmp(&a.area_mm2));
        let area_mm2 = walls.iter().map(|wall| wall.area_mm2).sum();
        let least = thickness.iter().copied().fold(f64::INFINITY, f64::min);
        Ok(ThinWalls {
            limit_mm,
            area_mm2,
            area_share: area_mm2 / areas.iter().sum::<f64>(),
            least_mm: least.is_finite().then_some(least),
            n_sites: sites.len(),
            walls,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};

    #[test]
    fn a_web_of_one_and_a_half_is_thinner_than_two_and_not_than_one() {
        let web = cuboid(DVec3::new(40.0, 1.5, 20.0));
        let below = |limit: f64| ThinWalls::of(&web, limit, 2000).unwrap();
        let found = below(2.0);
        assert!((1..=2).contains(&found.walls.len()), "both sides: {found:?}");
        assert!((found.area_mm2 - 1600.0).abs() < 60.0, "{}", found.area_mm2);
        assert!(found.walls.iter().all(|wall| (wall.least_mm - 1.5).abs() < 1e-5));
        assert!(below(1.0).walls.is_empty() && below(1.0).area_mm2 == 0.0);
        assert!((below(1.0).least_mm.unwrap() - 1.5).abs() < 1e-5, "the least is named anyway");
    }

    #[test]
    fn a_ring_is_as_thick_as_its_section_and_a_limit_must_be_a_length() {
        let ring = torus(20.0, 2.0, 96, 48);
        let found = ThinWalls::of(&ring, 3.0, 2000).unwrap();
        assert!(found.walls.is_empty() && found.least_mm.unwrap() > 3.9, "{found:?}");
        assert!(ThinWalls::of(&ring, 4.2, 2000).unwrap().area_share > 0.95);
        for limit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ThinWalls::of(&ring, limit, 10).unwrap_err().to_string().contains("thin wall"));
        }
    }
}
