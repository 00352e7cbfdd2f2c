//! Tool axes as a machine takes them: angles of its rotary axes, or of a tilted plane.

use crate::planning::setups::{Machine, plane_euler_deg};
use crate::tables::Cell;
use glam::DVec3;

/// Key and heading of an axis in the first pose, then in the second.
fn of_letter(letter: char) -> [(&'static str, &'static str); 2] {
    match letter {
        'A' => [("a_deg", "A°"), ("a2_deg", "or A°")],
        'B' => [("b_deg", "B°"), ("b2_deg", "or B°")],
        _ => [("c_deg", "C°"), ("c2_deg", "or C°")],
    }
}

/// Columns of the angles: of every rotary axis of a machine file in two poses, or Euler angles of the plane of `3+2`.
pub(super) fn columns(machine: &Machine) -> Vec<(&'static str, &'static str)> {
    match machine {
        Machine::Axes(axes) => {
            let pose = |k: usize| axes.letters().map(move |letter| of_letter(letter)[k]);
            pose(0).chain(pose(1)).collect()
        }
        Machine::Indexed { .. } => {
            vec![("precession_deg", "Z°"), ("nutation_deg", "X'°"), ("rotation_deg", "Z''°")]
        }
        _ => Vec::new(),
    }
}

/// A cell per column, for a tool axis in the coordinates of the setup; a pose that there is not is missing.
pub(super) fn cells(machine: &Machine, tool_axis: DVec3) -> Vec<Cell> {
    match machine {
        Machine::Axes(axes) => {
            let poses = axes.poses(tool_axis);
            let cell = |pose: usize, axis: usize| {
                poses.get(pose).map_or(Cell::Missing, |angles| rounded(angles[axis]))
            };
            (0..2)
                .flat_map(|pose| (0..axes.n_axes()).map(move |axis| (pose, axis)))
                .map(|(pose, axis)| cell(pose, axis))
                .collect()
        }
        Machine::Indexed { .. } => plane_euler_deg(tool_axis).map(rounded).into(),
        _ => Vec::new(),
    }
}

/// Single precision of a tool axis is 0.000004 degrees; never minus zero.
fn rounded(degrees: f64) -> Cell {
    Cell::Given((1e5 * degrees).round() / 1e5 + 0.0)
}
