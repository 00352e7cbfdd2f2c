//! Bad arguments of library calls: each gives an error that names it, or a panic that the documentation states. None
//! gives an answer.

use deepmill::access::Labeler;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles, raise};
use deepmill::answers::Rounding;
use deepmill::cutter::{Assembly, Cutter, Profile, Section, TipShape};
use deepmill::directions::Directions;
use deepmill::geom::inside::{Lattice, lattice_inside, windings};
use deepmill::geom::sites::{Normals, SiteOptions, from_vertices, sample};
use deepmill::geom::{Mesh, Sites, check, regions, solids, spacing, weld};
use deepmill::loss::CrossEntropy;
use deepmill::metrics::Confusion;
use deepmill::model::{Calibration, Model, UNet, UNetConfig};
use deepmill::nn::interp::Interpolation;
use deepmill::nn::params::{Init, Layout};
use deepmill::octree::normalize::Preparation;
use deepmill::octree::{Cloud, KernelMap, Octree, OctreeOptions, key};
use deepmill::optim::{Schedule, Sgd};
use deepmill::planning::cover::cover_share;
use deepmill::planning::setups::{Candidates, Choice, Clampings, Plan};
use deepmill::rng::{Purpose, Stream};
use deepmill::train::reliability::Reliability;
use deepmill::{Error, Result};
use glam::{DVec2, DVec3, Vec3, dvec3};
use std::fmt::Debug;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice::from_ref;

/// The call's error is one line that starts with what is bad and has these words.
fn refused<T>(call: Result<T>, words: &[&str]) {
    let message = call.err().expect("an error").to_string();
    assert!(message.starts_with(words[0]) && !message.contains('\n'), "{message}");
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
    assert!(message.contains("; "), "a remedy: {message}");
}

/// The call panics with these words.
fn panics<T: Debug>(call: impl FnOnce() -> T, words: &str) {
    let payload = catch_unwind(AssertUnwindSafe(call)).expect_err("a panic");
    let constant = payload.downcast_ref::<&str>().map(ToString::to_string);
    let message = payload.downcast_ref().cloned().or(constant).expect("a message");
    assert!(message.contains(words), "{message}");
}

fn cube() -> Mesh {
    solids::cuboid(DVec3::splat(10.0))
}

fn with_vertex(x: f64) -> Mesh {
    let mut mesh = cube();
    mesh.vertices[3].x = x;
    mesh
}

fn with_index(v: u32) -> Mesh {
    let mut mesh = cube();
    mesh.triangles[4][1] = v;
    mesh
}

fn cutter() -> Cutter {
    "1.5,6,40,5".parse().unwrap()
}

fn sites() -> Sites {
    sample(&cube(), &SiteOptions::default().with_n_sites(60)).unwrap()
}

#[test]
fn sites_are_not_spread_over_meshes_beyond_a_kilometer_or_without_numbers() {
    let options = SiteOptions::default().with_n_sites(50);
    for x in [1e9, 1.1e6, 1e300, f64::NAN, f64::INFINITY, -1e9] {
        refused(sample(&with_vertex(x), &options), &["vertex 3", "1 km"]);
        refused(from_vertices(&with_vertex(x)), &["vertex 3", "1 km"]);
    }
    refused(sample(&with_index(99), &options), &["face 4", "beyond the last of 8"]);
    refused(sample(&Mesh::default(), &options), &["mesh", "no face has an area"]);
    assert!(sample(&with_vertex(1e6), &options).unwrap().check().is_ok());
    for crease_rad in [f64::NAN, -0.1, 3.2] {
        let smooth = options.with_normals(Normals::Smooth { crease_rad });
        refused(sample(&cube(), &smooth), &["crease_rad is ", "0 to pi"]);
    }
}

