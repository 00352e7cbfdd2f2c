//! A vise, and where it can grip a part.

use super::polygons::{Flat, clipped, common_area, project};
use crate::geom::Mesh;
use crate::geom::solids::cuboid;
use crate::planning::setups::{DOWN_RAD, LOWEST_MM};
use crate::{Error, Result};
use glam::{DMat3, DVec3, Vec3, dvec3};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Two jaws and the bed between them, on which the part lies, or above which parallels hold it.
///
/// ```
/// use deepmill::analysis::Vise;
/// let vise = Vise::new([100.0, 60.0, 15.0], 0.0)?;
/// assert_eq!(vise.to_string(), "100,60,15");
/// assert!(Vise::new([100.0, -60.0, 15.0], 0.0).is_err());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(into = "[f64; 4]", try_from = "[f64; 4]")]
pub struct Vise {
    jaw_mm: f64,
    opening_mm: f64,
    height_mm: f64,
    parallels_mm: f64,
}

/// Least share of the jaw in front of the part that both jaws touch opposite each other.
const LEAST_CONTACT: f64 = 0.5;
/// Of the height of a face that ends below the top of the jaws, or of what overhangs there: so high lower jaws are.
const LOWER: f64 = 0.8;
/// Least share of the jaws' height.
const LEAST_HEIGHT: f64 = 0.1;
/// Longer ones are refused.
const MOST_MM: f64 = 1e5;

/// One way to grip the part in one orientation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grip {
    /// Outward normal of one of the faces, across z'.
    pub across: DVec3,
    /// Between the faces.
    pub opening_mm: f64,
    /// How high the jaws reach above what the part lies on.
    pub height_mm: f64,
    /// Of the part, under both jaws.
    pub under_jaws_mm2: f64,
    /// Jaws and bed.
    pub body: Mesh,
}

/// The ways to grip the part in one orientation.
#[derive(Debug, Default)]
pub(super) struct Grips {
    pub list: Vec<Grip>,
    /// The least opening among faces that are too far apart.
    pub too_wide_mm: Option<f64>,
}

impl From<Vise> for [f64; 4] {
    fn from(Vise { jaw_mm, opening_mm, height_mm, parallels_mm }: Vise) -> Self {
        [jaw_mm, opening_mm, height_mm, parallels_mm]
    }
}

impl TryFrom<[f64; 4]> for Vise {
    type Error = Error;

    fn try_from([jaw_mm, opening_mm, height_mm, parallels_mm]: [f64; 4]) -> Result<Self> {
        Vise::new([jaw_mm, opening_mm, height_mm], parallels_mm)
    }
}

impl Vise {
    /// With jaws of a width that open so far and reach up to a height above what the part lies on, and parallels as
    /// high as this between bed and part; mm.
    ///
    /// # Errors
    /// If one of the first three is not above 0, the last is below 0, or one is beyond 100 m.
    pub fn new([jaw_mm, opening_mm, height_mm]: [f64; 3], parallels_mm: f64) -> Result<Self> {
        let vise = Vise { jaw_mm, opening_mm, height_mm, parallels_mm };
        let is_length = |mm: &f64| *mm > 0.0 && *mm <= MOST_MM;
        if ![jaw_mm, opening_mm, height_mm].iter().all(is_length)
            || !(0.0..=MOST_MM).contains(&parallels_mm)
        {
            let expected =
                "jaw width, opening and height above 0, parallels 0 or more, within 100 m";
            let remedy = "write for example 100,60,15 or, on parallels of 20 mm, 100,60,15,20";
            return Err(Error::argument("vise", vise, expected, remedy));
        }
        Ok(vise)
    }

