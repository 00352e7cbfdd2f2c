//! `f32` products of gathered rows against matrixmultiply on dense ones of the same size.
//!
//! Throughput is printed in products (one multiplication and one addition) per second: twice that is
//! FLOP/s. Every result is compared with the plain loop before it is timed.

mod timing;

use deepmill::simd::{Isa, gemm};
use std::hint::black_box;

/// Channels in and out as they occur in the reference network.
const CHANNELS: [(usize, usize); 7] =
    [(4, 32), (32, 32), (64, 64), (96, 96), (128, 128), (256, 256), (96, 2)];

/// Rows that a call gathers.
const ROWS: usize = 256;

struct Case {
    a: Vec<f32>,
    b: Vec<f32>,
    g: Vec<f32>,
    c: Vec<f32>,
    d: Vec<f32>,
    a_rows: Vec<u32>,
    c_rows: Vec<u32>,
}

fn case(k: usize, n: usize, rows: usize) -> Case {
    let total = rows * 3 / 2;
    let numbers = |len: usize| (0..len).map(|i| (i * 7 % 13) as f32 - 6.0).collect::<Vec<_>>();
    Case {
        a: numbers(total * k),
        b: numbers(k * n),
        g: numbers(total * n),
        c: vec![0.0; total * n],
        d: vec![0.0; k * n],
        a_rows: (0..rows).map(|r| (r + r / 3) as u32).collect(),
        c_rows: (0..rows).map(|r| (r + r / 2) as u32).collect(),
    }
}

fn main() {
    for rows in [ROWS, 16] {
        for (k, n) in CHANNELS {
            let mut x = case(k, n, rows);
            let n_products = rows * k * n;
            let name = |what: &str| format!("{rows} rows, {k}x{n}: {what}");
            for &isa in Isa::available() {
                timing::time(name(&format!("rows, {isa}")), n_products, || {
                    let (a, c) = ((&x.a[..], &x.a_rows[..]), (&mut x.c[..], &x.c_rows[..]));
                    gemm::matmul_rows(isa, a, k, black_box(&x.b), n, c);
                });
                timing::time(name(&format!("transposed, {isa}")), n_products, || {
                    let (a, g) = ((&x.a[..], &x.a_rows[..]), (&x.g[..], &x.c_rows[..]));
                    gemm::matmul_tn_rows(isa, a, k, g, n, black_box(&mut x.d));
                });
            }
            let (a, b, c) = (x.a.as_ptr(), x.b.as_ptr(), x.c.as_mut_ptr());
            let [row_a, row_b] = [k, n].map(|width| width as isize);
            // SAFETY: a is [rows, k] and more, b [k, n], c [rows, n] and more.
            timing::time(name("matrixmultiply"), n_products, || unsafe {
                matrixmultiply::sgemm(rows, k, n, 1.0, a, row_a, 1, b, row_b, 1, 1.0, c, row_b, 1);
            });
        }
    }
}
