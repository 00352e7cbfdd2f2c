//! 3MF files: zip archives with XML models, read through `zip` and `quick-xml`.
//!
//! Read is the core of the format and its production extension: objects that are meshes, objects put together from
//! others, here or in another model of the archive, and the build that places them. What is no part of the solid
//! (supports, surfaces, modifiers, items that are not printed) is left out by name, and a negative part is refused:
//! `roles` says which is which. Colors, materials, slices and lattices are passed over. A 3MF says its unit, so the
//! mesh comes in millimeters. Models are read as they unpack, and neither a small archive that unpacks to gigabytes
//! nor a few objects that multiply are followed far.

mod model;
mod place;
mod roles;
mod xml;

use super::{Mesh, one_line};
use crate::{Error, Result};
use model::Model;
use place::Build;
use quick_xml::events::Event;
use quick_xml::reader::Reader;
use roles::Roles;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;
use xml::value;
use zip::ZipArchive;

/// The model's name if the archive does not state it.
const USUAL_MODEL: &str = "3D/3dmodel.model";
/// The file that states it.
const RELATIONSHIPS: &str = "_rels/.rels";
/// The models may unpack to this many times the archive's size, and a megabyte more. Models shrink
/// to a tenth; what shrinks to less than this is no model.
const MAX_GROWTH: u64 = 200;
/// Most bytes of the file that names the model.
const MAX_RELATIONSHIPS: u64 = 1 << 20;
/// Most models of an archive.
const MAX_MODELS: usize = 1 << 12;
const REMEDY: &str = "export the part again, as STL if this repeats";

type Found<T> = std::result::Result<T, String>;

/// All that the build places, in mm; and what was left out, one sentence each.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<(Mesh, Vec<String>)> {
    let mut package = Package::open(bytes, path)?;
    let name = package.model_name().unwrap_or_else(|| USUAL_MODEL.into());
    let mut models = vec![(name.clone(), package.model(&name)?)];
    for name in models[0].1.other_files() {
        if models.iter().all(|(known, _)| *known != name) {
            if models.len() == MAX_MODELS {
                return Err(package.fault("zip archive", "it has too many models".into()));
            }
            let model = package.model(&name)?;
            check_other(&models[0].1, &model).map_err(|found| package.fault(&name, found))?;
            models.push((name, model));
        }
    }
    let roles = package.roles()?;
    let built = Build::new(&models, &roles).mesh();
    let (mut mesh, left_out) =
        built.map_err(|fault| Error::file(path, fault.place, fault.found, fault.remedy))?;
    mesh.vertices.iter_mut().for_each(|v| *v *= models[0].1.unit_mm);
    let sentence = |what: String| format!("{}: {what}; it is left out", path.display());
    Ok((mesh, left_out.into_iter().map(sentence).collect()))
}

/// Whether a model that the main one takes objects from can be used with it.
fn check_other(main: &Model, other: &Model) -> Found<()> {
    if other.unit_mm != main.unit_mm {
        return Err(format!(
            "its unit has {} mm, that of the main model {} mm",
            other.unit_mm, main.unit_mm
        ));
    }
    match other.other_files().first() {
        Some(third) => {
            Err(format!("it takes objects from {}, only the main model may", one_line(third)))
        }
        None => Ok(()),
    }
}

/// An archive, and how much of it may still be unpacked.
struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    path: &'a Path,
    /// Bytes that all models together may unpack to.
    left: u64,
    /// Bytes that they have said they unpack to.
    claimed: u64,
}

impl<'a> Package<'a> {
    fn open(bytes: &'a [u8], path: &'a Path) -> Result<Self> {
        let archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|e| Error::file(path, "zip archive", one_line(e), REMEDY))?;
        let left = bytes.len() as u64 * MAX_GROWTH + (1 << 20);
        Ok(Package { archive, path, left, claimed: 0 })
    }

    fn fault(&self, place: &str, found: String) -> Error {
        Error::file(self.path, one_line(place), found, REMEDY)
    }

    /// What the archive's relationships call the model.
    fn model_name(&mut self) -> Option<String> {
        let mut text = String::new();
        let entry = self.archive.by_name(RELATIONSHIPS).ok()?;
        entry.take(MAX_RELATIONSHIPS).read_to_string(&mut text).ok()?;
        let mut xml = Reader::from_str(&text);
        loop {
            match xml.read_event().ok()? {
                Event::Start(tag) | Event::Empty(tag)
                    if value(&tag, "Type").is_some_and(|kind| kind.ends_with("/3dmodel")) =>
                {
                    return value(&tag, "Target").map(|target| in_archive(&target));
                }
                Event::Eof => return None,
                _ => {}
            }
        }
    }

    /// The name of an entry, whose case may differ.
    fn entry_name(&self, name: &str) -> String {
        let mut names = self.archive.file_names().flatten();
        match self.archive.index_for_name(name) {
            Some(_) => name.into(),
            None => names
                .find(|known| known.eq_ignore_ascii_case(name))
                .map_or_else(|| name.into(), |known| known.into_owned()),
        }
    }

    fn model(&mut self, name: &str) -> Result<Model> {
        let found = self.entry_name(name);
        let (path, claimed) = (self.path, self.claimed);
        let fault = |place: String, found| Error::file(path, place, found, REMEDY);
        let entry = self.archive.by_name(&found);
        let entry = entry.map_err(|e| fault(one_line(name), one_line(e)))?;
        // What the archive says of the entry is not trusted: one byte more is cut.
        let limit = self.left.min(entry.size().saturating_add(1));
        let remedy = "export the part with fewer triangles";
        super::require_memory("reading the mesh", claimed + limit, path, remedy)?;
        let mut model = Model::default();
        let mut xml = Reader::from_reader(BufReader::new(entry.take(limit)));
        let parsed = model.parse(&mut xml);
        let at = xml.buffer_position();
        let unread = xml.get_ref().get_ref().limit();
        let whole =
            if unread == 0 { Err(format!("it unpacks to over {limit} bytes")) } else { parsed };
        whole.map_err(|found| fault(format!("{} byte {at}", one_line(name)), found))?;
        self.left -= limit - unread;
        self.claimed += limit;
        Ok(model)
    }

    /// What the programs that write such archives say of their objects.
    fn roles(&mut self) -> Result<Roles> {
        let mut roles = Roles::default();
        for name in roles::FILES {
            let found = self.entry_name(name);
            let Ok(entry) = self.archive.by_name(&found) else { continue };
            let mut text = String::new();
            let read = entry.take(roles::MAX_BYTES).read_to_string(&mut text);
            let read = read.map_err(one_line).and_then(|n| match n as u64 == roles::MAX_BYTES {
                true => Err("it is too long".into()),
                false => roles.read(&text),
            });
            read.map_err(|found| self.fault(name, found))?;
        }
        Ok(roles)
    }
}

/// The name of an entry as the archive has it.
fn in_archive(path: &str) -> String {
    path.trim().trim_start_matches('/').replace('\\', "/")
}

#[cfg(test)]
mod tests;
