//! Cells of directions: spherical triangles that are cut in four.

use super::labels::DEFAULT_LEVELS;
use crate::tool::directions::{DirectionSet, Directions};
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::{Arc, OnceLock};

/// A spherical triangle of directions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    corners: [DVec3; 3],
}

impl Cell {
    /// A direction within.
    pub fn middle(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (a + b + c).normalize()
    }

    /// No direction of the cell is farther from its middle, radians.
    pub fn radius(&self) -> f64 {
        let middle = self.middle();
        let angle = |c: &DVec3| libm::atan2(middle.cross(*c).length(), middle.dot(*c));
        self.corners.iter().map(angle).fold(0.0, f64::max)
    }

    #[cfg(test)]
    /// Solid angle, steradians (Van Oosterom and Strackee 1983).
    pub fn solid_angle(&self) -> f64 {
        let [a, b, c] = self.corners;
        let volume = a.dot(b.cross(c)).abs();
        2.0 * libm::atan2(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    }

    /// The four cells between the corners and the middles of the sides.
    pub fn quarters(&self) -> [Cell; 4] {
        let [a, b, c] = self.corners;
        let [d, e, f] = [a + b, b + c, c + a].map(DVec3::normalize);
        [[a, d, f], [d, b, e], [f, e, c], [d, e, f]].map(|corners| Cell { corners })
    }
}

/// The directions that a set stands for: all within an angle of an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Domain {
    axis: DVec3,
    half_angle: f64,
}

impl Domain {
    /// What an even set stands for; `None` for a set that means just its own directions.
    pub fn of(directions: &Directions) -> Option<Self> {
        let (axis, half_angle) = match directions.set() {
            DirectionSet::Published
            | DirectionSet::DeepMillPlusPlus
            | DirectionSet::FibonacciHemisphere { .. }
            | DirectionSet::LatLong { .. } => (DVec3::Z, std::f64::consts::FRAC_PI_2),
            DirectionSet::FibonacciSphere { .. } => (DVec3::Z, std::f64::consts::PI),
            DirectionSet::Cone { axis, half_angle_rad, .. } => {
                (DVec3::from_array(*axis).normalize(), *half_angle_rad)
            }
            DirectionSet::Circle { .. } | DirectionSet::List { .. } => return None,
        };
        Some(Domain { axis, half_angle })
    }

    /// Whether a direction belongs to it; its rim does.
    pub fn holds(&self, direction: DVec3) -> bool {
        self.angle(direction) <= self.half_angle + 1e-12
    }

    fn angle(&self, direction: DVec3) -> f64 {
        libm::atan2(self.axis.cross(direction).length(), self.axis.dot(direction))
    }

    /// Whether no direction of the cell belongs to it, but for its rim.
    pub fn misses(&self, cell: &Cell) -> bool {
        if self.half_angle < std::f64::consts::FRAC_PI_2 {
            return self.angle(cell.middle()) - cell.radius() >= self.half_angle;
        }
        // What is left out is convex.
        cell.corners.iter().all(|corner| self.angle(*corner) >= self.half_angle - 1e-12)
    }

    /// The octants about the axis, cut in four `levels` times, that hold some of its directions.
    pub fn cells(&self, levels: usize) -> Vec<Cell> {
        let [u, v, w] = crate::tool::directions::basis(self.axis);
        let mut cells = Vec::new();
        for up in [w, -w] {
            for [a, b] in [[u, v], [v, -u], [-u, -v], [-v, u]] {
                cells.push(Cell { corners: [up, a, b] });
            }
        }
        for _ in 0..levels {
            cells = cells.iter().flat_map(Cell::quarters).collect();
        }
        cells.retain(|cell| !self.misses(cell));
        cells
    }
}

/// Middles of the cells of all levels; the quarters of cell `k` are the cells `4k` to `4k + 3` of the next level.
#[derive(Debug)]
pub(super) struct Hierarchy {
    axis: Vec3,
    /// Least cosine with the axis of a direction of the domain.
    cosine: f32,
    n_first: usize,
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    middles: Vec<Vec3>,
    /// No direction of a cell is farther from its middle, radians.
    radius: f64,
    /// Cells whose middle has a lesser cosine with the axis hold no direction of the domain.
    cosine: f32,
}

/// How often the octants are cut at the first level: 64 cells on the upper half.
const FIRST_CUTS: usize = 2;
/// Levels at which the radius is measured; from there on it is nearly halved.
const MEASURED: usize = 3;

/// The hierarchy of the upper half, which nearly all calls use.
static UPPER: OnceLock<Arc<Hierarchy>> = OnceLock::new();

impl Hierarchy {
    /// The first `n_levels` levels of a domain.
    pub fn of(domain: Domain, n_levels: usize) -> Arc<Self> {
        let upper = domain.axis == DVec3::Z && domain.half_angle == FRAC_PI_2;
        if upper && n_levels == DEFAULT_LEVELS {
            return UPPER.get_or_init(|| Arc::new(Hierarchy::new(domain, n_levels))).clone();
        }
        Arc::new(Hierarchy::new(domain, n_levels))
    }

