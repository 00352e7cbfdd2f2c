//! Tools.

use super::errors::{checked, detached, refused, wrong_type};
use super::input::{self, Rows};
use super::options::{Options, number, text_of};
use super::part::path_of;
use crate::data::files::tools::{self, MissingParameters, named_apart};
use crate::tool::cutter::{Assembly, Cutter, CutterParams, Profile, ProfileSection, Section};
use crate::{Error, Result};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};

/// A milling cutter in its holder.
///
/// Tool(lengths=None, *, cr=None, ch=None, fr=None, fh=None, kind="ball", corner=None, clearance=0.0, allowance=0.0,
///      name=None)
///
/// lengths: "CR,CH,FR,FH" or four numbers, mm: cutter radius, height of the cylinder from 2 CR above the tip to the
/// holder, radius and height of the holder; above it everything is spindle. Or each by its keyword.
/// kind: "ball" or "flat"; or the radius of the tip's corner by `corner`, mm: 0 is flat, CR a ball.
/// clearance: margin about what does not cut, mm. allowance: stock that is left, mm.
///
/// >>> import deepmill
/// >>> deepmill.Tool("3,20,20,20", kind="flat").lengths_mm
/// (3.0, 20.0, 20.0, 20.0)
#[pyclass(frozen, module = "deepmill")]
pub struct Tool {
    pub tool: tools::Tool,
    /// Whether a file names it.
    pub of_file: bool,
}

