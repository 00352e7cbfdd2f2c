//! In which directions the tool may stand at each site: a matrix of a row per direction and a column per site, 1 where
//! it may.
//!
//! As an NPZ archive with directions and sites, and as the text of DeepMill++'s `visibility_matrix.txt`: a line per
//! direction, numbers 0 and 1 with a space between them, a column per vertex of the part's file.

use super::{Provenance, open, start, vertices};
use crate::access::CollisionMatrix;
use crate::access::surface::AccessibleDirections;
use crate::exec::memory;
use crate::geom::Sites;
use crate::geom::file_vertices::SiteVertices;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use glam::Vec3;
use serde_json::json;
use std::path::Path;

/// Sites of a word.
const WORD: usize = 64;
/// For each bit: rows of blocks and directions while it is computed, with copies; and as bytes of an archive.
const BYTES_OF_8: u64 = 8 + 8 * 4;
const ACCESSIBLE: &str = "accessible";
const DIRECTIONS: &str = "directions";
const REMEDY: &str =
    "write a line per direction, with a 0 or 1 for each site and spaces between them";

/// Per direction and site, whether the tool has a free pose there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessMatrix {
    n_sites: usize,
    /// Per direction: site `i` is bit `i % 64` of word `i / 64`, bits past the end are 0.
    rows: Vec<Vec<u64>>,
}

impl AccessMatrix {
    /// Without any accessible pair.
    pub fn closed(n_directions: usize, n_sites: usize) -> Self {
        AccessMatrix { n_sites, rows: vec![vec![0; n_sites.div_ceil(WORD)]; n_directions] }
    }

    /// By the mesh definition.
    pub fn of_directions(found: &AccessibleDirections) -> Self {
        let rows = (0..found.n_directions()).map(|k| found.words(k).to_vec());
        AccessMatrix { n_sites: found.n_sites(), rows: rows.collect() }
    }

    /// By the published definition: what does not collide.
    pub fn of_collisions(matrix: &CollisionMatrix) -> Self {
        let n_sites = matrix.n_queries();
        let free = |(w, word): (usize, &u64)| !word & past_end(n_sites, w);
        let row = |k: usize| matrix.words(k).iter().enumerate().map(free).collect();
        AccessMatrix { n_sites, rows: (0..matrix.n_dirs()).map(row).collect() }
    }

    /// Checks that a matrix of this size, and its files, fit into the memory.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if they do not.
    pub fn require_memory(n_directions: usize, n_sites: usize) -> Result<()> {
        let needed =
            memory::product([n_directions, n_sites.div_ceil(8)]).saturating_mul(BYTES_OF_8);
        let remedy =
            format!("take fewer directions ({n_directions}) or sites ({n_sites}), or leave it out");
        memory::require("the matrix of directions by sites", needed, remedy)
    }

    /// Number of directions.
    pub fn n_directions(&self) -> usize {
        self.rows.len()
    }

    /// Number of sites.
    pub fn n_sites(&self) -> usize {
        self.n_sites
    }

    /// Whether the tool may stand at a site in a direction.
    ///
    /// # Panics
    /// If either is out of range.
    pub fn is_accessible(&self, direction: usize, site: usize) -> bool {
        assert!(site < self.n_sites);
        self.rows[direction][site / WORD] >> (site % WORD) & 1 == 1
    }

    /// Notes that it may.
    ///
    /// # Panics
    /// As [`AccessMatrix::is_accessible`].
    pub fn open(&mut self, direction: usize, site: usize) {
        assert!(site < self.n_sites);
        self.rows[direction][site / WORD] |= 1 << (site % WORD);
    }

    /// Clears the entries of every site but these; returns how many sites had any.
    ///
    /// # Panics
    /// If there is not one entry per site.
    pub fn close_all_but(&mut self, kept: &[bool]) -> usize {
        assert_eq!(kept.len(), self.n_sites);
        let reached = self.reached();
        let mut mask = vec![0u64; self.n_sites.div_ceil(WORD)];
        kept.iter()
            .enumerate()
            .for_each(|(i, kept)| mask[i / WORD] |= u64::from(*kept) << (i % WORD));
        for row in &mut self.rows {
            row.iter_mut().zip(&mask).for_each(|(word, mask)| *word &= mask);
        }
        reached.iter().zip(kept).filter(|(reached, kept)| **reached && !**kept).count()
    }

    /// Per site, whether the tool has a free pose there in some direction.
    pub fn reached(&self) -> Vec<bool> {
        let any = |w: usize| self.rows.iter().fold(0, |any, row| any | row[w]);
        let words: Vec<u64> = (0..self.n_sites.div_ceil(WORD)).map(any).collect();
        (0..self.n_sites).map(|i| words[i / WORD] >> (i % WORD) & 1 == 1).collect()
    }

