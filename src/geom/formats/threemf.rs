//! 3MF files: zip archives with an XML model, read through `zip` and `quick-xml`.
//!
//! Read is the core of the format: objects that are meshes, objects put together from others, and the
//! build that places them. Colors, materials, slices and lattices are passed over. A 3MF says
//! its unit, so the mesh comes in millimeters. The model is read as it unpacks, and neither
//! a small archive that unpacks to gigabytes nor a few objects that multiply are followed far.

use super::{Mesh, one_line};
use crate::{Error, Result};
use glam::{DMat3, DVec3};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use std::collections::HashMap;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;
use zip::ZipArchive;

/// The model's name if the archive does not state it.
const USUAL_MODEL: &str = "3D/3dmodel.model";
/// The file that states it.
const RELATIONSHIPS: &str = "_rels/.rels";
/// An entry may unpack to this many times the archive's size, and a megabyte more. Models shrink
/// to a tenth; what shrinks to less than this is no model.
const MAX_GROWTH: u64 = 200;
/// Most bytes of the file that names the model.
const MAX_RELATIONSHIPS: u64 = 1 << 20;
/// When every object is placed as often as the build says, there may be this many times the triangles
/// and vertices of the file, and some more.
const MAX_COPIES: usize = 4;
const FEW: usize = 1 << 18;
/// Most objects placed, and how deep they may be nested.
const MAX_PLACED: usize = 1 << 16;
const MAX_DEPTH: usize = 32;
const REMEDY: &str = "export the part again, as STL if this repeats";

/// All that the build places, in mm.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let fault = |place: &str, found: String| Error::file(path, place, found, REMEDY);
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|e| fault("zip archive", one_line(e)))?;
    let name = model_name(&mut archive).unwrap_or_else(|| USUAL_MODEL.into());
    let entry = archive.by_name(&name);
    let entry = entry.map_err(|e| fault(&one_line(&name), one_line(e)))?;
    // What the archive says of the entry is not trusted: one byte more is cut.
    let limit = (bytes.len() as u64 * MAX_GROWTH + (1 << 20)).min(entry.size().saturating_add(1));
    super::require_memory("reading the mesh", limit, path, "export the part with fewer triangles")?;
    let mut model = Model::default();
    let mut xml = Reader::from_reader(BufReader::new(entry.take(limit)));
    let parsed = model.parse(&mut xml);
    let at = xml.buffer_position();
    let cut = xml.get_ref().get_ref().limit() == 0;
    let whole = if cut { Err(format!("it unpacks to over {limit} bytes")) } else { parsed };
    whole.map_err(|found| fault(&format!("{} byte {at}", one_line(&name)), found))?;
    let mut mesh = Mesh::default();
    model.build(&mut mesh).map_err(|found| fault("build", found))?;
    mesh.vertices.iter_mut().for_each(|v| *v *= model.unit_mm);
    Ok(mesh)
}

/// What the archive's relationships call the model.
fn model_name(archive: &mut ZipArchive<Cursor<&[u8]>>) -> Option<String> {
    let mut text = String::new();
    let entry = archive.by_name(RELATIONSHIPS).ok()?;
    entry.take(MAX_RELATIONSHIPS).read_to_string(&mut text).ok()?;
    let mut xml = Reader::from_str(&text);
    loop {
        match xml.read_event().ok()? {
            Event::Start(tag) | Event::Empty(tag)
                if value(&tag, "Type").is_some_and(|kind| kind.ends_with("/3dmodel")) =>
            {
                let target = value(&tag, "Target")?;
                return Some(target.trim_start_matches('/').to_owned());
            }
            Event::Eof => return None,
            _ => {}
        }
    }
}

type Found<T> = std::result::Result<T, String>;

/// An object placed: its number and where its points go.
struct Placed {
    object: u32,
    turn: DMat3,
    shift: DVec3,
}

/// How much may still be placed.
struct Left {
    objects: usize,
    /// Triangles, and vertices, of the whole.
    most: usize,
}

