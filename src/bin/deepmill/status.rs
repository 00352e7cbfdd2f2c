//! `report --compare FILE.txt`: labels beside a status of every vertex, or a matrix of directions by vertices, of
//! another program.

use crate::output::Output;
use deepmill::data::files::matrix::{AccessMatrix, MatrixFile};
use deepmill::data::files::{LabelFile, safety};
use deepmill::tables::{Cell, Table};
use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::path::Path;

/// Whether a file is one of these.
pub fn is_status(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("txt"))
}

/// Says how often the answers of `labels`, which are in `folder`, agree with the file; as JSON for the result.
pub fn compare(path: &Path, labels: &LabelFile, folder: &Path, output: &Output) -> Result<Value> {
    let matrix = AccessMatrix::read_text(path)?;
    let (status, matrix) = match matrix.n_sites() {
        // Lines count the vertices: none may be passed over.
        1 => (safety::read(path)?, None),
        _ => (matrix.reached(), Some(matrix)),
    };
    let site_of = sites(path, labels, status.len())?;
    // Rows: what the file has; columns: accessible, inaccessible, tip does not fit.
    let mut counts = [[0usize; 3]; 2];
    for (reached, site) in status.iter().zip(&site_of) {
        if let Some(site) = site {
            counts[usize::from(!reached)][labels.labels.answers.of(*site) as usize] += 1;
        }
    }
    let n_left_out = site_of.iter().filter(|site| site.is_none()).count();
    let n: usize = counts.iter().flatten().sum();
    let mut table = Table::new(&[
        ("status", "in the file"),
        ("accessible", "accessible"),
        ("inaccessible", "inaccessible"),
        ("tip_does_not_fit", "tip does not fit"),
    ]);
    for (name, row) in ["1, reached", "0, not reached"].into_iter().zip(counts) {
        let [accessible, inaccessible, tip] = row.map(Cell::count);
        table.row([Cell::text(name), accessible, inaccessible, tip]);
    }
    output.say(table.text_in(output.unit()));
    let n_agreed = counts[0][0] + counts[1][1] + counts[1][2];
    let share = n_agreed as f64 / n.max(1) as f64;
    output.say(format!("{n_agreed} of {n} vertices agree ({:.2} %)", 100.0 * share));
    if n_left_out > 0 {
        output.say(format!("{n_left_out} vertices that no face with an area uses are left out"));
    }
    let mut result = json!({
        "counts": table.json(),
        "n_compared": n,
        "n_agreed": n_agreed,
        "n_left_out": n_left_out,
    });
    let own = folder.join("matrix.npz");
    if let Some(matrix) = matrix.filter(|_| own.is_file()) {
        let own = MatrixFile::read(&own)?;
        let of_vertices = labels.vertices.as_ref().map(|v| own.matrix.of_vertices(v));
        let own = of_vertices.unwrap_or(own.matrix);
        let n_pairs = own.n_directions() * own.n_sites();
        match own.n_different(&matrix) {
            Some(n_different) => {
                output.say(format!(
                    "{n_different} of {n_pairs} pairs of direction and vertex differ"
                ));
                result["n_pairs"] = json!(n_pairs);
                result["n_different_pairs"] = json!(n_different);
            }
            None => output.warn(format!(
                "matrix.npz has {} directions, the file {}: pairs are not compared",
                own.n_directions(),
                matrix.n_directions()
            )),
        }
    }
    Ok(result)
}

/// Per entry of a file of `n` its site.
fn sites(path: &Path, labels: &LabelFile, n: usize) -> Result<Vec<Option<usize>>> {
    let n_sites = labels.sites.len();
    let (sites, what): (Vec<Option<usize>>, _) = match &labels.vertices {
        Some(vertices) => {
            let of_vertex = vertices.site_of_vertex.iter();
            let sites = of_vertex.map(|s| usize::try_from(*s).ok().filter(|s| *s < n_sites));
            (sites.collect(), "vertices of the part's file")
        }
        None => ((0..n_sites).map(Some).collect(), "sites"),
    };
    if sites.len() == n {
        return Ok(sites);
    }
    let found = format!("{n} entries, the labels have {} {what}", sites.len());
    let remedy = "label the file that it is about with --sites vertices";
    Err(Error::file(path, "text", found, remedy))
}
