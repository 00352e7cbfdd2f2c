//! Bodies of a STEP file, and their places.

use glam::DMat4;

/// A solid, or where there is none, surfaces that may bound one; by their number in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Body {
    /// `MANIFOLD_SOLID_BREP`, `BREP_WITH_VOIDS`.
    Solid(u64),
    /// `SHELL_BASED_SURFACE_MODEL`.
    Shells(u64),
}

impl Body {
    pub fn id(self) -> u64 {
        match self {
            Body::Solid(id) | Body::Shells(id) => id,
        }
    }

    /// For messages.
    pub fn name(self) -> String {
        match self {
            Body::Solid(id) => format!("solid #{id}"),
            Body::Shells(id) => format!("surfaces #{id}"),
        }
    }
}

/// A body at a place.
pub struct Placed {
    pub body: Body,
    /// From its own coordinates to those of the file, in the file's unit.
    pub place: DMat4,
}
