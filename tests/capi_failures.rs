//! What the C interface promises where something is wrong: a status, a text with the argument's name, what was found
//! and what is right, and nothing else happens.
#![allow(unsafe_code)]

mod c_library;

use c_library::{Library, block, c, words};
use deepmill::capi::*;
use dm_status::{
    DM_BAD_ARGUMENT, DM_BAD_FILE, DM_BAD_GEOMETRY, DM_BAD_HANDLE, DM_CANNOT_READ, DM_CANNOT_WRITE,
    DM_INTERRUPTED, DM_NO_CONTEXT, DM_NOT_COMPUTED, DM_OK, DM_SHORT_BUFFER,
};
use std::ffi::{CStr, c_int, c_void};
use std::ptr::{null, null_mut};

// SAFETY of all blocks below: contexts are those of a `Library` or null, pointers those of variables and vectors with
// their lengths, or null, or not aligned, which is refused before they are followed.

fn block_arrays() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let block = block();
    (block.vertices.iter().map(|v| v.to_array()).collect(), block.triangles)
}

#[test]
fn versions_and_statuses_have_words_and_another_abi_gets_no_context() {
    assert_eq!(dm_abi_version(), DM_ABI_VERSION);
    // SAFETY: both are texts that live for ever.
    let [version, text] = unsafe { [dm_version(), dm_status_text(3)].map(|t| CStr::from_ptr(t)) };
    assert_eq!(version.to_str(), Ok(env!("CARGO_PKG_VERSION")));
    assert_eq!(text, c"an argument is null or outside its domain");
    assert!(dm_context_new(DM_ABI_VERSION + 1).is_null());
}

#[test]
fn a_null_context_is_a_status_of_its_own_everywhere() {
    let none = null_mut();
    // SAFETY: see above.
    unsafe {
        let of_mesh = dm_mesh_new(none, null(), 0, null(), 0, null(), 0, null_mut());
        assert_eq!(of_mesh, DM_NO_CONTEXT);
        assert_eq!(dm_free(none, 1), DM_NO_CONTEXT);
        assert_eq!(dm_error_text(none, null_mut(), 0, null_mut()), DM_NO_CONTEXT);
        assert_eq!(dm_tools_new(none, null_mut()), DM_NO_CONTEXT);
        assert_eq!(dm_analysis_set_rest(none, 1, 1), DM_NO_CONTEXT);
        assert_eq!(dm_analysis_run(none, 1, None, null_mut(), null_mut()), DM_NO_CONTEXT);
        let text = dm_outcome_text(none, 1, 0, DM_NOTICES, null_mut(), 0, null_mut());
        assert_eq!(text, DM_NO_CONTEXT);
    }
}

#[test]
fn a_context_is_freed_once_however_often_it_is_asked_for() {
    let mut context = dm_context_new(DM_ABI_VERSION);
    // SAFETY: see above.
    unsafe {
        let mut tools = 0;
        assert_eq!(dm_tools_new(context, &mut tools), DM_OK);
        dm_context_free(&mut context);
        assert!(context.is_null());
        dm_context_free(&mut context);
        dm_context_free(null_mut());
        assert_eq!(dm_free(context, tools), DM_NO_CONTEXT);
    }
}

#[test]
fn freed_handles_name_nothing_for_ever_and_what_was_made_of_them_stays() {
    let library = Library::new();
    let (mesh, tools) = (library.mesh(&block()), library.tools(&[20.0]));
    let analysis = library.analysis(mesh, tools);
    // SAFETY: see above.
    unsafe {
        for handle in [mesh, tools] {
            library.done(dm_free(library.0, handle));
            library.fails(dm_free(library.0, handle), DM_BAD_HANDLE, "which was freed");
        }
        library.done(dm_free(library.0, 0));
        let outcome = library.run(analysis);
        library.done(dm_free(library.0, analysis));
        let again = library.tools(&[20.0]);
        assert!(![mesh, tools, analysis].contains(&again));
        let status = dm_analysis_set_rest(library.0, analysis, 1);
        library.fails(status, DM_BAD_HANDLE, "expected an analysis");
        assert!(!library.floats(outcome, 0, DM_POINTS).is_empty());
    }
}

