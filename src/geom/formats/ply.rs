//! PLY files: text, and binary in both byte orders, read through `ply-rs-bw` one element at a time.
//!
//! A header may promise any number of elements; each one read consumes bytes of the file, and
//! elements that would not are refused, so neither time nor memory exceeds what the file pays for.

use super::polygon::Polygons;
use super::strip::Strips;
use super::text::Lines;
use super::{Mesh, one_line};
use crate::{Error, Result};
use glam::DVec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyDef,
    PropertyType, ScalarType,
};
use std::path::Path;

/// Vertices, polygons cut into triangles and strips of them, in file units.
pub(super) fn read_mesh(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let mut body = Body::open(bytes, path)?;
    body.require_faces()?;
    let last = body.last_of(&[FACE, STRIPS]);
    let mut vertices = Vec::new();
    let (mut polygons, mut strips) = (Polygons::counting_from(0), Strips::default());
    body.read(&last, |element, i, item| {
        match element {
            "vertex" => vertices.push(item.point()?),
            FACE => {
                item.corners.iter().for_each(|c| polygons.push_corner(*c));
                polygons.end(i);
            }
            STRIPS => strips.push(&item.corners),
            _ => {}
        }
        Ok(())
    })?;
    let mut mesh = polygons.into_mesh(vertices, path, |i| format!("face {i}"))?;
    strips.append_to(&mut mesh, path)?;
    Ok(mesh)
}

/// Elements whose faces are read.
const FACE: &str = "face";
const STRIPS: &str = "tristrips";

/// Points and normals as they are, in file units.
pub(super) fn read_cloud(bytes: &[u8], path: &Path) -> Result<(Vec<DVec3>, Vec<DVec3>)> {
    let mut body = Body::open(bytes, path)?;
    if !has_properties(&body.header, &["nx", "ny", "nz"]) {
        return Err(body.fault(
            "header",
            "element vertex has no normals (properties nx, ny, nz)",
            "export the cloud with normals, or give a mesh",
        ));
    }
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    body.read("vertex", |element, _, item| {
        if element == "vertex" {
            points.push(item.point()?);
            normals.push(DVec3::from_array([item.values[3], item.values[4], item.values[5]]));
        }
        Ok(())
    })?;
    Ok((points, normals))
}

/// Whether the file holds points with normals but no faces of any kind.
pub(super) fn is_cloud(bytes: &[u8], path: &Path) -> Result<bool> {
    let header = Body::open(bytes, path)?.header;
    let faces = header.elements.values().any(holds_faces);
    Ok(!faces && has_properties(&header, &["nx", "ny", "nz"]))
}

/// Whether an element joins vertices to faces, of whatever kind: by its name, or by a list of vertices.
fn holds_faces(element: &ElementDef) -> bool {
    let is_list = |p: &PropertyDef| matches!(p.data_type, PropertyType::List(..));
    let is_of_vertices = |p: &&PropertyDef| is_list(p) && p.name.starts_with("vert");
    let named = ["face", "strip", "fan", "triang", "polygon", "quad"];
    let by_name = named.iter().any(|word| element.name.to_lowercase().contains(word));
    let joins = by_name || element.properties.values().any(|p| is_of_vertices(&p));
    element.name != "vertex" && element.count > 0 && joins
}

fn has_properties(header: &Header, names: &[&str]) -> bool {
    let vertex = header.elements.get("vertex");
    vertex.is_some_and(|v| names.iter().all(|name| v.properties.contains_key(*name)))
}

/// What is used of one element, vertex or face.
struct Item {
    /// Properties x, y, z, nx, ny, nz.
    values: [f64; 6],
    /// The list `vertex_indices`.
    corners: Vec<i64>,
}

impl Item {
    fn point(&self) -> std::result::Result<DVec3, String> {
        let point = DVec3::from_array([self.values[0], self.values[1], self.values[2]]);
        match point.is_finite() {
            true => Ok(point),
            false => Err(format!("coordinates ({}, {}, {})", point.x, point.y, point.z)),
        }
    }
}

