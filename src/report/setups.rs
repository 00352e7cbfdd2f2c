//! What few setups cover of one part: tables, colored points and pictures of each, tabs of a page.

mod angles;
mod held;

pub use held::Held;

use super::coverage::{NO_TOOL, groups_called};
use super::folder::{Show, Shown, Writer};
use super::page::View;
use super::points::PointValues;
use super::{Class, Coloring, PartView, Rgb};
use crate::Result;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::findings::Findings;
use crate::findings::gate::SiteAreas;
use crate::geom::units::Unit;
use crate::geom::{Mesh, Sites, formats};
use crate::planning::setups::{Machine, Plan, Setup, direction_words};
use crate::render::outlines::outlines;
use crate::storage::atomic_file;
use crate::tables::{Cell, Table};
use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Chosen setups of a part, with what names them.
#[derive(Debug, PartialEq)]
pub struct Setups {
    plan: Plan,
    machine: Machine,
    tools: Vec<String>,
    areas: SiteAreas,
    /// Of each setup: number and orientation.
    names: Vec<String>,
    /// Of each setup, or empty.
    held: Vec<Held>,
}

/// What the colors of one setup say.
const ONE_SETUP: [Class<'static>; 4] = [
    Class { name: "added by this setup", color: [0, 158, 115] },
    Class { name: "reached again", color: [205, 208, 212] },
    Class { name: "in another setup", color: [120, 150, 190] },
    Class { name: "in no setup", color: NO_TOOL },
];
/// Setups of which there is a picture and a mesh.
const N_DRAWN: usize = 8;
/// Sites that a further setup would reach.
const LEFT: Rgb = [230, 140, 40];

impl Setups {
    /// Of a plan for a machine; `tools` are the names of the tools that it was made with.
    ///
    /// # Panics
    /// If the plan is about other tools or sites.
    pub fn new(plan: Plan, machine: Machine, tools: Vec<String>, areas: SiteAreas) -> Self {
        assert_eq!(plan.first.len(), areas.shares().len(), "areas of the plan's sites");
        assert!(plan.setups.iter().all(|s| s.by_tool.len() == tools.len()), "a name per tool");
        let name = |(k, setup): (usize, &Setup)| {
            let words = machine.setup_words(setup.direction);
            // Angles are from this turn on.
            let turn = machine.axes().map_or_else(String::new, |_| {
                format!(", {} along x'", direction_words(setup.turn.row(0).as_vec3()))
            });
            format!("{}: {words}{turn}", k + 1)
        };
        let names = plan.setups.iter().enumerate().map(name).collect();
        Setups { plan, machine, tools, areas, names, held: Vec::new() }
    }

    /// With what holds the part in each setup.
    ///
    /// # Panics
    /// If there is not one for each.
    #[must_use]
    pub fn held(self, held: Vec<Held>) -> Self {
        assert_eq!(held.len(), self.plan.setups.len(), "what holds it in every setup");
        Setups { held, ..self }
    }

    /// What holds the part in each setup, or nothing.
    #[cfg(feature = "generate")] // of `analysis`
    pub(crate) fn holders(&self) -> &[Held] {
        &self.held
    }

    /// The chosen setups.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Share of the surface that some candidate reaches.
    pub fn can_be_reached(&self) -> f64 {
        self.areas.share(|i| self.plan.can_be_reached[i])
    }

    /// Share of the surface that the setups reach.
    pub fn reached(&self) -> f64 {
        self.areas.share(|i| self.plan.first[i].is_some())
    }

    /// Number of positions of all setups, if the machine has such.
    pub fn n_positions(&self) -> Option<usize> {
        let of = |setup: &Setup| setup.positions.as_ref().map(|cover| cover.chosen.len());
        self.machine.has_positions().then(|| self.plan.setups.iter().filter_map(of).sum())
    }

    /// What the setups leave, as answers: see `docs/setups.md`.
    pub fn answers(&self) -> SiteAnswers {
        let Plan { first, only_tip, .. } = &self.plan;
        let answer = |i: usize| match (first[i], only_tip[i]) {
            (_, true) => SiteAnswer::TipDoesNotFit,
            (None, false) => SiteAnswer::Inaccessible,
            (Some(_), false) => SiteAnswer::Accessible,
        };
        SiteAnswers::by_mesh((0..first.len()).map(answer).collect())
    }

    /// Whether the strokes of the machine are known.
    fn has_strokes(&self) -> bool {
        self.machine.axes().is_some_and(|axes| axes.strokes_mm() != DVec3::INFINITY)
    }

