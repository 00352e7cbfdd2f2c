//! What the tools of a library reach on one part: a table, the fewest that reach a share of what can be reached, and
//! how little each may stick out.

use super::coverage::{number_of, profiles_of, steps_of};
use crate::access::surface::ToolReach;
use crate::answers::SiteAnswer;
use crate::data::files::tools::{Tool, thick_and_short_first};
use crate::findings::gate::SiteAreas;
use crate::geom::units::Unit;
use crate::planning::cover::{Cover, cover, cover_share_preferring};
use crate::render::curves::{self, Chart, Series};
use crate::storage::atomic_file;
use crate::tables::{Cell, Table};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// What each tool of a library reaches.
#[derive(Debug, PartialEq)]
pub struct Library {
    tools: Vec<Tool>,
    reach: Vec<ToolReach>,
    areas: SiteAreas,
    share: f64,
    /// The fewest tools that reach the share of what any tool reaches, of as few the thick and short ones.
    pub cover: Cover,
    /// The number of tools that reach all of it, the fewest that were found.
    pub n_for_all: usize,
}

/// One tool in numbers; areas as shares of the surface.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ToolFacts {
    /// That the tool reaches as it is held.
    pub reached: f64,
    /// Where in every direction some step of the tool penetrates.
    pub inaccessible: f64,
    /// Where in some direction only the tip penetrates.
    pub tip_does_not_fit: f64,
    /// That no tool before it reaches.
    pub adds: f64,
    /// That its body would reach at any stick-out up to the overall length, where that is stated.
    pub body_reaches: f64,
    /// That it would reach if it were longer than the overall length.
    pub beyond_overall: f64,
    /// Least stick-out at which the required share of `body_reaches` is reached, mm; none if the body reaches nothing.
    pub least_stick_out_mm: Option<f64>,
}

/// Tools of one chart.
const CURVES_OF_CHART: usize = 6;
/// Corners of a curve in the picture.
const MOST_CORNERS: usize = 400;

impl Library {
    /// Of tools with what they reach; `share` is that of the area within reach of the body which the least stick-out is
    /// stated for, and that of the area within reach of any tool which the smallest set reaches.
    ///
    /// # Errors
    /// If the share is not above 0 and at most 1.
    ///
    /// # Panics
    /// If there are not as many answers as tools.
    pub fn new(
        tools: Vec<Tool>,
        reach: Vec<ToolReach>,
        areas: SiteAreas,
        share: f64,
    ) -> Result<Self> {
        assert_eq!(tools.len(), reach.len(), "an answer per tool");
        if !(share > 0.0 && share <= 1.0) {
            let found = format!("{} %", 100.0 * share);
            let remedy = "95% is the default";
            return Err(Error::argument("share", found, "above 0, at most 100 %", remedy));
        }
        let reaches = |tool: usize, i: usize| reach[tool].answers[i] == SiteAnswer::Accessible;
        let n_for_all = cover(tools.len(), areas.shares(), reaches).chosen.len();
        let order = thick_and_short_first(&tools);
        let cover = cover_share_preferring(tools.len(), areas.shares(), reaches, share, &order);
        Ok(Library { tools, reach, areas, share, cover, n_for_all })
    }

    /// The tools.
    pub fn tools(&self) -> &[Tool] {
        &self.tools
    }

    /// What each of them reaches.
    pub fn reach(&self) -> &[ToolReach] {
        &self.reach
    }

    /// The share of the area that it is stated for.
    #[cfg(feature = "generate")] // of `analysis`
    pub(crate) fn share(&self) -> f64 {
        self.share
    }

    /// What each site stands for.
    pub fn areas(&self) -> &SiteAreas {
        &self.areas
    }

    fn reaches(&self, tool: usize, i: usize) -> bool {
        self.reach[tool].answers[i] == SiteAnswer::Accessible
    }

    /// Share of the surface that no tool reaches.
    pub fn unreached(&self) -> f64 {
        self.areas.share(|i| !(0..self.tools.len()).any(|tool| self.reaches(tool, i)))
    }

    /// A tool in numbers.
    pub fn facts(&self, tool: usize) -> ToolFacts {
        let reach = &self.reach[tool];
        let is_within = |i: usize| self.is_within(tool, reach.least_stick_out_mm[i]);
        let body_reaches = self.areas.share(|i| reach.body_reaches[i] && is_within(i));
        let beyond_overall = self.areas.share(|i| reach.body_reaches[i] && !is_within(i));
        let of = |answer: SiteAnswer| self.areas.share(|i| reach.answers[i] == answer);
        ToolFacts {
            reached: self.areas.share(|i| self.reaches(tool, i)),
            inaccessible: of(SiteAnswer::Inaccessible),
            tip_does_not_fit: of(SiteAnswer::TipDoesNotFit),
            adds: self.areas.share(|i| {
                self.reaches(tool, i) && !(0..tool).any(|before| self.reaches(before, i))
            }),
            body_reaches,
            beyond_overall,
            least_stick_out_mm: self.least_stick_out(tool, self.share * body_reaches),
        }
    }

