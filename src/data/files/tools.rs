//! Tool tables: CSV files with one tool per row. `docs/cli.md` shows one.

use super::ball_end_words;
use crate::cutter::{Cutter, CutterParams};
use crate::{Error, Result};
use csv::{Position, ReaderBuilder, StringRecord, Trim};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::Path;

/// A checked cutter and the numbers it was ordered with.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// Name, fit for a folder.
    pub name: String,
    /// CR, CH, FR, FH.
    pub params: CutterParams,
    /// Radius of the tip's corner, mm: 0 for a flat end, CR for a ball end.
    pub corner_mm: f64,
    /// Safety margin all around, mm.
    pub clearance_mm: f64,
    /// The cutter, margin included.
    pub cutter: Cutter,
}

impl Tool {
    /// A tool named after its lengths; without a corner it is a ball end.
    ///
    /// # Errors
    /// As [`Cutter::bull_nose`]; or if the clearance leaves nothing of the cutter, or is 2·CR or more:
    /// a margin that thick lies on every site that the cutter touches.
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
        Ok(Tool { name, params, corner_mm, clearance_mm, cutter })
    }

    /// The same tool by another name.
    ///
    /// # Errors
    /// If some system would not let a folder have the name, or it is that of a file beside the folders.
    pub fn named(self, name: &str) -> Result<Self> {
        let refuse = |remedy: &str| {
            Err(Error::argument("name", shown(name), "a name that a folder can have", remedy))
        };
        let forbidden = |c: char| c.is_control() || r#"/\:*?"<>|"#.contains(c);
        if name.contains(forbidden) {
            return refuse(r#"leave out / \ : * ? " < > | and control characters"#);
        }
        if name.is_empty() || name.starts_with(['.', '-', ' ']) || name.ends_with(['.', ' ']) {
            return refuse("begin it with a letter or a digit, end it without a dot");
        }
        if name.len() > 100 {
            return refuse("use at most 100 bytes");
        }
        let taken = ["part.stl", "report.html"].iter().any(|file| name.eq_ignore_ascii_case(file));
        if taken || ["tools.", "findings."].iter().any(|s| starts_with_ignoring_case(name, s)) {
            return refuse("part.stl, tools.… and others are files of the results: choose another");
        }
        Ok(Tool { name: name.into(), ..self })
    }

    /// The same for two tools that would have the same folder, on systems too that ignore case.
    pub fn folder_key(&self) -> String {
        self.name.to_lowercase()
    }

    /// The tool in words, without its name.
    pub fn words(&self) -> String {
        let mut words = ball_end_words(self.params);
        if self.corner_mm == 0.0 {
            words = words.replacen("ball-end", "flat-end", 1);
        } else if self.corner_mm != self.params.cr_mm {
            words = words.replacen("ball-end", &format!("bull-nose {} mm,", self.corner_mm), 1);
        }
        if self.clearance_mm != 0.0 {
            words += &format!(", clearance {} mm", self.clearance_mm);
        }
        words
    }

    /// What the four lengths do not say, for [`Provenance::settings`](super::Provenance::settings).
    pub fn settings(&self) -> Value {
        json!({ "corner_mm": self.corner_mm, "clearance_mm": self.clearance_mm })
    }
}

fn check_clearance(clearance_mm: f64, cr_mm: f64) -> Result<()> {
    if clearance_mm > -cr_mm && clearance_mm < 2.0 * cr_mm {
        return Ok(());
    }
    let expected = format!("between -CR = {} and 2 CR = {} mm", -cr_mm, 2.0 * cr_mm);
    let remedy = match clearance_mm < 0.0 {
        true => "nothing would be left of the cutter: take a thinner margin",
        false => "the margin would reach below the tip: widen the holder instead",
    };
    Err(Error::argument("clearance", clearance_mm, expected, remedy))
}

fn starts_with_ignoring_case(text: &str, start: &str) -> bool {
    text.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start))
}

/// What a tool table holds.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolTable {
    /// The tools in the order of the rows; no two have the same name.
    pub tools: Vec<Tool>,
    /// Headings of columns that mean nothing here.
    pub unused: Vec<String>,
}

/// Columns of a tool table; lengths in mm.
const COLUMNS: [&str; 7] = ["name", "CR", "CH", "FR", "FH", "corner", "clearance"];
/// Those of [`COLUMNS`] that must be there.
const REQUIRED: std::ops::Range<usize> = 1..5;

