//! Direction sets: the unit vectors, from the tip to the spindle, in which the tool may come.
//!
//! A [`DirectionSet`] is the recipe, small enough to be recorded with every data set; [`Directions`]
//! holds the vectors. Everything is computed in `f64` with [`libm`] and rounded to `f32` once, so a
//! recipe gives the same bits everywhere.

pub(crate) mod rotary;

use crate::{Error, Result};
use glam::{DVec3, Vec3};
pub use rotary::TurnLimits;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;
use std::str::FromStr;

/// How a set of directions is made. Axes need not be unit vectors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
#[non_exhaustive]
pub enum DirectionSet {
    /// `z_k = 1 − (k+½)/m`, azimuth `k·π(3−√5)`, k = 0…m−1: even over the upper half, without +z
    /// itself, which would make every vertical wall the borderline case r = R.
    FibonacciHemisphere {
        /// Number of directions m.
        n_dirs: usize,
    },
    /// The 152 of the published data: +z, then those with `z ≥ 0` of the 300 points `(r·cos θ, y, r·sin θ)`,
    /// `y = 2i/300 − 1 + 1/300`, `r = √(1−y²)`, `θ = i·3.1415926·(3−√5)`: a golden-angle sphere about the **y** axis.
    Published,
    /// The 102 of DeepMill++, in its order: the points of [`DirectionSet::Published`] with 200 in place of 300, those
    /// with `z ≥ 0`, then +z.
    #[serde(rename = "deepmill++")]
    #[doc(hidden)] // read and written by name
    DeepMillPlusPlus,
    /// `z_k = 1 − (2k+1)/m`, same azimuths: even over the whole sphere.
    FibonacciSphere {
        /// Number of directions m.
        n_dirs: usize,
    },
    /// Upper half, polar angles `(i+½)·(π/2)/n_polar`, azimuths `(j+½)·2π/n_azimuth`, polar outermost:
    /// symmetric in x and y for even `n_azimuth`.
    LatLong {
        /// Number of rings.
        n_polar: usize,
        /// Directions on each ring.
        n_azimuth: usize,
    },
    /// Within `half_angle_rad` of `axis`, even in area: the tilt limits of a machine.
    Cone {
        /// The cone's axis.
        axis: [f64; 3],
        /// Greatest angle from the axis, at most π.
        half_angle_rad: f64,
        /// Number of directions.
        n_dirs: usize,
    },
    /// Across `axis`, angles `k·2π/m`: a fourth axis.
    Circle {
        /// The axis of rotation.
        axis: [f64; 3],
        /// Number of directions.
        n_dirs: usize,
    },
    /// These vectors in this order, made unit: 3-axis and 3+2 setups.
    List {
        /// Any lengths but zero.
        vectors: Vec<[f64; 3]>,
    },
}

/// The form that [`DirectionSet::from_str`] reads.
impl fmt::Display for DirectionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let vector = |[x, y, z]: &[f64; 3]| format!("{x},{y},{z}");
        match self {
            DirectionSet::Published => f.write_str("published"),
            DirectionSet::DeepMillPlusPlus => f.write_str(DEEPMILL_PLUS_PLUS),
            DirectionSet::FibonacciHemisphere { n_dirs } => write!(f, "hemisphere:{n_dirs}"),
            DirectionSet::FibonacciSphere { n_dirs } => write!(f, "sphere:{n_dirs}"),
            DirectionSet::LatLong { n_polar, n_azimuth } => {
                write!(f, "latlong:{n_polar}x{n_azimuth}")
            }
            DirectionSet::Cone { axis, half_angle_rad, n_dirs } => {
                write!(f, "cone:{}:{n_dirs}", degrees(*half_angle_rad))?;
                if *axis == UP { Ok(()) } else { write!(f, ":{}", vector(axis)) }
            }
            DirectionSet::Circle { axis, n_dirs } => write!(f, "circle:{}:{n_dirs}", vector(axis)),
            DirectionSet::List { vectors } => {
                let all: Vec<String> = vectors.iter().map(vector).collect();
                write!(f, "list:{}", all.join(";"))
            }
        }
    }
}

/// Reads `published`, `deepmill++`, `COUNT` or `hemisphere:COUNT`, `sphere:COUNT`, `latlong:RINGSxCOUNT`,
/// `cone:DEGREES:COUNT` (about +z) or `cone:DEGREES:COUNT:X,Y,Z`, `circle:X,Y,Z:COUNT`, `list:X,Y,Z;X,Y,Z;…`; also
/// `up`, and `4-axis:AXIS` or `4-axis:AXIS:LOW,HIGH` (degrees, [`TurnLimits`]) with a direction every 5 degrees.
///
/// ```
/// use deepmill::directions::DirectionSet;
/// let set: DirectionSet = "cone:30:12".parse()?;
/// assert_eq!(set.to_string(), "cone:30:12");
/// # Ok::<(), deepmill::Error>(())
/// ```
impl FromStr for DirectionSet {
    type Err = Error;

