//! `f32` products of gathered rows against matrixmultiply on dense ones of the same size.
//!
//! Throughput is printed in products (one multiplication and one addition) per second: twice that is
//! FLOP/s. Every result is compared with the plain loop before it is timed.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
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

fn products(criterion: &mut Criterion) {
    for rows in [ROWS, 16] {
        let mut group = criterion.benchmark_group(format!("{rows} rows"));
        group.sample_size(20);
        group.warm_up_time(std::time::Duration::from_millis(200));
        group.measurement_time(std::time::Duration::from_millis(500));
        for (k, n) in CHANNELS {
            let mut x = case(k, n, rows);
            group.throughput(Throughput::Elements((rows * k * n) as u64));
            for &isa in Isa::available() {
                let id = |name: &str| {
                    BenchmarkId::new(format!("{name}/{}", isa.name()), format!("{k}x{n}"))
                };
                group.bench_function(id("rows"), |bencher| {
                    bencher.iter(|| {
                        let (a, c) = ((&x.a[..], &x.a_rows[..]), (&mut x.c[..], &x.c_rows[..]));
                        gemm::matmul_rows(isa, a, k, black_box(&x.b), n, c);
                    });
                });
                group.bench_function(id("transposed"), |bencher| {
                    bencher.iter(|| {
                        let (a, g) = ((&x.a[..], &x.a_rows[..]), (&x.g[..], &x.c_rows[..]));
                        gemm::matmul_tn_rows(isa, a, k, g, n, black_box(&mut x.d));
                    });
                });
            }
            group.bench_function(
                BenchmarkId::new("matrixmultiply", format!("{k}x{n}")),
                |bencher| {
                    let (a, b, c) = (x.a.as_ptr(), x.b.as_ptr(), x.c.as_mut_ptr());
                    let s = |width: usize| width as isize;
                    bencher.iter(|| {
                        // SAFETY: a is [rows, k] and more, b [k, n], c [rows, n] and more.
                        unsafe {
                            matrixmultiply::sgemm(
                                rows,
                                k,
                                n,
                                1.0,
                                a,
                                s(k),
                                1,
                                b,
                                s(n),
                                1,
                                1.0,
                                c,
                                s(n),
                                1,
                            );
                        }
                    });
                },
            );
        }
    }
}

criterion_group!(benches, products);
criterion_main!(benches);
