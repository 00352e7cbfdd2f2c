//! The tool of a tab at its sites: its outline, once for each tool, and a free pose per site.
//!
//! | part of the block | content |
//! |---|---|
//! | `viewV.axes` | three `f32` for each direction that occurs, from tip to spindle |
//! | `viewV.axis` | four bytes per site: row of its direction from 1 on, 0 where nothing is drawn |
//! | `viewV.tipK` | four bytes per site with a pose: steps of `step_mm` from the site to the tip along x, y, z, zigzag |

use super::pack::Block;
use crate::access::surface::WitnessPose;
use crate::data::files::LabelFile;
use crate::data::files::label_query::LabelQuery;
use crate::geom::Sites;
use crate::report::tool_drawing::{Portion, Solid};
use glam::DVec3;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::Path;

/// Bytes per site.
pub(super) const SITE_BYTES: usize = 16;
/// Steps of the greatest radius of what cuts: tips are as exact.
const STEPS: f64 = 2048.0;

/// Where a tab shows a tool.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::report) enum ToolAt {
    /// Nowhere: no pose is known.
    #[default]
    Nowhere,
    /// In these poses.
    Poses(Poses),
    /// Where the first of the other tabs has one.
    FirstOfOthers,
}

/// One tool in a pose per site.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::report) struct Poses {
    tool: Solid,
    of: Vec<Option<WitnessPose>>,
}

impl ToolAt {
    /// Of labels: free poses of their tool. With `leaves` where none is free the pose that leaves least, if the rest
    /// was computed.
    pub fn of_labels(file: &LabelFile, leaves: bool) -> Self {
        // Files of versions that did not state their tool have a page all the same.
        let Ok(tool) = LabelQuery::tool_of(file, Path::new("")) else { return ToolAt::Nowhere };
        let n = file.sites.len();
        let of: Vec<Option<WitnessPose>> = match &file.labels.surface {
            None => LabelQuery::poses_among_points(file, &tool),
            Some(surface) => {
                let rest =
                    |i: usize| surface.rest_pose.get(i).copied().flatten().filter(|_| leaves);
                let witness = surface.witness.iter().take(n).enumerate();
                witness.map(|(i, pose)| pose.or_else(|| rest(i))).collect()
            }
        };
        match of.len() == n && of.iter().any(Option::is_some) {
            true => ToolAt::Poses(Poses { tool: Solid::of(&tool), of }),
            false => ToolAt::Nowhere,
        }
    }

    pub fn is_somewhere(&self) -> bool {
        matches!(self, ToolAt::Poses(_))
    }

    /// Adds the numbers of tab `v`; returns what the script must know of them.
    pub fn add(&self, block: &mut Block, v: usize, sites: &Sites, tools: &mut Vec<Value>) -> Value {
        let poses = match self {
            ToolAt::Nowhere => return Value::Null,
            ToolAt::FirstOfOthers => return json!("first"),
            ToolAt::Poses(poses) => poses,
        };
        let outline = outline(&poses.tool);
        let number = tools.iter().position(|other| *other == outline).unwrap_or_else(|| {
            tools.push(outline);
            tools.len() - 1
        });
        let (mut axes, mut rows) = (Vec::new(), HashMap::new());
        let axis = poses.of.iter().map(|pose| {
            pose.map_or(0, |pose| {
                let bits = pose.direction.to_array().map(f32::to_bits);
                *rows.entry(bits).or_insert_with(|| {
                    axes.extend(bits);
                    axes.len() as u32 / 3
                })
            })
        });
        let axis: Vec<u32> = axis.collect();
        block.add_words(format!("view{v}.axis"), axis.iter().copied());
        let n_axes = axes.len() / 3;
        block.add_words(format!("view{v}.axes"), axes.into_iter());
        let step_mm = poses.tool.cutting_radius_mm / STEPS;
        let tips = sites.points.iter().zip(&poses.of);
        let tips = tips.filter_map(|(p, pose)| pose.map(|pose| pose.tip_mm - p.as_dvec3()));
        let steps: Vec<DVec3> = tips.map(|offset| offset / step_mm).collect();
        for k in 0..3 {
            let words = steps.iter().map(move |offset| zigzag(offset[k]));
            block.add_words(format!("view{v}.tip{k}"), words);
        }
        json!({ "tool": number, "step_mm": step_mm, "n_axes": n_axes, "n_tips": steps.len() })
    }
}

/// A number rounded, as 0, −1, 1, −2, 2 …; what does not fit is cut off.
fn zigzag(x: f64) -> u32 {
    let x = x.round() as i32;
    ((x << 1) ^ (x >> 31)) as u32
}

/// Radii and heights to the micrometer, and the portions: 0 cuts, 1 neck, 2 shank, 3 holder.
fn outline(tool: &Solid) -> Value {
    let points = tool.points.iter().map(|point| point.map(super::to_micron));
    let portion = |(portion, to): &(Portion, f64)| {
        let kind = match portion {
            Portion::Cutting => 0,
            Portion::Neck => 1,
            Portion::Shank => 2,
            Portion::Holder => 3,
        };
        json!([kind, super::to_micron(*to)])
    };
    json!({
        "points": points.collect::<Vec<_>>(),
        "portions": tool.portions.iter().map(portion).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zigzag_is_that_of_the_script() {
        let back = |code: u32| (code >> 1) as i32 ^ -((code & 1) as i32);
        for x in [0.0, 0.4, -0.6, 1.0, -1.0, 7.5, -70_000.2, 3e5] {
            assert_eq!(back(zigzag(x)), x.round() as i32, "{x}");
        }
    }
}
