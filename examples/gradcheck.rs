//! Check the backward pass of an own layer against finite differences.
//!
//! The layer: every row divided by its root mean square, times a gain per column (RMS norm).
//! `cargo run --release --example gradcheck`
#![allow(clippy::print_stdout)]

use deepmill::gradcheck::{self, GradcheckSettings};

const COLUMNS: usize = 5;
const EPSILON: f64 = 1e-6;

fn main() -> deepmill::Result<()> {
    let (x, gain) = (gradcheck::probe(4 * COLUMNS, 1), gradcheck::probe(COLUMNS, 2));
    let inputs = [("x", &x[..]), ("gain", &gain[..])];
    let report = gradcheck::function(&inputs, forward, backward, &GradcheckSettings::default())?;
    print!("{report}");
    report.require(1e-7)?;

    // The same with a mistake: the mean square is taken to be constant.
    let wrong = |v: &[Vec<f64>], dy: &[f64]| {
        let mut gradients = backward(v, dy);
        for ((row, dy), dx) in rows(&v[0]).zip(rows(dy)).zip(gradients[0].chunks_mut(COLUMNS)) {
            let scale = rms(row);
            dx.iter_mut().zip(dy).zip(&v[1]).for_each(|((dx, dy), g)| *dx = dy * g / scale);
        }
        gradients
    };
    let report = gradcheck::function(&inputs, forward, wrong, &GradcheckSettings::default())?;
    match report.require(1e-7) {
        Err(error) => println!("the mistake is found: {error}"),
        Ok(()) => unreachable!("a wrong gradient passes"),
    }
    Ok(())
}

fn rows(x: &[f64]) -> impl Iterator<Item = &[f64]> {
    x.chunks(COLUMNS)
}

fn rms(row: &[f64]) -> f64 {
    (row.iter().map(|x| x * x).sum::<f64>() / COLUMNS as f64 + EPSILON).sqrt()
}

fn forward(v: &[Vec<f64>]) -> Vec<f64> {
    let normalized = |row: &[f64]| {
        let scale = rms(row);
        row.iter().zip(&v[1]).map(|(x, g)| x / scale * g).collect::<Vec<f64>>()
    };
    rows(&v[0]).flat_map(normalized).collect()
}

/// With `r` the root mean square and `n` columns: `dx = (g·dy − x·⟨g·dy, x⟩/(n·r²)) / r`, `dg = Σ dy·x/r`.
fn backward(v: &[Vec<f64>], dy: &[f64]) -> Vec<Vec<f64>> {
    let (mut dx, mut dgain) = (Vec::new(), vec![0.0; COLUMNS]);
    for (row, dy) in rows(&v[0]).zip(rows(dy)) {
        let scale = rms(row);
        let weighted: Vec<f64> = dy.iter().zip(&v[1]).map(|(dy, g)| dy * g).collect();
        let along: f64 = weighted.iter().zip(row).map(|(w, x)| w * x).sum();
        let pull = along / (COLUMNS as f64 * scale * scale);
        dx.extend(weighted.iter().zip(row).map(|(w, x)| (w - x * pull) / scale));
        let columns = dgain.iter_mut().zip(dy.iter().zip(row));
        columns.for_each(|(dg, (dy, x))| *dg += dy * x / scale);
    }
    vec![dx, dgain]
}