    /// Whether a tool can stick out so far.
    fn is_within(&self, tool: usize, stick_out_mm: f64) -> bool {
        stick_out_mm <= self.tools[tool].assembly.most_stick_out_mm()
    }

    /// Stick-out, mm, up to the overall length, and share of the surface that is reached from there on: a corner for
    /// each site, ascending.
    pub fn curve(&self, tool: usize) -> Vec<(f64, f64)> {
        let least = self.reach[tool].least_stick_out_mm.iter().zip(self.areas.shares());
        let is_possible = |length: &f64| length.is_finite() && self.is_within(tool, *length);
        let mut corners: Vec<(f64, f64)> =
            least.map(|(l, a)| (*l, *a)).filter(|(length, _)| is_possible(length)).collect();
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        for (_, area) in &mut corners {
            sum += *area;
            *area = sum;
        }
        corners.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            kept.1 = if same { next.1 } else { kept.1 };
            same
        });
        corners
    }

    fn least_stick_out(&self, tool: usize, wanted: f64) -> Option<f64> {
        let curve = self.curve(tool);
        // Sums in another order may differ in the last bits.
        let enough = wanted - 1e-12;
        curve.iter().find(|(_, area)| *area >= enough).or(curve.last()).map(|(length, _)| *length)
    }

    /// A row per tool; as CSV it is a tool table again.
    pub fn table(&self) -> Table {
        let all: Vec<ToolFacts> = (0..self.tools.len()).map(|k| self.facts(k)).collect();
        let is_stopped = all.iter().any(|facts| facts.beyond_overall > 0.0);
        let mut columns = vec![
            ("name", "tool"),
            ("CR", ""),
            ("CH", ""),
            ("FR", ""),
            ("FH", ""),
            ("corner", ""),
            ("clearance", ""),
            ("reached", "reached"),
            ("reached_mm2", "mm²"),
            ("inaccessible", "inaccessible"),
            ("tip_does_not_fit", "tip does not fit"),
            ("adds", "adds"),
            ("adds_mm2", "mm²"),
            ("in_smallest_set", "needed"),
            ("body_reaches", "any stick-out"),
            ("held_at", "stick-out"),
            ("least_stick_out", "least"),
            ("beyond_overall", if is_stopped { "beyond its length" } else { "" }),
            ("excess", ""),
            ("body", ""),
            ("holder", ""),
            ("stick_out", ""),
            ("overall", ""),
            ("neck_and_shank", ""),
        ];
        let has_numbers = self.tools.iter().any(|tool| tool.number.is_some());
        if has_numbers {
            columns.push(("T", ""));
        }
        let profile = profiles_of(&self.tools);
        columns.extend(profile.is_some().then_some(("profile", "")));
        let mut table = Table::new(&columns);
        let area =
            |share: f64| self.areas.total_mm2().map_or(Cell::Missing, |t| Cell::Number(share * t));
        for (k, (tool, facts)) in self.tools.iter().zip(all).enumerate() {
            let ToolFacts { reached, adds, body_reaches, least_stick_out_mm, .. } = facts;
            let needed = if self.cover.chosen.contains(&k) { "yes" } else { "" };
            let given =
                tool.params.to_array().into_iter().chain([tool.corner_mm, tool.clearance_mm]);
            let mut row = vec![Cell::text(&tool.name)];
            row.extend(given.map(Cell::Given));
            row.extend([
                Cell::Share(reached),
                area(reached),
                Cell::Share(facts.inaccessible),
                Cell::Share(facts.tip_does_not_fit),
                Cell::Share(adds),
                area(adds),
                Cell::text(needed),
                Cell::Share(body_reaches),
                Cell::Millimeters(tool.assembly.stick_out_mm()),
                least_stick_out_mm.map_or(Cell::Missing, Cell::Millimeters),
                Cell::Share(facts.beyond_overall),
                Cell::Given(tool.assembly.excess_mm()),
            ]);
            row.extend(steps_of(tool));
            row.extend(has_numbers.then(|| number_of(tool)));
            row.extend(profile.as_ref().map(|profile| profile(tool)));
            table.row(row);
        }
        table
    }

    /// The fewest tools in the order of what each adds, with the area reached so far.
    pub fn cover_table(&self) -> Table {
        let mut table = Table::new(&[
            ("name", "fewest tools"),
            ("adds", "adds"),
            ("reached", "reached so far"),
        ]);
        let mut sum = 0.0;
        for (&tool, adds) in self.cover.chosen.iter().zip(&self.cover.adds) {
            sum += adds;
            table.row([Cell::text(&self.tools[tool].name), Cell::Share(*adds), Cell::Share(sum)]);
        }
        table
    }

    /// Writes `tools.csv` and `stick-out.csv` with lengths and areas in `unit`, and `stick-out.svg`; returns their
    /// paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    pub fn write(&self, folder: &Path, unit: Unit) -> Result<Vec<PathBuf>> {
        let [table, curves, picture] =
            ["tools.csv", "stick-out.csv", "stick-out.svg"].map(|name| folder.join(name));
        atomic_file::write_atomic(&table, |file| file.write_all(&self.table().csv_in(unit)))?;
        atomic_file::write_atomic(&curves, |file| file.write_all(&self.curves_csv(unit)))?;
        curves::write_curves(&picture, "stick-out, mm", &self.charts())?;
        Ok(vec![table, curves, picture])
    }

    fn curves_csv(&self, unit: Unit) -> Vec<u8> {
        let mut table =
            Table::new(&[("name", ""), ("stick_out", ""), ("reached", ""), ("reached_mm2", "")]);
        for (k, tool) in self.tools.iter().enumerate() {
            for (length, area) in self.curve(k) {
                let mm2 = self.areas.total_mm2().map_or(Cell::Missing, |t| Cell::Number(area * t));
                table.row([Cell::text(&tool.name), Cell::Given(length), Cell::Share(area), mm2]);
            }
        }
        table.csv_in(unit)
    }

    fn charts(&self) -> Vec<Chart> {
        let chart = |tools: &[usize]| {
            let end =
                tools.iter().filter_map(|&k| Some(self.curve(k).last()?.0)).fold(0.0, f64::max);
            let series = tools.iter().map(|&k| Series {
                name: self.tools[k].name.clone(),
                points: staircase(&self.curve(k), end),
            });
            Chart { title: "% of the surface within reach".into(), series: series.collect() }
        };
        let all: Vec<usize> = (0..self.tools.len()).collect();
        all.chunks(CURVES_OF_CHART).map(chart).collect()
    }
}

