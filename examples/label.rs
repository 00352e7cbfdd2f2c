//! Exact labels of a part: which sites a cutter cannot reach, and which sites are in its way.
//!
//! `cargo run --release --example label -- part.stl 1.5,6,40,5` (without a file: a block with a step).
#![allow(clippy::print_stdout)]

use deepmill::access::{LabelOptions, Obstacles, label};
use deepmill::cutter::Cutter;
use deepmill::directions::Directions;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, check, formats};

fn main() -> deepmill::Result<()> {
    let mut args = std::env::args().skip(1);
    let mesh = match args.next() {
        Some(path) => formats::read_mesh(path.as_ref(), &formats::ReadOptions::default())?,
        None => step()?,
    };
    check::require_labelable(&mesh)?;
    let cutter: Cutter = args.next().as_deref().unwrap_or("1.5,6,40,5").parse()?;
    let (directions, options) = (Directions::published(), LabelOptions::published());

    let sites = sample(&mesh, &SiteOptions::default().with_n_sites(2000))?;
    let labels = label(&sites, Obstacles::Queries, &cutter, &directions, &options)?;
    println!("{cutter}");
    println!("{} sites, {directions}", sites.len());
    println!(
        "{} inaccessible, {} in the way",
        labels.answers.n_inaccessible(),
        labels.answers.n_occlusion()
    );

    let site = labels.witness.iter().position(Option::is_some);
    if let Some((site, k)) = site.and_then(|site| Some((site, labels.witness[site]?))) {
        let direction = directions.vectors()[k as usize];
        println!("site {site} at {} mm can be reached from {direction}", sites.points[site]);
    }
    Ok(())
}

/// An L-shaped block of 40 × 30 × 20 mm.
fn step() -> deepmill::Result<Mesh> {
    let outline = [[0.0, 0.0], [40.0, 0.0], [40.0, 6.0], [15.0, 6.0], [15.0, 20.0], [0.0, 20.0]];
    let at = |y: f64| outline.map(|[x, z]| [x, y, z]);
    let vertices = [at(0.0), at(30.0)].concat();
    let sides = (0..6u32).flat_map(|i| {
        let j = (i + 1) % 6;
        [[i, i + 6, j], [j, i + 6, j + 6]]
    });
    let cap = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let front = cap.into_iter();
    let back = cap.into_iter().map(|[a, b, c]| [a + 6, c + 6, b + 6]);
    Mesh::from_slices(&vertices, &sides.chain(front).chain(back).collect::<Vec<[u32; 3]>>())
}