    /// Number of pairs in which it may.
    pub fn n_accessible(&self) -> u64 {
        self.rows.iter().flatten().map(|word| u64::from(word.count_ones())).sum()
    }

    /// Number of pairs of direction and site in which two matrices differ; `None` if they are of other sizes.
    pub fn n_different(&self, other: &AccessMatrix) -> Option<u64> {
        let same = self.n_sites == other.n_sites && self.rows.len() == other.rows.len();
        let pairs = || self.rows.iter().flatten().zip(other.rows.iter().flatten());
        same.then(|| pairs().map(|(a, b)| u64::from((a ^ b).count_ones())).sum())
    }

    /// With a column for every vertex of the part's file; 0 where none of the sites is.
    pub fn of_vertices(&self, vertices: &SiteVertices) -> AccessMatrix {
        let sites = &vertices.site_of_vertex;
        let mut found = AccessMatrix::closed(self.n_directions(), sites.len());
        for (v, site) in sites.iter().enumerate() {
            let Ok(site) = usize::try_from(*site) else { continue };
            for k in 0..self.n_directions() {
                found.rows[k][v / WORD] |=
                    (self.rows[k][site / WORD] >> (site % WORD) & 1) << (v % WORD);
            }
        }
        found
    }

    /// Writes the text form.
    ///
    /// # Errors
    /// If the system refuses the file.
    pub fn write_text(&self, path: &Path) -> Result<()> {
        atomic_file::write_atomic(path, |writer| {
            let mut line = Vec::with_capacity(2 * self.n_sites);
            for row in &self.rows {
                line.clear();
                for i in 0..self.n_sites {
                    line.extend([b'0' + (row[i / WORD] >> (i % WORD) & 1) as u8, b' ']);
                }
                if let Some(last) = line.last_mut() {
                    *last = b'\n';
                }
                writer.write_all(&line)?;
            }
            Ok(())
        })
    }

    /// Reads the text form, as NumPy's `loadtxt` does: what follows a `#` and empty lines are passed over, and `0.0` is
    /// a 0.
    ///
    /// # Errors
    /// If a line has another number of columns than the first, an entry is neither 0 nor 1, or there is none.
    pub fn read_text(path: &Path) -> Result<Self> {
        let text = input_file::read_text(path, input_file::TEXT)?;
        let mut found = AccessMatrix { n_sites: 0, rows: Vec::new() };
        for (number, line) in text.lines().enumerate() {
            let bad =
                |found: String| Error::file(path, format!("line {}", number + 1), found, REMEDY);
            let line = line.split('#').next().unwrap_or_default();
            let (mut row, mut n) = (Vec::new(), 0);
            for token in line.split_whitespace() {
                let bit = truth(token).ok_or_else(|| {
                    let token: String = token.escape_debug().take(20).collect();
                    bad(format!("column {} is `{token}`, neither 0 nor 1", n + 1))
                })?;
                if n % WORD == 0 {
                    row.push(0);
                }
                row[n / WORD] |= u64::from(bit) << (n % WORD);
                n += 1;
            }
            if n == 0 {
                continue;
            }
            if !found.rows.is_empty() && n != found.n_sites {
                return Err(bad(format!("{n} columns after a line of {}", found.n_sites)));
            }
            found.n_sites = n;
            found.rows.push(row);
        }
        match found.rows.is_empty() {
            true => Err(Error::file(path, "text", "it holds no number", REMEDY)),
            false => Ok(found),
        }
    }
}

/// Bits of word `w` that are sites.
fn past_end(n_sites: usize, w: usize) -> u64 {
    match n_sites - w * WORD {
        left if left < WORD => (1 << left) - 1,
        _ => u64::MAX,
    }
}

/// 0 or 1, however it is written.
pub(super) fn truth(token: &str) -> Option<bool> {
    match token {
        "0" => Some(false),
        "1" => Some(true),
        _ => match token.parse::<f64>() {
            Ok(0.0) => Some(false),
            Ok(1.0) => Some(true),
            _ => None,
        },
    }
}

/// The matrix of one part and tool, with its directions and sites.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MatrixFile {
    /// Part, tool and settings.
    pub provenance: Provenance,
    /// The columns.
    pub sites: Sites,
    /// The rows: unit vectors from tip to spindle.
    pub directions: Vec<Vec3>,
    /// The entries.
    pub matrix: AccessMatrix,
    /// The vertices of the part's file that the sites are at, if they are known.
    pub vertices: Option<SiteVertices>,
}