#[pymethods]
impl Tool {
    #[new]
    #[pyo3(signature = (lengths=None, **options))]
    #[pyo3(
        text_signature = "(lengths=None, *, cr=None, ch=None, fr=None, fh=None, kind='ball', corner=None, \
            clearance=0.0, allowance=0.0, name=None)"
    )]
    fn new(
        py: Python<'_>,
        lengths: Option<Bound<'_, PyAny>>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut options = Options::new(py, options)?;
        let by_name = [
            options.number("cr")?,
            options.number("ch")?,
            options.number("fr")?,
            options.number("fh")?,
        ];
        let params = match (lengths, by_name) {
            (Some(lengths), [None, None, None, None]) => params_of("lengths", &lengths)?,
            (None, [Some(cr), Some(ch), Some(fr), Some(fh)]) => {
                CutterParams::from_array([cr, ch, fr, fh])
            }
            (lengths, _) => {
                let found = if lengths.is_some() { "given in two ways" } else { "not complete" };
                let expected = "\"CR,CH,FR,FH\", four numbers, or cr, ch, fr and fh";
                return Err(refused(
                    py,
                    "lengths",
                    found,
                    expected,
                    "write for example Tool(\"1.5,6,40,5\")",
                ));
            }
        };
        let corner = options.number("corner")?;
        let corner = match (options.text("kind")?.as_deref(), corner) {
            (None, corner) => corner,
            (Some("ball"), None) => None,
            (Some("flat"), None) => Some(0.0),
            (Some("ball" | "flat"), Some(corner)) => {
                let remedy = "leave out kind or corner";
                return Err(refused(py, "corner", corner, "none with a kind", remedy));
            }
            (Some(other), _) => {
                let remedy = "give others by corner";
                return Err(refused(py, "kind", format!("`{other}`"), "ball or flat", remedy));
            }
        };
        let clearance = options.number("clearance")?.unwrap_or(0.0);
        let allowance = options.number("allowance")?.unwrap_or(0.0);
        let name = options.text("name")?;
        options.finish()?;
        let made = || -> Result<tools::Tool> {
            let tool = tools::Tool::new(params, corner, clearance)?.with_allowance(allowance)?;
            Ok(match name {
                Some(name) => tool.named(&name),
                None => tool,
            })
        };
        Ok(Tool { tool: checked(py, made())?, of_file: false })
    }

    /// A tool given by its profile, which may be wider below than above: a lollipop, a T-slot cutter, a drill.
    ///
    /// profile: radius and height, mm, from the tip upward, float [n, 2]; the first has height 0, or is the radius of a
    ///     flat lower end. Two points of one height are a face across the axis. Or text as in tables of tools.
    /// stick_out: height of the holder's nose above the tip, mm.
    /// holder: length, lower and upper radius of each of its segments from the nose upward, mm, float [k, 3].
    /// arcs: radius and height of the center of the arc from each point to the next, float [n - 1, 2]; all NaN is a
    ///     line. None: all are lines.
    /// cuts: whether the tool cuts from each point to the next, bool [n - 1]. None: all cuts.
    /// drill: it cuts along its axis alone. overall: length from tip to end, mm. clearance: margin about what does not
    /// cut, mm.
    ///
    /// >>> import deepmill, math
    /// >>> points = [[0, 0], [1.5, 3 + math.sqrt(6.75)], [1.5, 20], [3, 22]]
    /// >>> arcs = [[0, 3], [math.nan, math.nan], [math.nan, math.nan]]
    /// >>> deepmill.Tool.from_profile(points, 40, [[20, 15, 15]], arcs=arcs, cuts=[True, False, False]).words
    /// 'profile 6 mm, 40 mm out of its holder'
    #[staticmethod]
    #[pyo3(signature = (profile, stick_out, holder, **options))]
    #[pyo3(
        text_signature = "(profile, stick_out, holder, *, arcs=None, cuts=None, drill=False, overall=None, \
            clearance=0.0, name=None)"
    )]
    fn from_profile(
        profile: &Bound<'_, PyAny>,
        stick_out: &Bound<'_, PyAny>,
        holder: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let py = profile.py();
        let mut options = Options::new(py, options)?;
        let profile = profile_of(profile, &mut options)?;
        let stick_out_mm = number("stick_out", stick_out)?;
        let shape = Rows { shape: "[k, 3]", remedy: HOLDER, may_be_nan: false };
        let holder: Vec<Section> = input::rows("holder", holder, shape)?
            .into_iter()
            .map(|[length_mm, lower_radius_mm, upper_radius_mm]| Section {
                length_mm,
                lower_radius_mm,
                upper_radius_mm,
            })
            .collect();
        let overall = options.number("overall")?;
        let clearance = options.number("clearance")?.unwrap_or(0.0);
        let name = options.text("name")?;
        options.finish()?;
        let made = || -> Result<tools::Tool> {
            let diameter = 2.0 * profile.cutting_radius_mm();
            let name = name.unwrap_or_else(|| format!("profile-{diameter}"));
            let words = format!("profile {diameter} mm, {stick_out_mm} mm out of its holder");
            let assembly = Assembly::from_profile(profile, &holder, stick_out_mm)?;
            let assembly = match overall {
                Some(mm) => assembly.with_overall(mm)?,
                None => assembly,
            };
            tools::Tool::of_assembly(&name, assembly, clearance, words)
        };
        Ok(Tool { tool: checked(py, made())?, of_file: false })
    }

    /// Name for files and tables.
    #[getter]
    fn name(&self) -> &str {
        &self.tool.name
    }

    /// The profile as tables of tools have it, if the tool was given by one; else None.
    #[getter]
    fn profile(&self) -> Option<String> {
        self.tool.assembly.profile().map(Profile::to_string)
    }

    /// CR, CH, FR, FH, mm; a summary of a tool that has more steps.
    #[getter]
    fn lengths_mm(&self) -> (f64, f64, f64, f64) {
        self.tool.params.to_array().into()
    }

    /// Radius of the tip's corner, mm: 0 for a flat end, CR for a ball end.
    #[getter]
    fn corner_mm(&self) -> f64 {
        self.tool.corner_mm
    }

    /// Margin about what does not cut, mm.
    #[getter]
    fn clearance_mm(&self) -> f64 {
        self.tool.clearance_mm
    }

    /// Height of the holder's nose above the tip, mm.
    #[getter]
    fn stick_out_mm(&self) -> f64 {
        self.tool.assembly.stick_out_mm()
    }

    /// The tool in words, without its name.
    #[getter]
    fn words(&self) -> String {
        self.tool.words()
    }

    fn __repr__(&self) -> String {
        format!("<deepmill.Tool {:?}: {}>", self.tool.name, self.tool.words())
    }
}

const HOLDER: &str = "give length, lower radius and upper radius of each segment in a row, mm";