impl PropertyAccess for Item {
    fn new() -> Self {
        Item { values: [0.0; 6], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "nx" => 3,
            "ny" => 4,
            "nz" => 5,
            "vertex_indices" | "vertex_index" => {
                self.corners = match property {
                    Property::ListChar(list) => widened(&list),
                    Property::ListUChar(list) => widened(&list),
                    Property::ListShort(list) => widened(&list),
                    Property::ListUShort(list) => widened(&list),
                    Property::ListInt(list) => widened(&list),
                    Property::ListUInt(list) => widened(&list),
                    _ => return PropertyAccessResult::UnsupportedType,
                };
                return PropertyAccessResult::Set;
            }
            _ => return PropertyAccessResult::Ignored,
        };
        self.values[slot] = match property {
            Property::Float(value) => f64::from(value),
            Property::Double(value) => value,
            Property::Char(value) => f64::from(value),
            Property::UChar(value) => f64::from(value),
            Property::Short(value) => f64::from(value),
            Property::UShort(value) => f64::from(value),
            Property::Int(value) => f64::from(value),
            Property::UInt(value) => f64::from(value),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

fn widened<T: Copy + Into<i64>>(list: &[T]) -> Vec<i64> {
    list.iter().map(|i| (*i).into()).collect()
}

/// A file whose header is read.
struct Body<'a> {
    path: &'a Path,
    header: Header,
    rest: &'a [u8],
    /// Lines before `rest`.
    n_lines: usize,
}

impl<'a> Body<'a> {
    fn open(bytes: &'a [u8], path: &'a Path) -> Result<Self> {
        let parser = Parser::<Item>::new();
        let read = |bytes: &[u8]| {
            let mut reader = Reader::new(bytes);
            let header = parser.read_header(&mut reader).map_err(|e| {
                let place = format!("header line {}", e.line().unwrap_or(1));
                let remedy = "check that this is a PLY file; export it again";
                Error::file(path, place, one_line(e), remedy)
            })?;
            Ok::<_, Error>((header, bytes.len() - reader.into_inner().len()))
        };
        let (header, n_head) = match carriage_returns(bytes) {
            Some(head) => read(&head)?,
            None => read(bytes)?,
        };
        let (head, rest) = bytes.split_at(n_head);
        let n_lines = Lines::new(head).count();
        let body = Body { path, header, rest, n_lines };
        if !has_properties(&body.header, &["x", "y", "z"]) {
            let found = "there is no element vertex with properties x, y, z";
            return Err(body.fault("header", found, "export the part again"));
        }
        Ok(body)
    }

    /// Fails if there are no faces, or only faces of a kind that is not read.
    fn require_faces(&self) -> Result<()> {
        let faces = || self.header.elements.values().filter(|element| holds_faces(element));
        if faces().any(|element| [FACE, STRIPS].contains(&element.name.as_str())) {
            return Ok(());
        }
        Err(match faces().next() {
            Some(other) => {
                let found = format!("the faces are in the element {}", one_line(&other.name));
                let remedy =
                    "export the part with polygons (element face) or triangle strips (tristrips)";
                self.fault("header", found, remedy)
            }
            None => self.fault(
                "header",
                "there is no element face",
                "give a mesh, or, if the points have normals nx ny nz, use the file as a cloud",
            ),
        })
    }

    /// The last element of these names.
    fn last_of(&self, names: &[&str]) -> String {
        let mut elements = self.header.elements.keys().rev();
        elements.find(|name| names.contains(&name.as_str())).cloned().unwrap_or_default()
    }

    fn fault(&self, place: impl Into<String>, found: impl Into<String>, remedy: &str) -> Error {
        Error::file(self.path, place, found, remedy)
    }

    /// Hands every element to `take` as (kind, number, content), until those named `last` are read.
    fn read(
        &mut self,
        last: &str,
        mut take: impl FnMut(&str, usize, Item) -> std::result::Result<(), String>,
    ) -> Result<()> {
        let definitions: Vec<ElementDef> = self.header.elements.values().cloned().collect();
        // A face may stand before the vertices it uses.
        let n_needed = 1 + definitions
            .iter()
            .rposition(|d| d.name == last || d.name == "vertex")
            .unwrap_or_default();
        for definition in &definitions[..n_needed] {
            self.check_room(definition)?;
            for i in 0..definition.count {
                let place = || format!("element {} {i} of {}", definition.name, definition.count);
                let (line, item) = self.next(definition);
                let at = |place: String| match line {
                    Some(line) => format!("line {line}, {place}"),
                    None => place,
                };
                let item = item.map_err(|found| {
                    self.fault(at(place()), found, "copy or export the file again")
                })?;
                take(&definition.name, i, item)
                    .map_err(|found| self.fault(at(place()), found, "export the part again"))?;
            }
        }
        Ok(())
    }

    /// The next element, with its line if the file is text.
    fn next(
        &mut self,
        definition: &ElementDef,
    ) -> (Option<usize>, std::result::Result<Item, String>) {
        let parser = Parser::<Item>::new();
        let cut_off = |e: ParseError| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => "the file ends here: it is cut off".into(),
            _ => one_line(e),
        };
        match self.header.encoding {
            Encoding::BinaryLittleEndian => {
                let item = parser.read_little_endian_element(&mut self.rest, definition);
                (None, item.map_err(cut_off))
            }
            Encoding::BinaryBigEndian => {
                let item = parser.read_big_endian_element(&mut self.rest, definition);
                (None, item.map_err(cut_off))
            }
            Encoding::Ascii => self.next_line(&parser, definition),
        }
    }

    fn next_line(
        &mut self,
        parser: &Parser<Item>,
        definition: &ElementDef,
    ) -> (Option<usize>, std::result::Result<Item, String>) {
        loop {
            let mut lines = Lines::after(self.rest, self.n_lines);
            let Some((number, line)) = lines.next() else {
                return (Some(self.n_lines), Err("the file ends here: it is cut off".into()));
            };
            (self.rest, self.n_lines) = (lines.rest(), number);
            if !line.trim().is_empty() {
                let item = parser.read_ascii_element(line.trim(), definition);
                return (Some(number), item.map_err(one_line));
            }
        }
    }

    /// Refuses counts that the rest of the file cannot hold.
    fn check_room(&self, definition: &ElementDef) -> Result<()> {
        let size = |kind: &ScalarType| match kind {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        };
        let least = |kind: &PropertyType| match (kind, self.header.encoding) {
            (_, Encoding::Ascii) => 2,
            (PropertyType::Scalar(kind) | PropertyType::List(kind, _), _) => size(kind),
        };
        let each: u64 = definition.properties.values().map(|p| least(&p.data_type)).sum();
        let (count, rest) = (definition.count as u64, self.rest.len() as u64);
        // The last number of a text file needs no line end.
        if count > 0 && (each == 0 || count.saturating_mul(each) > rest.saturating_add(1)) {
            let place = format!("element {}", definition.name);
            let found = format!(
                "the header promises {count} of at least {each} bytes, {rest} bytes are left"
            );
            return Err(self.fault(place, found, "the file is cut off or damaged: copy it again"));
        }
        Ok(())
    }
}

/// Longest header in which carriage returns are read as line ends.
const MAX_HEAD: usize = 1 << 20;

/// The header with line ends that the library reads, if its lines end in carriage returns alone.
fn carriage_returns(bytes: &[u8]) -> Option<Vec<u8>> {
    let begins = bytes.starts_with(b"ply\r") && bytes.get(4) != Some(&b'\n');
    let start = &bytes[..bytes.len().min(MAX_HEAD)];
    let end = start.windows(11).position(|w| w == b"end_header\r").filter(|_| begins)? + 11;
    Some(start[..end].iter().map(|b| if *b == b'\r' { b'\n' } else { *b }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "comment made by hand\nelement vertex 4\nproperty float x\n\
        property float y\nproperty double z\nproperty uchar quality\nelement face 1\n\
        property list uchar int vertex_indices\nproperty uchar red\nend_header\n";

    fn read(bytes: &[u8]) -> Result<Mesh> {
        read_mesh(bytes, Path::new("part.ply"))
    }

    fn binary(order: &str) -> Vec<u8> {
        let big = order == "big";
        let f = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let d = |v: f64| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let n = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\n{HEAD}").into_bytes();
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            bytes.extend(f(x).into_iter().chain(f(y)).chain(d(0.5)).chain([7]));
        }
        bytes.push(4);
        bytes.extend((0..4).flat_map(n));
        bytes.push(255);
        bytes
    }

    #[test]
    fn text_and_both_byte_orders_give_the_same_mesh() {
        let text = format!(
            "ply\r\nformat ascii 1.0\r\n{}0 0 0.5 7\r\n1 0 0.5 7\r\n1 1 0.5 7\r\n\r\n\
             0 1 0.5 7\r\n4 0 1 2 3 255\r\n",
            HEAD.replace('\n', "\r\n")
        );
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 2));
        assert_eq!(mesh.vertices[2], DVec3::new(1.0, 1.0, 0.5));
        assert_eq!(mesh.area(), 1.0);
        assert_eq!(read(&binary("little")).unwrap(), mesh);
        assert_eq!(read(&binary("big")).unwrap(), mesh);
    }