    fn new(domain: Domain, n_levels: usize) -> Self {
        let mut cells = domain.cells(FIRST_CUTS);
        let n_first = cells.len();
        let mut levels: Vec<Level> = Vec::new();
        let cosine = |angle: f64| libm::cos(angle.min(PI)) as f32 - ROUNDING;
        for level in 0..n_levels {
            if level > 0 {
                cells = cells.iter().flat_map(Cell::quarters).collect();
            }
            let radius = match levels.last() {
                Some(before) if level >= MEASURED => NEARLY_HALF * before.radius,
                _ => cells.iter().map(Cell::radius).fold(0.0, f64::max) + f64::from(ROUNDING),
            };
            levels.push(Level {
                middles: cells.iter().map(|cell| cell.middle().as_vec3()).collect(),
                radius,
                cosine: cosine(domain.half_angle + radius),
            });
        }
        let (axis, cosine) = (domain.axis.as_vec3(), cosine(domain.half_angle));
        Hierarchy { axis, cosine, n_first, levels }
    }

    /// Number of cells of the first level.
    pub fn n_first(&self) -> usize {
        self.n_first
    }

    /// No direction of a cell is farther from its middle, radians.
    pub fn radius(&self, level: usize) -> f64 {
        self.levels[level].radius
    }

    /// A unit vector.
    pub fn middle(&self, level: usize, cell: u32) -> Vec3 {
        self.levels[level].middles[cell as usize]
    }

    /// Whether a direction belongs to the domain; its rim does.
    pub fn holds(&self, direction: Vec3) -> bool {
        self.axis.dot(direction) >= self.cosine
    }

    /// Whether no direction of a cell with this middle belongs to the domain.
    pub fn misses(&self, level: usize, middle: Vec3) -> bool {
        self.axis.dot(middle) < self.levels[level].cosine
    }

    /// Share of one cell in all, nearly.
    pub fn share(&self, level: usize) -> f64 {
        1.0 / (self.n_first << (2 * level)) as f64
    }
}

/// More than the roundings of a direction or its cosine.
const ROUNDING: f32 = 2e-7;
/// More than the ratio of the radii of a small cell and its quarters.
const NEARLY_HALF: f64 = 0.505;

#[cfg(test)]
mod tests {
    use super::*;

    fn domain(set: DirectionSet) -> Domain {
        Domain::of(&Directions::new(set).unwrap()).unwrap()
    }

    #[test]
    fn cells_cover_their_domain_and_nothing_twice() {
        let tau = std::f64::consts::TAU;
        for (set, angle) in [
            (DirectionSet::FibonacciHemisphere { n_dirs: 1 }, tau),
            (DirectionSet::FibonacciSphere { n_dirs: 1 }, 2.0 * tau),
        ] {
            for levels in 0..4 {
                let cells = domain(set.clone()).cells(levels);
                let sum: f64 = cells.iter().map(Cell::solid_angle).sum();
                assert!((sum - angle).abs() < 1e-9, "{sum}");
            }
        }
        let axis = [1.0, 2.0, 2.0];
        let cone = domain(DirectionSet::Cone { axis, half_angle_rad: 0.5, n_dirs: 1 });
        let within = Directions::new(DirectionSet::Cone { axis, half_angle_rad: 0.5, n_dirs: 500 });
        let cells = cone.cells(3);
        for d in within.unwrap().vectors().iter().map(|d| d.as_dvec3()) {
            let near = |cell: &Cell| cell.middle().dot(d).acos() <= cell.radius() + 1e-9;
            assert!(cone.holds(d) && cells.iter().any(near));
        }
        assert!(!cone.holds(DVec3::NEG_X) && cells.len() < 8 * 64 / 4);
    }

    #[test]
    fn no_direction_of_a_cell_is_farther_from_its_middle_than_the_radius() {
        let upper = domain(DirectionSet::FibonacciHemisphere { n_dirs: 1 });
        let hierarchy = Hierarchy::of(upper, DEFAULT_LEVELS);
        let mut cells = upper.cells(FIRST_CUTS);
        for level in 0..DEFAULT_LEVELS {
            assert_eq!(cells.len(), hierarchy.n_first() << (2 * level));
            for (k, cell) in cells.iter().enumerate() {
                let middle = hierarchy.middle(level, k as u32).as_dvec3();
                for corner in cell.corners {
                    let angle = libm::atan2(middle.cross(corner).length(), middle.dot(corner));
                    assert!(angle <= hierarchy.radius(level), "{level} {k} {angle}");
                }
            }
            cells = cells.iter().flat_map(Cell::quarters).collect();
        }
        assert!(hierarchy.holds(Vec3::X) && !hierarchy.holds(Vec3::new(1.0, 0.0, -1e-5)));
        assert!((hierarchy.share(1) * 256.0 - 1.0).abs() < 1e-12);
    }
}
