//! Cells of directions: spherical triangles that are cut in four.

use crate::directions::{DirectionSet, Directions};
use glam::DVec3;

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
            DirectionSet::FibonacciHemisphere { .. } | DirectionSet::LatLong { .. } => {
                (DVec3::Z, std::f64::consts::FRAC_PI_2)
            }
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
        let [u, v, w] = crate::directions::basis(self.axis);
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
}
