//! Any bytes, and a whole weight file with some bytes changed: read or refused without a panic, and what
//! is read survives being written.
#![no_main]

use deepmill::model::{Model, UNetConfig, weights};
use libfuzzer_sys::fuzz_target;
use std::{path::Path, sync::LazyLock};

static WHOLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let model = Model::<f32>::new(&UNetConfig::tiny(), 1).expect("a preset is valid");
    weights::to_bytes(&model, weights::Storage::Bf16, "")
});

fuzz_target!(|input: &[u8]| {
    let origin = Path::new("fuzz");
    let _ = weights::from_bytes::<f32>(input, origin);
    let mut bytes = WHOLE.clone();
    for change in input.as_chunks::<4>().0 {
        let place = u32::from_le_bytes([change[0], change[1], change[2], 0]) as usize;
        let n = bytes.len();
        bytes[place % n] = change[3];
    }
    if let Ok(model) = weights::from_bytes::<f32>(&bytes, origin) {
        let again = weights::to_bytes(&model, weights::Storage::Exact, "");
        let again = weights::from_bytes::<f32>(&again, origin).expect("our own file");
        assert!(again.params == model.params && again.buffers == model.buffers);
    }
});