    /// # Errors
    /// If the text has none of these forms, or a cone's angle is not above 0 and at most 180 degrees.
    fn from_str(text: &str) -> Result<Self> {
        let set = parse_set(text).ok_or_else(|| {
            let expected = "published, deepmill++, COUNT, hemisphere:COUNT, sphere:COUNT, latlong:RINGSxCOUNT, \
                            cone:DEGREES:COUNT, circle:X,Y,Z:COUNT, list:X,Y,Z;X,Y,Z, up, 4-axis:x or \
                            4-axis:x:LOW,HIGH";
            Error::argument("directions", format!("`{text}`"), expected, "write for example 150")
        })?;
        match &set {
            DirectionSet::Cone { half_angle_rad, .. } if !is_cone_angle(*half_angle_rad) => {
                let found = format!("`{text}`");
                let expected = "a cone of more than 0 and at most 180 degrees";
                Err(Error::argument(
                    "directions",
                    found,
                    expected,
                    "give its greatest tilt from +z",
                ))
            }
            _ => Ok(set),
        }
    }
}

const UP: [f64; 3] = [0.0, 0.0, 1.0];

fn parse_set(text: &str) -> Option<DirectionSet> {
    match text {
        "up" => return Some(DirectionSet::List { vectors: vec![UP] }),
        "published" => return Some(DirectionSet::Published),
        DEEPMILL_PLUS_PLUS => return Some(DirectionSet::DeepMillPlusPlus),
        _ => {}
    }
    let (kind, rest) = text.split_once(':').unwrap_or(("hemisphere", text));
    Some(match kind {
        "hemisphere" => DirectionSet::FibonacciHemisphere { n_dirs: rest.parse().ok()? },
        "sphere" => DirectionSet::FibonacciSphere { n_dirs: rest.parse().ok()? },
        "latlong" => {
            let (rings, around) = rest.split_once('x')?;
            let (n_polar, n_azimuth) = (rings.parse().ok()?, around.parse().ok()?);
            DirectionSet::LatLong { n_polar, n_azimuth }
        }
        "cone" => {
            let (angle, rest) = rest.split_once(':')?;
            let (count, axis) = rest.split_once(':').unwrap_or((rest, "0,0,1"));
            let half_angle_rad = angle.parse::<f64>().ok()?.to_radians();
            DirectionSet::Cone {
                axis: parse_vector(axis)?,
                half_angle_rad,
                n_dirs: count.parse().ok()?,
            }
        }
        "circle" => {
            let (axis, count) = rest.split_once(':')?;
            DirectionSet::Circle { axis: parse_vector(axis)?, n_dirs: count.parse().ok()? }
        }
        "4-axis" => rotary::parse(rest)?,
        "list" => {
            let vectors = rest.split(';').map(parse_vector).collect::<Option<_>>()?;
            DirectionSet::List { vectors }
        }
        _ => return None,
    })
}

fn parse_vector(text: &str) -> Option<[f64; 3]> {
    let parts: Option<Vec<f64>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    parts?.try_into().ok()
}

/// The shortest number of degrees that is read back as `radians`.
fn degrees(radians: f64) -> f64 {
    let exact = radians.to_degrees();
    let rounded = (exact * 1e9).round() / 1e9;
    if rounded.to_radians() == radians { rounded } else { exact }
}

fn is_cone_angle(half_angle_rad: f64) -> bool {
    half_angle_rad > 0.0 && half_angle_rad <= PI
}

/// At least one unit vector; the order is part of the result of every labeling. Serialized as its [`DirectionSet`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "DirectionSet", into = "DirectionSet")]
pub struct Directions {
    set: DirectionSet,
    vectors: Vec<Vec3>,
}

/// As [`Directions::new`].
impl TryFrom<DirectionSet> for Directions {
    type Error = Error;

    fn try_from(set: DirectionSet) -> Result<Self> {
        Directions::new(set)
    }
}

impl From<Directions> for DirectionSet {
    fn from(directions: Directions) -> Self {
        directions.set
    }
}

