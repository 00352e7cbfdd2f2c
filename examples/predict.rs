//! Predict with the shipped network for a cloud of points, and compare with the exact labels, through `ndarray`.
//!
//! `cargo run --release --example predict`
#![allow(clippy::print_stdout)]

use deepmill::access::{LabelOptions, Labeler};
use deepmill::cutter::Cutter;
use deepmill::directions::Directions;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Sites, solids};
use deepmill::glam::DVec3;
use deepmill::metrics::Confusion;
use deepmill::model::{Model, Predictor};

fn main() -> deepmill::Result<()> {
    // Points and normals may come from anywhere; here from a torus standing on a plate's height.
    let part = solids::torus(40.0, 15.0, 60, 30);
    let sampled = sample(&part, &SiteOptions { n_sites: 7000, ..SiteOptions::default() })?;
    let points = sampled.points_array().to_owned();
    let normals = sampled.normals_array().to_owned();
    let sites = Sites::from_arrays(points.view(), normals.view())?;
    println!("{} sites, extent {:.1} mm", sites.len(), part.bounds().map_or(0.0, extent));

    let cutter: Cutter = "1.5,6,40,5".parse()?;
    // Both engines take the same sites and cutter, and answer in the same form.
    let predictor = Predictor::new(Model::shipped()?);
    let labeler =
        Labeler::of_sites(Directions::fibonacci_hemisphere(150)?, LabelOptions::default());
    let (predicted, exact) = (predictor.answer(&sites, &cutter)?, labeler.answer(&sites, &cutter)?);

    let mean = predicted.probability_inaccessible.iter().sum::<f32>() / sites.len() as f32;
    println!("mean probability to be inaccessible: {mean:.3}");
    let area = exact.inaccessible_area_share(&sites)?;
    println!("inaccessible share of the surface, exactly: {:.1} %", 100.0 * area);
    let inaccessible = Confusion::of_labels(&predicted.inaccessible, &exact.inaccessible);
    println!("against the exact labels: F1 of the inaccessible class {:.3}", inaccessible.f1());
    Ok(())
}

fn extent((low, high): (DVec3, DVec3)) -> f64 {
    (high - low).max_element()
}