    /// Share of the surface that a setup does not reach for the strokes of the machine alone.
    fn beyond_strokes(&self, setup: &Setup) -> f64 {
        self.areas.share(|i| setup.beyond_strokes.get(i) == Some(&true))
    }

    /// What the strokes of the machine leave out, a sentence per setup.
    #[cfg(feature = "generate")] // of `analysis`
    pub(crate) fn stroke_notices(&self) -> Vec<String> {
        let Some(axes) = self.machine.axes() else { return Vec::new() };
        let words = [0, 1, 2].map(|k| match axes.strokes_mm()[k] {
            mm if mm.is_finite() => format!("{} {mm} mm", ["x", "y", "z"][k]),
            _ => String::new(),
        });
        let known: Vec<String> = words.into_iter().filter(|words| !words.is_empty()).collect();
        let notice = |(name, setup): (&String, &Setup)| {
            let percent = 100.0 * self.beyond_strokes(setup);
            (percent > 0.0).then(|| {
                format!(
                    "setup {name}: {percent:.2} % of the surface is beyond the strokes of the machine ({}), \
                     with the part in their middle; clamp it again for the rest, or take a machine with longer ones",
                    known.join(", ")
                )
            })
        };
        self.names.iter().zip(&self.plan.setups).filter_map(notice).collect()
    }

    fn mm2(&self, share: f64) -> Cell {
        self.areas.total_mm2().map_or(Cell::Missing, |total| Cell::Number(share * total))
    }

    fn tool_names(&self, setup: &Setup) -> String {
        let names: Vec<&str> = setup.tools.chosen.iter().map(|&t| &*self.tools[t]).collect();
        names.join(" + ")
    }

    /// A row per setup.
    pub fn table(&self) -> Table {
        let positions = if self.machine.has_positions() { "positions" } else { "" };
        let mut columns = vec![
            ("setup", "setup"),
            ("x", ""),
            ("y", ""),
            ("z", ""),
            ("reached", "reached"),
            ("reached_mm2", ""),
            ("adds", "adds"),
            ("adds_mm2", "mm²"),
            ("so_far", "so far"),
            ("positions", positions),
            ("positions_at_least", ""),
            ("tools", "tools"),
        ];
        columns.extend(held::columns(&self.held));
        columns.extend(self.has_strokes().then_some(("beyond_strokes", "beyond strokes")));
        let mut table = Table::new(&columns);
        let mut so_far = 0.0;
        for (k, (name, setup)) in self.names.iter().zip(&self.plan.setups).enumerate() {
            let reached = self.areas.share(|i| setup.reaches[i]);
            so_far += setup.adds;
            let count = |n: fn(&crate::planning::cover::Cover) -> usize| {
                setup.positions.as_ref().map_or(Cell::Missing, |cover| Cell::count(n(cover)))
            };
            let mut row = vec![Cell::text(name)];
            row.extend(setup.direction.to_array().map(|x| Cell::Given(f64::from(x))));
            row.extend([
                Cell::Share(reached),
                self.mm2(reached),
                Cell::Share(setup.adds),
                self.mm2(setup.adds),
                Cell::Share(so_far),
                count(|cover| cover.chosen.len()),
                count(|cover| cover.at_least),
                Cell::Text(self.tool_names(setup)),
            ]);
            row.extend(held::cells(self.held.get(k)));
            row.extend(self.has_strokes().then(|| Cell::Share(self.beyond_strokes(setup))));
            table.row(row);
        }
        table
    }

    /// A row per position of every setup, or of one.
    pub fn positions(&self, of: Option<usize>) -> Table {
        let setup = if of.is_none() { "setup" } else { "" };
        let mut columns = vec![
            ("setup", setup),
            ("position", "position"),
            ("axis", "tool axis"),
            ("x", ""),
            ("y", ""),
            ("z", ""),
            ("degrees", "degrees"),
            ("adds", "adds"),
            ("adds_mm2", "mm²"),
        ];
        columns.extend(angles::columns(&self.machine));
        let mut table = Table::new(&columns);
        for (k, setup) in
            self.plan.setups.iter().enumerate().filter(|(k, _)| of.is_none_or(|s| s == *k))
        {
            let Some(cover) = &setup.positions else { continue };
            for (number, (&axis, adds)) in (1..).zip(cover.chosen.iter().zip(&cover.adds)) {
                let axis = setup.axes[axis];
                let mut row = vec![Cell::text(&self.names[k]), Cell::count(number)];
                row.push(Cell::Text(direction_words(axis)));
                row.extend(axis.to_array().map(|x| Cell::Given(f64::from(x))));
                row.extend([
                    Cell::Number(self.degrees(setup, axis)),
                    Cell::Share(*adds),
                    self.mm2(*adds),
                ]);
                row.extend(angles::cells(&self.machine, setup.turn * axis.as_dvec3()));
                table.row(row);
            }
        }
        table
    }

