//! Answers for other programs: a glTF file with colors, and a table with a row per site. `docs/formats.md` has the
//! schema.

use super::points::PointValues;
use super::{Coloring, PartView};
use crate::data::files::Provenance;
use crate::exec::par;
use crate::geom::Sites;
use crate::render::memory::PartSize;
use crate::render::paint::Painter;
use crate::storage::atomic_file;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::io;
use std::path::Path;
use std::str::FromStr;

/// A format beside NPZ, PLY and PNG.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Extra {
    /// Binary glTF 2.0: triangles in the colors of the answers.
    Glb,
    /// Comma-separated values: a row per site.
    Csv,
}

impl Extra {
    /// Every format.
    pub const ALL: [Extra; 2] = [Extra::Glb, Extra::Csv];

    /// `glb` or `csv`, which is also the file's extension.
    pub fn name(self) -> &'static str {
        match self {
            Extra::Glb => "glb",
            Extra::Csv => "csv",
        }
    }
}

/// Reads a [name](Extra::name).
impl FromStr for Extra {
    type Err = Error;

    /// # Errors
    /// If no format has it.
    fn from_str(name: &str) -> Result<Self> {
        Extra::ALL.into_iter().find(|extra| extra.name() == name).ok_or_else(|| {
            let expected = Extra::ALL.map(Extra::name).join(" or ");
            Error::argument("format", name, expected, "NPZ and PLY are always written")
        })
    }
}

/// Writes a row per site: `site, x, y, z, nx, ny, nz, answer` (the color's name), then `values` by name; mm.
///
/// # Errors
/// If the system refuses the file.
///
/// # Panics
/// If `coloring` or a list of values has not one entry per site.
#[doc(hidden)] // written by `analysis` and the program
pub fn write_csv(
    path: &Path,
    sites: &Sites,
    coloring: &Coloring,
    values: &[(&str, PointValues)],
) -> Result<()> {
    let names = ["site", "x", "y", "z", "nx", "ny", "nz", "answer"];
    let names: Vec<&str> = names.into_iter().chain(values.iter().map(|(name, _)| *name)).collect();
    atomic_file::write_atomic(path, |file| {
        let mut writer = csv::Writer::from_writer(io::BufWriter::new(file));
        writer.write_record(&names)?;
        for i in 0..sites.len() {
            let vectors = [sites.points[i], sites.normals[i]];
            let mut row = vec![i.to_string()];
            row.extend(vectors.iter().flat_map(|v| v.to_array()).map(|x| x.to_string()));
            row.push(coloring.classes()[coloring.class(i)].name.into());
            row.extend(values.iter().map(|(_, values)| match values {
                PointValues::Flags(v) => u8::from(v[i]).to_string(),
                PointValues::Are(v, answer) => u8::from(v[i] == *answer).to_string(),
                PointValues::Counts(v) => v[i].to_string(),
                PointValues::LargeCounts(v) => v[i].to_string(),
                PointValues::Reals(v) => v[i].to_string(),
            }));
            writer.write_record(&row)?;
        }
        writer.flush()
    })
}

/// Most triangles of a glTF file; then they stay larger than the sites are apart.
const MAX_TRIANGLES: f64 = 2e6;
/// Longest edge of a triangle, in spacings of the sites.
const LONGEST_EDGE: f64 = 1.0;
/// Bytes of a vertex: position and normal in `f32`, color in four `u16`.
const STRIDE: usize = 32;