/// A profile of text, or of points with the options `arcs`, `cuts` and `drill`.
fn profile_of(value: &Bound<'_, PyAny>, options: &mut Options<'_>) -> PyResult<Profile> {
    let py = value.py();
    let (arcs, cuts) = (options.take("arcs")?, options.take("cuts")?);
    let is_drill = options.flag("drill")?;
    if value.is_instance_of::<PyString>() {
        for (name, is_given) in
            [("arcs", arcs.is_some()), ("cuts", cuts.is_some()), ("drill", is_drill.is_some())]
        {
            if is_given {
                let remedy = "write it into the text: docs/tools.md";
                return Err(refused(py, name, "given with text", "none with text", remedy));
            }
        }
        return checked(py, text_of("profile", value)?.parse());
    }
    let remedy = "give radius and height of each point in a row, mm";
    let shape = Rows { shape: "[n, 2]", remedy, may_be_nan: false };
    let points: Vec<[f64; 2]> = input::rows("profile", value, shape)?;
    let [[start_mm, first], ends @ ..] = &points[..] else { unreachable!("rows has at least one") };
    if *first != 0.0 {
        let remedy = "begin with the lower end: its radius, 0 for a point, and height 0";
        return Err(refused(py, "profile", format!("height {first} first"), "height 0", remedy));
    }
    let n = ends.len();
    let shape = Rows { shape: "[n - 1, 2]", remedy: CENTERS, may_be_nan: true };
    let arcs = arcs.map(|arcs| input::rows::<2>("arcs", &arcs, shape)).transpose()?;
    if let Some(rows) = arcs.as_ref().filter(|rows| rows.len() != n) {
        let (found, expected) = (format!("of {} rows", rows.len()), format!("{n}"));
        return Err(refused(
            py,
            "arcs",
            found,
            format!("{expected}, one less than points"),
            CENTERS,
        ));
    }
    let cuts = cuts.map(|cuts| input::flags("cuts", &cuts, (n, "section"))).transpose()?;
    let section = |(k, [radius_mm, height_mm]): (usize, &[f64; 2])| ProfileSection {
        radius_mm: *radius_mm,
        height_mm: *height_mm,
        center_mm: arcs.as_ref().map(|arcs| arcs[k]).filter(|[c, _]| c.is_finite()),
        cuts: cuts.as_ref().is_none_or(|cuts| cuts[k]),
    };
    let sections = ends.iter().enumerate().map(section).collect();
    let profile = checked(py, Profile::new(*start_mm, sections))?;
    Ok(if is_drill.unwrap_or(false) { profile.drilling() } else { profile })
}

const CENTERS: &str =
    "give the center of each arc in a row, radius and height; NaN, NaN for a line";

