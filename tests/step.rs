//! STEP files, against volumes and areas by formula, and against files that cannot be read.
#![cfg(feature = "step")]

use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::{Mesh, check};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

const CHORD_MM: f64 = 0.02;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/fixtures/step/{name}.step"))
}

fn read(name: &str) -> Mesh {
    read_mesh(&file(name), &ReadOptions::default()).unwrap()
}

fn text(name: &str) -> String {
    std::fs::read_to_string(file(name)).unwrap()
}

/// The words of the error about a file of this content.
fn refused(content: impl AsRef<[u8]>) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.step");
    std::fs::write(&path, content).unwrap();
    let words = read_mesh(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(words.contains("part.step") && words.contains("; "), "file and remedy: {words}");
    words
}

/// Of a mesh whose triangles are within the chord error of the surface, the volume is off by no more than that error
/// times the area.
fn require(name: &str, volume_mm3: f64, area_mm2: f64) {
    let mesh = read(name);
    let report = check::check(&mesh);
    assert!(report.blocking_bodies().is_none(), "{name}");
    let (volume, area) = (mesh.volume(), mesh.area());
    assert!(
        (volume - volume_mm3).abs() <= CHORD_MM * area_mm2,
        "{name}: {volume}, {volume_mm3} by hand"
    );
    assert!((area / area_mm2 - 1.0).abs() < 0.004, "{name}: {area}, {area_mm2} by hand");
}

#[test]
fn bodies_have_the_volume_and_area_of_their_formulas() {
    require("block", 24_000.0, 5_200.0);
    let cylinder = (PI * 225.0 * 40.0, 2.0 * PI * 15.0 * 55.0);
    require("cylinder", cylinder.0, cylinder.1);
    let slant = f64::hypot(10.0, 30.0);
    require("cone", PI * 10.0 * (225.0 + 75.0 + 25.0), PI * (225.0 + 25.0 + 20.0 * slant));
    require("sphere", 4.0 / 3.0 * PI * 1728.0, 4.0 * PI * 144.0);
    // A cavity: its wall faces inward.
    require("void", 64_000.0 - 4.0 / 3.0 * PI * 1000.0, 9_600.0 + 4.0 * PI * 100.0);
    // A pocket of 40 x 20 x 12 whose four corners have a radius of 4.
    let floor = 800.0 - (4.0 - PI) * 16.0;
    let walls = (2.0 * (32.0 + 12.0) + 8.0 * PI) * 12.0;
    require("pocket", 48_000.0 - 12.0 * floor, 8_800.0 + walls);
    // Four bores of 8 through 20, one of 6 through 15 below one of 12, 5 deep.
    let bores = 4.0 * 16.0 * PI * 20.0 + 9.0 * PI * 15.0 + 36.0 * PI * 5.0;
    let bored = 8_800.0 - 4.0 * 2.0 * 16.0 * PI + 4.0 * 8.0 * PI * 20.0;
    let step = -(36.0 + 9.0) * PI + (36.0 - 9.0) * PI + 6.0 * PI * 15.0 + 12.0 * PI * 5.0;
    require("bores", 48_000.0 - bores, bored + step);
    // By Open CASCADE: there is no formula for it.
    require("spline", 10_555.839_8, 3_252.476_8);
}

#[test]
fn the_unit_of_the_file_is_read() {
    let expected = read("pocket");
    for unit in ["inch", "cm", "m"] {
        let mesh = read(unit);
        let off = (mesh.volume() / expected.volume() - 1.0).abs();
        assert!(off < 1e-5, "{unit}: {}", mesh.volume());
        let bounds = [expected.bounds().unwrap(), mesh.bounds().unwrap()];
        assert!(
            bounds[0].0.distance(bounds[1].0) < 1e-6 && bounds[0].1.distance(bounds[1].1) < 1e-6
        );
    }
    // A factor on top, as for 3MF: the chord error stays that of the part.
    let doubled = ReadOptions::default().with_scale(2.0);
    let mesh = read_mesh(&file("block"), &doubled).unwrap();
    assert_eq!(mesh.volume(), 8.0 * 24_000.0);
}

