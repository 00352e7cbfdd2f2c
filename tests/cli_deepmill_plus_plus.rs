//! What the forms of DeepMill++ promise: sites in the order of the file's vertices, a matrix of directions by vertices,
//! a status of every vertex; and several parts in one call.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, json, text};
use deepmill::data::files::LabelFile;
use deepmill::data::files::matrix::{AccessMatrix, MatrixFile};
use deepmill::data::files::safety;
use deepmill::geom::solids;
use std::path::Path;

/// A block 10 × 10 × 10 mm with the middles of five faces. Vertex 1 is unused, 11 repeats 10, faces begin with the last
/// vertices, one is a quad.
const BLOCK: &str = "# by hand\n\
    v 5 5 5 # unused\n\
    v 5 5 10\n\
    v 0 0 0\nv 10 0 0\nv 0 10 0\nv 10 10 0\nv 0 0 10\nv 10 0 10\nv 0 10 10\nv 10 10 10\n\
    v 10 10 10\n\
    v 5 5 0\nv 10 5 5\nv 0 5 5\nv 5 0 5\n\
    g front\nf -1 3 4\nf 15 4 8\nf 15 8 7\nf 15 7 3\n\
    f 14 3 7\nf 14 7 9\nf 14 9 5\nf 14 5 3\n\
    f 13 4 6\nf 13 6 11\nf 13 11 8\nf 13 8 4\n\
    f 12 3 5\nf 12 5 6\nf 12 6 4\nf 12 4 3\n\
    f 2 7 8\nf 2 8 10\nf 2 10 9\nf 2 9 7\n\
    f 5 9 10 6 # a quad\n";

/// From +z and from +x, per vertex of the file. The tool is a ball of radius 1.5 with a holder of radius 40 from 7.5
/// above its middle: a site is reached from a direction if no more than 7.5 of the block is above it, and its face does
/// not look the other way. The middle of a wall is 5 below the top.
const FROM_ABOVE: [u8; 15] = [0, 1, 0, 0, 0, 0, 1, 1, 1, 1, 1, 0, 1, 1, 1];
const FROM_X: [u8; 15] = [0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 1, 1, 1, 0, 1];

const VERTEX_INDEX: [i64; 13] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14];
const SITE_OF_VERTEX: [i64; 15] = [-1, 0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 9, 10, 11, 12];

fn label(folder: &Folder, part: &str, out: &str, more: &[&str]) -> std::process::Output {
    let out = folder.path(out);
    let args = ["label", part, "--cutter", "1.5,6,40,5", "--sites", "vertices", "--no-picture"];
    deepmill(&[&args[..], &["--out", &out], more].concat())
}

fn read(folder: &Folder, name: &str) -> String {
    std::fs::read_to_string(folder.path(name)).unwrap()
}

fn labels(folder: &Folder, out: &str) -> LabelFile {
    LabelFile::read(Path::new(&folder.path(&format!("{out}/labels.npz")))).unwrap()
}

#[test]
fn sites_at_vertices_come_in_the_order_of_the_file_and_lead_back_to_it() {
    let folder = Folder::new();
    let part = folder.file("block.obj", BLOCK);
    json(&label(&folder, &part, "out", &["--json"]));
    let found = labels(&folder, "out");
    let vertices = found.vertices.unwrap();
    assert_eq!(vertices.vertex_index, VERTEX_INDEX);
    assert_eq!(vertices.site_of_vertex, SITE_OF_VERTEX);
    let lines: Vec<&str> = BLOCK.lines().filter(|line| line.starts_with("v ")).collect();
    for (point, &v) in found.sites.points.iter().zip(&VERTEX_INDEX) {
        let of_file: Vec<f32> =
            lines[v as usize].split(' ').skip(1).take(3).map(|x| x.parse().unwrap()).collect();
        assert_eq!(point.to_array(), of_file[..]);
    }
}