impl MatrixFile {
    const FORMAT: &str = "deepmill matrix";

    /// Writes an NPZ archive.
    ///
    /// # Errors
    /// If the matrix has not a row per direction and a column per site, or the system refuses the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (n_directions, n) = (self.directions.len(), self.sites.len());
        require_shape(path, &self.matrix, (n_directions, n))?;
        let entries = (0..n_directions).flat_map(|k| (0..n).map(move |i| (k, i)));
        let entries: Vec<bool> = entries.map(|(k, i)| self.matrix.is_accessible(k, i)).collect();
        let mut npz = start(&self.sites, &self.provenance);
        npz.vectors(DIRECTIONS, &self.directions);
        npz.array(ACCESSIBLE, &[n_directions, n], &entries);
        let mut meaning = json!({
            "directions": "unit vectors from tip to spindle, the rows of `accessible`",
            "accessible": "row: direction, column: site; true: the tool may stand at the site in the direction, the tip fits too",
        });
        vertices::add(path, &mut npz, self.vertices.as_ref(), (n, &mut meaning))?;
        npz.metadata(&self.provenance.metadata(Self::FORMAT, meaning));
        npz.write(path)
    }

    /// Reads a file that [`MatrixFile::write`] has written.
    ///
    /// # Errors
    /// If it is no such file, or an array is missing or of another size than directions and sites have.
    pub fn read(path: &Path) -> Result<Self> {
        let (mut npz, provenance, sites) = open(path, Self::FORMAT)?;
        let directions = npz.vectors(DIRECTIONS)?;
        let n = sites.len();
        let entries = npz.bool_rows(ACCESSIBLE, n)?;
        let mut matrix = AccessMatrix::closed(entries.len() / n.max(1), n);
        for (k, _) in entries.iter().enumerate().filter(|(_, open)| **open) {
            matrix.open(k / n, k % n);
        }
        require_shape(path, &matrix, (directions.len(), n))?;
        let vertices = vertices::read(path, &mut npz, &sites)?;
        Ok(MatrixFile { provenance, sites, directions, matrix, vertices })
    }
}

