//! What tools leave of a stock: the machined part.

use super::Analysis;
use super::fixtures::Fixture;
use super::observer::{Observer, Stage, report};
use super::placed::{or_usual, without_area};
use super::request::Request;
use super::setups::SetupRequest;
use super::write::Files;
use crate::access::surface::{Job, Machined, RestBody, TriangleObstacles};
use crate::data::files::settings::Blocking;
use crate::data::files::tools::Tool;
use crate::geom::formats::{self, MeshOrCloud};
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::{Mesh, bodies, inside};
use crate::planning::setups::Setup;
use crate::report::{Class, Coloring, PartView, picture};
use crate::storage::atomic_file;
use crate::tables::{Cell, Table};
use crate::tool::cutter::{Cutter, Profile};
use crate::tool::directions::{DirectionSet, Directions};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What a part is milled from.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of the program
pub enum Stock {
    /// The part's box with so much more on every side, mm.
    Box(f64),
    /// A closed body about the part, in its coordinates.
    Body(Mesh),
}

/// What tools leave of a stock.
#[derive(Debug)]
#[doc(hidden)] // of the program
pub struct MachinedOutcome {
    part: String,
    tools: Vec<Tool>,
    machined: Machined,
    mesh: Mesh,
    own: Mesh,
    accuracy_mm: f64,
    stock_mm3: f64,
    n_directions: usize,
    /// In order; none if all directions are of one clamping.
    setups: Vec<String>,
    warnings: Vec<String>,
    notices: Vec<String>,
    seconds: [f64; 2],
}

impl Analysis {
    /// What the tools together leave of a stock, with an accuracy of so many mm (by default a hundredth of the part's
    /// longest side, at most 0.1 mm, but no finer than a 400th of that side): the least set that no tool removes
    /// without meeting the part or the set itself with what does not cut. With a request for setups, one after the
    /// other, each with its tool axes, and what the later ones remove is in the way before. See `docs/rest.md`.
    ///
    /// # Errors
    /// If the part is no closed mesh, the stock does not contain it, there are no tools but drills, one is too thin for
    /// the accuracy, there are both fixtures and setups, the lattice would not fit into the memory, or the observer
    /// stops it.
    #[doc(hidden)] // of the program
    pub fn machine(
        self,
        stock: &Stock,
        accuracy_mm: Option<f64>,
        setups: Option<SetupRequest>,
        observer: &mut dyn Observer,
    ) -> Result<MachinedOutcome> {
        self.request.options.check()?;
        let is_clamped = !self.request.fixtures.is_empty() || self.request.table_z_mm.is_some();
        for (name, is_given, remedy) in [
            (
                "fixtures",
                is_clamped,
                "leave fixtures and table out: those of setups are not modelled",
            ),
            ("directions", self.directions.is_some(), "leave them out: a machine has its own"),
        ] {
            if setups.is_some() && is_given {
                return Err(Error::argument(name, "some", "none beside setups", remedy));
            }
        }
        let planned = setups.map(|request| self.clone().setups_of(request, observer));
        let Analysis { request, shape, directions, .. } = self;
        let Request { part: name, mut tools, fixtures, table_z_mm, mut options, .. } = request;
        let MeshOrCloud::Mesh(part) = shape else {
            let remedy = "give a mesh: of a cloud it is unknown what is inside";
            return Err(Error::argument("part", name, "a mesh", remedy));
        };
        let is_drill = |tool: &Tool| tool.cutter.profile().is_some_and(Profile::is_drill);
        let drills = tools.extract_if(.., |tool| is_drill(tool)).map(|tool| tool.name);
        let drills: Vec<String> = drills.collect();
        if tools.is_empty() {
            let found = if drills.is_empty() { "none".into() } else { drills.join(", ") };
            let remedy = "name a tool that mills: drills and reamers are left out";
            return Err(Error::argument("tools", found, "one or more", remedy));
        }
        let (names, setups) = match planned.transpose()? {
            None => (Vec::new(), vec![or_usual(directions, Blocking::Part)?]),
            Some(planned) => planned.into_iter().unzip(),
        };
        if !names.is_empty() {
            // A machine has the axes that it has.
            options.refinement = None;
        }
        let (low, high) = part.bounds().unwrap_or_default();
        let longest = (high - low).max_element();
        let accuracy_mm = accuracy_mm.unwrap_or((0.01 * longest).min(0.1).max(longest / 400.0));
        let (stock_box, stock, stock_mm3) = match stock {
            Stock::Box(more) => {
                if !(0.0..=longest.max(100.0)).contains(more) {
                    let expected = format!("0 to {} mm", longest.max(100.0));
                    let remedy = "give how much more there is on every side, in mm";
                    return Err(Error::argument("stock", more, expected, remedy));
                }
                let stock = [low - *more, high + *more];
                (stock, None, (stock[1] - stock[0]).element_product())
            }
            Stock::Body(mesh) => {
                require_around(mesh, &part, accuracy_mm)?;
                let (low, high) = mesh.bounds().unwrap_or_default();
                ([low, high], Some(mesh), mesh.volume())
            }
        };
        let start = Instant::now();
        let (fixtures, warnings) = Fixture::around(&part, fixtures, table_z_mm)?;
        let meshes: Vec<Mesh> = fixtures.iter().map(|fixture| fixture.mesh.clone()).collect();
        let obstacles = TriangleObstacles::new(&part, &meshes)?;
        let cutters: Vec<&Cutter> = tools.iter().map(|tool| &tool.cutter).collect();
        let job = Job { part: &part, stock_box, stock, accuracy_mm };
        let mut done = |done: usize, of: usize| report(observer, Stage::Machining, (done, of));
        let machined = obstacles.machine(&job, &cutters, &setups, &options, &mut done)?;
        let machined_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let rest = all_of(&machined.bodies);
        let mut notices: Vec<String> = without_area(&obstacles).into_iter().collect();
        if !drills.is_empty() {
            let names = drills.join(", ");
            notices
                .push(format!("left out: {names}: what drills and reamers remove is not computed"));
        }
        let mut mesh = part.clone();
        if !machined.bodies.is_empty() {
            match bodies::union(&part, &rest) {
                Some(joined) => mesh = joined,
                None => append(&mut mesh, &rest),
            }
            // Crumbs are where the bodies' skin pokes through the part's surface, or leaves it.
            let (least_mm3, most_mm) = (CRUMB * accuracy_mm.powi(3), SETTLED * accuracy_mm);
            if !bodies::settle(&mut mesh, least_mm3, most_mm) {
                notices.push(NOT_SOLID.into());
            }
        }
        Ok(MachinedOutcome {
            part: name,
            tools,
            machined,
            mesh,
            own: part,
            accuracy_mm,
            stock_mm3,
            n_directions: setups.iter().map(Directions::len).sum(),
            setups: names,
            warnings,
            notices,
            seconds: [machined_s, start.elapsed().as_secs_f64()],
        })
    }

