//! Few setups that cover a share of what all candidates reach.

use super::candidates::{Candidate, Candidates};
use super::machine::{DOWN_RAD, LOWEST_MM, angle};
use super::strokes::{self, Bits};
use crate::access::surface::AccessibleDirections;
use crate::exec::{memory, par};
use crate::geom::{Mesh, Sites};
use crate::planning::cover::{Cover, cover_share, cover_share_preferring, greedy_share, is_weight};
use crate::{Error, Result};
use glam::{DMat3, Vec3};
use serde::{Deserialize, Serialize};

/// The chosen setups, in the order of what each adds to those before it, most first; among nearly equal ones the
/// likelier clamping first.
///
/// A block reaches most of its surface standing on its smallest face:
///
/// ```
/// use deepmill::planning::setups::{Candidates, Choice, Clampings, Plan};
/// use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
/// use deepmill::geom::{sites, solids, spacing};
/// use deepmill::{cutter::Cutter, glam::{DVec3, Vec3}};
///
/// let part = solids::cuboid(DVec3::new(30.0, 20.0, 10.0)); // 2200 mm²
/// let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(400))?;
/// let areas = spacing::areas_mm2(&sites, Some(part.area()))?;
/// let cutter = Cutter::ball_end([1.5, 30.0, 20.0, 30.0].into())?;
/// let candidates = Candidates::new(&part, "3-axis".parse()?, Clampings::Standing, 20)?;
/// let accessible = TriangleObstacles::new(&part, &[])?
///     .accessible_directions(&sites, &cutter, candidates.directions(), &SurfaceOptions::default())?;
/// let choice = Choice::share(1.0).at_most(1);
/// let plan = Plan::new(&candidates, &part, &sites, &[accessible], &areas, choice, &[0])?;
/// assert_eq!((plan.setups[0].direction, plan.n_for_all), (Vec3::X, 2));
/// assert!((plan.setups[0].adds - 2000.0).abs() < 40.0); // all but 20 mm · 10 mm
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Plan {
    /// The setups.
    pub setups: Vec<Setup>,
    /// No choice of candidates that covers the share has fewer.
    pub at_least: usize,
    /// Setups that a greedy choice takes to cover all that can be reached.
    pub n_for_all: usize,
    /// Per site, whether some candidate reaches it.
    pub can_be_reached: Vec<bool>,
    /// Per site, the first of the setups that reaches it.
    pub first: Vec<Option<usize>>,
    /// Per site that no candidate reaches: whether for some tool, in some direction tested, the tip alone is in the
    /// way.
    pub only_tip: Vec<bool>,
}

/// Which of the candidates a plan takes.
///
/// ```
/// use deepmill::planning::setups::Choice;
///
/// let few = Choice::share(0.99); // as few as cover 99 % of what some candidate reaches
/// let two = few.at_most(2); // no more than two, even if those cover less
/// assert_ne!(few, two);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    share: f64,
    at_most: usize,
    all: bool,
}

impl Choice {
    /// Few that cover at least this share of the weight that some candidate reaches.
    pub fn share(share: f64) -> Self {
        Choice { share, at_most: usize::MAX, all: false }
    }

    /// But no more than this many: those that add most, one after the other.
    pub fn at_most(self, at_most: usize) -> Self {
        Choice { at_most, ..self }
    }

    /// All candidates, in their order; of one that is clamped in several ways the clamping that adds most.
    pub fn all(self) -> Self {
        Choice { all: true, ..self }
    }
}

