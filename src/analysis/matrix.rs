//! In which directions each tool has a free pose at each site.

use super::outcome::Outcome;
use super::placed::Placed;
use crate::access::{self, LabelOptions};
use crate::data::files::matrix::{AccessMatrix, MatrixFile};
use crate::data::files::safety;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// A form of the matrix of directions by sites, and the status of every vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[doc(hidden)] // of the program
pub enum PerDirection {
    /// `matrix.npz`.
    Npz,
    /// `visibility_matrix.txt`, as DeepMill++ has it.
    Text,
    /// `safety_status.txt`, as DeepMill++ has it.
    Safety,
}

impl PerDirection {
    /// Name of the file.
    pub fn file(self) -> &'static str {
        match self {
            PerDirection::Npz => "matrix.npz",
            PerDirection::Text => "visibility_matrix.txt",
            PerDirection::Safety => "safety_status.txt",
        }
    }
}

/// A matrix in numbers, beside the labels of its sites.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[doc(hidden)] // of the program
pub struct PerDirectionFacts {
    /// Number of rows.
    pub n_directions: usize,
    /// Number of columns.
    pub n_sites: usize,
    /// Number of pairs in which the tool has a free pose.
    pub n_accessible: u64,
    /// Number of accessible sites that no direction of the set reaches.
    pub n_between: usize,
    /// Number of sites that only the longer search of the matrix reaches; they have no entry.
    pub n_left_out: usize,
}

impl PerDirectionFacts {
    fn of(matrix: &AccessMatrix, accessible: &[bool]) -> Self {
        let reached = matrix.reached();
        PerDirectionFacts {
            n_directions: matrix.n_directions(),
            n_sites: matrix.n_sites(),
            n_accessible: matrix.n_accessible(),
            n_between: accessible.iter().zip(&reached).filter(|(a, r)| **a && !**r).count(),
            n_left_out: 0,
        }
    }
}

impl Placed {
    /// Checks, before the labels, that the matrix fits into the memory.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if it does not.
    #[doc(hidden)] // of the program
    pub fn require_matrix(&self) -> Result<()> {
        let n_columns = self.vertices.as_ref().map_or(0, |v| v.site_of_vertex.len());
        AccessMatrix::require_memory(self.directions.len(), n_columns.max(self.sites.len()))
    }
}

impl Outcome {
    /// Per direction and site, whether a tool has a free pose there: a row for each of [`Outcome::directions`], in
    /// their order, a column for each of [`Outcome::sites`].
    ///
    /// By the mesh definition an entry is set if in that direction no step penetrates the part and the tip fits, at a
    /// site that is accessible; the witness is among them. So a site is accessible iff some row has it, or its witness
    /// is no direction of the set: [`PerDirectionFacts::n_between`] counts these. Labels search a limited number of
    /// poses in all directions together, the matrix in each; where only the longer search finds one, the label holds,
    /// and [`PerDirectionFacts::n_left_out`] counts the sites. By the published definition an entry is set if nothing
    /// collides, so a site that the bottom rule calls accessible may have none.
    ///
    /// # Errors
    /// If it does not fit into the memory, or as the labels.
    ///
    /// # Panics
    /// If there is no such tool.
    #[doc(hidden)] // of the program
    pub fn matrix(&self, tool: usize) -> Result<(AccessMatrix, PerDirectionFacts)> {
        self.placed.require_matrix()?;
        let (sites, directions) = (self.sites(), self.directions());
        let cutter = &self.tools()[tool].cutter;
        let accessible = self.answers[tool].labels.answers.accessible();
        if let Some(triangles) = self.placed.obstacles()? {
            let options = self.placed.options();
            let found = triangles.accessible_directions(sites, cutter, directions, &options)?;
            let mut matrix = AccessMatrix::of_directions(&found);
            for (i, direction) in self.witness_rows(tool) {
                if let Some(direction) = direction {
                    matrix.open(direction, i);
                }
            }
            let n_left_out = matrix.close_all_but(&accessible);
            let facts = PerDirectionFacts::of(&matrix, &accessible);
            return Ok((matrix, PerDirectionFacts { n_left_out, ..facts }));
        }
        let centroids = self.placed.centroids();
        let options = LabelOptions {
            collision_matrix: true,
            occlusion: false,
            clearance_limit_mm: None,
            ..self.placed.request.published
        };
        let points = self.placed.points(centroids.as_deref());
        let labels = access::label(sites, points, cutter, directions, &options)?;
        let found = labels.collision_matrix.as_ref().map(AccessMatrix::of_collisions);
        let matrix = found.unwrap_or_else(|| AccessMatrix::closed(directions.len(), sites.len()));
        let facts = PerDirectionFacts::of(&matrix, &accessible);
        Ok((matrix, facts))
    }

