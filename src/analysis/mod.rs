//! From a part and its tools to a folder of results: what the commands do, for programs.
//!
//! [`Analysis`] is the request: a part, tools, and options. [`Analysis::place`] places the sites, [`Placed::label`]
//! computes their answers, [`Analysis::run`] does both. An [`Outcome`] holds every answer once, with what follows from
//! it: findings, coverage, warnings. [`Outcome::write`] writes the folder that `deepmill label` writes.
//!
//! [`Placed::reach`] compares the tools of a library, [`Placed::plan`] finds few setups, [`Placed::predict`] has a
//! network answer, [`Analysis::volume`] labels the space around the part.
//!
//! An [`Observer`] hears how far the work is and may stop it.
//!
//! ```
//! use deepmill::analysis::Analysis;
//! use deepmill::data::files::tools::Tool;
//! use deepmill::geom::solids;
//! use deepmill::glam::DVec3;
//!
//! let part = solids::cuboid(DVec3::new(40.0, 30.0, 20.0)); // or geom::formats::read_part
//! let tool = Tool::new("3,20,20,20".parse()?, Some(0.0), 0.0)?; // a flat end of 6 mm
//! let outcome = Analysis::new("block", part, vec![tool])
//!     .n_sites(500)
//!     .directions("up".parse()?)
//!     .run(&mut ())?; // nobody watches
//! let share = outcome.areas()?.share(|i| outcome.accessible()[0][i]); // of the surface
//! assert!((share - 0.77).abs() < 0.01); // all but the underside
//! # Ok::<(), deepmill::Error>(())
//! ```

mod baseline;
mod clamping;
mod findings;
mod fixtures;
mod label;
mod machined;
mod matrix;
mod observer;
mod outcome;
mod placed;
mod predictions;
mod record;
mod region;
mod request;
mod setups;
mod thin;
mod tools;
mod volume;
mod write;

#[doc(hidden)] // of the program
pub use clamping::Vise;
#[doc(hidden)] // of the program
pub use findings::{N_SHOWN, findings_of_tools};
pub use fixtures::Fixture;
#[doc(hidden)] // of the program
pub use fixtures::KeptOut;
#[doc(hidden)] // of the program
pub use machined::{MachinedOutcome, Stock};
#[doc(hidden)] // of the program
pub use matrix::{PerDirection, PerDirectionFacts};
pub use observer::{Observer, Progress, Stage};
pub use outcome::{Outcome, ToolOutcome};
pub use placed::Placed;
#[doc(hidden)] // of the program
pub use predictions::known_to_networks;
pub use predictions::{PredictRequest, PredictionsOutcome, ToolPrediction};
#[doc(hidden)] // of the program
pub use region::{selector, take_region};
pub use setups::{SetupRequest, SetupsOutcome};
#[doc(hidden)] // of the program
pub use thin::{ThinWall, ThinWalls};
pub use tools::ToolsOutcome;
pub use volume::VolumeOutcome;
pub use write::Files;

use crate::Result;
use crate::access::LabelOptions;
use crate::access::surface::SurfaceOptions;
use crate::data::files::settings::Blocking;
use crate::data::files::tools::Tool;
use crate::geom::file_vertices::FileVertices;
use crate::geom::formats::MeshOrCloud;
use crate::geom::selection::Selection;
use crate::geom::sites::{SiteOptions, VertexNormals};
use crate::tool::directions::Directions;
use glam::DVec3;
use request::{Placement, Region, Request};

/// What is requested of a part.
///
/// Beside a wall of 20 mm, a tool whose holder begins at 10 mm and one whose holder begins at 30 mm:
///
/// ```
/// use deepmill::analysis::Analysis;
/// use deepmill::data::files::tools::Tool;
/// use deepmill::{geom::solids, glam::dvec2};
///
/// let outline = [(0., 0.), (40., 0.), (40., 10.), (20., 10.), (20., 30.), (0., 30.)].map(|(x, y)| dvec2(x, y));
/// let part = solids::prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 30.0);
/// let tool = |lengths: &str| Tool::new(lengths.parse()?, Some(0.0), 0.0); // CR, CH, FR, FH of a flat end
/// let tools = vec![tool("3,4,20,20")?, tool("3,24,20,20")?];
/// let directions = "list:0,1,0".parse()?; // along y
/// let outcome = Analysis::new("step", part, tools).n_sites(400).directions(directions).run(&mut ())?;
/// let (sites, accessible) = (outcome.sites(), outcome.accessible());
/// let floor = |i: &usize| sites.normals[*i].y > 0.5 && sites.points[*i].y < 20.0;
/// for i in (0..sites.len()).filter(floor) {
///     // The holder is 20 mm from its axis to the wall at x = 20; the rim touches up to 3 mm off the axis.
///     assert_eq!(accessible[0][i], sites.points[i].x > 20.0 + 20.0 - 3.0);
///     assert!(accessible[1][i]);
/// }
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Analysis {
    request: Request,
    shape: MeshOrCloud,
    /// Those of the part's file.
    file_vertices: Option<FileVertices>,
    /// Of the request's region.
    selection: Option<Selection>,
    directions: Option<Directions>,
}

