//! Tables of numbers, printed as text or written as JSON and CSV from the same cells.

use comfy_table::{Cell as TextCell, CellAlignment, LineStyle, TableStyle};
use serde_json::{Map, Value, json};

/// One number or word.
#[derive(Debug, Clone, PartialEq)]
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
            Cell::Number(x) if x.is_finite() => significant(*x),
            Cell::Given(x) if x.is_finite() => x.to_string(),
            _ => "-".into(),
        }
    }

    /// For programs; numbers that are not finite become `null`.
    pub fn json(&self) -> Value {
        match self {
            Cell::Text(word) => json!(word),
            Cell::Count(n) => json!(n),
            Cell::Share(x)
            | Cell::Seconds(x)
            | Cell::Millimeters(x)
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

    /// For people: columns of equal width, numbers to the right.
    pub fn text(&self) -> String {
        let mut table = plain();
        let headings: Vec<&str> = self.columns.iter().map(|(_, heading)| *heading).collect();
        let is_shown = |k: &usize| !headings[*k].is_empty();
        table.set_header(headings.iter().filter(|heading| !heading.is_empty()));
        for row in &self.rows {
            table.add_row((0..row.len()).filter(is_shown).map(|k| text_cell(&row[k])));
        }
        table.trim_fmt()
    }

    /// For people, elsewhere: the headings that are not empty, and the cells under them.
    pub fn shown(&self) -> (Vec<&'static str>, Vec<Vec<&Cell>>) {
        let is_shown = |k: &usize| !self.columns[*k].1.is_empty();
        let shown: Vec<usize> = (0..self.columns.len()).filter(is_shown).collect();
        let headings = shown.iter().map(|&k| self.columns[k].1).collect();
        (headings, self.rows.iter().map(|row| shown.iter().map(|&k| &row[k]).collect()).collect())
    }

    /// For people: a Markdown table, numbers to the right, of what [`Table::shown`] gives.
    pub fn markdown(&self) -> String {
        let (headings, rows) = self.shown();
        let line = |cells: Vec<String>| {
            let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let is_number = |k: usize| rows.iter().all(|row| row[k].is_number());
        let rule = |k| if is_number(k) { "---:" } else { "---" }.to_string();
        let mut text = line(headings.iter().map(ToString::to_string).collect());
        text += &line((0..headings.len()).map(rule).collect());
        rows.iter().for_each(|row| text += &line(row.iter().map(|cell| cell.show()).collect()));
        text
    }

    /// For programs: an array with one object per row.
    pub fn json(&self) -> Value {
        let object = |row: &Vec<Cell>| {
            let cells =
                self.columns.iter().zip(row).map(|((key, _), c)| (key.to_string(), c.json()));
            Value::Object(cells.collect())
        };
        Value::Array(self.rows.iter().map(object).collect())
    }

    /// For programs: CSV with a header row of the keys; what is missing is empty.
    pub fn csv(&self) -> Vec<u8> {
        let field = |cell: &Cell| match cell.json() {
            Value::String(word) => word,
            Value::Null => String::new(),
            number => number.to_string(),
        };
        let mut writer = csv::Writer::from_writer(Vec::new());
        let header = self.columns.iter().map(|(key, _)| key.to_string()).collect();
        for row in [header]
            .into_iter()
            .chain(self.rows.iter().map(|r| r.iter().map(field).collect::<Vec<_>>()))
        {
            writer.write_record(row).expect("rows of equal length, into memory");
        }
        writer.into_inner().expect("memory takes all")
    }
}

/// Named values, one per line.
#[derive(Debug, Clone, Default, PartialEq)]
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

    /// For people: two columns, both to the left.
    pub fn text(&self) -> String {
        let mut table = plain();
        for (_, name, value) in &self.0 {
            table.add_row([TextCell::new(name), TextCell::new(value.show())]);
        }
        table.trim_fmt()
    }

    /// For programs: one object.
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
