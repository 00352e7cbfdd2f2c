//! STL files, binary or text: three corners per facet; facet normals are not read.

use super::text::{Lines, coordinates};
use super::{Mesh, one_line};
use crate::{Error, Result};
use glam::DVec3;
use std::io::Write;
use std::path::Path;

/// A binary file's header (80 bytes) and triangle count.
const HEAD: usize = 84;
/// Bytes of one triangle in a binary file: normal, three corners, attribute.
const FACET: usize = 50;

/// Every facet with three corners of its own, in file units.
///
/// A file whose size fits its triangle count is binary, whatever its header begins with.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let claimed = bytes.get(80..HEAD).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]));
    let size = |n: u32| HEAD as u64 + FACET as u64 * u64::from(n);
    match claimed {
        Some(n) if size(n) == bytes.len() as u64 => read_binary(&bytes[HEAD..], path),
        _ if is_text(bytes) => read_text(bytes, path),
        None => Err(Error::file(
            path,
            format!("byte {}", bytes.len()),
            format!("the file ends within the {HEAD} bytes of a binary STL's head"),
            "copy or export the file again",
        )),
        Some(n) => {
            let whole = (bytes.len() - HEAD) / FACET;
            let verdict = if (n as usize) > whole { "the file is cut off" } else { "more follows" };
            Err(Error::file(
                path,
                format!("byte {}", size(n).min(bytes.len() as u64)),
                format!("the head promises {n} triangles, there is room for {whole}: {verdict}"),
                "copy or export the file again",
            ))
        }
    }
}

fn is_text(bytes: &[u8]) -> bool {
    // A binary file has a zero byte in its triangle count at the latest.
    let start = &bytes[..bytes.len().min(1024)];
    let word = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    word.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid")) && !start.contains(&0)
}

fn read_binary(facets: &[u8], path: &Path) -> Result<Mesh> {
    let mut vertices = Vec::with_capacity(facets.len() / FACET * 3);
    for (i, facet) in facets.chunks_exact(FACET).enumerate() {
        for corner in facet[12..48].chunks_exact(12) {
            let value = |k: usize| {
                let b = &corner[4 * k..];
                f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            };
            let vertex = DVec3::new(value(0), value(1), value(2));
            if !vertex.is_finite() {
                let place = format!("triangle {i} at byte {}", HEAD + i * FACET);
                let found = format!("corner ({}, {}, {})", vertex.x, vertex.y, vertex.z);
                return Err(Error::file(path, place, found, NOT_FINITE));
            }
            vertices.push(vertex);
        }
    }
    soup(vertices, path)
}

const NOT_FINITE: &str = "export the part again; coordinates must be finite numbers";
const NOT_STL: &str = "check that this is an ASCII STL and export it again";

/// The keyword that a line begins with. Some programs write `end loop` for `endloop`, or a name without a blank
/// before it (`endsolidPart`).
fn keyword<'a>(word: &str, rest: impl Iterator<Item = &'a str>) -> Option<&'static str> {
    let mut word = word.to_ascii_lowercase();
    if word == "end" {
        word.extend(rest.take(1).map(str::to_ascii_lowercase));
    }
    let begins = ["solid", "endsolid"].into_iter().find(|keyword| word.starts_with(keyword));
    let glued = [("outerloop", "outer"), ("facetnormal", "facet")];
    let is = ["outer", "endloop", "facet", "vertex", "endfacet"].into_iter().find(|k| word == *k);
    begins
        .or(is)
        .or(glued.into_iter().find(|(glued, _)| word == *glued).map(|(_, keyword)| keyword))
}

fn read_text(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let mut vertices = Vec::new();
    let mut corners = None;
    let (mut ended, mut last) = (false, 0);
    for (number, line) in Lines::new(bytes) {
        last = number;
        let mut tokens = line.split_whitespace();
        let Some(word) = tokens.next() else { continue };
        ended = false;
        let fault = |found: String| Error::file(path, format!("line {number}"), found, NOT_STL);
        match (keyword(word, tokens.clone()), corners) {
            (Some("solid"), None) | (Some("outer" | "endloop"), Some(_)) => {}
            (Some("endsolid"), None) => ended = true,
            (Some("facet"), None) => corners = Some(0),
            (Some("vertex"), Some(n)) if n < 3 => {
                let vertex = coordinates(tokens);
                vertices.push(vertex.map_err(|found| {
                    Error::file(path, format!("line {number}"), found, NOT_FINITE)
                })?);
                corners = Some(n + 1);
            }
            (Some("endfacet"), Some(3)) => corners = None,
            (Some("endfacet"), Some(n)) => {
                return Err(fault(format!("a facet has {n} vertices, not 3")));
            }
            _ => return Err(fault(format!("\"{}\" has no place here", one_line(word)))),
        }
    }
    if !ended {
        return Err(Error::file(
            path,
            format!("line {last}"),
            "the file ends before its endsolid: it is cut off",
            "copy or export the file again",
        ));
    }
    soup(vertices, path)
}

