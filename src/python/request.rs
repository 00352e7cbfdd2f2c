//! What is requested of a part, from keyword arguments.

use super::errors::{checked, refused, wrong_type};
use super::input;
use super::options::{Options, number};
use super::part::{Mesh, Part, placement};
use super::region;
use super::tool::Tools;
use crate::Result;
use crate::access::LabelOptions;
use crate::access::surface::{ContactTolerance, FINISH_MM, RefinementOptions, SurfaceOptions};
use crate::analysis::{Analysis, Fixture, SetupRequest, Vise};
use crate::data::files::settings::Blocking;
use crate::data::files::tools::Tool;
use crate::geom::formats::MeshOrCloud;
use crate::geom::origin;
use glam::DVec3;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// What the answers are for: of each, other options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    Labels,
    Reach,
    Setups,
    Volume,
}

/// What is requested; the options that are left are the caller's.
pub fn analysis(
    part: &Part<'_>,
    tools: &Bound<'_, PyAny>,
    options: &mut Options<'_>,
    purpose: Purpose,
) -> PyResult<Analysis> {
    let (py, tools) = (tools.py(), Tools::of(tools)?);
    let allowance = match purpose {
        Purpose::Volume => None,
        Purpose::Labels | Purpose::Reach | Purpose::Setups => options.number("allowance")?,
    };
    let leaving = |tool: Tool| {
        allowance.map_or_else(|| Ok(tool.clone()), |mm| tool.clone().with_allowance(mm))
    };
    let list = tools.list.into_iter().map(leaving).collect::<Result<Vec<_>>>();
    let list = checked(py, list)?;
    let (name, origin, shape) = match part {
        Part::Mesh(mesh) => {
            let Mesh { mesh, origin, name, .. } = mesh.get();
            (name.clone(), *origin, MeshOrCloud::Mesh(mesh.clone()))
        }
        Part::Cloud(sites) => ("part".into(), None, MeshOrCloud::Cloud((*sites.get().0).clone())),
    };
    let name = options.text("name")?.unwrap_or(name);
    let is_mesh = matches!(shape, MeshOrCloud::Mesh(_));
    let mut analysis = Analysis::new(name, shape, list)
        .library(tools.are_of_files)
        .folders(tools.are_several)
        .origin(origin);
    if purpose != Purpose::Volume {
        analysis = match placement(options)? {
            (Some(sites), _) => analysis.spread(sites),
            (None, seed) => analysis.at_vertices(seed),
        };
    }
    if purpose != Purpose::Volume {
        analysis = region::add_to(analysis, part, options)?;
    }
    let (tolerances, share) = (surface_options(options, purpose)?, occlusion(options, purpose)?);
    let prove = purpose != Purpose::Setups && options.flag("prove")?.unwrap_or(false);
    let mut surface = SurfaceOptions { occlusion: share.is_some(), ..tolerances };
    if prove {
        surface.refinement = Some(RefinementOptions::proving());
    }
    surface.share = share.unwrap_or(LabelOptions::default().share);
    if purpose != Purpose::Setups {
        if let Some(directions) = options.directions()? {
            analysis = analysis.directions(directions);
        }
        analysis = add_fixtures(analysis, origin, options)?;
    }
    if purpose == Purpose::Labels {
        surface.clearance_limit_mm = options.number("clearance_limit")?;
        analysis = analysis.rest(options.flag("rest")?.unwrap_or(false));
        let blocking = options.text("obstacles")?.map(|text| obstacles(py, &text)).transpose()?;
        let by_mesh = is_mesh && blocking.is_none_or(|blocking| blocking == Blocking::Part);
        let base = if by_mesh { LabelOptions::default() } else { LabelOptions::published() };
        analysis = analysis.published(LabelOptions {
            share: surface.share,
            clearance_limit_mm: surface.clearance_limit_mm,
            ..base
        });
        if let Some(blocking) = blocking {
            analysis = analysis.obstacles(blocking);
        }
    }
    Ok(analysis.options(surface).proving(prove))
}

fn obstacles(py: Python<'_>, text: &str) -> PyResult<Blocking> {
    Blocking::try_from(text.to_owned()).map_err(|_| {
        let expected = "part, published, centroids or a number";
        let remedy = "part is the mesh definition, published has sites as obstacles";
        refused(py, "obstacles", format!("`{text}`"), expected, remedy)
    })
}

/// Tolerances, and how the directions between those tested are searched.
fn surface_options(options: &mut Options<'_>, purpose: Purpose) -> PyResult<SurfaceOptions> {
    let tolerance = options.number("tolerance")?;
    let finish_mm = options.number("finish")?.unwrap_or(FINISH_MM);
    let n_kept = match purpose {
        Purpose::Setups => None,
        Purpose::Labels | Purpose::Reach | Purpose::Volume => options.whole::<usize>("search")?,
    };
    let search = RefinementOptions::default();
    let refinement = match n_kept {
        None => Some(search),
        Some(0) => None,
        Some(n_kept) => Some(RefinementOptions { n_kept, ..search }),
    };
    Ok(SurfaceOptions {
        tolerance: tolerance.map_or(ContactTolerance::Tessellation, ContactTolerance::Millimeters),
        finish_mm,
        refinement,
        ..SurfaceOptions::default()
    })
}