#[test]
fn parts_of_an_assembly_are_where_it_places_them() {
    let mesh = read("assembly");
    let body_of = check::bodies(&mesh).unwrap();
    let low_high = |body: u32| {
        let faces = (0..mesh.triangles.len()).filter(|t| body_of[*t] == body);
        let corners: Vec<_> = faces.flat_map(|t| mesh.corners(t)).collect();
        let fold = |f: fn(glam::DVec3, glam::DVec3) -> glam::DVec3| {
            corners.iter().copied().reduce(f).unwrap()
        };
        (fold(glam::DVec3::min), fold(glam::DVec3::max))
    };
    let mut boxes: Vec<_> = (0..=*body_of.iter().max().unwrap()).map(low_high).collect();
    boxes.sort_by(|a, b| a.0.x.total_cmp(&b.0.x).then(a.1.z.total_cmp(&b.1.z)));
    // The block, a cylinder upright upon it, and one that lies along x from 100 on: turned by 90 degrees about y, its
    // axis z comes to be along x.
    let expected = [
        ([0.0, 0.0, 0.0], [40.0, 30.0, 20.0]),
        ([5.0, 0.0, 20.0], [35.0, 30.0, 60.0]),
        ([100.0, -15.0, -15.0], [140.0, 15.0, 15.0]),
    ];
    assert_eq!(boxes.len(), 3, "{boxes:?}");
    for ((low, high), (l, h)) in boxes.iter().zip(expected) {
        assert!(low.distance(l.into()) < 0.1 && high.distance(h.into()) < 0.1, "{low} {high}");
    }
}

/// The block, 40 x 30 x 20, in a shape of its own that another places at these frames: location, z, x.
fn mapped(frames: &[[[f64; 3]; 3]]) -> String {
    let block = text("block");
    let of = |name: &str| {
        let line = block.lines().find(|line| line.contains(name)).unwrap();
        line.split('=').next().unwrap().trim().trim_start_matches('#').to_string()
    };
    let shape = of("ADVANCED_BREP_SHAPE_REPRESENTATION");
    let mut more = String::from(
        "#9001=CARTESIAN_POINT('',(0.,0.,0.));\n#9002=AXIS2_PLACEMENT_3D('',#9001,$,$);\n",
    );
    more += &format!("#9003=REPRESENTATION_MAP(#9002,#{shape});\n");
    let mut items = Vec::new();
    for (k, frame) in frames.iter().enumerate() {
        let first = 9100 + 10 * k;
        let [location, z, x] = frame.map(|[x, y, z]| format!("({x:?},{y:?},{z:?})"));
        more += &format!("#{first}=CARTESIAN_POINT('',{location});\n");
        more += &format!("#{}=DIRECTION('',{z});\n#{}=DIRECTION('',{x});\n", first + 1, first + 2);
        let axes = format!("#{first},#{},#{}", first + 1, first + 2);
        more += &format!("#{}=AXIS2_PLACEMENT_3D('',{axes});\n", first + 3);
        more += &format!("#{}=MAPPED_ITEM('',#9003,#{});\n", first + 4, first + 3);
        items.push(format!("#{}", first + 4));
    }
    let context = block.split_once("ADVANCED_BREP_SHAPE_REPRESENTATION").unwrap().1;
    let context = context.split_once(";").unwrap().0.rsplit_once(',').unwrap().1.replace(')', "");
    more += &format!("#9004=SHAPE_REPRESENTATION('',({}),{});\n", items.join(","), context.trim());
    let of_product = block.split_once("SHAPE_DEFINITION_REPRESENTATION(").unwrap().1;
    let of_product = of_product.split_once(',').unwrap().0;
    more += &format!("#9005=SHAPE_DEFINITION_REPRESENTATION({of_product},#9004);\n");
    let (data, end) = block.rsplit_once("ENDSEC;").unwrap();
    format!("{data}{more}ENDSEC;{end}")
}

#[test]
fn parts_are_where_mapped_items_place_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.step");
    let boxed = |frames: &[[[f64; 3]; 3]]| {
        std::fs::write(&path, mapped(frames)).unwrap();
        let mesh = read_mesh(&path, &ReadOptions::default()).unwrap();
        let (low, high) = mesh.bounds().unwrap();
        (mesh.volume(), low, high)
    };
    let (own_low, own_high) = read("block").bounds().unwrap();
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    // As it is, and 100 mm along x.
    let (volume, low, high) = boxed(&[[[0.0; 3], z, x], [[100.0, 0.0, 0.0], z, x]]);
    assert!((volume - 48_000.0).abs() < 1e-6, "{volume}");
    assert!((low - own_low).length() < 1e-9);
    assert!((high - own_high - glam::DVec3::X * 100.0).length() < 1e-9);
    // A quarter turn about z: what was along x is along y, what was along y against x.
    let (volume, low, high) = boxed(&[[[5.0, 6.0, 7.0], z, y]]);
    assert!((volume - 24_000.0).abs() < 1e-6, "{volume}");
    let turned = |p: glam::DVec3| glam::dvec3(5.0 - p.y, 6.0 + p.x, 7.0 + p.z);
    let (a, b) = (turned(own_low), turned(own_high));
    assert!((low - a.min(b)).length() < 1e-9 && (high - a.max(b)).length() < 1e-9, "{low} {high}");
    // A mapped item of a drawing places nothing.
    let drawing = mapped(&[[[50.0, 0.0, 0.0], z, x]]);
    let drawing = drawing.replace("#9004=SHAPE_REPRESENTATION", "#9004=DRAUGHTING_MODEL");
    let drawing = drawing.replace("#9005=SHAPE_DEFINITION_REPRESENTATION", "#9005=NOTHING");
    std::fs::write(&path, drawing).unwrap();
    let (low, high) = read_mesh(&path, &ReadOptions::default()).unwrap().bounds().unwrap();
    assert!((low - own_low).length() < 1e-9 && (high - own_high).length() < 1e-9);
}