#[test]
fn handles_of_other_kinds_and_of_other_contexts_are_refused() {
    let (library, other) = (Library::new(), Library::new());
    let (mesh, tools) = (library.mesh(&block()), library.tools(&[20.0]));
    let (theirs, mut made) = (other.mesh(&block()), 1);
    // SAFETY: see above.
    unsafe {
        let status = dm_analysis_new(library.0, tools, mesh, &mut made);
        library.fails(status, DM_BAD_HANDLE, "a list of tools, expected a mesh");
        assert_eq!(made, 0);
        let status = dm_analysis_new(library.0, theirs, tools, &mut made);
        library.fails(status, DM_BAD_HANDLE, "is of another context, expected a mesh");
        let status = dm_analysis_new(library.0, 0, tools, &mut made);
        library.fails(status, DM_BAD_HANDLE, "handle is 0, expected a mesh");
        let status = dm_tools_add_text(library.0, mesh, c("3,20,20,20").as_ptr());
        library.fails(status, DM_BAD_HANDLE, "a mesh, expected a list of tools");
        let status = dm_outcome_counts(library.0, mesh, null_mut(), null_mut(), null_mut());
        library.fails(status, DM_BAD_HANDLE, "expected an outcome");
        let analysis = library.analysis(mesh, tools);
        let status = dm_analysis_add_fixture(library.0, analysis, analysis, null());
        library.fails(status, DM_BAD_HANDLE, "an analysis, expected a mesh");
        other.done(dm_free(other.0, theirs));
    }
}

#[test]
fn bad_arrays_are_refused_by_the_name_of_the_argument() {
    let library = Library::new();
    let (vertices, triangles) = block_arrays();
    let mut mesh = 1;
    let new = |vertices: &[[f64; 3]], triangles: &[[u32; 3]], mesh| {
        library.mesh_status(vertices, triangles, mesh)
    };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut vertices = vertices.clone();
        vertices[2][1] = bad;
        let status = new(&vertices, &triangles, &mut mesh);
        library.fails(status, DM_BAD_ARGUMENT, "vertices is [");
        library.fails(status, DM_BAD_ARGUMENT, "in row 2, expected finite numbers; ");
        assert_eq!(mesh, 0);
    }
    let mut beyond = triangles.clone();
    beyond[4][2] = 8;
    let status = new(&vertices, &beyond, &mut mesh);
    library.fails(status, DM_BAD_ARGUMENT, "in row 4, expected rows of vertices, from 0 to 7; ");
    library.fails(new(&[], &triangles, &mut mesh), DM_BAD_ARGUMENT, "n_vertices is 0, expected");
    library.fails(new(&vertices, &[], &mut mesh), DM_BAD_ARGUMENT, "n_triangles is 0, expected");
    let status = new(&vertices, &triangles[1..], &mut mesh);
    library.fails(status, DM_BAD_GEOMETRY, "edges");
    library.fails(new(&vertices, &triangles, null_mut()), DM_BAD_ARGUMENT, "mesh is null");
    // SAFETY: see above.
    unsafe {
        let (v, t) = (vertices.as_flattened().as_ptr(), triangles.as_flattened().as_ptr());
        let (n_v, n_t) = (vertices.len(), triangles.len());
        let new = |v: *const f64, n_v: usize, t: *const u32, unit: &CStr, flags: u32| {
            let mut mesh = 1;
            let unit = if unit.is_empty() { null() } else { unit.as_ptr() };
            dm_mesh_new(library.0, v, n_v, t, n_t, unit, flags, &mut mesh)
        };
        library.fails(new(null(), n_v, t, c"", 0), DM_BAD_ARGUMENT, "vertices is null");
        library.fails(new(v, n_v, null(), c"", 0), DM_BAD_ARGUMENT, "triangles is null");
        let odd = v.cast::<u8>().wrapping_add(1).cast::<f64>();
        library.fails(new(odd, n_v, t, c"", 0), DM_BAD_ARGUMENT, "expected a multiple of 8");
        let status = new(v, usize::MAX, t, c"", 0);
        library.fails(status, DM_BAD_ARGUMENT, "vertices is an array of 18446744073709551615");
        library.fails(new(v, n_v, t, c"ft", 0), DM_BAD_ARGUMENT, "unit is `ft`, expected mm, cm");
        library.fails(new(v, n_v, t, c"\xff", 0), DM_BAD_ARGUMENT, "unit is not UTF-8");
        library.fails(new(v, n_v, t, c"", 8), DM_BAD_ARGUMENT, "flags is 0x8, expected bits");
        library.done(new(v, n_v, t, c"mm", DM_REPAIR | DM_FORCE));
    }
}

