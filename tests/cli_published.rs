//! What importing the authors' form of data promises, on a made sample that plain loops labeled.
#![cfg(feature = "cli")]

mod command;
mod published_rule;

use command::{Folder, deepmill, failure, json, text};
use deepmill::rng::{Purpose, Stream};
use glam::{DVec3, Vec3};

const CUTTER: [f64; 4] = [1.0, 0.5, 20.0, 6.0];
/// Length of a unit of the normalized points, mm.
const MM_PER_UNIT: f64 = 23.4;

/// Walls, top and pocket of a block, mm.
fn block_with_pocket() -> (Vec<DVec3>, Vec<DVec3>) {
    let mut stream = Stream::new(11, 0, 0, Purpose::Probe);
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for k in 0..560 {
        let [a, b] = [0, 1].map(|_| stream.range(-1.0, 1.0));
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let (point, normal) = match k % 7 {
            0 => (DVec3::new(18.0 * a, 16.0 * b, 0.0), DVec3::NEG_Z),
            1 => (DVec3::new(18.0 * side, 16.0 * a, 10.0 + 10.0 * b), DVec3::X * side),
            2 => (DVec3::new(18.0 * a, 16.0 * side, 10.0 + 10.0 * b), DVec3::Y * side),
            3 => (DVec3::new(12.0 * side + 6.0 * a, 16.0 * b, 20.0), DVec3::Z),
            4 => (DVec3::new(6.0 * side, 6.0 * a, 12.0 + 8.0 * b), DVec3::X * -side),
            5 => (DVec3::new(6.0 * a, 6.0 * side, 12.0 + 8.0 * b), DVec3::Y * -side),
            _ => (DVec3::new(6.0 * a, 6.0 * b, 4.0), DVec3::Z),
        };
        points.push(point);
        normals.push(normal);
    }
    (points, normals)
}

/// Writes the sample as the authors do: centered, scaled to ±0.8, six decimals, label 1 for accessible. Returns its
/// number of occlusion points.
fn write(folder: &Folder) -> (String, usize) {
    let (mut points, normals) = block_with_pocket();
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    points.iter_mut().for_each(|p| *p -= mean);
    let greatest = points.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    points.iter_mut().for_each(|p| *p *= 0.8 / greatest);
    let rounded = |p: &DVec3| ((*p * 1e6).round() / 1e6 * MM_PER_UNIT).as_vec3();
    let in_mm: Vec<Vec3> = points.iter().map(rounded).collect();
    let unit: Vec<Vec3> = normals.iter().map(|n| n.as_vec3()).collect();
    let labels = published_rule::label(&in_mm, &unit, CUTTER, 1.0, None);
    let mut lines = String::new();
    for (i, (p, n)) in points.iter().zip(&normals).enumerate() {
        let [a, b] = [!labels.inaccessible[i], labels.occlusion[i]].map(u8::from);
        lines += &format!("{:.6} {:.6} {:.6} {:.6} {:.6} {:.6}", p.x, p.y, p.z, n.x, n.y, n.z);
        lines += &format!(" {a}.000000 {b}.000000\n");
    }
    for name in ["raw_data/models", "raw_data/models_cutter"] {
        std::fs::create_dir_all(folder.path(name)).unwrap();
    }
    folder.file("raw_data/models/part.txt", lines);
    let [cr, ch, fr, fh] = CUTTER;
    folder.file("raw_data/models_cutter/part_cutter.txt", format!("{cr} {ch} {fr} {fh}"));
    let n_occlusion = labels.occlusion.iter().filter(|o| **o).count();
    assert_eq!(n_occlusion, (560 - labels.n_bottom) / 10);
    assert!(labels.n_bottom >= 80 && labels.inaccessible.iter().filter(|i| **i).count() > 100);
    (folder.path(""), n_occlusion)
}

#[test]
fn normalized_points_beside_millimeters_are_refused_with_the_options_that_help() {
    let folder = Folder::new();
    let (root, _) = write(&folder);
    let import = ["dataset", "import", &root, "--out", &folder.path("data")];
    let message = failure(&deepmill(&import), 1);
    for words in ["sample part", "normalized to ±0.8", "scale", "--mm-per-unit", "--recover-scale"]
    {
        assert!(message.contains(words), "{words}: {message}");
    }
    for scale in ["0", "-3", "nan", "inf"] {
        let message = failure(&deepmill(&[&import[..], &["--mm-per-unit", scale]].concat()), 2);
        assert!(message.contains("--mm-per-unit"), "{message}");
    }
    assert!(!std::path::Path::new(&folder.path("data/manifest.json")).exists());
}

#[test]
fn at_the_right_scale_exact_labels_are_the_stored_ones() {
    let folder = Folder::new();
    let (root, _) = write(&folder);
    let data = folder.path("data");
    let scale = MM_PER_UNIT.to_string();
    let import = ["dataset", "import", &root, "--out", &data, "--mm-per-unit", &scale, "--json"];
    let imported = json(&deepmill(&import));
    assert_eq!(imported["settings"]["directions"]["kind"], "published");
    assert_eq!(imported["settings"]["bottom_mm"], 1.0);
    assert_eq!(imported["settings"]["occlusion_rounding"], "floor");
    let scores = json(&deepmill(&["eval", "--data", &data, "--exact", "--json"]));
    let rows = scores["per_sample"].as_array().unwrap();
    let exact = rows.iter().find(|row| row["engine"] == "exact labeler").unwrap();
    for score in ["acc_i", "f1_i", "acc_o", "f1_o"] {
        assert_eq!(exact[score], 1.0, "{score}: {exact}");
    }
    // The parts of the earlier rule are another definition.
    let earlier = folder.path("earlier");
    let parts = ["--directions", "150", "--bottom", "none", "--occlusion-rounding", "ceil"];
    let import = ["dataset", "import", &root, "--out", &earlier, "--mm-per-unit", &scale];
    assert!(deepmill(&[&import[..], &parts].concat()).status.success());
    let scores = json(&deepmill(&["eval", "--data", &earlier, "--exact", "--json"]));
    let rows = scores["per_sample"].as_array().unwrap();
    let exact = rows.iter().find(|row| row["engine"] == "exact labeler").unwrap();
    assert!(exact["acc_i"].as_f64().unwrap() < 0.9, "{exact}");
}

#[test]
fn the_scale_is_found_by_the_labels() {
    let folder = Folder::new();
    let (root, n_occlusion) = write(&folder);
    let data = folder.path("data");
    let output = deepmill(&["dataset", "import", &root, "--out", &data, "--recover-scale"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout) + &text(&output.stderr);
    let manifest = std::fs::read_to_string(folder.path("data/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let scale = manifest["parts"][0]["content"]["scale"].as_f64().unwrap();
    assert!((scale - MM_PER_UNIT).abs() < 0.11, "{scale}: {said}");
    assert!(said.contains("mm per unit") && said.contains("of the labels agree"), "{said}");
    let words = format!("{n_occlusion} occlusion points ({n_occlusion} stored)");
    assert!(said.contains(&words), "{words}: {said}");
}
