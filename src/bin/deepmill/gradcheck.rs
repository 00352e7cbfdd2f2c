//! `deepmill gradcheck`: compare every backward pass with central differences, and write fixtures.

use crate::output::Output;
use deepmill::gradcheck::suite::{LIMIT, ProbeShape, Suite, SuiteCase};
use deepmill::gradcheck::{Element, GradientReport};
use deepmill::tables::{Cell, Table};
use deepmill::{Error, Result, atomic_file};
use std::iter::once;
use std::path::PathBuf;

/// Compare the gradients of every layer with central differences, in f64.
///
/// A small random case of every layer, of the blocks made of them and of whole networks. Layers and blocks are checked
/// on several shapes (many, one point, one cell, a patch with empty nodes), and with gradients made wrong on purpose,
/// which must fail. Fixtures hold inputs, parameters, outputs and gradients, so that another implementation can be held
/// against them (docs/gradcheck-fixtures.md).
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill gradcheck --layer octree_conv --out fixtures")]
pub struct Args {
    /// Only this case, by its name in the table. Give it again for further ones.
    #[arg(long, value_name = "NAME")]
    layer: Vec<String>,
    /// Write NAME.safetensors for each case into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Greatest relative error of an element.
    #[arg(long, value_name = "ERROR", default_value_t = LIMIT, allow_negative_numbers = true)]
    limit: f64,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    if !(args.limit >= 0.0 && args.limit.is_finite()) {
        return Err(Error::argument("--limit", args.limit, "0 or more, finite", "leave it out"));
    }
    let cases = chosen(Suite::default().cases()?, &args.layer)?;
    args.out.iter().try_for_each(|folder| atomic_file::check_writable_folder(folder))?;
    let mut table = Table::new(&[
        ("layer", "layer"),
        ("n_shapes", "shapes"),
        ("n_checked", "elements"),
        ("n_controls", "controls"),
        ("error", "worst error"),
        ("tensor", "in"),
        ("index", "at"),
        ("analytic", ""),
        ("numeric", ""),
    ]);
    let (mut failures, mut files) = (Vec::new(), Vec::new());
    let others = others()?;
    for case in &cases {
        let alike = others.iter().flatten().filter(|other| other.name() == case.name());
        let reports = once(case).chain(alike).map(SuiteCase::check).collect::<Result<Vec<_>>>()?;
        let n_controls = case.controls()?.iter().filter(|control| !control.is_lost).count();
        let worst = table_row(&mut table, case, (&reports, n_controls));
        if worst.error > args.limit {
            let place = format!("of {}: {worst}", case.name());
            failures.push(Error::Gradient { place, limit: args.limit });
        }
        if let Some(folder) = &args.out {
            let path = folder.join(format!("{}.safetensors", case.name()));
            case.fixture().write(&path)?;
            files.push(path);
        }
    }
    output.say(table.text());
    let (n, limit) = (failures.len(), args.limit);
    output.say(format!(
        "{} cases, {n} with an error above {limit:e}; every control failed as it must",
        cases.len()
    ));
    output.files(&files);
    let result = serde_json::json!({
        "passed": failures.is_empty(), "limit": limit, "cases": table.json(),
    });
    output.result_with_files(result, &files);
    failures.into_iter().next().map_or(Ok(()), Err)
}

/// Those of these names, all if there are none.
fn chosen(cases: Vec<SuiteCase>, names: &[String]) -> Result<Vec<SuiteCase>> {
    let known: Vec<&str> = cases.iter().map(SuiteCase::name).collect();
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        let expected = format!("one of {}", known.join(", "));
        return Err(Error::argument("--layer", name, expected, "leave it out for all of them"));
    }
    let is_wanted = |case: &SuiteCase| names.is_empty() || names.iter().any(|n| n == case.name());
    Ok(cases.into_iter().filter(is_wanted).collect())
}

/// The cases of layers and blocks on each kind of shape alone.
fn others() -> Result<[Vec<SuiteCase>; 3]> {
    let of = |shape| Suite::default().with_shapes(vec![shape]).layer_cases();
    Ok([of(ProbeShape::Point)?, of(ProbeShape::Cell)?, of(ProbeShape::Patch)?])
}

/// Adds a row; the worst element of all shapes.
fn table_row<'a>(
    table: &mut Table,
    case: &SuiteCase,
    (reports, n_controls): (&'a [GradientReport], usize),
) -> &'a Element {
    let worst = reports.iter().map(GradientReport::worst);
    let worst = worst.max_by(|a, b| a.error.total_cmp(&b.error)).expect("at least one report");
    table.row([
        Cell::text(case.name()),
        Cell::count(reports.len()),
        Cell::count(reports.iter().map(|report| report.n_checked).sum()),
        if n_controls == 0 { Cell::Missing } else { Cell::count(n_controls) },
        Cell::Number(worst.error),
        Cell::text(&worst.name),
        Cell::count(worst.index),
        Cell::Number(worst.analytic),
        Cell::Number(worst.numeric),
    ]);
    worst
}
