//! Any text as settings of a run, over a preset: refused in one line, or settings that survive being written and are
//! checked without a panic.
#![no_main]

mod scratch;

use deepmill::train::{Settings, settings_file};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let path = scratch::file("settings.toml", text.as_bytes());
    let read = settings_file::read(&path, &Settings::tiny());
    let Some(settings) = scratch::assert_one_line(read) else { return };
    if settings.check().is_ok() {
        settings_file::write(&path, &settings).expect("settings that are sound");
        let again = settings_file::read(&path, &Settings::tiny()).expect("our own file");
        assert!(again == settings);
    }
});
