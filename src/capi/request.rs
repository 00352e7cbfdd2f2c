//! What is requested of a part.

use super::mesh::PartMesh;
use super::results::Results;
use super::status::{Answer, called, number, refused};
use super::tools::ToolList;
use super::work;
use crate::access::LabelOptions;
use crate::access::surface::{ContactTolerance, RefinementOptions, SurfaceOptions};
use crate::analysis::{Analysis, Fixture, Observer};
use crate::data::files::tools::named_apart;
use crate::exec::par;
use crate::geom::origin;
use crate::geom::sites::{Normals, SiteOptions};
use crate::tool::directions::{DirectionSet, Directions};
use glam::DVec3;
use std::sync::Arc;

/// A part, tools and options.
#[derive(Clone)]
pub struct Request {
    mesh: Arc<PartMesh>,
    tools: Arc<ToolList>,
    name: Option<String>,
    sites: SiteOptions,
    at_vertices: bool,
    directions: Option<Directions>,
    fixtures: Vec<(String, Arc<PartMesh>)>,
    table_mm: Option<f64>,
    rest: bool,
    prove: bool,
    options: SurfaceOptions,
    n_threads: usize,
}

impl Request {
    /// With the options of `deepmill label`.
    pub fn new(mesh: Arc<PartMesh>, tools: Arc<ToolList>) -> Answer<Self> {
        if tools.tools.is_empty() {
            let remedy = "add one by dm_tools_add_ball_end, for example";
            return Err(refused("tools", "an empty list", "one tool or more", remedy));
        }
        let mut list = ToolList::clone(&tools);
        list.tools = named_apart(list.tools)?;
        Ok(Request {
            mesh,
            tools: Arc::new(list),
            name: None,
            sites: SiteOptions::default(),
            at_vertices: false,
            directions: None,
            fixtures: Vec::new(),
            table_mm: None,
            rest: false,
            prove: false,
            options: SurfaceOptions { occlusion: false, ..SurfaceOptions::default() },
            n_threads: 0,
        })
    }

    /// The name of the part for files and titles.
    pub fn set_name(&mut self, name: &str) -> Answer<()> {
        self.name = Some(name.to_owned());
        Ok(())
    }

    /// About so many sites over the surface.
    pub fn set_sites(&mut self, n_sites: usize, seed: u64) -> Answer<()> {
        if n_sites < 2 {
            return Err(refused("n_sites", n_sites, "2 or more", "7000 suits most parts"));
        }
        self.sites = SiteOptions { n_sites, seed, ..self.sites };
        self.at_vertices = false;
        Ok(())
    }

    /// The corners of the mesh as sites.
    pub fn set_sites_at_vertices(&mut self) -> Answer<()> {
        self.at_vertices = true;
        Ok(())
    }

    /// Normals are smooth across edges that are folded by less.
    pub fn set_smooth(&mut self, degrees: f64) -> Answer<()> {
        if !(0.0..=180.0).contains(&degrees) {
            let expected = "an angle from 0 to 180 degrees";
            return Err(refused("degrees", degrees, expected, "30 suits most parts"));
        }
        self.sites.normals = Normals::Smooth { crease_rad: degrees.to_radians() };
        Ok(())
    }

    /// A number of directions over the upper half, or a set in words.
    pub fn set_directions(&mut self, words: &str) -> Answer<()> {
        self.directions = Some(words.parse()?);
        Ok(())
    }

    /// Vectors from tip to spindle.
    pub fn set_direction_vectors(&mut self, vectors: &[[f64; 3]]) -> Answer<()> {
        if vectors.is_empty() {
            return Err(refused("n_vectors", 0, "1 or more", "give at least one direction"));
        }
        let set = DirectionSet::List { vectors: vectors.to_vec() };
        self.directions = Some(Directions::new(set)?);
        Ok(())
    }

    /// Gouge tolerance.
    pub fn set_tolerance(&mut self, mm: f64) -> Answer<()> {
        if !(mm > 0.0 && mm.is_finite()) {
            let remedy = "leave the call out for the tolerance that the facets imply";
            return Err(refused("tolerance_mm", mm, "a positive length in mm", remedy));
        }
        self.checked("tolerance_mm", |options| {
            options.tolerance = ContactTolerance::Millimeters(mm)
        })
    }

    /// How much may remain at a site that counts as reached.
    pub fn set_finish(&mut self, mm: f64) -> Answer<()> {
        let mm = number("finish_mm", mm)?;
        self.checked("finish_mm", |options| options.finish_mm = mm)
    }

    /// How wide the search between the directions is, 0 for none.
    pub fn set_search(&mut self, n_kept: usize) -> Answer<()> {
        self.prove = false;
        let search = RefinementOptions { n_kept, ..RefinementOptions::default() };
        self.checked("n_kept", |options| options.refinement = (n_kept > 0).then_some(search))
    }

