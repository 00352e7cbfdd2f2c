//! Coverage by several tools: a table with a row per tool, and the first tool that reaches each site.

use super::folder::{LABELS, Show, Shown, Writer};
use super::page::View;
use super::points::PointValues;
use super::{Class, Coloring, PartView, Rgb};
use crate::access::Labels;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::data::files::tools::{Tool, steps_words};
use crate::findings::Findings;
use crate::findings::gate::SiteAreas;
use crate::geom::units::Unit;
use crate::storage::{atomic_file, input_file};
use crate::tables::{Cell, Table};
use crate::tool::cutter::Step;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Name of the table in a folder of several tools.
#[doc(hidden)] // of the program
pub const TOOLS: &str = "tools.csv";

/// Labels as shares of the surface, or by the published definition of the sites ([`SiteAreas::by_definition`]).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Shares {
    /// Within reach: neither inaccessible nor, where that was tested, with a tip that does not fit.
    pub accessible: f64,
    /// Out of reach of all but the tip.
    pub inaccessible: f64,
    /// Out of reach of the tip alone; `None` by the published definition, which does not test it.
    pub tip_does_not_fit: Option<f64>,
    /// Most often in the way; `None` if that was not counted.
    pub occlusion: Option<f64>,
    /// Inaccessible and most often in the way.
    pub both: Option<f64>,
    /// Of the directions: those that reach a site, mean over all sites, if they were counted.
    pub accessible_directions: Option<f64>,
}

impl Shares {
    /// The shares of `labels` with `n_directions` directions.
    pub fn of(labels: &Labels, n_directions: usize, areas: &SiteAreas) -> Self {
        let counts = &labels.answers.accessible_directions;
        let n_tested = labels.surface.as_ref().map_or(n_directions, |surface| surface.n_directions);
        let accessible: u64 = counts.iter().map(|d| u64::from(*d)).sum();
        let is_counted = !counts.is_empty() || labels.answers.is_empty();
        let accessible_directions =
            is_counted.then(|| accessible as f64 / (labels.answers.len() * n_tested).max(1) as f64);
        Shares { accessible_directions, ..Shares::of_answers(&labels.answers, areas) }
    }

    /// The shares of answers that do not count directions.
    pub fn of_answers(answers: &SiteAnswers, areas: &SiteAreas) -> Self {
        let occlusion = &answers.occlusion;
        let with = |answer: SiteAnswer| areas.share(|i| answers.of(i) == answer);
        let is_both = |i: usize| answers.is_inaccessible(i) && occlusion[i];
        Shares {
            accessible: with(SiteAnswer::Accessible),
            inaccessible: with(SiteAnswer::Inaccessible),
            tip_does_not_fit: answers.tests_tip.then(|| with(SiteAnswer::TipDoesNotFit)),
            occlusion: (!occlusion.is_empty()).then(|| areas.share(|i| occlusion[i])),
            both: (!occlusion.is_empty()).then(|| areas.share(is_both)),
            accessible_directions: None,
        }
    }

    /// What is not there is missing.
    fn cells(&self) -> [Cell; 6] {
        let some = |share: Option<f64>| share.map_or(Cell::Missing, Cell::Share);
        [
            Cell::Share(self.accessible),
            Cell::Share(self.inaccessible),
            some(self.tip_does_not_fit),
            some(self.occlusion),
            some(self.both),
            self.accessible_directions.map_or(Cell::Missing, Cell::Share),
        ]
    }
}

/// What the tools of a table reach.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage<'a> {
    tools: &'a [Tool],
    areas: &'a SiteAreas,
    shares: Vec<Shares>,
    /// Per site, the first tool that reaches it.
    first: Vec<Option<usize>>,
}