#[test]
fn a_tool_is_not_raised_by_or_over_what_is_no_number() {
    let at = |mesh: &Mesh, reference| raise(mesh, &cutter(), 0.01, reference, Vec3::Z);
    let center = DVec3::splat(5.0);
    for x in [f64::NAN, f64::INFINITY, 1e9] {
        refused(at(&with_vertex(x), center), &["vertex 3", "1 km"]);
        refused(at(&cube(), dvec3(5.0, x, 5.0)), &["reference is ", "1 km"]);
    }
    refused(at(&with_index(99), center), &["face 4"]);
    refused(raise(&cube(), &cutter(), f64::NAN, center, Vec3::Z), &["contact tolerance is NaN"]);
    refused(raise(&cube(), &cutter(), 0.01, center, Vec3::NAN), &["direction is "]);
    assert!(at(&cube(), center).unwrap().tip > 0.0);
}

#[test]
fn nothing_that_is_no_number_is_inside() {
    let lattice = Lattice::covering(DVec3::ZERO, DVec3::splat(10.0), 2.0).unwrap();
    for x in [f64::NAN, f64::INFINITY, 1e300] {
        refused(windings(&with_vertex(x), &[DVec3::ONE]), &["vertex 3", "1e12 mm"]);
        refused(lattice_inside(&with_vertex(x), &lattice), &["vertex 3", "1e12 mm"]);
    }
    refused(windings(&with_index(99), &[DVec3::ONE]), &["face 4", "beyond the last of 8"]);
    for point in [DVec3::NAN, DVec3::INFINITY] {
        refused(windings(&cube(), &[DVec3::ONE, point]), &["point 1", "finite"]);
    }
    assert_eq!(windings(&cube(), &[DVec3::ONE, -DVec3::ONE]).unwrap(), [1, 0]);
}

#[test]
fn a_lattice_covers_a_box_with_finite_corners_in_order() {
    for (low, high) in [
        (DVec3::NAN, DVec3::ONE),
        (dvec3(0.0, f64::NAN, 0.0), DVec3::ONE),
        (DVec3::ZERO, DVec3::INFINITY),
        (DVec3::ONE, DVec3::ZERO),
    ] {
        refused(Lattice::covering(low, high, 0.1), &["box is ", "the least first"]);
    }
    refused(Lattice::covering(DVec3::ZERO, DVec3::ONE, f64::NAN), &["step is NaN"]);
    refused(Lattice::with_about(DVec3::NAN, DVec3::ONE, 9), &["volume samples is "]);
    assert_eq!(Lattice::covering(DVec3::ZERO, DVec3::X, 0.5).unwrap().counts, [2, 1, 1]);
}

#[test]
fn vertices_are_welded_within_a_share_of_a_finite_diagonal() {
    for tolerance in [1e300, 1.1, -1e-9, f64::NAN, f64::INFINITY] {
        refused(weld::weld(&cube(), tolerance), &["weld is ", "0 to 1"]);
    }
    for x in [1e300, 1e13, f64::NAN] {
        refused(weld::weld(&with_vertex(x), 1e-6), &["vertex 3", "1e12 mm"]);
    }
    refused(weld::weld(&with_index(99), 1e-6), &["face 4"]);
    assert_eq!(weld::weld(&cube(), 1.0).unwrap().vertices.len(), 1);
}

#[test]
fn areas_and_weights_are_not_negative() {
    let sites = sites();
    for area in [-5.0, f64::NAN, f64::INFINITY] {
        refused(spacing::areas_mm2(&sites, Some(area)), &["surface_mm2 is ", "0 mm²"]);
        let areas = [area; 60];
        panics(|| regions::regions(&sites, None, &areas, &[Some(1); 60]), "the area of site 0 is ");
        panics(|| cover_share(2, &[1.0, area], |set, e| set == e, 1.0), "weight 1 is ");
    }
    for share in [f64::NAN, -0.1, 1.1] {
        panics(|| cover_share(2, &[1.0; 2], |set, e| set == e, share), "the share is ");
    }
}

