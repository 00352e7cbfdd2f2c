//! The tool on the page of a report: its outline, and where it is at every site that it reaches.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, block, deepmill, json, stl, t_slot};
use deepmill::data::files::LabelFile;
use deepmill::glam::{DVec3, Vec3};
use serde_json::Value;
use std::io::Read;

/// A page as its script has it.
struct Page {
    about: Value,
    block: Vec<u8>,
}

/// A pose, as `data.js` has it.
#[derive(Debug, Clone, Copy)]
struct Pose {
    axis: Vec3,
    tip: DVec3,
}

impl Page {
    fn read(path: &str) -> Self {
        let html = std::fs::read_to_string(path).unwrap();
        let script = |start: &str| {
            html.split(start).nth(1).unwrap().split("</script>").next().unwrap().to_owned()
        };
        let about = script("id=\"about\" type=\"application/json\">");
        let packed = from_base64(script("id=\"block\" type=\"text/plain\">").trim());
        let mut block = Vec::new();
        flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut block).unwrap();
        Page { about: serde_json::from_str(&about).unwrap(), block }
    }

    /// Numbers of four bytes, whose first bytes come first.
    fn words(&self, name: &str) -> Vec<u32> {
        let part = &self.about["parts"][name];
        let [at, length] = [0, 1].map(|k| part[k].as_u64().unwrap() as usize);
        let (bytes, n) = (&self.block[at..at + length], length / 4);
        let word = |i: usize| u32::from_le_bytes([0, 1, 2, 3].map(|k| bytes[k * n + i]));
        (0..n).map(word).collect()
    }

    /// The poses of a tab at these sites.
    fn poses(&self, view: usize, points: &[Vec3]) -> Vec<Option<Pose>> {
        let pose = &self.about["views"][view]["pose"];
        let step_mm = pose["step_mm"].as_f64().unwrap();
        let axes = self.words(&format!("view{view}.axes"));
        let axis = |row: usize| {
            Vec3::from_array([0, 1, 2].map(|k| f32::from_bits(axes[3 * (row - 1) + k])))
        };
        let tips = [0, 1, 2].map(|k| self.words(&format!("view{view}.tip{k}")));
        let zigzag = |code: u32| f64::from((code >> 1) as i32 ^ -((code & 1) as i32));
        let mut next = 0;
        let rows = self.words(&format!("view{view}.axis"));
        let of = |(p, row): (&Vec3, u32)| {
            (row > 0).then(|| {
                let offset = [0, 1, 2].map(|k| step_mm * zigzag(tips[k][next]));
                next += 1;
                Pose { axis: axis(row as usize), tip: p.as_dvec3() + DVec3::from_array(offset) }
            })
        };
        points.iter().zip(rows).map(of).collect()
    }

    /// Radius and height of the corners of a tool's outline.
    fn points(&self, tool: usize) -> Vec<[f64; 2]> {
        let points = self.about["tools"][tool]["points"].as_array().unwrap();
        points.iter().map(|p| [0, 1].map(|k| p[k].as_f64().unwrap())).collect()
    }
}

fn from_base64(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => 0,
    };
    let bytes = |four: &[u8]| {
        let bits = four.iter().fold(0u32, |bits, c| bits << 6 | u32::from(digit(*c)));
        let n = 3 - four.iter().filter(|c| **c == b'=').count();
        (0..n).map(move |k| (bits >> (16 - 8 * k)) as u8).collect::<Vec<u8>>()
    };
    text.as_bytes().chunks(4).flat_map(bytes).collect()
}

/// What of the tool may be left where it touches, and the steps of the page.
const ABOUT_MM: f64 = 0.03;

/// Page and labels of a block of 40 × 30 × 20 mm and a ball end of R3.
fn ball_on_block(more: &[&str]) -> (Page, LabelFile) {
    let folder = Folder::new();
    let part = folder.file("block.stl", stl(&block([0.0; 3], [40.0, 30.0, 20.0])));
    let args = ["label", &part, "--out", &folder.path("out"), "--cutter", "3,20,15,40"];
    let pages = ["--sites", "600", "--no-picture", "--report", "--json"];
    json(&deepmill(&[&args[..], &pages, more].concat()));
    let file = LabelFile::read(folder.path("out/labels.npz").as_ref()).unwrap();
    (Page::read(&folder.path("out/report.html")), file)
}