impl<'a> Coverage<'a> {
    /// Of `tools` with a label each, about the same sites, whose `areas` they are.
    ///
    /// # Panics
    /// If there are not as many labels as tools, at least one, or they differ in length.
    pub fn of(
        tools: &'a [Tool],
        labels: &[&Labels],
        n_directions: usize,
        areas: &'a SiteAreas,
    ) -> Self {
        assert_eq!(tools.len(), labels.len(), "one label per tool");
        let accessible: Vec<Vec<bool>> = labels.iter().map(|l| l.answers.accessible()).collect();
        let shares = labels.iter().map(|labels| Shares::of(labels, n_directions, areas)).collect();
        Coverage { shares, ..Coverage::of_reached(tools, &accessible, areas) }
    }

    /// Of `tools` of which only the sites are known that they reach.
    ///
    /// # Panics
    /// If there is no tool.
    pub fn of_reached(tools: &'a [Tool], accessible: &[Vec<bool>], areas: &'a SiteAreas) -> Self {
        let reaching = |i: usize| accessible.iter().position(|accessible| accessible[i]);
        let first = (0..accessible[0].len()).map(reaching).collect();
        Coverage { tools, areas, shares: Vec::new(), first }
    }

    /// Share of which `tool` is the first that reaches it; `None`: that no tool reaches.
    pub fn share_of_first(&self, tool: Option<usize>) -> f64 {
        self.areas.share(|i| self.first[i] == tool)
    }

    /// A row per tool; as CSV it is a tool table again.
    pub fn table(&self) -> Table {
        let has =
            |share: fn(&Shares) -> Option<f64>| self.shares.iter().any(|s| share(s).is_some());
        let shown = |is_shown: bool, heading| if is_shown { heading } else { "" };
        let mut columns = vec![
            ("name", "tool"),
            ("CR", "CR"),
            ("CH", "CH"),
            ("FR", "FR"),
            ("FH", "FH"),
            ("corner", ""),
            ("clearance", ""),
            ("accessible", "accessible"),
            ("inaccessible", "inaccessible"),
            ("tip_does_not_fit", shown(has(|s| s.tip_does_not_fit), "tip does not fit")),
            ("occlusion", shown(has(|s| s.occlusion), "occlusion")),
            ("both", ""),
            ("free_directions", "directions"),
            ("adds", "adds"),
        ];
        // What four lengths do not say, for tools of libraries.
        let says_more =
            |tool: &Tool| tool.description.is_some() || tool.assembly.overall_mm().is_some();
        let has_steps = self.tools.iter().any(says_more);
        if has_steps {
            columns.extend([("body", ""), ("holder", ""), ("stick_out", ""), ("overall", "")]);
            columns.push(("neck_and_shank", ""));
        }
        let has_numbers = self.tools.iter().any(|tool| tool.number.is_some());
        if has_numbers {
            columns.push(("T", ""));
        }
        // Where the name is no folder's.
        let has_folders = self.tools.iter().any(|tool| tool.folder() != tool.name);
        if has_folders {
            columns.push(("folder", ""));
        }
        let profile = profiles_of(self.tools);
        columns.extend(profile.is_some().then_some(("profile", "")));
        let mut table = Table::new(&columns);
        for (k, (tool, shares)) in self.tools.iter().zip(&self.shares).enumerate() {
            let lengths = tool.params.to_array();
            let mut row = vec![Cell::text(&tool.name)];
            row.extend(
                lengths.into_iter().chain([tool.corner_mm, tool.clearance_mm]).map(Cell::Given),
            );
            row.extend(shares.cells());
            row.push(Cell::Share(self.share_of_first(Some(k))));
            if has_steps {
                row.extend(steps_of(tool));
            }
            row.extend(has_numbers.then(|| number_of(tool)));
            row.extend(has_folders.then(|| Cell::text(tool.folder())));
            row.extend(profile.as_ref().map(|profile| profile(tool)));
            table.row(row);
        }
        table
    }

    /// Writes `tools.csv` with its lengths and areas in `unit`, `tools.ply` and, if wanted, `tools.png`; returns their
    /// paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    #[doc(hidden)] // of `analysis`
    pub fn write(
        &self,
        folder: &Path,
        part: PartView,
        show: Show,
        unit: Unit,
    ) -> Result<Vec<PathBuf>> {
        let table = folder.join(TOOLS);
        atomic_file::write_atomic(&table, |file| file.write_all(&self.table().csv_in(unit)))?;
        let drawn = self.write_first(folder, part, show)?;
        Ok([table].into_iter().chain(drawn).collect())
    }