/// One clamping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Setup {
    /// z', or the direction of the part along the rotary axis.
    pub direction: Vec3,
    /// Rows: the machine's x', y', z' in the part's coordinates. A rotary axis is along x'.
    pub turn: DMat3,
    /// Weight that it adds to the setups before it.
    pub adds: f64,
    /// Per site, whether some tool reaches it.
    pub reaches: Vec<bool>,
    /// Per tool, per site, whether that reaches it.
    pub by_tool: Vec<Vec<bool>>,
    /// Few tools, by their numbers, that reach the share of what the setup adds.
    pub tools: Cover,
    /// Few tool axes that reach the share of what the setup adds, where the machine has positions: numbers among
    /// `axes`.
    pub positions: Option<Cover>,
    /// Every tool axis of the setup.
    pub axes: Vec<Vec3>,
    candidate: usize,
    /// Per site, whether it is not reached for the strokes of the machine alone. Empty if none is.
    #[serde(default)]
    pub(crate) beyond_strokes: Vec<bool>,
}

impl Setup {
    /// Its number among the candidates.
    pub fn candidate(&self) -> usize {
        self.candidate
    }
}

fn holds(bits: &[u64], i: usize) -> bool {
    bits[i / 64] >> (i % 64) & 1 == 1
}

fn unite(into: &mut Bits, with: &[u64]) {
    into.iter_mut().zip(with).for_each(|(a, b)| *a |= b);
}

impl Plan {
    /// Checks that the choice for so many sites and tools fits into the memory: a bit for each site and candidate, four
    /// times, and for each site and direction.
    ///
    /// # Errors
    /// [`Error::TooLarge`](crate::Error::TooLarge) if it does not.
    pub fn require_memory(candidates: &Candidates, n_sites: usize, n_tools: usize) -> Result<()> {
        let (n, n_directions) = (candidates.list().len(), candidates.directions().len());
        let rows = n.saturating_mul(4).saturating_add(n_directions);
        let bits =
            memory::product([rows, n_sites.div_ceil(64).saturating_mul(8).saturating_add(64)]);
        let by_tool = memory::product([n_sites, n_tools, 64]);
        let remedy = format!(
            "take fewer sites ({n_sites}), directions ({n_directions}) or candidates ({n})"
        );
        memory::require("the choice of setups", bits.saturating_add(by_tool), remedy)
    }

    /// Of the `candidates` for `part`, those of a [`Choice`]; `accessible` has for each tool in which of their
    /// directions it has a free pose, `weights` what each site counts. `order` has every tool once, the preferred
    /// first: of sets of tools as small as can be a setup takes the one that comes first.
    ///
    /// # Errors
    /// If a weight is negative or not finite, or the share of the choice is not from 0 to 1.
    ///
    /// # Panics
    /// If `accessible` is about other sites or directions, or empty, or `order` does not have every tool once.
    pub fn new(
        candidates: &Candidates,
        part: &Mesh,
        sites: &Sites,
        accessible: &[AccessibleDirections],
        weights: &[f64],
        choice: Choice,
        order: &[usize],
    ) -> Result<Self> {
        let n = sites.len();
        assert!(!accessible.is_empty() && weights.len() == n, "a tool, and a weight per site");
        for tool in accessible {
            let about = (tool.n_sites(), tool.n_directions());
            assert_eq!(about, (n, candidates.directions().len()), "these sites and directions");
        }
        if let Some(weight) = weights.iter().find(|weight| !is_weight(**weight)) {
            let remedy = "give the areas that the sites stand for";
            return Err(Error::argument("weights", weight, "0 or more each", remedy));
        }
        if !(0.0..=1.0).contains(&choice.share) {
            let remedy = "0.95 is the share of the program";
            return Err(Error::argument("share", choice.share, "0 to 1", remedy));
        }
        let any: Vec<Bits> = par::map(candidates.directions().len(), |d| {
            let mut bits = vec![0; n.div_ceil(64)];
            accessible.iter().for_each(|tool| unite(&mut bits, tool.words(d)));
            bits
        });
        let list = candidates.list();
        let barred: Vec<Barred> =
            par::map(list.len(), |c| Barred::of(candidates, &list[c], part, sites));
        let reached: Vec<Bits> =
            par::map(list.len(), |c| reach(&list[c], &barred[c], |d| &any[d][..]));
        let of = |c: usize, i: usize| holds(&reached[c], i);
        let share = choice.share;
        let mut cover = cover_share(list.len(), weights, of, share);
        if choice.all {
            cover.chosen = one_of_each_orientation(list, &reached, weights);
        } else if cover.chosen.len() > choice.at_most {
            cover.chosen = greedy_share(list.len(), weights, of, share).chosen;
            cover.chosen.truncate(choice.at_most);
        }
        let n_for_all = greedy_share(list.len(), weights, of, 1.0).chosen.len();
        let mut first = vec![None; n];
        let mut setups = Vec::new();
        for &c in &cover.chosen {
            let new: Vec<f64> = (0..n)
                .map(|i| if first[i].is_none() && of(c, i) { weights[i] } else { 0.0 })
                .collect();
            let adds = new.iter().sum();
            (0..n).filter(|&i| of(c, i)).for_each(|i| first[i] = first[i].or(Some(setups.len())));
            let barred = &barred[c];
            let about = About { candidates, accessible, any: &any, barred, share, order };
            setups.push(about.setup(c, &reached[c], adds, &new));
        }
        let can_be_reached: Vec<bool> = (0..n).map(|i| (0..list.len()).any(|c| of(c, i))).collect();
        let only_tip = (0..n)
            .map(|i| !can_be_reached[i] && accessible.iter().any(|tool| tool.only_tip()[i]))
            .collect();
        let at_least = cover.at_least;
        Ok(Plan { setups, at_least, n_for_all, can_be_reached, first, only_tip })
    }
}

