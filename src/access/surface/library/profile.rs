//! Tools of any profile among others: each is labeled as it is held, and without its holder.
//!
//! # Definition
//!
//! Stick-outs [2 %](STEP) apart are tried, the tool's own among them. The **least stick-out** of a site is the least of
//! these at which one of two poses is free with a proven retreat: that found for the whole tool, or that found for its
//! body. Other poses may need less.
//!
//! A higher holder is less in the way, in the pose and on its retreat, so bisection finds it:
//!
//! ```text
//! for both poses: free at the longest, above all of the part? then the least by bisection
//! a site that the body reaches at no more than the tool's own stick-out: accessible, whatever the search missed
//! ```

use super::ToolReach;
use crate::Result;
use crate::access::surface::profile::ProfileTool;
use crate::access::surface::tolerance::Tolerances;
use crate::access::surface::tool::Outline;
use crate::access::surface::{SurfaceOptions, TriangleObstacles, WitnessPose};
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, Cutter, Profile};
use crate::tool::directions::Directions;
use std::sync::OnceLock;

/// From one length to the next.
const STEP: f64 = 1.02;
/// No length of a tool is longer, mm.
const LONGEST_MM: f64 = 9999.0;
/// Sites per task.
const BLOCK: usize = 32;

impl TriangleObstacles {
    pub(super) fn reach_of_profile(
        &self,
        sites: &Sites,
        tool: &Assembly,
        (directions, options): (&Directions, &SurfaceOptions),
    ) -> Result<ToolReach> {
        let held = self.surface_labels(sites, &tool.cutter()?, directions, options)?;
        let body = self.surface_labels(sites, &tool.body_cutter()?, directions, options)?;
        let lengths = Lengths::new(self, tool, options)?;
        let blocks = par::map_blocks(sites.len(), BLOCK, |range| {
            let least = |i: usize| {
                let of_body = lengths.least(body.evidence.witness[i], lengths.all.len());
                let found = lengths.least(held.evidence.witness[i], lengths.own + 1);
                let is_less = of_body.is_some_and(|k| found.is_none_or(|found| k < found));
                if is_less {
                    (of_body, body.evidence.witness[i])
                } else {
                    (found, held.evidence.witness[i])
                }
            };
            range.map(least).collect::<Vec<_>>()
        });
        let (mut answers, mut witness) = (held.answers, held.evidence.witness);
        let mut least_stick_out_mm = Vec::with_capacity(sites.len());
        let mut body_reaches = Vec::with_capacity(sites.len());
        for (i, (least, pose)) in blocks.into_iter().flatten().enumerate() {
            if answers[i] != SiteAnswer::Accessible && least.is_some_and(|k| k <= lengths.own) {
                (answers[i], witness[i]) = (SiteAnswer::Accessible, pose);
            }
            body_reaches.push(least.is_some());
            least_stick_out_mm.push(least.map_or(f64::INFINITY, |k| lengths.all[k]));
        }
        Ok(ToolReach { answers, witness, body_reaches, least_stick_out_mm })
    }
}

/// A tool at stick-outs from the end of what cuts to above the part.
struct Lengths<'a> {
    obstacles: &'a TriangleObstacles,
    tolerances: Tolerances,
    finish_mm: f64,
    /// Stick-outs, ascending, mm.
    all: Vec<f64>,
    /// The one at which the tool is held.
    own: usize,
    cutters: Vec<Cutter>,
    tools: Vec<OnceLock<ProfileTool<'a>>>,
}

impl<'a> Lengths<'a> {
    fn new(
        obstacles: &'a TriangleObstacles,
        tool: &Assembly,
        options: &SurfaceOptions,
    ) -> Result<Self> {
        // What cuts is the same at all of them, and so are the tolerances.
        let outline = Outline::new(&tool.cutter()?, options.finish_mm);
        let tolerances =
            options.tolerance.of_triangles(&outline, &obstacles.chords, &obstacles.bvh)?;
        let (held, flutes) = (tool.stick_out_mm(), tool.profile().map_or(0.0, Profile::flutes_mm));
        let least = flutes.max(2.0 * outline.radius()).min(held);
        // A tip is not farther below its site than what cuts is long.
        let above = 2.0 * obstacles.bvh.radius() + flutes + outline.radius();
        let holder = tool.holder().iter().fold(0.0, |top: f64, step| top.max(step.height_mm));
        let steps = |ratio: f64| libm::log(ratio) / libm::log(STEP);
        let below = steps(held / least).floor();
        let possible = steps((LONGEST_MM - holder).max(held) / held).floor();
        let beyond = steps(above.max(held) / held).ceil().min(possible);
        let length = |k: i32| if k == 0 { held } else { held * libm::pow(STEP, f64::from(k)) };
        let all: Vec<f64> = (-(below as i32)..=beyond as i32).map(length).collect();
        let cutters = all.iter().map(|length| tool.at_stick_out(*length));
        Ok(Lengths {
            obstacles,
            tolerances,
            finish_mm: options.finish_mm,
            own: below as usize,
            cutters: cutters.collect::<Result<_>>()?,
            tools: all.iter().map(|_| OnceLock::new()).collect(),
            all,
        })
    }

