//! The suite of gradient checks: a small random case of every layer, of the blocks made of them, and of whole networks.
//!
//! A case knows the worst error of its gradients ([`SuiteCase::check`]) and the numbers that another
//! implementation needs to be compared ([`SuiteCase::fixture`]). Seeds are fixed, so both are the same every time.
//!
//! ```
//! use deepmill::gradcheck::suite::Suite;
//! for case in Suite::default().cases()?.iter().filter(|case| case.name() == "linear") {
//!     case.check()?.require(1e-7)?;
//!     assert!(case.fixture().get("grad.linear.weight").is_some());
//! }
//! # Ok::<(), deepmill::Error>(())
//! ```
//!
//! No probe comes near a kink of a ReLU, by construction: where batch norm feeds a ReLU over `n` rows, a
//! normalized value is at most `√(n - 1)`, so with weights up to `0.5 / √n` and biases of magnitude 1 and more
//! every input of the ReLU has magnitude 0.5 and more. Every fourth channel is off, in every layer.

mod blocks;
mod case;
mod layers;
mod networks;
mod probes;

use super::fixture::Fixture;
use super::{Control, GradientReport};
use crate::Result;
use crate::model::policy::MemoryPolicy;
use crate::octree::Octree;
use case::Checked;
use std::fmt;

/// Greatest relative error of a right gradient of the suite.
pub const LIMIT: f64 = 1e-7;

/// The points of one shape of the suite's batch, in an octree of depth 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProbeShape {
    /// Nine points on a curved patch, with empty nodes around them.
    Patch,
    /// A single point.
    Point,
    /// Five points in one cell.
    Cell,
}

/// The octree of some shapes.
pub(super) fn octree(shapes: &[ProbeShape]) -> Result<Octree> {
    Ok(probes::batch(shapes, &probes::input())?.octree)
}

/// What the cases are made for.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Suite {
    /// The batch, at least one shape.
    pub shapes: Vec<ProbeShape>,
    /// What blocks and networks save for backward.
    pub policy: MemoryPolicy,
}

setters!(Suite {
    with_shapes(shapes: Vec<ProbeShape>),
    with_policy(policy: MemoryPolicy),
});

impl Default for Suite {
    /// One shape of each kind, the policy of training.
    fn default() -> Self {
        let shapes = vec![ProbeShape::Patch, ProbeShape::Point, ProbeShape::Cell];
        Suite { shapes, policy: MemoryPolicy::default() }
    }
}

impl Suite {
    /// Layers, then blocks, then networks; no two of the same name.
    ///
    /// # Errors
    /// If there are no shapes.
    pub fn cases(&self) -> Result<Vec<SuiteCase>> {
        let mut cases = self.layer_cases()?;
        cases.extend(networks::cases(self)?);
        Ok(cases)
    }

    /// [`Suite::cases`] without whole networks.
    ///
    /// # Errors
    /// As [`Suite::cases`].
    pub fn layer_cases(&self) -> Result<Vec<SuiteCase>> {
        let octree = octree(&self.shapes)?;
        let mut cases = layers::cases(&octree)?;
        cases.extend(blocks::cases(&octree, &self.policy)?);
        Ok(cases)
    }
}

/// A layer or network with the numbers at which it is checked.
pub struct SuiteCase {
    name: &'static str,
    formula: &'static str,
    constants: Vec<(&'static str, f64)>,
    checked: Box<dyn Checked>,
}

impl SuiteCase {
    /// Name: lower case, words joined by `_`.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What is computed, in the names of the fixture's arrays.
    pub fn formula(&self) -> &'static str {
        self.formula
    }

    /// Compares the gradients with central differences.
    ///
    /// # Errors
    /// As [`super::function`]; a large error of a gradient is no error here, see [`GradientReport::require`].
    pub fn check(&self) -> Result<GradientReport> {
        self.checked.check()
    }

    /// Negative controls of the check at [`LIMIT`]; none of whole networks.
    ///
    /// # Errors
    /// As [`super::negative_control`].
    pub fn controls(&self) -> Result<Vec<Control>> {
        self.checked.controls()
    }

    /// Inputs, parameters, geometry, outputs and gradients.
    pub fn fixture(&self) -> Fixture {
        let SuiteCase { name: case, formula, constants, .. } = self;
        let (constants, arrays) = (constants.clone(), Vec::new());
        let mut fixture = Fixture { case, formula, constants, arrays };
        self.checked.record(&mut fixture);
        fixture
    }

    /// With a number that the arrays do not tell.
    fn constant(mut self, name: &'static str, value: f64) -> Self {
        self.constants.push((name, value));
        self
    }
}

impl fmt::Debug for SuiteCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SuiteCase { name, formula, constants, .. } = self;
        let mut shown = f.debug_struct("SuiteCase");
        shown.field("name", name).field("formula", formula).field("constants", constants);
        shown.finish_non_exhaustive()
    }
}
