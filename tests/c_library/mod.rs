//! Calls of the C interface, for its tests.
#![allow(dead_code)] // each test file has its own part of it
#![allow(unsafe_code)]

use deepmill::capi::*;
use deepmill::geom::{Mesh, solids};
use deepmill::glam::DVec3;
use std::ffi::{CString, c_char};
use std::ptr::{null, null_mut};

/// A context that is freed at the end, and calls with it.
pub struct Library(pub *mut dm_context);

impl Drop for Library {
    fn drop(&mut self) {
        // SAFETY: the context was made by `Library::new`, and nobody else has it.
        unsafe { dm_context_free(&raw mut self.0) };
    }
}

/// A buffer of so many elements that has `n` in its length, for calls that fill one.
pub type Fill<'a, T> = &'a dyn Fn(*mut T, usize, *mut usize) -> dm_status;

/// What a call puts into a buffer, by its own count.
pub fn filled<T: Default + Clone>(fill: Fill<'_, T>) -> Vec<T> {
    let mut needed = usize::MAX;
    assert_eq!(fill(null_mut(), 0, &mut needed), dm_status::DM_OK);
    let mut buffer = vec![T::default(); needed];
    assert_eq!(fill(buffer.as_mut_ptr(), needed, null_mut()), dm_status::DM_OK);
    buffer
}

pub fn words(fill: Fill<'_, c_char>) -> String {
    let bytes: Vec<u8> = filled(fill).into_iter().map(|char| char as u8).collect();
    std::ffi::CStr::from_bytes_with_nul(&bytes).unwrap().to_str().unwrap().to_owned()
}

pub fn c(text: &str) -> CString {
    CString::new(text).unwrap()
}

/// SAFETY of all blocks below: contexts are those of a `Library`, pointers those of variables and vectors with their
/// lengths, or null.
impl Library {
    pub fn new() -> Self {
        Library(dm_context_new(DM_ABI_VERSION))
    }

    pub fn error(&self) -> String {
        // SAFETY: as above.
        words(&|buffer, n, needed| unsafe { dm_error_text(self.0, buffer, n, needed) })
    }

    /// The handle that a call makes.
    pub fn made(&self, make: impl FnOnce(*mut dm_handle) -> dm_status) -> dm_handle {
        let mut handle = u64::MAX;
        let status = make(&mut handle);
        assert_eq!(status, dm_status::DM_OK, "{}", self.error());
        handle
    }

    pub fn done(&self, status: dm_status) {
        assert_eq!(status, dm_status::DM_OK, "{}", self.error());
    }

    /// That a call fails in this way; its text.
    pub fn fails(&self, status: dm_status, expected: dm_status, with: &str) {
        let text = self.error();
        assert_eq!(status, expected, "{text}");
        assert!(text.contains(with), "`{with}` is not in `{text}`");
    }

    pub fn mesh_status(
        &self,
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
        handle: *mut dm_handle,
    ) -> dm_status {
        let (v, t) = (vertices.as_flattened().as_ptr(), triangles.as_flattened().as_ptr());
        // SAFETY: as above.
        unsafe { dm_mesh_new(self.0, v, vertices.len(), t, triangles.len(), null(), 0, handle) }
    }

    pub fn mesh(&self, mesh: &Mesh) -> dm_handle {
        let vertices: Vec<[f64; 3]> = mesh.vertices.iter().map(|v| v.to_array()).collect();
        self.made(|handle| self.mesh_status(&vertices, &mesh.triangles, handle))
    }

    /// Flat ends of 6 mm, by the heights of their cylinders.
    pub fn tools(&self, heights: &[f64]) -> dm_handle {
        // SAFETY: as above.
        unsafe {
            let tools = self.made(|handle| dm_tools_new(self.0, handle));
            for height in heights {
                let add = dm_tools_add_flat_end(self.0, tools, 3.0, *height, 20.0, 20.0, 0.0);
                self.done(add);
            }
            tools
        }
    }

    /// An analysis of the block by +z alone.
    pub fn analysis(&self, mesh: dm_handle, tools: dm_handle) -> dm_handle {
        // SAFETY: as above.
        unsafe {
            let new = |handle| dm_analysis_new(self.0, mesh, tools, handle);
            let analysis = self.made(new);
            self.done(dm_analysis_set_sites(self.0, analysis, 600, 7));
            self.done(dm_analysis_set_directions(self.0, analysis, c("up").as_ptr()));
            self.done(dm_analysis_set_search(self.0, analysis, 0));
            analysis
        }
    }

    pub fn run(&self, analysis: dm_handle) -> dm_handle {
        // SAFETY: as above.
        let run = |handle| unsafe { dm_analysis_run(self.0, analysis, None, null_mut(), handle) };
        self.made(run)
    }

    pub fn floats(&self, outcome: dm_handle, tool: u32, field: u32) -> Vec<f32> {
        // SAFETY: as above.
        filled(&|buffer, n, needed| unsafe {
            dm_outcome_floats(self.0, outcome, tool, field, buffer, n, needed)
        })
    }

    pub fn doubles(&self, outcome: dm_handle, tool: u32, field: u32) -> Vec<f64> {
        // SAFETY: as above.
        filled(&|buffer, n, needed| unsafe {
            dm_outcome_doubles(self.0, outcome, tool, field, buffer, n, needed)
        })
    }

    pub fn wholes(&self, outcome: dm_handle, tool: u32, field: u32) -> Vec<u32> {
        // SAFETY: as above.
        filled(&|buffer, n, needed| unsafe {
            dm_outcome_uint32s(self.0, outcome, tool, field, buffer, n, needed)
        })
    }

    pub fn bytes(&self, outcome: dm_handle, tool: u32, field: u32) -> Vec<u8> {
        // SAFETY: as above.
        filled(&|buffer, n, needed| unsafe {
            dm_outcome_bytes(self.0, outcome, tool, field, buffer, n, needed)
        })
    }

    pub fn text(&self, outcome: dm_handle, tool: u32, field: u32) -> String {
        // SAFETY: as above.
        words(&|buffer, n, needed| unsafe {
            dm_outcome_text(self.0, outcome, tool, field, buffer, n, needed)
        })
    }
}

/// 40 × 30 × 20 mm.
pub fn block() -> Mesh {
    solids::cuboid(DVec3::new(40.0, 30.0, 20.0))
}