fn require_shape(
    path: &Path,
    matrix: &AccessMatrix,
    (n_directions, n): (usize, usize),
) -> Result<()> {
    let shape = (matrix.n_directions(), matrix.n_sites());
    if shape == (n_directions, n) {
        return Ok(());
    }
    let found =
        format!("{} rows of {} for {n_directions} directions and {n} sites", shape.0, shape.1);
    Err(Error::file(path, ACCESSIBLE, found, "store a row per direction and a column per site"))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{provenance, sites};
    use super::*;

    /// 3 directions, 70 sites: more than a word.
    fn matrix() -> AccessMatrix {
        let mut matrix = AccessMatrix::closed(3, 70);
        [(0, 0), (0, 69), (2, 64)].into_iter().for_each(|(k, i)| matrix.open(k, i));
        matrix
    }

    fn put(folder: &tempfile::TempDir, text: &str) -> std::path::PathBuf {
        let path = folder.path().join("visibility_matrix.txt");
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn text_has_a_line_per_direction_and_a_number_per_site() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.txt");
        let mut small = AccessMatrix::closed(2, 3);
        small.open(0, 1);
        small.write_text(&path).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "0 1 0\n0 0 0\n");
        matrix().write_text(&path).unwrap();
        assert_eq!(AccessMatrix::read_text(&path).unwrap(), matrix());
        assert_eq!((matrix().n_accessible(), matrix().n_different(&small)), (3, None));
        assert_eq!(matrix().n_different(&AccessMatrix::closed(3, 70)), Some(3));
        let reached = matrix().reached();
        let which: Vec<usize> = (0..70).filter(|&i| reached[i]).collect();
        assert_eq!(which, [0, 64, 69]);
    }

    #[test]
    fn text_is_read_as_loadtxt_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = put(&folder, "# made by hand\r\n\r\n 1.0\t0  1 # up\r\n0e0 1 1.000000e+00");
        let mut expected = AccessMatrix::closed(2, 3);
        [(0, 0), (0, 2), (1, 1), (1, 2)].into_iter().for_each(|(k, i)| expected.open(k, i));
        assert_eq!(AccessMatrix::read_text(&path).unwrap(), expected);
    }

    #[test]
    fn text_that_is_no_matrix_is_refused_with_line_and_remedy() {
        let folder = tempfile::tempdir().unwrap();
        for (text, words) in [
            ("", "it holds no number"),
            ("# nothing\n\n", "it holds no number"),
            ("0 1\n0 1 1\n", "line 2: 3 columns after a line of 2"),
            ("0 1\n1 2\n", "line 2: column 2 is `2`"),
            ("0,1\n", "line 1: column 1 is `0,1`"),
            ("0 0.5\n", "column 2 is `0.5`"),
            ("nan 1\n", "column 1 is `nan`"),
            ("1 -1\n", "column 2 is `-1`"),
            ("\u{1b}[31m\n", "column 1 is `\\u{1b}[31m`"),
        ] {
            let message = AccessMatrix::read_text(&put(&folder, text)).unwrap_err().to_string();
            assert!(message.contains(words) && message.ends_with(REMEDY), "{text:?}: {message}");
        }
        let path = folder.path().join("bytes.txt");
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(AccessMatrix::read_text(&path).unwrap_err().to_string().contains("UTF-8"));
    }

    #[test]
    fn a_column_of_every_vertex_is_that_of_its_site() {
        let vertices = SiteVertices { vertex_index: vec![0, 2], site_of_vertex: vec![0, -1, 1, 0] };
        let mut of_sites = AccessMatrix::closed(2, 2);
        [(0, 0), (1, 1)].into_iter().for_each(|(k, i)| of_sites.open(k, i));
        let mut expected = AccessMatrix::closed(2, 4);
        [(0, 0), (0, 3), (1, 2)].into_iter().for_each(|(k, v)| expected.open(k, v));
        assert_eq!(of_sites.of_vertices(&vertices), expected);
    }

    #[test]
    fn entries_of_sites_that_are_not_kept_are_cleared_and_counted() {
        let mut cleared = matrix();
        let kept: Vec<bool> = (0..70).map(|i| i == 0 || i == 5 || i == 64).collect();
        assert_eq!(cleared.close_all_but(&kept), 1);
        let mut expected = AccessMatrix::closed(3, 70);
        [(0, 0), (2, 64)].into_iter().for_each(|(k, i)| expected.open(k, i));
        assert_eq!(cleared, expected);
    }

    #[test]
    fn archives_come_back_exactly_and_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("matrix.npz");
        let mut matrix = AccessMatrix::closed(3, 2);
        [(0, 1), (2, 0)].into_iter().for_each(|(k, i)| matrix.open(k, i));
        let vertices = Some(SiteVertices { vertex_index: vec![1, 0], site_of_vertex: vec![1, 0] });
        let directions = vec![Vec3::X, Vec3::Y, Vec3::Z];
        let file =
            MatrixFile { provenance: provenance(), sites: sites(), directions, matrix, vertices };
        file.write(&path).unwrap();
        assert_eq!(MatrixFile::read(&path).unwrap(), file);
        let message = super::super::LabelFile::read(&path).unwrap_err().to_string();
        assert!(message.contains("deepmill matrix"), "{message}");
        let mut few = file.clone();
        few.directions.pop();
        let message = few.write(&path).unwrap_err().to_string();
        assert!(message.contains("3 rows of 2 for 2 directions and 2 sites"), "{message}");
        let hostile = |shape: &[usize], entries: &[u8], n_directions: usize| {
            let mut npz = start(&file.sites, &file.provenance);
            npz.vectors(DIRECTIONS, &vec![Vec3::Z; n_directions]).array(ACCESSIBLE, shape, entries);
            npz.metadata(&file.provenance.metadata(MatrixFile::FORMAT, json!({})));
            npz.write(&path).unwrap();
            MatrixFile::read(&path).unwrap_err().to_string()
        };
        for (message, words) in [
            (hostile(&[1, 2], &[0, 2], 1), "accessible: row 0 is 2"),
            (hostile(&[2, 1], &[0, 1], 2), "its shape is [2, 1], expected [n, 2]"),
            (hostile(&[4], &[0, 1, 0, 0], 2), "its shape is [4]"),
            (hostile(&[2, 2], &[0, 1, 0, 0], 3), "2 rows of 2 for 3 directions and 2 sites"),
        ] {
            assert!(message.contains("matrix.npz") && message.contains(words), "{message}");
        }
    }

    #[test]
    fn what_cannot_fit_is_refused_with_its_numbers() {
        AccessMatrix::require_memory(102, 7302).unwrap();
        if cfg!(target_os = "linux") {
            let message = AccessMatrix::require_memory(1_000_000, 10_000_000).unwrap_err();
            let message = message.to_string();
            for words in ["directions by sites needs about ", "(1000000)", "(10000000)"] {
                assert!(message.contains(words), "{message}");
            }
        }
    }
}
