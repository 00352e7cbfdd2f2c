//! Colored point clouds: binary PLY that any viewer shows, with the numbers behind the colors.

use super::{Coloring, PartView};
use crate::answers::SiteAnswer;
use crate::exec::memory;
use crate::storage::atomic_file;
use crate::{Error, Result};
use ply_rs_bw::ply::{
    Addable, ElementDef, Encoding, Ply, PropertyAccess, PropertyDef, PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;
use std::path::Path;

/// One number per site, written as a property of the point.
#[derive(Debug, Clone, Copy)]
pub enum PointValues<'a> {
    /// 0 (no) or 1 (yes), `uchar`.
    Flags(&'a [bool]),
    /// 1 where that is the answer, `uchar`.
    Are(&'a [SiteAnswer], SiteAnswer),
    /// `uint`.
    Counts(&'a [u32]),
    /// `double`, exact up to 2⁵³.
    LargeCounts(&'a [u64]),
    /// `float`.
    Reals(&'a [f32]),
}

impl PointValues<'_> {
    fn len(&self) -> usize {
        match self {
            PointValues::Flags(v) => v.len(),
            PointValues::Are(v, _) => v.len(),
            PointValues::Counts(v) => v.len(),
            PointValues::LargeCounts(v) => v.len(),
            PointValues::Reals(v) => v.len(),
        }
    }

    fn kind(&self) -> ScalarType {
        match self {
            PointValues::Flags(_) | PointValues::Are(..) => ScalarType::UChar,
            PointValues::Counts(_) => ScalarType::UInt,
            PointValues::LargeCounts(_) => ScalarType::Double,
            PointValues::Reals(_) => ScalarType::Float,
        }
    }
}

/// Writes the sites as binary PLY: `x y z nx ny nz red green blue`, then `values` by name.
///
/// Comments state the unit, the part, the cutter, the meaning of the colors, and `notes`.
///
/// # Errors
/// If it does not fit into the memory, the system refuses the file, or a list of values has not one entry per site.
///
/// # Panics
/// If `coloring` has not one entry per site.
pub fn write(
    path: &Path,
    part: &PartView,
    coloring: &Coloring,
    values: &[(&str, PointValues)],
    notes: &[String],
) -> Result<()> {
    assert_eq!(coloring.len(), part.sites.len(), "one color per site");
    if let Some((name, v)) = values.iter().find(|(_, v)| v.len() != part.sites.len()) {
        let found = format!("{} values for {} sites", v.len(), part.sites.len());
        return Err(Error::file(path, *name, found, "give one value per site"));
    }
    let needed = memory::product([part.sites.len(), 2 * size_of::<Row>()]);
    memory::require("writing the points", needed, "take fewer sites")?;
    let table = Table { part, coloring, values };
    let mut ply = Ply::<Row>::new();
    ply.header.encoding = Encoding::BinaryLittleEndian;
    ply.header.comments = comments(part, coloring, notes);
    ply.header.elements.add(definition(values));
    let rows = (0..part.sites.len()).map(|i| Row { table: Some(&table), i }).collect();
    ply.payload.insert("vertex".into(), rows);
    atomic_file::write_atomic(path, |mut file| {
        Writer::new().write_ply(&mut file, &mut ply).map(|_| ())
    })
}

fn comments(part: &PartView, coloring: &Coloring, notes: &[String]) -> Vec<String> {
    let mut comments = vec![
        format!("deepmill {}", env!("CARGO_PKG_VERSION")),
        "unit mm".to_string(),
        format!("part {}", part.name),
        format!("cutter {}", part.cutter),
    ];
    comments.extend(coloring.classes().iter().map(|class| {
        let [r, g, b] = class.color;
        format!("color {r} {g} {b}: {}", class.name)
    }));
    comments.extend(notes.iter().cloned());
    comments.iter().map(|c| c.replace(['\n', '\r'], " ")).collect()
}

fn definition(values: &[(&str, PointValues)]) -> ElementDef {
    let mut element = ElementDef::new("vertex".into());
    let mut add = |name: &str, kind: ScalarType| {
        element.properties.add(PropertyDef::new(name.into(), PropertyType::Scalar(kind)));
    };
    ["x", "y", "z", "nx", "ny", "nz"].iter().for_each(|name| add(name, ScalarType::Float));
    ["red", "green", "blue"].iter().for_each(|name| add(name, ScalarType::UChar));
    values.iter().for_each(|(name, v)| add(name, v.kind()));
    element
}

struct Table<'a> {
    part: &'a PartView<'a>,
    coloring: &'a Coloring<'a>,
    values: &'a [(&'a str, PointValues<'a>)],
}

/// One site, as the writer reads it; without a table only while the writer makes defaults.
struct Row<'a> {
    table: Option<&'a Table<'a>>,
    i: usize,
}

impl Row<'_> {
    fn value(&self, name: &str) -> Option<PointValues<'_>> {
        self.table?.values.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
    }
}

