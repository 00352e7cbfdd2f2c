//! A whole checkpoint with some bytes changed: refused in one line, or the run that was stored.
#![no_main]

mod scratch;

use deepmill::train::{Checkpoint, Run, Settings};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static WHOLE: LazyLock<(Checkpoint, Vec<u8>)> = LazyLock::new(|| {
    let mut settings = Settings::tiny();
    let network = settings.network.octree_mut().expect("the preset's network");
    network.stem_width = 2;
    network.encoder_widths = vec![2];
    network.encoder_blocks = vec![1];
    network.decoder_widths = vec![2];
    network.decoder_blocks = vec![1];
    let checkpoint = Run::new(settings).expect("a small network").checkpoint();
    let path = scratch::file("whole.safetensors", &[]);
    checkpoint.write(&path).expect("a checkpoint");
    (checkpoint, std::fs::read(path).expect("its file"))
});

fuzz_target!(|input: &[u8]| {
    let (whole, bytes) = &*WHOLE;
    scratch::assert_one_line(Checkpoint::read(&scratch::file("any.safetensors", input)));
    let path = scratch::file("changed.safetensors", &scratch::changed(bytes, input));
    if let Some(found) = scratch::assert_one_line(Checkpoint::read(&path)) {
        assert!(found == *whole, "a change that the hash does not see");
        scratch::assert_one_line(Run::resume(found));
    }
});