    /// Tilt from z', or angle about the rotary axis from z' on.
    fn degrees(&self, setup: &Setup, axis: glam::Vec3) -> f64 {
        let local = setup.turn * axis.as_dvec3();
        let radians = match self.machine.tilt_rad() {
            Some(_) => libm::atan2(local.truncate().length(), local.z),
            None => libm::atan2(-local.y, local.z).rem_euclid(std::f64::consts::TAU),
        };
        (1e3 * radians.to_degrees()).round() / 1e3 % 360.0
    }

    /// A row per setup and tool, or those of one setup.
    pub fn tools(&self, of: Option<usize>) -> Table {
        let setup = if of.is_none() { "setup" } else { "" };
        let mut table = Table::new(&[
            ("setup", setup),
            ("tool", "tool"),
            ("reached", "reached"),
            ("reached_mm2", "mm²"),
            ("needed", "needed"),
        ]);
        for (k, setup) in
            self.plan.setups.iter().enumerate().filter(|(k, _)| of.is_none_or(|s| s == *k))
        {
            for (t, tool) in self.tools.iter().enumerate() {
                let reached = self.areas.share(|i| setup.by_tool[t][i]);
                let needed = if setup.tools.chosen.contains(&t) { "yes" } else { "" };
                let name = Cell::text(&self.names[k]);
                let cells = [Cell::text(tool), Cell::Share(reached), self.mm2(reached)];
                table.row([vec![name], cells.into(), vec![Cell::text(needed)]].concat());
            }
        }
        table
    }

    /// The setups for programs: the rows of [`Setups::table`] with turn, tools and positions.
    pub fn json(&self) -> Value {
        let mut rows = self.table().json();
        for (k, setup) in self.plan.setups.iter().enumerate() {
            let row = |r: usize| setup.turn.row(r).to_array();
            rows[k]["turn"] = json!([row(0), row(1), row(2)]);
            rows[k]["tools"] = self.tools(Some(k)).json();
            rows[k]["positions"] = match setup.positions {
                Some(_) => self.positions(Some(k)).json(),
                None => Value::Null,
            };
        }
        rows
    }

