//! Answers, and what follows from them.

use super::super::context::dm_context;
use super::super::results::{Results, cause};
use super::super::status::{Answer, dm_status};
use super::analysis::{Callback, dm_progress};
use super::raw::{Buffer, Place, optional_text, text};
use super::{copy, copy_text, dm_handle, enter};
use crate::findings::Finding;
use std::ffi::{c_char, c_void};

/// A region out of reach. NaN is what was not computed.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(non_camel_case_types)] // the name in C
pub struct dm_finding {
    /// Number of its sites.
    pub n_sites: u64,
    /// The site nearest to its mean place.
    pub site: u32,
    /// DM_INACCESSIBLE or DM_TIP_DOES_NOT_FIT.
    pub answer: u32,
    /// Estimated area, mm².
    pub area_mm2: f64,
    /// That area as a share of the surface.
    pub area_share: f64,
    /// Where its site is, mm.
    pub at_mm: [f64; 3],
    /// Mean outward normal; zero if the normals cancel.
    pub normal: [f64; 3],
    /// Least corner of the box about its sites, mm.
    pub low_mm: [f64; 3],
    /// Greatest corner of that box, mm.
    pub high_mm: [f64; 3],
    /// Least clearance of its sites, mm.
    pub worst_clearance_mm: f64,
    /// Greatest rest of its sites, mm.
    pub greatest_rest_mm: f64,
    /// Volume of what is left about its sites, mm³.
    pub left_mm3: f64,
}

impl From<&Finding> for dm_finding {
    fn from(found: &Finding) -> Self {
        dm_finding {
            n_sites: found.n_sites as u64,
            site: found.site,
            answer: cause(found),
            area_mm2: found.area_mm2,
            area_share: found.area_share,
            at_mm: found.at_mm.to_array(),
            normal: found.normal.to_array(),
            low_mm: found.low_mm.to_array(),
            high_mm: found.high_mm.to_array(),
            worst_clearance_mm: found.worst_clearance_mm.map_or(f64::NAN, f64::from),
            greatest_rest_mm: found.greatest_rest_mm.map_or(f64::NAN, f64::from),
            left_mm3: found.left_mm3.unwrap_or(f64::NAN),
        }
    }
}

/// Puts one number of an outcome into its place.
///
/// # Safety
/// As [`enter`] and [`Place::new`].
unsafe fn put<T>(
    context: *mut dm_context,
    outcome: dm_handle,
    (name, place): (&'static str, *mut T),
    number: impl FnOnce(&Results) -> Answer<T>,
) -> dm_status {
    // SAFETY: of this function.
    unsafe {
        enter(context, |context| {
            let place = Place::new(name, place)?;
            place.put(number(&*context.get::<Results>(outcome)?)?);
            Ok(())
        })
    }
}

/// The numbers of sites, tools and directions. Each of the places may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_counts(
    context: *mut dm_context,
    outcome: dm_handle,
    n_sites: *mut usize,
    n_tools: *mut usize,
    n_directions: *mut usize,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let results = context.get::<Results>(outcome)?;
            let of = &results.outcome;
            let counts = [of.sites().len(), of.tools().len(), of.directions().len()];
            let places =
                [("n_sites", n_sites), ("n_tools", n_tools), ("n_directions", n_directions)];
            for ((name, place), count) in places.into_iter().zip(counts) {
                if let Some(place) = Place::optional(name, place)? {
                    place.put(count);
                }
            }
            Ok(())
        })
    }
}

/// Copies numbers of type float: DM_POINTS and so on. tool: from 0 on; DM_ALL_TOOLS for what no tool reaches, of
/// DM_REST_MM and DM_REST_VOLUME_MM3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_floats(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    field: u32,
    buffer: *mut f32,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy(context, outcome, buffer, |of: &Results| of.floats(tool, field)) }
}

/// Copies numbers of type double: DM_AREA_SHARES and so on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_doubles(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    field: u32,
    buffer: *mut f64,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy(context, outcome, buffer, |of: &Results| of.doubles(tool, field)) }
}

/// Copies numbers of type uint32_t: DM_FACES and so on. tool: from 0 on; DM_ALL_TOOLS for what no tool reaches, of
/// DM_FINDING_OF_SITE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_uint32s(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    field: u32,
    buffer: *mut u32,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy(context, outcome, buffer, |of: &Results| of.wholes(tool, field)) }
}

/// Copies numbers of type uint8_t: DM_ANSWERS or DM_OCCLUSION. tool: from 0 on; DM_ALL_TOOLS for what no tool reaches,
/// of DM_ANSWERS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_bytes(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    field: u32,
    buffer: *mut u8,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy(context, outcome, buffer, |of: &Results| of.bytes(tool, field)) }
}

/// Copies text: DM_TOOL_NAME and so on. tool: from 0 on; DM_ALL_TOOLS of DM_WARNINGS for all of them, of
/// DM_FINDINGS_JSON for what no tool reaches.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_text(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    field: u32,
    buffer: *mut c_char,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy_text(context, outcome, buffer, |of: &Results| of.text(tool, field)) }
}

/// Share of the surface that has an answer, DM_ACCESSIBLE and so on. tool: from 0 on, or DM_ALL_TOOLS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_share(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    answer: u32,
    share: *mut f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { put(context, outcome, ("share", share), |of| of.share(tool, answer)) }
}

/// Area of the surface, mm².
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_surface(
    context: *mut dm_context,
    outcome: dm_handle,
    surface_mm2: *mut f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { put(context, outcome, ("surface_mm2", surface_mm2), Results::surface_mm2) }
}

/// Number of regions out of reach of a tool, or with DM_ALL_TOOLS of all.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_n_findings(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    n_findings: *mut usize,
) -> dm_status {
    let count = |of: &Results| of.findings(tool).map(|findings| findings.list.len());
    // SAFETY: the caller keeps the contract of the header.
    unsafe { put(context, outcome, ("n_findings", n_findings), count) }
}

/// A region out of reach, by its number from 0 on; the largest is first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_finding(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    number: usize,
    finding: *mut dm_finding,
) -> dm_status {
    let found = |of: &Results| of.finding(tool, number).map(dm_finding::from);
    // SAFETY: the caller keeps the contract of the header.
    unsafe { put(context, outcome, ("finding", finding), found) }
}

/// Copies the name of a region, which other sites and small changes of the part do not change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_finding_id(
    context: *mut dm_context,
    outcome: dm_handle,
    tool: u32,
    number: usize,
    buffer: *mut c_char,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let id = |of: &Results| of.finding(tool, number).map(|finding| finding.id.clone());
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy_text(context, outcome, buffer, id) }
}

/// Writes the folder of `deepmill label`. unit: of tables and report; null is mm. flags: 0, or DM_WRITE_REPORT and so
/// on. progress and user: as of dm_analysis_run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_write(
    context: *mut dm_context,
    outcome: dm_handle,
    folder: *const c_char,
    unit: *const c_char,
    flags: u32,
    progress: dm_progress,
    user: *mut c_void,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let results = context.get::<Results>(outcome)?;
            let (folder, unit) = (text("folder", folder)?, optional_text("unit", unit)?);
            results.write(folder, unit, flags, &mut Callback::new(progress, user))
        })
    }
}

/// Writes the HTML report into one file. unit: of lengths and areas; null is mm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_outcome_write_report(
    context: *mut dm_context,
    outcome: dm_handle,
    path: *const c_char,
    unit: *const c_char,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let results = context.get::<Results>(outcome)?;
            results.write_report(text("path", path)?, optional_text("unit", unit)?)
        })
    }
}