    /// Where it can grip a part with `up` upward, by flat faces with these outward normals.
    pub(super) fn grips(&self, part: &Mesh, up: Vec3, normals: &[Vec3]) -> Grips {
        let w = up.as_dvec3().normalize();
        let mut grips = Grips::default();
        let mut tried: Vec<DVec3> = Vec::new();
        for normal in normals.iter().map(|normal| normal.as_dvec3()) {
            let across = normal.reject_from_normalized(w).normalize_or_zero();
            let is_across = normal.dot(w).abs() <= libm::sin(DOWN_RAD) && across != DVec3::ZERO;
            let is_tried = |other: &DVec3| other.dot(across).abs() >= libm::cos(DOWN_RAD);
            if !is_across || tried.iter().any(is_tried) {
                continue;
            }
            tried.push(across);
            let Some(grip) = self.grip(part, [across, w.cross(across), w]) else { continue };
            if grip.opening_mm <= self.opening_mm + LOWEST_MM {
                grips.list.push(grip);
            } else {
                let least = grips.too_wide_mm.map_or(grip.opening_mm, |mm| mm.min(grip.opening_mm));
                grips.too_wide_mm = Some(least);
            }
        }
        grips
    }

    /// By the faces farthest along and against the first of the axes; the jaws along the second, the third upward. As
    /// high as the vise's jaws are, or lower where the faces are: the part is on higher parallels then.
    ///
    /// ```text
    /// h = HEIGHT
    /// until both jaws touch up to their tops, and opposite each other on half of what is in front of the part:
    ///     h = 0.8 of where the lower face ends, if that is below h; else of where the higher one begins, or h/2
    /// ```
    fn grip(&self, part: &Mesh, axes: [DVec3; 3]) -> Option<Grip> {
        let frame = Frame::new(part, axes, self.height_mm);
        let mut height = self.height_mm;
        while height >= LEAST_HEIGHT * self.height_mm {
            let touch = frame.touch(self.jaw_mm, height)?;
            if touch.is_enough {
                return Some(self.gripping(&frame, &touch, height));
            }
            height = match touch.extent {
                Some([_, to]) if to < height - LOWEST_MM => LOWER * to,
                Some([from, _]) if from > LOWEST_MM => (LOWER * from).min(LOWER * height),
                _ => 0.5 * height,
            };
        }
        None
    }

    fn gripping(&self, frame: &Frame, touch: &Touch, height_mm: f64) -> Grip {
        let (thick, Touch { faces, jaw, .. }) = (self.thickness_mm(), touch);
        let bed = -self.parallels_mm;
        let mut body = Mesh::default();
        for (low, high) in [
            (dvec3(faces[0] - thick, jaw[0], bed), dvec3(faces[0], jaw[1], height_mm)),
            (dvec3(faces[1], jaw[0], bed), dvec3(faces[1] + thick, jaw[1], height_mm)),
            (dvec3(faces[0] - thick, jaw[0], bed - thick), dvec3(faces[1] + thick, jaw[1], bed)),
        ] {
            add_box(&mut body, (low, high), |p| frame.global(p));
        }
        Grip {
            across: frame.axes.x_axis,
            opening_mm: faces[1] - faces[0],
            height_mm,
            under_jaws_mm2: touch.area_mm2,
            body,
        }
    }

    /// Of jaws and bed.
    fn thickness_mm(&self) -> f64 {
        0.5 * self.jaw_mm
    }
}

impl fmt::Display for Vise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}", self.jaw_mm, self.opening_mm, self.height_mm)?;
        if self.parallels_mm == 0.0 { Ok(()) } else { write!(f, ",{}", self.parallels_mm) }
    }
}

/// What of the part is low enough for the jaws, the lowest place at 0: across the faces, along the jaws, upward.
struct Frame {
    axes: DMat3,
    lowest: f64,
    /// Triangles with their normals.
    triangles: Vec<(DVec3, [DVec3; 3])>,
}

/// What the jaws touch.
struct Touch {
    /// Where they are across.
    faces: [f64; 2],
    /// From where to where they reach along.
    jaw: [f64; 2],
    /// Of both faces.
    area_mm2: f64,
    /// Heights between which both faces are.
    extent: Option<[f64; 2]>,
    is_enough: bool,
}

