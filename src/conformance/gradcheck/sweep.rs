//! The same check over many shapes.

use super::GradientReport;
use super::suite::{self, ProbeShape};
use crate::octree::Octree;
use crate::{Error, Result};

/// Rows and columns at which mistakes of shape show, with their names: one row, one column, square, tall, wide, and
/// more rows than a block of vectors has.
pub fn matrix_shapes() -> [(&'static str, [usize; 2]); 6] {
    [
        ("one row", [1, 5]),
        ("one column", [7, 1]),
        ("square", [4, 4]),
        ("tall", [11, 3]),
        ("wide", [3, 11]),
        ("many rows", [67, 5]),
    ]
}

/// Octrees at which mistakes of geometry show, with their names: a single point, so that fine levels hold one group of
/// nodes; one shape with empty nodes around its patch; points in one cell; many shapes. Depth 3, full to depth 1; the
/// same every time. A convolution checks on `octree.levels[3].conv`, a strided one on `octree.levels[2]`.
///
/// # Errors
/// None that is known: octrees of so few points are built.
pub fn octree_shapes() -> Result<Vec<(&'static str, Octree)>> {
    let named = [
        ("one point", &[ProbeShape::Point][..]),
        ("empty nodes", &[ProbeShape::Patch]),
        ("one cell", &[ProbeShape::Cell]),
        ("many shapes", &[ProbeShape::Patch, ProbeShape::Point, ProbeShape::Cell]),
    ];
    let built = |(name, shapes): (_, &[ProbeShape])| Ok((name, suite::octree(shapes)?));
    named.into_iter().map(built).collect()
}

/// Checks over shapes, and holds each report against `limit`; the reports, in the order of the shapes.
///
/// ```
/// use deepmill::gradcheck::{self, GradcheckSettings};
/// // Twice the sum of every row.
/// let sums = |&[rows, c]: &[usize; 2]| {
///     let x = gradcheck::probe(rows * c, 1);
///     let forward = |v: &[Vec<f64>]| v[0].chunks(c).map(|row| 2.0 * row.iter().sum::<f64>()).collect();
///     let backward = |_: &[Vec<f64>], dy: &[f64]| {
///         vec![dy.iter().flat_map(|dy| vec![2.0 * dy; c]).collect()]
///     };
///     gradcheck::function(&[("x", &x)], forward, backward, &GradcheckSettings::default())
/// };
/// assert_eq!(gradcheck::sweep(gradcheck::matrix_shapes(), 1e-7, sums)?.len(), 6);
/// # Ok::<(), deepmill::Error>(())
/// ```
///
/// # Errors
/// If there is no shape; [`Error::Gradient`] with the shape's name if an error exceeds `limit`; or as `check`.
pub fn sweep<'a, S>(
    shapes: impl IntoIterator<Item = (&'a str, S)>,
    limit: f64,
    mut check: impl FnMut(&S) -> Result<GradientReport>,
) -> Result<Vec<GradientReport>> {
    let mut reports = Vec::new();
    for (name, shape) in shapes {
        let report = check(&shape)?;
        match report.require(limit) {
            Err(Error::Gradient { place, limit }) => {
                return Err(Error::Gradient { place: format!("of {name}: {place}"), limit });
            }
            other => other?,
        }
        reports.push(report);
    }
    if reports.is_empty() {
        let remedy = "a check of nothing proves nothing: give a shape";
        return Err(Error::argument("shapes", "none", "at least one", remedy));
    }
    Ok(reports)
}
