//! The rest at every site.

use super::super::obstacles::{TriangleObstacles, contacts};
use super::super::profile::{Frame, ProfileTool, Underside};
use super::super::tolerance::Tolerances;
use super::super::tool::Outline;
use super::super::triangle::nearest;
use super::super::{SurfaceOptions, WitnessPose};
use super::footprint::{Cutting, Footprint};
use super::heights::{Buffers, Heights};
use super::pose::{Dropped, Line, Recent};
use super::profile::{AnyTool, Leaves};
use super::swept::Swept;
use super::view::View;
use crate::Result;
use crate::exec::{memory, par};
use crate::geom::Sites;
use crate::simd::extremes::{TILE_HEIGHT, TILE_WIDTH};
use crate::tool::cutter::{Cutter, Profile};
use crate::tool::directions::Directions;
use glam::{DVec2, DVec3};

/// Directions of a site from which poses are searched.
const N_POSES: usize = 6;
/// Pixels along the part's longest side by default, and along the tool's radius at most and at least.
const ACROSS_PART: f64 = 400.0;
const ACROSS_TOOL: [f64; 2] = [64.0, 4.0];
/// Most pixels along the part's longest side, however thin the tool.
const MOST_ACROSS: f64 = 4000.0;
/// Bytes of a pixel: heights, where the tool stops, what it leaves, and windows of rows.
const PIXEL_BYTES: f64 = 64.0;
/// Sites per task.
const BLOCK: usize = 16;
/// Walls nearer to a site than this are its own, mm.
const OWN_WALL_MM: f64 = 0.02;
/// What cuts is shrunk by a little less than what stops, so that it reaches the walls that it touches: share of the
/// gouge tolerance.
const CUTS: f64 = 0.9;
/// Steps over places end at this share of a pixel.
const FINEST: f64 = 1.0 / 64.0;

/// What is known of a site on the way.
#[derive(Debug, Clone)]
struct Search {
    line: Line,
    /// The best so far, ascending by what is left, then by direction.
    best: Vec<Candidate>,
}

#[derive(Debug, Clone, Copy)]
struct Candidate {
    left: f64,
    direction: u32,
    /// Of the axis, across the direction, from the line's begin.
    x: DVec2,
}

impl Search {
    /// Beyond this nothing is of interest.
    fn limit(&self) -> f64 {
        self.best.get(N_POSES - 1).map_or(self.line.length, |worst| worst.left)
    }

    fn push(&mut self, candidate: Candidate) {
        let at = self.best.partition_point(|other| other.left <= candidate.left);
        self.best.insert(at, candidate);
        self.best.truncate(N_POSES);
    }
}