#[test]
fn setups_are_not_planned_by_weights_below_zero_or_shares_beyond_all() {
    let (part, sites) = (cube(), sites());
    let candidates = Candidates::new(&part, "3-axis".parse().unwrap(), Clampings::Any, 20).unwrap();
    let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
    let directions = candidates.directions();
    let accessible = obstacles
        .accessible_directions(&sites, &cutter(), directions, &SurfaceOptions::default())
        .unwrap();
    let plan = |weight: f64, share: f64| {
        let (mut weights, accessible) = (vec![1.0; 60], [accessible.clone()]);
        weights[7] = weight;
        Plan::new(&candidates, &part, &sites, &accessible, &weights, Choice::share(share), &[0])
    };
    for weight in [-1.0, f64::NAN, f64::INFINITY] {
        refused(plan(weight, 1.0), &["weights is ", "0 or more"]);
    }
    for share in [-0.1, 1.5, f64::NAN] {
        refused(plan(1.0, share), &["share is ", "0 to 1"]);
    }
    assert!(!plan(1.0, 1.0).unwrap().setups.is_empty());
}

#[test]
fn a_part_without_area_is_no_obstacle() {
    let flat = Mesh::from_slices(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], &[[0, 1, 2]]);
    for part in [Mesh::default(), flat.unwrap()] {
        refused(TriangleObstacles::new(&part, &[]), &["part", "no face has an area"]);
        refused(TriangleObstacles::new(&part, &[cube()]), &["part", "no face has an area"]);
        let options = SurfaceOptions::default();
        refused(Labeler::of_part(&part, &[], Directions::up(), options), &["part"]);
    }
    for x in [f64::NAN, 1e9] {
        refused(TriangleObstacles::new(&with_vertex(x), &[]), &["vertex 3", "1 km"]);
        refused(TriangleObstacles::new(&cube(), &[with_vertex(x)]), &["vertex 3", "1 km"]);
    }
}

#[test]
fn triangles_block_whichever_side_they_face_and_the_check_refuses_open_and_turned_parts() {
    let (part, sites) = (cube(), sites());
    let mut turned = part.clone();
    turned.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let answers = |mesh: &Mesh| {
        let labeler = Labeler::of_part(mesh, &[], "50".parse()?, SurfaceOptions::default())?;
        labeler.answer(&sites, &cutter())
    };
    assert_eq!(answers(&turned).unwrap(), answers(&part).unwrap());
    let mut open = part.clone();
    open.triangles.pop();
    assert!(answers(&open).is_ok() && check::require_labelable(&part).is_ok());
    refused(check::require_labelable(&open), &["edge", "open edge"]);
    refused(check::require_labelable(&turned), &["component", "inward"]);
}

#[test]
fn a_calibration_that_is_no_number_calibrates_nothing() {
    let mut model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
    let (points, normals) = ([Vec3::ZERO, Vec3::X], [Vec3::Z; 2]);
    for (slope, offset) in [(f64::NAN, 0.0), (1.0, f64::NAN), (0.0, 0.0), (-1.0, 0.0)] {
        model.calibration[1] = Calibration { slope, offset };
        let found = model.predict(&points, &normals, [1.5, 6.0, 40.0, 5.0]);
        refused(found, &["calibration is Calibration", "positive slope"]);
        refused(model.calibration[1].check(), &["calibration is Calibration"]);
    }
    panics(|| Reliability::of(&[0.5, f32::NAN], &[true; 2]), "probability NaN");
    panics(|| Reliability::of(&[1.5], &[true]), "probability 1.5");
}

fn loss(class_weights: &[f64], label_smoothing: f64, target: u8) -> f64 {
    let entropy = CrossEntropy::binary()
        .with_class_weights(class_weights.to_vec())
        .with_label_smoothing(label_smoothing);
    entropy.loss(&[0.1, 0.2], &[target], 1.0, &mut Vec::new())
}

#[test]
fn a_loss_has_classes_with_weights_and_a_smoothing_below_one() {
    for smoothing in [1.0, 1.5, -0.1, f64::NAN] {
        panics(|| loss(&[1.0; 2], smoothing, 1), "label_smoothing is ");
    }
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        panics(|| loss(&[weight, 1.0], 0.0, 1), "class_weights is [");
    }
    panics(|| loss(&[1.0; 2], 0.0, 7), "target is 7 in row 0, expected below 2");
    assert!(loss(&[1.0; 2], 0.0, 1) > 0.0);
    let entropy = CrossEntropy::binary();
    assert!(entropy.loss(&[f64::NAN, 0.2], &[1], 1.0, &mut Vec::new()).is_nan());
}

