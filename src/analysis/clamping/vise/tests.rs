//! Grips of a vise, against areas computed by hand.

use super::*;
use crate::geom::solids::{cuboid, prism};
use glam::DVec2;

const SIDES: [Vec3; 4] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y];

fn vise(lengths: [f64; 3]) -> Vise {
    Vise::new(lengths, 0.0).unwrap()
}

#[test]
fn a_block_is_gripped_by_both_pairs_of_sides_with_the_area_under_the_jaws() {
    let block = cuboid(dvec3(60.0, 40.0, 20.0));
    let both = vise([100.0, 60.0, 8.0]).grips(&block, Vec3::Z, &SIDES);
    let openings: Vec<f64> = both.list.iter().map(|grip| grip.opening_mm).collect();
    assert_eq!(openings, [60.0, 40.0]);
    // 40 × 8 and 60 × 8, on two sides.
    let areas: Vec<f64> = both.list.iter().map(|grip| grip.under_jaws_mm2).collect();
    assert!((areas[0] - 640.0).abs() < 1e-9 && (areas[1] - 960.0).abs() < 1e-9, "{areas:?}");
    // Narrow jaws are at the middle of the side: 24 × 8, on two sides.
    let narrow = vise([24.0, 40.0, 8.0]).grips(&block, Vec3::Z, &SIDES);
    assert_eq!((narrow.list.len(), narrow.too_wide_mm), (1, Some(60.0)));
    assert!((narrow.list[0].under_jaws_mm2 - 384.0).abs() < 1e-9);
    let (low, high) = narrow.list[0].body.bounds().unwrap();
    assert!((low - dvec3(18.0, -12.0, -12.0)).length() < 1e-9, "{low}");
    assert!((high - dvec3(42.0, 52.0, 8.0)).length() < 1e-9, "{high}");
    // Two jaws of 24 × 12 × 8, a bed of 24 × 64 × 12.
    assert!((narrow.list[0].body.volume() - (2.0 * 2304.0 + 18432.0)).abs() < 1e-6);
    let none = vise([24.0, 39.0, 8.0]).grips(&block, Vec3::Z, &SIDES);
    assert_eq!((none.list.len(), none.too_wide_mm), (0, Some(40.0)));
}

#[test]
fn parallels_lift_the_part_above_the_bed() {
    let block = cuboid(dvec3(60.0, 40.0, 20.0));
    let lifted = Vise::new([60.0, 50.0, 8.0], 25.0).unwrap();
    assert_eq!(lifted.to_string(), "60,50,8,25");
    let grips = lifted.grips(&block, Vec3::NEG_Z, &SIDES);
    // Upside down the bed is 25 above z = 20, its lower side 30 more; the jaws reach down to z = 12.
    let (low, high) = grips.list[0].body.bounds().unwrap();
    assert!((low.z - 12.0).abs() < 1e-9 && (high.z - 75.0).abs() < 1e-9, "{low} {high}");
}

/// Upright, a corner of the outline at x = 40 taken away down to `step` mm.
fn stepped(step: f64) -> Mesh {
    let outline = [[0.0, 0.0], [40.0, 0.0], [40.0, step], [30.0, step], [30.0, 20.0], [0.0, 20.0]];
    let outline = outline.map(DVec2::from_array);
    let mut part = prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 30.0);
    // y becomes z.
    part.vertices.iter_mut().for_each(|p| *p = dvec3(p.x, -p.z, p.y));
    part
}