    /// A far longer search, for proofs.
    pub fn set_prove(&mut self) -> Answer<()> {
        self.prove = true;
        self.checked("prove", |options| options.refinement = Some(RefinementOptions::proving()))
    }

    /// Marks this share of the sites as most often in the way.
    pub fn set_occlusion(&mut self, share: f64) -> Answer<()> {
        let share = number("share", share)?;
        self.checked("share", |options| (options.occlusion, options.share) = (true, share))
    }

    /// Clearances up to this.
    pub fn set_clearance_limit(&mut self, mm: f64) -> Answer<()> {
        let mm = number("limit_mm", mm)?;
        self.checked("limit_mm", |options| options.clearance_limit_mm = Some(mm))
    }

    /// Whether to compute how much each tool leaves.
    pub fn set_rest(&mut self, rest: bool) -> Answer<()> {
        self.rest = rest;
        Ok(())
    }

    /// A mesh that blocks too.
    pub fn add_fixture(&mut self, mesh: Arc<PartMesh>, name: Option<&str>) -> Answer<()> {
        let name = name.map(str::to_owned).or_else(|| mesh.name.clone());
        let name = name.unwrap_or_else(|| format!("fixture {}", self.fixtures.len() + 1));
        self.fixtures.push((name, mesh));
        Ok(())
    }

    /// A table at a height.
    pub fn set_table(&mut self, z_mm: f64) -> Answer<()> {
        self.table_mm = Some(number("z_mm", z_mm)?);
        Ok(())
    }

    /// The number of threads, 0 for one per logical CPU.
    pub fn set_threads(&mut self, n_threads: usize) -> Answer<()> {
        if n_threads > par::MAX_THREADS {
            let expected = format!("at most {}", par::MAX_THREADS);
            return Err(refused("n_threads", n_threads, expected, "0 is one per processor"));
        }
        self.n_threads = n_threads;
        Ok(())
    }

    /// Changes the options, if the library takes them then.
    fn checked(
        &mut self,
        argument: &'static str,
        change: impl FnOnce(&mut SurfaceOptions),
    ) -> Answer<()> {
        let mut options = self.options;
        change(&mut options);
        options.check().map_err(|error| called(argument, error))?;
        self.options = options;
        Ok(())
    }

    /// The request in the words of the library.
    fn analysis(&self) -> Analysis {
        let PartMesh { mesh, origin, name, .. } = &*self.mesh;
        let name = self.name.as_ref().or(name.as_ref()).map_or("part", |name| name);
        let analysis = Analysis::new(name, mesh.clone(), self.tools.tools.clone())
            .library(self.tools.are_of_files())
            .folders(self.tools.have_folders())
            .origin(*origin)
            .rest(self.rest)
            .published(LabelOptions {
                share: self.options.share,
                clearance_limit_mm: self.options.clearance_limit_mm,
                ..LabelOptions::default()
            })
            .options(self.options)
            .proving(self.prove);
        let analysis = match self.at_vertices {
            true => analysis.at_vertices(self.sites.seed),
            false => analysis.spread(self.sites),
        };
        let analysis = match &self.directions {
            Some(directions) => analysis.directions(directions.clone()),
            None => analysis,
        };
        self.with_fixtures(analysis, origin.unwrap_or_default())
    }

    /// Fixtures and table are in the coordinates of the part as it was given, `about` their new origin.
    fn with_fixtures(&self, analysis: Analysis, about: DVec3) -> Analysis {
        let add = |analysis: Analysis, (name, fixture): &(String, Arc<PartMesh>)| {
            let (mut mesh, from) =
                (fixture.mesh.clone(), about - fixture.origin.unwrap_or_default());
            if from != DVec3::ZERO {
                origin::make_relative(&mut mesh, from);
            }
            analysis.fixture(Fixture::new(name.clone(), mesh))
        };
        let analysis = self.fixtures.iter().fold(analysis, add);
        match self.table_mm {
            Some(z_mm) => analysis.table(z_mm - about.z),
            None => analysis,
        }
    }

    /// Places the sites and labels them.
    pub fn run(&self, observer: &mut dyn Observer) -> Answer<Results> {
        let analysis = self.analysis();
        let (outcome, warnings) = work::run(self.n_threads, observer, move |observer| {
            let placed = analysis.place(observer)?;
            let warnings = placed.warnings().to_vec();
            Ok((placed.label(observer)?, warnings))
        })?;
        let notices = self.mesh.notices.iter().chain(&self.tools.notices).chain(outcome.notices());
        let notices = notices.cloned().collect();
        Ok(Results::new(outcome, warnings, notices))
    }
}