    #[test]
    fn lines_end_in_any_of_the_three_ways() {
        let text =
            format!("ply\nformat ascii 1.0\n{HEAD}0 0 0 7\n1 0 0 7\n1 1 0 7\n0 1 0 7\n4 0 1 2 3 9");
        let mesh = read(text.as_bytes()).unwrap();
        for end in ["\r", "\r\n"] {
            assert_eq!(read(text.replace('\n', end).as_bytes()).unwrap(), mesh, "{end:?}");
            let cut = text.replace("\n1 1 0 7", "\n1 x 0 7").replace('\n', end);
            let message = read(cut.as_bytes()).unwrap_err().to_string();
            assert!(message.starts_with("part.ply: line 15, element vertex 2"), "{message}");
        }
        // A binary body begins right behind the carriage return, even with a line feed.
        let mut bytes = binary("little");
        let n = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        bytes[n] = b'\n';
        let expected = read(&bytes).unwrap();
        bytes[..n].iter_mut().filter(|b| **b == b'\n').for_each(|b| *b = b'\r');
        assert_eq!(read(&bytes).unwrap(), expected);
    }

    /// A cube of strips, with normals.
    fn strips(element: &str, list: &str) -> String {
        let head = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
            property float z\nproperty float nx\nproperty float ny\nproperty float nz\n";
        let corner = |i: usize| format!("{} {} {} 0 0 1\n", i % 2, i / 2 % 2, i / 4);
        let corners: String = (0..8).map(corner).collect();
        format!(
            "{head}element {element} 1\nproperty list int int vertex_indices\nend_header\n{corners}{list}\n"
        )
    }

