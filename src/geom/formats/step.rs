//! STEP files (ISO 10303-21), read and cut into triangles by `monstertruck`.
//!
//! ```text
//! unit of length; solids with their places in the assembly
//! for every solid: triangles of its faces, plainly; else with a wider search; else with the curves of its faces
//!     accepted if no face is lost, the triangles bound a solid, and their middles lie on the surfaces of their faces
//! ```
//!
//! A solid that is accepted in no way refuses the file, with its faces: a part with a hole in it is no part.

mod body;
mod mapped;
mod parts;
mod placed;
mod records;
mod units;

use super::one_line;
use crate::geom::Mesh;
use crate::{Error, Result};
use body::{Refused, Triangles};
use glam::{DMat4, DVec3};
use monstertruck::step::load::{Table, step_p21};
use parts::Placed;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Lists within lists of real files are a few levels deep; the reader follows them by recursion.
const MOST_NESTED: usize = 100;
/// A chord error of a smaller share of the file's box is refused: triangles would be without number.
const LEAST_CHORD: f64 = 1e-6;
/// What to do about a file that is refused.
const REMEDY: &str = "export it as STL in millimeters, or convert it as docs/meshes.md says";

/// The triangles of all solids, mm, none further than about `chord_mm` from its surface; what was left out, a sentence
/// each.
///
/// # Errors
/// If it is no such file, states two units of length, or a solid or its place cannot be read as a whole.
pub fn read(bytes: &[u8], path: &Path, chord_mm: f64) -> Result<(Mesh, Vec<String>)> {
    let refused = |place: &str, found: String| Error::file(path, place, found, REMEDY);
    if !bytes.trim_ascii_start().starts_with(b"ISO-10303-21") {
        let found = "it does not begin with ISO-10303-21: it is no STEP file".into();
        return Err(refused("byte 0", found));
    }
    if nesting(bytes) > MOST_NESTED {
        let found = format!("parentheses within parentheses, more than {MOST_NESTED} deep");
        return Err(refused("text", found));
    }
    // Texts in other encodings are names alone: numbers are ASCII.
    let text = String::from_utf8_lossy(bytes);
    let parsed = guarded(|| step_p21::parser::parse(&text)).map_err(|why| refused("text", why))?;
    let exchange = parsed.map_err(|error| refused("text", one_line(error)))?;
    let [section] = &exchange.data[..] else {
        let found = format!("{} sections of data, one is read", exchange.data.len());
        return Err(refused("text", found));
    };
    let unit_mm = units::millimeters(&section.entities).map_err(|found| refused("units", found))?;
    let table =
        guarded(|| Table::from_data_section(section)).map_err(|why| refused("text", why))?;
    require_chord(&table, unit_mm, chord_mm)?;
    let mut notices = Vec::new();
    if let Some(why) = placed::left_out(&table) {
        notices.push(format!("{}: {why}", path.display()));
    }
    let placed = placed::placed(&table, &records::records(&section.entities))
        .map_err(|(place, found)| refused(&place, found))?;
    let mut whole = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    let (mut done, mut off_mm): (Option<(u64, Triangles)>, f64) = (None, 0.0);
    for Placed { body, place } in placed {
        let triangles = match done.take() {
            Some((id, triangles)) if id == body.id() => triangles,
            _ => body::triangles(&table, body, chord_mm / unit_mm).map_err(|why| match why {
                Refused { face: Some(face), found } => refused(&face, found),
                Refused { face: None, found } => refused(&body.name(), found),
            })?,
        };
        off_mm = off_mm.max(triangles.off * unit_mm);
        add(&mut whole, &triangles.mesh, DMat4::from_scale(DVec3::splat(unit_mm)) * place);
        done = Some((body.id(), triangles));
    }
    if off_mm > chord_mm {
        notices.push(format!(
            "{}: triangles are up to {off_mm:.4} mm from their surfaces, which is more than the chord error of {chord_mm} \
             mm; give a smaller one",
            path.display()
        ));
    }
    Ok((whole, notices))
}

/// The greatest depth of parentheses outside of texts.
fn nesting(bytes: &[u8]) -> usize {
    let (mut depth, mut most, mut in_text) = (0usize, 0, false);
    for byte in bytes {
        match byte {
            b'\'' => in_text = !in_text,
            b'(' if !in_text => {
                depth += 1;
                most = most.max(depth);
            }
            b')' if !in_text => depth = depth.saturating_sub(1),
            _ => {}
        }
    }
    most
}

/// Passes if the chord error is no smaller than [`LEAST_CHORD`] of the box about the points of the file.
fn require_chord(table: &Table, unit_mm: f64, chord_mm: f64) -> Result<()> {
    let points = table.cartesian_point.values().filter_map(|point| match point.coordinates[..] {
        [x, y, z] => Some(DVec3::new(x, y, z)),
        _ => None,
    });
    let boxed = points.fold(None, |boxed: Option<(DVec3, DVec3)>, p| {
        Some(boxed.map_or((p, p), |(low, high)| (low.min(p), high.max(p))))
    });
    let least_mm = boxed.map_or(0.0, |(low, high)| (high - low).length() * unit_mm * LEAST_CHORD);
    if chord_mm >= least_mm {
        return Ok(());
    }
    let expected = format!("at least {least_mm:.2e} mm for a part of this size");
    let remedy = "give a greater chord error; 0.02 mm is usual";
    Err(Error::argument("chord", format!("{chord_mm} mm"), expected, remedy))
}

/// Adds a mesh at a place; one that is mirrored is turned outward again.
fn add(whole: &mut Mesh, mesh: &Mesh, place: DMat4) {
    let first = whole.vertices.len() as u32;
    let is_mirrored = place.determinant() < 0.0;
    whole.vertices.extend(mesh.vertices.iter().map(|vertex| place.transform_point3(*vertex)));
    whole.triangles.extend(mesh.triangles.iter().map(|[a, b, c]| match is_mirrored {
        true => [first + a, first + c, first + b],
        false => [first + a, first + b, first + c],
    }));
}

/// Work of the library, whose panics are about files that it does not know.
fn guarded<T>(work: impl FnOnce() -> T) -> std::result::Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|_| "its reader gave up on it".into())
}
