//! Many tools on one part: what each reaches, and how little each may stick out of its holder.
//!
//! # Definition
//!
//! A tool is a *body* without an upper end and a *holder* whose nose is `L` above the tip ([`Assembly`]). For a site
//! and a direction in which the body is free (shrunk by the contact tolerance, tip and all), the holder's step `(t,
//! R)`, height above the nose, penetrates iff the greatest height of the triangles over the disc of radius `R − τ`,
//! measured from the tip, exceeds `L + t + τ`. So the holder is clear from
//!
//! ```text
//! L(site, direction) = max over steps of  (greatest height over the disc of R − τ) − t − τ
//! ```
//!
//! on, for every greater `L` as well. The **least stick-out** of a site is the least `L` over the directions in which
//! the body is free, and there over its own pose, the one that was found, and 16 poses around the disc of an end that
//! lies on a face; no `L` is tried. Directions are those of the set and the witnesses that the search between them
//! found, so it is exact for these and an upper bound for all. It is never below twice the radius of the lower end;
//! infinite where the body has no free pose. Tools given by their profile: see `profile` in this room.
//!
//! # Pseudo-code
//!
//! ```text
//! for every different body, the slender before the thick:                                   (search tree, sites, cells: shared)
//!     where a more slender body with the same tip does not reach: not reached               (it is inside this one)
//!     where a direction found for an earlier tool is free: that is the witness              (one test)
//!     elsewhere: label as for one cutter
//!     for every different holder on it:
//!         least stick-outs: the witness first; then every direction in which no sample point is in the body:
//!             clear at the least so far? then the body free? then the greatest height, which is the new least
//!         for every stick-out of that holder, the longest first: reached where the least stick-out is no more;
//!             not reached where a more slender tool with the same tip does not reach;
//!             elsewhere, where the body reaches: the search between the directions, for the whole tool
//! ```

mod held;
mod profile;

use super::cells::Domain;
use super::labels::{SurfaceLabels, SurfaceOptions};
use super::obstacles::{TriangleObstacles, extent, tested};
use super::problem::Problem;
use super::query::Scratch;
use super::site::SiteState;
use super::tool::{Contact, Outline, Stand, axes};
use super::verdict::Verdict;
use crate::access::{Queries, evidence::WitnessPose};
use crate::answers::SiteAnswer;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, Cutter, Step};
use crate::tool::directions::{Directions, basis};
use crate::{Result, exec::par};
use glam::{DVec3, Vec3};
use held::{Held, stand, tops_along};
use std::f64::consts::TAU;

/// What one tool of several reaches.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ToolReach {
    /// Per site, the answer for the tool as it is held.
    pub answers: Vec<SiteAnswer>,
    /// Per site, a free pose of the tool as it is held.
    pub witness: Vec<Option<WitnessPose>>,
    /// Per site, whether the body alone has a free pose there, whatever the stick-out.
    pub body_reaches: Vec<bool>,
    /// Per site, mm: from which stick-out on the tool has a free pose there; infinite where the body has none.
    pub least_stick_out_mm: Vec<f64>,
}

/// Directions of earlier tools that are tried at a site.
const N_HINTS: usize = 6;
/// Sites per task.
const BLOCK: usize = 64;

