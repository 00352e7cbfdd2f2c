//! Any bytes, read as any file of tools or of a holder: an error of one line or tools whose steps widen upward, never a
//! panic. The first byte chooses the extension, what is given beside the file, and tools or holder.
#![no_main]

use deepmill::cutter::Section;
use deepmill::data::files::tools::{Holder, MissingParameters, from_bytes, holder_from_bytes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let Some((choice, bytes)) = input.split_first() else { return };
    let name = ["x.json", "x.fctb", "x.tbl", "x.csv"][usize::from(choice % 4)];
    let holder = Holder { name: "h".into(), sections: vec![Section::cylinder(40.0, 20.0)] };
    let defaults = match choice / 4 % 2 {
        0 => MissingParameters::default(),
        _ => MissingParameters::default()
            .with_stick_out_mm(Some(30.0))
            .with_holder(Some(holder))
            .with_shank_mm(Some(6.0))
            .with_flutes_mm(Some(10.0))
            .with_unit_mm(Some(25.4)),
    };
    if choice >> 7 == 1 {
        match holder_from_bytes(bytes, name.as_ref(), &defaults) {
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
            Ok(holder) => assert!(!holder.sections.is_empty()),
        }
        return;
    }
    match from_bytes(bytes, name.as_ref(), &defaults) {
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        Ok(table) => table.tools.iter().for_each(|tool| {
            assert!(tool.cutter.steps().is_sorted_by(|a, b| a.radius_mm <= b.radius_mm));
        }),
    }
});
