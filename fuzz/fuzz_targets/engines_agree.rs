//! Every engine gives the labels of the reference engine on any scene that a few bytes can describe.
#![no_main]

use deepmill::access::{Engine, LabelOptions, Obstacles, label};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::Sites;
use glam::Vec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((head, rest)) = bytes.split_at_checked(8) else { return };
    // Small whole numbers make ties and knife edges common.
    let length = |b: u8| f64::from(b % 32 + 1) * 0.25;
    let (cr, wider) = (length(head[0]), length(head[2]));
    let lengths = [cr, length(head[1]), cr + wider - 0.25, length(head[3])];
    let cutter = Cutter::ball_end(CutterParams::from_array(lengths)).expect("lengths are ordered");
    let vector =
        |b: u8| [f64::from(b & 3) - 1.0, f64::from(b >> 2 & 3) - 1.0, f64::from(b >> 4 & 3) + 0.5];
    let vectors = head[4..8].iter().map(|&b| vector(b)).collect();
    let directions = Directions::new(DirectionSet::List { vectors }).expect("vectors are not zero");
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let mut sites = Sites::default();
    for site in rest.chunks_exact(3).take(700) {
        let at = |b: u8| f32::from(b) * 0.25;
        sites.points.push(Vec3::new(at(site[0]), at(site[1]), at(site[2])));
        sites.normals.push(axes[usize::from(site[0] ^ site[1] ^ site[2]) % 6]);
    }
    let run = |engine| {
        let options = LabelOptions { engine, ..LabelOptions::default() };
        let mut labels = label(&sites, Obstacles::Queries, &cutter, &directions, &options).unwrap();
        labels.stats = Default::default();
        labels
    };
    let expected = run(Engine::Reference);
    assert!(run(Engine::Batched) == expected);
    assert!(run(Engine::Pruned) == expected);
});