#[test]
fn bad_tools_and_options_are_refused_and_change_nothing() {
    let library = Library::new();
    let (mesh, tools) = (library.mesh(&block()), library.tools(&[20.0]));
    let analysis = library.analysis(mesh, tools);
    let before = library.floats(library.run(analysis), 0, DM_POINTS);
    let (l, nan) = (library.0, f64::NAN);
    // SAFETY: see above.
    unsafe {
        let add = |cr, clearance| dm_tools_add_ball_end(l, tools, cr, 20.0, 20.0, 20.0, clearance);
        for cr in [nan, -1.0, 0.0, f64::INFINITY] {
            library.fails(add(cr, 0.0), DM_BAD_ARGUMENT, "cutter radius CR is ");
        }
        library.fails(add(3.0, nan), DM_BAD_ARGUMENT, "clearance is NaN");
        let status = dm_tools_add_bull_nose(l, tools, 3.0, 20.0, 20.0, 20.0, 4.0, 0.0);
        library.fails(status, DM_BAD_ARGUMENT, "corner radius is 4, expected between 0 and");
        let status = dm_tools_add_text(l, tools, c("3,20").as_ptr());
        library.fails(status, DM_BAD_ARGUMENT, "lengths is `3,20`, expected four lengths");
        library.fails(dm_tools_add_text(l, tools, null()), DM_BAD_ARGUMENT, "lengths is null");
        let status = dm_tools_set_allowance(l, tools, 1, 0.1);
        library.fails(status, DM_BAD_ARGUMENT, "tool is 1, expected less than 1");
        library.fails(
            dm_tools_set_allowance(l, tools, 0, nan),
            DM_BAD_ARGUMENT,
            "allowance is NaN",
        );
        let status = dm_tools_add_file(l, tools, c("no.csv").as_ptr(), null(), 0.0);
        library.fails(status, DM_CANNOT_READ, "no.csv: cannot be read");
        let status = dm_tools_add_file(l, tools, c("no.csv").as_ptr(), null(), nan);
        library.fails(status, DM_BAD_ARGUMENT, "stick_out_mm is NaN");
        let mut n_tools = 0;
        library.done(dm_tools_count(l, tools, &mut n_tools));
        assert_eq!(n_tools, 1);
        library.fails(dm_tools_count(l, tools, null_mut()), DM_BAD_ARGUMENT, "n_tools is null");

        let mut made = 1;
        let empty = library.tools(&[]);
        let status = dm_analysis_new(l, mesh, empty, &mut made);
        library.fails(status, DM_BAD_ARGUMENT, "tools is an empty list, expected one tool");
        let twins = library.tools(&[20.0, 20.0]);
        let status = dm_analysis_new(l, mesh, twins, &mut made);
        library.fails(status, DM_BAD_ARGUMENT, "twice, expected a name for one tool only");

        let bad = |status, with| library.fails(status, DM_BAD_ARGUMENT, with);
        bad(dm_analysis_set_sites(l, analysis, 1, 0), "n_sites is 1, expected 2 or more");
        bad(dm_analysis_set_smooth(l, analysis, nan), "degrees is NaN, expected an angle");
        bad(dm_analysis_set_directions(l, analysis, c("down:").as_ptr()), "down:");
        bad(dm_analysis_set_directions(l, analysis, null()), "directions is null");
        bad(dm_analysis_set_direction_vectors(l, analysis, null(), 0), "n_vectors is 0");
        bad(dm_analysis_set_direction_vectors(l, analysis, null(), 1), "vectors is null");
        for vector in [[0.0; 3], [nan, 0.0, 1.0]] {
            let status = dm_analysis_set_direction_vectors(l, analysis, vector.as_ptr(), 1);
            bad(status, "direction");
        }
        bad(dm_analysis_set_tolerance(l, analysis, nan), "tolerance_mm is NaN");
        bad(dm_analysis_set_tolerance(l, analysis, -0.1), "tolerance_mm is -0.1, expected");
        bad(dm_analysis_set_finish(l, analysis, 0.0), "finish_mm is 0, expected positive");
        bad(dm_analysis_set_occlusion(l, analysis, 1.5), "share is 1.5, expected above 0");
        bad(dm_analysis_set_clearance_limit(l, analysis, -1.0), "limit_mm is -1, expected");
        bad(dm_analysis_set_table(l, analysis, nan), "z_mm is NaN, expected a number");
        bad(dm_analysis_set_threads(l, analysis, 1 << 20), "n_threads is 1048576, expected");
        bad(dm_analysis_set_name(l, analysis, null()), "name is null");
        let mut outcome = 1;
        library.done(dm_analysis_set_table(l, analysis, 1e9));
        bad(dm_analysis_run(l, analysis, None, null_mut(), &mut outcome), "table is 1000000000");
        assert_eq!(outcome, 0);
        bad(dm_analysis_run(l, analysis, None, null_mut(), null_mut()), "outcome is null");
        library.done(dm_analysis_set_table(l, analysis, -5.0));
    }
    assert_eq!(library.floats(library.run(analysis), 0, DM_POINTS), before);
}

