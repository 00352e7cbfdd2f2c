//! Tables of numbers, printed as text or written as JSON and CSV from the same cells.

mod unit;

use crate::geom::units::Unit;
use comfy_table::{Cell as TextCell, CellAlignment, LineStyle, TableStyle};
use serde_json::{Map, Value, json};
use unit::Quantity;

/// One number or word.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Cell {
    /// A word.
    Text(String),
    /// A count.
    Count(u64),
    /// A share from 0 to 1; text shows percent.
    Share(f64),
    /// Seconds.
    Seconds(f64),
    /// A length, mm.
    Millimeters(f64),
    /// A length in another unit than mm, and how it is shown.
    Measure(f64, String),
    /// Any other number, shown with four digits.
    Number(f64),
    /// A number that someone chose, shown with the digits it has.
    Given(f64),
    /// Not known or not defined.
    Missing,
}

impl Cell {
    /// A word.
    pub fn text(word: impl Into<String>) -> Self {
        Cell::Text(word.into())
    }

    /// A count.
    pub fn count(n: usize) -> Self {
        Cell::Count(n as u64)
    }

    /// For people.
    pub fn show(&self) -> String {
        match self {
            Cell::Text(word) => word.clone(),
            Cell::Count(n) => n.to_string(),
            Cell::Share(x) if x.is_finite() => format!("{:.1} %", 100.0 * x),
            Cell::Seconds(x) if x.is_finite() => seconds(*x),
            Cell::Millimeters(x) if x.is_finite() => format!("{} mm", significant(*x)),
            Cell::Measure(_, shown) => shown.clone(),
            Cell::Number(x) if x.is_finite() => significant(*x),
            Cell::Given(x) if x.is_finite() => x.to_string(),
            _ => "-".into(),
        }
    }

    /// For programs; numbers that are not finite become `null`.
    #[doc(hidden)] // a type of `serde_json`
    pub fn json(&self) -> Value {
        match self {
            Cell::Text(word) => json!(word),
            Cell::Count(n) => json!(n),
            Cell::Share(x)
            | Cell::Seconds(x)
            | Cell::Millimeters(x)
            | Cell::Measure(x, _)
            | Cell::Number(x)
            | Cell::Given(x) => json!(x),
            Cell::Missing => Value::Null,
        }
    }

    pub(super) fn is_number(&self) -> bool {
        !matches!(self, Cell::Text(_))
    }
}

/// A time with about three digits.
fn seconds(x: f64) -> String {
    match x {
        _ if x < 1.0 => format!("{:.3} s", x),
        _ if x < 100.0 => format!("{:.2} s", x),
        _ => format!("{:.0} s", x),
    }
}

/// A number with four significant digits, without a power of ten where it can be read without.
fn significant(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if !(1e-4..1e7).contains(&a) => format!("{x:.3e}"),
        a if a >= 1000.0 => format!("{x:.0}"),
        a if a >= 100.0 => format!("{x:.1}"),
        a if a >= 10.0 => format!("{x:.2}"),
        a if a >= 1.0 => format!("{x:.3}"),
        _ => format!("{x:.4}"),
    }
}

