//! The machined part: the part with all that no tool removes.

use super::super::SurfaceOptions;
use super::super::cells::Domain;
use super::super::obstacles::{TriangleObstacles, tested};
use super::super::profile::{Frame, ProfileTool, Underside};
use super::super::tool::Outline;
use super::aside::Aside;
use super::bodies::{Nodes, RestBody};
use super::footprint::Footprint;
use super::grid::Grid;
use super::heights::{BLOCK, Buffers, Heights};
use super::swept::Swept;
use super::view::View;
use crate::exec::{memory, par};
use crate::geom::Mesh;
use crate::geom::inside::Lattice;
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::DVec3;
use std::collections::BTreeMap;
use std::mem;

/// What is to be machined.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// Closed and oriented.
    pub part: &'a Mesh,
    /// Least and greatest corner of the box of the stock, mm.
    pub stock_box: [DVec3; 2],
    /// The stock within that box, closed and oriented, if it is no box.
    pub stock: Option<&'a Mesh>,
    /// Step of the lattice, mm.
    pub accuracy_mm: f64,
}

/// The rest of a set of tools.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Machined {
    /// Volume that each tool alone leaves, mm³; none if there are several setups.
    pub alone_mm3: Vec<f64>,
    /// Per setup, the volume that is left after each tool in order, mm³.
    pub after_mm3: Vec<Vec<f64>>,
    /// What all tools leave, the largest body first.
    pub bodies: Vec<RestBody>,
    /// Times that what is left was an obstacle itself.
    pub n_rounds: usize,
}

/// Pixels of a step of the lattice.
const PIXELS: f64 = 2.0;
/// Rounds after which what is left is taken as it is.
const MOST_ROUNDS: usize = 6;

impl TriangleObstacles {
    /// What a set of tools leaves of a stock: the least fixed point of *left is what no tool removes that is clear of
    /// the part and of what is left*, on a lattice; of several setups, each with its directions, one after the other.
    /// `report` is given how much is done, and may stop it.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`]; if the part or the stock has no inside, or the lattice would not fit into the
    /// memory; those of `report`.
    #[doc(hidden)] // of `analysis`
    pub fn machine(
        &self,
        job: &Job,
        cutters: &[&Cutter],
        setups: &[Directions],
        options: &SurfaceOptions,
        report: &mut dyn FnMut(usize, usize) -> Result<()>,
    ) -> Result<Machined> {
        let _floats = par::DefaultFloats::set();
        options.check()?;
        let lattice = lattice(job)?;
        let pitch = job.accuracy_mm / PIXELS;
        let tools: Vec<Tool> = cutters
            .iter()
            .map(|cutter| self.tool(cutter, pitch, options))
            .collect::<Result<_>>()?;
        let part = &self.triangles[..self.chords.len()];
        let setups: Vec<Vec<Frame>> =
            setups.iter().map(|of| self.frames(of, options)).collect::<Result<_>>()?;
        let region = tools.iter().map(|tool| self.region(job.stock_box, &tool.outline));
        let region =
            region.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or(job.stock_box);
        let mut grid = Grid::new(lattice, job.stock_box, [Some(job.part), job.stock])?;
        let (mut alone_mm3, mut after_mm3) = (Vec::new(), Vec::new());
        let (mut n_rounds, n_setups) = (0, setups.len());
        for (k, frames) in setups.iter().enumerate() {
            let n = tools.len() * frames.len();
            let mut check = || report(k * n, n * n_setups);
            let aside = tools.iter().map(|tool| {
                let any = tool.any.as_ref();
                any.map(|any| Aside::new(any, part, frames, job.accuracy_mm, &mut check))
                    .transpose()
            });
            let aside = aside.collect::<Result<_>>()?;
            let pass = Pass {
                obstacles: self,
                tools: &tools,
                aside,
                fresh: &grid,
                each_alone: n_setups == 1,
                order: &spread(frames.len()),
                pitch,
                region,
                stock_box: job.stock_box,
            };
            let (found, n) =
                pass.rounds(frames, &mut |done, n| report(k * n + done, n * n_setups))?;
            n_rounds = n_rounds.max(n);
            alone_mm3 = found.alone_mm3;
            after_mm3.push(found.after_mm3);
            grid = found.grid;
        }
        let bodies = Nodes::new(&grid, &self.bvh).bodies(&grid, &self.bvh);
        Ok(Machined { alone_mm3, after_mm3, bodies, n_rounds })
    }