/// Writes the part as triangles that are not shared, each in the color of the site nearest to its middle that faces the
/// same way. Triangles longer than the sites are apart are cut in two until they are not. Positions are mm, +z up; a
/// matrix makes meters and +y up of them, as glTF has it.
///
/// # Errors
/// If it does not fit into the memory, the system refuses the file, or it would have 4 GB.
///
/// # Panics
/// If `coloring` has not one entry per site.
#[doc(hidden)] // written by `analysis` and the program
pub fn write_glb(path: &Path, part: &PartView, caption: &str, coloring: &Coloring) -> Result<()> {
    let size = PartSize::of(part.mesh, part.sites);
    size.require_for_gltf(size.n_drawn())?;
    let painter = Painter::new(part, coloring);
    let mut triangles: Vec<[(DVec3, Vec3); 3]> = painter.surface.triangles().collect();
    let area = |t: &[(DVec3, Vec3); 3]| 0.5 * (t[1].0 - t[0].0).cross(t[2].0 - t[0].0).length();
    let total: f64 = triangles.iter().map(area).sum();
    if part.mesh.is_some() {
        let spacing = (total / part.sites.len().max(1) as f64).sqrt();
        // A triangle that was cut is larger than an eighth of a square of that edge, but for slivers.
        let least = (8.0 * total / MAX_TRIANGLES).sqrt();
        let longest = (LONGEST_EDGE * spacing).max(least);
        let n_triangles = triangles.iter().map(|t| cut(*t, longest).len()).sum();
        size.require_for_gltf(n_triangles)?;
        let mut all = Vec::with_capacity(n_triangles);
        triangles.into_iter().for_each(|t| all.extend(cut(t, longest)));
        triangles = all;
    }
    let colored = par::map(triangles.len(), |f| {
        let t = &triangles[f];
        let middle = (t[0].0 + t[1].0 + t[2].0) / 3.0;
        let normal = (t[0].1 + t[1].1 + t[2].1).normalize_or(Vec3::Z);
        let color = painter.color_at(f, middle, normal).map(linear);
        let mut bytes = Vec::with_capacity(3 * STRIDE);
        for (place, normal) in t {
            let numbers = place.as_vec3().to_array().into_iter().chain(normal.to_array());
            numbers.for_each(|x| bytes.extend(x.to_le_bytes()));
            color.iter().chain(&[u16::MAX]).for_each(|c| bytes.extend(c.to_le_bytes()));
        }
        bytes
    });
    let n_vertices = 3 * triangles.len();
    let corners = triangles.iter().flatten().map(|(place, _)| place.as_vec3());
    let bounds = corners.map(|p| (p, p)).reduce(|(l, h), (p, _)| (l.min(p), h.max(p)));
    let header = header(part, caption, coloring, n_vertices, bounds.unwrap_or_default());
    write_container(path, &header, &colored.concat())
}

/// The JSON of the file.
fn header(
    part: &PartView,
    caption: &str,
    coloring: &Coloring,
    n_vertices: usize,
    (low, high): (Vec3, Vec3),
) -> Value {
    let n_bytes = STRIDE * n_vertices;
    let attribute = |offset: usize, component: u32, kind: &str| json!({ "bufferView": 0, "byteOffset": offset, "componentType": component, "count": n_vertices, "type": kind });
    const F32: u32 = 5126;
    const U16: u32 = 5123;
    let mut accessors = vec![attribute(0, F32, "VEC3"), attribute(12, F32, "VEC3")];
    accessors.push(attribute(24, U16, "VEC4"));
    accessors[0]["min"] = json!(low.to_array());
    accessors[0]["max"] = json!(high.to_array());
    accessors[2]["normalized"] = json!(true);
    let legend = coloring.classes().iter().map(|c| json!({ "answer": c.name, "srgb": c.color }));
    json!({
        "asset": { "version": "2.0", "generator": Provenance::PROGRAM },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{
            "name": part.name,
            "mesh": 0,
            "matrix": [0.001, 0, 0, 0, 0, 0, -0.001, 0, 0, 0.001, 0, 0, 0, 0, 0, 1],
            "extras": { "unit": "mm", "cutter": part.cutter, "caption": caption, "colors": legend.collect::<Vec<_>>() },
        }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1, "COLOR_0": 2 }, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0.9 }, "doubleSided": true }],
        "accessors": accessors,
        "bufferViews": [{ "buffer": 0, "byteLength": n_bytes, "byteStride": STRIDE, "target": 34962 }],
        "buffers": [{ "byteLength": n_bytes }],
    })
}

/// The two chunks of a binary glTF file.
fn write_container(path: &Path, header: &Value, bytes: &[u8]) -> Result<()> {
    let mut json = header.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = |n: usize| u32::try_from(n).map(u32::to_le_bytes);
    let total = 12 + 8 + json.len() + 8 + bytes.len();
    let lengths = (length(total), length(json.len()), length(bytes.len()));
    let (Ok(total), Ok(n_json), Ok(n_bytes)) = lengths else {
        let found = format!("{total} bytes");
        return Err(Error::file(path, "glTF", found, "take fewer sites or triangles"));
    };
    atomic_file::write_atomic(path, |file| {
        file.write_all(b"glTF\x02\0\0\0")?;
        file.write_all(&total)?;
        file.write_all(&n_json)?;
        file.write_all(b"JSON")?;
        file.write_all(&json)?;
        file.write_all(&n_bytes)?;
        file.write_all(b"BIN\0")?;
        file.write_all(bytes)
    })
}