impl TriangleObstacles {
    /// What each of `tools` reaches of `sites`, in their order.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`], or as [`Assembly::cutter`].
    #[doc(hidden)] // of `analysis`, which compares tools
    pub fn reach_many(
        &self,
        sites: &Sites,
        tools: &[Assembly],
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Vec<ToolReach>> {
        self.reach_bodies(sites, tools, (directions, options), &mut |_| Ok(()))
    }

    /// [`TriangleObstacles::reach_many`]; `done` is called with the number of tools that are done, and may stop it.
    pub(crate) fn reach_bodies(
        &self,
        sites: &Sites,
        tools: &[Assembly],
        (directions, options): (&Directions, &SurfaceOptions),
        done: &mut dyn FnMut(usize) -> Result<()>,
    ) -> Result<Vec<ToolReach>> {
        let _floats = par::DefaultFloats::set();
        let (counts, occlusion, clearance_limit_mm) = (false, false, None);
        let options = SurfaceOptions { counts, occlusion, clearance_limit_mm, ..*options };
        let tested = tested(directions)?;
        extent(sites.len(), tools.len(), &tested, &options).require_library()?;
        let domain = Domain::of(directions);
        let mut pass = Pass {
            obstacles: self,
            sites,
            tested: &tested,
            domain,
            options: &options,
            tops: tops_along(&self.bvh, tested.vectors()),
            hints: vec![Vec::new(); sites.len()],
            bodies: Vec::new(),
            reach: vec![ToolReach::default(); tools.len()],
        };
        let is_profile = |k: &usize| tools[*k].profile().is_some();
        let (profiles, mut left): (Vec<usize>, Vec<_>) = (0..tools.len()).partition(is_profile);
        for (n, k) in profiles.into_iter().enumerate() {
            pass.reach[k] = self.reach_of_profile(sites, &tools[k], (directions, &options))?;
            done(n + 1)?;
        }
        left.sort_by(|&a, &b| {
            thickness(tools[a].body()).total_cmp(&thickness(tools[b].body())).then(a.cmp(&b))
        });
        while let Some(&first) = left.first() {
            let same_body = |&k: &usize| has_same_body(&tools[k], &tools[first]);
            let (group, rest) = left.into_iter().partition(same_body);
            left = rest;
            pass.body(tools, group)?;
            done(tools.len() - left.len())?;
        }
        Ok(pass.reach)
    }
}

fn has_same_body(a: &Assembly, b: &Assembly) -> bool {
    a.tip() == b.tip() && a.allowance_mm() == b.allowance_mm() && a.body() == b.body()
}

/// The lower end that touches.
fn contact(cutter: &Cutter) -> [f64; 2] {
    [cutter.corner_mm(), cutter.side_mm()]
}

/// Tools in the order of this come after those inside them.
fn thickness(steps: &[Step]) -> f64 {
    /// Far above any body, mm.
    const TOP: f64 = 300.0;
    /// In place of the spindle's, mm.
    const WIDE: f64 = 1000.0;
    let heights = steps.iter().map(|step| step.height_mm.min(TOP));
    let ends = heights.clone().skip(1).chain([TOP]);
    let areas = steps.iter().zip(heights.zip(ends));
    areas.map(|(step, (low, high))| step.radius_mm.min(WIDE) * (high - low)).sum()
}

/// Whether every step of one body is inside the other; both have the same tip.
fn is_inside(inner: &[Step], outer: &[Step]) -> bool {
    let holds = |step: &Step| {
        outer.iter().any(|o| o.height_mm <= step.height_mm && o.radius_mm >= step.radius_mm)
    };
    inner.iter().all(holds)
}

/// A body or a whole tool that is done; steps above the reference point.
struct Body {
    tip: [f64; 2],
    steps: Vec<Step>,
    answers: Vec<SiteAnswer>,
}

struct Pass<'a> {
    obstacles: &'a TriangleObstacles,
    sites: &'a Sites,
    tested: &'a Directions,
    domain: Option<Domain>,
    options: &'a SurfaceOptions,
    /// Height of the triangles along every direction tested.
    tops: Vec<f64>,
    /// Per site, directions in which earlier tools may stand.
    hints: Vec<Vec<Vec3>>,
    bodies: Vec<Body>,
    reach: Vec<ToolReach>,
}

