//! Units of length of mesh files, which the files themselves do not state; and lengths as people write them.

pub(crate) mod length;

pub use length::Length;

use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Parts whose longest edge is outside these limits, mm, are probably in another unit.
const PLAUSIBLE_MM: std::ops::RangeInclusive<f64> = 1.0..=10_000.0;
/// The size a part is taken to have when its unit is guessed, mm.
const TYPICAL_MM: f64 = 100.0;

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Unit {
    /// Millimeter.
    #[default]
    Millimeter,
    /// Centimeter.
    Centimeter,
    /// Inch, 25.4 mm.
    Inch,
    /// Meter.
    Meter,
}

impl Unit {
    /// All units, ascending.
    pub const ALL: [Unit; 4] = [Unit::Millimeter, Unit::Centimeter, Unit::Inch, Unit::Meter];

    /// Its length in mm.
    pub fn millimeters(self) -> f64 {
        match self {
            Unit::Millimeter => 1.0,
            Unit::Centimeter => 10.0,
            Unit::Inch => 25.4,
            Unit::Meter => 1000.0,
        }
    }

    /// Its symbol, as [`Unit::from_str`] reads it.
    pub fn symbol(self) -> &'static str {
        match self {
            Unit::Millimeter => "mm",
            Unit::Centimeter => "cm",
            Unit::Inch => "in",
            Unit::Meter => "m",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}

impl FromStr for Unit {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Unit::ALL.into_iter().find(|u| u.symbol() == text).ok_or_else(|| {
            Error::argument("unit", format!("{text:?}"), "mm, cm, in or m", "for another unit give its millimeters (`ReadOptions::scale`; `--scale` at the command line)")
        })
    }
}

/// The edges of a bounding box for people: `120 × 10 × 120 mm`.
#[doc(hidden)] // of the program
pub fn size_line(low: DVec3, high: DVec3) -> String {
    let [x, y, z] = (high - low).to_array().map(|edge| {
        let text = format!("{edge:.4}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    });
    format!("{x} × {y} × {z} mm")
}

/// A warning, with the likely unit, if the longest edge of a part is under 1 mm or over 10 m.
/// `scale` is the mm per unit with which the file was read.
#[doc(hidden)] // of the program
pub fn size_warning(low: DVec3, high: DVec3, scale: f64) -> Option<String> {
    let longest = (high - low).max_element();
    if PLAUSIBLE_MM.contains(&longest) || longest.is_nan() {
        return None;
    }
    let verdict = if longest < 1.0 { "under 1 mm" } else { "over 10 m" };
    let in_file = longest / scale;
    let doubt = |u: &Unit| libm::fabs(libm::log(in_file * u.millimeters() / TYPICAL_MM));
    let likely = Unit::ALL.into_iter().min_by(|a, b| doubt(a).total_cmp(&doubt(b)));
    let advice = match likely {
        Some(u) if PLAUSIBLE_MM.contains(&(in_file * u.millimeters())) => {
            format!("the file is probably in {u}: give --unit {u}")
        }
        _ if longest > TYPICAL_MM => "is it in micrometers? then give --scale 0.001".to_owned(),
        _ => "give the millimeters per unit of the file with --scale".to_owned(),
    };
    Some(format!("the part is {}, {verdict}; {advice}", size_line(low, high)))
}

/// Boxes without an edge this long may be in inches, mm.
const TINY_MM: f64 = 10.0;

/// A warning if the longest edge of a part that was read in millimeters is under 10 mm: the file may be in inches.
#[doc(hidden)] // of the program
pub fn inch_warning(low: DVec3, high: DVec3) -> Option<String> {
    let longest = (high - low).max_element();
    let in_inches = longest * Unit::Inch.millimeters();
    (longest < TINY_MM).then(|| {
        format!(
            "the part is {longest:.3} mm long at most; if the file is in inches, --unit in makes it {in_inches:.1} mm"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_are_read_back_and_others_refused() {
        for unit in Unit::ALL {
            assert_eq!(unit.symbol().parse::<Unit>().unwrap(), unit);
        }
        assert!("inch".parse::<Unit>().unwrap_err().to_string().contains("mm, cm, in or m"));
    }

    #[test]
    fn sizes_are_short_and_exact() {
        assert_eq!(size_line(DVec3::ZERO, DVec3::new(120.0, 0.0625, 1e-9)), "120 × 0.0625 × 0 mm");
        assert_eq!(size_line(DVec3::splat(-1.0), DVec3::splat(9.0)), "10 × 10 × 10 mm");
    }

    #[test]
    fn small_parts_may_be_in_inches() {
        let warn = |longest: f64| inch_warning(DVec3::ZERO, DVec3::new(0.5, longest, 0.1));
        assert!(warn(3.0).unwrap().contains("--unit in makes it 76.2 mm"));
        assert_eq!(warn(10.0), None);
    }

    #[test]
    fn implausible_sizes_name_the_likely_unit() {
        let warn = |longest: f64, scale: f64| {
            size_warning(DVec3::ZERO, DVec3::new(0.1 * longest, longest, 0.0), scale)
        };
        for plausible in [1.0, 2.7, 300.0, 10_000.0] {
            assert_eq!(warn(plausible, 1.0), None);
        }
        assert!(warn(0.2, 1.0).unwrap().contains("under 1 mm; the file is probably in m:"));
        assert!(warn(0.9, 1.0).unwrap().contains("probably in in:"));
        assert!(
            warn(120_000.0, 1000.0).unwrap().contains("over 10 m; the file is probably in mm:")
        );
        assert!(warn(120_000.0, 1.0).unwrap().contains("micrometers"));
        assert!(warn(1e-6, 1.0).unwrap().contains("--scale"));
        assert!(warn(0.0, 1.0).unwrap().contains("--scale"));
    }
}