#[test]
fn far_from_the_origin_and_in_other_formats_vertices_are_named_too_but_an_stl_has_none() {
    let folder = Folder::new();
    let moved = |line: &str| match line.strip_prefix("v ").and_then(|rest| rest.split_once(' ')) {
        Some((x, rest)) => format!("v {} {rest}\n", 90_000 + x.parse::<i32>().unwrap()),
        None => format!("{line}\n"),
    };
    let far = folder.file("far.obj", BLOCK.lines().map(moved).collect::<String>());
    json(&label(&folder, &far, "far", &["--json"]));
    assert_eq!(labels(&folder, "far").vertices.unwrap().vertex_index, VERTEX_INDEX);
    let mesh = solids::cuboid(deepmill::glam::DVec3::splat(10.0));
    let vertices: String =
        mesh.vertices.iter().rev().map(|v| format!("{} {} {}\n", v.x, v.y, v.z)).collect();
    let faces: String = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| 8 - v))
        .map(|[a, b, c]| format!("3 {a} {b} {c}\n"))
        .collect();
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 9\nproperty double x\nproperty double y\nproperty double z\n\
         element face 12\nproperty list uchar int vertex_indices\nend_header\n3 3 3\n{vertices}{faces}"
    );
    let ply = folder.file("cube.ply", ply);
    json(&label(&folder, &ply, "ply", &["--json"]));
    let of_ply = labels(&folder, "ply").vertices.unwrap();
    assert_eq!(of_ply.vertex_index, [1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(of_ply.site_of_vertex, [-1, 0, 1, 2, 3, 4, 5, 6, 7]);
    json(&label(&folder, &folder.block(), "stl", &["--json"]));
    assert_eq!(labels(&folder, "stl").vertices, None);
    let part = folder.file("block.obj", BLOCK);
    let spread = folder.label(&part, &["--sites", "50", "--no-picture"]);
    assert!(spread.status.success(), "{}", text(&spread.stderr));
    assert_eq!(labels(&folder, "out").vertices, None);
}

#[test]
fn a_region_names_the_vertices_that_it_keeps_and_not_those_that_a_cut_makes() {
    let folder = Folder::new();
    let part = folder.file("block.obj", BLOCK);
    json(&label(&folder, &part, "out", &["--json", "--only", "box:-1,-1,7,11,11,11"]));
    let vertices = labels(&folder, "out").vertices.unwrap();
    let n_kept = vertices.vertex_index.iter().filter(|v| **v >= 0).count();
    assert_eq!(vertices.vertex_index[..n_kept], [1, 6, 7, 8, 9]);
    assert!(n_kept < vertices.vertex_index.len(), "corners at z = 7");
    assert_eq!(vertices.site_of_vertex[..3], [-1, 0, -1]);
}

#[test]
fn the_matrix_is_that_computed_by_hand_in_both_forms_and_on_any_number_of_threads() {
    let folder = Folder::new();
    let part = folder.file("block.obj", BLOCK);
    let more = ["--directions", "list:0,0,1;1,0,0", "--matrix", "npz,txt", "--safety-status"];
    let row = |row: [u8; 15]| row.map(|x| x.to_string()).join(" ") + "\n";
    for (out, threads) in [("one", "1"), ("three", "3")] {
        let result = json(&label(
            &folder,
            &part,
            out,
            &[&more[..], &["--json", "--threads", threads]].concat(),
        ));
        let facts = &result["matrices"][0];
        assert_eq!((&facts["n_directions"], &facts["n_sites"]), (&2.into(), &13.into()), "{facts}");
        assert_eq!(facts["n_between"], 0);
        let of_sites = |row: [u8; 15]| VERTEX_INDEX.map(|v| row[v as usize] == 1);
        let n: usize =
            [FROM_ABOVE, FROM_X].map(|r| of_sites(r).iter().filter(|x| **x).count()).iter().sum();
        assert_eq!(facts["n_accessible_pairs"], n);
        assert_eq!(
            read(&folder, &format!("{out}/visibility_matrix.txt")),
            row(FROM_ABOVE) + &row(FROM_X)
        );
        let status: String =
            FROM_ABOVE.iter().zip(FROM_X).map(|(a, b)| format!("{}\n", a | b)).collect();
        assert_eq!(read(&folder, &format!("{out}/safety_status.txt")), status);
        let path = folder.path(&format!("{out}/matrix.npz"));
        let file = MatrixFile::read(Path::new(&path)).unwrap();
        for (k, by_hand) in [FROM_ABOVE, FROM_X].into_iter().enumerate() {
            let found: Vec<bool> = (0..13).map(|i| file.matrix.is_accessible(k, i)).collect();
            assert_eq!(found, of_sites(by_hand), "{k}");
        }
        assert_eq!(file.directions, [deepmill::glam::Vec3::Z, deepmill::glam::Vec3::X]);
        assert_eq!(file.vertices.unwrap().site_of_vertex, SITE_OF_VERTEX);
    }
    for name in ["matrix.npz", "visibility_matrix.txt", "safety_status.txt"] {
        let bytes = |out: &str| std::fs::read(folder.path(&format!("{out}/{name}"))).unwrap();
        assert!(bytes("one") == bytes("three"), "{name}");
    }
}

/// A ring of 24 × 12 facets, R 14 and r 6 mm, as an OBJ.
fn ring(folder: &Folder) -> String {
    let mesh = solids::torus(14.0, 6.0, 24, 12);
    let vertices: String =
        mesh.vertices.iter().map(|v| format!("v {} {} {}\n", v.x, v.y, v.z)).collect();
    let faces: String = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| v + 1))
        .map(|[a, b, c]| format!("f {a} {b} {c}\n"))
        .collect();
    folder.file("ring.obj", vertices + &faces)
}

