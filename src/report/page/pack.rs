//! The numbers of a page in few bytes: quantized, differences, one deflated block in base64. `assets/data.js` reads
//! them.
//!
//! | part of the block | content |
//! |---|---|
//! | `mesh.places`, `sites.places` | x, y, z in steps of `step_mm` from `low_mm`, 16 bits; differences from row to row, zigzag; low bytes then high bytes, column by column |
//! | `mesh.normals`, `sites.normals` | two signed bytes of an octahedral map, column by column |
//! | `mesh.indices` | per corner of a triangle the distance from the next vertex that has not occurred, seven bits to a byte |
//! | `viewV.class` | a byte per site: its group |
//! | `viewV.finding`, `viewV.valueK` | four bytes per site, unsigned or `f32` with 12 bits of mantissa; all first bytes, all second bytes, and so on |

use crate::geom::Mesh;
use crate::render::raster::Surface;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::{DVec3, Vec3};
use serde_json::{Map, Value, json};
use std::collections::HashMap;
use std::io::Write;

/// Steps along the longest edge of the box.
const STEPS: f64 = 65535.0;

/// Places in 16 bits per coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Grid {
    /// Least corner of the box, mm.
    pub low: DVec3,
    /// One step, mm.
    pub step_mm: f64,
}

impl Grid {
    /// The grid over a box; the longest edge has 65,535 steps.
    pub fn over(low: DVec3, high: DVec3) -> Self {
        let longest = (high - low).max_element();
        Grid { low, step_mm: if longest > 0.0 { longest / STEPS } else { 1e-6 } }
    }

    fn place(&self, p: DVec3) -> [u16; 3] {
        ((p - self.low) / self.step_mm).to_array().map(|x| x.round().clamp(0.0, STEPS) as u16)
    }
}

/// Named parts of one block of bytes.
#[derive(Debug, Default)]
pub struct Block {
    bytes: Vec<u8>,
    parts: Map<String, Value>,
}

impl Block {
    /// Adds a part.
    pub fn add(&mut self, name: impl Into<String>, bytes: &[u8]) {
        self.parts.insert(name.into(), json!([self.bytes.len(), bytes.len()]));
        self.bytes.extend_from_slice(bytes);
    }

    /// Adds numbers of four bytes.
    pub fn add_words(&mut self, name: impl Into<String>, words: impl Iterator<Item = u32> + Clone) {
        let planes = (0..4).flat_map(|k| words.clone().map(move |word| word.to_le_bytes()[k]));
        self.add(name, &planes.collect::<Vec<u8>>());
    }

    /// Adds points with normals.
    pub fn add_points(
        &mut self,
        name: &str,
        grid: &Grid,
        points: impl Iterator<Item = DVec3>,
        normals: impl Iterator<Item = Vec3>,
    ) {
        let places: Vec<[u16; 3]> = points.map(|p| grid.place(p)).collect();
        self.add(format!("{name}.places"), &differences(&places));
        let normals: Vec<[u8; 2]> = normals.map(fold).collect();
        let columns = (0..2).flat_map(|k| normals.iter().map(move |n| n[k]));
        self.add(format!("{name}.normals"), &columns.collect::<Vec<u8>>());
    }

    /// Adds a mesh; vertices that differ in their normal are apart. Returns the numbers of vertices and triangles.
    pub fn add_mesh(&mut self, grid: &Grid, mesh: &Mesh) -> [usize; 2] {
        let surface = Surface::of_mesh(mesh);
        let mut numbers: HashMap<([u16; 3], [u8; 2]), u32> = HashMap::new();
        let (mut places, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
        let (mut n_triangles, mut next) = (0, 0u32);
        for (triangle, corners) in mesh.triangles.iter().zip(surface.corner_normals()) {
            let at = triangle.map(|v| grid.place(mesh.vertices[v as usize]));
            if at[0] == at[1] || at[1] == at[2] || at[2] == at[0] {
                continue;
            }
            n_triangles += 1;
            for (place, normal) in at.into_iter().zip(corners.map(fold)) {
                let number = *numbers.entry((place, normal)).or_insert_with(|| {
                    places.push(place);
                    normals.push(normal);
                    places.len() as u32 - 1
                });
                variable_length(&mut indices, next - number);
                next = next.max(number + 1);
            }
        }
        self.add("mesh.places", &differences(&places));
        let columns = (0..2).flat_map(|k| normals.iter().map(move |n: &[u8; 2]| n[k]));
        self.add("mesh.normals", &columns.collect::<Vec<u8>>());
        self.add("mesh.indices", &indices);
        [places.len(), n_triangles]
    }

    /// Where the parts are: name → first byte, number of bytes.
    pub fn parts(&self) -> Value {
        Value::Object(self.parts.clone())
    }

    /// The block, deflated (zlib), in base64.
    pub fn base64(&self) -> String {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&self.bytes).expect("memory takes all");
        base64(&encoder.finish().expect("memory takes all"))
    }
}

