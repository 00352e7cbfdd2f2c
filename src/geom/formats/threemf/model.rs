//! A model: its objects, and the items of its build.

use super::super::{Mesh, one_line};
use super::roles::Role;
use super::xml::{coordinate, finite, namespace, number, unit_mm, value};
use super::{Found, in_archive};
use glam::{DMat3, DVec3};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use std::collections::HashMap;
use std::io::BufRead;

/// An object placed: its number, in which model, and where its points go.
pub(super) struct Placed {
    pub object: u32,
    /// Name of the other model that holds it.
    pub file: Option<String>,
    pub turn: DMat3,
    pub shift: DVec3,
    pub printable: bool,
}

#[derive(Default)]
pub(super) struct Object {
    pub mesh: Mesh,
    pub components: Vec<Placed>,
    pub role: Role,
    pub name: Option<String>,
}

pub(super) struct Model {
    pub unit_mm: f64,
    pub objects: HashMap<u32, Object>,
    pub items: Vec<Placed>,
    /// The object being read.
    open: Option<(u32, Object)>,
    /// The role that a setting being read gives it.
    setting: Option<Role>,
}

impl Default for Model {
    fn default() -> Self {
        Model {
            unit_mm: 1.0,
            objects: HashMap::new(),
            items: Vec::new(),
            open: None,
            setting: None,
        }
    }
}

/// Namespaces of extensions that may be required.
const EXTENSIONS: [&str; 3] = [
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
];

impl Model {
    pub(super) fn parse(&mut self, xml: &mut Reader<impl BufRead>) -> Found<()> {
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
                Event::Text(text) => {
                    self.text(&text);
                    continue;
                }
                Event::Eof if began => return Err("the model is cut off".into()),
                Event::Eof => return Err("there is no model".into()),
                _ => continue,
            }
            began = true;
        }
    }

    fn begin(&mut self, tag: &BytesStart) -> Found<()> {
        match (tag.local_name().as_ref(), &mut self.open) {
            ("model", _) => {
                check_extensions(tag)?;
                self.unit_mm = unit_mm(value(tag, "unit").as_deref())?;
            }
            ("item", _) => self.items.push(placed(tag)?),
            ("object", open) => *open = Some((number(tag, "id")?, object(tag)?)),
            ("component", Some((_, object))) => object.components.push(placed(tag)?),
            ("vertex", Some((_, object))) => {
                let [x, y, z] = ["x", "y", "z"].map(|name| coordinate(tag, name));
                object.mesh.vertices.push(DVec3::new(x?, y?, z?));
            }
            ("triangle", Some((_, object))) => {
                let [a, b, c] = ["v1", "v2", "v3"].map(|name| number(tag, name));
                object.mesh.triangles.push([a?, b?, c?]);
            }
            ("metadata", Some(_)) => {
                self.setting = value(tag, "name").and_then(|name| Role::of_setting(&name));
            }
            (shape @ ("booleanshape" | "displacementmesh"), Some((id, _))) => {
                return Err(format!("object {id} is a {shape}, which is not read"));
            }
            _ => {}
        }
        Ok(())
    }

    fn text(&mut self, text: &str) {
        let is_set = || matches!(text.trim().to_ascii_lowercase().as_str(), "true" | "1");
        if let (Some(role), Some((_, object))) = (self.setting, &mut self.open)
            && is_set()
        {
            object.role = role;
        }
    }

    fn end(&mut self, name: &str) {
        match name {
            "object" => self.objects.extend(self.open.take()),
            "metadata" => self.setting = None,
            _ => {}
        }
    }

    /// Models that objects are taken from, each once, in order.
    pub(super) fn other_files(&self) -> Vec<String> {
        let mut ids: Vec<&u32> = self.objects.keys().collect();
        ids.sort_unstable();
        let components = ids.into_iter().flat_map(|id| &self.objects[id].components);
        let mut files: Vec<String> = Vec::new();
        for file in self.items.iter().chain(components).filter_map(|placed| placed.file.as_ref()) {
            if files.last() != Some(file) && !files.contains(file) {
                files.push(file.clone());
            }
        }
        files
    }
}

/// An extension that a file requires and that is not read may change its shape.
fn check_extensions(tag: &BytesStart) -> Found<()> {
    let required = value(tag, "requiredextensions").unwrap_or_default();
    for prefix in required.split_whitespace() {
        let name = namespace(tag, prefix);
        if name.as_deref().is_some_and(|name| EXTENSIONS.contains(&name.trim())) {
            continue;
        }
        let name = name.map_or(String::new(), |name| format!(" ({})", one_line(name)));
        let prefix = one_line(prefix);
        return Err(format!("it requires the extension {prefix}{name}, which is not read"));
    }
    Ok(())
}

fn object(tag: &BytesStart) -> Found<Object> {
    let role = Role::of_object(value(tag, "type").as_deref())?;
    let name = value(tag, "name").filter(|name| !name.trim().is_empty());
    Ok(Object { role, name, ..Object::default() })
}

fn placed(tag: &BytesStart) -> Found<Placed> {
    let object = number(tag, "objectid")?;
    let file = value(tag, "path").map(|path| in_archive(&path));
    let printable = !matches!(value(tag, "printable").as_deref(), Some("0" | "false"));
    let here = Placed { object, file, turn: DMat3::IDENTITY, shift: DVec3::ZERO, printable };
    let Some(text) = value(tag, "transform") else { return Ok(here) };
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
    Ok(Placed { turn: DMat3::from_cols(x, y, z), shift, ..here })
}