#[test]
fn places_without_number_and_shapes_within_themselves_are_refused() {
    let z = [[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    // Each of 20 shapes places the next twice: a million places.
    let file = mapped(&[z]);
    let mut more = String::new();
    for k in 0..20 {
        let (this, next) = (9500 + 10 * k, 9500 + 10 * (k + 1));
        more += &format!("#{}=REPRESENTATION_MAP(#9002,#{next});\n", this + 1);
        more += &format!("#{0}=MAPPED_ITEM('',#{1},#9002);\n", this + 2, this + 1);
        more += &format!("#{0}=MAPPED_ITEM('',#{1},#9002);\n", this + 3, this + 1);
        more += &format!("#{this}=SHAPE_REPRESENTATION('',(#{},#{}),#1);\n", this + 2, this + 3);
    }
    more += "#9700=SHAPE_REPRESENTATION('',(#9104),#1);\n";
    let many = file.replace(
        "#9004=SHAPE_REPRESENTATION('',(#9104)",
        &format!("{more}#9004=SHAPE_REPRESENTATION('',(#9502)"),
    );
    let words = refused(many);
    assert!(words.contains("more than 100000 places of parts"), "{words}");
    // A shape that places itself.
    let within = file.replace(
        "#9003=REPRESENTATION_MAP(#9002,",
        "#9003=REPRESENTATION_MAP(#9002,#9004);\n#9006=REPRESENTATION_MAP(#9002,",
    );
    let words = refused(within);
    assert!(words.contains("solid #") || words.contains("deep"), "{words}");
}

#[test]
fn assemblies_that_each_place_the_next_twice_are_refused_by_the_number_of_their_places() {
    // 20 products over the assembly: a million places of its parts.
    let (mut more, first) = (String::new(), 10_000);
    for k in 0..20 {
        let id = |j: usize| first + 100 * k + j;
        let (part, shape) = match k {
            19 => (5, 10),
            _ => (id(100), id(105)),
        };
        more += &format!("#{}=PRODUCT_DEFINITION('design','',#{},#9);\n", id(0), id(1));
        more += &format!("#{}=PRODUCT_DEFINITION_FORMATION('','',#{});\n", id(1), id(2));
        more += &format!("#{}=PRODUCT('p{k}','p{k}','',(#8));\n", id(2));
        more += &format!("#{}=PRODUCT_DEFINITION_SHAPE('','',#{});\n", id(3), id(0));
        more += &format!("#{}=SHAPE_DEFINITION_REPRESENTATION(#{},#{});\n", id(4), id(3), id(5));
        more += &format!("#{}=SHAPE_REPRESENTATION('',(#11,#15),#27);\n", id(5));
        for j in [10, 20] {
            let [dependent, relation, transformation, placement, usage] =
                [0, 1, 2, 3, 4].map(|i| id(j + i));
            more += &format!(
                "#{dependent}=CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{placement});\n\
                 #{relation}=(REPRESENTATION_RELATIONSHIP('','',#{shape},#{})\
                 REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{transformation})\
                 SHAPE_REPRESENTATION_RELATIONSHIP());\n\
                 #{transformation}=ITEM_DEFINED_TRANSFORMATION('','',#11,#15);\n\
                 #{placement}=PRODUCT_DEFINITION_SHAPE('','',#{usage});\n\
                 #{usage}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('{usage}','','',#{},#{part},$);\n",
                id(5),
                id(0)
            );
        }
    }
    let assembly = text("assembly");
    let (data, end) = assembly.rsplit_once("ENDSEC;").unwrap();
    let words = refused(format!("{data}{more}ENDSEC;{end}"));
    assert!(words.contains("more than 100000 places of parts"), "{words}");
}

#[test]
fn a_smaller_chord_error_is_nearer_to_the_surface() {
    let exact = PI * 225.0 * 40.0;
    let off = |chord_mm: f64| {
        let options = ReadOptions::default().with_chord_mm(chord_mm);
        exact - read_mesh(&file("cylinder"), &options).unwrap().volume()
    };
    let [coarse, fine] = [0.2, 0.02].map(off);
    assert!(coarse > 2.0 * fine && fine > 0.0, "{coarse} {fine}");
    let zero = ReadOptions::default().with_chord_mm(0.0);
    let words = read_mesh(&file("cylinder"), &zero).unwrap_err().to_string();
    assert!(words.contains("chord"), "{words}");
}

#[test]
fn the_same_file_gives_the_same_mesh() {
    for name in ["assembly", "bores", "void"] {
        assert_eq!(read(name), read(name), "{name}");
    }
}

#[test]
fn a_face_that_cannot_be_cut_refuses_the_file_and_is_named() {
    for (name, found) in [
        ("conetip", "face #17, a cone"),
        ("sweep", "face #17, a spline surface"),
        // Closed, and with half of its volume: its triangles cut through the hole.
        ("torus", "face #17, a torus: its triangles are not on its surface"),
    ] {
        let words = read_mesh(&file(name), &ReadOptions::default()).unwrap_err().to_string();
        assert!(words.contains(found) && words.contains("docs/meshes.md"), "{words}");
    }
}

#[test]
fn what_is_no_whole_step_file_is_refused() {
    let block = text("block");
    assert!(refused("solid a\nendsolid").contains("no STEP file"));
    assert!(refused(&block[..block.len() / 2]).contains("text"));
    let head = block.split("DATA;").next().unwrap();
    assert!(refused(format!("{head}DATA;\nENDSEC;\nEND-ISO-10303-21;\n")).contains("no solid"));
    // Without its solid; without a face.
    assert!(refused(block.replace("MANIFOLD_SOLID_BREP", "OTHER")).contains("no solid"));
    let shell = block.lines().find(|line| line.contains("CLOSED_SHELL")).unwrap();
    let fewer = shell.replace("(#17,", "(");
    assert!(refused(block.replace(shell, &fewer)).contains("do not bound a solid"));
    let missing = shell.replace("(#17,", "(#999999,");
    assert!(refused(block.replace(shell, &missing)).contains("cannot be read as a whole"));
    // Two units of length.
    let unit = "#346 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );";
    let other = unit.replace("#346", "#9346").replace(".MILLI.", ".CENTI.");
    let both = block.replace(unit, &format!("{unit}\n{other}"));
    let both = both.replace("((#346,", "((#346,#9346,");
    let words = refused(both);
    assert!(words.contains("units of length of 1 mm and 10 mm"), "{words}");
}

#[test]
fn files_that_would_take_all_memory_or_the_stack_are_refused() {
    let block = text("block");
    let deep = format!(
        "#9999 = OTHER({}1{});\nENDSEC;\nEND-ISO",
        "(".repeat(200_000),
        ")".repeat(200_000)
    );
    assert!(refused(block.replacen("ENDSEC;\nEND-ISO", &deep, 1)).contains("parentheses"));
    let fine = ReadOptions::default().with_chord_mm(1e-7);
    let words = read_mesh(&file("cylinder"), &fine).unwrap_err().to_string();
    assert!(words.contains("chord") && words.contains("at least"), "{words}");
}

#[test]
fn damaged_files_are_refused_or_read_and_nothing_worse() {
    let whole = text("cylinder").into_bytes();
    let mut state = 1u64;
    let mut next = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) as usize % n
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.step");
    for _ in 0..60 {
        let mut bytes = whole.clone();
        for _ in 0..1 + next(3) {
            let at = next(bytes.len());
            bytes[at] = b"0123456789.,#()'$*-E"[next(20)];
        }
        std::fs::write(&path, &bytes).unwrap();
        if let Ok(mesh) = read_mesh(&path, &ReadOptions::default()) {
            assert!(mesh.vertices.iter().all(|v| v.is_finite()));
            assert!(check::check(&mesh).blocking_bodies().is_none());
        }
    }
}

#[test]
fn a_step_file_is_labeled() {
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_deepmill");
    let out = folder.path().join("out");
    let output = std::process::Command::new(program)
        .args([
            "label",
            file("pocket").to_str().unwrap(),
            "--cutter",
            "3,30,6,30",
            "--directions",
            "up",
        ])
        .args([
            "--sites",
            "2000",
            "--no-picture",
            "--chord",
            "0.05",
            "--json",
            "--out",
            out.to_str().unwrap(),
        ])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(out.join("labels.npz").exists());
}
