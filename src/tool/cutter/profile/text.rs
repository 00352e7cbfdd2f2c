//! Profiles as text: points `radius:height`, centers of arcs behind an `@`, `|` where what does not cut begins, and the
//! word `drill` before those of a drill.

use super::{Profile, ProfileSection};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

const EXAMPLE: &str = "write radius:height from the tip upward, an arc with its center as radius:height@radius:height, \
     and | before what does not cut: '0:0 1.5:5.598@0:3 | 1.5:20 3:22'; of a drill the word drill first";

/// Comes before the points of a drill or a reamer.
const DRILL: &str = "drill";

fn pair(text: &str) -> Result<[f64; 2]> {
    let numbers = text.split_once(':').map(|(a, b)| (a.trim().parse(), b.trim().parse()));
    match numbers {
        Some((Ok(a), Ok(b))) => Ok([a, b]),
        _ => Err(Error::argument("point of the profile", text, "radius:height in mm", EXAMPLE)),
    }
}

/// Reads points `radius:height`, mm, from the tip upward; the first has height 0.
impl FromStr for Profile {
    type Err = Error;

    /// # Errors
    /// If a point is none, the first is not at height 0, a length is not a number from 0 to 10 m, a height is
    /// below the one before, nothing cuts, the upper end has no radius, or an arc does not fit its center.
    fn from_str(text: &str) -> Result<Self> {
        let spaced = text.replace('|', " | ");
        let mut cuts = true;
        let (mut start, mut sections) = (None, Vec::new());
        let mut words = spaced.split_whitespace().peekable();
        let is_drill = words.next_if(|word| word.eq_ignore_ascii_case(DRILL)).is_some();
        for word in words {
            if word == "|" {
                cuts = !cuts;
                continue;
            }
            let (point, center) = match word.split_once('@') {
                Some((point, center)) => (pair(point)?, Some(pair(center)?)),
                None => (pair(word)?, None),
            };
            if start.is_none() {
                if point[1] != 0.0 || center.is_some() {
                    let expected = "radius:0, the lower end";
                    return Err(Error::argument(
                        "first point of the profile",
                        word,
                        expected,
                        EXAMPLE,
                    ));
                }
                start = Some(point[0]);
                continue;
            }
            let [radius_mm, height_mm] = point;
            sections.push(ProfileSection { radius_mm, height_mm, center_mm: center, cuts });
        }
        let Some(start_mm) = start else {
            return Err(Error::argument("profile", "empty", "points from the tip upward", EXAMPLE));
        };
        Ok(Profile { is_drill, ..Profile::new(start_mm, sections)? })
    }
}

/// Writes what [`Profile::from_str`] reads.
impl fmt::Display for Profile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_drill {
            write!(f, "{DRILL} ")?;
        }
        write!(f, "{}:0", self.start_mm)?;
        let mut cuts = true;
        for section in &self.sections {
            if section.cuts != cuts {
                f.write_str(" |")?;
                cuts = section.cuts;
            }
            write!(f, " {}:{}", section.radius_mm, section.height_mm)?;
            if let Some([c, z]) = section.center_mm {
                write!(f, "@{c}:{z}")?;
            }
        }
        Ok(())
    }
}
