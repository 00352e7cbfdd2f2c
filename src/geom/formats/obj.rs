//! Wavefront OBJ files: positions and polygons; groups, materials, normals and texture are skipped.
//!
//! A remark begins at `#` and ends with its line: a backslash in it continues nothing. Nor does one that ends the
//! path of a material or the name of a group: only positions and faces go on over lines.

use super::polygon::Polygons;
use super::text::{Lines, coordinates};
use super::{Mesh, one_line};
use crate::{Error, Result};
use glam::DVec3;
use std::borrow::Cow;
use std::path::Path;

/// Vertices as they are and polygons cut into triangles, in file units.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let mut vertices = Vec::new();
    let mut polygons = Polygons::counting_from(1);
    let mut lines = Lines::new(bytes);
    while let Some((number, line)) = lines.next() {
        let line = statement(line, &mut lines);
        let fault = |found: String, remedy: &str| {
            Err(Error::file(path, format!("line {number}"), found, remedy))
        };
        let mut tokens = line.split_whitespace();
        match tokens.next() {
            Some("v") => match coordinates(tokens) {
                Ok(vertex) => vertices.push(vertex),
                Err(found) => return fault(found, "export the part again"),
            },
            Some("f") => {
                for token in tokens {
                    match corner(token, &vertices) {
                        Ok(index) => polygons.push_corner(index),
                        Err(found) => return fault(found, INDEX_REMEDY),
                    }
                }
                polygons.end(number);
            }
            _ => {}
        }
    }
    polygons.into_mesh(vertices, path, |line| format!("line {line}"))
}

/// A line without its remark, with the lines on which it goes on.
fn statement<'a>(line: Cow<'a, str>, lines: &mut Lines<'a>) -> Cow<'a, str> {
    let begun = without_remark(&line);
    let goes_on = begun.ends_with('\\');
    if !goes_on || !matches!(begun.split([' ', '\t', '\\']).next(), Some("v" | "f")) {
        return match begun.len() == line.len() {
            true => line,
            false => begun.to_string().into(),
        };
    }
    let mut whole = begun.to_string();
    while whole.ends_with('\\') {
        whole.pop();
        let Some((_, next)) = lines.next() else { break };
        whole.push(' ');
        whole.push_str(without_remark(&next));
    }
    whole.into()
}

fn without_remark(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim()
}

const INDEX_REMEDY: &str = "export the part again; faces count vertices from 1, or back from -1";

/// The vertex, from 1, that one corner of a face names; whether it exists is checked at the end, since
/// vertices may follow their faces.
fn corner(token: &str, vertices: &[DVec3]) -> std::result::Result<i64, String> {
    let position = token.split('/').next().unwrap_or_default();
    let known = vertices.len() as i64;
    match position.parse::<i64>() {
        Ok(i) if i > 0 => Ok(i),
        Ok(i) if i < 0 && i >= -known => Ok(known + 1 + i),
        Ok(i) => Err(format!("vertex index {i}, {known} vertices so far")),
        Err(_) => Err(format!("\"{}\" is not a vertex index", one_line(token))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Mesh> {
        read(text.as_bytes(), Path::new("part.obj"))
    }

    #[test]
    fn groups_slashes_negative_and_forward_indices_name_the_same_square() {
        let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
        let plain = read_text(&format!("{corners}f 1 2 3 4\n")).unwrap();
        assert_eq!(plain.triangles.len(), 2);
        for faces in [
            "mtllib no.mtl\r\ng a\r\nusemtl b\r\nf 1/1/1 2//2 3/3 4\r\n",
            "o x\nf -4 -3 -2 -1\n",
            "f 1 2 \\\n 3 4\n",
        ] {
            assert_eq!(read_text(&format!("{corners}{faces}")).unwrap(), plain, "{faces}");
        }
        assert_eq!(read_text(&format!("f 1 2 3 4\n{corners}")).unwrap(), plain);
    }

    #[test]
    fn a_remark_ends_with_its_line_and_hides_what_follows_it() {
        let corners = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0"];
        let plain = read_text(&(corners.join("\n") + "\nf 1 2 3 4\n")).unwrap();
        for end in ["\n", "\r\n", "\r"] {
            for text in [
                "# C:\\parts\\|V|f 1 2 3 4",
                "V|# C:\\out\\|f 1 2 3 4 # lid \\|# end\\",
                "V|f 1 2 3 4# lid",
                "mtllib C:\\parts\\|V|g C:\\a\\|f 1 2 \\|  3 \\ |4 # lid",
                "V # corner|f\\|1 2 3 4 #",
                "V|f 1 2 3 4 \\",
            ] {
                let text = text.replace('V', &corners.join("|")).replace('|', end);
                assert_eq!(read_text(&text).unwrap(), plain, "{text:?}");
            }
        }
        let message = read_text("v 0 0 0\nv 1 0 # 0 0\n").unwrap_err().to_string();
        assert!(message.starts_with("part.obj: line 2: coordinate z"), "{message}");
    }

    #[test]
    fn bad_faces_are_refused_with_their_line() {
        let message = |face: &str| {
            let text = format!("v 0 0 0\nv 1 0 0\nv 1 1 0\n\nf {face}\n");
            read_text(&text).unwrap_err().to_string()
        };
        for face in ["1 2 4", "0 1 2", "-4 1 2", "1 2 x", "1 2", "1 2 99999999999999999999"] {
            assert!(message(face).starts_with("part.obj: line 5: "), "{}", message(face));
        }
    }
}