#[derive(Default)]
struct Object {
    mesh: Mesh,
    components: Vec<Placed>,
}

struct Model {
    unit_mm: f64,
    objects: HashMap<u32, Object>,
    items: Vec<Placed>,
    /// The object being read.
    open: Option<(u32, Object)>,
}

impl Default for Model {
    fn default() -> Self {
        Model { unit_mm: 1.0, objects: HashMap::new(), items: Vec::new(), open: None }
    }
}

impl Model {
    fn parse(&mut self, xml: &mut Reader<impl std::io::BufRead>) -> Found<()> {
        let mut buffer = Vec::new();
        let mut began = false;
        loop {
            buffer.clear();
            match xml.read_event_into(&mut buffer).map_err(one_line)? {
                Event::Start(tag) => self.begin(&tag)?,
                Event::Empty(tag) => {
                    self.begin(&tag)?;
                    self.end(tag.local_name().as_ref());
                }
                Event::End(tag) if tag.local_name().as_ref() == "model" => return Ok(()),
                Event::End(tag) => self.end(tag.local_name().as_ref()),
                Event::Eof if began => return Err("the model is cut off".into()),
                Event::Eof => return Err("there is no model".into()),
                _ => continue,
            }
            began = true;
        }
    }

    fn begin(&mut self, tag: &BytesStart) -> Found<()> {
        match (tag.local_name().as_ref(), &mut self.open) {
            ("model", _) => self.unit_mm = unit_mm(value(tag, "unit").as_deref())?,
            ("item", _) => self.items.push(placed(tag)?),
            ("object", open) => *open = Some((number(tag, "id")?, Object::default())),
            ("component", Some((_, object))) => object.components.push(placed(tag)?),
            ("vertex", Some((_, object))) => {
                let [x, y, z] = ["x", "y", "z"].map(|name| coordinate(tag, name));
                object.mesh.vertices.push(DVec3::new(x?, y?, z?));
            }
            ("triangle", Some((_, object))) => {
                let [a, b, c] = ["v1", "v2", "v3"].map(|name| number(tag, name));
                object.mesh.triangles.push([a?, b?, c?]);
            }
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str) {
        if name == "object" {
            self.objects.extend(self.open.take());
        }
    }

    fn build(&self, mesh: &mut Mesh) -> Found<()> {
        if self.items.is_empty() {
            return Err("it places no object".into());
        }
        let size = |o: &Object| o.mesh.triangles.len().max(o.mesh.vertices.len());
        let most = FEW + MAX_COPIES * self.objects.values().map(size).sum::<usize>();
        let mut left = Left { objects: MAX_PLACED, most };
        self.items.iter().try_for_each(|item| self.place(item, 0, &mut left, mesh))
    }

    /// Appends an object and all it is put together from.
    fn place(&self, at: &Placed, depth: usize, left: &mut Left, mesh: &mut Mesh) -> Found<()> {
        let id = at.object;
        let object = self.objects.get(&id).ok_or_else(|| format!("object {id} does not exist"))?;
        let (begin, n_corners) = (mesh.vertices.len(), object.mesh.vertices.len());
        let n_triangles = mesh.triangles.len() + object.mesh.triangles.len();
        let too_many = n_triangles.max(begin + n_corners) > left.most || left.objects == 0;
        if depth > MAX_DEPTH || too_many {
            return Err("its objects multiply without end".into());
        }
        left.objects -= 1;
        let far = |v: &&u32| **v as usize >= n_corners;
        if let Some(v) = object.mesh.triangles.iter().flatten().find(far) {
            return Err(format!("object {id}: vertex {v} of {n_corners} does not exist"));
        }
        // Vertices are placed by the innermost object first, then by all around it.
        mesh.vertices.extend(&object.mesh.vertices);
        let moved = |t: &[u32; 3]| t.map(|v| v + begin as u32);
        let first = mesh.triangles.len();
        mesh.triangles.extend(object.mesh.triangles.iter().map(moved));
        for component in &object.components {
            self.place(component, depth + 1, left, mesh)?;
        }
        mesh.vertices[begin..].iter_mut().for_each(|v| *v = at.turn * *v + at.shift);
        if at.turn.determinant() < 0.0 {
            mesh.triangles[first..].iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok(())
    }
}

/// The attribute of that name, whatever its prefix.
fn value(tag: &BytesStart, name: &str) -> Option<String> {
    let mut all = tag.attributes();
    let mut all = all.with_checks(false).flatten();
    all.find(|a| a.key.local_name().as_ref() == name).map(|a| a.value.into_owned())
}

fn required(tag: &BytesStart, name: &str) -> Found<String> {
    value(tag, name)
        .ok_or_else(|| format!("<{}> has no {name}", one_line(tag.local_name().as_ref())))
}

fn number(tag: &BytesStart, name: &str) -> Found<u32> {
    let text = required(tag, name)?;
    text.trim().parse().map_err(|_| format!("{name} is \"{}\", not a count", one_line(&text)))
}

fn coordinate(tag: &BytesStart, name: &str) -> Found<f64> {
    finite(&required(tag, name)?).map_err(|found| format!("coordinate {name} is {found}"))
}

fn finite(text: &str) -> Found<f64> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(x) => Err(x.to_string()),
        Err(_) => Err(format!("\"{}\", not a number", one_line(text))),
    }
}

