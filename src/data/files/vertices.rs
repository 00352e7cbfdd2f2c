//! The arrays of sites at the vertices of a file.

use super::same_length;
use crate::data::npz::{NpzReader, NpzWriter};
use crate::geom::Sites;
use crate::geom::file_vertices::SiteVertices;
use crate::{Error, Result};
use serde_json::{Value, json};
use std::path::Path;

const VERTEX_INDEX: &str = "vertex_index";
const SITE_OF_VERTEX: &str = "site_of_vertex";

/// Adds them and what they mean, if there are any, for `n` sites.
pub(crate) fn add(
    path: &Path,
    npz: &mut NpzWriter,
    vertices: Option<&SiteVertices>,
    (n, meaning): (usize, &mut Value),
) -> Result<()> {
    let Some(vertices) = vertices else { return Ok(()) };
    let SiteVertices { vertex_index, site_of_vertex } = vertices;
    if vertex_index.len() != n {
        let found = format!("{} entries for {n} sites", vertex_index.len());
        return Err(Error::file(path, VERTEX_INDEX, found, "give every site its vertex"));
    }
    require_sound(path, vertices)?;
    npz.array(VERTEX_INDEX, &[n], vertex_index);
    npz.array(SITE_OF_VERTEX, &[site_of_vertex.len()], site_of_vertex);
    meaning[VERTEX_INDEX] = json!(
        "the first vertex of the part's file, counted from 0, that is at this site; -1 if the file has none there"
    );
    meaning[SITE_OF_VERTEX] = json!(
        "per vertex of the part's file, in its order, the site there; -1 if no face with an area uses the vertex"
    );
    Ok(())
}

/// Reads them, if the archive has them.
pub(crate) fn read(
    path: &Path,
    npz: &mut NpzReader,
    sites: &Sites,
) -> Result<Option<SiteVertices>> {
    if !npz.has(VERTEX_INDEX) && !npz.has(SITE_OF_VERTEX) {
        return Ok(None);
    }
    let vertices = SiteVertices {
        vertex_index: npz.counts(VERTEX_INDEX)?,
        site_of_vertex: npz.counts(SITE_OF_VERTEX)?,
    };
    same_length(path, sites, VERTEX_INDEX, vertices.vertex_index.len())?;
    require_sound(path, &vertices)?;
    Ok(Some(vertices))
}

fn require_sound(path: &Path, vertices: &SiteVertices) -> Result<()> {
    let Some((name, entry)) = vertices.fault() else { return Ok(()) };
    let found = format!("entry {entry} names what is not there, or another than that names it");
    Err(Error::file(path, name, found, "label the part again"))
}

#[cfg(test)]
mod tests {
    use super::super::tests::sites;
    use super::*;

    /// Reads these arrays beside two sites.
    fn read_back(vertex_index: &[i64], site_of_vertex: &[i64]) -> Result<Option<SiteVertices>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.npz");
        let mut npz = NpzWriter::new();
        npz.array(VERTEX_INDEX, &[vertex_index.len()], vertex_index);
        if !site_of_vertex.is_empty() {
            npz.array(SITE_OF_VERTEX, &[site_of_vertex.len()], site_of_vertex);
        }
        npz.write(&path).unwrap();
        read(&path, &mut NpzReader::open(&path).unwrap(), &sites())
    }

    #[test]
    fn arrays_that_name_what_is_not_there_are_refused_by_name_and_entry() {
        let good = read_back(&[0, 2], &[0, -1, 1, 0]).unwrap().unwrap();
        assert_eq!((good.vertex_index, good.site_of_vertex), (vec![0, 2], vec![0, -1, 1, 0]));
        for (vertex_index, site_of_vertex, words) in [
            (&[0, 2, 3][..], &[0, -1, 1, 0][..], "vertex_index: 3 rows for 2 points"),
            (&[0, 2], &[0, -1, 2], "site_of_vertex: entry 2"),
            (&[0, 2], &[0, i64::MIN, 1], "site_of_vertex: entry 1"),
            (&[0, i64::MAX], &[0, -1, 1], "vertex_index: entry 1"),
            (&[0, 1], &[0, -1, 1], "vertex_index: entry 1"),
            (&[0, 2], &[], "site_of_vertex: there is no such array"),
        ] {
            let message = read_back(vertex_index, site_of_vertex).unwrap_err().to_string();
            assert!(message.contains("labels.npz") && message.contains(words), "{message}");
        }
    }
}