/// Of every orientation the clamping that adds most to those before it; of equal ones the first.
fn one_of_each_orientation(list: &[Candidate], reached: &[Bits], weights: &[f64]) -> Vec<usize> {
    let mut so_far = vec![0; weights.len().div_ceil(64)];
    let mut chosen = Vec::new();
    let mut next = 0;
    for of in list.chunk_by(|a, b| a.orientation == b.orientation) {
        let first = next;
        next += of.len();
        let adds = |c: usize| -> f64 {
            let new = |i: &usize| holds(&reached[c], *i) && !holds(&so_far, *i);
            (0..weights.len()).filter(new).map(|i| weights[i]).sum()
        };
        let mut best = (first, adds(first));
        for c in first + 1..next {
            let gain = adds(c);
            if gain > best.1 {
                best = (c, gain);
            }
        }
        unite(&mut so_far, &reached[best.0]);
        chosen.push(best.0);
    }
    chosen
}

/// Per site, whether some tool reaches it in a candidate.
#[cfg(all(feature = "formats", feature = "generate"))]
pub(crate) fn reached_in(
    candidates: &Candidates,
    number: usize,
    (part, sites): (&Mesh, &Sites),
    accessible: &[AccessibleDirections],
) -> Vec<bool> {
    let candidate = &candidates.list()[number];
    let barred = Barred::of(candidates, candidate, part, sites);
    let mut any = vec![0; barred.lies_on.len()];
    for tool in accessible {
        unite(&mut any, &reach(candidate, &barred, |d| tool.words(d)));
    }
    (0..sites.len()).map(|i| holds(&any, i)).collect()
}

/// The sites that no tool reaches in a candidate, whatever its poses are.
struct Barred {
    lies_on: Bits,
    /// Per tool axis, where the strokes of the machine bar any; empty if they bar none.
    beyond: Vec<Option<Bits>>,
}

impl Barred {
    fn of(candidates: &Candidates, candidate: &Candidate, part: &Mesh, sites: &Sites) -> Self {
        Barred {
            lies_on: lies_on(candidates, candidate, part, sites),
            beyond: strokes::beyond(candidates, candidate, part, sites),
        }
    }

    fn is_beyond(&self, axis: usize, i: usize) -> bool {
        self.beyond.get(axis).is_some_and(|bits| bits.as_ref().is_some_and(|bits| holds(bits, i)))
    }
}