    /// The setups of a machine in words, and the tool axes of each.
    fn setups_of(
        self,
        request: SetupRequest,
        observer: &mut dyn Observer,
    ) -> Result<Vec<(String, Directions)>> {
        let outcome = self.place(observer)?.plan(request, observer)?;
        let machine = outcome.candidates().machine();
        let setups = outcome.setups().plan().setups.iter();
        let vectors = |axes: &[Vec3]| axes.iter().map(|axis| axis.as_dvec3().to_array()).collect();
        let of = |setup: &Setup| {
            Ok((
                machine.setup_words(setup.direction),
                Directions::new(DirectionSet::List { vectors: vectors(&setup.axes) })?,
            ))
        };
        setups.map(of).collect()
    }
}

/// Passes a stock that contains a part but for the accuracy.
fn require_around(stock: &Mesh, part: &Mesh, accuracy_mm: f64) -> Result<()> {
    let windings = inside::windings(stock, &part.vertices)?;
    let surface = TriangleObstacles::new(stock, &[])?;
    let far = |p: &DVec3| surface.distance_to(*p);
    let outside = part.vertices.iter().zip(windings).filter(|(_, winding)| *winding == 0);
    let outside: Vec<f64> = outside.map(|(p, _)| far(p)).filter(|d| *d > accuracy_mm).collect();
    let Some(most) = outside.iter().copied().reduce(f64::max) else { return Ok(()) };
    let found = format!(
        "{} of {} corners of the part are outside of it, up to {most:.3} mm",
        outside.len(),
        part.vertices.len()
    );
    let remedy = "move it about the part, or give box:MM";
    Err(Error::argument("stock", found, "a body that contains the part", remedy))
}

/// The surfaces of all bodies.
fn all_of(bodies: &[RestBody]) -> Mesh {
    let mut all = Mesh::default();
    bodies.iter().for_each(|body| append(&mut all, &body.mesh));
    all
}

fn append(to: &mut Mesh, other: &Mesh) {
    let first = to.vertices.len() as u32;
    to.vertices.extend(&other.vertices);
    to.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
}

/// Least volume of a piece of the joined surface, in cubes of the accuracy.
const CRUMB: f64 = 30.0;
/// How far the joined surface may move to lose triangles that are too small for a file, as a share of the accuracy.
const SETTLED: f64 = 0.25;
const NOT_SOLID: &str =
    "machined.stl bounds no solid when it is read again: choose another accuracy";
/// Colors of the picture: the part's own surface, and what is left.
const CLASSES: [Class<'static>; 2] = [
    Class { name: "the part", color: [205, 208, 212] },
    Class { name: "left by the tools", color: [205, 66, 66] },
];
/// Sites of the picture.
const N_SITES: usize = 20_000;

impl MachinedOutcome {
    /// Name of the part.
    pub fn part(&self) -> &str {
        &self.part
    }

    /// The tools.
    pub fn tools(&self) -> &[Tool] {
        &self.tools
    }

    /// The part with all that is left: its own mesh where nothing is.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Step of the lattice, mm.
    pub fn accuracy_mm(&self) -> f64 {
        self.accuracy_mm
    }

    /// Number of directions.
    pub fn n_directions(&self) -> usize {
        self.n_directions
    }

