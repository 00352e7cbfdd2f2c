//! Form mills of Fusion 360: half of their outline, in lines and arcs.
//!
//! `profile` is a list of points `end`, radius and height; a point reached by an arc has its `center`. It begins and
//! ends on the axis, below and above, or the other way round. What begins at the end of the flutes (`LCF`) or above
//! does not cut; if the flutes are as long as the outline, that is a cylinder at its top.

use super::Geometry;
use crate::Result;
use crate::geom::units::length::converted;
use crate::tool::cutter::{Profile, ProfileSection};
use serde_json::Value;

struct Point {
    end: [f64; 2],
    /// Of the arc that leads to it.
    center: Option<[f64; 2]>,
}

/// Heights closer than this share of the greatest are one.
const SAME: f64 = 1e-6;

impl Geometry<'_> {
    pub(super) fn form_mill(&self) -> Result<Profile> {
        let mut points = self.outline()?;
        let last = points.len() - 1;
        if points[0].end[1] > points[last].end[1] {
            turn(&mut points);
        }
        let lowest = points.iter().map(|point| point.end[1]).fold(f64::INFINITY, f64::min);
        let highest = points.iter().map(|point| point.end[1]).fold(0.0, f64::max) - lowest;
        let same = SAME * highest;
        // Up to the axis above, from the axis below.
        while points.last().is_some_and(|point| point.end[0] <= same) {
            points.pop();
        }
        let height = |z: f64| z - lowest;
        let is_start = |point: &Point| height(point.end[1]) <= same && point.center.is_none();
        let n_start = points.iter().take_while(|point| is_start(point)).count();
        let start = points[..n_start].last().map_or(0.0, |point| point.end[0]);
        let flutes = self.positive("LCF")?.unwrap_or(highest);
        let mut from = [start, 0.0];
        let mut sections = Vec::new();
        for point in &points[n_start.max(1).min(points.len())..] {
            let to = [point.end[0], height(point.end[1])];
            let center_mm = point.center.map(|[r, z]| [r, height(z)]);
            let is_shank = center_mm.is_none()
                && (to[0] - from[0]).abs() <= same
                && (to[1] - highest).abs() <= same;
            let cuts = from[1] < flutes - same && !is_shank;
            // Rounded numbers may go down by less than that.
            let rise = if (to[1] - from[1]).abs() <= same { from[1] } else { to[1] };
            sections.push(ProfileSection { radius_mm: to[0], height_mm: rise, center_mm, cuts });
            from = [to[0], rise];
        }
        Profile::new(start, sections).map_err(|error| self.place.within(error))
    }

    fn outline(&self) -> Result<Vec<Point>> {
        let remedy = "draw half of its outline where the tool was made, and export again";
        let bad = |found: String| self.place.error(found, remedy);
        let list = self.geometry.get("profile").and_then(Value::as_array);
        let list = list.filter(|list| list.len() >= 3);
        let list = list.ok_or_else(|| bad("profile, its outline, is missing".into()))?;
        let pair = |value: Option<&Value>| -> Option<[f64; 2]> {
            let numbers: Vec<f64> = value?.as_array()?.iter().filter_map(Value::as_f64).collect();
            let pair = <[f64; 2]>::try_from(numbers).ok()?;
            pair.iter().all(|x| x.abs() <= MOST).then(|| pair.map(|x| converted(x, self.unit)))
        };
        let point = |(k, value): (usize, &Value)| {
            let center = match value.get("center") {
                None | Some(Value::Null) => Some(None),
                center => pair(center).map(Some),
            };
            match (pair(value.get("end")), center) {
                (Some(end), Some(center)) => Ok(Point { end, center }),
                _ => {
                    let found = super::shown_value(value);
                    Err(bad(format!("point {} of its profile is {found}", k + 1)))
                }
            }
        };
        list.iter().enumerate().map(point).collect()
    }
}

/// From the other end: the arc that leads to a point leads to the one before it.
fn turn(points: &mut [Point]) {
    let centers: Vec<Option<[f64; 2]>> = points.iter().map(|point| point.center).collect();
    points.reverse();
    let n = points.len();
    for (k, point) in points.iter_mut().enumerate() {
        point.center = if k == 0 { None } else { centers[n - k] };
    }
}

/// Beyond this no number is a length of a tool in any unit.
const MOST: f64 = 1e6;