#[test]
fn scores_count_two_classes() {
    panics(|| Confusion::of_logits(&[0.1, 0.2], &[7], 1), "class 7 of 2");
    panics(|| Confusion::of_logits(&[0.1, 0.2], &[1], 2), "class 2 of 2");
    let nan = Confusion::of_logits(&[f32::NAN, 0.2], &[1], 1);
    assert_eq!((nan.n(), nan.recall()), (1, 0.0));
}

fn octree() -> Octree {
    let points: Vec<Vec3> = (0..40).map(|i| Vec3::new(i as f32 / 20.0 - 1.0, 0.1, 0.2)).collect();
    let options = OctreeOptions::default().with_depth(4);
    Octree::build(&[Cloud::new(&points, &[])], &options).unwrap()
}

#[test]
fn features_are_interpolated_at_finite_points() {
    let octree = octree();
    let at =
        |point| Interpolation::<f32>::linear(&octree, 3, &[Vec3::ZERO, point], from_ref(&(0..2)));
    let nearest = |point| Interpolation::<f32>::nearest(&octree, 3, &[point], from_ref(&(0..1)));
    for point in [Vec3::NAN, Vec3::INFINITY, Vec3::new(0.0, 0.0, f32::NAN)] {
        panics(|| at(point), "point 1 is ");
        panics(|| nearest(point), "point 0 is ");
    }
    assert_eq!(at(Vec3::splat(1e30)), at(Vec3::splat(3.0)), "far from every node");
}

#[test]
fn kernel_maps_name_rows_that_there_are() {
    panics(|| KernelMap::gather(&[0, 99], 5), "row 99 of 5");
    panics(|| KernelMap::gather(&[0, u32::MAX], 5), "of 5 rows");
    panics(|| KernelMap::scatter(&[0, 99], 5), "row 99 of 5");
    panics(|| KernelMap::convolution(&[[7; 27]], vec![]), "row 7 of 1");
    assert_eq!(KernelMap::gather(&[4, 4, 0], 5).n_pairs(), 3);
    panics(|| KernelMap::scatter(&[3, 3], 5), "ascend");
}

#[test]
fn cells_beyond_the_cube_have_no_node_and_depths_beyond_the_octree_no_cells() {
    let octree = octree();
    assert_eq!(octree.find(4, 0, [u32::MAX, 0, 0]), None, "-1 as a coordinate");
    assert_eq!(octree.find(4, 0, [16, 0, 0]), None);
    assert_eq!(octree.locate(4, 0, Vec3::NAN), None);
    panics(|| octree.find(9, 0, [3, 400, 7]), "depth 9 of an octree of depth 4");
    panics(|| octree.find(40, 0, [3, 4, 7]), "depth 40");
    panics(|| octree.find(4, 3, [99, 4, 7]), "shape 3 of 1");
    panics(|| key::encode([1 << 16, 0, 0], 0), "below 2^16");
    panics(|| key::encode([0; 3], 1 << 16), "below 2^16");
}

#[test]
fn errors_of_arguments_name_them() {
    let error = weld::weld(&cube(), f64::NAN).unwrap_err();
    assert!(matches!(error, Error::Argument { name: "weld", .. }));
}

#[test]
fn solids_have_lengths_corners_and_quads() {
    for size in [DVec3::ZERO, DVec3::splat(-1.0), DVec3::NAN, dvec3(1.0, f64::INFINITY, 1.0)] {
        panics(|| solids::cuboid(size), "a box of size [");
    }
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(DVec2::from_array);
    panics(|| solids::prism(&corners[..2], &[], 1.0), "an outline of [");
    panics(|| solids::prism(&corners, &[[0, 1, 9]], 1.0), "corner Some(9) of an outline of 3");
    panics(|| solids::prism(&corners, &[[0, 1, 2]], f64::NAN), "a prism NaN mm high");
    for radii in [[f64::INFINITY, 15.0], [40.0, 0.0], [-40.0, 5.0], [f64::NAN, 5.0]] {
        panics(|| solids::torus(radii[0], radii[1], 9, 9), "a torus with the radii ");
    }
    for [around, across] in [[2, 9], [9, 0], [u32::MAX, 3], [100_000, 100_000]] {
        panics(|| solids::torus(40.0, 5.0, around, across), "quads");
    }
}

