//! The volume of what is left, by sites.
//!
//! Every point outside of the part belongs to the place of the surface that is nearest to it. So what is left is cut
//! into pieces, one about each site: along its normal as far as the rest, but no further than its own points go, to
//! where a ball that touches the surface at the site first touches it elsewhere. In a corner of two walls that is the
//! bisector, in a slot the middle. Points nearest to an outer edge belong to no site: around such an edge of angle φ
//! a rest r lacks (π − φ) r²/2 per length.

use super::super::obstacles::{TriangleObstacles, contacts};
use super::super::triangle::nearest;
use crate::exec::par;
use crate::geom::Sites;
use crate::{Error, Result};
use glam::DVec3;

/// Sites per task.
const BLOCK: usize = 64;
/// A triangle that enters a ball by less does not touch it elsewhere, mm, and as a share of the radius.
const ENTERS: [f64; 2] = [1e-5, 1e-6];
/// Most balls at a site.
const ROUNDS: usize = 64;

impl TriangleObstacles {
    /// Volume of what is left about each site, mm³: of rests in mm ([`TriangleObstacles::rests`]) and the areas of the
    /// surface about the sites, mm².
    ///
    /// # Errors
    /// If the lists differ in length, or a site has no normal.
    #[doc(hidden)] // of `analysis`
    pub fn rest_volumes(&self, sites: &Sites, rests: &[f32], areas: &[f64]) -> Result<Vec<f32>> {
        let n = sites.len();
        if rests.len() != n || areas.len() != n {
            let found = format!("{} rests and {} areas", rests.len(), areas.len());
            let remedy = "give a rest and an area for every site";
            return Err(Error::argument("rests", found, format!("{n} of each"), remedy));
        }
        let contacts = contacts(sites)?;
        let of = |i: usize| {
            if rests[i] <= 0.0 {
                return 0.0;
            }
            let (at, normal) = (contacts[i].point, contacts[i].normal.unwrap_or(DVec3::Z));
            (areas[i] * self.own_length(at, normal, f64::from(rests[i]))) as f32
        };
        let blocks = par::map_blocks(n, BLOCK, |range| range.map(of).collect::<Vec<_>>());
        Ok(blocks.concat())
    }

    /// How far the points along a normal are nearest to where it begins, of at most `length`.
    fn own_length(&self, at: DVec3, normal: DVec3, length: f64) -> f64 {
        let n_of_part = self.chords.len() as u32;
        let mut radius = length;
        for _ in 0..ROUNDS {
            let center = at + normal * radius;
            let most = radius - ENTERS[0] - ENTERS[1] * radius;
            let mut smaller = None;
            self.bvh.near(center, most, |place| {
                let to = nearest(center, self.bvh.triangle(place)) - at;
                let along = to.dot(normal);
                let enters = self.bvh.face(place) < n_of_part
                    && along > 0.0
                    && (to + at).distance_squared(center) < most * most;
                if enters {
                    // The ball that touches at the site and passes through this point.
                    smaller = Some(0.5 * to.length_squared() / along);
                }
                enters
            });
            match smaller {
                Some(smaller) => radius = radius.min(smaller),
                None => break,
            }
        }
        radius
    }
}