impl PropertyAccess for Row<'_> {
    fn new() -> Self {
        Row { table: None, i: 0 }
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        let sites = self.table?.part.sites;
        let axis = |name: &str| ["x", "y", "z"].iter().position(|a| *a == name);
        if let Some(k) = axis(name) {
            return Some(sites.points[self.i][k]);
        }
        if let Some(k) = name.strip_prefix('n').and_then(axis) {
            return Some(sites.normals[self.i][k]);
        }
        match self.value(name)? {
            PointValues::Reals(v) => Some(v[self.i]),
            _ => None,
        }
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        if let Some(k) = ["red", "green", "blue"].iter().position(|c| *c == name) {
            return Some(self.table?.coloring.color(self.i)[k]);
        }
        match self.value(name)? {
            PointValues::Flags(v) => Some(u8::from(v[self.i])),
            PointValues::Are(v, answer) => Some(u8::from(v[self.i] == answer)),
            _ => None,
        }
    }

    fn get_uint(&self, name: &str) -> Option<u32> {
        match self.value(name)? {
            PointValues::Counts(v) => Some(v[self.i]),
            _ => None,
        }
    }

    fn get_double(&self, name: &str) -> Option<f64> {
        match self.value(name)? {
            PointValues::LargeCounts(v) => Some(v[self.i] as f64),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Sites;
    use glam::Vec3;
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Property};

    #[test]
    fn every_property_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let points = vec![Vec3::new(1.0, 2.0, 3.0), Vec3::new(-0.1, 1e-7, 4.0)];
        let sites = Sites { points, normals: vec![Vec3::X, Vec3::NEG_Z], faces: vec![] };
        let part =
            PartView { name: "a\nb", mesh: None, sites: &sites, cutter: "CR 1", outlines: &[] };
        let coloring =
            Coloring::Labels { inaccessible: &[true, false], occlusion: &[false, false] };
        let values = [
            ("inaccessible", PointValues::Flags(&[true, false])),
            ("accessible_directions", PointValues::Counts(&[0, 150])),
            ("beta", PointValues::LargeCounts(&[1 << 40, 3])),
            ("probability", PointValues::Reals(&[0.25, 1.0])),
        ];
        write(&path, &part, &coloring, &values, &["inaccessible 1 means yes".into()]).unwrap();
        let mut file = std::fs::File::open(&path).unwrap();
        let ply = Parser::<DefaultElement>::new().read_ply(&mut file).unwrap();
        let rows = &ply.payload["vertex"];
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[1]["x"], Property::Float(-0.1));
        assert_eq!(rows[1]["nz"], Property::Float(-1.0));
        assert_eq!(rows[0]["red"], Property::UChar(206));
        assert_eq!(rows[0]["inaccessible"], Property::UChar(1));
        assert_eq!(rows[1]["accessible_directions"], Property::UInt(150));
        assert_eq!(rows[0]["beta"], Property::Double((1u64 << 40) as f64));
        assert_eq!(rows[0]["probability"], Property::Float(0.25));
        assert!(ply.header.comments.contains(&"unit mm".to_string()));
        assert!(ply.header.comments.contains(&"part a b".to_string()));
        assert!(ply.header.comments.contains(&"color 206 58 44: inaccessible".to_string()));
        let short = [("beta", PointValues::Counts(&[1]))];
        assert!(write(&path, &part, &coloring, &short, &[]).is_err());
    }
}
