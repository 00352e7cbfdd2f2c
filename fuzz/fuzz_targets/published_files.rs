//! Any text as a sample of the published format, raw and as a list: refused in one line, or samples that pass their
//! check. The first line is the cutter, the second the list.
#![no_main]

mod scratch;

use deepmill::data::files::published::{self, List};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let mut lines = input.splitn(3, |byte| *byte == b'\n');
    let mut next = || lines.next().unwrap_or_default();
    let (cutter, list, sites) = (next(), next(), next());
    scratch::file("raw_data/models_cutter/part_cutter.txt", cutter);
    scratch::file("filelist/models_train_val.txt", list);
    scratch::file("points/models/part.ply", sites);
    let path = scratch::file("raw_data/models/part.txt", sites);
    let root = path.ancestors().nth(3).expect("the folder of the format");
    for samples in [published::read_raw(root), published::read_list(root, List::TrainVal)] {
        scratch::assert_one_line(samples);
    }
    scratch::assert_one_line(published::listed_names(root, List::TrainVal));
});
