//! The millimeters of normalized samples: whether points are normalized, and which scale their labels fit best.
//!
//! The authors' raw files hold points that were centered and scaled to ±0.8, beside cutters in mm; the scale of each
//! part is in no file. [`fit_scale`] finds it as the one at which the exact labels agree best with the stored ones:
//!
//! ```text
//! coarse: every factor 1.02 from 1 to 1,000 mm per unit: agreement of the labels *inaccessible*
//! fine:   around the best coarse scales, in steps of 0.1 mm per unit; among equals the one where the occlusion
//!         points agree best, too, then the middle one
//! twin:   the same with CH and FH exchanged; told where it fits within 0.5 % as well
//! ```

use super::sample::Sample;
use crate::access::{self, LabelOptions, Obstacles};
use crate::geom::Sites;
use crate::tool::cutter::{Cutter, CutterParams};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::Vec3;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

/// The greatest coordinate of the published normalization.
const GREATEST: f32 = 0.8;
/// Scales that are looked at, mm per unit.
const RANGE: [f64; 2] = [1.0, 1000.0];
const COARSE_FACTOR: f64 = 1.02;
/// Fine scales are whole multiples of this share of a mm per unit.
const STEPS_PER_MM: f64 = 10.0;
/// So many coarse scales are looked at closer, and all that are as good as the best, up to another number.
const N_CANDIDATES: usize = 4;
const MOST_CANDIDATES: usize = 16;
/// A twin within this much of the agreement fits as well.
const AS_WELL: f64 = 0.005;

/// Whether a sample's points are centered and scaled to ±0.8, and so without millimeters, beside a cutter that is in
/// mm: wider or longer than all of them.
pub fn is_normalized(sample: &Sample) -> bool {
    let points = &sample.sites.points;
    let greatest = points.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
    let mean =
        points.iter().map(|p| p.as_dvec3()).sum::<glam::DVec3>() / points.len().max(1) as f64;
    let longest = sample.cutter.to_array().into_iter().fold(0.0, f64::max);
    (greatest - GREATEST).abs() < 0.01
        && mean.abs().max_element() < 0.1
        && longest > f64::from(2.0 * GREATEST)
}

/// The sample with points in mm.
///
/// # Errors
/// If a point is beyond 1 km then.
pub fn in_millimeters(sample: &Sample, mm_per_unit: f64) -> Result<Sample> {
    let scaled = |p: &Vec3| (p.as_dvec3() * mm_per_unit).as_vec3();
    let points = sample.sites.points.iter().map(scaled).collect();
    let sites = Sites { points, normals: sample.sites.normals.clone(), faces: Vec::new() };
    let scaled = Sample { sites: Arc::new(sites), ..sample.clone() };
    scaled.check().map(|()| scaled)
}

/// One scale, and how well labels fit there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fit {
    /// Length of a unit of the normalized points, mm.
    pub mm_per_unit: f64,
    /// Share of the sites whose label *inaccessible* is the stored one.
    pub agreement: f64,
    /// Number of occlusion points by the exact labels.
    pub n_occlusion: usize,
}

/// The scale of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ScaleFit {
    /// The scale that fits best.
    pub best: Fit,
    /// The best scale with CH and FH exchanged, if it fits as well (within 0.5 % of the sites).
    pub exchanged: Option<Fit>,
    /// Number of stored occlusion points.
    pub n_occlusion_stored: usize,
}

/// The scale at which exact labels of `sample`, by these directions and options, agree best with its stored ones.
///
/// # Errors
/// If the sample has no sites, or its cutter is none.
pub fn fit_scale(
    sample: &Sample,
    directions: &Directions,
    options: &LabelOptions,
) -> Result<ScaleFit> {
    if sample.sites.is_empty() {
        let remedy = "leave it out of the data set";
        return Err(Error::geometry(format!("sample {}", sample.name), "it has no sites", remedy));
    }
    let best = best_fit(sample, directions, options)?;
    let [cr, ch, fr, fh] = sample.cutter.to_array();
    let twin = Sample { cutter: CutterParams::from_array([cr, fh, fr, ch]), ..sample.clone() };
    let exchanged = best_fit(&twin, directions, options)?;
    Ok(ScaleFit {
        best,
        exchanged: Some(exchanged).filter(|fit| fit.agreement >= best.agreement - AS_WELL),
        n_occlusion_stored: sample.answers.n_occlusion(),
    })
}

/// The occlusion points at a scale.
fn occlusion_at(
    sample: &Sample,
    mm_per_unit: f64,
    directions: &Directions,
    options: &LabelOptions,
) -> Result<Vec<bool>> {
    let scaled = in_millimeters(sample, mm_per_unit)?;
    let cutter = Cutter::ball_end(sample.cutter)?;
    let options = LabelOptions { beta: false, clearance_limit_mm: None, ..*options };
    let labels = access::label(&*scaled.sites, Obstacles::Queries, &cutter, directions, &options)?;
    Ok(labels.answers.occlusion)
}

