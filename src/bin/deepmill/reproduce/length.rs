//! How much of a part is out of reach over the lengths of cutter and holder.

use super::page::Page;
use super::parts::Part;
use super::pictures::Sheet;
use super::study::{N_DIRECTIONS, Study};
use deepmill::Result;
use deepmill::access::surface::SurfaceOptions;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::data::generated;
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::report::{Class, Coloring};
use deepmill::tables::{Cell, Table};
use serde_json::Value;

/// What is swept, mm; the other length stays at [`OTHER`].
const LENGTHS: [f64; 9] = [0.1, 2.0, 4.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0];
const OTHER: f64 = 10.0;
/// Ball and holder, mm.
const CR: f64 = 1.5;
const FR: f64 = 5.0;
/// Lengths of which there is a picture.
const SHOWN: [f64; 3] = [0.1, 10.0, 30.0];

/// Which length is swept.
#[derive(Clone, Copy, PartialEq)]
enum Swept {
    Ch,
    Fh,
}

impl Swept {
    fn name(self) -> &'static str {
        match self {
            Swept::Ch => "CH",
            Swept::Fh => "FH",
        }
    }

    fn cutter(self, length: f64) -> CutterParams {
        let [ch, fh] = match self {
            Swept::Ch => [length, OTHER],
            Swept::Fh => [OTHER, length],
        };
        [CR, ch, FR, fh].into()
    }
}

pub fn run(study: &Study) -> Result<Value> {
    let demo = Part { name: "demo part".into(), mesh: generated::demo_part() };
    let part = study.parts_of_user().first().unwrap_or(&demo);
    let sites = part.sites(study.args.sites)?;
    let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS)?;
    let labels = LabelOptions::published().with_occlusion(false);
    let surface = SurfaceOptions::default().with_occlusion(false);
    let engines = [
        ("sites", Labeler::of_sites(Directions::published(), labels)),
        ("mesh definition", Labeler::of_part(&part.mesh, &[], directions, surface)?),
    ];
    let mut table = Table::new(&[
        ("swept", "swept"),
        ("length_mm", "length, mm"),
        ("sites", "out of reach: sites"),
        ("part", "out of reach: mesh definition"),
    ]);
    let (mut charts, mut sheet) = (Vec::new(), Sheet::default());
    let bar = study.bar(2 * LENGTHS.len(), "cutters");
    for swept in [Swept::Ch, Swept::Fh] {
        let mut curves =
            engines.each_ref().map(|(name, _)| Series { name: (*name).into(), points: vec![] });
        for length in LENGTHS {
            let mut row = vec![Cell::text(swept.name()), Cell::Given(length)];
            for ((name, engine), curve) in engines.iter().zip(&mut curves) {
                study.go_on()?;
                let answers = engine.answer(&sites, &Cutter::ball_end(swept.cutter(length))?)?;
                let share = answers.inaccessible_area_share(&sites)?;
                curve.points.push((length, 100.0 * share));
                row.push(Cell::Share(share));
                if swept == Swept::Ch && SHOWN.contains(&length) {
                    show(
                        &mut sheet,
                        part,
                        &sites,
                        &answers.inaccessible(),
                        format!("{name}, CH {length} mm, FH {OTHER} mm"),
                    );
                }
            }
            table.row(row);
            bar.inc(1);
        }
        let title = format!("area out of reach, %, over {}", swept.name());
        charts.push(Chart { title, series: curves.into() });
    }
    bar.finish_and_clear();
    write_curves(&study.file("length.svg"), "length, mm", &charts)?;
    sheet.by_turns(engines.len()).image().write_png(&study.file("length.png"))?;
    let page = Page {
        name: "length",
        title: "Lengths of cutter and holder",
        text: vec![format!(
            "Share of the area of the part `{}` that is out of reach of a ball-end cutter with CR {CR} mm and FR {FR} mm, while CH \
             is swept at FH {OTHER} mm, and FH at CH {OTHER} mm. *Sites*: the published definition ({} sites against each other). \
             *Mesh definition*: its triangles, with the search between the directions; sites where only the tip does not fit are not \
             counted, as the published definition has no such answer. The published 152 directions, and {N_DIRECTIONS} over the upper half.",
            part.name, study.args.sites
        )],
        table,
        pictures: vec![
            ("length.svg".into(), "Area out of reach over both lengths".into()),
            ("length.png".into(), "Sites out of reach for three lengths: the published definition above, the mesh definition below".into()),
        ],
    };
    page.write(study)
}

fn show(sheet: &mut Sheet, part: &Part, sites: &Sites, inaccessible: &[bool], caption: String) {
    let classes = [
        Class { name: "reached", color: [205, 208, 212] },
        Class { name: "out of reach", color: [206, 58, 44] },
    ];
    let of: Vec<usize> = inaccessible.iter().map(|flag| usize::from(*flag)).collect();
    let coloring = Coloring::Groups { classes: &classes, of: &of, areas: &[] };
    sheet.add(&part.mesh, sites, &coloring, caption);
}