#[test]
fn a_site_is_accessible_exactly_if_some_row_has_it_and_one_that_the_tip_does_not_fit_is_not_safe() {
    let folder = Folder::new();
    let part = ring(&folder);
    for (out, cutter, obstacles) in [
        ("wide", "7,30,7,5", "part"),
        ("holder", "1.5,4,12,5", "part"),
        ("points", "1.5,4,12,5", "published"),
    ] {
        let (dir, bottom) = (folder.path(out), ["--bottom", "none"]);
        let args = [
            "label",
            &part,
            "--cutter",
            cutter,
            "--sites",
            "vertices",
            "--no-picture",
            "--out",
            &dir,
            "--directions",
            "deepmill++",
            "--search",
            "0",
            "--matrix",
            "txt",
            "--safety-status",
            "--obstacles",
            obstacles,
            "--json",
        ];
        let bottom = if obstacles == "published" { &bottom[..] } else { &[] };
        let result = json(&deepmill(&[&args[..], bottom].concat()));
        assert_eq!(result["matrices"][0]["n_between"], 0, "{out}");
        // The matrix searches longer than the labels, but not so that it shows on this part.
        assert_eq!(result["matrices"][0]["n_left_out"], 0, "{out}");
        let found = labels(&folder, out);
        let accessible = found.labels.answers.accessible();
        let path = folder.path(&format!("{out}/visibility_matrix.txt"));
        let matrix = AccessMatrix::read_text(Path::new(&path)).unwrap();
        assert_eq!((matrix.n_directions(), matrix.n_sites()), (102, 288));
        assert!(matrix.reached() == accessible, "{out}");
        let path = folder.path(&format!("{out}/safety_status.txt"));
        assert!(safety::read(Path::new(&path)).unwrap() == accessible, "{out}");
        assert!(accessible.contains(&true) && accessible.contains(&false), "{out}");
        let tip = found.labels.answers.tip_does_not_fit();
        assert_eq!(out == "wide", tip.contains(&true), "{out}");
    }
}

#[test]
fn a_status_and_a_matrix_of_another_program_are_held_against_the_labels() {
    let folder = Folder::new();
    let part = folder.file("block.obj", BLOCK);
    let more =
        ["--directions", "list:0,0,1;1,0,0", "--matrix", "npz,txt", "--safety-status", "--json"];
    json(&label(&folder, &part, "out", &more));
    let out = folder.path("out");
    let compare = |file: &str| deepmill(&["report", &out, "--compare", file, "--json"]);
    let own = json(&compare(&folder.path("out/safety_status.txt")));
    assert_eq!(
        (&own["status"]["n_agreed"], &own["status"]["n_compared"]),
        (&14.into(), &14.into())
    );
    assert_eq!(own["status"]["n_left_out"], 1);
    // Two vertices turned: one that is reached, one that is not.
    let mut lines: Vec<String> =
        read(&folder, "out/safety_status.txt").lines().map(str::to_owned).collect();
    (lines[1], lines[2]) = ("0".into(), "1".into());
    let other = json(&compare(&folder.file("other.txt", lines.join("\n"))));
    assert_eq!(other["status"]["n_agreed"], 12);
    let matrix = read(&folder, "out/visibility_matrix.txt").replacen("0 1 0 0", "0 1 1 0", 1);
    let matrix = json(&compare(&folder.file("matrix.txt", matrix)));
    assert_eq!(matrix["status"]["n_agreed"], 13);
    assert_eq!(matrix["status"]["n_different_pairs"], 1);
    assert_eq!(matrix["status"]["n_pairs"], 30);
    for (content, words) in [
        ("1\n0\n", "2 entries, the labels have 15 vertices of the part's file"),
        ("1\nyes\n", "line 2: column 1 is `yes`, neither 0 nor 1"),
        ("1\n\n0\n", "line 2: `` is neither 0 nor 1"),
        ("0 1\n0 2\n", "line 2: column 2 is `2`"),
        ("", "it holds no number"),
    ] {
        let message = failure(&compare(&folder.file("bad.txt", content)), 1);
        assert!(message.contains("bad.txt") && message.contains(words), "{message}");
    }
}