#[test]
fn a_ball_is_drawn_on_the_surface_that_it_touches() {
    let (page, file) = ball_on_block(&["--directions", "up"]);
    let poses = page.poses(0, &file.sites.points);
    let mut n = [0; 3];
    for (i, pose) in poses.iter().enumerate() {
        let (p, normal) = (file.sites.points[i].as_dvec3(), file.sites.normals[i].as_dvec3());
        // By hand: nothing reaches the lower face, and elsewhere the center is 3 mm off along the normal.
        if normal.z < -0.5 {
            assert!(pose.is_none());
            n[0] += 1;
            continue;
        }
        let pose = pose.unwrap();
        assert_eq!(pose.axis, Vec3::Z);
        let center = pose.tip + DVec3::Z * 3.0;
        assert!(center.distance(p + normal * 3.0) < ABOUT_MM, "{i}: {p} {pose:?}");
        n[if normal.z > 0.5 { 1 } else { 2 }] += 1;
    }
    assert!(n.iter().all(|n| *n > 50), "{n:?}");
    // A quarter of a circle, the flank up to the nose at 2·3 + 20 mm, the holder of radius 15, 40 mm high.
    let points = page.points(0);
    let (corner, above) = points.split_at(points.len() - 4);
    assert_eq!(above, [[3.0, 26.0], [15.0, 26.0], [15.0, 66.0], [0.0, 66.0]]);
    assert!(corner.iter().all(|[r, h]| (r.hypot(3.0 - h) - 3.0).abs() < 2e-3), "{corner:?}");
    let portions = &page.about["tools"][0]["portions"];
    assert_eq!(*portions, serde_json::json!([[0, 26.0], [3, 66.0]]));
    assert_eq!(page.about["views"][0]["pose"]["tool"], 0);
}

#[test]
fn a_t_slot_cutter_is_drawn_in_its_slot_with_its_upper_face_below_the_lips() {
    let folder = Folder::new();
    let part = folder.file("slot.stl", t_slot());
    let table = "name,profile,stick_out\ncutter,10.5:0 10.5:8.9 5:8.9 | 5:50 8:50,60\n";
    let tools = folder.file("tools.csv", table);
    let holder = folder.file("holder.csv", "height,lower,upper\n30,40,40\n");
    let args =
        ["label", &part, "--tools", &tools, "--holder", &holder, "--out", &folder.path("out")];
    let more = ["--sites", "1500", "--directions", "up", "--no-picture", "--report", "--json"];
    json(&deepmill(&[&args[..], &more].concat()));
    let page = Page::read(&folder.path("out/report.html"));
    let file = LabelFile::read(folder.path("out/cutter/labels.npz").as_ref()).unwrap();
    let poses = page.poses(1, &file.sites.points);
    let (mut n, mut n_inner) = (0, 0);
    for (i, pose) in poses.iter().enumerate() {
        let (p, normal) = (file.sites.points[i].as_dvec3(), file.sites.normals[i].as_dvec3());
        let is_under_lip = normal.z < -0.9 && (p.z - 28.0).abs() < 0.01;
        let Some(pose) = pose.filter(|_| is_under_lip) else { continue };
        // By hand: the face at height 8.9 is at the lip.
        assert!((pose.tip.z + 8.9 - 28.0).abs() < ABOUT_MM, "{i}: {pose:?}");
        assert_eq!(pose.axis, Vec3::Z);
        // The disc of radius 10.5 is between walls at ±10.6, unless it reaches out of an end, at 0 or -40.
        if (-29.0..-11.0).contains(&pose.tip.y) {
            assert!(pose.tip.x.abs() < 0.1 + ABOUT_MM, "{i}: {pose:?}");
            n_inner += 1;
        }
        // The disc is over the site, the neck is not.
        let away = (p - pose.tip).truncate().length();
        assert!((5.0 - ABOUT_MM..10.5 + ABOUT_MM).contains(&away), "{i}: {away}");
        n += 1;
    }
    assert!(n > 20 && n_inner > 5, "{n} {n_inner}");
    let by_hand = [
        [0.0, 0.0],
        [10.5, 0.0],
        [10.5, 8.9],
        [5.0, 8.9],
        [5.0, 50.0],
        [8.0, 50.0],
        [8.0, 60.0],
        [20.0, 60.0],
        [20.0, 90.0],
        [0.0, 90.0],
    ];
    assert_eq!(page.points(0), by_hand);
    let portions = serde_json::json!([[0, 8.9], [1, 50.0], [2, 60.0], [3, 90.0]]);
    assert_eq!(page.about["tools"][0]["portions"], portions);
    // In the tab of all tools, the first one that reaches.
    assert_eq!(page.about["views"][0]["pose"], "first");
}