#[test]
fn short_buffers_stay_as_they_were_and_longer_ones_beyond_the_result() {
    let library = Library::new();
    let outcome = library.run(library.analysis(library.mesh(&block()), library.tools(&[20.0])));
    let answers = library.bytes(outcome, 0, DM_ANSWERS);
    let n = answers.len();
    // SAFETY: see above.
    unsafe {
        let copy = |buffer: &mut [u8], needed: *mut usize| {
            let start = buffer.as_mut_ptr();
            dm_outcome_bytes(library.0, outcome, 0, DM_ANSWERS, start, buffer.len(), needed)
        };
        let (mut needed, mut short, mut long) = (0, vec![77; n - 1], vec![77; n + 9]);
        let expected = format!("buffer has {} elements, expected {n}; ", n - 1);
        library.fails(copy(&mut short, &mut needed), DM_SHORT_BUFFER, &expected);
        assert_eq!((needed, short.iter().all(|byte| *byte == 77)), (n, true));
        library.done(copy(&mut long, null_mut()));
        assert_eq!((&long[..n], &long[n..]), (&answers[..], &[77; 9][..]));

        let ask = |field, buffer: *mut u8, n| {
            dm_outcome_bytes(library.0, outcome, 0, field, buffer, n, null_mut())
        };
        library.done(ask(DM_ANSWERS, null_mut(), 0));
        let status = ask(DM_ANSWERS, null_mut(), n);
        library.fails(status, DM_BAD_ARGUMENT, "buffer is null");
        library.fails(ask(DM_OCCLUSION, null_mut(), 0), DM_NOT_COMPUTED, "occlusion was not");
        let status = ask(DM_POINTS, null_mut(), 0);
        library.fails(status, DM_BAD_ARGUMENT, "field is 1, expected a field of uint8_t");

        // Text counts its zero, and the text of the failure outlives a short buffer for it.
        let expected = library.error();
        let mut text = vec![1; expected.len()];
        let status = dm_error_text(library.0, text.as_mut_ptr(), text.len(), &mut needed);
        assert_eq!((status, needed), (DM_SHORT_BUFFER, expected.len() + 1));
        assert!(text.iter().all(|char| *char == 1));
        assert_eq!(library.error(), expected);
    }
}