/// Reads a tool table: a header row that names the columns, in any order and case, then a row per tool.
///
/// Columns are separated by commas, semicolons or tabs, whichever the header row has most of; where it
/// is not commas, numbers may have a decimal comma. Empty rows and lines that begin with `#` are
/// passed over.
///
/// # Errors
/// If the file is not such a table, a length is not a number or makes no cutter, or two tools have
/// the same name.
pub fn read(path: &Path) -> Result<ToolTable> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let line = line_at(&e.as_bytes()[..e.utf8_error().valid_up_to()]);
        let remedy = "save the table as CSV in UTF-8";
        Error::file(path, format!("line {line}"), "the text is not UTF-8", remedy)
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    TableText { path, text, separator: separator(text) }.table()
}

/// Number of the line that follows `before`, from 1.
fn line_at(before: &[u8]) -> usize {
    1 + before.iter().filter(|b| **b == b'\n').count()
}

fn is_passed_over(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#')
}

fn separator(text: &str) -> char {
    let header = text.lines().find(|line| !is_passed_over(line)).unwrap_or("");
    let candidates = ['\t', ';', ','];
    candidates.into_iter().max_by_key(|c| header.matches(*c).count()).unwrap_or(',')
}

/// A field in a message: in one line, not too long.
fn shown(field: &str) -> String {
    let short: String = field.chars().take(40).collect();
    let more = if short.len() < field.len() { "…" } else { "" };
    format!("{:?}", short + more)
}

/// Where known columns are.
struct Columns {
    place: [Option<usize>; COLUMNS.len()],
    n: usize,
}

struct TableText<'a> {
    path: &'a Path,
    text: &'a str,
    separator: char,
}

