//! Lists of tools.

use super::super::context::dm_context;
use super::super::status::{Answer, dm_status};
use super::super::tools::ToolList;
use super::raw::{Buffer, Place, optional_text, text};
use super::{copy_text, dm_handle, enter, make};
use std::ffi::c_char;

/// Changes a list.
///
/// # Safety
/// As [`enter`].
unsafe fn change(
    context: *mut dm_context,
    tools: dm_handle,
    change: impl FnOnce(&mut ToolList) -> Answer<()>,
) -> dm_status {
    // SAFETY: of this function.
    unsafe { enter(context, |context| context.change(tools, change)) }
}

/// Makes an empty list of tools.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_new(
    context: *mut dm_context,
    tools: *mut dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { make(context, ("tools", tools), |_| Ok(ToolList::default())) }
}

/// Adds a ball end: cutter radius, height of its cylinder from 2 CR above the tip to the holder, radius and height of
/// the holder, and a margin about what does not cut, mm. Above the holder everything is spindle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_add_ball_end(
    context: *mut dm_context,
    tools: dm_handle,
    cr_mm: f64,
    ch_mm: f64,
    fr_mm: f64,
    fh_mm: f64,
    clearance_mm: f64,
) -> dm_status {
    let lengths = [cr_mm, ch_mm, fr_mm, fh_mm];
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, tools, |list| list.add(lengths, None, clearance_mm)) }
}

/// Adds a flat end, of the lengths of dm_tools_add_ball_end.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_add_flat_end(
    context: *mut dm_context,
    tools: dm_handle,
    cr_mm: f64,
    ch_mm: f64,
    fr_mm: f64,
    fh_mm: f64,
    clearance_mm: f64,
) -> dm_status {
    let lengths = [cr_mm, ch_mm, fr_mm, fh_mm];
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, tools, |list| list.add(lengths, Some(0.0), clearance_mm)) }
}

/// Adds a bull nose, whose tip has a corner of this radius: 0 is a flat end, CR a ball end.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_add_bull_nose(
    context: *mut dm_context,
    tools: dm_handle,
    cr_mm: f64,
    ch_mm: f64,
    fr_mm: f64,
    fh_mm: f64,
    corner_mm: f64,
    clearance_mm: f64,
) -> dm_status {
    let lengths = [cr_mm, ch_mm, fr_mm, fh_mm];
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, tools, |list| list.add(lengths, Some(corner_mm), clearance_mm)) }
}

/// Adds a ball end in the words of the program: "CR,CH,FR,FH", mm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_add_text(
    context: *mut dm_context,
    tools: dm_handle,
    lengths: *const c_char,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { change(context, tools, |list| list.add_text(text("lengths", lengths)?)) }
}

/// Adds the tools of a file or folder: a Fusion 360 library, FreeCAD, CAMotics, LinuxCNC, HSMWorks, or a CSV table.
///
/// unit: that of the file's numbers; null is as the file states. stick_out_mm: of tools whose file states none, 0 if
/// it is not known. What is left out is in dm_tools_notices.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_add_file(
    context: *mut dm_context,
    tools: dm_handle,
    path: *const c_char,
    unit: *const c_char,
    stick_out_mm: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let (path, unit) = (text("path", path)?, optional_text("unit", unit)?);
            // That there is such a list, before a file is read for it.
            context.get::<ToolList>(tools)?;
            let read = ToolList::read(path, unit, stick_out_mm)?;
            context.change(tools, |list: &mut ToolList| {
                list.add_read(read);
                Ok(())
            })
        })
    }
}

/// Has a tool of the list leave stock of this thickness, mm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_set_allowance(
    context: *mut dm_context,
    tools: dm_handle,
    tool: u32,
    allowance_mm: f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        change(context, tools, |list| list.replace(tool, |tool| tool.with_allowance(allowance_mm)))
    }
}

/// Names a tool of the list, for files and tables.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_set_name(
    context: *mut dm_context,
    tools: dm_handle,
    tool: u32,
    name: *const c_char,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        change(context, tools, |list| {
            let name = text("name", name)?;
            list.replace(tool, |tool| Ok(tool.named(name)))
        })
    }
}

/// The number of tools in the list.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_count(
    context: *mut dm_context,
    tools: dm_handle,
    n_tools: *mut usize,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let place = Place::new("n_tools", n_tools)?;
            place.put(context.get::<ToolList>(tools)?.tools.len());
            Ok(())
        })
    }
}

/// Copies the name of a tool of the list, a colon, and the tool in words.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_words(
    context: *mut dm_context,
    tools: dm_handle,
    tool: u32,
    buffer: *mut c_char,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let words =
        |of: &ToolList| of.tool(tool).map(|tool| format!("{}: {}", tool.name, tool.words()));
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy_text(context, tools, buffer, words) }
}

/// Copies what was left out of tool files or changed, a line each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_tools_notices(
    context: *mut dm_context,
    tools: dm_handle,
    buffer: *mut c_char,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy_text(context, tools, buffer, |of: &ToolList| Ok(of.notices.join("\n"))) }
}
