//! Predict with the shipped network for sites on a mesh, and compare with the exact labels of the definition that the
//! network learned, through `ndarray`.
//!
//! `cargo run --release --example predict`
#![allow(clippy::print_stdout)]

use deepmill::access::surface::SurfaceOptions;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::answers::Definition;
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
    let sampled = sample(&part, &SiteOptions::default().with_n_sites(2000))?;
    let points = sampled.points_array().to_owned();
    let normals = sampled.normals_array().to_owned();
    let sites = Sites::from_arrays(points.view(), normals.view())?;
    println!("{} sites, extent {:.1} mm", sites.len(), part.bounds().map_or(0.0, extent));

    let cutter: Cutter = "1.5,6,40,5".parse()?;
    let predictor = Predictor::new(Model::shipped()?);
    // The network was trained with 7,000 sites: on the part the missing ones are placed for it.
    let predicted = predictor.answer_on(&part, &sites, &cutter)?;

    // Labels of another definition than the network's would show what both differ in, not how good the network is.
    let directions = Directions::fibonacci_hemisphere(150)?;
    let labeler = match predictor.definition() {
        Some(Definition::Part) => {
            Labeler::of_part(&part, &[], directions, SurfaceOptions::default())?
        }
        _ => Labeler::of_sites(directions, LabelOptions::default()),
    };
    let exact = labeler.answer(&sites, &cutter)?;

    if let Some(network) = predicted.network() {
        let mean = network.probability_inaccessible.iter().sum::<f32>() / sites.len() as f32;
        println!("mean probability to be inaccessible: {mean:.3}");
    }
    let area = exact.inaccessible_area_share(&sites)?;
    println!("inaccessible share of the surface, exactly: {:.1} %", 100.0 * area);
    let inaccessible = Confusion::of_labels(&predicted.inaccessible(), &exact.inaccessible());
    println!("against the exact labels: F1 of the inaccessible class {:.3}", inaccessible.f1());
    Ok(())
}

fn extent((low, high): (DVec3, DVec3)) -> f64 {
    (high - low).max_element()
}