#[test]
fn the_page_of_a_folder_has_the_poses_of_its_files_and_of_the_rest_those_that_leave_least() {
    let folder = Folder::new();
    let floor = block([0.0; 3], [40.0, 30.0, 10.0]);
    let wall = block([0.0; 3], [10.0, 30.0, 30.0]);
    let part = folder.file("angle.stl", stl(&[floor, wall].concat()));
    let out = folder.path("out");
    let args =
        ["label", &part, "--out", &out, "--sites", "1500", "--no-picture", "--rest", "--report"];
    let more = ["--cutter", "3,30,20,40", "--directions", "up", "--json"];
    json(&deepmill(&[&args[..], &more].concat()));
    let at = folder.path("out/report.html");
    let page = Page::read(&at);
    let file = LabelFile::read(folder.path("out/labels.npz").as_ref()).unwrap();
    let surface = file.labels.surface.as_ref().unwrap();
    let (answers, rests) = (page.poses(0, &file.sites.points), page.poses(1, &file.sites.points));
    let (mut n_reached, mut n_left) = (0, 0);
    for i in 0..file.sites.len() {
        let (witness, least) = (surface.witness[i], surface.rest_pose[i]);
        for (shown, pose) in [(answers[i], witness), (rests[i], witness.or(least))] {
            assert_eq!(shown.map(|shown| shown.axis), pose.map(|pose| pose.direction), "{i}");
            let Some((shown, pose)) = shown.zip(pose) else { continue };
            // Half a step of 3 mm / 2048 along each axis.
            assert!(shown.tip.distance(pose.tip_mm) < 0.0014, "{i}: {shown:?} {pose:?}");
        }
        n_reached += usize::from(witness.is_some());
        n_left += usize::from(witness.is_none() && least.is_some());
    }
    assert!(n_reached > 500 && n_left > 10, "{n_reached} {n_left}");
    assert!(deepmill(&["report", &out]).status.success());
    let again = Page::read(&at);
    assert_eq!(again.about["views"][0]["pose"], page.about["views"][0]["pose"]);
    assert_eq!((&again.about["tools"], &again.block), (&page.about["tools"], &page.block));
}

#[test]
fn by_the_published_definition_the_tool_touches_along_the_first_free_direction() {
    let (page, file) = ball_on_block(&["--obstacles", "published"]);
    let poses = page.poses(0, &file.sites.points);
    for (i, pose) in poses.iter().enumerate() {
        let first = file.labels.witness[i];
        assert_eq!(pose.is_some(), first.is_some());
        let Some(pose) = pose else { continue };
        // +z is the first of that set.
        assert!(first != Some(0) || pose.axis == Vec3::Z, "{i}: {pose:?}");
        let center = pose.tip + 3.0 * pose.axis.as_dvec3();
        let by_hand = file.sites.points[i].as_dvec3() + 3.0 * file.sites.normals[i].as_dvec3();
        assert!(center.distance(by_hand) < 0.002, "{i}: {pose:?}");
    }
    assert!(poses.iter().flatten().count() > 300);
}