    const CUBE: &str = "29 0 2 1 3 -1 4 5 6 7 -1 0 1 4 5 -1 2 6 3 7 -1 0 4 2 6 -1 1 3 5 7";

    #[test]
    fn triangle_strips_are_faces_and_face_the_same_side() {
        let text = strips("tristrips", CUBE);
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.volume(), mesh.area()), (12, 1.0, 6.0));
        // The sides in one strip and lids, with corners that only lead on.
        let one = strips("tristrips", "21 4 0 5 1 7 3 6 2 4 0 0 4 4 5 6 7 -1 0 2 1 3");
        assert_eq!(read(one.as_bytes()).unwrap().volume(), 1.0);
        for (text, words) in [
            (strips("tristrips", "3 0 1 8"), "triangle strip 0: vertex 8 of 8"),
            (strips("tristrips", "4 0 1 -2 3"), "vertex -2 of 8"),
            (strips("tristrips", "6 0 1 2 -1 4 5"), "a strip has 2 corners"),
            (strips("trifans", CUBE), "the faces are in the element trifans"),
        ] {
            let message = read(text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(words), "{words}: {message}");
        }
    }

    #[test]
    fn points_with_faces_of_any_kind_are_no_cloud() {
        let cloud = |text: String| is_cloud(text.as_bytes(), Path::new("part.ply")).unwrap();
        for element in ["face", "tristrips", "trifans", "quads", "patch"] {
            assert!(!cloud(strips(element, CUBE)), "{element}");
        }
        let text = strips("camera", CUBE).replace("vertex_indices", "view");
        assert!(cloud(text) && cloud(strips("face", "").replace("face 1", "face 0")));
    }

    #[test]
    fn every_cut_of_a_binary_file_is_refused() {
        let whole = binary("little");
        for n in 0..whole.len() - 1 {
            let message = read(&whole[..n]).unwrap_err().to_string();
            assert!(message.starts_with("part.ply: ") && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused_at_once() {
        for count in ["4000000000", "18446744073709551615"] {
            for element in ["vertex 4", "face 1"] {
                let (name, _) = element.split_once(' ').unwrap();
                let head = HEAD.replace(element, &format!("{name} {count}"));
                for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
                    let text = format!("ply\nformat {format} 1.0\n{head}0 0 0 7\n0 0 0 7\n");
                    assert!(read(text.as_bytes()).is_err());
                }
            }
        }
        let hollow = HEAD.replace("element face", "element nothing 4000000000\nelement face");
        let text = format!("ply\nformat ascii 1.0\n{hollow}");
        assert!(read(text.as_bytes()).is_err());
    }
}