impl TriangleObstacles {
    /// How much a tool leaves at every site, mm, and the pose that leaves least, if the tool removes anything there: 0
    /// and none at those that are not among `which`, their numbers. `docs/rest.md` has the definition.
    ///
    /// ```
    /// use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
    /// use deepmill::directions::Directions;
    /// use deepmill::geom::{Sites, solids};
    /// use deepmill::glam::{DVec3, Vec3};
    ///
    /// // In the inner corner of an angle a ball of radius 3 leaves what its circle does not reach.
    /// let outline = [[0.0, 0.0], [30.0, 0.0], [30.0, 10.0], [10.0, 10.0], [10.0, 30.0], [0.0, 30.0]];
    /// let cap = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    /// let mut part = solids::prism(&outline.map(deepmill::glam::DVec2::from_array), &cap, 20.0);
    /// part.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, -v.z, v.y));
    /// let sites = Sites::new(vec![Vec3::new(11.0, -10.0, 10.0)], vec![Vec3::Z])?;
    /// let obstacles = TriangleObstacles::new(&part, &[])?;
    /// let (tool, up, options) = ("3,30,20,40".parse()?, Directions::up(), SurfaceOptions::default());
    /// let (rests, poses) = obstacles.rests((&sites, &[0]), &tool, &up, &options)?;
    /// assert!((rests[0] - (3.0 - 5f32.sqrt())).abs() < 0.02 && poses[0].is_some());
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`]; if the images would not fit into the memory.
    ///
    /// # Panics
    /// If a number is that of no site.
    pub fn rests(
        &self,
        (sites, which): (&Sites, &[usize]),
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<(Vec<f32>, Vec<Option<WitnessPose>>)> {
        let _floats = par::DefaultFloats::set();
        options.check()?;
        let outline = Outline::new(cutter, options.finish_mm);
        let tolerances = options.tolerance.of_triangles(&outline, &self.chords, &self.bvh)?;
        let contacts = contacts(sites)?;
        let stock = self.stock();
        let line = |&i: &usize| {
            let (from, along) = (contacts[i].point, contacts[i].normal.unwrap_or(DVec3::Z));
            let length = self.length(from, along, stock);
            Search { line: Line { from, along, length }, best: Vec::new() }
        };
        let searches = par::map_blocks(which.len(), BLOCK, |range| {
            which[range].iter().map(line).collect::<Vec<_>>()
        });
        let mut searches: Vec<Search> = searches.into_iter().flatten().collect();
        let frames = self.frames(directions, options)?;
        let pitch = pitch(stock, &outline);
        let of = (cutter.profile(), &outline);
        self.by_images(&mut searches, &frames, (of, tolerances.least, pitch))?;
        let found = match cutter.profile() {
            None => {
                let cutting = Cutting::new(&outline, CUTS * tolerances.least);
                let (bvh, tolerances, of) = (&self.bvh, &tolerances, &outline);
                let dropped = Dropped { bvh, tolerances, outline: of, cutting: &cutting };
                by_poses(&searches, &frames, (&dropped, pitch))
            }
            Some(profile) => {
                let tolerances = (&tolerances, options.finish_mm);
                self.by_any_poses(&searches, &frames, (profile, tolerances, pitch))
            }
        };
        let (mut rests, mut poses) = (vec![0.0; sites.len()], vec![None; sites.len()]);
        for (&i, (mm, pose)) in which.iter().zip(found) {
            rests[i] = mm as f32;
            poses[i] = pose.map(|(frame, reference)| {
                let direction = frames[frame].direction;
                match cutter.profile() {
                    None => WitnessPose::new(&outline, reference, direction),
                    Some(_) => WitnessPose { direction, tip_mm: reference },
                }
            });
        }
        Ok((rests, poses))
    }

    /// Finds the best directions of every line by images.
    fn by_images(
        &self,
        searches: &mut [Search],
        frames: &[Frame],
        ((profile, outline), tolerance, pitch): ((Option<&Profile>, &Outline), f64, f64),
    ) -> Result<()> {
        let shrink =
            (pitch * std::f64::consts::FRAC_1_SQRT_2 + tolerance).min(0.5 * outline.radius());
        let region = self.region(self.stock(), outline);
        let footprint = match profile {
            None => Footprint::new(outline, shrink, pitch),
            Some(profile) => Footprint::of_profile(Underside::new(profile, shrink), pitch),
        };
        let margin = footprint.margin();
        let across = (region[1] - region[0]).length() / pitch + 2.0 * margin as f64;
        let needed = (PIXEL_BYTES * across * across) as u64;
        memory::require("the images of what is left", needed, "leave the rest out")?;
        let buffers = Buffers::default();
        for (k, frame) in frames.iter().enumerate() {
            let view = View::new(frame.axes, region, pitch, margin);
            let heights = Heights::new(view, &self.triangles, &buffers);
            let along = Along { heights, footprint: &footprint, pitch, buffers: &buffers };
            along.search(k as u32, searches);
            along.heights.recycle(&buffers);
        }
        Ok(())
    }

    /// As [`by_poses`], of a tool of any profile.
    fn by_any_poses(
        &self,
        searches: &[Search],
        frames: &[Frame],
        (profile, (tolerances, finish), pitch): (&Profile, (&Tolerances, f64), f64),
    ) -> Vec<Found> {
        let tool = ProfileTool::new(&self.bvh, tolerances, profile, finish);
        let any = AnyTool::new(&tool, profile, CUTS * tolerances.least);
        let steps = [pitch, FINEST * pitch];
        let found = par::map_blocks(searches.len(), BLOCK, |range| {
            let of = |search: &Search| {
                let (line, mut best) = (&search.line, None::<(usize, Leaves)>);
                for candidate in &search.best {
                    let below = best.map_or(line.length, |(_, best)| best.mm);
                    if candidate.left > below {
                        break;
                    }
                    let k = candidate.direction as usize;
                    let found = any.least_straight(line, &frames[k], candidate.x, steps, below);
                    best = found.map(|found| (k, found)).or(best);
                }
                any.least_aside(line, frames, best)
            };
            searches[range].iter().map(of).collect::<Vec<_>>()
        });
        let found = searches.iter().zip(found.into_iter().flatten());
        found
            .map(|(search, leaves)| match leaves {
                None => (search.line.length, None),
                Some((frame, Leaves { mm, tip, .. })) => (mm, Some((frame, tip))),
            })
            .collect()
    }

    /// The part's box.
    fn stock(&self) -> [DVec3; 2] {
        let corners = self.triangles[..self.chords.len()].iter().flatten();
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        corners.fold(nothing, |[low, high], p| [low.min(*p), high.max(*p)])
    }

    /// The part's box, and of fixtures what a tool over it can meet.
    pub(super) fn region(&self, [low, high]: [DVec3; 2], outline: &Outline) -> [DVec3; 2] {
        let fixtures = &self.triangles[self.chords.len()..];
        let finite =
            outline.all_steps().iter().map(|[_, radius]| *radius).filter(|r| r.is_finite());
        let reach = 2.0 * finite.fold(outline.radius(), f64::max);
        let corners = fixtures.iter().flatten().map(|p| p.clamp(low - reach, high + reach));
        corners.fold([low, high], |[low, high], p| [low.min(p), high.max(p)])
    }

    /// How far a line goes within the stock and outside the part.
    pub(super) fn length(&self, from: DVec3, along: DVec3, [low, high]: [DVec3; 2]) -> f64 {
        let mut length = f64::INFINITY;
        for k in 0..3 {
            if along[k] != 0.0 {
                let end = if along[k] > 0.0 { high[k] } else { low[k] };
                length = length.min(((end - from[k]) / along[k]).max(0.0));
            }
        }
        let Some((wall, place)) = self.ray(from, along, OWN_WALL_MM) else { return length };
        // The line would come out of the part there: it has met the other wall of a thin gap already.
        let comes_out = self.facing(place).dot(along) > 0.0;
        comes_out.then(|| self.thin_gap(from, along)).flatten().unwrap_or(wall).min(length)
    }

    /// Width of a gap that is too thin to tell a site's own wall from the other, if there is one. A line that begins at
    /// an edge of needle triangles may cross neither.
    fn thin_gap(&self, from: DVec3, along: DVec3) -> Option<f64> {
        let mut width: Option<f64> = None;
        self.bvh.near(from, OWN_WALL_MM, |place| {
            if self.facing(place).dot(along) < 0.0 {
                let distance = nearest(from, self.bvh.triangle(place)).distance(from);
                width = Some(width.map_or(distance, |least| least.min(distance)));
            }
            false
        });
        width
    }
}

/// Distance of pixels, mm.
fn pitch([low, high]: [DVec3; 2], outline: &Outline) -> f64 {
    let longest = (high - low).max_element();
    let [finest, coarsest] = ACROSS_TOOL.map(|n| outline.radius() / n);
    (longest / ACROSS_PART).clamp(finest, coarsest).max(longest / MOST_ACROSS)
}

/// What is left of a line, mm, and the number of the direction that leaves least, with the reference point.
type Found = (f64, Option<(usize, DVec3)>);

/// For every line.
fn by_poses(
    searches: &[Search],
    frames: &[Frame],
    (dropped, pitch): (&Dropped, f64),
) -> Vec<Found> {
    let found = par::map_blocks(searches.len(), BLOCK, |range| {
        let mut recent = Recent::default();
        let of = |search: &Search| {
            let mut best = (search.line.length, None);
            // The tool of the images is smaller: where it leaves more, the true one does.
            for candidate in &search.best {
                if candidate.left > best.0 {
                    break;
                }
                let frame = candidate.direction as usize;
                let (axes, steps) = (frames[frame].axes, [pitch, FINEST * pitch]);
                let found = dropped.least(&search.line, axes, candidate.x, steps, &mut recent);
                if let Some((mm, reference)) = found.filter(|(mm, _)| *mm < best.0) {
                    best = (mm, Some((frame, reference)));
                }
            }
            best
        };
        searches[range].iter().map(of).collect::<Vec<_>>()
    });
    found.into_iter().flatten().collect()
}

/// One direction.
struct Along<'a> {
    heights: Heights,
    footprint: &'a Footprint,
    pitch: f64,
    buffers: &'a Buffers,
}

impl Along<'_> {
    fn search(&self, direction: u32, searches: &mut [Search]) {
        let view = &self.heights.view;
        let [n_across, n_along] = view.n_tiles();
        let lists = par::map_blocks(searches.len(), BLOCK, |range| {
            let mut tiles = Vec::new();
            searches[range].iter().for_each(|search| self.mark(search, &mut tiles));
            tiles
        });
        let mut wanted = vec![false; n_across * n_along];
        lists.into_iter().flatten().for_each(|tile| wanted[tile as usize] = true);
        if !wanted.contains(&true) {
            return;
        }
        let swept = Swept::new([&self.heights; 2], self.footprint, &wanted, self.buffers);
        par::for_each_block(searches, BLOCK, |_, searches| {
            for search in searches {
                if let Some((left, x)) = self.first_removed(search, &swept) {
                    search.push(Candidate { left, direction, x });
                }
            }
        });
        swept.recycle(self.buffers);
    }

    /// Places along a line that are of interest, a pixel apart: its length there, column, row and height.
    fn places(&self, search: &Search) -> impl Iterator<Item = (f64, [f64; 3])> {
        let (line, limit, pitch) = (search.line, search.limit(), self.pitch);
        let view = &self.heights.view;
        let (from, way) = (view.project(line.from), view.turn(line.along));
        let n = (limit / pitch).ceil() as usize;
        (0..=n).map(move |k| {
            let r = (k as f64 * pitch).min(limit);
            (r, [from[0] + r * way[0], from[1] + r * way[1], from[2] + r * way[2]])
        })
    }

    /// Whether the part is above a place, so that nothing removes it along this direction.
    fn is_covered(&self, [x, y, height]: [f64; 3]) -> bool {
        let width = self.heights.view.width;
        let first = y as usize * width + x as usize;
        let image = &self.heights.image;
        let around =
            [image[first], image[first + 1], image[first + width], image[first + width + 1]];
        let least = around.into_iter().fold(f32::INFINITY, f32::min);
        f64::from(least) > height
    }

    /// The tiles that are needed for a line.
    fn mark(&self, search: &Search, tiles: &mut Vec<u32>) {
        let [n_across, _] = self.heights.view.n_tiles();
        let mut last = [usize::MAX; 4];
        for (_, at) in self.places(search) {
            if self.is_covered(at) {
                continue;
            }
            let [x, y] = [at[0] as usize, at[1] as usize];
            let corners = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]];
            let of = |[x, y]: [usize; 2]| y / TILE_HEIGHT * n_across + x / TILE_WIDTH;
            let now = corners.map(of);
            if now != last {
                tiles.extend(now.map(|tile| tile as u32));
                last = now;
            }
        }
    }

    /// Where a line is removed first, below its limit, and where the axis is then, from the line's begin.
    fn first_removed(&self, search: &Search, swept: &Swept) -> Option<(f64, DVec2)> {
        let mut before: Option<(f64, f64)> = None;
        let limit = search.limit();
        for (r, at) in self.places(search) {
            if self.is_covered(at) {
                before = None;
                continue;
            }
            let (below, pixel) = swept.least(at[0], at[1]);
            let above = at[2] - below;
            if above < 0.0 {
                before = Some((r, above));
                continue;
            }
            let left = match before {
                Some((r_before, below)) => r_before + (r - r_before) * below / (below - above),
                None => r,
            };
            let is_less = left < limit || (left <= limit && search.best.len() < N_POSES);
            return is_less.then(|| {
                let begin = self.heights.view.project(search.line.from);
                let [x, y] = swept.axis_at(pixel, self.footprint);
                (left, DVec2::new(x - begin[0], y - begin[1]) * self.pitch)
            });
        }
        None
    }
}
