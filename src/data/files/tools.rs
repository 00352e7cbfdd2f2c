//! Tool libraries: files that say which cutters a shop has. `docs/tools.md` says what becomes what.
//!
//! | file | recognised by |
//! |---|---|
//! | Fusion 360 export | JSON with `data` or `geometry`; `.tools`, a ZIP with such a `tools.json` |
//! | what [`to_csv`] and [`to_json`] write | the columns, or `format` |
//! | HSMWorks, Inventor CAM or Fusion 360 (`.hsmlib`) | XML with `tool-library` or `tool-table` |
//! | FreeCAD tool bit, one tool | JSON with `parameter`; a folder stands for its `.fctb` files |
//! | FreeCAD library (`.fctl`) | JSON whose `tools` have a `path`; the bits are beside it or in `Bit` |
//! | CAMotics tool table | JSON whose tools have a `shape` |
//! | LinuxCNC tool table | `.tbl`, or a first line that begins with `T` and a number |
//! | table of lengths, or in the words of a shop | anything else: CSV |
//!
//! What a file leaves out comes from [`MissingParameters`], never assumed. A tool that is not complete, contradicts
//! itself or is of a kind that `docs/tool-families.md` does not list is left out by name with the reason, and the rest
//! is read.

mod by_format;
mod camotics;
mod described;
mod export;
mod freecad;
mod fusion;
mod holder;
mod hsmlib;
mod linuxcnc;
mod names;
mod place;
mod read_holder;
mod reading;
mod serialized;
mod shop;
mod table;
mod table_text;
mod unpack;
mod words;

use super::ball_end_words;
use crate::geom::units::Unit;
use crate::geom::units::length::tidy;
use crate::tool::cutter::{Assembly, Cutter, CutterParams, Step};
use crate::{Error, Result};
use names::{folder_name, in_one_line};
use serde::{Deserialize, Serialize};

#[doc(hidden)] // checked by fuzz targets
pub use by_format::from_bytes;
pub use by_format::read;
#[doc(hidden)] // of the program
pub use by_format::read_several;
#[doc(hidden)] // of the program
pub use export::{to_csv, to_json};
pub use holder::Holder;
#[cfg(any(feature = "python", feature = "capi"))]
pub(crate) use names::named_apart;
#[doc(hidden)] // of the program
pub use names::number_repeated;
#[doc(hidden)] // checked by fuzz targets
pub use read_holder::holder_from_bytes;
pub use read_holder::read_holder;
pub(crate) use table::{steps_of_words, steps_words};

/// A checked cutter and the numbers it was ordered with.
///
/// ```
/// use deepmill::{cutter::Step, data::files::tools::Tool};
///
/// // CR, CH, FR, FH in mm; a flat end, with half a millimeter around what does not cut.
/// let tool = Tool::new("3,20,20,30".parse()?, Some(0.0), 0.5)?.named("T1 rougher");
/// assert_eq!(tool.assembly.stick_out_mm(), 26.0); // 2·CR + CH
/// assert_eq!(tool.words().split(", ").last(), Some("clearance 0.5 mm"));
/// let widest_mm = |steps: &[Step]| steps.iter().map(|s| s.radius_mm).filter(|r| r.is_finite()).fold(0.0, f64::max);
/// assert_eq!((widest_mm(tool.assembly.holder()), widest_mm(tool.cutter.steps())), (20.0, 20.5));
/// let error = Tool::new("3,20,20,30".parse()?, None, -3.0).unwrap_err().to_string();
/// assert!(error.contains("more than -CR = -3 mm"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")] // checked when it is read
pub struct Tool {
    /// Name as its file has it.
    pub name: String,
    /// Number in the machine's table.
    pub number: Option<u32>,
    folder: String,
    unit: Unit,
    /// CR, CH, FR, FH; of a tool with more steps a summary: radius of the tip, height from `2·CR` above it to the
    /// holder, greatest radius and height of the holder.
    pub params: CutterParams,
    /// Radius of the tip's corner, mm: 0 for a flat end, CR for a ball end.
    pub corner_mm: f64,
    /// Safety margin about what does not cut, mm.
    pub clearance_mm: f64,
    /// The cutter, margin and allowance included.
    pub cutter: Cutter,
    /// Body, holder and stick-out, without the margin, but with the allowance.
    pub assembly: Assembly,
    /// In words, where four lengths do not say it.
    pub description: Option<String>,
}