/// A real number whose last 11 bits of mantissa are rounded away.
pub fn rounded(x: f32) -> u32 {
    if x.is_finite() { x.to_bits().saturating_add(0x400) & !0x7ff } else { x.to_bits() }
}

/// Differences from row to row, zigzag, in planes of bytes.
fn differences(rows: &[[u16; 3]]) -> Vec<u8> {
    let mut bytes = vec![0; 6 * rows.len()];
    for (c, plane) in bytes.chunks_exact_mut(2 * rows.len().max(1)).enumerate() {
        let (low, high) = plane.split_at_mut(rows.len());
        let mut before = 0u16;
        for (i, row) in rows.iter().enumerate() {
            let step = row[c].wrapping_sub(before) as i16;
            [low[i], high[i]] = (((step << 1) ^ (step >> 15)) as u16).to_le_bytes();
            before = row[c];
        }
    }
    bytes
}

/// A unit vector as two signed bytes: the octahedron unfolded.
fn fold(n: Vec3) -> [u8; 2] {
    let n = n / (n.x.abs() + n.y.abs() + n.z.abs()).max(f32::MIN_POSITIVE);
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let [x, y] = match n.z >= 0.0 {
        true => [n.x, n.y],
        false => [(1.0 - n.y.abs()) * sign(n.x), (1.0 - n.x.abs()) * sign(n.y)],
    };
    [x, y].map(|x| ((x * 127.0).round().clamp(-127.0, 127.0) as i8) as u8)
}

fn variable_length(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 128 {
        bytes.push(number as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= chunk.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};

    #[test]
    fn base64_of_the_standard() {
        let cases =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        cases.iter().for_each(|(plain, coded)| assert_eq!(base64(plain.as_bytes()), *coded));
    }

    #[test]
    fn differences_read_back() {
        let rows = [[0, 65535, 7], [65535, 0, 7], [3, 40000, 6]];
        let bytes = differences(&rows);
        for c in 0..3 {
            let plane = &bytes[6 * c..6 * c + 6];
            let mut value = 0u16;
            for i in 0..3 {
                let code = u16::from_le_bytes([plane[i], plane[3 + i]]);
                value = value.wrapping_add((code >> 1) ^ (code & 1).wrapping_neg());
                assert_eq!(value, rows[i][c]);
            }
        }
        assert!(differences(&[]).is_empty());
    }

    #[test]
    fn folded_normals_are_true_to_a_degree() {
        for k in 0..500 {
            let z = 1.0 - (k as f32 + 0.5) / 250.0;
            let (a, r) = (k as f32 * 2.4, (1.0 - z * z).sqrt());
            let n = Vec3::new(r * a.cos(), r * a.sin(), z);
            let [x, y] = fold(n).map(|b| f32::from(b as i8) / 127.0);
            let mut m = Vec3::new(x, y, 1.0 - x.abs() - y.abs());
            let t = (-m.z).max(0.0);
            m.x += if m.x >= 0.0 { -t } else { t };
            m.y += if m.y >= 0.0 { -t } else { t };
            assert!(m.normalize().dot(n) > 0.9998, "{n}");
        }
    }

    #[test]
    fn a_box_has_24_vertices_and_a_smooth_torus_one_per_corner() {
        let count = |mesh: &Mesh| {
            let (low, high) = mesh.bounds().unwrap();
            Block::default().add_mesh(&Grid::over(low, high), mesh)
        };
        assert_eq!(count(&cuboid(DVec3::new(3.0, 2.0, 1.0))), [24, 12]);
        let mesh = torus(20.0, 8.0, 48, 24);
        assert_eq!(count(&mesh)[1], mesh.triangles.len());
        assert!(count(&mesh)[0] < mesh.triangles.len());
    }

    #[test]
    fn rounding_keeps_four_digits_and_what_is_no_number() {
        let back = |x: f32| f32::from_bits(rounded(x));
        assert!([1.2345, -0.01, 3e9].iter().all(|&x| (back(x) / x - 1.0).abs() < 2e-4));
        assert!(
            back(f32::NAN).is_nan() && back(f32::INFINITY) == f32::INFINITY && back(0.0) == 0.0
        );
    }
}