#[test]
fn the_faces_gripped_are_the_outermost_below_the_top_of_the_jaws() {
    // The step is 5 high: the jaws are 4 high there, 30 wide, on both sides.
    let part = stepped(5.0);
    let low = vise([50.0, 50.0, 19.0]).grips(&part, Vec3::Z, &[Vec3::X]);
    let [grip] = &low.list[..] else { panic!("{low:?}") };
    assert!((grip.opening_mm - 40.0).abs() < 1e-9 && (grip.height_mm - 4.0).abs() < 1e-9);
    assert!((grip.under_jaws_mm2 - 240.0).abs() < 1e-9);
    // A step of 1 is too low for jaws of 19.
    assert!(vise([50.0, 50.0, 19.0]).grips(&stepped(1.0), Vec3::Z, &[Vec3::X]).list.is_empty());
    // Upside down the step is above jaws of 15: they grip the narrow part.
    let upside_down = vise([50.0, 50.0, 15.0]).grips(&part, Vec3::NEG_Z, &[Vec3::X]);
    assert!((upside_down.list[0].opening_mm - 30.0).abs() < 1e-9);
    // Higher ones would touch the side of the step, from 15 up: they are 12 high.
    let below = vise([50.0, 50.0, 19.0]).grips(&part, Vec3::NEG_Z, &[Vec3::X]);
    assert!((below.list[0].opening_mm - 30.0).abs() < 1e-9);
    assert!((below.list[0].under_jaws_mm2 - 720.0).abs() < 1e-9, "{}", below.list[0].height_mm);
    // With a top at the step itself, which overhangs the jaw.
    let at_the_step = vise([50.0, 50.0, 15.005]).grips(&part, Vec3::NEG_Z, &[Vec3::X]);
    assert!((at_the_step.list[0].opening_mm - 30.0).abs() < 1e-9);
}

#[test]
fn faces_that_slant_or_are_not_opposite_are_not_gripped() {
    // A wedge that gets narrower upward, by 2 in 20: 5.7 degrees.
    let outline = [[0.0, 0.0], [40.0, 0.0], [38.0, 20.0], [2.0, 20.0]].map(DVec2::from_array);
    let mut wedge = prism(&outline, &[[0, 1, 2], [0, 2, 3]], 30.0);
    wedge.vertices.iter_mut().for_each(|p| *p = dvec3(p.x, -p.z, p.y));
    let normals = [Vec3::X, Vec3::Y, dvec3(20.0, 0.0, 2.0).normalize().as_vec3()];
    let grips = vise([50.0, 50.0, 8.0]).grips(&wedge, Vec3::Z, &normals);
    assert_eq!(grips.list.len(), 1);
    assert!(grips.list[0].across.dot(DVec3::Y).abs() > 0.999);
    // Seen from above a Z of two bars, which the jaws touch along 28 mm each: the lower from x = 0, the upper up to 40.
    let z = |[from, to]: [f64; 2]| {
        let corners = [[0.0, 0.0], [to, 0.0], [to, 10.0], [40.0, 10.0], [40.0, 40.0], [from, 40.0]];
        let corners = [&corners[..], &[[from, 30.0], [0.0, 30.0]]].concat();
        let outline: Vec<DVec2> = corners.into_iter().map(DVec2::from_array).collect();
        // Of either shape the part between y = 10 and 30 is a rectangle.
        let cap = [[0, 1, 2], [0, 2, 7], [7, 2, 3], [7, 3, 6], [6, 3, 4], [6, 4, 5]];
        vise([40.0, 50.0, 8.0]).grips(&prism(&outline, &cap, 20.0), Vec3::Z, &[Vec3::Y]).list
    };
    // From 6 to 34: 28 of 40 are opposite each other. From 30 to 10: nothing.
    assert_eq!((z([6.0, 34.0]).len(), z([30.0, 10.0]).len()), (1, 0));
    // From 15 to 25: 10 of 40.
    assert!(z([15.0, 25.0]).is_empty());
}

#[test]
fn lengths_out_of_their_domain_are_refused_by_name() {
    for lengths in [[0.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, f64::NAN], [1.0, 1e9, 1.0]] {
        let message = Vise::new(lengths, 0.0).unwrap_err().to_string();
        assert!(message.starts_with("vise is "), "{message}");
    }
    assert!(Vise::new([1.0; 3], -1.0).is_err() && Vise::new([1.0; 3], f64::INFINITY).is_err());
}