impl Tool {
    /// A tool named after its lengths; without a corner it is a ball end.
    ///
    /// # Errors
    /// As [`Cutter::bull_nose`] and [`Cutter::with_clearance`]; or if the clearance is -CR or less.
    pub fn new(params: CutterParams, corner_mm: Option<f64>, clearance_mm: f64) -> Result<Self> {
        let corner_mm = corner_mm.unwrap_or(params.cr_mm);
        let cutter = Cutter::bull_nose(params, corner_mm)?;
        check_clearance(clearance_mm, params.cr_mm)?;
        let cutter = cutter.with_clearance(clearance_mm)?;
        let mut name = params.to_array().map(|length| length.to_string()).join("-");
        if corner_mm != params.cr_mm {
            name += &format!("-corner{corner_mm}");
        }
        if clearance_mm != 0.0 {
            name += &format!("-clearance{clearance_mm}");
        }
        let CutterParams { cr_mm, ch_mm, fr_mm, fh_mm } = params;
        let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
        let assembly = Assembly::from_steps(
            [corner_mm, cr_mm - corner_mm],
            vec![step(2.0 * cr_mm, cr_mm)],
            vec![step(0.0, fr_mm), step(fh_mm, f64::INFINITY)],
            2.0 * cr_mm + ch_mm,
        )?;
        Ok(Tool {
            folder: name.clone(),
            name,
            number: None,
            unit: Unit::Millimeter,
            params,
            corner_mm,
            clearance_mm,
            cutter,
            assembly,
            description: None,
        })
    }

    /// A tool of a library.
    ///
    /// # Errors
    /// As [`Assembly::cutter`], or as [`Tool::new`] for the clearance.
    pub fn of_assembly(
        name: &str,
        assembly: Assembly,
        clearance_mm: f64,
        description: String,
    ) -> Result<Self> {
        let [corner_mm, side_mm] = assembly.tip();
        let cr_mm = corner_mm + side_mm;
        check_clearance(clearance_mm, cr_mm)?;
        let whole = assembly.cutter()?;
        let summary = || {
            let finite = assembly.holder().iter().filter(|step| step.radius_mm.is_finite());
            CutterParams {
                cr_mm,
                ch_mm: (assembly.stick_out_mm() - 2.0 * cr_mm).max(0.0),
                fr_mm: finite.map(|step| step.radius_mm).fold(cr_mm, f64::max),
                fh_mm: assembly.holder().last().map_or(0.0, |step| step.height_mm),
            }
        };
        let params = whole.as_ball_end().unwrap_or_else(summary);
        let params = CutterParams::from_array(params.to_array().map(tidy));
        let cutter = whole.with_clearance(clearance_mm)?;
        let description = Some(description);
        let mut tool = Tool {
            name: String::new(),
            number: None,
            folder: String::new(),
            unit: Unit::Millimeter,
            params,
            corner_mm,
            clearance_mm,
            cutter,
            assembly,
            description,
        };
        tool.rename(name);
        Ok(tool)
    }

    /// Body, holder and stick-out with the margin.
    ///
    /// # Errors
    /// As [`Assembly::with_clearance`].
    pub fn held(&self) -> Result<Assembly> {
        self.assembly.with_clearance(self.clearance_mm)
    }

    /// The same tool, leaving stock of this thickness: [`Cutter::with_allowance`].
    ///
    /// # Errors
    /// As [`Assembly::with_allowance`].
    pub fn with_allowance(self, allowance_mm: f64) -> Result<Self> {
        if allowance_mm == self.assembly.allowance_mm() {
            return Ok(self);
        }
        let assembly = self.assembly.with_allowance(allowance_mm)?;
        let cutter = assembly.with_clearance(self.clearance_mm)?.cutter()?;
        Ok(Tool { assembly, cutter, ..self })
    }

    /// The same tool, of which the overall length is stated.
    ///
    /// # Errors
    /// As [`Assembly::with_overall`].
    pub fn of_overall_length(self, overall_mm: f64) -> Result<Self> {
        let assembly = self.assembly.with_overall(overall_mm)?;
        Ok(Tool { assembly, ..self })
    }