    /// The directions of a set, and those that the part suggests where the set represents others too and these are
    /// searched.
    pub(super) fn frames(
        &self,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Vec<Frame>> {
        let domain = Domain::of(directions).filter(|_| options.refinement.is_some());
        Ok(Frame::tested((&tested(directions)?, domain), &self.bvh))
    }

    fn tool(&self, cutter: &Cutter, pitch: f64, options: &SurfaceOptions) -> Result<Tool<'_>> {
        let outline = Outline::new(cutter, options.finish_mm);
        let tolerances = options.tolerance.of_triangles(&outline, &self.chords, &self.bvh)?;
        let shrink = pitch * std::f64::consts::FRAC_1_SQRT_2 + tolerances.least;
        if shrink > 0.5 * outline.radius() {
            let found =
                format!("{} mm for a tool of radius {} mm", PIXELS * pitch, outline.radius());
            let expected = format!("at most {} mm", short(0.6 * PIXELS * outline.radius()));
            let remedy = "choose a finer accuracy, or leave the tool out";
            return Err(Error::argument("accuracy", found, expected, remedy));
        }
        let Some(profile) = cutter.profile() else {
            let footprint = Footprint::new(&outline, shrink, pitch);
            return Ok(Tool { outline, footprint, any: None });
        };
        let footprint = Footprint::of_profile(Underside::new(profile, shrink), pitch);
        let any = ProfileTool::new(&self.bvh, &tolerances, profile, options.finish_mm);
        Ok(Tool { outline, footprint, any: Some(any) })
    }
}

/// What is the same in every round.
struct Pass<'a> {
    obstacles: &'a TriangleObstacles,
    tools: &'a [Tool<'a>],
    /// Of tools given by their profile.
    aside: Vec<Option<Aside<'a>>>,
    /// What is not removed yet.
    fresh: &'a Grid,
    /// Whether what each tool leaves alone is wanted.
    each_alone: bool,
    order: &'a [usize],
    pitch: f64,
    region: [DVec3; 2],
    stock_box: [DVec3; 2],
}

/// The result of a round.
struct Round {
    grid: Grid,
    alone_mm3: Vec<f64>,
    after_mm3: Vec<f64>,
    /// Of each tool and direction, where the tool stops.
    stops: Vec<Vec<Option<Stops>>>,
}

/// Where a tool stops along a direction.
struct Stops {
    view: View,
    /// The least height of every block of pixels, row by row, but no lower than it must be for the lowest of the stock.
    lowest: Vec<f32>,
}

impl Stops {
    /// Whether a step of the tool, a radius in pixels and a height above the reference point, may be as low as `rest`,
    /// mm.
    fn may_meet(&self, (radius, height): (f64, f32), rest: &[DVec3]) -> bool {
        let width = self.view.width / BLOCK;
        let n_rows = self.lowest.len() / width;
        let deepest = self.lowest.iter().fold(f32::INFINITY, |a, b| a.min(*b)) + height;
        // The highest of the rest over every block, where it is high enough for any place of the tool.
        let mut high = BTreeMap::<(usize, usize), f32>::new();
        for point in rest {
            let [x, y, z] = self.view.project(*point);
            if z as f32 > deepest {
                let block = (y.round() as usize / BLOCK, x.round() as usize / BLOCK);
                let highest = high.entry(block).or_insert(f32::NEG_INFINITY);
                *highest = highest.max(z as f32);
            }
        }
        // The spindle is as wide as the image.
        let n = (radius / BLOCK as f64).ceil().min((width + n_rows) as f64) as usize + 1;
        high.into_iter().any(|((row, column), z)| {
            let columns = column.saturating_sub(n)..(column + n + 1).min(width);
            let rows = row.saturating_sub(n)..(row + n + 1).min(n_rows);
            let is_lower = |lowest: &f32| z > lowest + height;
            rows.clone().any(|row| self.lowest[row * width..][columns.clone()].iter().any(is_lower))
        })
    }
}

