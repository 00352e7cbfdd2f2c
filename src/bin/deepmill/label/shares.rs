//! Shares, clearances and the bottom rule as facts.

use deepmill::access::{Labels, bottom_sites};
use deepmill::findings::gate::SiteAreas;
use deepmill::geom::Sites;
use deepmill::report::coverage::Shares;
use deepmill::tables::{Cell, Facts};

/// Adds the middle clearance of the accessible sites, if there are clearances.
pub fn add_clearance(facts: &mut Facts, labels: &Labels) {
    let mut clearances: Vec<f32> =
        labels.answers.clearance_mm().iter().copied().filter(|c| *c > 0.0).collect();
    clearances.sort_unstable_by(f32::total_cmp);
    if let Some(median) = clearances.get(clearances.len() / 2) {
        let rounded = (f64::from(*median) * 1e3).round() / 1e3;
        let words = "clearance where accessible, median, mm";
        facts.add("clearance_median_mm", words, Cell::Given(rounded));
    }
}

/// Adds the greatest rest, and the area on which more than a tenth of a millimeter is left.
pub fn add_rest(facts: &mut Facts, labels: &Labels, areas: &SiteAreas) {
    let rests = labels.answers.rest_mm();
    if let Some(most) = rests.iter().copied().reduce(f32::max) {
        let rounded = (f64::from(most) * 1e3).round() / 1e3;
        facts.add("greatest_rest_mm", "most left, mm", Cell::Given(rounded));
        let share = areas.share(|i| rests[i] > 0.1);
        facts.add("rest_above_tenth", "more than 0.1 mm left", Cell::Share(share));
    }
}

/// Adds the shares of a single tool.
pub fn add_shares(facts: &mut Facts, shares: Shares) {
    let Shares { accessible, inaccessible, tip_does_not_fit, occlusion, both, .. } = shares;
    facts.add("accessible", "accessible", Cell::Share(accessible));
    facts.add("inaccessible", "inaccessible", Cell::Share(inaccessible));
    for (key, name, share) in [
        ("tip_does_not_fit", "tip does not fit", tip_does_not_fit),
        ("occlusion", "occlusion", occlusion),
        ("both", "inaccessible and occlusion", both),
    ] {
        if let Some(share) = share {
            facts.add(key, name, Cell::Share(share));
        }
    }
    let name = "directions that reach a site, mean";
    if let Some(share) = shares.accessible_directions {
        facts.add("free_directions", name, Cell::Share(share));
    }
}

/// Adds the bottom rule, if there is one, and how many sites it labels.
pub fn add_bottom(facts: &mut Facts, bottom_mm: Option<f64>, sites: &Sites) {
    let Some(bottom_mm) = bottom_mm else { return };
    let n_by_rule = bottom_sites(&sites.points, bottom_mm).into_iter().filter(|by_rule| *by_rule);
    facts.add("bottom_mm", "bottom rule, mm", Cell::Given(bottom_mm));
    let words = "accessible by the bottom rule, sites";
    facts.add("n_bottom", words, Cell::count(n_by_rule.count()));
}
