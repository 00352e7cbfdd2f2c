//! What fixtures and the table keep out of reach, and how it is said.

use crate::output::Output;
use deepmill::analysis::KeptOut;
use deepmill::data::files::tools::Tool;
use deepmill::findings::gate::SiteAreas;
use serde_json::{Value, json};

/// Says what each fixture keeps out of reach; as JSON for the result.
pub fn say(kept: &KeptOut, tools: &[Tool], areas: &SiteAreas, output: &Output) -> Value {
    let mut rows = Vec::new();
    for (tool, kept_by) in tools.iter().zip(&kept.by_tool) {
        let of = if tools.len() > 1 { format!("{}: ", tool.name) } else { String::new() };
        for (k, name) in kept.names.iter().enumerate() {
            let share = areas.share(|i| kept_by[i] == Some(k));
            if share > 0.0 {
                output.say(format!(
                    "{of}{name} keeps {:.2} % of the surface out of reach",
                    100.0 * share
                ));
            }
            rows.push(json!({ "tool": tool.name, "fixture": name, "keeps_out": share }));
        }
    }
    json!(rows)
}
