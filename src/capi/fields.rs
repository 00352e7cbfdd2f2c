//! The numbers of an outcome by what they are.

use super::results::Results;
use super::status::{Answer, Failure, not_computed, refused};
use crate::access::surface::SurfaceEvidence;
use glam::Vec3;
use std::borrow::Cow;

/// Positions of the sites, mm; float, rows of three. The same of every tool.
pub const DM_POINTS: u32 = 1;
/// Outward unit normals of the sites; float, rows of three. The same of every tool.
pub const DM_NORMALS: u32 = 2;
/// The directions that were tested, from tip to spindle; float, rows of three. The same of every tool.
pub const DM_DIRECTIONS: u32 = 3;
/// A direction in which the tool reaches the site, NaN where there is none; float, rows of three.
pub const DM_WITNESS: u32 = 4;
/// Share of the directions in which the tool reaches the site; float.
pub const DM_ACCESSIBLE_SHARE: u32 = 5;
/// How much the tool leaves, 0 where it reaches, mm; float, with dm_analysis_set_rest.
pub const DM_REST_MM: u32 = 6;
/// Volume of what is left about each site, mm³; float, with dm_analysis_set_rest.
pub const DM_REST_VOLUME_MM3: u32 = 7;
/// How far every height and radius of the tool may grow or must shrink, mm; float, with
/// dm_analysis_set_clearance_limit.
pub const DM_CLEARANCE_MM: u32 = 8;
/// Share of the directions that was not proven closed, of sites out of reach; float. 0: proven.
pub const DM_OPEN_DIRECTIONS: u32 = 9;
/// Share of the surface about each site; double. They add up to 1. The same of every tool.
pub const DM_AREA_SHARES: u32 = 101;
/// Where the tip is with DM_WITNESS, mm, NaN where there is none; double, rows of three.
pub const DM_TIP_MM: u32 = 102;
/// Gouge tolerance at each site, mm; double.
pub const DM_TOLERANCE_MM: u32 = 103;
/// The triangle that each site lies on; uint32_t. The same of every tool.
pub const DM_FACES: u32 = 201;
/// Number of directions in which the tool reaches the site; uint32_t.
pub const DM_ACCESSIBLE_DIRECTIONS: u32 = 202;
/// Number of the finding that each site belongs to, from 1 on, 0 if to none; uint32_t.
pub const DM_FINDING_OF_SITE: u32 = 203;
/// DM_ACCESSIBLE, DM_INACCESSIBLE or DM_TIP_DOES_NOT_FIT; uint8_t.
pub const DM_ANSWERS: u32 = 301;
/// 1 if the site is among those most often in the way, else 0; uint8_t, with dm_analysis_set_occlusion.
pub const DM_OCCLUSION: u32 = 302;
/// Name of the tool for files and tables; text.
pub const DM_TOOL_NAME: u32 = 401;
/// The tool in words, without its name; text.
pub const DM_TOOL_WORDS: u32 = 402;
/// What may make the answers misleading, a line each; text.
pub const DM_WARNINGS: u32 = 403;
/// What was changed or left out, a line each; text. The same of every tool.
pub const DM_NOTICES: u32 = 404;
/// The findings with all that is known of them, as in findings.json; text.
pub const DM_FINDINGS_JSON: u32 = 405;
/// Name of the part; text. The same of every tool.
pub const DM_PART_NAME: u32 = 406;

/// Numbers to be copied, held or made for it.
type Numbers<'a, T> = Answer<Cow<'a, [T]>>;