impl Frame {
    fn new(part: &Mesh, axes: [DVec3; 3], height_mm: f64) -> Self {
        let axes = DMat3::from_cols(axes[0], axes[1], axes[2]);
        let lowest = part.vertices.iter().map(|p| p.dot(axes.z_axis)).fold(f64::INFINITY, f64::min);
        let to_frame = axes.transpose();
        let local = |v: u32| to_frame * part.vertices[v as usize] - lowest * DVec3::Z;
        let triangles = part.triangles.iter().filter_map(|triangle| {
            let [a, b, c] = triangle.map(local);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            (a.z.min(b.z).min(c.z) <= height_mm).then_some((normal, [a, b, c]))
        });
        let triangles = triangles.collect();
        Frame { axes, lowest, triangles }
    }

    fn global(&self, p: DVec3) -> DVec3 {
        self.axes * (p + self.lowest * DVec3::Z)
    }

    /// What jaws of a width and a height touch, at the middle of the part's length along them.
    fn touch(&self, jaw_mm: f64, top: f64) -> Option<Touch> {
        let below_top = |limit: f64| {
            self.triangles.iter().filter_map(move |(normal, corners)| {
                let polygon = clipped(corners, 2, [f64::NEG_INFINITY, limit]);
                (!polygon.is_empty()).then_some((*normal, polygon))
            })
        };
        let slab: Vec<(DVec3, Vec<DVec3>)> = below_top(top).collect();
        let [from, to] = extremes(slab.iter().flat_map(|(_, polygon)| polygon), 1)?;
        let middle = 0.5 * (from + to);
        let jaw = [middle - 0.5 * jaw_mm, middle + 0.5 * jaw_mm];
        // What only touches the rim of a jaw is not in its way.
        let inside = below_top(top - LOWEST_MM).flat_map(|(_, polygon)| {
            clipped(&polygon, 1, [jaw[0] + LOWEST_MM, jaw[1] - LOWEST_MM])
        });
        let inside: Vec<DVec3> = inside.collect();
        let faces = extremes(inside.iter(), 0)?;
        let patch = |side: usize| {
            let outward = if side == 0 { -DVec3::X } else { DVec3::X };
            let is_flat = |normal: &DVec3| normal.dot(outward) >= libm::cos(DOWN_RAD);
            let is_touched =
                |polygon: &[DVec3]| polygon.iter().all(|p| (p.x - faces[side]).abs() <= LOWEST_MM);
            let flat = slab.iter().filter(|(normal, _)| is_flat(normal));
            let polygons = flat.map(|(_, polygon)| clipped(polygon, 1, jaw));
            let touched = polygons.filter(|polygon| polygon.len() >= 3 && is_touched(polygon));
            touched.collect::<Vec<_>>()
        };
        let patches = [patch(0), patch(1)];
        let heights = [0, 1].map(|side| extremes(patches[side].iter().flatten(), 2));
        let extent = match heights {
            [Some(a), Some(b)] => Some([a[0].max(b[0]), a[1].min(b[1])]),
            _ => None,
        };
        let [low, high] = patches.map(|patch| patch.iter().map(|p| project(p)).collect::<Vec<_>>());
        let in_front = jaw_mm.min(to - from) * top;
        let is_enough = extent.is_some_and(|[_, to]| to >= top - LOWEST_MM)
            && common_area(&low, &high) >= LEAST_CONTACT * in_front;
        let area_mm2 = low.iter().chain(&high).map(Flat::area).sum();
        Some(Touch { faces, jaw, area_mm2, extent, is_enough })
    }
}

/// Least and greatest coordinate.
fn extremes<'a>(points: impl Iterator<Item = &'a DVec3>, axis: usize) -> Option<[f64; 2]> {
    let all = [f64::INFINITY, f64::NEG_INFINITY];
    let [low, high] = points.fold(all, |[low, high], p| [low.min(p[axis]), high.max(p[axis])]);
    (low <= high).then_some([low, high])
}

fn add_box(mesh: &mut Mesh, (low, high): (DVec3, DVec3), placed: impl Fn(DVec3) -> DVec3) {
    let solid = cuboid(high - low);
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(solid.vertices.iter().map(|p| placed(*p + low)));
    mesh.triangles.extend(solid.triangles.iter().map(|t| t.map(|v| v + first)));
}

#[cfg(test)]
mod tests;