    fn tool(&self, k: usize) -> &ProfileTool<'a> {
        self.tools[k].get_or_init(|| {
            let profile = self.cutters[k].profile().expect("a tool that was given by its profile");
            ProfileTool::new(&self.obstacles.bvh, &self.tolerances, profile, self.finish_mm)
        })
    }

    /// The least of the first `n` lengths that will do in a pose.
    fn least(&self, pose: Option<WitnessPose>, n: usize) -> Option<usize> {
        let pose = pose?;
        let does = |k: usize| self.tool(k).is_free_with_retreat(&pose);
        let (mut short, mut long) = (0, n - 1);
        if !does(long) {
            return None;
        }
        while short < long {
            let middle = (short + long) / 2;
            if does(middle) { long = middle } else { short = middle + 1 }
        }
        Some(long)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids;
    use crate::tool::cutter::Section;
    use glam::{DVec3, dvec2};

    #[test]
    fn a_part_longer_than_any_tool_has_answers() {
        let part = solids::cuboid(DVec3::new(30_000.0, 20.0, 20.0));
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        let (points, normals) = (vec![glam::Vec3::new(10.0, 10.0, 20.0)], vec![glam::Vec3::Z]);
        let sites = Sites { points, normals, faces: vec![] };
        let profile = Profile::lollipop(3.0, 1.5).unwrap();
        let holder = [Section::cylinder(30.0, 20.0)];
        let tool = Assembly::from_profile(profile, &holder, 40.0).unwrap();
        let up: Directions = "up".parse().unwrap();
        let reach = obstacles.reach_many(&sites, &[tool], &up, &SurfaceOptions::default()).unwrap();
        assert!(reach[0].least_stick_out_mm[0] < 40.0 && reach[0].body_reaches[0]);
    }

    /// In a block of 80 x 60 mm, 50 mm high, a slot of 14 mm along y down to 20 mm; its wall alone.
    #[test]
    fn a_holder_wider_than_a_slot_stays_above_it() {
        let outline = [
            [0.0, 0.0],
            [80.0, 0.0],
            [80.0, 50.0],
            [47.0, 50.0],
            [47.0, 20.0],
            [33.0, 20.0],
            [33.0, 50.0],
            [0.0, 50.0],
        ];
        let cap = [[0, 1, 4], [0, 4, 5], [0, 5, 7], [5, 6, 7], [1, 2, 4], [2, 3, 4]];
        let mut part = solids::prism(&outline.map(|[x, z]| dvec2(x, z)), &cap, 60.0);
        // From the plane of its outline to xz.
        part.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, 60.0 - v.z, v.y));
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        // On the wall at x = 33, as low as the ball goes and higher.
        let heights: Vec<f32> = (0..26).map(|k| 23.5 + k as f32).collect();
        let points: Vec<_> = heights.iter().map(|z| glam::Vec3::new(33.0, 30.0, *z)).collect();
        let sites = Sites { normals: vec![glam::Vec3::X; points.len()], points, faces: vec![] };
        let up: Directions = "up".parse().unwrap();
        let options = SurfaceOptions::default();
        for held in [25.0, 45.0] {
            let profile = Profile::lollipop(3.0, 1.5).unwrap();
            let holder = [Section::cylinder(30.0, 20.0)];
            let tool = Assembly::from_profile(profile, &holder, held).unwrap();
            let reach = obstacles.reach_many(&sites, &[tool], &up, &options).unwrap();
            for (i, z) in heights.iter().enumerate() {
                // The ball touches the wall with its equator, 3 mm above the tip; the nose stays at 50 mm or above.
                let least = 50.0 - (f64::from(*z) - 3.0);
                let found = reach[0].least_stick_out_mm[i];
                let floor = 6.0;
                let most = least.max(floor) * STEP;
                assert!(found >= least - 0.05 && found <= most + 0.05, "{z}: {found}, {least}");
                assert!(reach[0].body_reaches[i], "{z}");
                assert_eq!(reach[0].answers[i] == SiteAnswer::Accessible, found <= held, "{z}");
                assert_eq!(reach[0].witness[i].is_some(), found <= held, "{z}");
            }
        }
    }
}
