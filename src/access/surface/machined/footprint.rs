//! A tool in pixels.

use super::super::profile::Underside;
use super::super::tool::{Outline, Tip};
use super::heights::BLOCK;
use crate::simd::extremes::TILE_WIDTH;

/// A shrunk tool over the pixels around its axis.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// What cuts, the nearest to the axis first.
    pub groups: Vec<Group>,
    /// Pixels from the axis to the farthest group, whole blocks.
    pub reach: usize,
    /// What does not cut.
    pub discs: Vec<Disc>,
    /// Height above the reference point of a half-space, mm.
    pub spindle: Option<f32>,
}

/// What cuts, over a block of pixels.
#[derive(Debug, Clone)]
pub struct Group {
    /// Blocks from the axis to the group's first pixel.
    pub block: [isize; 2],
    /// The least height.
    pub least: f32,
    /// Columns and rows from the axis, and the height above the reference point, mm.
    pub pixels: Vec<([isize; 2], f32)>,
}

/// A step that does not cut.
#[derive(Debug, Clone, Copy)]
pub struct Disc {
    /// In pixels.
    pub radius: f64,
    /// Above the reference point, mm.
    pub height: f32,
}

/// The surface of revolution below what cuts.
#[derive(Debug, Clone)]
pub struct Cutting {
    surface: Surface,
    pub radius: f64,
}

#[derive(Debug, Clone)]
enum Surface {
    Steps {
        tip: Tip,
        /// Height above the reference point and radius, mm.
        steps: Vec<[f64; 2]>,
    },
    /// From the tip.
    Profile(Underside),
}

impl Cutting {
    /// After shrinking by less than the tip's radius.
    pub fn new(outline: &Outline, shrink: f64) -> Self {
        let tip = outline.tip(shrink);
        let steps: Vec<_> = outline
            .cutting()
            .map(|[height, radius]| [height + shrink, radius - shrink])
            .filter(|[_, radius]| *radius > 0.0)
            .collect();
        let widest = steps.iter().fold(tip.lower_end()[1], |a, [_, radius]| a.max(*radius));
        Cutting { surface: Surface::Steps { tip, steps }, radius: widest }
    }

    /// Of a tool of any profile, which is seen from below.
    pub fn of_profile(underside: Underside) -> Self {
        let radius = underside.radius();
        Cutting { surface: Surface::Profile(underside), radius }
    }

    /// Lowest height above the reference point at a distance from the axis within the radius, mm.
    #[inline]
    pub fn height(&self, distance: f64) -> f64 {
        let (tip, steps) = match &self.surface {
            Surface::Steps { tip, steps } => (*tip, steps),
            Surface::Profile(underside) => return underside.height(distance),
        };
        let tip = match tip {
            Tip::Round { ring, radius } if distance <= ring + radius => {
                let beyond = (distance - ring).max(0.0);
                -(radius * radius - beyond * beyond).max(0.0).sqrt()
            }
            Tip::Flat { height, radius } if distance <= radius => height,
            _ => f64::INFINITY,
        };
        let wide = |[_, radius]: &&[f64; 2]| *radius >= distance;
        steps.iter().find(wide).map_or(tip, |[height, _]| height.min(tip))
    }
}

impl Footprint {
    /// Pixels within the radius of the widest disc.
    pub fn widest(&self) -> usize {
        self.discs.iter().map(|disc| disc.radius.floor() as usize).fold(0, usize::max)
    }

    /// The greatest height of what cuts above the reference point, mm.
    pub fn highest(&self) -> f32 {
        let heights = self.groups.iter().flat_map(|group| &group.pixels).map(|(_, height)| *height);
        heights.fold(f32::NEG_INFINITY, f32::max)
    }

    /// Pixels of a view beside what is of interest: the tool beside a tile of what it leaves, and that beside where it
    /// stops.
    pub fn margin(&self) -> usize {
        2 * self.reach + 2 * TILE_WIDTH
    }

    /// A tool shrunk by `shrink` mm, which is less than its tip's radius.
    pub fn new(outline: &Outline, shrink: f64, pitch: f64) -> Self {
        let upper = outline.upper().map(|[height, radius]| [height + shrink, radius - shrink]);
        Footprint::of(&Cutting::new(outline, shrink), &upper.collect::<Vec<_>>(), pitch)
    }

    /// A tool of any profile, which is seen from below.
    pub fn of_profile(underside: Underside, pitch: f64) -> Self {
        let discs = underside.discs();
        Footprint::of(&Cutting::of_profile(underside), &discs, pitch)
    }

    /// `upper` are heights and radii of what does not cut, mm.
    fn of(cutting: &Cutting, upper: &[[f64; 2]], pitch: f64) -> Self {
        let reach = ((cutting.radius / pitch).floor() as usize + 1).next_multiple_of(BLOCK);
        let n_blocks = (reach / BLOCK) as isize;
        let mut groups = Vec::new();
        for [y, x] in (-n_blocks..n_blocks).flat_map(|y| (-n_blocks..n_blocks).map(move |x| [y, x]))
        {
            let block = BLOCK as isize;
            let within = |[dx, dy]: [isize; 2]| {
                let distance = (dx as f64).hypot(dy as f64) * pitch;
                let height = (distance <= cutting.radius).then(|| cutting.height(distance) as f32);
                height.filter(|height| height.is_finite()).map(|height| ([dx, dy], height))
            };
            let offsets =
                (0..block * block).map(|k| [x * block + k % block, y * block + k / block]);
            let pixels: Vec<_> = offsets.filter_map(within).collect();
            let least = pixels.iter().fold(f32::INFINITY, |a, (_, height)| a.min(*height));
            if !pixels.is_empty() {
                groups.push(Group { block: [x, y], least, pixels });
            }
        }
        let from_axis = |group: &Group| {
            let [x, y] = group.block.map(|b| 2 * b + 1);
            (x * x + y * y, group.block)
        };
        groups.sort_by_key(from_axis);
        let discs = upper.iter().filter(|[_, radius]| *radius > 0.0 && radius.is_finite());
        let discs = discs
            .map(|[height, radius]| Disc { radius: radius / pitch, height: *height as f32 })
            .collect();
        let spindle = upper.iter().find(|[_, radius]| radius.is_infinite());
        let spindle = spindle.map(|[height, _]| *height as f32);
        Footprint { groups, reach, discs, spindle }
    }
}