impl Directions {
    /// The vectors of `set`.
    ///
    /// # Errors
    /// If the set is empty or larger than a million, an axis or vector has no direction, or the
    /// cone's angle is not in `(0, π]`.
    pub fn new(set: DirectionSet) -> Result<Self> {
        let n_dirs = match &set {
            DirectionSet::Published => N_PUBLISHED,
            DirectionSet::DeepMillPlusPlus => N_DEEPMILL_PLUS_PLUS,
            DirectionSet::FibonacciHemisphere { n_dirs }
            | DirectionSet::FibonacciSphere { n_dirs }
            | DirectionSet::Cone { n_dirs, .. }
            | DirectionSet::Circle { n_dirs, .. } => *n_dirs,
            DirectionSet::LatLong { n_polar, n_azimuth } => n_polar.saturating_mul(*n_azimuth),
            DirectionSet::List { vectors } => vectors.len(),
        };
        if n_dirs == 0 || n_dirs > MAX_DIRECTIONS {
            let expected = format!("1 to {MAX_DIRECTIONS}");
            return Err(Error::argument("directions", n_dirs, expected, "the paper uses 150"));
        }
        Directions::of(set, n_dirs)
    }

    fn of(set: DirectionSet, n_dirs: usize) -> Result<Self> {
        let vectors = build(&set, n_dirs)?;
        Ok(Directions { set, vectors: vectors.into_iter().map(DVec3::as_vec3).collect() })
    }

    /// Those of these numbers, each as it is; a number may be there again.
    #[cfg(all(feature = "formats", feature = "generate"))]
    pub(crate) fn numbered(&self, numbers: impl Iterator<Item = u32>) -> Self {
        let vectors: Vec<Vec3> = numbers.map(|k| self.vectors[k as usize]).collect();
        let set = vectors.iter().map(|d| d.as_dvec3().to_array()).collect();
        Directions { set: DirectionSet::List { vectors: set }, vectors }
    }

    /// +z, then these; one more than a million is no fault of the user's.
    pub(crate) fn after_up(&self) -> Result<Self> {
        let vectors = std::iter::once(&Vec3::Z).chain(&self.vectors);
        let vectors = vectors.map(|d| d.as_dvec3().to_array()).collect();
        Directions::of(DirectionSet::List { vectors }, self.len() + 1)
    }

    /// The 152 directions of the published data ([`DirectionSet::Published`]).
    ///
    /// ```
    /// use deepmill::{directions::Directions, glam::Vec3};
    /// let directions = Directions::published();
    /// assert_eq!((directions.len(), directions.vectors()[0]), (152, Vec3::Z));
    /// ```
    pub fn published() -> Self {
        let vectors = published().map(DVec3::as_vec3).collect();
        Directions { set: DirectionSet::Published, vectors }
    }

    /// The default of the mesh definition: `n_dirs` Fibonacci directions on the upper half, the paper's text
    /// having 150.
    ///
    /// # Errors
    /// If `n_dirs` is 0 or above a million.
    ///
    /// ```
    /// let directions = deepmill::directions::Directions::fibonacci_hemisphere(150)?;
    /// assert!(directions.vectors().iter().all(|d| d.z > 0.0));
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn fibonacci_hemisphere(n_dirs: usize) -> Result<Self> {
        Directions::new(DirectionSet::FibonacciHemisphere { n_dirs })
    }

    /// +z alone: 3-axis milling.
    pub fn up() -> Self {
        let vectors = vec![[0.0, 0.0, 1.0]];
        Directions { set: DirectionSet::List { vectors }, vectors: vec![Vec3::Z] }
    }

    /// Unit vectors from tip to spindle.
    pub fn vectors(&self) -> &[Vec3] {
        &self.vectors
    }

    /// The recipe.
    pub fn set(&self) -> &DirectionSet {
        &self.set
    }

    /// Number of directions.
    pub fn len(&self) -> usize {
        self.vectors.len()
    }

    /// Never true: a set has at least one direction.
    pub fn is_empty(&self) -> bool {
        self.vectors.is_empty()
    }
}

/// As [`DirectionSet::from_str`].
impl FromStr for Directions {
    type Err = Error;

    /// # Errors
    /// As [`DirectionSet::from_str`] and [`Directions::new`].
    fn from_str(text: &str) -> Result<Self> {
        Directions::new(text.parse()?)
    }
}

/// The recipe, as [`DirectionSet`] is written.
impl fmt::Display for Directions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.set.fmt(f)
    }
}

impl AsRef<[Vec3]> for Directions {
    fn as_ref(&self) -> &[Vec3] {
        &self.vectors
    }
}

const MAX_DIRECTIONS: usize = 1_000_000;
const N_PUBLISHED: usize = 152;
const N_DEEPMILL_PLUS_PLUS: usize = 102;
const DEEPMILL_PLUS_PLUS: &str = "deepmill++";

