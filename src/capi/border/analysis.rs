//! What is requested, and its run.

use super::super::context::dm_context;
use super::super::request::Request;
use super::super::status::{Answer, dm_status};
use super::super::work;
use super::raw::{optional_text, slice, text};
use super::{dm_handle, enter, make};
use crate::analysis::{Observer, Progress};
use std::ffi::{c_char, c_int, c_void};
use std::ops::ControlFlow;

/// Is called with how far the work is: done of so many parts of a stage, DM_STAGE_SITES and so on; another result than
/// 0 stops the work. It is called on the thread that called, and may call the library. It must return: no exception,
/// no longjmp.
#[allow(non_camel_case_types)] // the name in C
pub type dm_progress =
    Option<unsafe extern "C" fn(user: *mut c_void, stage: u32, done: usize, of: usize) -> c_int>;

/// A callback of C.
pub(super) struct Callback {
    function: dm_progress,
    user: *mut c_void,
}

impl Callback {
    /// Of a function, which may be null.
    ///
    /// # Safety
    /// The function can be called with `user` as long as this lives, and returns.
    pub unsafe fn new(function: dm_progress, user: *mut c_void) -> Self {
        Callback { function, user }
    }
}

impl Observer for Callback {
    fn progress(&mut self, Progress { stage, done, of }: Progress) -> ControlFlow<()> {
        let Some(function) = self.function else { return ControlFlow::Continue(()) };
        // SAFETY: whoever made this has promised that it can be called.
        match unsafe { function(self.user, work::number(stage), done, of) } {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }
}

/// Changes an analysis.
///
/// # Safety
/// As [`enter`].
unsafe fn change(
    context: *mut dm_context,
    analysis: dm_handle,
    change: impl FnOnce(&mut Request) -> Answer<()>,
) -> dm_status {
    // SAFETY: of this function.
    unsafe { enter(context, |context| context.change(analysis, change)) }
}

/// Makes an analysis of a mesh and tools, with the options of `deepmill label`: 7,000 sites, 150 directions over the
/// upper half, the mesh definition. Tools that are added to the list later are not in it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_new(
    context: *mut dm_context,
    mesh: dm_handle,
    tools: dm_handle,
    analysis: *mut dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        make(context, ("analysis", analysis), |context| {
            Request::new(context.get(mesh)?, context.get(tools)?)
        })
    }
}

/// Names the part, for files and titles; "part" if it has no file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_name(
    context: *mut dm_context,
    analysis: dm_handle,
    name: *const c_char,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_name(text("name", name)?)) }
}

/// Spreads about so many sites over the surface; the seed is that of their places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_sites(
    context: *mut dm_context,
    analysis: dm_handle,
    n_sites: usize,
    seed: u64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_sites(n_sites, seed)) }
}

/// Takes the corners of the mesh as its sites.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_sites_at_vertices(
    context: *mut dm_context,
    analysis: dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, Request::set_sites_at_vertices) }
}

/// Has normals be smooth across edges that are folded by less than this angle, of 0 to 180 degrees.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_smooth(
    context: *mut dm_context,
    analysis: dm_handle,
    degrees: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_smooth(degrees)) }
}

/// The directions tested: a number of them over the upper half, or a set such as "cone:60:150", "sphere:300" or "up".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_directions(
    context: *mut dm_context,
    analysis: dm_handle,
    directions: *const c_char,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_directions(text("directions", directions)?)) }
}

/// The directions tested: rows of x, y, z from tip to spindle, of any length above 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_direction_vectors(
    context: *mut dm_context,
    analysis: dm_handle,
    vectors: *const f64,
    n_vectors: usize,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header. Three numbers in a row have no padding between them.
    unsafe {
        change(context, analysis, |of| {
            let vectors = slice("vectors", vectors.cast::<[f64; 3]>(), n_vectors)?;
            of.set_direction_vectors(vectors)
        })
    }
}

/// Gouge tolerance against every facet, mm, in place of one that the facets imply.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_tolerance(
    context: *mut dm_context,
    analysis: dm_handle,
    tolerance_mm: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_tolerance(tolerance_mm)) }
}

/// How much may remain at a site that counts as reached, mm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_finish(
    context: *mut dm_context,
    analysis: dm_handle,
    finish_mm: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_finish(finish_mm)) }
}

/// How many cells between the directions are searched for each site, 0 for none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_search(
    context: *mut dm_context,
    analysis: dm_handle,
    n_kept: usize,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_search(n_kept)) }
}

/// Searches far longer between the directions, for proofs that nothing is open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_prove(
    context: *mut dm_context,
    analysis: dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, Request::set_prove) }
}

/// Also marks this share of the sites, those that are most often in the way.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_occlusion(
    context: *mut dm_context,
    analysis: dm_handle,
    share: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_occlusion(share)) }
}

/// Also computes by how much every height and radius of a tool may grow or must shrink, up to this, mm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_clearance_limit(
    context: *mut dm_context,
    analysis: dm_handle,
    limit_mm: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_clearance_limit(limit_mm)) }
}

/// Also computes how much each tool leaves where it does not reach, unless `rest` is 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_rest(
    context: *mut dm_context,
    analysis: dm_handle,
    rest: c_int,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_rest(rest != 0)) }
}

/// Adds a mesh that blocks too, in the coordinates of the part as it was given. name: for findings; null is its file's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_add_fixture(
    context: *mut dm_context,
    analysis: dm_handle,
    mesh: dm_handle,
    name: *const c_char,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let (mesh, name) = (context.get(mesh)?, optional_text("name", name)?);
            context.change(analysis, |of: &mut Request| of.add_fixture(mesh, name))
        })
    }
}

/// Puts a table at this height, which blocks too, in the coordinates of the part as it was given, mm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_table(
    context: *mut dm_context,
    analysis: dm_handle,
    z_mm: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_table(z_mm)) }
}

/// The number of threads that compute; 0, the default, is one per logical CPU. Results do not depend on it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_set_threads(
    context: *mut dm_context,
    analysis: dm_handle,
    n_threads: usize,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, analysis, |of| of.set_threads(n_threads)) }
}

/// Places the sites and labels them for every tool. progress: may be null; user: is handed to it as it is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_analysis_run(
    context: *mut dm_context,
    analysis: dm_handle,
    progress: dm_progress,
    user: *mut c_void,
    outcome: *mut dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        make(context, ("outcome", outcome), |context| {
            let request = context.get::<Request>(analysis)?;
            request.run(&mut Callback::new(progress, user))
        })
    }
}