impl Pass<'_> {
    /// All tools of one body.
    fn body(&mut self, tools: &[Assembly], mut group: Vec<usize>) -> Result<()> {
        let assembly = &tools[group[0]];
        let cutter = assembly.body_cutter()?;
        let (answers, witness) = self.label_body(&cutter)?;
        let reached: Vec<usize> = (0..self.sites.len()).filter(|&i| witness[i].is_some()).collect();
        self.bodies.push(Body {
            tip: contact(&cutter),
            steps: cutter.steps().to_vec(),
            answers: answers.clone(),
        });
        let body =
            BodyLabels { cutter: &cutter, answers: &answers, witness: &witness, reached: &reached };
        let free = self.clear_of_points(&body)?;
        group.sort_by(|&a, &b| {
            thickness(tools[a].holder()).total_cmp(&thickness(tools[b].holder())).then(a.cmp(&b))
        });
        while let Some(&first) = group.first() {
            let same = |&k: &usize| tools[k].holder() == tools[first].holder();
            let (mut held, rest): (Vec<usize>, Vec<usize>) = group.into_iter().partition(same);
            group = rest;
            // The longest first: what it does not reach, the shorter ones do not either.
            held.sort_by(|&a, &b| {
                tools[b].stick_out_mm().total_cmp(&tools[a].stick_out_mm()).then(a.cmp(&b))
            });
            self.holder(tools, &held, &body, &free)?;
        }
        Ok(())
    }

    /// Answers and witnesses of a body without a holder.
    fn label_body(
        &mut self,
        cutter: &Cutter,
    ) -> Result<(Vec<SiteAnswer>, Vec<Option<WitnessPose>>)> {
        let n = self.sites.len();
        let (mut answers, mut witness) = (vec![SiteAnswer::Inaccessible; n], vec![None; n]);
        let closed = self.closed(cutter);
        let open: Vec<usize> = (0..n).filter(|&i| closed[i].is_none()).collect();
        let hinted = self.try_hints(cutter, &open)?;
        for (&i, hinted) in open.iter().zip(&hinted) {
            witness[i] = *hinted;
        }
        // Where a more slender body's tip does not fit, this one's does not either, but its steps may collide.
        let rest: Vec<usize> = (0..n)
            .filter(|&i| witness[i].is_none() && closed[i] != Some(SiteAnswer::Inaccessible))
            .collect();
        let labels = self.label(cutter, &rest)?;
        for (k, &i) in rest.iter().enumerate() {
            (answers[i], witness[i]) = (labels.answers[k], labels.evidence.witness[k]);
            if closed[i].is_some() && witness[i].is_some() {
                (answers[i], witness[i]) = (SiteAnswer::TipDoesNotFit, None);
            }
        }
        for i in 0..n {
            if let Some(pose) = witness[i] {
                answers[i] = SiteAnswer::Accessible;
                self.hint(i, pose.direction);
            }
        }
        Ok((answers, witness))
    }

    /// Per site, the answer of some more slender tool with the same tip that does not reach it, inaccessible if one is.
    fn closed(&self, cutter: &Cutter) -> Vec<Option<SiteAnswer>> {
        let tip = contact(cutter);
        let is_slender = |body: &&Body| body.tip == tip && is_inside(&body.steps, cutter.steps());
        let mut closed = vec![None; self.sites.len()];
        for body in self.bodies.iter().filter(is_slender) {
            for (closed, answer) in closed.iter_mut().zip(&body.answers) {
                match answer {
                    SiteAnswer::Inaccessible => *closed = Some(*answer),
                    SiteAnswer::TipDoesNotFit => *closed = closed.or(Some(*answer)),
                    SiteAnswer::Accessible => {}
                }
            }
        }
        closed
    }

    fn hint(&mut self, i: usize, direction: Vec3) {
        let hints = &mut self.hints[i];
        if !hints.contains(&direction) && hints.len() < N_HINTS {
            hints.push(direction);
        }
    }

    /// A free pose of the cutter in the first hint of each of these sites that has one.
    fn try_hints(&self, cutter: &Cutter, of: &[usize]) -> Result<Vec<Option<WitnessPose>>> {
        let sites = self.sites.subset(of);
        let problem = self.problem(&sites, cutter)?;
        let blocks = par::map_blocks(of.len(), BLOCK, |range| {
            let mut state = SiteState::default();
            let find = |k: usize| {
                state.begin();
                let pose = |direction: &Vec3| {
                    let (_, pose) = problem.verdict(k, &axes(*direction), false, &mut state);
                    Some(WitnessPose::new(&problem.outline, pose?, *direction))
                };
                self.hints[of[k]].iter().find_map(pose)
            };
            range.map(find).collect::<Vec<_>>()
        });
        Ok(blocks.into_iter().flatten().collect())
    }

    fn problem(&self, sites: &Sites, cutter: &Cutter) -> Result<Problem<'_>> {
        self.obstacles.problem(Queries::Sites(sites), cutter, self.options)
    }

    /// As [`TriangleObstacles::label`], for some of the sites.
    fn label(&self, cutter: &Cutter, of: &[usize]) -> Result<SurfaceLabels> {
        if of.is_empty() {
            return Ok(SurfaceLabels::default());
        }
        let sites = self.sites.subset(of);
        let problem = self.problem(&sites, cutter)?;
        let options = self.options.for_few(of.len());
        let tallies = problem.by_triangles(cutter, self.tested, self.domain, &options)?;
        Ok(problem.labels(tallies, self.tested, &options))
    }

    /// Per site that a body reaches, the directions of the set in which no sample point is in it.
    fn clear_of_points(&self, body: &BodyLabels) -> Result<Vec<Vec<u32>>> {
        if body.reached.is_empty() {
            return Ok(Vec::new());
        }
        let sites = self.sites.subset(body.reached);
        let problem = self.problem(&sites, body.cutter)?;
        let all: Vec<usize> = (0..sites.len()).collect();
        let matrix = problem.all_by_points(body.cutter, self.tested, self.options, &all)?;
        let free = |k: usize| {
            let is_free = |&d: &u32| {
                let axis = self.tested.vectors()[d as usize].as_dvec3().normalize();
                let is_blocked = matrix.words(d as usize)[k / 64] >> (k % 64) & 1 == 1;
                !(is_blocked && problem.is_trusted(k, axis))
            };
            (0..self.tested.len() as u32).filter(is_free).collect()
        };
        Ok(par::map(body.reached.len(), free))
    }

    /// All tools of one body and one holder, in the order of their stick-outs.
    fn holder(
        &mut self,
        tools: &[Assembly],
        held: &[usize],
        body: &BodyLabels,
        free: &[Vec<u32>],
    ) -> Result<()> {
        let mut least = self.least_stick_outs(&tools[held[0]], body, free)?;
        for &tool in held {
            let stick_out = tools[tool].stick_out_mm();
            let cutter = tools[tool].cutter()?;
            let closed = self.closed(&cutter);
            let is_closed = |i: usize| closed[i] == Some(SiteAnswer::Inaccessible);
            // What is found to be reached counts, whatever the search for another tool missed.
            let is_known = |i: usize| least[i].0 <= stick_out || is_closed(i);
            // Where the tip does not fit at all, the answer depends on the holder.
            let open: Vec<usize> = (0..self.sites.len())
                .filter(|&i| !is_known(i) && body.answers[i] != SiteAnswer::Inaccessible)
                .collect();
            let labels = self.label(&cutter, &open)?;
            let mut answers: Vec<SiteAnswer> = body.answers.to_vec();
            for i in (0..answers.len()).filter(|&i| is_closed(i) && least[i].0 > stick_out) {
                answers[i] = SiteAnswer::Inaccessible;
            }
            let mut found = Vec::new();
            for (k, &i) in open.iter().enumerate() {
                answers[i] = labels.answers[k];
                match labels.evidence.witness[k] {
                    Some(pose) if body.witness[i].is_some() && closed[i].is_none() => {
                        found.push((i, pose));
                    }
                    // The search for the body or a more slender tool missed it: that answer stays.
                    Some(_) => answers[i] = SiteAnswer::TipDoesNotFit,
                    None => {}
                }
            }
            for ((i, pose), length) in self.stick_outs_at(&tools[tool], body, &found)? {
                // But for roundings it is no more than that of the tool, which is free there.
                least[i] = (length.min(stick_out).min(least[i].0), Some(pose));
                self.hint(i, pose.direction);
            }
            self.bodies.push(Body {
                tip: contact(&cutter),
                steps: cutter.steps().to_vec(),
                answers: answers.clone(),
            });
            let reaches = |i: usize| answers[i] == SiteAnswer::Accessible;
            self.reach[tool] = ToolReach {
                witness: (0..answers.len()).map(|i| least[i].1.filter(|_| reaches(i))).collect(),
                body_reaches: body.witness.iter().map(Option::is_some).collect(),
                least_stick_out_mm: Vec::new(),
                answers,
            };
        }
        let least: Vec<f64> = least.into_iter().map(|(length, _)| length).collect();
        held.iter().for_each(|&tool| self.reach[tool].least_stick_out_mm = least.clone());
        Ok(())
    }

    /// The least stick-outs of sites in one pose each.
    fn stick_outs_at(
        &self,
        assembly: &Assembly,
        body: &BodyLabels,
        of: &[(usize, WitnessPose)],
    ) -> Result<Vec<((usize, WitnessPose), f64)>> {
        let sites = self.sites.subset(&of.iter().map(|(i, _)| *i).collect::<Vec<_>>());
        let problem = self.problem(&sites, body.cutter)?;
        let held = Held::new(&problem, assembly);
        let directions: Vec<Vec3> = of.iter().map(|(_, pose)| pose.direction).collect();
        let tops = tops_along(problem.bvh, &directions);
        let length = |k: usize| {
            let stand = stand(&problem, &of[k].1);
            (of[k], held.stick_out(&stand, tops[k], f64::INFINITY, &mut Scratch::default()))
        };
        Ok(par::map(of.len(), length))
    }

    /// Per site, the least stick-out and a pose that has it.
    fn least_stick_outs(
        &self,
        assembly: &Assembly,
        body: &BodyLabels,
        free: &[Vec<u32>],
    ) -> Result<Vec<(f64, Option<WitnessPose>)>> {
        let sites = self.sites.subset(body.reached);
        let problem = self.problem(&sites, body.cutter)?;
        let held = Held::new(&problem, assembly);
        let witness = |i: &usize| body.witness[*i].expect("only sites that the body reaches");
        let first: Vec<WitnessPose> = body.reached.iter().map(witness).collect();
        let directions: Vec<Vec3> = first.iter().map(|pose| pose.direction).collect();
        let tops = tops_along(problem.bvh, &directions);
        let blocks = par::map_blocks(body.reached.len(), BLOCK, |range| {
            let mut state = SiteState::default();
            let mut scratch = Scratch::default();
            let of = |k: usize| {
                state.begin();
                scratch = Scratch::renewed(std::mem::take(&mut scratch));
                problem.place_ball(k, &mut state);
                let own = stand(&problem, &first[k]);
                let length = held.stick_out(&own, tops[k], f64::INFINITY, &mut scratch);
                let mut best = (length, Some(first[k]));
                for &d in &free[k] {
                    if best.0 <= held.floor {
                        break;
                    }
                    let direction = self.tested.vectors()[d as usize];
                    let top = self.tops[d as usize];
                    let own = problem.own_stand(k, direction);
                    for reference in rim_poses(&problem.contacts[k], &problem.outline, own.axes[2])
                    {
                        let stand = Stand { reference, ..own };
                        let length = held.stick_out(&stand, top, best.0, &mut scratch);
                        let whole = &problem.probes.whole;
                        if length < best.0
                            && whole.verdict(problem.triangles(), &stand, &mut scratch)
                                == Verdict::Free
                        {
                            let pose = WitnessPose::new(&problem.outline, reference, direction);
                            best = (length, Some(pose));
                        }
                    }
                    if held.collides_at(&own, top, best.0, &mut scratch) {
                        continue;
                    }
                    let (_, reference) = problem.verdict(k, &own.axes, false, &mut state);
                    let Some(reference) = reference else { continue };
                    let free = Stand { reference, ..own };
                    let length = held.stick_out(&free, top, best.0, &mut scratch);
                    if length < best.0 {
                        let pose = WitnessPose::new(&problem.outline, reference, direction);
                        best = (length, Some(pose));
                    }
                }
                best
            };
            range.map(of).collect::<Vec<_>>()
        });
        let mut least = vec![(f64::INFINITY, None); self.sites.len()];
        for (&i, found) in body.reached.iter().zip(blocks.into_iter().flatten()) {
            least[i] = found;
        }
        Ok(least)
    }
}

/// Poses of a flat or bull-nose end that lies on a face with its disc, as far as it can be moved aside: the holder may
/// be beside a wall there.
fn rim_poses(contact: &Contact, outline: &Outline, axis: DVec3) -> impl Iterator<Item = DVec3> {
    /// Around the disc.
    const N_POSES: usize = 16;
    /// Cosine to the normal from which on a disc lies on a face.
    const FLAT: f64 = 1.0 - 1e-9;
    let lies = outline.side() > 0.0 && contact.normal.is_some_and(|n| n.dot(axis) >= FLAT);
    let [u, v, _] = basis(axis);
    let (center, side) = (contact.corner_center(outline, axis), outline.side());
    let at = move |k: usize| {
        let angle = TAU * k as f64 / N_POSES as f64;
        center + (u * libm::cos(angle) + v * libm::sin(angle)) * side
    };
    (0..if lies { N_POSES } else { 0 }).map(at)
}

/// What is known of a body.
struct BodyLabels<'a> {
    cutter: &'a Cutter,
    answers: &'a [SiteAnswer],
    witness: &'a [Option<WitnessPose>],
    /// The sites that it reaches.
    reached: &'a [usize],
}