    /// As [`Coverage::write`], without the table.
    ///
    /// # Errors
    /// If the system refuses a file.
    #[doc(hidden)] // of the program
    pub fn write_first(&self, folder: &Path, part: PartView, show: Show) -> Result<Vec<PathBuf>> {
        let (classes, of) = self.groups();
        let areas = self.areas.shares();
        let coloring = Coloring::Groups { classes: &classes, of: &of, areas };
        let rows: Vec<u32> = self.first.iter().map(|f| f.map_or(0, |k| k as u32 + 1)).collect();
        let values = [("first_tool", PointValues::Counts(&rows))];
        let notes =
            ["first_tool: row of tools.csv from 1, 0: no tool reaches the site".to_string()];
        let writer = Writer { folder, part, show };
        let caption = "first tool that reaches";
        writer.write("tools", &Shown { caption, coloring, values: &values, notes: &notes })
    }

    fn groups(&self) -> (Vec<Class<'_>>, Vec<usize>) {
        let names: Vec<&str> = self.tools.iter().map(|tool| &*tool.name).collect();
        groups(&names, &self.first)
    }

    /// The same as a tab of a page; `findings` are those of the sites that no tool reaches.
    #[doc(hidden)] // of the program
    pub fn view(&self, findings: Findings) -> View {
        let (classes, of) = self.groups();
        let view = View::of_first_tools(&classes, &of, findings);
        View { counts_sites: self.areas.are_even(), ..view }
    }
}

/// As [`tool_folders`], of a folder that `label` has written for several tools; none of others, as that of `tools`,
/// whose table names tools without answers.
///
/// # Errors
/// As [`tool_folders`].
#[doc(hidden)] // of the program
pub fn labeled_tools(folder: &Path) -> Result<Option<Vec<(String, String)>>> {
    if !folder.join(TOOLS).is_file() {
        return Ok(None);
    }
    let tools = tool_folders(folder)?;
    let is_labeled = |(_, of): &(String, String)| folder.join(of).join(LABELS).is_file();
    Ok(tools.iter().any(is_labeled).then_some(tools))
}

/// The names and folders in the columns `name` and `folder` of `tools.csv` in `folder`, at least one; without the
/// latter, a folder has the tool's name.
///
/// # Errors
/// If the system refuses the file, it is no such table, or a folder's name is none.
fn tool_folders(folder: &Path) -> Result<Vec<(String, String)>> {
    let path = folder.join(TOOLS);
    let bytes = input_file::read(&path, input_file::LIBRARY)?;
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let remedy = "name a folder that `deepmill label` has written";
    let bad = |found: String| Error::file(&path, "column name", found, remedy);
    let header = reader.headers().map_err(|e| bad(e.to_string()))?;
    let column = |name: &str| header.iter().position(|heading| heading == name);
    let (name, other) =
        (column("name").ok_or_else(|| bad("it is missing".into()))?, column("folder"));
    let mut found = Vec::new();
    for row in reader.records() {
        let row = row.map_err(|e| bad(e.to_string()))?;
        let field = |column: usize| row.get(column).unwrap_or_default();
        let folder = other.map_or(field(name), field);
        if folder.is_empty() || folder.starts_with('.') || folder.contains(['/', '\\', ':']) {
            return Err(bad(format!("`{folder}` is no folder's name")));
        }
        found.push((field(name).to_string(), folder.to_string()));
    }
    if found.is_empty() { Err(bad("no tool".into())) } else { Ok(found) }
}

/// The column `T`.
pub(super) fn number_of(tool: &Tool) -> Cell {
    tool.number.map_or(Cell::Missing, |number| Cell::Count(number.into()))
}

/// Groups for the legend, the tools that add something first, and the group of each site; `first` is the first tool
/// that reaches it.
#[doc(hidden)] // of the program
pub fn groups<'a>(names: &[&'a str], first: &[Option<usize>]) -> (Vec<Class<'a>>, Vec<usize>) {
    groups_called(names, first, ["further tools", "no tool"])
}

