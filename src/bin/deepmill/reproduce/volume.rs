//! The space around a part: where the cutter's tip can be, by a network that reads the part's surface beside it.

use super::page::Page;
use super::parts::Part;
use super::samples::{Draw, for_parts, inaccessible_share};
use super::study::{N_DIRECTIONS, Study};
use super::trainings::{Data, N_CUTTERS, N_TEST_CUTTERS, Trainings};
use deepmill::access::Labels;
use deepmill::access::surface::TriangleObstacles;
use deepmill::answers::{Definition, SiteAnswers};
use deepmill::cutter::{Cutter, CutterSet};
use deepmill::data::Sample;
use deepmill::data::files::Provenance;
use deepmill::data::files::volume::VolumeFile;
use deepmill::data::volume::{Volume, VolumeObstacles};
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::model::AnyModel;
use deepmill::report::image::Image;
use deepmill::report::section;
use deepmill::tables::{Cell, Table};
use deepmill::train::evaluate;
use deepmill::{Error, Result};
use serde_json::Value;
use std::sync::Arc;
use std::time::Instant;

/// The paper's accuracy.
const PUBLISHED: f64 = 0.979;
/// Most parts that are labeled once more for the time.
const N_TIMED: usize = 6;

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let mut table = Table::new(&[
        ("obstacles", "obstacles"),
        ("inaccessible", "inaccessible, exact"),
        ("majority", "majority class"),
        ("accuracy", "accuracy"),
        ("f1", "F1"),
        ("published", "accuracy, published"),
        ("exact_seconds", "exact, per part and cutter"),
        ("network_seconds", "network, per part and cutter"),
    ]);
    let mut sections = Vec::new();
    for definition in [Definition::SitesInSpace, Definition::PartInSpace] {
        let directions = match definition {
            Definition::SitesInSpace => Directions::published(),
            _ => Directions::fibonacci_hemisphere(N_DIRECTIONS)?,
        };
        let of = (definition, &directions);
        let training = samples(study, study.training_parts(), N_CUTTERS, of)?;
        let test = samples(study, study.test_parts(), N_TEST_CUTTERS, of)?;
        if training.is_empty() || test.is_empty() {
            return Err(no_space());
        }
        let data = Data { definition, training: &training, test: &test };
        let name = format!("space, {}", words(definition));
        let trained = trainings.network_of(&name, &data, |_| {})?;
        study.go_on()?;
        let scores = evaluate(&trained.model, &test)?;
        let score = scores.mean()[0];
        let share = inaccessible_share(&test);
        table.row([
            Cell::text(words(definition)),
            Cell::Share(share),
            Cell::Share(share.max(1.0 - share)),
            Cell::Share(score.accuracy),
            Cell::Share(score.f1),
            if definition.is_by_mesh() { Cell::Missing } else { Cell::Share(PUBLISHED) },
            Cell::Seconds(exact_seconds(study, &test, of)?),
            Cell::Seconds(scores.seconds / test.len() as f64),
        ]);
        if definition.is_by_mesh() {
            sections = show(study, &trained.model, &test[0])?;
        }
    }
    Image::grid(&sections, 2).write_png(&study.file("volume.png"))?;
    let page = Page {
        name: "volume",
        title: "The space around a part",
        text: vec![
            "Points of a lattice over the part's box that are outside of the part, about as many as sites elsewhere; the tip of the \
             cutter is at the point. Obstacles are as many sites of the surface (the published definition), or the triangles of the \
             part with the search between 150 directions. The octree holds the points and as many sites of the surface with \
             their normals; points of space have none, and are no occlusion points, so that only the first head has something to \
             learn. Whether the tip fits is not tested. Scores are averages over samples, \
             F1 of the class inaccessible."
                .into(),
            trainings.words(),
        ],
        table,
        pictures: vec![(
            "volume.png".into(),
            "A section of the space around a test part: exact labels by the mesh definition, and the network's predictions".into(),
        )],
    };
    page.write(study)
}

fn words(definition: Definition) -> &'static str {
    if definition.is_by_mesh() { "mesh definition" } else { "sites" }
}