    /// Volume of the stock without the part, mm³.
    pub fn to_remove_mm3(&self) -> f64 {
        (self.stock_mm3 - self.own.volume()).max(0.0)
    }

    /// Volume that is left, mm³.
    pub fn left_mm3(&self) -> f64 {
        // Never minus zero.
        self.machined.bodies.iter().map(|body| body.volume_mm3).sum::<f64>() + 0.0
    }

    /// How often what is left was an obstacle itself.
    pub fn n_rounds(&self) -> usize {
        self.machined.n_rounds
    }

    /// Number of bodies that are left.
    pub fn n_bodies(&self) -> usize {
        self.machined.bodies.len()
    }

    /// What is wrong with fixtures and table, a sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What was left out, a sentence each.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Seconds of computing what is left, and of joining it with the part.
    pub fn seconds(&self) -> [f64; 2] {
        self.seconds
    }

    /// A row per tool, of every setup if there are setups: what is left after it and those before it; without setups
    /// also what it leaves alone.
    pub fn table(&self) -> Table {
        let Machined { alone_mm3, after_mm3, .. } = &self.machined;
        let (tool, after) = (("tool", "tool"), ("after_mm3", "left after it, mm³"));
        if self.setups.is_empty() {
            let mut table = Table::new(&[tool, ("alone_mm3", "left by it alone, mm³"), after]);
            let after = after_mm3.iter().flatten();
            for ((tool, alone), after) in self.tools.iter().zip(alone_mm3).zip(after) {
                table.row([Cell::text(&tool.name), Cell::Number(*alone), Cell::Number(*after)]);
            }
            return table;
        }
        let mut table = Table::new(&[("setup", "setup"), tool, after]);
        for ((k, words), of_setup) in (1..).zip(&self.setups).zip(after_mm3) {
            for (tool, after) in self.tools.iter().zip(of_setup) {
                let setup = Cell::text(format!("{k}: {words}"));
                table.row([setup, Cell::text(&tool.name), Cell::Number(*after)]);
            }
        }
        table
    }

    /// The setups in words, in their order; none without a request for setups.
    pub fn setups(&self) -> &[String] {
        &self.setups
    }

    /// A row per body that is left, the largest first.
    pub fn bodies_table(&self) -> Table {
        let mut table = Table::new(&[
            ("body", "body"),
            ("volume_mm3", "volume, mm³"),
            ("x_mm", "x, mm"),
            ("y_mm", "y"),
            ("z_mm", "z"),
        ]);
        for (number, RestBody { volume_mm3, at_mm, .. }) in (1..).zip(&self.machined.bodies) {
            let mut row = vec![Cell::count(number), Cell::Number(*volume_mm3)];
            row.extend(at_mm.to_array().map(Cell::Number));
            table.row(row);
        }
        table
    }

    /// Writes `machined.stl`, `machined.csv`, and if something is left `rest.stl` and `rest.csv`; if there are
    /// pictures, `machined.png`; returns the paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    pub fn write(&self, folder: &Path, files: &Files) -> Result<Vec<PathBuf>> {
        let mut paths = Vec::new();
        let mut stl = |name: &str, mesh: &Mesh| {
            let path = folder.join(name);
            formats::write_stl(&path, mesh).map(|()| paths.push(path))
        };
        stl("machined.stl", &self.mesh)?;
        if self.n_bodies() > 0 {
            stl("rest.stl", &all_of(&self.machined.bodies))?;
        }
        let tables = [("machined.csv", self.table()), ("rest.csv", self.bodies_table())];
        for (name, table) in tables.into_iter().take(1 + usize::from(self.n_bodies() > 0)) {
            let path = folder.join(name);
            let bytes = table.csv_in(files.unit);
            atomic_file::write_atomic(&path, |file| file.write_all(&bytes))?;
            paths.push(path);
        }
        if files.pictures {
            let path = folder.join("machined.png");
            self.draw(&path)?;
            paths.push(path);
        }
        Ok(paths)
    }

    fn draw(&self, path: &Path) -> Result<()> {
        let sites =
            sample(&self.mesh, &SiteOptions { n_sites: N_SITES, ..SiteOptions::default() })?;
        let own = TriangleObstacles::new(&self.own, &[])?;
        let is_left = |p: &glam::Vec3| own.distance_to(p.as_dvec3()) > 0.1 * self.accuracy_mm;
        let of: Vec<usize> = sites.points.iter().map(|p| usize::from(is_left(p))).collect();
        let words = format!("{} tools, {} directions", self.tools.len(), self.n_directions);
        let cutter = if let [tool] = &self.tools[..] { tool.words() } else { words };
        let part = PartView {
            name: &self.part,
            mesh: Some(&self.mesh),
            sites: &sites,
            cutter: &cutter,
            outlines: &[],
        };
        let caption = format!(
            "the machined part, accuracy {} mm\n{:.1} mm³ left in {} bodies",
            self.accuracy_mm,
            self.left_mm3(),
            self.n_bodies()
        );
        picture::write(
            path,
            &part,
            &caption,
            &Coloring::Groups { classes: &CLASSES, of: &of, areas: &[] },
        )
    }
}
