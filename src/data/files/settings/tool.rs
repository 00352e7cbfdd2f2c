//! What files state of a tool.

use crate::data::files::tools::{Tool, steps_words};
use serde::{Deserialize, Serialize};

/// What the four lengths of a tool do not say; mm. Steps are `height:radius`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct ToolSettings {
    /// Radius of the tip's corner.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corner_mm: Option<f64>,
    /// Margin about what does not cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearance_mm: Option<f64>,
    /// Stock to leave.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub allowance_mm: Option<f64>,
    /// Radius at the upper end of the tip.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub side_mm: Option<f64>,
    /// Steps of the tool below the holder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Those of them that do not cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neck_and_shank: Option<String>,
    /// Steps of the holder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holder: Option<String>,
    /// Its profile, of a tool that is given by one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Height of the holder's nose above the tip.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stick_out_mm: Option<f64>,
    /// By how much the steps reach beyond the true tool.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excess_mm: Option<f64>,
    /// Overall length of the tool without its holder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overall_mm: Option<f64>,
    /// Whether it is a tool that exists, of a library or table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of_library: Option<bool>,
}

impl ToolSettings {
    /// Of a tool.
    pub fn of(tool: &Tool) -> Self {
        let assembly = &tool.assembly;
        let lengths = ToolSettings {
            corner_mm: Some(tool.corner_mm),
            clearance_mm: Some(tool.clearance_mm),
            allowance_mm: Some(assembly.allowance_mm()),
            overall_mm: assembly.overall_mm(),
            ..ToolSettings::default()
        };
        if tool.description.is_none() {
            return lengths;
        }
        ToolSettings {
            side_mm: Some(assembly.tip()[1]),
            body: Some(steps_words(&assembly.own_body())),
            neck_and_shank: Some(steps_words(assembly.neck_and_shank())),
            holder: Some(steps_words(assembly.holder())),
            profile: assembly.profile().map(ToString::to_string),
            stick_out_mm: Some(assembly.stick_out_mm()),
            excess_mm: Some(assembly.excess_mm()),
            ..lengths
        }
    }
}
