//! GraphSAGE on the graph of the sites beside the octree network.

use super::page::Page;
use super::pictures::Sheet;
use super::scores;
use super::study::Study;
use super::trainings::{Trainings, training_samples};
use deepmill::Result;
use deepmill::access::Labeler;
use deepmill::cutter::CutterSet;
use deepmill::model::graph_sage::GraphSageConfig;
use deepmill::tables::{Cell, Table};
use deepmill::train::{Settings, evaluate};
use serde_json::Value;

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let labeler = Labeler::published();
    let data = training_samples(study, &[CutterSet::Uniform], &labeler)?;
    let octree = trainings.network("octree", &data, |_| ())?;
    let graph = trainings.network("GraphSAGE", &data, use_graph)?;
    let networks = [("octree", octree), ("GraphSAGE", graph)];
    let mut columns = vec![
        ("network", "network"),
        ("parameters", "parameters"),
        ("loss", "training loss"),
        ("training_seconds", "training"),
    ];
    columns.extend(scores::COLUMNS);
    columns.push(("seconds", "prediction, per part and cutter"));
    let mut table = Table::new(&columns);
    for (name, trained) in &networks {
        study.go_on()?;
        let tested = evaluate(&trained.model, &trainings.test)?;
        let (loss, _) = scores::last(trained);
        let mut row = vec![Cell::text(*name), Cell::count(trained.model.params.len())];
        row.extend([Cell::Number(loss), Cell::Seconds(trained.seconds())]);
        row.extend(scores::cells(tested.mean()));
        row.push(Cell::Seconds(tested.seconds / trainings.test.len().max(1) as f64));
        table.row(row);
    }
    let mut sheet = Sheet::default();
    let sample = &trainings.test[0];
    sheet.add_answers(&study.test_parts()[0].mesh, sample, &networks, &sample.name)?;
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