#[test]
fn tools_stick_out_and_leave_stock_by_lengths() {
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.5 };
    let (body, holder) = ([Section::cylinder(20.0, 3.0)], [Section::cylinder(30.0, 20.0)]);
    let tool = Assembly::new(tip, &body, &holder, 40.0).unwrap();
    for stick_out in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
        refused(tool.at_stick_out(stick_out), &["stick-out is ", "a positive length"]);
    }
    let rough = cutter().with_allowance(6e3).unwrap();
    refused(rough.with_allowance(6e3), &["allowance is 12000"]);
    assert!(Profile::lollipop(5.0, 2.0).unwrap().radius_at(f64::NAN).is_nan());
    for angle in [f64::NAN, -1.0, 2.0] {
        refused(Profile::dovetail(5.0, angle, 3.0, 2.0), &["angle of the flank is ", "1.5708 rad"]);
    }
}

#[test]
fn steps_and_rates_of_training_are_in_their_domain() {
    let step = |lr: f64, sgd: Sgd| sgd.step(lr, &mut [1.0], &mut [0.0], &mut [1.0]);
    panics(|| step(f64::NAN, Sgd::new(0.9, 0.0)), "the rate is NaN");
    panics(|| step(-0.1, Sgd::new(0.9, 0.0)), "the rate is -0.1");
    panics(|| step(0.1, Sgd::new(0.9, f64::INFINITY)), "the weight decay is inf");
    panics(|| step(0.1, Sgd::new(1.0, 0.0)), "the momentum is 1");
    panics(|| Schedule::Poly { power: f64::NAN }.lr(0.1, 3, 10), "out of its domain");
    panics(|| Schedule::Constant.lr(f64::NAN, 3, 10), "the base rate is NaN");
    let entropy = CrossEntropy::binary();
    let loss = entropy.try_loss(&[0.1, 0.2], &[1_u8], f64::NAN, &mut Vec::new());
    refused(loss, &["scale is NaN", "finite"]);
}

#[test]
fn random_ranges_shares_and_clips_are_numbers() {
    let stream = || Stream::new(1, 0, 0, Purpose::Probe);
    panics(|| stream().log_range(-1.0, 2.0), "a logarithmic range from -1 to 2");
    panics(|| stream().range(0.0, f64::INFINITY), "a range from 0 to inf");
    for share in [f64::NAN, -0.5, 1.5] {
        panics(|| Rounding::Ceil.n_of_share(share, 10), "a share of ");
    }
    for limit in [f32::NAN, -1.0, 0.0] {
        let mut preparation = Preparation::default();
        preparation.clip = Some(limit);
        refused(preparation.prepare(&[Vec3::ZERO, Vec3::X]), &["clip is ", "above 0"]);
    }
}

#[test]
fn tensors_can_be_counted_and_start_at_numbers() {
    let param = |shape: &[usize], init| Layout::default().param("a", shape, init);
    panics(|| param(&[usize::MAX, 2], Init::Constant(0.0)), "a: a tensor of shape [");
    panics(|| param(&[usize::MAX], Init::Constant(0.0)), "a: a tensor of shape [");
    panics(|| param(&[2], Init::Constant(f64::NAN)), "a: a tensor that starts at NaN");
    panics(|| param(&[2], Init::Uniform { bound: f64::INFINITY }), "starts at inf");
    for n in [0, usize::MAX, 1 << 33] {
        refused(
            UNet::with_heads(&UNetConfig::tiny(), &[2, n]),
            &["n_classes is [2, ", "1 to 1048576"],
        );
    }
}
