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
mod placed;
mod units;

use super::one_line;
use crate::geom::Mesh;
use crate::{Error, Result};
use body::{Refused, Triangles};
use glam::{DMat4, DVec3};
use monstertruck::step::load::{Table, step_p21};
use placed::Placed;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

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
    let mut notices = Vec::new();
    if let Some(why) = placed::left_out(&table) {
        notices.push(format!("{}: {why}", path.display()));
    }
    let placed = placed::placed(&table).map_err(|(place, found)| refused(&place, found))?;
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
