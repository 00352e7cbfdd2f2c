//! How often a site and its mirror image get different labels, over the direction set.

use super::page::Page;
use super::parts::{Part, SEED};
use super::pictures::Sheet;
use super::study::{N_DIRECTIONS, Study};
use super::trainings::{Trainings, training_samples};
use deepmill::access::surface::SurfaceOptions;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::answers::SiteAnswers;
use deepmill::cutter::{Cutter, CutterSet};
use deepmill::data::generated::{self, Lie};
use deepmill::directions::Directions;
use deepmill::geom::{Mesh, Sites};
use deepmill::glam::{DVec3, Vec3};
use deepmill::report::{Class, Coloring};
use deepmill::tables::{Cell, Table};
use deepmill::{Error, Result};
use serde_json::Value;
use std::collections::HashSet;

/// The set of the published definition, one of about as many directions that is symmetric in x and y, and a fine one.
const SETS: [(&str, &str); 3] = [
    ("published", "published, 152"),
    ("latlong:10x16", "latitude-longitude, 10 x 16"),
    ("hemisphere:2400", "Fibonacci, 2,400"),
];
/// CR, CH, FR, FH in mm.
const CUTTERS: [[f64; 4]; 2] = [[1.5, 6.0, 40.0, 5.0], [1.5, 10.0, 5.0, 10.0]];
/// Most parts, and generated ones that are looked at for a mirror plane.
const N_PARTS: usize = 8;
const N_CANDIDATES: u64 = 220;
/// Corners whose mirror images are this near to a corner, mm, are symmetric.
const TOLERANCE_MM: f64 = 1e-3;
/// Sites nearer to the mirror plane, mm, are left out: their images would fall upon them.
const LEAST_MM: f32 = 0.01;

/// A part with the mirror plane x = 0 or y = 0, and sites of which every second is the mirror image of the one before.
struct Symmetric {
    part: Part,
    sites: Sites,
}

pub fn run(study: &Study) -> Result<Value> {
    let parts = symmetric_parts(study)?;
    let mut table = Table::new(&[
        ("answers", "answers"),
        ("directions", "directions"),
        ("asymmetry_i", "mirror image disagrees: inaccessible"),
        ("asymmetry_o", "mirror image disagrees: occlusion"),
        ("worst_i", "greatest of a part, inaccessible"),
        ("inaccessible", "inaccessible"),
    ]);
    let mut sheet = Sheet::default();
    let mut shown = None;
    for (set, words) in SETS {
        let labeler = labeler(set)?;
        let scores = score(study, &parts, |part, cutter| labeler.answer(&part.sites, cutter))?;
        scores.row(&mut table, "exact labels, sites", words);
        let (part, lengths) = *shown.get_or_insert(scores.worst_of);
        let answers = labeler.answer(&parts[part].sites, &Cutter::ball_end(lengths.into())?)?;
        show(&mut sheet, &parts[part], &answers, words);
    }
    let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS)?;
    let itself = score(study, &parts, |part, cutter| {
        let options = SurfaceOptions::default();
        let labeler = Labeler::of_part(&part.part.mesh, &[], directions.clone(), options)?;
        labeler.answer(&part.sites, cutter)
    })?;
    itself.row(
        &mut table,
        "exact labels, mesh definition",
        "Fibonacci, 150, and the search between",
    );
    let trainings = Trainings::new(study)?;
    for (set, words) in SETS {
        let data = training_samples(study, &[CutterSet::Uniform], &labeler(set)?)?;
        let name = format!("labels of {set}");
        let model = trainings.network(&name, &data, |_| ())?.model;
        let scores = score(study, &parts, |Symmetric { sites, .. }, cutter| {
            let Some(lengths) = cutter.as_ball_end() else { return Ok(SiteAnswers::default()) };
            Ok(model.predict(&sites.points, &sites.normals, lengths.to_array())?.answers())
        })?;
        scores.row(&mut table, "network trained on such labels", words);
    }
    sheet.image().write_png(&study.file("symmetry.png"))?;
    let page = Page {
        name: "symmetry",
        title: "Symmetric directions",
        text: vec![
            format!(
                "{} parts with a mirror plane ({}), {} cutters; every second site is the exact mirror image of another. The \
                 share of sites of which the image has the other answer, averaged over parts and cutters.",
                parts.len(),
                parts.iter().map(|p| &*p.part.name).collect::<Vec<_>>().join(", "),
                CUTTERS.len()
            ),
            trainings.words(),
        ],
        table,
        pictures: vec![(
            "symmetry.png".into(),
            "Sites whose mirror image has another label; the part and the cutter with most of them at the published directions".into(),
        )],
    };
    page.write(study)
}

/// The published definition with other directions.
fn labeler(set: &str) -> Result<Labeler> {
    Ok(Labeler::of_sites(set.parse()?, LabelOptions::published()))
}

/// Averages over parts and cutters.
struct Scores {
    n: f64,
    disagree: [f64; 2],
    worst: f64,
    /// The part and the cutter of the greatest share.
    worst_of: (usize, [f64; 4]),
    inaccessible: f64,
}

impl Scores {
    fn add(&mut self, of: (usize, [f64; 4]), answers: &SiteAnswers) {
        let [i, o] = [&answers.inaccessible(), answers.occlusion()].map(|flags| {
            let disagree = disagreeing(flags).into_iter().filter(|d| *d).count();
            disagree as f64 / flags.len().max(1) as f64
        });
        self.n += 1.0;
        self.disagree[0] += i;
        self.disagree[1] += o;
        if i > self.worst {
            (self.worst, self.worst_of) = (i, of);
        }
        self.inaccessible += answers.n_inaccessible() as f64 / answers.len().max(1) as f64;
    }

