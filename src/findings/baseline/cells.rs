//! Where a known finding is: cells of a grid in the part's box, and the side that the surface in them faces.

use crate::findings::Bounds;
use crate::geom::Sites;
use glam::DVec3;
use std::collections::BTreeMap;

/// The sides that a surface faces: the largest component of its normal, x, y or z, twice, and one more if it is
/// negative.
pub const N_FACINGS: usize = 6;
/// Surfaces whose normals are further apart than this cosine are on other sides.
const OTHER_SIDE: f64 = -0.5;
/// Edge of a cell, in spacings of sites.
const CELL_SPACINGS: f64 = 2.0;
/// Most cells along the longest edge of the box, so that files stay short.
const MOST_ALONG: f64 = 128.0;

/// Cells in a row along x: facing, z, y, the first and the last x.
pub type Run = [i32; 5];

/// The edge of a cell, mm, for sites of this spacing in a box.
pub fn cell_mm(spacing_mm: f64, [low, high]: Bounds) -> f64 {
    (CELL_SPACINGS * spacing_mm).max((high - low).max_element() / MOST_ALONG)
}

/// The cells of some sites, ascending.
pub fn of_sites(members: &[u32], sites: &Sites, low: DVec3, cell_mm: f64) -> Vec<Run> {
    let cell = |i: &u32| {
        let place = (sites.points[*i as usize].as_dvec3() - low) / cell_mm;
        let [x, y, z] = place.floor().to_array().map(|index| index as i32);
        [facing(sites.normals[*i as usize].as_dvec3()), z, y, x, x]
    };
    let mut cells: Vec<Run> = members.iter().map(cell).collect();
    cells.sort_unstable();
    let mut runs: Vec<Run> = Vec::new();
    for cell in cells {
        match runs.last_mut() {
            Some(run) if run[..3] == cell[..3] && cell[3] <= run[4] + 1 => run[4] = cell[4],
            _ => runs.push(cell),
        }
    }
    runs
}

fn facing(normal: DVec3) -> i32 {
    let n = normal.to_array();
    // The first among equals.
    let axis = (1..3).fold(0, |most, axis| if n[axis].abs() > n[most].abs() { axis } else { most });
    2 * axis as i32 + i32::from(n[axis] < 0.0)
}

/// What a known finding covers.
pub struct Cover {
    /// Where the cells begin, and their edge, mm.
    origin: DVec3,
    cell_mm: f64,
    /// By facing, z and y: first and last x.
    rows: BTreeMap<[i32; 3], Vec<[i32; 2]>>,
    bounds: Bounds,
    normal: DVec3,
    /// How far from its cells, or from its box, it covers, mm.
    around_mm: f64,
}

impl Cover {
    /// Of cells of `cell_mm` that begin at `origin`, of sites in a box; it covers what is no further away than
    /// `around_mm`. Without cells it fills its box, with a surface of this mean normal.
    pub fn new(
        cells: &[Run],
        (origin, cell_mm): (DVec3, f64),
        (bounds, normal): (Bounds, DVec3),
        around_mm: f64,
    ) -> Self {
        let mut rows: BTreeMap<[i32; 3], Vec<[i32; 2]>> = BTreeMap::new();
        for &[facing, z, y, from, to] in cells {
            rows.entry([facing, z, y]).or_default().push([from, to]);
        }
        Cover { origin, cell_mm, rows, bounds, normal, around_mm }
    }

    /// Whether it covers a site.
    pub fn covers_site(&self, sites: &Sites, i: u32) -> bool {
        let at = i as usize;
        self.covers(sites.points[at].as_dvec3(), sites.normals[at].as_dvec3())
    }

    /// Whether it covers a place, where the surface has this normal.
    fn covers(&self, p: DVec3, normal: DVec3) -> bool {
        let Cover { origin, cell_mm, rows, bounds, around_mm, .. } = self;
        let reach = DVec3::splat(if rows.is_empty() { *around_mm } else { cell_mm + around_mm });
        if p.cmplt(bounds[0] - reach).any() || p.cmpgt(bounds[1] + reach).any() {
            return false;
        }
        if rows.is_empty() {
            return normal.dot(self.normal) >= OTHER_SIDE;
        }
        let index = |at: DVec3| ((at - *origin) / *cell_mm).floor().to_array().map(|i| i as i32);
        let (from, to) = (index(p - *around_mm), index(p + *around_mm));
        let is_on_side = |facing: i32| {
            let along = normal[facing as usize / 2];
            (if facing % 2 == 0 { along } else { -along }) > OTHER_SIDE
        };
        let is_in = |runs: &Vec<[i32; 2]>| runs.iter().any(|[a, b]| *a <= to[0] && from[0] <= *b);
        // One row of z at a time, but for cells that are much smaller than the distance.
        let step = if to[2].saturating_sub(from[2]) > 64 { i32::MAX } else { 0 };
        let is_near = |facing: i32| {
            let mut z = from[2];
            loop {
                let last = z.saturating_add(step).min(to[2]);
                let mut near = rows.range([facing, z, from[1]]..=[facing, last, to[1]]);
                let is_beside = |y: i32| (from[1]..=to[1]).contains(&y);
                if near.any(|([_, _, y], runs)| is_beside(*y) && is_in(runs)) {
                    return true;
                }
                if last >= to[2] {
                    return false;
                }
                z = last + 1;
            }
        };
        (0..N_FACINGS as i32).any(|facing| is_on_side(facing) && is_near(facing))
    }
}
