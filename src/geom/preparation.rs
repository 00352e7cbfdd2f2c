//! How a mesh of a caller from another language becomes one that can be labeled, with what was changed in words.

use super::units::{inch_warning, size_warning};
use super::{Mesh, bodies, check, origin, repair};
use crate::{Error, Result};
use glam::DVec3;
use std::path::PathBuf;

/// What is allowed, and where the mesh is from.
pub(crate) struct Preparation {
    /// Also mend small faults.
    pub repair: bool,
    /// Take what does not bound solids, with a notice.
    pub force: bool,
    /// Of a file.
    pub path: Option<PathBuf>,
    /// Millimeters per unit of what was given.
    pub scale: f64,
}

/// A mesh that can be labeled.
pub(crate) struct Prepared {
    pub mesh: Mesh,
    /// The origin of its coordinates in those that were given, mm, of a part that is far from it.
    pub origin: Option<DVec3>,
    /// What was changed or left out, a sentence each.
    pub notices: Vec<String>,
}

impl Preparation {
    /// As `deepmill label` prepares a mesh.
    pub fn mesh(&self, mut mesh: Mesh, mut notices: Vec<String>) -> Result<Prepared> {
        let local = origin::local_origin(&mesh);
        if let Some(at) = local {
            origin::make_relative(&mut mesh, at);
            let [x, y, z] = at.to_array();
            notices.push(format!(
                "the part is far from the origin: results are relative to ({x}, {y}, {z}) mm"
            ));
        }
        let mut changes: Vec<repair::Change> = repair::drop_loose(&mut mesh).into_iter().collect();
        if let Some((low, high)) = mesh.bounds() {
            let in_inches = || inch_warning(low, high).filter(|_| self.scale == 1.0);
            notices.extend(size_warning(low, high, self.scale).or_else(in_inches));
        }
        match self.repair {
            true => changes.extend(repair::repair(&mut mesh)?),
            false => changes.extend(repair::face_outward(&mut mesh)),
        }
        let joined = bodies::join(&mut mesh).map_err(|error| self.in_file(error));
        match joined {
            Err(fault) if self.force => notices.push(fault.to_string()),
            joined => changes.extend(joined?),
        }
        match check::check(&mesh).require_bodies().map_err(|error| self.in_file(error)) {
            Err(fault) if self.force => notices.push(fault.to_string()),
            verdict => verdict?,
        }
        notices.extend(changes.iter().map(ToString::to_string));
        Ok(Prepared { mesh, origin: local, notices })
    }

    fn in_file(&self, error: Error) -> Error {
        match (&self.path, error) {
            (Some(path), Error::Geometry { place, found, remedy }) => {
                Error::file(path, place, found, remedy)
            }
            (_, other) => other,
        }
    }
}
