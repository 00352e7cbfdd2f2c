//! The answers, and what follows from them.

use super::mesh::{check_flags, unit_of};
use super::status::{Answer, not_computed, refused};
use super::tools::no_tool;
use super::work;
use crate::Result;
use crate::analysis::{Files, Observer, Outcome, ToolOutcome};
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::findings::gate::SiteAreas;
use crate::findings::{Finding, Findings, for_all_tools};
use crate::report::export::Extra;
use crate::storage::atomic_file;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// In place of the number of a tool: what no tool reaches.
pub const DM_ALL_TOOLS: u32 = 0xffff_ffff;

/// The answer for a site: the tool reaches it.
pub const DM_ACCESSIBLE: u32 = 0;
/// The answer for a site: in every direction what does not cut, or the flank, collides.
pub const DM_INACCESSIBLE: u32 = 1;
/// The answer for a site: in some direction only the tip penetrates the part, in none nothing does.
pub const DM_TIP_DOES_NOT_FIT: u32 = 2;

/// Also write `report.html`.
pub const DM_WRITE_REPORT: u32 = 1;
/// Draw no pictures.
pub const DM_WRITE_NO_PICTURES: u32 = 2;
/// Also write binary glTF.
pub const DM_WRITE_GLB: u32 = 4;
/// Also write a table of the sites.
pub const DM_WRITE_CSV: u32 = 8;

/// The answers about every tool.
pub struct Results {
    pub outcome: Arc<Outcome>,
    /// About the placing of the sites, a sentence each.
    warnings: Vec<String>,
    notices: Vec<String>,
    areas: OnceLock<SiteAreas>,
    together: OnceLock<SiteAnswers>,
}

impl Results {
    /// Of what was computed.
    pub fn new(outcome: Outcome, warnings: Vec<String>, notices: Vec<String>) -> Self {
        let (areas, together) = (OnceLock::new(), OnceLock::new());
        Results { outcome: Arc::new(outcome), warnings, notices, areas, together }
    }

    /// What each site stands for.
    pub fn areas(&self) -> Answer<&SiteAreas> {
        if let Some(areas) = self.areas.get() {
            return Ok(areas);
        }
        let areas = self.outcome.areas()?;
        // Another thread may have been faster, with the same.
        Ok(self.areas.get_or_init(|| areas))
    }

    /// The answers of a tool.
    pub fn tool(&self, tool: u32) -> Answer<&ToolOutcome> {
        let answers = self.outcome.answers();
        answers.get(tool as usize).ok_or_else(|| no_tool(tool, answers.len()))
    }

    /// The answers of a tool, or of all together.
    pub fn site_answers(&self, tool: u32) -> Answer<&SiteAnswers> {
        match tool {
            DM_ALL_TOOLS => Ok(self.together.get_or_init(|| {
                for_all_tools(self.outcome.answers().iter().map(|answer| &answer.labels.answers))
            })),
            tool => Ok(&self.tool(tool)?.labels.answers),
        }
    }

    /// An answer per site, by its number in C.
    pub fn answers(&self, tool: u32) -> Answer<Vec<u8>> {
        let of = self.site_answers(tool)?;
        Ok(of.of_sites().iter().map(|answer| number(*answer) as u8).collect())
    }

    /// The share of the surface that has an answer.
    pub fn share(&self, tool: u32, answer: u32) -> Answer<f64> {
        if answer > DM_TIP_DOES_NOT_FIT {
            let expected = "DM_ACCESSIBLE, DM_INACCESSIBLE or DM_TIP_DOES_NOT_FIT";
            return Err(refused("answer", answer, expected, "name one of them"));
        }
        let answers = self.answers(tool)?;
        Ok(self.areas()?.share(|i| u32::from(answers[i]) == answer))
    }

    /// Area of the surface.
    pub fn surface_mm2(&self) -> Answer<f64> {
        let none = || not_computed("the area of the surface", "only a mesh has one");
        self.areas()?.total_mm2().ok_or_else(none)
    }

    /// The findings of a tool, or where no tool reaches.
    pub fn findings(&self, tool: u32) -> Answer<&Findings> {
        match tool {
            DM_ALL_TOOLS => Ok(self.outcome.findings()),
            tool => Ok(&self.tool(tool)?.findings),
        }
    }

    /// A finding by its number, from 0 on.
    pub fn finding(&self, tool: u32, finding: usize) -> Answer<&Finding> {
        let list = &self.findings(tool)?.list;
        list.get(finding).ok_or_else(|| {
            let expected = format!("less than {}, the number of findings", list.len());
            refused("finding", finding, expected, "count findings from 0")
        })
    }

    /// What may make the answers misleading, of a tool or of all.
    pub fn warnings(&self, tool: u32) -> Answer<Vec<String>> {
        let own = match tool {
            DM_ALL_TOOLS => self.outcome.answers(),
            tool => std::slice::from_ref(self.tool(tool)?),
        };
        let own = own.iter().flat_map(|of| &of.warnings).map(ToString::to_string);
        let mut all = self.warnings.clone();
        for warning in own {
            if !all.contains(&warning) {
                all.push(warning);
            }
        }
        Ok(all)
    }

    /// What was changed or left out.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Writes the folder of `deepmill label`.
    pub fn write(
        &self,
        folder: &str,
        unit: Option<&str>,
        flags: u32,
        observer: &mut dyn Observer,
    ) -> Answer<()> {
        check_flags(flags, DM_WRITE_REPORT | DM_WRITE_NO_PICTURES | DM_WRITE_GLB | DM_WRITE_CSV)?;
        let has = |flag: u32| flags & flag != 0;
        let also = [(DM_WRITE_GLB, Extra::Glb), (DM_WRITE_CSV, Extra::Csv)];
        let files = Files {
            pictures: !has(DM_WRITE_NO_PICTURES),
            report: has(DM_WRITE_REPORT),
            also: also.into_iter().filter(|(flag, _)| has(*flag)).map(|(_, extra)| extra).collect(),
            unit: unit_of(unit)?,
        };
        let (outcome, folder) = (Arc::clone(&self.outcome), Path::new(folder).to_path_buf());
        let write = move |observer: &mut dyn Observer| -> Result<()> {
            outcome.write(&folder, &files, observer).map(drop)
        };
        work::run(0, observer, write)
    }

    /// Writes the HTML report into one file.
    pub fn write_report(&self, path: &str, unit: Option<&str>) -> Answer<()> {
        let html = self.outcome.html(unit_of(unit)?)?;
        let fill = |file: &mut dyn std::io::Write| file.write_all(html.as_bytes());
        Ok(atomic_file::write_atomic(Path::new(path), fill)?)
    }
}

/// The number of a finding's cause in C.
pub fn cause(finding: &Finding) -> u32 {
    number(finding.cause)
}

/// The number of an answer in C.
fn number(answer: SiteAnswer) -> u32 {
    match answer {
        SiteAnswer::Accessible => DM_ACCESSIBLE,
        SiteAnswer::Inaccessible => DM_INACCESSIBLE,
        SiteAnswer::TipDoesNotFit => DM_TIP_DOES_NOT_FIT,
    }
}
