//! Which fixtures keep the tool from a finding.

use super::Findings;
use serde::{Deserialize, Serialize};

/// A fixture without which the tool reaches sites of a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct InTheWay {
    /// The fixture.
    pub fixture: String,
    /// Share of the region's sites that are reached without it.
    pub share: f64,
}

/// Adds to every finding the fixture that keeps the tool from most of its sites; the first among equals. `kept_by` has
/// per site the number among `names` of what has to go for the site to be reached, if that is a fixture.
///
/// # Panics
/// If `kept_by` has not one entry per site, or a number is beyond the names.
pub fn add_fixtures(findings: &mut Findings, names: &[String], kept_by: &[Option<usize>]) {
    assert_eq!(kept_by.len(), findings.of_site.len(), "one entry per site");
    let mut counts = vec![vec![0usize; names.len()]; findings.list.len()];
    for (number, kept_by) in findings.of_site.iter().zip(kept_by) {
        if let (1.., Some(fixture)) = (*number, kept_by) {
            counts[*number as usize - 1][*fixture] += 1;
        }
    }
    for (finding, counts) in findings.list.iter_mut().zip(counts) {
        let most = counts.iter().copied().max().unwrap_or(0);
        let fixture = counts.iter().position(|count| *count == most).filter(|_| most > 0);
        finding.fixture = fixture.map(|fixture| InTheWay {
            fixture: names[fixture].clone(),
            share: most as f64 / finding.n_sites as f64,
        });
    }
}
