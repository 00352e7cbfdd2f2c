//! Poses in files: a direction and a tip for each site, zeros where there is none.

use super::same_length;
use crate::Result;
use crate::access::surface::WitnessPose;
use crate::data::npz::{NpzReader, NpzWriter};
use crate::geom::Sites;
use glam::{DVec3, Vec3};
use std::path::Path;

/// Names of the arrays of poses: their directions and tips.
pub(super) const WITNESS: [&str; 2] = ["witness_direction", "witness_tip"];
pub(super) const REST: [&str; 2] = ["rest_direction", "rest_tip"];

/// Adds poses.
pub(super) fn add(
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
    let witness = npz.f32s(name, 3)?;
    same_length(path, sites, name, witness.len() / 3)?;
    let direction = |w: &[f32]| Some(Vec3::from_slice(w)).filter(|d| *d != Vec3::ZERO);
    Ok(witness.chunks_exact(3).map(direction).collect())
}

/// Poses by the names of their arrays; none from a file of before there were poses.
pub(super) fn read_poses(
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
    let directions = read_directions(path, npz, sites, direction)?;
    let pose = |(direction, tip): (Option<Vec3>, &[f64])| {
        direction.map(|direction| WitnessPose { direction, tip_mm: DVec3::from_slice(tip) })
    };
    Ok(directions.into_iter().zip(tips.chunks_exact(3)).map(pose).collect())
}
