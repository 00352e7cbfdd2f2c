//! The table of findings.

use super::{Finding, Findings, Scattered};
use crate::tables::{Cell, Table};

/// The columns of `findings.csv`; those without a heading are for programs.
const COLUMNS: [(&str, &str); 33] = [
    ("finding", "finding"),
    ("id", "id"),
    ("status", "status"),
    ("reason", ""),
    ("cause", "cause"),
    ("area_mm2", "area, mm²"),
    ("area_share", "of the surface"),
    ("n_sites", "sites"),
    ("x_mm", "x, mm"),
    ("y_mm", "y"),
    ("z_mm", "z"),
    ("normal_x", ""),
    ("normal_y", ""),
    ("normal_z", ""),
    ("low_x_mm", ""),
    ("low_y_mm", ""),
    ("low_z_mm", ""),
    ("high_x_mm", ""),
    ("high_y_mm", ""),
    ("high_z_mm", ""),
    ("site", ""),
    ("worst_clearance_mm", ""),
    ("greatest_rest_mm", "most left, mm"),
    ("left_mm3", "left, mm³"),
    ("proven", "proven"),
    ("fixture", "fixture in the way"),
    ("fixture_share", "at"),
    ("helps", "a tool that helps"),
    ("helps_share", "reaches"),
    ("blocked_by", "blocked by"),
    ("blocked_share", "at"),
    ("change", "a change that helps"),
    ("change_share", "reaches"),
];

/// The column about a baseline.
const STATUS: std::ops::Range<usize> = 2..3;
/// The columns about rests.
const REST: std::ops::Range<usize> = 22..24;
/// The column about proofs.
const PROVEN: std::ops::Range<usize> = 24..25;
/// The columns about fixtures.
const FIXTURE: std::ops::Range<usize> = 25..27;
/// The columns about other tools.
const HELPS: std::ops::Range<usize> = 27..29;
/// The columns about the part that blocks.
const BLOCKED: std::ops::Range<usize> = 29..31;
/// The columns about a change of the tool.
const CHANGE: std::ops::Range<usize> = 31..33;

impl Findings {
    /// A row per finding, and one for the scattered regions if there are any.
    pub fn table(&self) -> Table {
        self.first_rows(usize::MAX)
    }

    /// [`Findings::table`] of the `n` largest.
    pub fn first_rows(&self, n: usize) -> Table {
        let mut columns = COLUMNS;
        let has = |is: fn(&Finding) -> bool| self.list.iter().any(is);
        for (shown, range) in [
            (has(|finding| finding.status.is_some()), STATUS),
            (has(|finding| finding.helps.is_some()), HELPS),
            (has(|finding| finding.blocked_by.is_some()), BLOCKED),
            (has(|finding| finding.change.is_some()), CHANGE),
            (has(|finding| finding.greatest_rest_mm.is_some()), REST),
            (has(|finding| finding.proven.is_some()), PROVEN),
            (has(|finding| finding.fixture.is_some()), FIXTURE),
        ] {
            if !shown {
                columns[range].iter_mut().for_each(|(_, heading)| *heading = "");
            }
        }
        let mut table = Table::new(&columns);
        for (number, finding) in (1..).zip(&self.list).take(n) {
            table.row(finding.row(number));
        }
        let Scattered { n_regions, n_sites, area_mm2 } = self.scattered;
        if n_regions > 0 {
            let name = format!("{n_regions} small");
            let mut row = vec![Cell::text(name), Cell::Missing, Cell::Missing, Cell::Missing];
            row.extend([Cell::text("scattered"), Cell::Number(area_mm2)]);
            row.push(Cell::Share(area_mm2 / self.surface_mm2));
            row.push(Cell::count(n_sites));
            row.resize(COLUMNS.len(), Cell::Missing);
            table.row(row);
        }
        table
    }
}

impl Finding {
    fn row(&self, number: usize) -> Vec<Cell> {
        let status = self.status.map_or(Cell::Missing, |status| Cell::text(status.name()));
        let reason = self.reason.as_ref().map_or(Cell::Missing, Cell::text);
        let mut row = vec![Cell::count(number), Cell::text(&self.id), status, reason];
        row.push(Cell::text(self.words()));
        row.extend([Cell::Number(self.area_mm2), Cell::Share(self.area_share)]);
        row.push(Cell::count(self.n_sites));
        let vectors = [self.at_mm, self.normal, self.low_mm, self.high_mm];
        row.extend(vectors.iter().flat_map(|v| v.to_array()).map(Cell::Number));
        row.push(Cell::count(self.site as usize));
        let clearance = self.worst_clearance_mm.map(f64::from);
        row.push(clearance.map_or(Cell::Missing, Cell::Millimeters));
        let rest = self.greatest_rest_mm.map(f64::from);
        row.push(rest.map_or(Cell::Missing, Cell::Millimeters));
        row.push(self.left_mm3.map_or(Cell::Missing, Cell::Number));
        row.push(self.proven.map_or(Cell::Missing, Cell::Share));
        let fixture = self.fixture.as_ref();
        row.push(fixture.map_or(Cell::Missing, |found| Cell::text(&found.fixture)));
        row.push(fixture.map_or(Cell::Missing, |found| Cell::Share(found.share)));
        row.push(self.helps.as_ref().map_or(Cell::Missing, |help| Cell::text(&help.tool)));
        row.push(self.helps.as_ref().map_or(Cell::Missing, |help| Cell::Share(help.share)));
        row.push(self.blocked_by.map_or(Cell::Missing, |part| Cell::text(part.name())));
        row.push(self.blocked_share.map_or(Cell::Missing, Cell::Share));
        row.push(self.change.as_ref().map_or(Cell::Missing, |change| Cell::text(&change.words)));
        row.push(self.change.as_ref().map_or(Cell::Missing, |change| Cell::Share(change.share)));
        row
    }
}
