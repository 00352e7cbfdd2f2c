//! How an outcome is said.

use super::Args;
use super::shares::{add_bottom, add_clearance, add_rest, add_shares};
use crate::clock::Clock;
use crate::output::Output;
use crate::premise::{premise, premise_of_points};
use crate::{density, findings, fixtures, part_itself, region};
use deepmill::Result;
use deepmill::analysis::{Outcome, PerDirectionFacts};
use deepmill::answers::Definition;
use deepmill::data::files::tools::Tool;
use deepmill::findings::gate::SiteAreas;
use deepmill::geom::Sites;
use deepmill::geom::spacing::Spacing;
use deepmill::report::coverage::{Coverage, Shares};
use deepmill::tables::{Cell, Facts};
use serde_json::{Value, json};

/// Says premise, facts, what blocks, warnings and findings; as JSON for the result.
pub fn say(outcome: &Outcome, args: &Args, clock: &Clock, output: &Output) -> Result<Value> {
    let areas = outcome.areas()?;
    let is_by_mesh = outcome.definition() == Definition::Part;
    let mut facts = facts(outcome, &areas, args);
    let sparse = if is_by_mesh { None } else { add_density(outcome, &mut facts) };
    clock.add_to(&mut facts);
    let premise = match is_by_mesh {
        true => premise(outcome.directions(), &args.surface),
        false => premise_of_points(outcome.directions(), outcome.bottom_mm()),
    };
    output.say(&premise);
    let mut result = facts.json();
    region::say(outcome.region(), &mut result, output);
    output.say(facts.text_in(output.unit()));
    result["premise"] = json!(premise);
    args.read.add_origin(&mut result);
    if let (true, [answer], Some(mesh)) = (is_by_mesh, outcome.answers(), outcome.mesh())
        && !outcome.has_folders()
    {
        let labels = &answer.labels;
        result["faces"] = part_itself::say_blocking(mesh, outcome.sites(), labels, output);
        let about = (outcome.sites(), &areas);
        result["bodies"] = part_itself::say_bodies(mesh, about, labels, output)?;
    }
    let kept = outcome.kept_out().map(|kept| fixtures::say(kept, outcome.tools(), &areas, output));
    result["fixtures"] = kept.unwrap_or_default();
    let named = |tool: &'_ Tool| outcome.has_folders().then(|| tool.name.clone());
    let each = outcome.tools().iter().zip(outcome.answers());
    let warnings = each.map(|(tool, answer)| {
        part_itself::say_warnings(&answer.warnings, named(tool).as_deref(), output)
    });
    result["warnings"] = warnings.collect();
    findings::say(outcome.findings(), output);
    result["findings"] = outcome.findings().json();
    if let Some(warning) = sparse {
        output.warn(format!("{warning}: raise --sites, or add --obstacles"));
    }
    Ok(result)
}

/// Says what the matrices of directions by sites hold, one for each tool.
pub fn say_matrices(
    outcome: &Outcome,
    matrices: &[PerDirectionFacts],
    result: &mut Value,
    output: &Output,
) {
    let mut of_tools = Vec::new();
    for (tool, facts) in outcome.tools().iter().zip(matrices) {
        let PerDirectionFacts { n_directions, n_sites, n_accessible, n_between, n_left_out } =
            facts;
        let name = match outcome.has_folders() {
            true => format!("{}: ", tool.name),
            false => String::new(),
        };
        output.say(format!(
            "{name}matrix: {n_directions} directions by {n_sites} sites, {n_accessible} pairs accessible"
        ));
        if *n_between > 0 {
            output.say(format!(
                "{name}{n_between} accessible sites have none of these directions: one between them, or the bottom \
                 rule; --search 0 tests the set alone"
            ));
        }
        if *n_left_out > 0 {
            output.say(format!(
                "{name}{n_left_out} sites more are reached if poses are searched for in each direction: not in the matrix, \
                 which agrees with the labels"
            ));
        }
        of_tools.push(json!({
            "n_directions": n_directions,
            "n_sites": n_sites,
            "n_accessible_pairs": n_accessible,
            "n_between": n_between,
            "n_left_out": n_left_out,
        }));
    }
    if !of_tools.is_empty() {
        result["matrices"] = json!(of_tools);
    }
}

/// Says the table of several tools, and adds it to the result.
pub fn say_table(outcome: &Outcome, result: &mut Value, output: &Output) -> Result<()> {
    if outcome.has_folders() {
        let areas = outcome.areas()?;
        let table = outcome.coverage(&areas).table();
        output.say(table.text_in(output.unit()));
        result["tools"] = table.json();
    }
    Ok(())
}

fn facts(outcome: &Outcome, areas: &SiteAreas, args: &Args) -> Facts {
    let coverage: Option<Coverage> = outcome.has_folders().then(|| outcome.coverage(areas));
    let (sites, answers) = (outcome.sites(), outcome.answers());
    let n_given = outcome.directions().len();
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(outcome.part()));
    facts.add("definition", "definition", Cell::text(outcome.definition().to_string()));
    add_bottom(&mut facts, outcome.bottom_mm(), sites);
    if coverage.is_none() {
        facts.add("cutter", "cutter", Cell::text(outcome.tools()[0].words()));
    }
    part_itself::add_tolerances(&mut facts, answers, args.surface.tolerances.finish_mm());
    facts.add("n_sites", "sites", Cell::count(sites.len()));
    let labels = &answers[0].labels;
    let n_directions = labels.surface.as_ref().map_or(n_given, |s| s.n_directions);
    facts.add("n_directions", "directions", Cell::count(n_directions));
    match coverage {
        None => {
            add_shares(&mut facts, Shares::of(labels, n_given, areas));
            part_itself::add_facts(&mut facts, labels);
            add_rest(&mut facts, labels, areas);
            add_clearance(&mut facts, labels);
        }
        Some(coverage) => {
            let none = Cell::Share(coverage.share_of_first(None));
            facts.add("inaccessible_to_all", "out of reach of every tool", none);
        }
    }
    facts
}

/// Adds how dense the sites are for the smallest tool; returns the warning if that is too little.
fn add_density(outcome: &Outcome, facts: &mut Facts) -> Option<String> {
    let sites: &Sites = outcome.sites();
    let mut spacing = density::add_spacing(facts, sites);
    if let Some(denser) = outcome.further_obstacles().filter(|more| more.len() > sites.len()) {
        spacing = Spacing::measure_on_sheet(denser);
    }
    let tools = outcome.tools();
    let which = if tools.len() > 1 { "the smallest cutter" } else { "this cutter" };
    let smallest = tools.iter().map(|tool| tool.params.cr_mm).fold(f64::INFINITY, f64::min);
    spacing.and_then(|spacing| density::add_advice(facts, &spacing, which, smallest))
}