    /// Writes every file but the page and the findings, tables with lengths and areas in `unit`; returns their paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    pub fn write(
        &self,
        folder: &Path,
        part: PartView,
        show: Show,
        unit: Unit,
    ) -> Result<Vec<PathBuf>> {
        let mut tables = vec![("setups.csv", self.table()), ("setup-tools.csv", self.tools(None))];
        if self.machine.has_positions() {
            tables.push(("positions.csv", self.positions(None)));
        }
        let mut paths = Vec::new();
        for (name, table) in tables {
            let path = folder.join(name);
            atomic_file::write_atomic(&path, |file| file.write_all(&table.csv_in(unit)))?;
            paths.push(path);
        }
        let (classes, of) = self.groups();
        let numbers: Vec<u32> =
            self.plan.first.iter().map(|f| f.map_or(0, |k| k as u32 + 1)).collect();
        let can: Vec<bool> = self.plan.can_be_reached.clone();
        let shown = Shown {
            caption: &format!("first setup that reaches\n{}", self.machine),
            coloring: Coloring::Groups { classes: &classes, of: &of, areas: self.areas.shares() },
            values: &[
                ("setup", PointValues::Counts(&numbers)),
                ("can_be_reached", PointValues::Flags(&can)),
            ],
            notes: &["setup: row of setups.csv from 1, 0: none of them reaches the site".into()],
        };
        paths.extend(Writer { folder, part, show }.write("setups", &shown)?);
        for k in 0..self.plan.setups.len() {
            let show = if k < N_DRAWN { show } else { Show::Points };
            paths.extend(self.write_one(k, folder, part, show)?);
        }
        Ok(paths)
    }

    /// The files of one setup, turned as it is clamped.
    fn write_one(
        &self,
        k: usize,
        folder: &Path,
        part: PartView,
        show: Show,
    ) -> Result<Vec<PathBuf>> {
        let turn = self.plan.setups[k].turn;
        let sites = turned_sites(part.sites, turn);
        let mesh = part.mesh.map(|mesh| turned_mesh(mesh, turn));
        let name = format!("setup-{}", k + 1);
        let of = self.groups_of(k);
        let flags = |class: usize| of.iter().map(|o| *o == class).collect::<Vec<bool>>();
        let (adds, reaches) = (flags(0), &self.plan.setups[k].reaches);
        let row = |r: usize| turn.row(r).to_string();
        let shown = Shown {
            caption: &format!("setup {}\n{}", self.names[k], self.machine),
            coloring: Coloring::Groups { classes: &ONE_SETUP, of: &of, areas: self.areas.shares() },
            values: &[
                ("adds", PointValues::Flags(&adds)),
                ("reaches", PointValues::Flags(reaches)),
            ],
            notes: &[format!(
                "turned: x', y', z' of the machine are {}, {}, {}",
                row(0),
                row(1),
                row(2)
            )],
        };
        let around = self.held.get(k).and_then(|held| held.body(turn));
        let segments = around.as_ref().zip(mesh.as_ref());
        let outlines = segments.map_or_else(Vec::new, |(around, part)| outlines(around, part));
        let part = PartView { mesh: mesh.as_ref(), sites: &sites, outlines: &outlines, ..part };
        let mut paths = Writer { folder, part, show }.write(&name, &shown)?;
        if let Some(mesh) = mesh.as_ref().filter(|_| k < N_DRAWN) {
            let path = folder.join(format!("{name}.stl"));
            formats::write_stl(&path, mesh)?;
            paths.push(path);
            if let Some(around) = &around {
                let path = folder.join(format!("{name}-fixtures.stl"));
                formats::write_stl(&path, around)?;
                paths.push(path);
            }
        }
        Ok(paths)
    }

    /// The tabs of a page: all setups, then each.
    pub fn views(&self, findings: Findings, settings: &Value) -> Vec<View> {
        let (classes, of) = self.groups();
        let all = View::of_groups("all setups", "first setup that reaches", &classes, &of);
        let tool = self.tools.join(", ");
        let tables = vec![("Setups".to_string(), self.table())];
        let settings = settings.clone();
        let mut views = vec![View { tool, tables, settings, findings: Some(findings), ..all }];
        for (k, name) in self.names.iter().enumerate() {
            let caption = format!("what this setup adds on a machine {}", self.machine);
            let view = View::of_groups(name, caption, &ONE_SETUP, &self.groups_of(k));
            let mut tables = vec![("Tools".to_string(), self.tools(Some(k)))];
            if self.machine.has_positions() {
                tables.push(("Positions".into(), self.positions(Some(k))));
            }
            views.push(View { tables, ..view });
        }
        views
    }

    /// Groups for the colors of all setups.
    fn groups(&self) -> (Vec<Class<'_>>, Vec<usize>) {
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let words = ["further setups", "in no setup"];
        let (mut classes, mut of) = groups_called(&names, &self.plan.first, words);
        let is_left = |i: usize| self.plan.first[i].is_none() && self.plan.can_be_reached[i];
        if (0..of.len()).any(is_left) {
            (0..of.len()).filter(|&i| is_left(i)).for_each(|i| of[i] = classes.len());
            classes.push(Class { name: "left to more setups", color: LEFT });
        }
        (classes, of)
    }

    /// The group of each site in [`ONE_SETUP`].
    fn groups_of(&self, k: usize) -> Vec<usize> {
        let group = |(first, reaches): (&Option<usize>, &bool)| match (first, reaches) {
            (Some(first), _) if *first == k => 0,
            (_, true) => 1,
            (Some(_), false) => 2,
            (None, false) => 3,
        };
        self.plan.first.iter().zip(&self.plan.setups[k].reaches).map(group).collect()
    }
}

fn turned_sites(sites: &Sites, turn: DMat3) -> Sites {
    let turned = |v: &glam::Vec3| (turn * v.as_dvec3()).as_vec3();
    Sites {
        points: sites.points.iter().map(turned).collect(),
        normals: sites.normals.iter().map(turned).collect(),
        faces: sites.faces.clone(),
    }
}

fn turned_mesh(mesh: &Mesh, turn: DMat3) -> Mesh {
    Mesh {
        vertices: mesh.vertices.iter().map(|v| turn * *v).collect(),
        triangles: mesh.triangles.clone(),
    }
}