/// The share of occlusion points, if they are wanted.
fn occlusion(options: &mut Options<'_>, purpose: Purpose) -> PyResult<Option<f64>> {
    if purpose != Purpose::Labels {
        return Ok(None);
    }
    let wanted = options.flag("occlusion")?;
    let share = options.number("occlusion_share")?;
    Ok(match (wanted, share) {
        (Some(false), _) | (None, None) => None,
        (Some(true), None) => Some(LabelOptions::default().share),
        (_, Some(share)) => Some(share),
    })
}

/// Meshes and a table that block too, in the coordinates of the part as it was given.
fn add_fixtures(
    mut analysis: Analysis,
    origin: Option<DVec3>,
    options: &mut Options<'_>,
) -> PyResult<Analysis> {
    let about = origin.unwrap_or_default();
    if let Some(fixtures) = options.take("fixtures")? {
        const EXPECTED: &str = "a sequence of deepmill.Mesh";
        for (k, item) in items(&fixtures, EXPECTED)?.iter().enumerate() {
            analysis = analysis.fixture(fixture(item, (k, about), EXPECTED)?);
        }
    }
    Ok(match options.number("table")? {
        Some(z_mm) => analysis.table(z_mm - about.z),
        None => analysis,
    })
}

/// Vise, table and fixtures of setups; fixtures are in the coordinates of the part as it was given.
pub fn add_holding(
    (mut analysis, mut request): (Analysis, SetupRequest),
    part: &Part<'_>,
    options: &mut Options<'_>,
) -> PyResult<(Analysis, SetupRequest)> {
    let py = options.py();
    let about = part.mesh_and_origin().and_then(|(_, origin)| origin).unwrap_or_default();
    if let Some(fixtures) = options.take("fixtures")? {
        const EXPECTED: &str =
            "a sequence of deepmill.Mesh, or of pairs of a setup, from 1, and one";
        for (k, item) in items(&fixtures, EXPECTED)?.iter().enumerate() {
            match item.cast::<PyTuple>() {
                Ok(pair) => {
                    let (setup, mesh): (usize, Bound<'_, PyAny>) =
                        pair.extract().map_err(|_| wrong_type("fixtures", item, EXPECTED))?;
                    request = request.fixture_of(setup, fixture(&mesh, (k, about), EXPECTED)?);
                }
                Err(_) => analysis = analysis.fixture(fixture(item, (k, about), EXPECTED)?),
            }
        }
    }
    if let Some(vise) = options.take("vise")? {
        let expected = "jaw width, opening and height, and perhaps parallels, mm";
        request = match input::numbers_of("vise", &vise, (3..=4, expected))?[..] {
            [jaw, opening, height, ref parallels @ ..] => {
                let parallels = parallels.first().copied().unwrap_or(0.0);
                request.vise(checked(py, Vise::new([jaw, opening, height], parallels))?)
            }
            _ => unreachable!("three or four"),
        };
    }
    if let Some(table) = options.take("table")? {
        let expected = "how far below the part, or that and the width, mm";
        request = match number("table", &table) {
            Ok(below_mm) => request.table_below(below_mm, None),
            Err(_) => match input::numbers_of("table", &table, (2..=2, expected))?[..] {
                [below_mm, width_mm] => request.table_below(below_mm, Some(width_mm)),
                _ => unreachable!("two"),
            },
        };
    }
    Ok((analysis, request))
}

fn items<'py>(fixtures: &Bound<'py, PyAny>, expected: &str) -> PyResult<Vec<Bound<'py, PyAny>>> {
    fixtures.try_iter().map_err(|_| wrong_type("fixtures", fixtures, expected))?.collect()
}

/// A mesh about the part's origin, by its name or number.
fn fixture(
    item: &Bound<'_, PyAny>,
    (k, about): (usize, DVec3),
    expected: &str,
) -> PyResult<Fixture> {
    let Some(fixture) = Mesh::of(item)? else {
        return Err(wrong_type("fixtures", item, expected));
    };
    let Mesh { mesh, origin, name, .. } = fixture.get();
    let (mut mesh, from) = (mesh.clone(), about - origin.unwrap_or_default());
    if from != DVec3::ZERO {
        origin::make_relative(&mut mesh, from);
    }
    let name = if name == "part" { format!("fixture {}", k + 1) } else { name.clone() };
    Ok(Fixture::new(name, mesh))
}