impl Analysis {
    /// A part, with a name for files and titles, and the tools that are to mill it: 7,000 sites, answered by the mesh
    /// definition, or for a cloud by the published one. Lengths are mm.
    ///
    /// Several tools get a folder each ([`Outcome::write`]).
    pub fn new(part: impl Into<String>, shape: impl Into<MeshOrCloud>, tools: Vec<Tool>) -> Self {
        let shape = shape.into();
        let request = Request {
            part: part.into(),
            is_cloud: matches!(shape, MeshOrCloud::Cloud(_)),
            origin: None,
            has_folders: tools.len() > 1,
            is_library: false,
            tools,
            sites: Placement::Spread(SiteOptions::default()),
            region: None,
            obstacles: None,
            fixtures: Vec::new(),
            table_z_mm: None,
            prove: false,
            rest: false,
            options: SurfaceOptions { occlusion: false, ..SurfaceOptions::default() },
            published: LabelOptions::published(),
        };
        Analysis { request, shape, file_vertices: None, selection: None, directions: None }
    }

    /// Spreads about so many sites over a mesh.
    #[must_use]
    pub fn n_sites(self, n_sites: usize) -> Self {
        self.spread(SiteOptions { n_sites, ..SiteOptions::default() })
    }

    /// Spreads sites over a mesh; a cloud is taken as it is.
    #[must_use]
    pub fn spread(mut self, options: SiteOptions) -> Self {
        self.request.sites = Placement::Spread(options);
        self
    }

    /// Takes the corners of a mesh as its sites.
    #[must_use]
    pub fn at_vertices(mut self, seed_of_further_obstacles: u64) -> Self {
        let normals = VertexNormals::default();
        self.request.sites = Placement::Vertices { seed: seed_of_further_obstacles, normals };
        self
    }

    /// How faces weigh in the normals of sites at vertices.
    #[doc(hidden)] // of the program
    #[must_use]
    pub fn vertex_normals(mut self, weights: VertexNormals) -> Self {
        if let Placement::Vertices { normals, .. } = &mut self.request.sites {
            *normals = weights;
        }
        self
    }

    /// The vertices of the part's file: sites at vertices come in their order, and results name them.
    #[doc(hidden)] // of the program
    #[must_use]
    pub fn file_vertices(mut self, vertices: Option<FileVertices>) -> Self {
        self.file_vertices = vertices;
        self
    }

    /// Answers for a region of the part only; all of it blocks. `only` and `except` name its parts in files.
    #[must_use]
    pub fn region(mut self, selection: Selection, only: Vec<String>, except: Vec<String>) -> Self {
        self.request.region = Some(Region { only, except });
        self.selection = Some(selection);
        self
    }

    /// The directions tested; by default 150 over the upper half, of the published definition those published.
    #[must_use]
    pub fn directions(mut self, directions: Directions) -> Self {
        self.directions = Some(directions);
        self
    }

    /// What blocks; by default the triangles of a mesh, the points of a cloud.
    #[must_use]
    pub fn obstacles(mut self, blocking: Blocking) -> Self {
        self.request.obstacles = Some(blocking);
        self
    }

    /// A mesh that blocks too, by the mesh definition, in the part's coordinates; its name is for findings.
    #[must_use]
    pub fn fixture(mut self, fixture: Fixture) -> Self {
        self.request.fixtures.push(fixture);
        self
    }

    /// A table at this height, which blocks too, by the mesh definition.
    #[must_use]
    pub fn table(mut self, z_mm: f64) -> Self {
        self.request.table_z_mm = Some(z_mm);
        self
    }

    /// Options of the mesh definition: tolerances, search between the directions, occlusion, clearances.
    #[must_use]
    pub fn options(mut self, options: SurfaceOptions) -> Self {
        self.request.options = options;
        self
    }

    /// The options are those of proofs ([`RefinementOptions::proving`](crate::access::surface::RefinementOptions)).
    #[must_use]
    pub fn proving(mut self, prove: bool) -> Self {
        self.request.prove = prove;
        self
    }

    /// Whether to compute how much each tool leaves where it does not reach, by the mesh definition: see
    /// `docs/rest.md`.
    #[must_use]
    pub fn rest(mut self, rest: bool) -> Self {
        self.request.rest = rest;
        self
    }

    /// Options of the published definition: bottom rule, rounding, share, engine.
    #[must_use]
    pub fn published(mut self, options: LabelOptions) -> Self {
        self.request.published = options;
        self
    }

    /// Whether the tools are those that there are: proposals then change nothing but their stick-out.
    #[must_use]
    pub fn library(mut self, is_library: bool) -> Self {
        self.request.is_library = is_library;
        self
    }

    /// Gives each tool a folder of its own, even if it is one only.
    #[must_use]
    pub fn folders(mut self, has_folders: bool) -> Self {
        self.request.has_folders = has_folders;
        self
    }

    /// The origin of the part's coordinates in those of its file, mm, for files.
    #[must_use]
    pub fn origin(mut self, origin: Option<DVec3>) -> Self {
        self.request.origin = origin;
        self
    }

    /// [`Analysis::place`], then [`Placed::label`].
    ///
    /// # Errors
    /// As these.
    pub fn run(self, observer: &mut dyn Observer) -> Result<Outcome> {
        self.place(observer)?.label(observer)
    }
}