/// The sites on what the part lies on.
fn lies_on(candidates: &Candidates, candidate: &Candidate, part: &Mesh, sites: &Sites) -> Bits {
    let mut bits = vec![0; sites.len().div_ceil(64)];
    if candidates.machine().is_chucked() {
        return bits;
    }
    let up = candidate.direction.as_dvec3();
    let down: Vec<usize> = (0..sites.len())
        .filter(|&i| angle(sites.normals[i], -candidate.direction) <= DOWN_RAD)
        .collect();
    if !down.is_empty() {
        let lowest = part.vertices.iter().map(|p| p.dot(up)).fold(f64::INFINITY, f64::min);
        let is_low = |i: &usize| sites.points[*i].as_dvec3().dot(up) <= lowest + LOWEST_MM;
        down.into_iter().filter(is_low).for_each(|i| bits[i / 64] |= 1 << (i % 64));
    }
    bits
}

/// The union over the tool axes of a candidate, without what is barred.
fn reach<'a>(candidate: &Candidate, barred: &Barred, of: impl Fn(usize) -> &'a [u64]) -> Bits {
    let Barred { lies_on, beyond } = barred;
    let mut bits = vec![0; lies_on.len()];
    for (k, &d) in candidate.axes.iter().enumerate() {
        match beyond.get(k).and_then(Option::as_ref) {
            None => unite(&mut bits, of(d as usize)),
            Some(beyond) => {
                let within = of(d as usize).iter().zip(beyond).map(|(free, beyond)| free & !beyond);
                bits.iter_mut().zip(within).for_each(|(a, b)| *a |= b);
            }
        }
    }
    bits.iter_mut().zip(lies_on).for_each(|(a, on)| *a &= !on);
    bits
}

fn rows(axes: [glam::DVec3; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&axes.map(|row| row.to_array())).transpose()
}

struct About<'a> {
    candidates: &'a Candidates,
    accessible: &'a [AccessibleDirections],
    any: &'a [Bits],
    barred: &'a Barred,
    share: f64,
    order: &'a [usize],
}

impl About<'_> {
    /// `new`: the weights of what the setup adds, 0 elsewhere.
    fn setup(&self, number: usize, reached: &Bits, adds: f64, new: &[f64]) -> Setup {
        let (n, candidate) = (new.len(), &self.candidates.list()[number]);
        let list = |bits: &Bits| (0..n).map(|i| holds(bits, i)).collect::<Vec<bool>>();
        let by_tool: Vec<Vec<bool>> = par::map(self.accessible.len(), |t| {
            list(&reach(candidate, self.barred, |d| self.accessible[t].words(d)))
        });
        let reaches = |t: usize, i: usize| by_tool[t][i];
        let tools = cover_share_preferring(by_tool.len(), new, reaches, self.share, self.order);
        let is_free = |k: usize, i: usize| {
            !holds(&self.barred.lies_on, i) && holds(&self.any[candidate.axes[k] as usize], i)
        };
        let is_accessible = |k: usize, i: usize| is_free(k, i) && !self.barred.is_beyond(k, i);
        let beyond_strokes = match self.barred.beyond.iter().any(Option::is_some) {
            false => Vec::new(),
            true => (0..n)
                .map(|i| {
                    let n_axes = candidate.axes.len();
                    !holds(reached, i) && (0..n_axes).any(|k| is_free(k, i))
                })
                .collect(),
        };
        let has_positions = self.candidates.machine().has_positions();
        let positions = has_positions
            .then(|| cover_share(candidate.axes.len(), new, is_accessible, self.share));
        let vectors = self.candidates.directions().vectors();
        Setup {
            direction: candidate.direction,
            turn: rows(self.candidates.turn_of(candidate)),
            adds,
            reaches: list(reached),
            by_tool,
            tools,
            positions,
            axes: candidate.axes.iter().map(|&d| vectors[d as usize]).collect(),
            candidate: number,
            beyond_strokes,
        }
    }
}