    fn row(&self, table: &mut Table, answers: &str, directions: &str) {
        let mean = |sum: f64| Cell::Share(sum / self.n);
        let [i, o] = self.disagree.map(mean);
        let (answers, directions) = (Cell::text(answers), Cell::text(directions));
        table.row([answers, directions, i, o, Cell::Share(self.worst), mean(self.inaccessible)]);
    }
}

/// Scores of the answers of one engine.
fn score(
    study: &Study,
    parts: &[Symmetric],
    answer: impl Fn(&Symmetric, &Cutter) -> Result<SiteAnswers>,
) -> Result<Scores> {
    let first = (0, CUTTERS[0]);
    let mut scores =
        Scores { n: 0.0, disagree: [0.0; 2], worst: 0.0, worst_of: first, inaccessible: 0.0 };
    let bar = study.bar(parts.len() * CUTTERS.len(), "parts answered");
    for (index, part) in parts.iter().enumerate() {
        for lengths in CUTTERS {
            study.go_on()?;
            scores.add((index, lengths), &answer(part, &Cutter::ball_end(lengths.into())?)?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(scores)
}

/// Per site, whether the other of its pair has another answer.
fn disagreeing(flags: &[bool]) -> Vec<bool> {
    flags.chunks_exact(2).flat_map(|pair| [pair[0] != pair[1]; 2]).collect()
}

fn show(sheet: &mut Sheet, part: &Symmetric, answers: &SiteAnswers, words: &str) {
    let classes = [
        Class { name: "accessible", color: [205, 208, 212] },
        Class { name: "inaccessible", color: [122, 134, 150] },
        Class { name: "mirror image disagrees", color: [206, 58, 44] },
    ];
    let disagree = disagreeing(&answers.inaccessible());
    let class = |(inaccessible, disagrees): (&bool, &bool)| {
        if *disagrees { 2 } else { usize::from(*inaccessible) }
    };
    let of: Vec<usize> = answers.inaccessible().iter().zip(&disagree).map(class).collect();
    let coloring = Coloring::Groups { classes: &classes, of: &of, areas: &[] };
    sheet.add(&part.part.mesh, &part.sites, &coloring, format!("{}: {words}", part.part.name));
}

/// The first of the user's parts, or of generated ones as drawn, that have a mirror plane.
fn symmetric_parts(study: &Study) -> Result<Vec<Symmetric>> {
    let n_parts = N_PARTS.min(study.args.parts_count as usize);
    let mut found = Vec::new();
    let mut add = |name: &str, mesh: &Mesh| -> Result<bool> {
        if let Some(part) = symmetric(name, mesh, study.args.sites)? {
            found.push(part);
        }
        Ok(found.len() == n_parts)
    };
    if study.args.parts.is_empty() {
        for index in 0..N_CANDIDATES {
            study.go_on()?;
            let family = generated::family_of(index);
            let mesh = generated::part_lying(family, SEED, index, Lie::AsDrawn);
            if add(&format!("{}-{index:04}", family.name()), &mesh)? {
                break;
            }
        }
    }
    for part in study.parts_of_user() {
        if add(&part.name, &part.mesh)? {
            break;
        }
    }
    if found.is_empty() {
        let remedy = "give a part that is symmetric in x or y about the middle of its box";
        return Err(Error::argument(
            "--parts",
            "no part with a mirror plane",
            "one or more",
            remedy,
        ));
    }
    Ok(found)
}

/// The part about the middle of its box, if that is a mirror plane across x or y.
fn symmetric(name: &str, mesh: &Mesh, n_sites: usize) -> Result<Option<Symmetric>> {
    let Some((low, high)) = mesh.bounds() else { return Ok(None) };
    let middle = 0.5 * (low + high) * DVec3::new(1.0, 1.0, 0.0);
    let vertices = mesh.vertices.iter().map(|v| *v - middle).collect();
    let mesh = Mesh { vertices, triangles: mesh.triangles.clone() };
    let across = [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, 1.0)];
    let Some(mirror) = across.into_iter().find(|mirror| is_symmetric(&mesh, *mirror)) else {
        return Ok(None);
    };
    let part = Part { name: name.into(), mesh };
    let (all, mirror) = (part.sites(n_sites)?, mirror.as_vec3());
    // The coordinate that changes its sign.
    let side = |p: Vec3| p.dot((Vec3::ONE - mirror) * 0.5);
    let mut sites = Sites { points: vec![], normals: vec![], faces: vec![] };
    for (point, normal) in all.points.iter().zip(&all.normals) {
        if side(*point) > LEAST_MM {
            sites.points.extend([*point, *point * mirror]);
            sites.normals.extend([*normal, *normal * mirror]);
        }
    }
    Ok((sites.points.len() >= 2).then_some(Symmetric { part, sites }))
}

/// Whether every corner has a mirror image among the corners.
fn is_symmetric(mesh: &Mesh, mirror: DVec3) -> bool {
    let cell = |v: DVec3| (v / TOLERANCE_MM).to_array().map(|x| x.round() as i64);
    let corners: HashSet<_> = mesh.vertices.iter().map(|v| cell(*v)).collect();
    let near = |v: DVec3| {
        let [x, y, z] = cell(v);
        let steps = || -1..=1;
        steps().any(|i| steps().any(|j| steps().any(|k| corners.contains(&[x + i, y + j, z + k]))))
    };
    mesh.vertices.iter().all(|v| near(*v * mirror))
}