fn build(set: &DirectionSet, n_dirs: usize) -> Result<Vec<DVec3>> {
    let all = 0..n_dirs;
    Ok(match set {
        DirectionSet::Published => published().collect(),
        DirectionSet::DeepMillPlusPlus => {
            upper_half_about_y(200).chain(std::iter::once(DVec3::Z)).collect()
        }
        DirectionSet::FibonacciHemisphere { .. } => {
            all.map(|k| fibonacci(k, n_dirs, 1.0)).collect()
        }
        DirectionSet::FibonacciSphere { .. } => all.map(|k| fibonacci(k, n_dirs, 2.0)).collect(),
        DirectionSet::LatLong { n_polar, n_azimuth } => all
            .map(|k| {
                let polar = ((k / n_azimuth) as f64 + 0.5) * FRAC_PI_2 / *n_polar as f64;
                let azimuth = ((k % n_azimuth) as f64 + 0.5) * TAU / *n_azimuth as f64;
                let (sin, cos) = (libm::sin(polar), libm::cos(polar));
                DVec3::new(sin * libm::cos(azimuth), sin * libm::sin(azimuth), cos)
            })
            .collect(),
        DirectionSet::Cone { axis, half_angle_rad, .. } => {
            if !is_cone_angle(*half_angle_rad) {
                let remedy = "give the greatest tilt in radians";
                let expected = "above 0, at most pi";
                return Err(Error::argument("cone angle", half_angle_rad, expected, remedy));
            }
            let [u, v, w] = basis(unit("cone axis", *axis)?);
            let depth = 1.0 - libm::cos(*half_angle_rad);
            all.map(|k| fibonacci(k, n_dirs, depth)).map(|p| u * p.x + v * p.y + w * p.z).collect()
        }
        DirectionSet::Circle { axis, .. } => {
            let [u, v, _] = basis(unit("circle axis", *axis)?);
            let angle = |k: usize| k as f64 * TAU / n_dirs as f64;
            all.map(angle).map(|a| u * libm::cos(a) + v * libm::sin(a)).collect()
        }
        DirectionSet::List { vectors } => {
            vectors.iter().map(|&d| unit("direction", d)).collect::<Result<_>>()?
        }
    })
}

/// Point `k` of `n` on the cap of the unit sphere above `z = 1 − depth`, midpoints in z.
fn fibonacci(k: usize, n: usize, depth: f64) -> DVec3 {
    let z = 1.0 - depth * (k as f64 + 0.5) / n as f64;
    let azimuth = k as f64 * (PI * (3.0 - 5f64.sqrt()));
    let across = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(across * libm::cos(azimuth), across * libm::sin(azimuth), z)
}

/// [`DirectionSet::Published`].
fn published() -> impl Iterator<Item = DVec3> {
    std::iter::once(DVec3::Z).chain(upper_half_about_y(300))
}

/// Of `n` points of a golden-angle sphere about y those with z ≥ 0, in the order of operations that the published data
/// were fitted with.
fn upper_half_about_y(n: usize) -> impl Iterator<Item = DVec3> {
    // The digits that the data were made with.
    #[allow(clippy::approx_constant)]
    let turn = 3.1415926 * (3.0 - 5f64.sqrt());
    let step = 2.0 / n as f64;
    let sphere = (0..n).map(move |i| {
        let y = i as f64 * step - 1.0 + step / 2.0;
        let (r, angle) = ((1.0 - y * y).sqrt(), i as f64 * turn);
        DVec3::new(r * libm::cos(angle), y, r * libm::sin(angle))
    });
    sphere.filter(|d| d.z >= 0.0)
}

fn unit(name: &'static str, vector: [f64; 3]) -> Result<DVec3> {
    DVec3::from_array(vector).try_normalize().ok_or_else(|| {
        let found = format!("{vector:?}");
        Error::argument(
            name,
            found,
            "a finite vector of non-zero length",
            "check the three numbers",
        )
    })
}

/// `[u, v, w]` right-handed and orthonormal with `w` given (Duff et al. 2017).
pub(crate) fn basis(w: DVec3) -> [DVec3; 3] {
    let sign = 1f64.copysign(w.z);
    let a = -1.0 / (sign + w.z);
    let b = w.x * w.y * a;
    let u = DVec3::new(1.0 + sign * w.x * w.x * a, sign * b, -sign * w.x);
    let v = DVec3::new(b, sign + w.y * w.y * a, -w.y);
    [u, v, w]
}

#[cfg(test)]
mod tests;
