//! Rows that state how evenly and how densely sites are spread, and the number a cutter needs.

use deepmill::geom::Sites;
use deepmill::geom::spacing::Spacing;
use deepmill::tables::{Cell, Facts};

/// Adds distances between sites of one sheet, and their variation with walls and without. Returns the
/// distances within sheets.
pub fn add_spacing(facts: &mut Facts, sites: &Sites) -> Option<Spacing> {
    let spacing = Spacing::measure_on_sheet(sites)?;
    facts.add("spacing_mm", "mean spacing", Cell::Millimeters(spacing.mean_mm));
    facts.add("spacing_min_mm", "least spacing", Cell::Millimeters(spacing.min_mm));
    facts.add("spacing_max_mm", "greatest spacing", Cell::Millimeters(spacing.max_mm));
    facts.add("spacing_cv", "variation of spacing on a sheet", Cell::Number(spacing.cv));
    let straight = Spacing::measure(sites).map_or(Cell::Missing, |all| Cell::Number(all.cv));
    facts.add("spacing_straight_cv", "variation also through walls", straight);
    Some(spacing)
}

/// Adds how many sites a cutter of ball radius `cr_mm` needs; returns the warning if there are fewer.
pub fn add_advice(facts: &mut Facts, spacing: &Spacing, which: &str, cr_mm: f64) -> Option<String> {
    let advice = spacing.advice(cr_mm);
    let enough = format!("sites enough for {which}");
    facts.add("n_sites_enough", enough, Cell::count(advice.n_sites_enough));
    facts.add("n_sites_fine", "sites to notice CR/10 of depth", Cell::count(advice.n_sites_fine));
    let hidden = advice.hidden_mm.map_or(Cell::Missing, Cell::Millimeters);
    facts.add("hidden_mm", "depth that can stay unnoticed", hidden);
    advice.warning()
}