/// A mesh in which no two triangles share a corner.
fn soup(vertices: Vec<DVec3>, path: &Path) -> Result<Mesh> {
    let n = u32::try_from(vertices.len()).map_err(|_| {
        Error::file(
            path,
            "triangles",
            format!("{} corners are more than can be counted", vertices.len()),
            "export the part with fewer triangles",
        )
    })?;
    let triangles = (0..n / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    Ok(Mesh { vertices, triangles })
}

/// Fails if the mesh has more triangles than the format can count.
pub(super) fn check_count(mesh: &Mesh) -> Result<()> {
    match u32::try_from(mesh.triangles.len()) {
        Ok(_) => Ok(()),
        Err(_) => Err(Error::geometry(
            "mesh",
            format!("{} triangles are more than an STL file can count", mesh.triangles.len()),
            "write fewer triangles",
        )),
    }
}

/// Writes a binary file; the header must not begin with `solid`.
pub(super) fn write(writer: &mut (impl Write + ?Sized), mesh: &Mesh) -> std::io::Result<()> {
    let mut head = [b' '; 80];
    let title = concat!("deepmill ", env!("CARGO_PKG_VERSION"), ", millimeters");
    head[..title.len()].copy_from_slice(title.as_bytes());
    writer.write_all(&head)?;
    writer.write_all(&(mesh.triangles.len() as u32).to_le_bytes())?;
    for f in 0..mesh.triangles.len() {
        let normal = mesh.area_vector(f).normalize_or_zero().as_vec3();
        let [a, b, c] = mesh.corners(f).map(|v| v.as_vec3());
        for number in [normal, a, b, c].iter().flat_map(|v| v.to_array()) {
            writer.write_all(&number.to_le_bytes())?;
        }
        writer.write_all(&[0; 2])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str =
        "facet normal 0 0 1|outer loop|vertex 0 0 0|vertex 1 0 0|vertex 0 1 0|endloop|endfacet|";

    fn read_lines(text: &str) -> Result<Mesh> {
        read(text.replace('|', "\n").as_bytes(), Path::new("part.stl"))
    }

    #[test]
    fn keywords_with_and_without_blanks_are_the_same() {
        let whole = format!("solid a|{FACET}{FACET}endsolid a");
        let mesh = read_lines(&whole).unwrap();
        assert_eq!(mesh.triangles.len(), 2);
        for (usual, other) in [
            ("endloop", "end loop"),
            ("endloop", "End Loop"),
            ("endfacet", "end\tfacet"),
            ("endsolid a", "end solid a"),
            ("endsolid a", "ENDSOLID"),
            ("endsolid a", "endsolidAssimpScene"),
            ("solid a", "solidAssimpScene"),
            ("outer loop", "outerloop"),
            ("facet normal", "facetnormal"),
        ] {
            let text = whole.replacen(usual, other, if usual.starts_with("solid") { 1 } else { 9 });
            assert_eq!(read_lines(&text).unwrap(), mesh, "{other}");
            for end in ["\r", "\r\n"] {
                let bytes = text.replace('|', end);
                assert_eq!(read(bytes.as_bytes(), Path::new("x")).unwrap(), mesh, "{other}");
            }
        }
    }

    #[test]
    fn a_text_that_is_cut_off_is_refused() {
        let whole = format!("solid a|{FACET}end solid a");
        for n in 6..whole.len() - 7 {
            assert!(read_lines(&whole[..n]).is_err(), "{}", &whole[..n]);
        }
        let two = format!("{whole}|solid b|{FACET}");
        assert!(read_lines(&two).unwrap_err().to_string().contains("cut off"));
        for word in ["end", "end lop", "endlid", "end vertex"] {
            let text = whole.replace("endfacet", word);
            let message = read_lines(&text).unwrap_err().to_string();
            assert!(message.contains("line 8") && message.contains("no place here"), "{message}");
        }
    }
}