#[test]
fn tools_sites_and_findings_that_are_not_there_are_refused() {
    let library = Library::new();
    let outcome = library.run(library.analysis(library.mesh(&block()), library.tools(&[20.0])));
    let l = library.0;
    let bad = |status, with| library.fails(status, DM_BAD_ARGUMENT, with);
    // SAFETY: see above.
    unsafe {
        let rest = dm_outcome_floats(l, outcome, 0, DM_REST_MM, null_mut(), 0, null_mut());
        library.fails(rest, DM_NOT_COMPUTED, "call dm_analysis_set_rest");
        let clearance =
            dm_outcome_floats(l, outcome, 0, DM_CLEARANCE_MM, null_mut(), 0, null_mut());
        library.fails(clearance, DM_NOT_COMPUTED, "call dm_analysis_set_clearance_limit");
        let witness = dm_outcome_floats(l, outcome, 1, DM_WITNESS, null_mut(), 0, null_mut());
        bad(witness, "tool is 1, expected less than 1, the number of tools");
        let name =
            dm_outcome_text(l, outcome, DM_ALL_TOOLS, DM_TOOL_NAME, null_mut(), 0, null_mut());
        bad(name, "tool is 4294967295");
        let (mut share, mut n, mut mesh) = (0.0, 0, [0.0; 3]);
        bad(dm_outcome_share(l, outcome, 0, 3, &mut share), "answer is 3, expected DM_ACCESSIBLE");
        library.done(dm_outcome_n_findings(l, outcome, 0, &mut n));
        let beyond = dm_outcome_finding_id(l, outcome, 0, n, null_mut(), 0, null_mut());
        bad(beyond, "finding is 1, expected less than 1");
        bad(dm_outcome_finding(l, outcome, 0, 0, null_mut()), "finding is null");
        let origin = dm_mesh_origin(l, library.mesh(&block()), mesh.as_mut_ptr());
        library.fails(origin, DM_NOT_COMPUTED, "the coordinates are those given");
    }
}

#[test]
fn files_that_are_not_there_or_cannot_be_written_are_statuses() {
    let library = Library::new();
    let outcome = library.run(library.analysis(library.mesh(&block()), library.tools(&[20.0])));
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| c(folder.path().join(name).to_str().unwrap());
    std::fs::write(folder.path().join("bad.stl"), "solid of nothing").unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    let (l, mut mesh) = (library.0, 1);
    // SAFETY: see above.
    unsafe {
        let mut read = |name: &str| dm_mesh_read(l, path(name).as_ptr(), null(), 0, &mut mesh);
        library.fails(read("none.stl"), DM_CANNOT_READ, "none.stl: cannot be read");
        library.fails(read("bad.stl"), DM_BAD_FILE, "bad.stl: ");
        library.fails(read("part.iges"), DM_BAD_FILE, "export it as STL");
        let write = |name: &str, unit: &CStr, flags| {
            let name = path(name);
            dm_outcome_write(l, outcome, name.as_ptr(), unit.as_ptr(), flags, None, null_mut())
        };
        let no_pictures = DM_WRITE_NO_PICTURES;
        library.fails(write("file/below", c"mm", no_pictures), DM_CANNOT_WRITE, "file");
        library.fails(write("out", c"mile", 0), DM_BAD_ARGUMENT, "unit is `mile`");
        library.fails(write("out", c"mm", 64), DM_BAD_ARGUMENT, "flags is 0x40");
        assert!(!folder.path().join("out").exists());
        let also = no_pictures | DM_WRITE_REPORT | DM_WRITE_CSV | DM_WRITE_GLB;
        library.done(write("out", c"in", also));
        for name in ["labels.npz", "labels.csv", "labels.glb", "report.html", "part.stl"] {
            assert!(folder.path().join("out").join(name).is_file(), "{name}");
        }
        assert!(!folder.path().join("out/labels.png").exists());
        let report = path("report.html");
        library.done(dm_outcome_write_report(l, outcome, report.as_ptr(), null()));
        let status = dm_outcome_write_report(l, outcome, path("").as_ptr(), null());
        library.fails(status, DM_CANNOT_WRITE, "");
    }
    let html = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("</html>"), "the report is whole");
}

