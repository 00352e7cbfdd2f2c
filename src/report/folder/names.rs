//! Names of files in folders of results.

/// Names of the data files in a report's folder.
pub const LABELS: &str = "labels.npz";
/// See [`LABELS`].
pub const PREDICTIONS: &str = "predictions.npz";
pub use crate::data::files::label_query::{FIXTURES, SURFACE};

/// What of an outcome is not about one tool's answers, beside [`LABELS`].
pub const OUTCOME: &str = "outcome.npz";

/// All that `setups` has computed.
#[doc(hidden)] // of the program
pub const SETUPS: &str = "setups.npz";

/// The surface of a region of interest, mm, beside [`SURFACE`].
pub const REGION: &str = "region.stl";

/// The first tool that reaches each site, beside the folders of several tools.
pub const FIRST_TOOLS: &str = "tools.ply";
