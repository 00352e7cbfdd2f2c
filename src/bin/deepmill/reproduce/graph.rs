//! GraphSAGE on the graph of the sites beside the octree network.

use super::page::Page;
use super::pictures::Sheet;
use super::study::{N_DIRECTIONS, Study};
use super::trainings::{Trained, Trainings, training_samples};
use deepmill::Result;
use deepmill::cutter::CutterSet;
use deepmill::data::Sample;
use deepmill::directions::Directions;
use deepmill::model::graph_sage::GraphSageConfig;
use deepmill::report::Coloring;
use deepmill::report::tables::{Cell, Table};
use deepmill::train::{Settings, evaluate};
use serde_json::Value;

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS)?;
    let data = training_samples(study, &[CutterSet::Uniform], &directions)?;
    let octree = trainings.network("octree", &data, |_| ())?;
    let graph = trainings.network("GraphSAGE", &data, use_graph)?;
    let networks = [("octree", octree), ("GraphSAGE", graph)];
    let mut table = Table::new(&[
        ("network", "network"),
        ("parameters", "parameters"),
        ("loss", "training loss"),
        ("training_seconds", "training"),
        ("acc_i", "Acc_i"),
        ("f1_i", "F1_i"),
        ("acc_o", "Acc_o"),
        ("f1_o", "F1_o"),
        ("seconds", "prediction, per part and cutter"),
    ]);
    for (name, trained) in &networks {
        study.go_on()?;
        let scores = evaluate(&trained.model, &trainings.test)?;
        let history = &trained.history;
        let seconds = history.iter().map(|row| row.seconds).sum();
        let loss = history.last().map_or(0.0, |row| row.loss);
        let mut row = vec![Cell::text(*name), Cell::count(trained.model.params.len())];
        row.extend([Cell::Number(loss), Cell::Seconds(seconds)]);
        row.extend(scores.mean().iter().flat_map(|s| [s.accuracy, s.f1]).map(Cell::Share));
        row.push(Cell::Seconds(scores.seconds / trainings.test.len().max(1) as f64));
        table.row(row);
    }
    let mut sheet = Sheet::default();
    show(study, &mut sheet, &trainings.test[0], &networks)?;
    sheet.image().write_png(&study.file("graph.png"))?;
    let GraphSageConfig { n_nearest, n_neighbors, widths, .. } = GraphSageConfig::default();
    let page = Page {
        name: "graph",
        title: "GraphSAGE",
        text: vec![
            format!(
                "The graph of a part: each site reads its {n_nearest} nearest sites. {} layers of {} channels that take the mean over \
                 them, in training over {n_neighbors} drawn at random; a cutter module before each layer, as wide as the octree \
                 network's; the same heads, loss, trainer and samples. Time of training without the scores in between.",
                widths.len(),
                widths[0]
            ),
            trainings.words(),
        ],
        table,
        pictures: vec![(
            "graph.png".into(),
            "A test part: exact labels, the octree network, GraphSAGE".into(),
        )],
    };
    page.write(study)
}

/// Puts GraphSAGE in the place of the octree network; head, cutter modules and unit cube stay as they were.
fn use_graph(settings: &mut Settings) {
    let mut config = GraphSageConfig::default();
    if let Some(octree) = settings.network.octree_mut() {
        config.cutter = octree.cutter.clone();
        config.head_width = octree.head_width;
        (config.cube, config.cutter_input) = (octree.input.cube, octree.input.cutter);
    }
    settings.network = config.into();
}

/// A row: exact labels of a sample, and the predictions of the networks.
fn show(
    study: &Study,
    sheet: &mut Sheet,
    sample: &Sample,
    networks: &[(&str, Trained)],
) -> Result<()> {
    let sites = &*sample.sites;
    let mut answers = vec![("exact", sample.answers.clone())];
    for (name, trained) in networks {
        let (points, normals) = (&sites.points, &sites.normals);
        let prediction = trained.model.predict(points, normals, sample.cutter.to_array())?;
        answers.push((name, prediction.answers()));
    }
    for (name, answers) in &answers {
        let coloring =
            Coloring::Labels { inaccessible: &answers.inaccessible, occlusion: &answers.occlusion };
        let caption = format!("{}: {name}", sample.name);
        sheet.add(&study.test_parts()[0].mesh, sites, &coloring, caption);
    }
    Ok(())
}