/// As [`groups`], with words for those beyond the colors and for none.
pub(super) fn groups_called<'a>(
    names: &[&'a str],
    first: &[Option<usize>],
    [further, none]: [&'a str; 2],
) -> (Vec<Class<'a>>, Vec<usize>) {
    let mut classes = Vec::new();
    let group_of: Vec<usize> = (0..names.len())
        .map(|k| {
            let is_new = first.contains(&Some(k)) && classes.len() <= COLORS.len();
            if is_new {
                let named = COLORS.get(classes.len()).map(|c| (names[k], *c));
                let (name, color) = named.unwrap_or((further, FURTHER));
                classes.push(Class { name, color });
            }
            classes.len().saturating_sub(1)
        })
        .collect();
    classes.push(Class { name: none, color: NO_TOOL });
    let last = classes.len() - 1;
    let of = first.iter().map(|first| first.map_or(last, |k| group_of[k])).collect();
    (classes, of)
}

/// The columns `body`, `holder` and `stick_out`, missing for a tool of four lengths, and `overall`, missing where no
/// one has stated it.
pub(super) fn steps_of(tool: &Tool) -> [Cell; 5] {
    let overall = tool.assembly.overall_mm().map_or(Cell::Missing, Cell::Given);
    let Tool { assembly, description: Some(_), .. } = tool else {
        return [Cell::Missing, Cell::Missing, Cell::Missing, overall, Cell::Missing];
    };
    let words = |steps: &[Step]| Cell::Text(steps_words(steps));
    let stick_out = Cell::Given(assembly.stick_out_mm());
    [
        words(&assembly.own_body()),
        words(assembly.holder()),
        stick_out,
        overall,
        words(assembly.neck_and_shank()),
    ]
}

/// The column `profile`, if some tool is given by one.
pub(super) fn profiles_of(tools: &[Tool]) -> Option<impl Fn(&Tool) -> Cell + use<>> {
    let words = |tool: &Tool| {
        let profile = tool.assembly.profile();
        profile.map_or(Cell::Missing, |profile| Cell::Text(profile.to_string()))
    };
    tools.iter().any(|tool| tool.assembly.profile().is_some()).then_some(words)
}

/// Colors of the tools that add something, apart for the common kinds of color blindness.
const COLORS: [Rgb; 6] =
    [[205, 208, 212], [86, 180, 233], [240, 228, 66], [0, 158, 115], [204, 121, 167], [0, 90, 160]];
const FURTHER: Rgb = [110, 100, 90];
pub(super) const NO_TOOL: Rgb = [206, 58, 44];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::CutterParams;

    fn tools(n: usize) -> Vec<Tool> {
        let tool =
            |k| Tool::new(CutterParams::from_array([1.0 + k as f64, 2.0, 50.0, 4.0]), None, 0.0);
        (0..n).map(|k| tool(k).unwrap()).collect()
    }

    fn labels(inaccessible: &[u8]) -> Labels {
        let inaccessible: Vec<bool> = inaccessible.iter().map(|i| *i == 1).collect();
        let free = inaccessible.iter().map(|i| if *i { 0 } else { 5 }).collect();
        let occlusion = vec![true; inaccessible.len()];
        let answers = SiteAnswers {
            accessible_directions: free,
            ..SiteAnswers::new(inaccessible, occlusion)
        };
        Labels { answers, ..Labels::default() }
    }

    #[test]
    fn each_site_counts_for_the_first_tool_that_reaches_it() {
        let tools = tools(3);
        let all = [labels(&[0, 1, 1, 1]), labels(&[0, 1, 1, 1]), labels(&[1, 0, 0, 1])];
        let areas = SiteAreas::even(4);
        let coverage = Coverage::of(&tools, &all.iter().collect::<Vec<_>>(), 10, &areas);
        let adds = [Some(0), Some(1), Some(2), None].map(|k| coverage.share_of_first(k));
        assert_eq!(adds, [0.25, 0.0, 0.5, 0.25]);
        let row = &coverage.table().json()[2];
        assert_eq!(
            (&row["CR"], &row["inaccessible"], &row["adds"]),
            (&3.0.into(), &0.5.into(), &0.5.into())
        );
        assert_eq!((&row["both"], &row["free_directions"]), (&0.5.into(), &0.25.into()));
        let (classes, of) = coverage.groups();
        let names: Vec<&str> = classes.iter().map(|c| c.name).collect();
        assert_eq!(names, ["1-2-50-4", "3-2-50-4", "no tool"]);
        assert_eq!(of, [0, 1, 1, 2]);
    }

    /// A wide ball is nowhere inaccessible, and its tip fits nowhere in the corners: it reaches less than a thin one.
    #[test]
    fn what_the_tip_cannot_reach_is_not_reached_by_the_tool() {
        let tools = tools(2);
        let mut all = [labels(&[0, 0, 0, 1]), labels(&[0, 0, 0, 0])];
        use SiteAnswer::{Accessible, Inaccessible, TipDoesNotFit};
        all[0].answers.of_sites = vec![Accessible, Accessible, Accessible, Inaccessible];
        all[1].answers.of_sites = vec![Accessible, TipDoesNotFit, TipDoesNotFit, TipDoesNotFit];
        all.iter_mut().for_each(|labels| labels.answers.tests_tip = true);
        let areas = SiteAreas::even(4);
        let coverage = Coverage::of(&tools, &all.iter().collect::<Vec<_>>(), 10, &areas);
        let rows = coverage.table().json();
        let shares = |row: usize| {
            ["accessible", "inaccessible", "tip_does_not_fit"].map(|key| rows[row][key].clone())
        };
        assert_eq!(
            (shares(0), shares(1)),
            ([0.75, 0.25, 0.0].map(Into::into), [0.25, 0.0, 0.75].map(Into::into))
        );
        assert_eq!([Some(0), Some(1), None].map(|k| coverage.share_of_first(k)), [0.75, 0.0, 0.25]);
        let text = coverage.table().text();
        let at = |heading| text.find(heading).unwrap();
        assert!(
            at("accessible") < at("inaccessible") && at("inaccessible") < at("tip does not fit")
        );
    }

    #[test]
    fn names_are_read_from_the_table_and_ways_out_of_the_folder_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |text: &str| std::fs::write(folder.path().join(TOOLS), text).unwrap();
        write("CR,name\n1,stub\n2,\"D2, long\"\n");
        let names = |found: Vec<(String, String)>| found.into_iter().map(|(name, _)| name);
        let found = tool_folders(folder.path()).unwrap();
        assert!(found.iter().all(|(name, folder)| name == folder));
        assert!(names(found).eq(["stub", "D2, long"]));
        write("name,folder\n\"1/4\"\" flat\",1 4 flat\n");
        let found = tool_folders(folder.path()).unwrap();
        assert_eq!(found, [("1/4\" flat".to_string(), "1 4 flat".to_string())]);
        for bad in [
            "name,folder\nx,../x\n",
            "name\n../x\n",
            "name\n",
            "CR\n1\n",
            "name\na/b\n",
            "name\n\"\"\n",
        ] {
            write(bad);
            let message = tool_folders(folder.path()).unwrap_err().to_string();
            assert!(message.contains("column name"), "{bad}: {message}");
        }
    }

    #[test]
    fn tools_beyond_the_colors_share_one() {
        let tools = tools(9);
        let only = |k: usize| (0..10).map(|i| u8::from(i != k)).collect::<Vec<u8>>();
        let all: Vec<Labels> = (0..9).map(|k| labels(&only(k))).collect();
        let areas = SiteAreas::even(10);
        let coverage = Coverage::of(&tools, &all.iter().collect::<Vec<_>>(), 10, &areas);
        let (classes, of) = coverage.groups();
        assert_eq!((classes.len(), classes[6].name), (8, "further tools"));
        assert_eq!(of, [0, 1, 2, 3, 4, 5, 6, 6, 6, 7]);
    }
}