/// The triangle, cut in two at its longest edge until no edge is longer than `longest`.
fn cut(t: [(DVec3, Vec3); 3], longest: f64) -> Vec<[(DVec3, Vec3); 3]> {
    let (mut open, mut done) = (vec![t], Vec::new());
    while let Some(t) = open.pop() {
        let edge = |k: usize| t[k].0.distance(t[(k + 1) % 3].0);
        // What is no number is not cut.
        if !(edge(0) > longest || edge(1) > longest || edge(2) > longest) {
            done.push(t);
            continue;
        }
        let k = (0..3).max_by(|a, b| edge(*a).total_cmp(&edge(*b))).unwrap_or(0);
        let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
        let middle = (0.5 * (a.0 + b.0), (a.1 + b.1).normalize_or(a.1));
        open.extend([[a, middle, c], [middle, b, c]]);
    }
    done
}

/// A color of sRGB as light, 16 bits.
fn linear(c: u8) -> u16 {
    let s = f64::from(c) / 255.0;
    let light = if s <= 0.04045 { s / 12.92 } else { libm::pow((s + 0.055) / 1.055, 2.4) };
    (light * 65535.0).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids::cuboid;

    fn block() -> (crate::geom::Mesh, Sites, Vec<bool>) {
        let mesh = cuboid(DVec3::new(30.0, 20.0, 10.0));
        let sites = sample(&mesh, &SiteOptions { n_sites: 300, ..SiteOptions::default() }).unwrap();
        let below = sites.normals.iter().map(|n| n.z < -0.5).collect();
        (mesh, sites, below)
    }

    #[test]
    fn a_glb_file_has_the_part_in_its_colors() {
        let (mesh, sites, below) = block();
        let none = vec![false; sites.len()];
        let coloring = Coloring::Labels { inaccessible: &below, occlusion: &none };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        for mesh in [Some(&mesh), None] {
            let part =
                PartView { name: "a \"b\"", mesh, sites: &sites, cutter: "CR 1", outlines: &[] };
            write_glb(&path, &part, "test", &coloring).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let word =
                |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
            assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
            let n_json = word(12);
            let header: Value = serde_json::from_slice(&bytes[20..20 + n_json]).unwrap();
            assert_eq!(header["nodes"][0]["name"], "a \"b\"");
            let binary = 20 + n_json;
            assert_eq!(
                (word(binary), &bytes[binary + 4..binary + 8]),
                (bytes.len() - binary - 8, &b"BIN\0"[..])
            );
            let vertices = &bytes[binary + 8..];
            assert_eq!(
                vertices.len(),
                STRIDE * header["accessors"][0]["count"].as_u64().unwrap() as usize
            );
            let real =
                |v: &[u8], k: usize| f32::from_le_bytes(v[4 * k..4 * k + 4].try_into().unwrap());
            let share = |v: &[u8], k: usize| u32::from(u16::from_le_bytes([v[k], v[k + 1]]));
            let red = |v: &[u8]| share(v, 24) > 2 * share(v, 26);
            let mut area = [0.0; 2];
            for t in vertices.chunks_exact(3 * STRIDE) {
                let at = |k: usize| Vec3::from_array([0, 1, 2].map(|c| real(&t[k * STRIDE..], c)));
                area[usize::from(red(t))] += 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).length();
                assert_eq!(red(t), real(t, 5) < -0.5, "the underside is red, nothing else");
            }
            if mesh.is_some() {
                assert!(
                    (area[1] - 600.0).abs() < 0.1 && (area[0] - 1600.0).abs() < 0.1,
                    "{area:?}"
                );
            }
        }
    }

    #[test]
    fn every_site_has_a_row() {
        let (_, sites, below) = block();
        let none = vec![false; sites.len()];
        let coloring = Coloring::Labels { inaccessible: &below, occlusion: &none };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let values = [("inaccessible", PointValues::Flags(&below))];
        write_csv(&path, &sites, &coloring, &values).unwrap();
        let mut reader = csv::Reader::from_path(&path).unwrap();
        assert_eq!(reader.headers().unwrap().iter().next_back(), Some("inaccessible"));
        let rows: Vec<_> = reader.records().map(|row| row.unwrap()).collect();
        assert_eq!(rows.len(), 300);
        for (i, row) in rows.iter().enumerate() {
            assert_eq!(row[1].parse::<f32>().unwrap(), sites.points[i].x);
            assert_eq!(&row[7], if below[i] { "inaccessible" } else { "accessible" });
            assert_eq!(&row[8], if below[i] { "1" } else { "0" });
        }
    }

    #[test]
    fn formats_are_named() {
        assert_eq!("glb".parse::<Extra>().unwrap(), Extra::Glb);
        assert!("obj".parse::<Extra>().unwrap_err().to_string().contains("glb or csv"));
    }
}