#[test]
fn impossible_forms_and_weights_are_refused_before_the_work() {
    let folder = Folder::new();
    let part = folder.file("block.obj", BLOCK);
    let refused = |more: &[&str], words: &str| {
        let message = failure(&label(&folder, &part, "out", more), 2);
        assert!(message.contains(words), "{message}");
    };
    refused(&["--matrix", "csv"], "--matrix is `csv`");
    refused(&["--normals", "mean"], "--normals is `mean`");
    let out = folder.path("out");
    let spread = ["label", &part, "--cutter", "1.5,6,40,5", "--normals", "area", "--out", &out];
    let message = failure(&deepmill(&spread), 2);
    assert!(message.contains("--normals is `area` with --sites 7000"), "{message}");
    assert!(!Path::new(&out).exists());
}

#[test]
fn area_weighs_the_normals_if_it_is_asked_for_and_files_say_so() {
    let folder = Folder::new();
    let part = folder.file("block.obj", BLOCK);
    json(&label(&folder, &part, "angle", &["--json", "--normals", "angle"]));
    json(&label(&folder, &part, "default", &["--json"]));
    json(&label(&folder, &part, "area", &["--json", "--normals", "area"]));
    let bytes = |out: &str| std::fs::read(folder.path(&format!("{out}/labels.npz"))).unwrap();
    assert!(bytes("angle") == bytes("default"));
    let by_area = labels(&folder, "area");
    // Corner (0, 10, 10): two triangles of 25 mm² of the left and the top face each, one or two of the quad's 50 mm².
    let normal = by_area.sites.normals[7].to_array();
    assert!((normal[0] + normal[2]).abs() < 1e-6 && normal[1] > 0.9 * normal[2], "{normal:?}");
    let one = normal[1] / normal[2];
    assert!((one - 1.0).abs() < 1e-5 || (one - 2.0).abs() < 1e-5, "{one}");
    let settings = by_area.provenance.settings.sites.unwrap();
    assert_eq!(settings.vertex_normals.as_deref(), Some("area"));
    assert_eq!(labels(&folder, "angle").provenance.settings.sites.unwrap().vertex_normals, None);
}

#[test]
fn of_several_parts_each_has_its_folder_and_a_bad_one_does_not_lose_the_others() {
    let folder = Folder::new();
    let (block, ring) = (folder.file("block.obj", BLOCK), ring(&folder));
    let bad = folder.file("bad.obj", "v 0 0\n");
    let out = folder.path("all");
    let parts = ["label", &block, &bad, &ring, "--cutter", "1.5,6,40,5", "--out", &out];
    let more = ["--sites", "vertices", "--safety-status", "--no-picture"];
    let all = deepmill(&[&parts[..], &more].concat());
    let message = failure(&all, 1);
    assert!(message.contains("1 of 3 are not labeled: bad.obj"), "{message}");
    assert!(text(&all.stderr).contains("warning: bad.obj is not labeled: "));
    for name in ["block", "ring"] {
        let single = folder.path(name);
        let part = folder.path(&format!("{name}.obj"));
        let alone = ["label", &part, "--cutter", "1.5,6,40,5", "--out", &single];
        json(&deepmill(&[&alone[..], &more, &["--json"]].concat()));
        for file in ["labels.npz", "safety_status.txt", "findings.json", "part.stl"] {
            let bytes = |path: String| std::fs::read(path).unwrap();
            let (a, b) = (bytes(format!("{out}/{name}/{file}")), bytes(format!("{single}/{file}")));
            assert!(a == b, "{name} {file}");
        }
    }
    assert!(!Path::new(&format!("{out}/bad/labels.npz")).exists());
    let good = ["label", &block, &ring, "--cutter", "1.5,6,40,5", "--out", &out, "--json"];
    let result = json(&deepmill(&[&good[..], &more].concat()));
    assert_eq!(result["n_failed"], 0);
    assert_eq!(result["parts"][1]["folder"], "ring");
    assert!(result["parts"][1]["files"].as_array().unwrap().len() > 3, "{result}");
    let message =
        failure(&deepmill(&["label", &block, &block, "--cutter", "1,2,3,4", "--out", &out]), 2);
    assert!(message.contains("block.obj"), "{message}");
}