/// What a callback has seen, and when it stops.
struct Watch {
    library: *mut dm_context,
    thread: std::thread::ThreadId,
    seen: Vec<(u32, usize, usize)>,
    stop_at: Option<u32>,
}

unsafe extern "C" fn watch(user: *mut c_void, stage: u32, done: usize, of: usize) -> c_int {
    // SAFETY: every test below passes its own `Watch`, and nobody else reads it meanwhile.
    let watch = unsafe { &mut *user.cast::<Watch>() };
    assert_eq!(watch.thread, std::thread::current().id());
    watch.seen.push((stage, done, of));
    let mut tools = 0;
    // SAFETY: the context is that of the `Library` of the test.
    assert_eq!(unsafe { dm_tools_new(watch.library, &mut tools) }, DM_OK);
    c_int::from(watch.stop_at == Some(stage))
}

#[test]
fn callbacks_come_on_the_calling_thread_may_call_the_library_and_stop_the_work() {
    let library = Library::new();
    let analysis = library.analysis(library.mesh(&block()), library.tools(&[20.0, 5.0]));
    let thread = std::thread::current().id();
    let run = |stop_at| {
        let mut watched = Watch { library: library.0, thread, seen: Vec::new(), stop_at };
        let mut outcome = 1;
        let user = (&raw mut watched).cast();
        // SAFETY: see above.
        let status =
            unsafe { dm_analysis_run(library.0, analysis, Some(watch), user, &mut outcome) };
        (status, outcome, watched.seen)
    };
    let (status, outcome, seen) = run(None);
    library.done(status);
    for expected in [(DM_STAGE_SITES, 0, 1), (DM_STAGE_LABELS, 0, 2), (DM_STAGE_LABELS, 2, 2)] {
        assert!(seen.contains(&expected), "{seen:?}");
    }
    assert!(seen.is_sorted_by_key(|(stage, done, _)| (*stage, *done)), "{seen:?}");
    let (status, none, seen) = run(Some(DM_STAGE_LABELS));
    library.fails(status, DM_INTERRUPTED, "interrupted");
    assert_eq!((none, seen.last().unwrap().0), (0, DM_STAGE_LABELS));

    let folder = tempfile::tempdir().unwrap();
    let path = c(folder.path().join("out").to_str().unwrap());
    let stop_at = Some(DM_STAGE_WRITING);
    let mut watched = Watch { library: library.0, thread, seen: Vec::new(), stop_at };
    let user = (&raw mut watched).cast();
    // SAFETY: see above.
    let status = unsafe {
        dm_outcome_write(library.0, outcome, path.as_ptr(), null(), 0, Some(watch), user)
    };
    library.fails(status, DM_INTERRUPTED, "interrupted");
    assert_eq!(watched.seen, [(DM_STAGE_WRITING, 0, 2)]);
}