    /// The unit in which its maker states its lengths: that of drawings.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    pub(crate) fn of_unit(self, unit: Unit) -> Self {
        Tool { unit, ..self }
    }

    /// The same tool by another name.
    pub fn named(mut self, name: &str) -> Self {
        self.rename(name);
        self
    }

    fn rename(&mut self, name: &str) {
        let name = in_one_line(name);
        self.name = if name.is_empty() { "tool".into() } else { name };
        self.folder = folder_name(&self.name);
    }

    /// Name of a folder for its files, on every system; [`number_repeated`] tells those of several tools apart.
    pub fn folder(&self) -> &str {
        &self.folder
    }

    /// The same for two tools of the same name, whatever the case.
    pub fn name_key(&self) -> String {
        self.name.to_lowercase()
    }

    /// The tool in words, without its name.
    pub fn words(&self) -> String {
        let mut words = self.description.clone().unwrap_or_else(|| self.lengths_in_words());
        if self.clearance_mm != 0.0 {
            words += &format!(", clearance {} mm", self.clearance_mm);
        }
        if self.assembly.allowance_mm() != 0.0 {
            words += &format!(", allowance {} mm", self.assembly.allowance_mm());
        }
        words
    }

    fn lengths_in_words(&self) -> String {
        let words = ball_end_words(self.params);
        if self.corner_mm == 0.0 {
            return words.replacen("ball-end", "flat-end", 1);
        }
        if self.corner_mm != self.params.cr_mm {
            return words.replacen("ball-end", &format!("bull-nose {} mm,", self.corner_mm), 1);
        }
        words
    }
}

fn check_clearance(clearance_mm: f64, cr_mm: f64) -> Result<()> {
    // Others are checked where the cutter gets it.
    if clearance_mm.is_nan() || clearance_mm > -cr_mm {
        return Ok(());
    }
    let expected = format!("more than -CR = {} mm", -cr_mm);
    let remedy = "nothing would be left of a shank as wide as the cutter: take a thinner margin";
    Err(Error::argument("clearance", clearance_mm, expected, remedy))
}

fn starts_with_ignoring_case(text: &str, start: &str) -> bool {
    text.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start))
}

/// Values of parameters that a tool file leaves out. An error names what is missing in both.
///
/// ```
/// use deepmill::data::files::tools::MissingParameters;
/// let defaults = MissingParameters::default().with_stick_out_mm(Some(30.0)).with_unit_mm(Some(25.4));
/// assert_eq!(defaults.holder, None);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct MissingParameters {
    /// Height of the holder's nose above the tip, mm.
    pub stick_out_mm: Option<f64>,
    /// The holder.
    pub holder: Option<Holder>,
    /// Diameter of the shank, mm.
    pub shank_mm: Option<f64>,
    /// Length of the flutes, mm.
    pub flutes_mm: Option<f64>,
    /// Millimeters that the file's unit has.
    pub unit_mm: Option<f64>,
}

setters!(MissingParameters {
    with_stick_out_mm(stick_out_mm: Option<f64>),
    with_holder(holder: Option<Holder>),
    with_shank_mm(shank_mm: Option<f64>),
    with_flutes_mm(flutes_mm: Option<f64>),
    with_unit_mm(unit_mm: Option<f64>),
});

/// What a file of tools holds.
///
/// ```
/// use deepmill::data::files::tools::{MissingParameters, read};
///
/// # let temporary = tempfile::tempdir().unwrap();
/// # let path = temporary.path().join("tools.csv");
/// let text = "name,CR,CH,FR,FH,supplier\nfinisher,1.5,6,40,5,A\nbroken,1.5,6,1,5,B\n";
/// std::fs::write(&path, text).unwrap();
/// let table = read(&path, &MissingParameters::default())?;
/// assert_eq!(table.tools.iter().map(|tool| &*tool.name).collect::<Vec<_>>(), ["finisher"]);
/// assert_eq!(table.unused, ["\"supplier\""]);
/// // A holder thinner than the tool is named, and the rest is read.
/// assert!(table.refused[0].ends_with("the tool is left out"), "{:?}", table.refused);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ToolTable {
    /// The tools in the order of the file; no two have the same name.
    pub tools: Vec<Tool>,
    /// Headings of columns that mean nothing here, in quotes.
    pub unused: Vec<String>,
    /// Tools that are left out: not complete, contradictory or of a kind that cannot be represented; one sentence each.
    pub refused: Vec<String>,
    /// What was changed to the safe side, one sentence each.
    pub notices: Vec<String>,
}

/// The places of tools in the order in which a shop prefers them: by diameter of the lower end, the greatest first,
/// then by stick-out, the least first, then as given.
#[doc(hidden)] // of the program
pub fn thick_and_short_first(tools: &[Tool]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..tools.len()).collect();
    let stick_out = |k: usize| tools[k].assembly.stick_out_mm();
    order.sort_by(|&a, &b| {
        let by_diameter = tools[b].params.cr_mm.total_cmp(&tools[a].params.cr_mm);
        by_diameter.then(stick_out(a).total_cmp(&stick_out(b))).then(a.cmp(&b))
    });
    order
}

#[cfg(test)]
mod tests;
