//! Poses in files: a direction and a tip for each site, zeros where there is none.

use super::same_length;
use crate::access::surface::WitnessPose;
use crate::data::npz::{NpzReader, NpzWriter};
use crate::geom::Sites;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::path::Path;

/// Names of the arrays of poses: their directions and tips.
pub(super) const WITNESS: [&str; 2] = ["witness_direction", "witness_tip"];
pub(super) const REST: [&str; 2] = ["rest_direction", "rest_tip"];

const REMEDY: &str = "label the part again";

/// Adds poses.
pub(crate) fn add(
    npz: &mut NpzWriter,
    [directions, tips]: [&str; 2],
    poses: &[Option<WitnessPose>],
) {
    let direction = |pose: &Option<WitnessPose>| pose.map_or(Vec3::ZERO, |pose| pose.direction);
    let tip = |pose: &Option<WitnessPose>| pose.map_or(DVec3::ZERO, |pose| pose.tip_mm);
    let of = poses.iter().flat_map(|pose| direction(pose).to_array());
    npz.array(directions, &[poses.len(), 3], &of.collect::<Vec<f32>>());
    let of = poses.iter().flat_map(|pose| tip(pose).to_array());
    npz.array(tips, &[poses.len(), 3], &of.collect::<Vec<f64>>());
}

/// The directions of poses.
pub(super) fn read_directions(
    path: &Path,
    npz: &mut NpzReader,
    sites: &Sites,
    name: &str,
) -> Result<Vec<Option<Vec3>>> {
    let directions = unit_or_none(path, npz, name)?;
    same_length(path, sites, name, directions.len())?;
    Ok(directions)
}

/// Unit vectors, none where all three numbers are 0.
///
/// # Errors
/// If there is no such array, or one of another length.
pub(super) fn unit_or_none(
    path: &Path,
    npz: &mut NpzReader,
    name: &str,
) -> Result<Vec<Option<Vec3>>> {
    const OFF: f32 = 1e-3;
    let direction = |(i, numbers): (usize, &[f32])| {
        let direction = Vec3::from_slice(numbers);
        if direction == Vec3::ZERO {
            return Ok(None);
        }
        match (direction.length_squared() - 1.0).abs() < OFF {
            true => Ok(Some(direction)),
            false => {
                let found = format!("row {i} is {direction}, which is no unit vector");
                Err(Error::file(path, name, found, REMEDY))
            }
        }
    };
    npz.f32s(name, 3)?.chunks_exact(3).enumerate().map(direction).collect()
}

/// Poses by the names of their arrays; none from a file of before there were poses.
pub(crate) fn read_poses(
    path: &Path,
    npz: &mut NpzReader,
    sites: &Sites,
    [direction, tip]: [&str; 2],
) -> Result<Vec<Option<WitnessPose>>> {
    if !npz.has(tip) {
        return Ok(vec![None; sites.len()]);
    }
    let tips = npz.f64s(tip, 3)?;
    same_length(path, sites, tip, tips.len() / 3)?;
    if let Some(i) = tips.iter().position(|x| !x.is_finite()) {
        let found = format!("row {} has {}, which is not finite", i / 3, tips[i]);
        return Err(Error::file(path, tip, found, REMEDY));
    }
    let directions = read_directions(path, npz, sites, direction)?;
    let pose = |(direction, tip): (Option<Vec3>, &[f64])| {
        direction.map(|direction| WitnessPose { direction, tip_mm: DVec3::from_slice(tip) })
    };
    Ok(directions.into_iter().zip(tips.chunks_exact(3)).map(pose).collect())
}