impl Pass<'_> {
    /// The least height of the stock.
    fn bottom(&self, view: &View) -> f32 {
        let [low, high] = self.stock_box;
        let corner = |k: u32| {
            let end = |axis: usize| if k >> axis & 1 == 1 { high[axis] } else { low[axis] };
            view.project(DVec3::new(end(0), end(1), end(2)))[2]
        };
        (0..8).map(corner).fold(f64::INFINITY, f64::min) as f32
    }

    fn volume(&self, grid: &Grid) -> f64 {
        Nodes::new(grid, &self.obstacles.bvh).volume_mm3(grid, &self.obstacles.bvh)
    }

    /// All tools along all directions until what is left stays, and the number of rounds.
    fn rounds(
        &self,
        frames: &[Frame],
        report: &mut dyn FnMut(usize, usize) -> Result<()>,
    ) -> Result<(Round, usize)> {
        let (mut rest, mut alone_mm3) = (Vec::new(), Vec::new());
        let mut round = 0;
        loop {
            round += 1;
            let mut found = self.run(frames, &rest, &mut |done, n| report(done, n * round))?;
            if round == 1 {
                alone_mm3 = mem::take(&mut found.alone_mm3);
            }
            let points = Nodes::new(&found.grid, &self.obstacles.bvh).points(&found.grid);
            let is_last = points == rest || round == MOST_ROUNDS;
            let may_meet = || {
                let mut aside = self.aside.iter().flatten();
                self.may_meet(&found.stops, &points) || aside.any(|aside| aside.may_meet(&points))
            };
            if is_last || !may_meet() {
                found.alone_mm3 = alone_mm3;
                return Ok((found, round));
            }
            rest = points;
        }
    }

    /// All tools along all directions, with `rest`, mm, in the way of what does not cut.
    fn run(
        &self,
        frames: &[Frame],
        rest: &[DVec3],
        report: &mut dyn FnMut(usize, usize) -> Result<()>,
    ) -> Result<Round> {
        let (n_steps, mut n_done) = (self.tools.len() * self.order.len(), 0);
        let buffers = Buffers::default();
        let mut all: Option<Grid> = None;
        let (mut alone_mm3, mut after_mm3, mut stops) = (Vec::new(), Vec::new(), Vec::new());
        for (tool, aside) in self.tools.iter().zip(&self.aside) {
            // What each leaves alone is of the first round; after it, tools go on with what others have left.
            let mut grid = match all.take() {
                Some(others) if !self.each_alone || !rest.is_empty() => others,
                others => {
                    all = others;
                    self.fresh.clone()
                }
            };
            let mut of_tool: Vec<Option<Stops>> = frames.iter().map(|_| None).collect();
            for &k in self.order {
                report(n_done, n_steps)?;
                n_done += 1;
                let view =
                    View::new(frames[k].axes, self.region, self.pitch, tool.footprint.margin());
                let heights = Heights::new(view, &self.obstacles.triangles, &buffers);
                let wanted = grid.wanted(&heights);
                if wanted.contains(&true) {
                    let upper = (!rest.is_empty()).then(|| heights.raised_to(rest, &buffers));
                    let both = [&heights, upper.as_ref().unwrap_or(&heights)];
                    let swept = Swept::new(both, &tool.footprint, &wanted, &buffers);
                    grid.raise(&heights, &swept);
                    let lowest = swept.recycle(&buffers);
                    let floor = self.bottom(&heights.view) - tool.footprint.highest();
                    let lowest = lowest.into_iter().map(|stop| stop.max(floor)).collect();
                    of_tool[k] = Some(Stops { view: heights.view.clone(), lowest });
                    upper.into_iter().for_each(|upper| upper.recycle(&buffers));
                }
                heights.recycle(&buffers);
            }
            if let Some(aside) = aside {
                aside.raise(&mut grid, rest);
            }
            stops.push(of_tool);
            if self.each_alone && rest.is_empty() {
                alone_mm3.push(self.volume(&grid));
            }
            let both = match all.take() {
                Some(mut all) => {
                    all.merge(&grid);
                    all
                }
                None => grid,
            };
            after_mm3.push(self.volume(&both));
            all = Some(both);
        }
        report(n_steps, n_steps)?;
        let grid = all.unwrap_or_else(|| self.fresh.clone());
        Ok(Round { grid, alone_mm3, after_mm3, stops })
    }

    /// Whether what does not cut of a tool may meet what is left, where the tool stops.
    fn may_meet(&self, stops: &[Vec<Option<Stops>>], rest: &[DVec3]) -> bool {
        self.tools.iter().zip(stops).any(|(tool, stops)| {
            let Footprint { discs, spindle, .. } = &tool.footprint;
            let mut steps: Vec<(f64, f32)> =
                discs.iter().map(|disc| (disc.radius, disc.height)).collect();
            steps.extend(spindle.map(|height| (f64::INFINITY, height)));
            let meets = par::map(stops.len(), |k| {
                let Some(stops) = &stops[k] else { return false };
                steps.iter().any(|step| stops.may_meet(*step, rest))
            });
            meets.contains(&true)
        })
    }
}

struct Tool<'a> {
    outline: Outline,
    footprint: Footprint,
    /// Of a tool given by its profile.
    any: Option<ProfileTool<'a>>,
}

/// The nodes of the stock's box, with one more beyond each face.
fn lattice(job: &Job) -> Result<Lattice> {
    let ([low, high], step) = (job.stock_box, job.accuracy_mm);
    if !(step > 0.0 && step.is_finite()) {
        let expected = "a positive length";
        return Err(Error::argument("accuracy", step, expected, "give it in mm"));
    }
    let n_nodes = ((high - low) / step + 2.0).max(DVec3::ONE).element_product();
    let n_pixels = ((high - low).length() * PIXELS / step).powi(2);
    let needed = 3.0 * Grid::bytes(n_nodes) + 64.0 * n_pixels;
    memory::require(
        "the lattice of the machined part",
        needed as u64,
        "choose a coarser accuracy",
    )?;
    let Lattice { origin, step_mm, counts } = Lattice::covering(low, high, step)?;
    Ok(Lattice { origin: origin - step_mm, step_mm, counts: counts.map(|n| n + 2) })
}

/// Numbers in an order in which neighbors in the list are far from one another: what most directions remove is gone
/// after the first of them.
fn spread(n: usize) -> Vec<usize> {
    let mut stride = ((n as f64 * 0.618).round() as usize).max(1);
    let divisor = |mut a: usize, mut b: usize| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    while divisor(stride, n) != 1 {
        stride += 1;
    }
    (0..n).map(|k| k * stride % n).collect()
}

fn short(x: f64) -> f64 {
    (1e3 * x).floor() / 1e3
}
