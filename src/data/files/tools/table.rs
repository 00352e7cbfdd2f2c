//! Tables of lengths: CSV files with one tool per row. `docs/cli.md` shows one.

use super::place::shown;
use super::reading::Reading;
use super::table_text::TableText;
use super::{MissingParameters, Tool, shop};
use crate::Result;
use crate::geom::units::{Length, Unit};
use crate::tool::cutter::{Assembly, CutterParams, Step};
use csv::StringRecord;
use std::collections::HashMap;
use std::path::Path;

/// Columns of a tool table; lengths in mm.
const COLUMNS: [&str; 17] = [
    "name",
    "CR",
    "CH",
    "FR",
    "FH",
    "corner",
    "clearance",
    "body",
    "holder",
    "stick_out",
    "T",
    "folder",
    "overall",
    "neck_and_shank",
    "profile",
    "description",
    "drawn_in",
];
/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-6;
/// Those of [`COLUMNS`] that must be there.
const REQUIRED: std::ops::Range<usize> = 1..5;

/// Reads a tool table: a header row that names the columns, in any order and case, then a row per tool.
///
/// Columns are separated by commas, semicolons or tabs, whichever the header row has most of; numbers may have a
/// decimal comma where it is not commas. Empty rows and lines that begin with `#` are passed over. A table without the
/// column CR may have a diameter: [`shop`].
///
/// # Errors
/// If the file is not such a table.
pub(super) fn read(text: &str, path: &Path, defaults: &MissingParameters) -> Result<Reading> {
    TableText::new(path, text).table(defaults)
}

/// `height:radius` of every step, with blanks between: what the columns `body` and `holder` hold.
pub fn steps_words(steps: &[Step]) -> String {
    let words = steps.iter().map(|step| format!("{}:{}", step.height_mm, step.radius_mm));
    words.collect::<Vec<_>>().join(" ")
}

/// The steps that [`steps_words`] has written; `None` if it has not.
pub fn steps_of_words(words: &str) -> Option<Vec<Step>> {
    let step = |word: &str| {
        let (height, radius) = word.split_once(':')?;
        Some(Step { height_mm: height.parse().ok()?, radius_mm: radius.parse().ok()? })
    };
    let steps: Option<Vec<Step>> = words.split_whitespace().map(step).collect();
    steps.filter(|steps| !steps.is_empty())
}

/// Where known columns are.
struct ColumnPlaces {
    place: [Option<usize>; COLUMNS.len()],
    n: usize,
}