impl TableText<'_> {
    fn table(&self) -> Result<ToolTable> {
        let mut rows = self.rows()?.into_iter();
        let Some((header_line, header)) = rows.next() else {
            let remedy = "begin with a header row such as name,CR,CH,FR,FH";
            return Err(self.at(1, "the table is empty", remedy));
        };
        let (columns, unused) = self.columns(header_line, &header)?;
        let (mut tools, mut line_of) = (Vec::new(), HashMap::new());
        for (line, row) in rows {
            let tool = self.tool(line, &row, &columns)?;
            if let Some(first) = line_of.insert(tool.folder_key(), line) {
                let found = format!("{} is also the tool of line {first}", shown(&tool.name));
                return Err(self.at(line, found, "give each tool a name of its own, once"));
            }
            tools.push(tool);
        }
        if tools.is_empty() {
            let remedy = "add a row for each tool";
            return Err(self.at(header_line, "no tool follows the header row", remedy));
        }
        Ok(ToolTable { tools, unused })
    }

    /// The rows that are not empty, with their lines.
    fn rows(&self) -> Result<Vec<(usize, StringRecord)>> {
        let mut reader = ReaderBuilder::new()
            .delimiter(self.separator as u8)
            .comment(Some(b'#'))
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .from_reader(self.text.as_bytes());
        let mut rows = Vec::new();
        for row in reader.records() {
            let row = row.map_err(|e| self.at(1, e.to_string(), "save the table as CSV"))?;
            if row.iter().any(|field| !field.is_empty()) {
                let line = row.position().map_or(1, |start| self.line_of_row(start));
                rows.push((line, row));
            }
        }
        Ok(rows)
    }

    /// Line of the row that the reader found from `start` on, comments and empty lines before it.
    fn line_of_row(&self, start: &Position) -> usize {
        let rest = self.text.get(start.byte() as usize..).unwrap_or("");
        start.line() as usize + rest.lines().take_while(|l| is_passed_over(l)).count()
    }

    fn columns(&self, line: usize, header: &StringRecord) -> Result<(Columns, Vec<String>)> {
        let mut columns = Columns { place: [None; COLUMNS.len()], n: header.len() };
        let mut unused = Vec::new();
        for (i, heading) in header.iter().enumerate() {
            match COLUMNS.iter().position(|name| name.eq_ignore_ascii_case(heading)) {
                Some(k) if columns.place[k].is_some() => {
                    let found = format!("there are two columns {}", COLUMNS[k]);
                    return Err(self.at(line, found, "delete or rename one"));
                }
                Some(k) => columns.place[k] = Some(i),
                None if heading.is_empty() => {}
                None => unused.push(shown(heading)),
            }
        }
        if let Some(k) = REQUIRED.into_iter().find(|k| columns.place[*k].is_none()) {
            let found = format!("there is no column {}", COLUMNS[k]);
            let remedy = "the header row must name CR, CH, FR and FH, such as name,CR,CH,FR,FH";
            return Err(self.at(line, found, remedy));
        }
        Ok((columns, unused))
    }

    fn tool(&self, line: usize, row: &StringRecord, columns: &Columns) -> Result<Tool> {
        if row.iter().skip(columns.n).any(|field| !field.is_empty()) {
            let found = format!("{} fields under {} headings", row.len(), columns.n);
            let remedy = "write decimals with a point, or separate columns by semicolons";
            return Err(self.at(line, found, remedy));
        }
        let field = |k: usize| columns.place[k].and_then(|i| row.get(i)).unwrap_or("");
        let length = |k| self.length(line, k, field(k));
        let mut lengths = [0.0; 4];
        for (value, k) in lengths.iter_mut().zip(REQUIRED) {
            let missing = || self.at(line, format!("{} is empty", COLUMNS[k]), "give it in mm");
            *value = length(k)?.ok_or_else(missing)?;
        }
        let params = CutterParams::from_array(lengths);
        let tool = Tool::new(params, length(5)?, length(6)?.unwrap_or(0.0));
        let tool = match field(0) {
            "" => tool,
            name => tool.and_then(|tool| tool.named(name)),
        };
        tool.map_err(|error| self.in_line(line, error))
    }

    fn length(&self, line: usize, column: usize, field: &str) -> Result<Option<f64>> {
        if field.is_empty() {
            return Ok(None);
        }
        let decimal = match self.separator {
            ',' => field.into(),
            _ => field.replace(',', "."),
        };
        decimal.parse().map(Some).map_err(|_| {
            let found = format!("{} is {}, not a number", COLUMNS[column], shown(field));
            self.at(line, found, "write it in mm with a decimal point, without a unit")
        })
    }

    fn at(&self, line: usize, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::file(self.path, format!("line {line}"), found, remedy)
    }

    fn in_line(&self, line: usize, error: Error) -> Error {
        match error {
            Error::Argument { name, found, expected, remedy } => {
                self.at(line, format!("{name} is {found}, expected {expected}"), remedy)
            }
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<ToolTable> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tools.csv");
        std::fs::write(&path, text).unwrap();
        read(&path)
    }

    #[test]
    fn columns_have_any_order_and_case_and_may_be_left_out() {
        let text = "\u{feff}# shop 3\r\n\r\nfh,FR, Name ,CR,ch,Clearance,CORNER,T\r\n\
            5,40,\"ball, long\",1.5,6,,,1\r\n# worn\r\n,,,,,,,\r\n20,5,,1,2e1,0.5,0\r\n";
        let ToolTable { tools, unused } = table(text).unwrap();
        assert_eq!(tools[0].name, "ball, long");
        assert_eq!(tools[0].words(), "ball-end CR 1.5, CH 6, FR 40, FH 5 mm");
        assert_eq!(tools[1].name, "1-20-5-20-corner0-clearance0.5");
        assert_eq!(tools[1].words(), "flat-end CR 1, CH 20, FR 5, FH 20 mm, clearance 0.5 mm");
        assert_eq!((tools.len(), unused), (2, vec!["\"T\"".to_string()]));
    }

    #[test]
    fn semicolons_and_tabs_come_with_decimal_commas() {
        let comma = table("name,CR,CH,FR,FH\na,1.5,6,40,5").unwrap();
        assert_eq!(table("name;CR;CH;FR;FH\na;1,5;6;40;5\n").unwrap(), comma);
        assert_eq!(table("name\tCR\tCH\tFR\tFH\na\t1.5\t6\t40\t5\t\t\n").unwrap(), comma);
    }

    #[test]
    fn a_long_table_is_read_in_one_pass() {
        let row = |k: usize| format!("tool {k},1.5,2,50,4\n# worn\n");
        let text: String = (0..200_000).map(row).collect();
        let header = "name,CR,CH,FR,FH\n";
        assert_eq!(table(&format!("{header}{text}")).unwrap().tools.len(), 200_000);
        let twice = format!("{header}{text}TOOL 7,1,2,3,4\n");
        let message = table(&twice).unwrap_err().to_string();
        assert!(message.contains("line 400002") && message.contains("line 16"), "{message}");
    }

    #[test]
    fn every_name_is_a_folder_on_every_system() {
        let tool = |name: &str| {
            Tool::new(CutterParams::from_array([1.0, 2.0, 3.0, 4.0]), None, 0.0)?.named(name)
        };
        for name in ["D6", "Kugel Ø6", "6.5 long", "tool", "T-1_(new)"] {
            assert_eq!(tool(name).unwrap().name, name);
        }
        let long = "x".repeat(101);
        let bad = ["", ".", "..", ".x", "-x", "x.", "a/b", "a\\b", "1/4\"", "a:b", "a\nb", "a\0"];
        for name in bad.into_iter().chain(["part.stl", "Tools.csv", "tools.ply", &long]) {
            let message = tool(name).unwrap_err().to_string();
            assert!(message.starts_with("name is ") && !message.contains('\n'), "{message}");
        }
    }
}
