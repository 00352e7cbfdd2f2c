//! A cutter and directions that a few bytes describe.

use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::{DirectionSet, Directions};

/// A ball end and four directions.
pub fn tool(head: &[u8; 8]) -> (Cutter, Directions) {
    // Small whole numbers make ties and borderline cases common.
    let length = |b: u8| f64::from(b % 32 + 1) * 0.25;
    let (cr, wider) = (length(head[0]), length(head[2]));
    let lengths = [cr, length(head[1]), cr + wider - 0.25, length(head[3])];
    let cutter = Cutter::ball_end(CutterParams::from_array(lengths)).expect("lengths are ordered");
    let vector =
        |b: u8| [f64::from(b & 3) - 1.0, f64::from(b >> 2 & 3) - 1.0, f64::from(b >> 4 & 3) + 0.5];
    let vectors = head[4..8].iter().map(|&b| vector(b)).collect();
    let directions = Directions::new(DirectionSet::List { vectors }).expect("vectors are not zero");
    (cutter, directions)
}