impl TableText<'_> {
    fn table(&self, defaults: &MissingParameters) -> Result<Reading> {
        let mut rows = self.rows()?.into_iter();
        let Some((header_line, header)) = rows.next() else {
            let remedy = "begin with a header row such as name,CR,CH,FR,FH";
            return Err(self.at(1, "the table is empty", remedy));
        };
        let rows: Vec<(usize, StringRecord)> = rows.collect();
        if rows.is_empty() {
            let remedy = "add a row for each tool";
            return Err(self.at(header_line, "no tool follows the header row", remedy));
        }
        let has = |name: &str| header.iter().any(|heading| heading.eq_ignore_ascii_case(name));
        let mut reading = Reading::default();
        if let Some(shop) = shop::Columns::of(&header).filter(|_| !has("CR")) {
            shop.check(self, header_line)?;
            rows.iter().for_each(|(line, row)| shop.add(self, *line, row, defaults, &mut reading));
            reading.unused = shop.unused;
            return Ok(reading);
        }
        let (columns, unused) = self.columns(header_line, &header)?;
        reading.unused = unused;
        let mut line_of = HashMap::new();
        for (line, row) in &rows {
            let tool = self.tool(*line, row, &columns, &mut reading.notices);
            let tool = tool.and_then(|tool| match line_of.get(&tool.name_key()) {
                Some(first) => {
                    let found = format!("{} is also the tool of line {first}", shown(&tool.name));
                    Err(self.at(*line, found, "give each tool a name of its own, once"))
                }
                None => Ok(tool),
            });
            if let Ok(tool) = &tool {
                line_of.insert(tool.name_key(), *line);
            }
            reading.add(tool.map(|tool| (tool, Vec::new())));
        }
        Ok(reading)
    }

    fn columns(&self, line: usize, header: &StringRecord) -> Result<(ColumnPlaces, Vec<String>)> {
        let mut columns = ColumnPlaces { place: [None; COLUMNS.len()], n: header.len() };
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
            let remedy = "the header row must name CR, CH, FR and FH, such as name,CR,CH,FR,FH, or a diameter";
            return Err(self.at(line, found, remedy));
        }
        Ok((columns, unused))
    }

    fn tool(
        &self,
        line: usize,
        row: &StringRecord,
        columns: &ColumnPlaces,
        notices: &mut Vec<String>,
    ) -> Result<Tool> {
        self.check_width(line, row, columns.n)?;
        let field = |k: usize| columns.place[k].and_then(|i| row.get(i)).unwrap_or("");
        let length = |k| self.length(line, k, field(k));
        let mut lengths = [0.0; 4];
        for (value, k) in lengths.iter_mut().zip(REQUIRED) {
            let missing = || self.at(line, format!("{} is empty", COLUMNS[k]), "give it in mm");
            *value = length(k)?.ok_or_else(missing)?;
        }
        let params = CutterParams::from_array(lengths);
        let (corner, clearance) = (length(5)?, length(6)?.unwrap_or(0.0));
        let tool = match field(7) {
            "" => Tool::new(params, corner, clearance),
            body => {
                let stick_out = length(9)?
                    .ok_or_else(|| self.at(line, "stick_out is empty", "give it in mm"))?;
                let (body, holder) = (self.steps(line, 7, body)?, self.steps(line, 8, field(8))?);
                let corner = corner.unwrap_or(params.cr_mm);
                // Of a ball, what the radius is rounded by.
                let side = params.cr_mm - corner;
                let side = if side.abs() < SAME_MM { 0.0 } else { side };
                let assembly = Assembly::from_steps([corner, side], body, holder, stick_out);
                let words = match field(15) {
                    "" => {
                        let diameter = 2.0 * params.cr_mm;
                        format!("tool of {diameter} mm, {stick_out} mm out of its holder")
                    }
                    words => words.to_string(),
                };
                let assembly = match field(13) {
                    "" => assembly,
                    upper => {
                        let upper = self.steps(line, 13, upper)?;
                        assembly.and_then(|assembly| assembly.with_neck_and_shank(upper))
                    }
                };
                let assembly = match field(14) {
                    "" => assembly,
                    words => assembly.and_then(|tool| tool.of_same_lengths(words.parse()?)),
                };
                assembly.and_then(|assembly| {
                    Tool::of_assembly(&words, assembly, clearance, words.clone())
                })
            }
        };
        let tool = match length(12)? {
            None => tool,
            Some(overall) => tool.and_then(|tool| tool.of_overall_length(overall)),
        };
        let tool = tool.map_err(|error| self.in_line(line, error))?;
        let mut tool = match field(0) {
            "" => tool,
            name => tool.named(name),
        };
        tool.number = self.number(line, field(10), notices);
        match field(16).parse() {
            Ok(unit) => Ok(tool.of_unit(unit)),
            Err(_) => Ok(tool),
        }
    }

    /// Steps as [`steps_words`] writes them.
    fn steps(&self, line: usize, column: usize, field: &str) -> Result<Vec<Step>> {
        steps_of_words(field).ok_or_else(|| {
            let found = format!("{} is {}", COLUMNS[column], shown(field));
            self.at(line, found, "write height:radius of every step in mm, with blanks between")
        })
    }

    fn length(&self, line: usize, column: usize, field: &str) -> Result<Option<f64>> {
        if field.is_empty() {
            return Ok(None);
        }
        let decimal = match self.separator {
            ',' => field.into(),
            _ => field.replace(',', "."),
        };
        let read = || Length::read(field).map(|length| length.mm(Unit::Millimeter));
        decimal.parse().ok().or_else(read).map(Some).ok_or_else(|| {
            let found = format!("{} is {}, not a number or length", COLUMNS[column], shown(field));
            self.at(line, found, "write it in mm with a decimal point, or with its unit (1/4 in)")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<ToolTable> {
        super::super::from_bytes(text.as_bytes(), "tools.csv".as_ref(), &Default::default())
    }

    use super::super::ToolTable;

    #[test]
    fn columns_have_any_order_and_case_and_may_be_left_out() {
        let text = "\u{feff}# shop 3\r\n\r\nfh,FR, Name ,CR,ch,Clearance,CORNER,T\r\n\
            5,40,\"ball, long\",1.5,6,,,1\r\n# worn\r\n,,,,,,,\r\n20,5,,1,2e1,0.5,0\r\n";
        let ToolTable { tools, unused, .. } = table(text).unwrap();
        assert_eq!(tools[0].name, "ball, long");
        assert_eq!(tools[0].words(), "ball-end CR 1.5, CH 6, FR 40, FH 5 mm");
        assert_eq!(tools[1].name, "1-20-5-20-corner0-clearance0.5");
        assert_eq!(tools[1].words(), "flat-end CR 1, CH 20, FR 5, FH 20 mm, clearance 0.5 mm");
        assert_eq!((tools.len(), unused), (2, vec![]));
        assert_eq!([tools[0].number, tools[1].number], [Some(1), None]);
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
        let ToolTable { tools, refused, .. } = table(&twice).unwrap();
        assert_eq!((tools.len(), refused.len()), (200_000, 1));
        let message = &refused[0];
        assert!(message.contains("line 400002") && message.contains("line 16"), "{message}");
    }
}
