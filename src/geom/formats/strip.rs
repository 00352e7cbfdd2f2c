//! Triangle strips: every corner after the second makes a triangle with the two before it.
//!
//! ```text
//! a strip a b c d e … holds  (a b c) (c b d) (c d e) …: every other one is turned, so that all face the same side
//! -1 ends a strip within its list; triangles that use a corner twice only lead on and are left out
//! ```

use super::Mesh;
use crate::{Error, Result};
use std::path::Path;

/// Ends a strip; the greatest number of 32 bits, where the list has no sign.
const RESTART: [i64; 2] = [-1, u32::MAX as i64];

/// Lists of strips, each with its place in the file.
#[derive(Default)]
pub(super) struct Strips {
    corners: Vec<i64>,
    /// End in `corners` of every list.
    ends: Vec<usize>,
}

impl Strips {
    /// A list as the file has it.
    pub(super) fn push(&mut self, list: &[i64]) {
        self.corners.extend_from_slice(list);
        self.ends.push(self.corners.len());
    }

    /// Checks every index and appends every triangle.
    pub(super) fn append_to(&self, mesh: &mut Mesh, path: &Path) -> Result<()> {
        let mut begin = 0;
        for (k, &end) in self.ends.iter().enumerate() {
            for strip in self.corners[begin..end].split(|c| RESTART.contains(c)) {
                append(strip, mesh).map_err(|found| {
                    let remedy = "export the part again, as triangles if the program can";
                    Error::file(path, format!("triangle strip {k}"), found, remedy)
                })?;
            }
            begin = end;
        }
        Ok(())
    }
}

fn append(strip: &[i64], mesh: &mut Mesh) -> std::result::Result<(), String> {
    let n = mesh.vertices.len();
    let exists = |c: i64| usize::try_from(c).is_ok_and(|c| c < n);
    match (strip.len(), strip.iter().find(|c| !exists(**c))) {
        (_, Some(c)) => return Err(format!("vertex {c} of {n}, counted from 0, does not exist")),
        (n @ 1..3, None) => return Err(format!("a strip has {n} corners, at least 3 are needed")),
        _ => {}
    }
    for (k, corners) in strip.windows(3).enumerate() {
        let [a, b, c] = [0, 1, 2].map(|i| corners[i] as u32);
        let triangle = if k % 2 == 0 { [a, b, c] } else { [b, a, c] };
        if a != b && b != c && c != a {
            mesh.triangles.push(triangle);
        }
    }
    Ok(())
}
