//! `deepmill label --volume`: where in the space around a part the cutter's tip can be.

use crate::args::{called, name_of};
use crate::clock::Clock;
use crate::label::Args;
use crate::output::Output;
use crate::premise::premise;
use crate::progress::Bars;
use deepmill::analysis::Analysis;
use deepmill::data::files::tools::Tool;
use deepmill::data::files::volume::PointAnswer;
use deepmill::geom::formats::MeshOrCloud;
use deepmill::tables::{Cell, Facts};
use deepmill::{Error, Result};
use serde_json::json;

pub fn run(
    args: &Args,
    step_mm: f64,
    (part, tools): (MeshOrCloud, Vec<Tool>),
    mut clock: Clock,
    output: &Output,
) -> Result<()> {
    let directions = args.directions.directions()?;
    let premise = premise(&directions, &args.surface);
    let mut analysis = Analysis::new(name_of(&args.part), part, tools)
        .origin(args.read.origin())
        .options(args.surface.options()?)
        .proving(args.surface.proves())
        .directions(directions);
    analysis = args.surface.add_to(analysis, &args.read, output)?;
    let outcome = analysis.volume(step_mm, &mut Bars::default()).map_err(|error| match error {
        Error::Argument { name: "volume", .. } => called(error, "--volume"),
        Error::Argument { name: "allowance", .. } => called(error, "--allowance"),
        Error::Argument { name: "table", .. } => called(error, "--table"),
        other => other,
    })?;
    outcome.warnings().iter().for_each(|warning| output.warn(warning));
    outcome.notices().iter().for_each(|notice| output.say(notice));
    clock.stages(STAGES, outcome.seconds());
    let files = output.forms(!args.no_picture, false, &[])?;
    let paths = outcome.write(args.out.folder(), &files)?;
    clock.lap("write_s", "writing and drawing");

    let file = outcome.file();
    let n_directions = file.provenance.settings.n_directions.unwrap_or_default();
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(&file.provenance.part));
    facts.add("definition", "definition", Cell::text("mesh definition, in space"));
    facts.add("cutter", "cutter", Cell::text(&file.provenance.tool));
    facts.add("n_points", "points outside the part", Cell::count(outcome.n_points()));
    facts.add("step_mm", "step", Cell::Given(step_mm));
    facts.add("n_directions", "directions", Cell::count(n_directions));
    for (key, answer) in [
        ("accessible", PointAnswer::Accessible),
        ("inaccessible", PointAnswer::Inaccessible),
        ("tip_does_not_fit", PointAnswer::TipDoesNotFit),
    ] {
        facts.add(key, answer.words(), Cell::Share(file.share(answer)));
    }
    if let Some(share) = file.unproven_share() {
        facts.add("retreat_unproven", "retreat unproven", Cell::Share(share));
    }
    clock.add_to(&mut facts);
    output.say(&premise);
    output.say(facts.text_in(output.unit()));
    output.files(&paths);
    let mut result = facts.json();
    result["premise"] = json!(premise);
    output.result_with_files(result, &paths);
    Ok(())
}

/// Keys and names of what [`VolumeOutcome::seconds`](deepmill::analysis::VolumeOutcome::seconds) has.
const STAGES: [[&str; 2]; 2] = [["points_s", "points"], ["labels_s", "labels"]];