/// A curve that goes up in steps, in percent, up to the end of the axis; of many corners the picture has some.
fn staircase(curve: &[(f64, f64)], end: f64) -> Vec<(f64, f64)> {
    let every = curve.len().div_ceil(MOST_CORNERS).max(1);
    let mut points = Vec::new();
    let mut before = 0.0;
    for (k, (length, area)) in curve.iter().enumerate() {
        if k % every == 0 || k + 1 == curve.len() {
            points.extend([(*length, 100.0 * before), (*length, 100.0 * area)]);
            before = *area;
        }
    }
    points.extend(curve.last().map(|(_, area)| (end, 100.0 * area)));
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Sites, solids};
    use crate::tool::cutter::CutterParams;
    use glam::{DVec3, Vec3};

    fn reach(least: [f64; 4], held: f64) -> ToolReach {
        let answer = |l: &f64| {
            if *l <= held { SiteAnswer::Accessible } else { SiteAnswer::Inaccessible }
        };
        ToolReach {
            answers: least.iter().map(answer).collect(),
            witness: vec![None; 4],
            body_reaches: least.iter().map(|l| l.is_finite()).collect(),
            least_stick_out_mm: least.to_vec(),
        }
    }

    #[test]
    fn no_stick_out_is_beyond_the_overall_length() {
        let tool = |overall| {
            let tool = Tool::new(CutterParams::from_array([1.0, 8.0, 50.0, 4.0]), None, 0.0);
            tool.unwrap().of_overall_length(overall).unwrap()
        };
        let least = [2.0, 12.0, 30.0, 45.0];
        let tools = [tool(38.0), tool(60.0)];
        let reach = [reach(least, 10.0), reach(least, 10.0)];
        let areas = SiteAreas::even(4);
        let library = Library::new(tools.to_vec(), reach.to_vec(), areas, 1.0).unwrap();
        let facts = [library.facts(0), library.facts(1)];
        assert_eq!(facts.clone().map(|f| f.least_stick_out_mm), [Some(30.0), Some(45.0)]);
        assert_eq!(facts.clone().map(|f| f.body_reaches), [0.75, 1.0]);
        assert_eq!(facts.map(|f| f.beyond_overall), [0.25, 0.0]);
        assert_eq!(library.curve(0).last(), Some(&(30.0, 0.75)));
        let table = library.table();
        assert!(table.text().contains("beyond its length"), "{}", table.text());
        let rows = table.json();
        assert_eq!((&rows[0]["overall"], &rows[0]["beyond_overall"]), (&38.0.into(), &0.25.into()));
    }

    #[test]
    fn of_sets_as_small_the_thick_and_short_tools_are_taken() {
        let tool = |cr: f64, ch: f64| {
            Tool::new(CutterParams::from_array([cr, ch, 50.0, 4.0]), None, 0.0).unwrap()
        };
        // The thin tool reaches all, the thick ones all but a fortieth; then each alone is enough for 95 %.
        let tools = [tool(1.5, 30.0), tool(6.0, 40.0), tool(6.0, 20.0), tool(3.0, 10.0)];
        let answers = |n: usize| {
            let answer = |i| if i < n { SiteAnswer::Accessible } else { SiteAnswer::TipDoesNotFit };
            ToolReach { answers: (0..40).map(answer).collect(), ..ToolReach::default() }
        };
        let reach = [40, 39, 39, 40].map(answers);
        let areas = SiteAreas::even(40);
        let new = |share| Library::new(tools.to_vec(), reach.to_vec(), areas.clone(), share);
        let chosen = |share| new(share).unwrap().cover.chosen;
        assert_eq!((chosen(0.95), chosen(1.0)), (vec![2], vec![3]));
    }

    #[test]
    fn areas_stick_outs_and_the_fewest_tools_are_those_of_the_sites() {
        let tool =
            |ch| Tool::new(CutterParams::from_array([1.0, ch, 50.0, 4.0]), None, 0.0).unwrap();
        let tools = [tool(8.0), tool(18.0), tool(28.0)];
        const NEVER: f64 = f64::INFINITY;
        let least = [[2.0, 2.0, 15.0, NEVER], [2.0, NEVER, 15.0, 40.0], [2.0, NEVER, 12.0, 25.0]];
        let reach: Vec<ToolReach> =
            least.iter().zip([10.0, 20.0, 30.0]).map(|(l, h)| reach(*l, h)).collect();
        let points = (0..4).map(|i| Vec3::new((i % 2) as f32, (i / 2) as f32, 0.0)).collect();
        let sites = Sites::new(points, vec![Vec3::Z; 4]).unwrap();
        let mesh = solids::cuboid(DVec3::splat(1.0));
        let areas = SiteAreas::of(&sites, Some(&mesh)).unwrap();
        let new = |share| Library::new(tools.to_vec(), reach.clone(), areas.clone(), share);
        let library = new(0.95).unwrap();
        assert_eq!(library.cover.chosen.len(), 2);
        assert!(
            library.cover.is_smallest()
                && library.cover.chosen.contains(&0)
                && library.cover.chosen.contains(&2)
        );
        let facts = [0, 1, 2].map(|k| library.facts(k));
        assert_eq!(facts.clone().map(|f| f.reached), [0.5, 0.5, 0.75]);
        assert_eq!(facts.clone().map(|f| f.adds), [0.5, 0.25, 0.25]);
        assert_eq!(facts.clone().map(|f| f.body_reaches), [0.75; 3]);
        assert_eq!(facts.map(|f| f.least_stick_out_mm), [Some(15.0), Some(40.0), Some(25.0)]);
        assert_eq!(library.curve(1), [(2.0, 0.25), (15.0, 0.5), (40.0, 0.75)]);
        assert_eq!(
            (library.unreached(), &library.table().json()[2]["adds_mm2"]),
            (0.0, &1.5.into())
        );
        assert_eq!(library.n_for_all, 2);
        // Each of the three reaches half of the surface: the one that sticks out least is taken.
        let half = new(0.5).unwrap();
        assert_eq!(
            (half.cover.chosen.clone(), half.cover.at_least, half.n_for_all),
            (vec![0], 1, 2)
        );
        assert_eq!(half.facts(0).least_stick_out_mm, Some(2.0));
        for bad in [0.0, 1.1, f64::NAN] {
            assert!(new(bad).is_err());
        }
        let folder = tempfile::tempdir().unwrap();
        for path in library.write(folder.path(), Unit::Millimeter).unwrap() {
            assert!(std::fs::metadata(path).unwrap().len() > 100);
        }
    }
}