fn n_equal(a: &[bool], b: &[bool]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a == b).count()
}

fn best_fit(sample: &Sample, directions: &Directions, options: &LabelOptions) -> Result<Fit> {
    let (mm_per_unit, agreement) = best_scale(sample, directions, options)?;
    let occlusion = occlusion_at(sample, mm_per_unit, directions, options)?;
    let n_occlusion = occlusion.iter().filter(|marked| **marked).count();
    Ok(Fit { mm_per_unit, agreement, n_occlusion })
}

/// The best scale, mm per unit, and its agreement.
fn best_scale(
    sample: &Sample,
    directions: &Directions,
    options: &LabelOptions,
) -> Result<(f64, f64)> {
    let cutter = Cutter::ball_end(sample.cutter)?;
    let counting = options;
    let options = LabelOptions { occlusion: false, clearance_limit_mm: None, ..*options };
    let fit = |mm_per_unit: f64| -> Result<(f64, f64)> {
        let scaled = in_millimeters(sample, mm_per_unit)?;
        let labels =
            access::label(&*scaled.sites, Obstacles::Queries, &cutter, directions, &options)?;
        let n_equal = n_equal(&labels.answers.inaccessible(), &sample.answers.inaccessible());
        Ok((mm_per_unit, n_equal as f64 / sample.sites.len() as f64))
    };
    let scales = std::iter::successors(Some(RANGE[0]), |scale| Some(scale * COARSE_FACTOR));
    let scales = scales.take_while(|scale| *scale <= RANGE[1]);
    let mut coarse = scales.map(fit).collect::<Result<Vec<(f64, f64)>>>()?;
    coarse.sort_by(|a, b| b.1.total_cmp(&a.1));
    let n_best = coarse.iter().filter(|fit| fit.1 == coarse[0].1).count();
    let mut fine = BTreeMap::new();
    for candidate in &coarse[..n_best.clamp(N_CANDIDATES, MOST_CANDIDATES)] {
        let step = |factor: f64| (candidate.0 * factor * STEPS_PER_MM).round() as u32;
        for k in step(1.0 / COARSE_FACTOR).max(1)..=step(COARSE_FACTOR) {
            if let Entry::Vacant(place) = fine.entry(k) {
                place.insert(fit(f64::from(k) / STEPS_PER_MM)?);
            }
        }
    }
    let best = fine.values().map(|fit| fit.1).fold(0.0, f64::max);
    let equal: Vec<(f64, f64)> = fine.into_values().filter(|fit| fit.1 == best).collect();
    if let [only] = equal[..] {
        return Ok(only);
    }
    let of_occlusion = |fit: &(f64, f64)| -> Result<usize> {
        let occlusion = occlusion_at(sample, fit.0, directions, counting)?;
        Ok(n_equal(&occlusion, &sample.answers.occlusion))
    };
    let agreeing = equal.iter().map(of_occlusion).collect::<Result<Vec<usize>>>()?;
    let most = agreeing.iter().copied().max().unwrap_or(0);
    let equal: Vec<&(f64, f64)> =
        equal.iter().zip(&agreeing).filter(|(_, n)| **n == most).map(|(fit, _)| fit).collect();
    Ok(*equal[equal.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::SiteAnswers;

    fn sample(points: Vec<Vec3>, lengths: [f64; 4]) -> Sample {
        let n = points.len();
        Sample {
            surface: None,
            name: "part".into(),
            sites: Arc::new(Sites { points, normals: vec![Vec3::Z; n], faces: vec![] }),
            cutter: CutterParams::from_array(lengths),
            answers: SiteAnswers::new(vec![false; n], vec![false; n]),
        }
    }

    #[test]
    fn centered_points_within_eight_tenths_are_normalized_and_parts_in_millimeters_are_not() {
        let cross = |x: f32| vec![Vec3::X * x, Vec3::X * -x, Vec3::Y * 0.3, Vec3::Y * -0.3];
        let tool = [1.5, 6.0, 40.0, 5.0];
        assert!(is_normalized(&sample(cross(0.8), tool)));
        assert!(is_normalized(&sample(cross(0.80005), tool)));
        assert!(!is_normalized(&sample(cross(40.0), tool)));
        assert!(!is_normalized(&sample(cross(0.5), tool)));
        assert!(!is_normalized(&sample(cross(0.8), [0.02, 0.1, 0.5, 0.1])), "a tool of its size");
        let beside = vec![Vec3::X * 0.8, Vec3::X * 0.7];
        assert!(!is_normalized(&sample(beside, tool)), "not centered");
        let scaled = in_millimeters(&sample(cross(0.8), tool), 50.0).unwrap();
        assert_eq!(scaled.sites.points[0], Vec3::X * 40.0);
        assert!(in_millimeters(&scaled, 1e9).is_err());
    }
}
