//! Any text as a baseline, a machine, a matrix of directions by vertices, or the status of every vertex: refused in one
//! line, or the same after being written again; a machine's poses give the tool axis back.
#![no_main]

mod scratch;

use deepmill::data::files::{machines, matrix::AccessMatrix, safety};
use deepmill::findings::baseline::Baseline;
use deepmill::glam::DVec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let path = scratch::file("shop.toml", text.as_bytes());
    if let Some(baseline) = scratch::assert_one_line(Baseline::read(&path)) {
        baseline.write(&path).expect("a baseline that was read");
        assert!(Baseline::read(&path).expect("our own file") == baseline);
    }
    scratch::file("shop.toml", text.as_bytes());
    if let Some(machine) = scratch::assert_one_line(machines::read(&path)) {
        let axes = machine.axes().expect("a machine file");
        for tool_axis in [DVec3::Z, DVec3::X, -DVec3::Z, DVec3::new(0.6, -0.48, 0.64)] {
            for angles in axes.poses(tool_axis) {
                assert!(axes.tool_axis(&angles).distance(tool_axis) < 1e-5, "{angles:?}");
            }
        }
    }
    let of_freecad = scratch::file("shop.fcm", text.as_bytes());
    scratch::assert_one_line(machines::read(&of_freecad));
    if let Some(matrix) = scratch::assert_one_line(AccessMatrix::read_text(&path)) {
        matrix.write_text(&path).expect("a matrix that was read");
        assert!(AccessMatrix::read_text(&path).expect("our own file") == matrix);
    }
    scratch::file("shop.toml", text.as_bytes());
    if let Some(status) = scratch::assert_one_line(safety::read(&path)) {
        safety::write(&path, &status).expect("a status that was read");
        assert!(safety::read(&path).expect("our own file") == status);
    }
});