/// Rows of cells under named columns.
///
/// ```
/// use deepmill::tables::{Cell, Table};
///
/// let mut table = Table::new(&[("tool", "tool"), ("reach", "reaches"), ("n_sites", "")]);
/// table.row([Cell::text("T1"), Cell::Share(0.625), Cell::count(500)]);
/// table.row([Cell::text("T2"), Cell::Missing, Cell::count(500)]);
/// // People see no column without a heading; programs see every one, under its key, with all digits.
/// assert_eq!(table.markdown(), "| tool | reaches |\n| --- | ---: |\n| T1 | 62.5 % |\n| T2 | - |\n");
/// assert_eq!(table.csv(), b"tool,reach,n_sites\nT1,0.625,500\nT2,,500\n");
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    columns: Vec<(&'static str, &'static str)>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows; each column has a key for programs and a heading for people, who do not
    /// see columns of which the heading is empty.
    pub fn new(columns: &[(&'static str, &'static str)]) -> Self {
        Table { columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it has not one cell per column.
    pub fn row(&mut self, cells: impl Into<Vec<Cell>>) -> &mut Self {
        let cells = cells.into();
        assert_eq!(cells.len(), self.columns.len(), "one cell per column");
        self.rows.push(cells);
        self
    }

    /// What the numbers of a column are.
    fn quantity(&self, column: usize) -> Option<Quantity> {
        let of_tools = self.columns.iter().any(|(key, _)| *key == "CR");
        Quantity::of(self.columns[column].0, of_tools)
    }

    /// For people: columns of equal width, numbers to the right; lengths and areas in mm.
    pub fn text(&self) -> String {
        self.text_in(Unit::Millimeter)
    }

    /// [`Table::text`] with lengths and areas in a unit.
    pub fn text_in(&self, unit: Unit) -> String {
        let mut table = plain();
        let (headings, rows) = self.shown_in(unit);
        table.set_header(headings);
        for row in &rows {
            table.add_row(row.iter().map(text_cell));
        }
        table.trim_fmt()
    }

    /// For people, elsewhere: the headings that are not empty, and the cells under them, with lengths and areas in a
    /// unit.
    pub fn shown_in(&self, unit: Unit) -> (Vec<String>, Vec<Vec<Cell>>) {
        let is_shown = |k: &usize| !self.columns[*k].1.is_empty();
        let shown: Vec<usize> = (0..self.columns.len()).filter(is_shown).collect();
        // Cells that show their unit need none in the heading.
        let names_unit = |k: usize| self.rows.iter().any(|r| matches!(r[k], Cell::Millimeters(_)));
        let heading = |&k: &usize| match names_unit(k) {
            true => self.columns[k].1.to_string(),
            false => unit::heading(self.columns[k].1, self.quantity(k), unit),
        };
        let cells = |row: &Vec<Cell>| {
            shown.iter().map(|&k| unit::cell_shown(&row[k], self.quantity(k), unit)).collect()
        };
        (shown.iter().map(heading).collect(), self.rows.iter().map(cells).collect())
    }

    /// For people: a Markdown table, numbers to the right, of what [`Table::shown_in`] gives in mm.
    pub fn markdown(&self) -> String {
        let (headings, rows) = self.shown_in(Unit::Millimeter);
        let line = |cells: Vec<String>| {
            let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let is_number = |k: usize| rows.iter().all(|row| row[k].is_number());
        let rule = |k| if is_number(k) { "---:" } else { "---" }.to_string();
        let mut text = line(headings.clone());
        text += &line((0..headings.len()).map(rule).collect());
        rows.iter().for_each(|row| text += &line(row.iter().map(|cell| cell.show()).collect()));
        text
    }

    /// For programs: an array with one object per row.
    #[doc(hidden)] // a type of `serde_json`
    pub fn json(&self) -> Value {
        let object = |row: &Vec<Cell>| {
            let cells =
                self.columns.iter().zip(row).map(|((key, _), c)| (key.to_string(), c.json()));
            Value::Object(cells.collect())
        };
        Value::Array(self.rows.iter().map(object).collect())
    }

    /// For programs: CSV with a header row of the keys; what is missing is empty. Lengths and areas are in mm.
    pub fn csv(&self) -> Vec<u8> {
        self.csv_in(Unit::Millimeter)
    }

    /// [`Table::csv`] in a unit: in another than mm the keys of lengths and areas name it (`_in`, `_in2`); the lengths
    /// of a tool table have it with the number, as such tables are read.
    pub fn csv_in(&self, unit: Unit) -> Vec<u8> {
        let field = |cell: &Cell| match cell.json() {
            Value::String(word) => word,
            Value::Null => String::new(),
            number => number.to_string(),
        };
        let mut writer = csv::Writer::from_writer(Vec::new());
        let quantities: Vec<_> = (0..self.columns.len()).map(|k| self.quantity(k)).collect();
        let keys = self.columns.iter().zip(&quantities);
        let header = keys.map(|((key, _), quantity)| unit::key(key, *quantity, unit)).collect();
        let fields = |row: &Vec<Cell>| {
            let cells = row.iter().zip(&quantities);
            let one = |(cell, quantity): (&Cell, &Option<Quantity>)| {
                unit::field(field(&unit::cell(cell, *quantity, unit)), *quantity, unit)
            };
            cells.map(one).collect::<Vec<_>>()
        };
        for row in [header].into_iter().chain(self.rows.iter().map(fields)) {
            writer.write_record(row).expect("rows of equal length, into memory");
        }
        writer.into_inner().expect("memory takes all")
    }
}

/// Named values, one per line.
#[derive(Debug, Clone, Default, PartialEq)]
#[doc(hidden)] // of the program
pub struct Facts(Vec<(&'static str, String, Cell)>);

impl Facts {
    /// No facts.
    pub fn new() -> Self {
        Facts::default()
    }

    /// Adds a value with its key for JSON and its name for people.
    pub fn add(&mut self, key: &'static str, name: impl Into<String>, value: Cell) -> &mut Self {
        self.0.push((key, name.into(), value));
        self
    }

    /// For people: two columns, both to the left; lengths and areas in mm.
    pub fn text(&self) -> String {
        self.text_in(Unit::Millimeter)
    }

    /// [`Facts::text`] with lengths and areas in a unit.
    pub fn text_in(&self, unit: Unit) -> String {
        let mut table = plain();
        for (key, name, value) in &self.0 {
            let quantity = Quantity::of(key, false);
            let name = match value {
                Cell::Millimeters(_) => name.clone(),
                _ => unit::heading(name, quantity, unit),
            };
            let value = unit::cell_shown(value, quantity, unit).show();
            table.add_row([TextCell::new(name), TextCell::new(value)]);
        }
        table.trim_fmt()
    }

    /// For programs: one object.
    #[doc(hidden)] // a type of `serde_json`
    pub fn json(&self) -> Value {
        let pairs = self.0.iter().map(|(key, _, value)| (key.to_string(), value.json()));
        Value::Object(pairs.collect::<Map<String, Value>>())
    }
}

/// No lines but one below the headings.
const STYLE: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('-').junction('-'));

fn plain() -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table.load_style(STYLE);
    table
}

fn text_cell(cell: &Cell) -> TextCell {
    let alignment = if cell.is_number() { CellAlignment::Right } else { CellAlignment::Left };
    TextCell::new(cell.show()).set_alignment(alignment)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_json_come_from_the_same_cells() {
        let mut table = Table::new(&[("head", "head"), ("f1", "F1"), ("time_s", "time")]);
        table.row([Cell::text("inaccessible"), Cell::Share(0.98765), Cell::Seconds(0.0254)]);
        table.row([Cell::text("occlusion"), Cell::Missing, Cell::Seconds(f64::NAN)]);
        let text = table.text();
        assert!(text.contains("98.8 %") && text.contains("0.025 s"), "{text}");
        assert_eq!(
            table.json()[0],
            json!({"head": "inaccessible", "f1": 0.98765, "time_s": 0.0254})
        );
        assert_eq!(table.json()[1], json!({"head": "occlusion", "f1": null, "time_s": null}));
        assert_eq!(serde_json::from_str::<Value>(&table.json().to_string()).unwrap(), table.json());
    }

    #[test]
    fn csv_has_all_columns_and_people_see_those_with_a_heading() {
        let mut table = Table::new(&[("name", "name"), ("CR", "CR"), ("both", "")]);
        table.row([Cell::text("6, \"long\""), Cell::Given(1.5), Cell::Share(0.25)]);
        table.row([Cell::text("Ø6"), Cell::Given(40.0), Cell::Missing]);
        let csv = String::from_utf8(table.csv()).unwrap();
        assert_eq!(csv, "name,CR,both\n\"6, \"\"long\"\"\",1.5,0.25\nØ6,40.0,\n");
        let text = table.text();
        assert!(text.contains(" 1.5") && text.contains(" 40"), "{text}");
        assert!(!text.contains("both") && !text.contains("25"), "{text}");
    }

    #[test]
    fn markdown_has_the_columns_that_people_see() {
        let mut table = Table::new(&[("name", "name"), ("both", ""), ("f1", "F1")]);
        table.row([Cell::text("a|b"), Cell::Share(0.5), Cell::Share(0.25)]);
        table.row([Cell::text("c"), Cell::Missing, Cell::Missing]);
        let expected = "| name | F1 |\n| --- | ---: |\n| a\\|b | 25.0 % |\n| c | - |\n";
        assert_eq!(table.markdown(), expected);
    }

    #[test]
    fn lengths_and_areas_are_in_the_unit_that_is_asked_for_and_json_stays_in_mm() {
        let columns = [
            ("name", "tool"),
            ("CR", "CR"),
            ("held_at", "stick-out"),
            ("adds_mm2", "mm²"),
            ("x_mm", "x, mm"),
            ("adds", "adds"),
        ];
        let mut table = Table::new(&columns);
        let lengths = [Cell::Given(3.175), Cell::Millimeters(50.8), Cell::Number(64.516)];
        let mut row = vec![Cell::text("1/4")];
        row.extend(lengths);
        row.extend([Cell::Number(-12.7), Cell::Share(0.5)]);
        table.row(row);
        let csv = String::from_utf8(table.csv_in(Unit::Inch)).unwrap();
        assert_eq!(csv, "name,CR,held_at_in,adds_in2,x_in,adds\n1/4,0.125in,2.0,0.1,-0.5,0.5\n");
        let text = table.text_in(Unit::Inch);
        for part in ["CR, in", "in²", "x, in", "0.125", "2.000 in", "0.1000", "-0.5000", "50.0 %"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains("mm"), "{text}");
        assert_eq!(table.csv_in(Unit::Millimeter), table.csv());
        assert_eq!(table.json()[0]["x_mm"], -12.7);
        let mut facts = Facts::new();
        facts.add("area_mm2", "surface, mm²", Cell::Number(645.16));
        facts.add("spacing_mm", "spacing", Cell::Millimeters(25.4));
        facts.add("rests", "above 0.05 mm alone", Cell::count(3));
        facts.add("finish_mm", "finish, mm", Cell::Given(0.01));
        let text = facts.text_in(Unit::Inch);
        for part in ["surface, in²", "1.000", "1.000 in", "above 0.05 mm alone", "0.0003937"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains("0.00039370"), "digits that no one reads: {text}");
        assert_eq!(facts.json()["area_mm2"], 645.16);
    }

    #[test]
    fn facts_keep_their_order() {
        let mut facts = Facts::new();
        facts.add("sites", "sites", Cell::count(7000));
        facts.add("spacing_mm", "spacing", Cell::Millimeters(1.23456));
        assert_eq!(facts.json().to_string(), r#"{"sites":7000,"spacing_mm":1.23456}"#);
        assert!(facts.text().contains("1.235 mm"), "{}", facts.text());
    }

    #[test]
    fn numbers_keep_four_digits() {
        let shown = [0.0, 0.123456, 12.3456, 123456.7, 1.5e9, 2e-7].map(significant);
        assert_eq!(shown, ["0", "0.1235", "12.35", "123457", "1.500e9", "2.000e-7"]);
    }
}
