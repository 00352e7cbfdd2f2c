//! Running the program, and what the tests of the command line need beside it.
#![allow(dead_code)] // Each test file uses some of it.

use deepmill::geom::solids;
use deepmill::glam::{DVec2, DVec3};
use serde_json::Value;
use std::process::{Command, Output};
use tempfile::TempDir;

pub const CUTTER: &str = "1.5,6,40,5";

pub fn deepmill(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_deepmill")).args(args).output().unwrap()
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The JSON object on standard output.
pub fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The program's last words, after checking that it failed in the promised way.
pub fn failure(output: &Output, code: i32) -> String {
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    let errors: Vec<&str> = stderr.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "one error: {stderr}");
    assert!(stderr.ends_with(&format!("{}\n", errors[0])), "the error is the last line: {stderr}");
    assert!(errors[0].contains("; "), "with a remedy: {stderr}");
    errors[0].into()
}

pub type Corner = [f32; 3];

/// The twelve triangles of a box, counter-clockwise from outside.
pub fn block(low: Corner, high: Corner) -> Vec<[Corner; 3]> {
    let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { high[k] } else { low[k] });
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let split = |q: &[usize; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(corner));
    quads.iter().flat_map(split).collect()
}

pub fn stl(triangles: &[[Corner; 3]]) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0u8; 12]);
        triangle.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().into()
    }

    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        std::fs::write(self.path(name), content).unwrap();
        self.path(name)
    }

    /// A block 40 × 30 × 20 mm.
    pub fn block(&self) -> String {
        self.file("block.stl", stl(&block([0.0; 3], [40.0, 30.0, 20.0])))
    }

    pub fn label(&self, part: &str, more: &[&str]) -> Output {
        let out = self.path("out");
        deepmill(&[&["label", part, "--cutter", CUTTER, "--out", &out], more].concat())
    }
}

/// `label --json` with these tools, 400 sites and no picture.
pub fn label_tools(folder: &Folder, out: &str, tools: &[&str]) -> Value {
    let (part, out) = (folder.block(), folder.path(out));
    let args = ["label", &part, "--out", &out, "--sites", "400", "--no-picture", "--json"];
    json(&deepmill(&[&args, tools].concat()))
}

/// A block 44 × 30 × 20 mm with a groove along y, `width` wide and `depth` deep.
pub fn grooved(folder: &Folder, width: f32, depth: f32) -> String {
    let (left, right, floor) = (22.0 - 0.5 * width, 22.0 + 0.5 * width, 20.0 - depth);
    let outline = [
        [0.0, 0.0],
        [44.0, 0.0],
        [44.0, 20.0],
        [right, 20.0],
        [right, floor],
        [left, floor],
        [left, 20.0],
        [0.0, 20.0],
    ];
    let corner = |k: usize, y: f32| [outline[k][0], y, outline[k][1]];
    let end = [[0, 1, 4], [0, 4, 5], [1, 2, 4], [2, 3, 4], [0, 5, 7], [5, 6, 7]];
    let mut triangles: Vec<_> = end.iter().map(|t| t.map(|k| corner(k, 0.0))).collect();
    triangles.extend(end.iter().map(|[a, b, c]| [*a, *c, *b].map(|k| corner(k, 30.0))));
    for k in 0..8 {
        let [a, b, c, d] = [(k, 0.0), (k, 30.0), ((k + 1) % 8, 30.0), ((k + 1) % 8, 0.0)]
            .map(|(k, y)| corner(k, y));
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    folder.file("groove.stl", stl(&triangles))
}

/// A T-slot along y: 11 mm wide at its mouth, 21.2 below the lips, 9 mm high there.
pub fn t_slot() -> Vec<u8> {
    let half = [[30.0, 0.0], [30.0, 40.0], [5.5, 40.0], [5.5, 28.0], [10.6, 28.0], [10.6, 19.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<DVec2> = half.iter().copied().chain(other).map(DVec2::from_array).collect();
    let right = [[0, 4, 5], [0, 1, 4], [1, 2, 4], [2, 3, 4]];
    let left = right.map(|[a, b, c]| [11 - a, 11 - c, 11 - b]);
    let cap = [&[[0, 5, 6], [0, 6, 11]][..], &right, &left].concat();
    let mut mesh = solids::prism(&outline, &cap, 40.0);
    mesh.vertices.iter_mut().for_each(|p| *p = DVec3::new(p.x, -p.z, p.y));
    let corners = |f: usize| mesh.corners(f).map(|p| p.as_vec3().to_array());
    stl(&(0..mesh.triangles.len()).map(corners).collect::<Vec<_>>())
}
