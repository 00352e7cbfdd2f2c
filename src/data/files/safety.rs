//! DeepMill++'s `safety_status.txt`: a line per vertex of the part's file, in its order, 1 where the tool reaches the
//! vertex and 0 where it does not.

use super::matrix::truth;
use crate::geom::file_vertices::SiteVertices;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use std::path::Path;

/// Per vertex of the part's file, whether the tool reaches the site there; not where no site is.
pub fn of_vertices(accessible: &[bool], vertices: &SiteVertices) -> Vec<bool> {
    let of = |site: &i64| usize::try_from(*site).is_ok_and(|site| accessible[site]);
    vertices.site_of_vertex.iter().map(of).collect()
}

/// Writes a line for each.
///
/// # Errors
/// If the system refuses the file.
pub fn write(path: &Path, accessible: &[bool]) -> Result<()> {
    let lines: Vec<u8> =
        accessible.iter().flat_map(|reached| [b'0' + u8::from(*reached), b'\n']).collect();
    atomic_file::write_atomic(path, |writer| writer.write_all(&lines))
}

/// Reads them.
///
/// # Errors
/// If a line is neither 0 nor 1, or there is none. Empty lines are passed over at the end alone, since lines count the
/// vertices.
pub fn read(path: &Path) -> Result<Vec<bool>> {
    const REMEDY: &str =
        "write a line per vertex: 1 where the tool reaches it, 0 where it does not";
    let text = input_file::read_text(path, input_file::TEXT)?;
    let text = text.trim_end();
    if text.is_empty() {
        return Err(Error::file(path, "text", "it holds no line", REMEDY));
    }
    let status = |(i, line): (usize, &str)| {
        truth(line.trim()).ok_or_else(|| {
            let shown: String = line.trim().escape_debug().take(20).collect();
            let found = format!("`{shown}` is neither 0 nor 1");
            Error::file(path, format!("line {}", i + 1), found, REMEDY)
        })
    };
    text.lines().enumerate().map(status).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertex_has_the_answer_of_its_site_and_unused_ones_are_not_reached() {
        let vertices = SiteVertices { vertex_index: vec![1, 2], site_of_vertex: vec![-1, 0, 1, 0] };
        assert_eq!(of_vertices(&[true, false], &vertices), [false, true, false, true]);
    }

    #[test]
    fn lines_come_back_and_others_are_refused_with_their_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("safety_status.txt");
        write(&path, &[true, false, true]).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "1\n0\n1\n");
        assert_eq!(read(&path).unwrap(), [true, false, true]);
        for (text, words) in [
            ("", "it holds no line"),
            (" \n\n", "it holds no line"),
            ("1\n\n0\n", "line 2: `` is neither 0 nor 1"),
            ("1\n0 1\n", "line 2: `0 1`"),
            ("1\n2\n", "line 2: `2`"),
            ("safe\n", "line 1: `safe`"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("per vertex"), "{message}");
        }
        std::fs::write(&path, "1\r\n0\r\n\r\n").unwrap();
        assert_eq!(read(&path).unwrap(), [true, false]);
    }
}
