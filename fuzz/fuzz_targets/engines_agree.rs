//! Every engine gives the labels of the reference engine on any scene that a few bytes can describe.
#![no_main]

mod scene;

use deepmill::access::{Engine, LabelOptions, Obstacles, label};
use deepmill::geom::Sites;
use glam::Vec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((head, rest)) = bytes.split_first_chunk() else { return };
    let (cutter, directions) = scene::tool(head);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let mut sites = Sites::default();
    for site in rest.chunks_exact(3).take(700) {
        let at = |b: u8| f32::from(b) * 0.25;
        sites.points.push(Vec3::new(at(site[0]), at(site[1]), at(site[2])));
        sites.normals.push(axes[usize::from(site[0] ^ site[1] ^ site[2]) % 6]);
    }
    let run = |engine, beta| {
        let options = LabelOptions::default().with_engine(engine).with_beta(beta);
        let mut labels = label(&sites, Obstacles::Queries, &cutter, &directions, &options).unwrap();
        labels.stats = Default::default();
        labels
    };
    let expected = run(Engine::Reference, true);
    assert!(run(Engine::Batched, true) == expected);
    assert!(run(Engine::Pruned, true) == expected);
    assert!(run(Engine::Pruned, false).answers == expected.answers);
});
