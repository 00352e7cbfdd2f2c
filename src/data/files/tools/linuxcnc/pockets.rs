//! Tables of EMC2 up to version 2.3, of columns without letters: pocket, number of the tool (FMS), length, diameter,
//! remark.
//!
//! ```text
//! POC  FMS  LEN   DIAM  COMMENT
//!
//! 1    1    50.2  6.0   6 mm ball
//!
//! POC  FMS  ZOFFSET  XOFFSET  DIAMETER  FRONTANGLE  BACKANGLE  ORIENT  COMMENT
//! ```
//!
//! Lines above the rows name the columns, or may be missing. A row with four more numbers is one of a lathe, unless the
//! lines above name the columns of mills alone: EMC2 itself reads a remark of four numbers so.

use super::Row;
use crate::data::files::tools::place::shown;
use crate::geom::units::length::decimal;
use crate::{Error, Result};
use std::path::Path;

/// Words of a line that names columns, each a name of one of them.
const NAMES: [(Column, &[&str]); 9] = [
    (Column::Pocket, &["poc", "pocket"]),
    (Column::Number, &["fms"]),
    (Column::Length, &["len", "length", "tlo", "zoffset", "z-offset"]),
    (Column::Across, &["xoffset", "x-offset"]),
    (Column::Diameter, &["diam", "dia", "diameter"]),
    (Column::Front, &["frontangle", "front-angle"]),
    (Column::Back, &["backangle", "back-angle"]),
    (Column::Orientation, &["orient", "orientation"]),
    (Column::Remark, &["comment", "remark"]),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Pocket,
    Number,
    Length,
    Across,
    Diameter,
    Front,
    Back,
    Orientation,
    Remark,
}

const MILL: [Column; 5] =
    [Column::Pocket, Column::Number, Column::Length, Column::Diameter, Column::Remark];
const LATHE: [Column; 9] = [
    Column::Pocket,
    Column::Number,
    Column::Length,
    Column::Across,
    Column::Diameter,
    Column::Front,
    Column::Back,
    Column::Orientation,
    Column::Remark,
];
const REMEDY: &str = "expected POC FMS LEN DIAM COMMENT, or POC FMS ZOFFSET XOFFSET DIAMETER FRONTANGLE BACKANGLE \
     ORIENT COMMENT of a lathe: correct it, or save the table with LinuxCNC 2.4 or newer";

/// Whether a line names the columns of such a table.
pub(super) fn is_header(line: &str) -> bool {
    let mut words = line.split_whitespace().map(column_of);
    words.next() == Some(Some(Column::Pocket)) && words.next() == Some(Some(Column::Number))
}

/// Whether a line may be a row of such a table: it begins with two whole numbers.
pub(super) fn is_row(line: &str) -> bool {
    let mut words = line.split_whitespace();
    let mut is_whole = || words.next().is_some_and(|word| word.parse::<u64>().is_ok());
    is_whole() && is_whole()
}

fn column_of(word: &str) -> Option<Column> {
    let word = word.to_ascii_lowercase();
    NAMES.iter().find(|(_, names)| names.contains(&&*word)).map(|(column, _)| *column)
}

/// What the lines above the rows say.
#[derive(Debug, Default)]
pub(super) struct Above {
    names_mill: bool,
    names_lathe: bool,
}

/// What a line of the table is.
pub(super) enum Line<'a> {
    Above,
    Row(Row, &'a str),
}

impl Above {
    /// Reads a line, its number and file for messages.
    ///
    /// # Errors
    /// If it neither names columns nor is a row.
    pub fn line<'a>(&mut self, text: &'a str, line: usize, path: &Path) -> Result<Line<'a>> {
        if is_header(text) {
            self.names(text).map_err(|found| at(line, path, found, REMEDY))?;
            return Ok(Line::Above);
        }
        // Such as `the file includes both`.
        let is_words = text.chars().all(|c| !c.is_ascii_digit());
        if is_words {
            return Ok(Line::Above);
        }
        let only_mill = self.names_mill && !self.names_lathe;
        let only_lathe = self.names_lathe && !self.names_mill;
        let row = if only_mill { None } else { row_of(text, &LATHE) };
        let row = row.or_else(|| if only_lathe { None } else { row_of(text, &MILL) });
        row.map(|(row, remark)| Line::Row(row, remark)).ok_or_else(|| {
            let (n, columns) = match only_lathe {
                true => (8, "pocket, FMS, two offsets, diameter, two angles and orientation"),
                false => (4, "pocket, FMS, length and diameter"),
            };
            let found = format!("{} does not begin with {n} numbers: {columns}", shown(text));
            at(line, path, found, "write for example 1 1 52.3 6.0 6 mm ball end")
        })
    }

    /// Takes a line that names columns.
    fn names(&mut self, text: &str) -> std::result::Result<(), String> {
        let mut columns = Vec::new();
        for word in text.split_whitespace() {
            let column = column_of(word).ok_or_else(|| {
                format!("{} is no column of a table with POC and FMS", shown(word))
            })?;
            if columns.contains(&column) {
                return Err(format!("the column {} is there twice", shown(word)));
            }
            columns.push(column);
        }
        let is = |all: &[Column]| columns == all || columns == all[..all.len() - 1];
        match (is(&MILL), is(&LATHE)) {
            (true, _) => self.names_mill = true,
            (_, true) => self.names_lathe = true,
            _ => return Err(format!("the columns are {}", shown(text))),
        }
        Ok(())
    }
}

fn at(line: usize, path: &Path, found: String, remedy: &str) -> Error {
    Error::file(path, format!("line {line}"), found, remedy)
}

/// A row with its remark; none if its words are not the numbers of the columns.
fn row_of<'a>(text: &'a str, columns: &[Column]) -> Option<(Row, &'a str)> {
    let mut rest = text.trim_start();
    let mut row = Row::default();
    for column in columns {
        if *column == Column::Remark {
            break;
        }
        let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = after.trim_start();
        let whole = || word.parse::<u64>().ok();
        let number = decimal(word).filter(|x| x.is_finite());
        match column {
            Column::Pocket => row.number = whole()?,
            Column::Number => row.other_number = Some(whole()?),
            Column::Diameter => row.diameter = Some(number?).filter(|d| *d != 0.0),
            Column::Front | Column::Back => row.is_lathe |= number? != 0.0,
            Column::Orientation => row.is_lathe |= whole()? != 0,
            Column::Length | Column::Across | Column::Remark => drop(number?),
        }
    }
    Some((row, rest.trim_start_matches([';', '#', ' ', '\t']).trim_end()))
}
