//! Names of findings that stay: by tool, cause and place.

use super::{Finding, Findings};
use crate::geom::{Mesh, Sites};
use crate::storage::input_file;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// The name of all tools together, of which what none reaches is found.
pub const ALL_TOOLS: &str = "all tools";

/// Least and greatest corner of the part, mm.
pub type Bounds = [DVec3; 2];

/// Cells along the longest edge of the part's box: an even number, so that the middle of the box and its faces lie in
/// the middle of cells, where small changes do not matter.
const N_CELLS: f64 = 8.0;
/// How often the cells are halved for findings that share one.
const N_LEVELS: u32 = 5;

/// What a baseline makes of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
#[doc(hidden)] // in files by its name
pub enum FindingStatus {
    /// It is in the baseline, and no larger than there.
    Known,
    /// It is not in the baseline.
    New,
    /// It is in the baseline, and larger than there.
    Grown,
    /// It is not in the baseline, and has the area of a few sites.
    Small,
}

impl FindingStatus {
    /// As files have it.
    pub fn name(self) -> &'static str {
        match self {
            FindingStatus::Known => "known",
            FindingStatus::New => "new",
            FindingStatus::Grown => "grown",
            FindingStatus::Small => "small",
        }
    }
}

/// The box about the mesh, or about the sites of a cloud.
pub fn bounds_of(mesh: Option<&Mesh>, sites: &Sites) -> Bounds {
    let of_mesh = mesh.and_then(Mesh::bounds).map(|(low, high)| [low, high]);
    of_mesh.unwrap_or_else(|| {
        let places = sites.points.iter().map(|p| p.as_dvec3());
        let all = places.map(|p| [p, p]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        all.unwrap_or_default()
    })
}

impl Findings {
    /// Names every finding by `tool`, cause and the place of its middle in the box of the part.
    #[doc(hidden)] // of `analysis` and the program
    pub fn identify(&mut self, tool: &str, bounds: Bounds) {
        let keys = |level: u32| -> Vec<String> {
            self.list.iter().map(|finding| key(finding, tool, bounds, level)).collect()
        };
        let mut ids = keys(0);
        for level in 1..=N_LEVELS {
            let mut counts: HashMap<&str, usize> = HashMap::new();
            ids.iter().for_each(|id| *counts.entry(id).or_default() += 1);
            if counts.values().all(|count| *count == 1) {
                break;
            }
            let shared: Vec<bool> = ids.iter().map(|id| counts[&**id] > 1).collect();
            let finer = keys(level);
            let each = ids.iter_mut().zip(finer).zip(shared);
            each.filter(|(_, shared)| *shared).for_each(|((id, finer), _)| *id = finer);
        }
        let mut taken = HashSet::new();
        for (finding, id) in self.list.iter_mut().zip(ids) {
            finding.id = untaken(id, &mut taken);
        }
    }

    /// Takes the names, and what a baseline made of them, that `findings.json` of a folder has for these findings:
    /// where it is, and lists a finding of the same site, cause and number of sites.
    #[doc(hidden)] // of the program
    pub fn take_ids(&mut self, folder: &Path) {
        let path = folder.join(super::FINDINGS[0]);
        let Ok(bytes) = input_file::read(&path, input_file::TEXT) else { return };
        let Ok(value) = serde_json::from_slice::<Value>(&bytes) else { return };
        let mut written = HashMap::new();
        for of in value["findings"].as_array().into_iter().flatten() {
            if let (Some(site), Some(_)) = (of["site"].as_u64(), of["id"].as_str()) {
                written.insert(site, of);
            }
        }
        let words = |value: &Value| value.as_str().map(str::to_owned);
        let same = |finding: &Finding| {
            let of = *written.get(&u64::from(finding.site))?;
            let is_same = of["n_sites"].as_u64() == Some(finding.n_sites as u64)
                && serde_json::to_value(finding.cause).ok().as_ref() == Some(&of["cause"]);
            is_same.then_some(of)
        };
        if self.list.iter().any(|finding| same(finding).is_none()) {
            return;
        }
        for finding in &mut self.list {
            let Some(of) = same(finding) else { continue };
            finding.id = words(&of["id"]).unwrap_or_default();
            finding.status = serde_json::from_value(of["status"].clone()).ok();
            (finding.reason, finding.since) = (words(&of["reason"]), words(&of["since"]));
        }
    }
}

/// The first of `id`, `id-2`, `id-3`, … that is not taken, which it then is.
pub fn untaken(id: String, taken: &mut HashSet<String>) -> String {
    let more = (2..).map(|n: u32| format!("{id}-{n}"));
    let mut all = std::iter::once(id.clone()).chain(more);
    let free = all.find(|id| !taken.contains(id)).unwrap_or(id);
    taken.insert(free.clone());
    free
}

/// A name by tool, cause and cell, in cells that are halved `level` times.
fn key(finding: &Finding, tool: &str, [low, high]: Bounds, level: u32) -> String {
    let extent = high - low;
    let cell_mm = extent.max_element() / N_CELLS;
    let index = |axis: usize| {
        if extent[axis] <= 0.0 {
            return 0;
        }
        let n_half = (extent[axis] / (2.0 * cell_mm)).round().max(1.0);
        let n = 2.0 * n_half * f64::from(1u32 << level);
        let from_middle = finding.middle_mm[axis] - (low[axis] + 0.5 * extent[axis]);
        (from_middle / extent[axis] * n).round() as i64
    };
    let [x, y, z] = [0, 1, 2].map(index);
    let text = format!("{tool}\n{}\n{level}\n{x} {y} {z}", finding.words());
    let hash = hmac_sha256::Hash::hash(text.as_bytes());
    format!("F-{}", hash[..3].iter().map(|byte| format!("{byte:02x}")).collect::<String>())
}
