//! Any options and any coordinates: an error of one line, or an octree whose nodes hold their points, whose
//! neighbors agree with each other, and which interpolates ones to ones.
#![no_main]

use deepmill::nn::arena::Arena;
use deepmill::nn::interp::{Interpolate, Interpolation};
use deepmill::nn::layer::Layer;
use deepmill::nn::operand::Operand;
use deepmill::nn::pass::Inference;
use deepmill::octree::{Cloud, Octree, OctreeOptions, key};
use glam::Vec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let [depth, full_depth, wrap, coordinates @ ..] = input else { return };
    let options = OctreeOptions::default()
        .with_depth(usize::from(*depth))
        .with_full_depth(usize::from(*full_depth))
        .with_wrap_at_faces(wrap % 2 == 1)
        .with_max_bytes(1 << 24);
    // Either any bit patterns, or points on a coarse lattice inside the cube.
    let bits = coordinates.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
    let lattice = coordinates.iter().map(|b| f32::from(*b) / 127.5 - 1.0);
    let numbers: Vec<f32> = if wrap & 2 == 0 { bits.collect() } else { lattice.collect() };
    let points: Vec<Vec3> = numbers.as_chunks::<3>().0.iter().map(|p| Vec3::from(*p)).collect();
    let clouds: Vec<Cloud> = points.chunks(5).map(|p| Cloud::new(p, &[])).collect();
    let octree = match Octree::build(&clouds, &options) {
        Ok(octree) => octree,
        Err(error) => return assert!(!error.to_string().contains('\n'), "{error}"),
    };
    for (i, &point) in points.iter().enumerate() {
        let node = octree.finest().nonempty[octree.point_node[i] as usize];
        assert_eq!(octree.locate(octree.depth(), i / 5, point), Some(node));
    }
    for (d, level) in octree.levels.iter().enumerate() {
        assert!(level.keys.is_sorted_by(|a, b| a < b), "keys ascend");
        for (n, &code) in level.keys.iter().enumerate() {
            let (cell, shape) = key::decode(code);
            assert_eq!(octree.find(d, shape, cell), Some(n as u32));
        }
        for (n, neigh) in level.neigh.iter().enumerate() {
            let mutual = |k: usize, m: i32| m < 0 || level.neigh[m as usize][26 - k] == n as i32;
            assert!(neigh.iter().enumerate().all(|(k, &m)| mutual(k, m)));
        }
    }
    let map = Interpolation::linear(&octree, octree.depth(), &points, &octree.point_ranges);
    let ones = vec![1.0f64; octree.finest().n_nodes()];
    let arena = Arena::default();
    let pass = Inference::new(&[], &[], &arena);
    let y = Interpolate.forward(&pass, &map, Operand::new(&ones, 1));
    assert!(y.iter().all(|y| (y - 1.0).abs() < 1e-9));
});
