//! Cylinders and cones that tools are made of.

use crate::Result;
use crate::tool::cutter::positive;

/// A cylinder or cone of a solid of revolution.
///
/// ```
/// use deepmill::cutter::{Assembly, Section, TipShape};
///
/// let end = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
/// let flutes = Section::cylinder(12.0, 3.0);
/// let shank = Section { length_mm: 25.0, lower_radius_mm: 3.0, upper_radius_mm: 4.0 }; // a cone
/// let tool = Assembly::new(end, &[flutes, shank], &[Section::cylinder(20.0, 15.0)], 40.0)?;
/// assert_eq!((tool.stick_out_mm(), tool.flutes_mm()), (40.0, 12.0));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Height, mm.
    pub length_mm: f64,
    /// Radius at its lower end, mm.
    pub lower_radius_mm: f64,
    /// Radius at its upper end, mm.
    pub upper_radius_mm: f64,
}

impl Section {
    /// A cylinder.
    pub fn cylinder(length_mm: f64, radius_mm: f64) -> Self {
        Section { length_mm, lower_radius_mm: radius_mm, upper_radius_mm: radius_mm }
    }

    pub(super) fn check(&self, name: &'static str) -> Result<()> {
        positive(name, self.length_mm)?;
        positive(name, self.lower_radius_mm)?;
        positive(name, self.upper_radius_mm)
    }
}