fn placed(tag: &BytesStart) -> Found<Placed> {
    if value(tag, "path").is_some() {
        return Err("an object is in another file of the archive, which is not read".into());
    }
    let object = number(tag, "objectid")?;
    let Some(text) = value(tag, "transform") else {
        return Ok(Placed { object, turn: DMat3::IDENTITY, shift: DVec3::ZERO });
    };
    let numbers: Vec<f64> = text
        .split_whitespace()
        .map(finite)
        .collect::<Found<_>>()
        .map_err(|found| format!("transform has {found}"))?;
    let columns: [f64; 12] = numbers
        .try_into()
        .map_err(|n: Vec<f64>| format!("transform has {} numbers, not 12", n.len()))?;
    // Points are rows in the file: its rows are the columns of a matrix that points follow.
    let [x, y, z, shift] = [0, 3, 6, 9].map(|i| DVec3::from_slice(&columns[i..]));
    Ok(Placed { object, turn: DMat3::from_cols(x, y, z), shift })
}

fn unit_mm(name: Option<&str>) -> Found<f64> {
    Ok(match name {
        None | Some("millimeter") => 1.0,
        Some("micron") => 1e-3,
        Some("centimeter") => 10.0,
        Some("inch") => 25.4,
        Some("foot") => 304.8,
        Some("meter") => 1000.0,
        Some(other) => return Err(format!("the unit is \"{}\"", one_line(other))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::write::SimpleFileOptions;

    fn archive(entries: &[(&str, &str)]) -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, text) in entries {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(text.as_bytes()).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    fn tetrahedron(id: u32) -> String {
        let corners = ["0 0 0", "1 0 0", "0 2 0", "0 0 3"].map(|corner| {
            let [x, y, z] = [0, 1, 2].map(|k| corner.split(' ').nth(k).unwrap());
            format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>")
        });
        let faces = ["021", "013", "123", "032"].map(|f| {
            format!(
                "<m:triangle v1=\"{}\" v2=\"{}\" v3=\"{}\" pid='5'/>",
                &f[..1],
                &f[1..2],
                &f[2..]
            )
        });
        format!(
            "<object id=\"{id}\"><mesh><vertices>{}</vertices><triangles>{}</triangles></mesh></object>",
            corners.concat(),
            faces.concat()
        )
    }

    fn model(unit: &str, resources: &str, build: &str) -> String {
        format!(
            "\u{feff}<?xml version=\"1.0\"?><!-- made by hand --><model {unit} xmlns:m='x'>\
             <metadata name=\"Title\">a &amp; b</metadata>\
             <resources>{resources}</resources><build>{build}</build></model>"
        )
    }

    fn read_model(text: &str) -> Result<Mesh> {
        read(&archive(&[(USUAL_MODEL, text)]), Path::new("part.3mf"))
    }

    #[test]
    fn objects_are_placed_scaled_and_mirrored_as_the_build_says() {
        let inch = model("unit=\"inch\"", &tetrahedron(4), "<item objectid=\"4\"/>");
        let mesh = read_model(&inch).unwrap();
        assert!((mesh.volume() / 25.4f64.powi(3) - 1.0).abs() < 1e-12);
        // A quarter turn about z, a shift, and in the outer object a mirror image.
        let nest = "<object id=\"7\"><components>\
             <component objectid=\"4\" transform=\"0 1 0 -1 0 0 0 0 1 10 0 0\"/>\
             </components></object>";
        let mirror = "<item objectid=\"7\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 5\"/>";
        let text = model("", &(tetrahedron(4) + nest), mirror);
        let mesh = read_model(&text).unwrap();
        assert_eq!(mesh.volume(), 1.0);
        assert_eq!(
            mesh.bounds().unwrap(),
            (DVec3::new(-10.0, 0.0, 5.0), DVec3::new(-8.0, 1.0, 8.0))
        );
    }

    #[test]
    fn the_relationships_name_the_model() {
        let text = model("", &tetrahedron(1), "<item objectid=\"1\"/>");
        let relation = "<Relationships><Relationship Target=\"/a/b.model\" Id=\"r\" \
             Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
        let bytes = archive(&[(RELATIONSHIPS, relation), ("a/b.model", &text)]);
        assert_eq!(read(&bytes, Path::new("x")).unwrap().triangles.len(), 4);
    }

    #[test]
    fn broken_models_are_one_line_that_says_where() {
        let whole = model("", &tetrahedron(1), "<item objectid=\"1\"/>");
        let nested = |id: u32| {
            let part = format!("<component objectid=\"{}\"/>", id - 1).repeat(9);
            format!("<object id=\"{id}\"><components>{part}</components></object>")
        };
        let bomb: String = (2..20).map(nested).collect();
        let cases = [
            (whole.replace("v1=\"1\"", "v1=\"9\""), "object 1: vertex 9 of 4"),
            (whole.replace("v1=\"1\"", "v1=\"-1\""), "v1 is \"-1\""),
            (whole.replace("x=\"1\"", "x=\"nan\""), "coordinate x is NaN"),
            (whole.replace("x=\"1\"", "q=\"1\""), "<vertex> has no x"),
            (whole.replace("objectid=\"1\"", "objectid=\"2\""), "object 2 does not exist"),
            (whole.replace("objectid=\"1\"", "p:path=\"/b.model\" objectid=\"1\""), "another file"),
            (
                whole.replace("objectid=\"1\"", "objectid=\"1\" transform=\"1 0\""),
                "2 numbers, not 12",
            ),
            (whole.replace("<item", "<none"), "places no object"),
            (whole.replace("<model", "<model unit=\"parsec\""), "the unit is \"parsec\""),
            (whole.replace("</build></model>", ""), "cut off"),
            ("no xml at all".into(), "no model"),
            (
                model(
                    "",
                    "<object id=\"1\"><components><component objectid=\"1\"/></components></object>",
                    "<item objectid=\"1\"/>",
                ),
                "multiply without end",
            ),
            (
                model("", &(tetrahedron(1) + &bomb), "<item objectid=\"19\"/>"),
                "multiply without end",
            ),
        ];
        for (text, expected) in cases {
            let message = read_model(&text).unwrap_err().to_string();
            assert!(message.contains(expected) && !message.contains('\n'), "{expected}: {message}");
        }
    }

    #[test]
    fn an_archive_that_unpacks_to_far_more_than_it_is_is_refused() {
        let blank = " ".repeat(50 << 20);
        let text = model("", &(tetrahedron(1) + &blank), "<item objectid=\"1\"/>");
        let message = read_model(&text).unwrap_err().to_string();
        assert!(message.contains("unpacks to over"), "{message}");
        assert!(read(b"PK\x03\x04", Path::new("x")).is_err());
    }
}