    /// Of the accessible sites the row of the witness, if it is a direction of the set.
    fn witness_rows(&self, tool: usize) -> impl Iterator<Item = (usize, Option<usize>)> {
        let surface = self.answers[tool].labels.surface.as_ref();
        let witness = surface.map_or(&[][..], |surface| &surface.witness[..]);
        let vectors = self.directions().vectors();
        let row = |d: glam::Vec3| vectors.iter().position(|v| *v == d);
        let found = witness.iter().enumerate();
        found.filter_map(move |(i, pose)| Some((i, row(pose.as_ref()?.direction))))
    }

    /// Writes these forms for every tool, beside its labels; returns their paths. Text has a column or line for every
    /// vertex of the part's file, if the sites are its vertices, else for every site.
    ///
    /// # Errors
    /// If it does not fit into the memory, or the system refuses a file.
    #[doc(hidden)] // of the program
    pub fn write_per_direction(
        &self,
        folder: &Path,
        forms: &[PerDirection],
    ) -> Result<(Vec<PathBuf>, Vec<PerDirectionFacts>)> {
        let vertices = self.placed.vertices.as_ref();
        let (mut paths, mut facts) = (Vec::new(), Vec::new());
        let wants_matrix = forms.iter().any(|form| *form != PerDirection::Safety);
        for (k, tool) in self.tools().iter().enumerate() {
            let folder = match self.has_folders() {
                false => folder.to_path_buf(),
                true => folder.join(tool.folder()),
            };
            let matrix = wants_matrix.then(|| self.matrix(k)).transpose()?;
            let accessible = self.answers[k].labels.answers.accessible();
            facts.extend(matrix.as_ref().map(|(_, facts)| *facts));
            for form in forms {
                let path = folder.join(form.file());
                match (form, &matrix) {
                    (PerDirection::Npz, Some((matrix, _))) => {
                        let file = self.file(k)?;
                        let (sites, vertices) = (file.sites, file.vertices);
                        let directions = self.directions().vectors().to_vec();
                        let (provenance, matrix) = (file.provenance, matrix.clone());
                        MatrixFile { provenance, sites, directions, matrix, vertices }
                            .write(&path)?;
                    }
                    (PerDirection::Text, Some((matrix, _))) => match vertices {
                        Some(vertices) => matrix.of_vertices(vertices).write_text(&path)?,
                        None => matrix.write_text(&path)?,
                    },
                    _ => match vertices {
                        Some(vertices) => {
                            safety::write(&path, &safety::of_vertices(&accessible, vertices))?;
                        }
                        None => safety::write(&path, &accessible)?,
                    },
                }
                paths.push(path);
            }
        }
        Ok((paths, facts))
    }
}

/// Reads a name of `npz`, `txt`.
impl std::str::FromStr for PerDirection {
    type Err = Error;

    /// # Errors
    /// If it is neither.
    fn from_str(name: &str) -> Result<Self> {
        match name {
            "npz" => Ok(PerDirection::Npz),
            "txt" => Ok(PerDirection::Text),
            _ => {
                let remedy = "txt is the form of DeepMill++, npz has the directions too";
                Err(Error::argument("matrix", format!("`{name}`"), "npz or txt", remedy))
            }
        }
    }
}