impl Results {
    /// A field of float.
    pub fn floats(&self, tool: u32, field: u32) -> Numbers<'_, f32> {
        let threes = |vectors: &[Vec3]| Ok(vectors.iter().flat_map(|v| v.to_array()).collect());
        match field {
            DM_POINTS => return threes(&self.outcome.sites().points),
            DM_NORMALS => return threes(&self.outcome.sites().normals),
            DM_DIRECTIONS => return threes(self.outcome.directions().vectors()),
            DM_REST_MM => {
                return computed(&self.site_answers(tool)?.rest_mm, "the rest", REST);
            }
            DM_REST_VOLUME_MM3 => {
                let volume = &self.site_answers(tool)?.rest_volume_mm3;
                return computed(volume, "the volume of the rest", REST);
            }
            DM_WITNESS | DM_ACCESSIBLE_SHARE | DM_CLEARANCE_MM | DM_OPEN_DIRECTIONS => {}
            other => return Err(unknown(other, "float", "1 to 9")),
        }
        let answers = &self.tool(tool)?.labels.answers;
        match field {
            DM_WITNESS => {
                let of_site = |found: &Option<Vec3>| found.map_or([f32::NAN; 3], |d| d.to_array());
                Ok(answers.witness.iter().flat_map(of_site).collect())
            }
            DM_ACCESSIBLE_SHARE => computed(&answers.accessible_share, "the share", ALWAYS),
            DM_CLEARANCE_MM => computed(&answers.clearance_mm, "the clearance", CLEARANCE),
            _ => computed(&self.surface(tool)?.open_directions, "what is not proven", ALWAYS),
        }
    }

    /// A field of double.
    pub fn doubles(&self, tool: u32, field: u32) -> Numbers<'_, f64> {
        match field {
            DM_AREA_SHARES => Ok(self.areas()?.shares().into()),
            DM_TIP_MM => {
                let poses = &self.surface(tool)?.witness;
                let tip = |pose: Option<[f64; 3]>| pose.unwrap_or([f64::NAN; 3]);
                let rows = poses.iter().map(|pose| tip(pose.map(|pose| pose.tip_mm.to_array())));
                Ok(rows.flatten().collect())
            }
            DM_TOLERANCE_MM => computed(&self.surface(tool)?.tolerance_mm, "the tolerance", ALWAYS),
            other => Err(unknown(other, "double", "101 to 103")),
        }
    }

    /// A field of whole numbers.
    pub fn wholes(&self, tool: u32, field: u32) -> Numbers<'_, u32> {
        match field {
            DM_FACES => computed(&self.outcome.sites().faces, "the triangle of sites", ALWAYS),
            DM_ACCESSIBLE_DIRECTIONS => {
                let counts = &self.tool(tool)?.labels.answers.accessible_directions;
                computed(counts, "the number of directions", ALWAYS)
            }
            DM_FINDING_OF_SITE => Ok(self.findings(tool)?.of_site[..].into()),
            other => Err(unknown(other, "uint32_t", "201 to 203")),
        }
    }

    /// A field of bytes.
    pub fn bytes(&self, tool: u32, field: u32) -> Numbers<'_, u8> {
        match field {
            DM_ANSWERS => Ok(self.answers(tool)?.into()),
            DM_OCCLUSION => {
                let marks: Vec<u8> =
                    self.tool(tool)?.labels.answers.occlusion.iter().map(|&m| m.into()).collect();
                computed(&marks, "occlusion", OCCLUSION).map(|marks| marks.into_owned().into())
            }
            other => Err(unknown(other, "uint8_t", "301 or 302")),
        }
    }

    /// A field of text.
    pub fn text(&self, tool: u32, field: u32) -> Answer<String> {
        let of = || self.tool(tool).map(|_| &self.outcome.tools()[tool as usize]);
        match field {
            DM_TOOL_NAME => Ok(of()?.name.clone()),
            DM_TOOL_WORDS => Ok(of()?.words()),
            DM_WARNINGS => Ok(self.warnings(tool)?.join("\n")),
            DM_NOTICES => Ok(self.notices().join("\n")),
            DM_FINDINGS_JSON => Ok(self.findings(tool)?.json().to_string()),
            DM_PART_NAME => Ok(self.outcome.part().to_owned()),
            other => Err(unknown(other, "text", "401 to 406")),
        }
    }

    /// What only the mesh definition answers, which is the only one here.
    fn surface(&self, tool: u32) -> Answer<&SurfaceEvidence> {
        let none = || not_computed("the answer about the mesh", ALWAYS);
        self.tool(tool)?.labels.surface.as_ref().ok_or_else(none)
    }
}

const REST: &str = "call dm_analysis_set_rest before the analysis runs";
const CLEARANCE: &str = "call dm_analysis_set_clearance_limit before the analysis runs";
const OCCLUSION: &str = "call dm_analysis_set_occlusion before the analysis runs";
const ALWAYS: &str = "please report it with the input";

/// The numbers, of which there are none if they were not computed.
fn computed<'a, T: Clone>(numbers: &'a [T], what: &str, remedy: &str) -> Numbers<'a, T> {
    match numbers.is_empty() {
        true => Err(not_computed(what, remedy)),
        false => Ok(numbers.into()),
    }
}

fn unknown(field: u32, kind: &str, numbers: &str) -> Failure {
    let expected = format!("a field of {kind}, {numbers}");
    refused("field", field, expected, "take its name from the header")
}