/// Labeled space of every part.
fn samples(
    study: &Study,
    parts: &[Part],
    n_cutters: usize,
    (definition, directions): (Definition, &Directions),
) -> Result<Vec<Sample>> {
    let draw = Draw { sets: &[CutterSet::Uniform], n_cutters };
    for_parts(study, parts, |part, index| {
        // A part that fills its box has no space around it.
        let Ok(volume) = Volume::new(&part.mesh, study.args.sites) else { return Ok(Vec::new()) };
        let points = Arc::new(volume.points());
        let surface = Arc::new(part.sites(study.args.sites)?);
        let obstacles = obstacles(part, &surface, definition)?;
        let sample = |k| {
            let cutter = draw.cutter(index, k);
            let tool = Cutter::ball_end(cutter)?;
            let answers = obstacles.answers(&points.points, &tool, directions)?;
            let sample = Sample::new(part.name.clone(), Arc::clone(&points), cutter, answers);
            Ok(sample.with_surface(Arc::clone(&surface)))
        };
        (0..n_cutters).map(sample).collect()
    })
}

fn obstacles(part: &Part, surface: &Sites, definition: Definition) -> Result<VolumeObstacles> {
    Ok(match definition.is_by_mesh() {
        true => VolumeObstacles::Part(Box::new(TriangleObstacles::new(&part.mesh, &[])?)),
        false => VolumeObstacles::Points(surface.points.clone()),
    })
}

/// Mean seconds of the exact labels of a test part with one cutter; obstacles are prepared beforehand.
fn exact_seconds(
    study: &Study,
    test: &[Sample],
    (definition, directions): (Definition, &Directions),
) -> Result<f64> {
    let (mut seconds, mut n) = (0.0, 0);
    for samples in test.chunk_by(|a, b| a.name == b.name).take(N_TIMED) {
        let first = &samples[0];
        let surface = first.surface().ok_or_else(no_space)?;
        let obstacles = obstacles(part_of(study, first)?, surface, definition)?;
        for sample in samples {
            study.go_on()?;
            let cutter = Cutter::ball_end(sample.cutter)?;
            let start = Instant::now();
            obstacles.answers(&sample.sites.points, &cutter, directions)?;
            seconds += start.elapsed().as_secs_f64();
            n += 1;
        }
    }
    Ok(seconds / f64::from(n.max(1)))
}

/// The test part that a sample is about.
fn part_of<'a>(study: &'a Study, sample: &Sample) -> Result<&'a Part> {
    study.test_parts().iter().find(|part| part.name == sample.name).ok_or_else(no_space)
}

/// One section of exact labels and of predictions.
fn show(study: &Study, model: &AnyModel<f32>, sample: &Sample) -> Result<Vec<(Image, String)>> {
    let volume = Volume::new(&part_of(study, sample)?.mesh, study.args.sites)?;
    let prediction = model.predict_shape(&sample.shape())?;
    let exact = file(sample, &volume, &sample.answers.inaccessible())?;
    let predicted = file(sample, &volume, &prediction.answers().inaccessible())?;
    let layer = section::most_mixed_layer(&exact);
    let picture =
        |file, name: &str| (section::draw(file, layer), format!("{}: {name}", sample.name));
    Ok(vec![picture(&exact, "exact"), picture(&predicted, "network")])
}

fn file(sample: &Sample, volume: &Volume, inaccessible: &[bool]) -> Result<VolumeFile> {
    let mut labels = Labels::default();
    labels.answers = SiteAnswers::new(inaccessible.to_vec(), vec![]);
    let mut provenance =
        Provenance::ball_end(sample.name.clone(), sample.cutter, Default::default());
    let [cr, ch, fr, fh] = sample.cutter.to_array();
    provenance.tool = format!("ball end CR {cr:.1}, CH {ch:.1}, FR {fr:.1}, FH {fh:.1} mm");
    VolumeFile::new(provenance, volume.lattice, &volume.inside, &labels)
}

fn no_space() -> Error {
    let (found, expected) = ("parts that fill their boxes", "one or more with space around it");
    Error::argument("--parts", found, expected, "give parts with pockets, steps or curved sides")
}