#[test]
fn threads_share_a_context() {
    let library = Library::new();
    let mesh = library.mesh(&block());
    let address = library.0.expose_provenance();
    let expected = library.run(library.analysis(mesh, library.tools(&[20.0])));
    let expected = library.bytes(expected, 0, DM_ANSWERS);
    let of_threads = std::thread::scope(|scope| {
        let threads = [(); 4].map(|()| {
            scope.spawn(|| {
                // Not freed here: it is the other thread's.
                let context = std::ptr::with_exposed_provenance_mut(address);
                let shared = std::mem::ManuallyDrop::new(Library(context));
                let outcome = shared.run(shared.analysis(mesh, shared.tools(&[20.0])));
                (outcome, shared.bytes(outcome, 0, DM_ANSWERS))
            })
        });
        threads.map(|thread| thread.join().unwrap())
    });
    let mut handles = of_threads.each_ref().map(|(outcome, _)| *outcome);
    handles.sort_unstable();
    assert!(handles.windows(2).all(|pair| pair[0] != pair[1]), "{handles:?}");
    assert!(of_threads.iter().all(|(_, answers)| *answers == expected));
}

#[test]
fn tools_of_files_keep_what_was_left_out_and_names_are_set() {
    let library = Library::new();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tools.csv");
    std::fs::write(&path, "name,CR,CH,FR,FH,color\nD6,3,20,20,20,red\n").unwrap();
    let (l, tools) = (library.0, library.tools(&[5.0]));
    // SAFETY: see above.
    unsafe {
        let path = c(path.to_str().unwrap());
        library.done(dm_tools_add_file(l, tools, path.as_ptr(), null(), 0.0));
        library.done(dm_tools_set_name(l, tools, 0, c("short").as_ptr()));
        library.done(dm_tools_set_allowance(l, tools, 0, 0.5));
        let of =
            |tool| words(&|buffer, n, needed| dm_tools_words(l, tools, tool, buffer, n, needed));
        assert!(of(0).starts_with("short: flat-end"), "{}", of(0));
        assert!(of(0).ends_with("allowance 0.5 mm"), "{}", of(0));
        assert!(of(1).starts_with("D6: "), "{}", of(1));
        let left = words(&|buffer, n, needed| dm_tools_notices(l, tools, buffer, n, needed));
        assert_eq!(left, "column not used: \"color\"");
    }
}

#[test]
fn a_mesh_far_away_has_another_origin_and_its_table_and_results_follow() {
    let library = Library::new();
    let (mut vertices, triangles) = block_arrays();
    let far = 2e5;
    vertices.iter_mut().for_each(|row| row[2] += far);
    let mesh = library.made(|handle| library.mesh_status(&vertices, &triangles, handle));
    let mut origin = [0.0; 3];
    // SAFETY: see above.
    unsafe {
        library.done(dm_mesh_origin(library.0, mesh, origin.as_mut_ptr()));
        let notices = words(&|b, n, needed| dm_mesh_notices(library.0, mesh, b, n, needed));
        assert!(notices.contains("far from the origin"), "{notices}");
        let prepared =
            c_library::filled(&|b, n, needed| dm_mesh_vertices(library.0, mesh, b, n, needed));
        let corners =
            c_library::filled(&|b, n, needed| dm_mesh_triangles(library.0, mesh, b, n, needed));
        assert_eq!((prepared.len(), corners.len()), (24, 36));
        let low = prepared.chunks_exact(3).map(|row| row[2]).fold(f64::INFINITY, f64::min);
        let given = vertices.iter().map(|row| row[2]).fold(f64::INFINITY, f64::min);
        assert!((low + origin[2] - given).abs() < 1e-6);
        // A table 15 mm above the underside keeps the flat end from the walls below it.
        let analysis = library.analysis(mesh, library.tools(&[20.0]));
        library.done(dm_analysis_set_table(library.0, analysis, given + 15.0));
        let outcome = library.run(analysis);
        let points = library.floats(outcome, 0, DM_POINTS);
        let answers = library.bytes(outcome, 0, DM_ANSWERS);
        for (point, answer) in points.chunks_exact(3).zip(answers) {
            let height = f64::from(point[2]) - low;
            if (height - 15.0).abs() > 0.05 {
                assert_eq!(u32::from(answer) == DM_ACCESSIBLE, height > 15.0, "at {height}");
            }
        }
    }
}