/// Four lengths of text, numbers or an array.
fn params_of(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<CutterParams> {
    if value.is_instance_of::<PyString>() {
        let params: Result<CutterParams> = text_of(name, value)?.parse();
        return checked(value.py(), params.map_err(|error| called(name, error)));
    }
    if value.is_instance_of::<PyDict>() {
        return Err(wrong_type(name, value, "\"CR,CH,FR,FH\" or four numbers"));
    }
    input::numbers(name, value, "four lengths CR, CH, FR, FH, mm").map(CutterParams::from_array)
}

/// The error, of an argument by its name here.
fn called(name: &'static str, error: Error) -> Error {
    match error {
        Error::Argument { found, expected, remedy, .. } => {
            Error::Argument { name, found, expected, remedy }
        }
        other => other,
    }
}

/// A cutter of a tool, text, or four numbers.
pub fn cutter_of(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<Cutter> {
    match value.cast::<Tool>() {
        Ok(tool) => Ok(tool.get().tool.cutter.clone()),
        Err(_) => checked(value.py(), Cutter::ball_end(params_of(name, value)?)),
    }
}

/// The four lengths of a ball end.
pub fn ball_end_of(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<CutterParams> {
    let cutter = cutter_of(name, value)?;
    cutter.as_ball_end().ok_or_else(|| {
        let expected = "a ball end with one holder below the spindle";
        refused(value.py(), name, cutter.to_string(), expected, "networks know no other")
    })
}

/// Tools of an argument: one, or a sequence of tools and texts; no two have the same name.
pub struct Tools {
    pub list: Vec<tools::Tool>,
    /// Whether files name all of them.
    pub are_of_files: bool,
    /// Whether results go to a folder for each.
    pub are_several: bool,
}

impl Tools {
    /// Of an argument.
    pub fn of(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = value.py();
        let expected = "a deepmill.Tool, lengths as text, or a sequence of these";
        let one = |item: &Bound<'_, PyAny>| -> PyResult<(tools::Tool, bool)> {
            if let Ok(tool) = item.cast::<Tool>() {
                let tool = tool.get();
                return Ok((tool.tool.clone(), tool.of_file));
            }
            if !item.is_instance_of::<PyString>() {
                return Err(wrong_type("tools", item, expected));
            }
            let params = params_of("tools", item)?;
            Ok((checked(py, tools::Tool::new(params, None, 0.0))?, false))
        };
        let is_one = value.is_instance_of::<PyString>() || value.is_instance_of::<Tool>();
        let all = match is_one {
            true => vec![one(value)?],
            false => {
                let items = value.try_iter().map_err(|_| wrong_type("tools", value, expected))?;
                items.map(|item| one(&item?)).collect::<PyResult<Vec<_>>>()?
            }
        };
        let of_files = all.iter().filter(|(_, of_file)| *of_file).count();
        let (n, are_of_files) = (all.len(), of_files == all.len() && !all.is_empty());
        let list = checked(py, named_apart(all.into_iter().map(|(tool, _)| tool).collect()))?;
        Ok(Tools { list, are_of_files, are_several: n > 1 || of_files > 0 })
    }
}

/// Reads tools of a file or folder: a Fusion 360 library, FreeCAD, CAMotics, LinuxCNC, HSMWorks, or a CSV table.
///
/// What the file does not state comes from the options: stick_out, shank, flutes: mm; holder: path of a file of one;
/// unit: "mm", "cm", "m" or "in", of the file's numbers. strict: refuse a file of which a tool would be left out.
/// Returns the tools, and what was left out or changed, a sentence each.
#[pyfunction]
#[pyo3(signature = (path, **options))]
#[pyo3(
    text_signature = "(path, *, stick_out=None, holder=None, shank=None, flutes=None, unit=None, strict=False)"
)]
pub fn read_tools<'py>(
    path: &Bound<'py, PyAny>,
    options: Option<Bound<'py, PyDict>>,
) -> PyResult<(Bound<'py, PyList>, Vec<String>)> {
    let py = path.py();
    let path = path_of("path", path)?;
    let mut options = Options::new(py, options)?;
    let length = |name: &'static str, options: &mut Options<'_>| -> PyResult<Option<f64>> {
        let Some(value) = options.take(name)? else { return Ok(None) };
        let mm = number(name, &value)?;
        match (1e-4..=1e4).contains(&mm) {
            true => Ok(Some(mm)),
            false => Err(refused(py, name, mm, "0.0001 mm to 10 m", "give it in mm")),
        }
    };
    let [stick_out_mm, shank_mm, flutes_mm] =
        ["stick_out", "shank", "flutes"].map(|name| length(name, &mut options));
    let holder = options.take("holder")?.map(|holder| path_of("holder", &holder)).transpose()?;
    let unit = options.take("unit")?;
    let unit_mm = match unit {
        None => None,
        Some(unit) => {
            let text = text_of("unit", &unit)?;
            Some(checked(py, text.parse::<crate::geom::units::Unit>())?.millimeters())
        }
    };
    let strict = options.flag("strict")?.unwrap_or(false);
    options.finish()?;
    let defaults = MissingParameters {
        stick_out_mm: stick_out_mm?,
        shank_mm: shank_mm?,
        flutes_mm: flutes_mm?,
        unit_mm,
        holder: None,
    };
    let table = detached(py, || {
        let holder = holder.map(|path| tools::read_holder(&path, &defaults)).transpose()?;
        let table = tools::read(&path, &MissingParameters { holder, ..defaults })?;
        match table.refused.first().filter(|_| strict) {
            None => Ok(table),
            Some(first) => {
                let found =
                    format!("{} of its tools would be left out: {first}", table.refused.len());
                Err(Error::file(&path, "tools", found, "correct them, or leave out strict"))
            }
        }
    })?;
    let unused = table.unused.iter().map(|column| format!("column not used: {column}"));
    let notices = unused.chain(table.refused.clone()).chain(table.notices.clone()).collect();
    let list = PyList::empty(py);
    for tool in table.tools {
        list.append(Bound::new(py, Tool { tool, of_file: true })?)?;
    }
    Ok((list, notices))
}
