use super::*;
use proptest::prelude::*;

fn all() -> Vec<Profile> {
    let more = [
        Profile::rounded_dovetail(8.0, 0.5, 30f64.to_radians(), 6.0, 3.0),
        Profile::barrel_at(6.0, 48.0, 10.0, [1.0, 0.5], 24.0),
        Profile::oval(3.0, 90.0, 1.0),
        Profile::tapered_barrel(0.0, 8.0, 500.0, 20f64.to_radians(), [4.0, 8.0]),
        Profile::tapered_barrel(2.0, 8.0, 250.0, 10f64.to_radians(), [1.0, 0.0]),
        Profile::lens(5.0, 10.0, 0.0, 20.0),
        Profile::cylinder(25.0, 1.0, 12.0),
        Profile::face_mill(25.0, 31.5, 45f64.to_radians(), [0.8, 1.0]),
        Profile::corner_rounding(2.5, 1.0, 10.0, 7.5),
        Profile::thread_mill(5.0, 3.5, 30f64.to_radians(), 0.1, 2.0, 3),
        Profile::of_rings([5.0, 4.0], 30f64.to_radians(), Crest::Round(0.2), 1.5, 2),
        Profile::saw(38.1, 3.0, [4.0, 2.0], 9.5),
        Profile::spheroid(5.0, 20.0, 3.0),
    ];
    let more = more.map(Result::unwrap);
    [
        Profile::lollipop(3.0, 1.5),
        Profile::t_slot(10.5, 9.0, 0.0, 5.0),
        Profile::t_slot(10.5, 9.0, 0.5, 5.0),
        Profile::dovetail(8.0, 30f64.to_radians(), 6.0, 3.0),
        Profile::barrel(5.0, 85.0, 1.0, 20.0),
        Profile::lens(6.0, 30.0, 1.0, 8.0),
        Profile::chamfer(0.5, 45f64.to_radians(), 5.0),
    ]
    .map(Result::unwrap)
    .into_iter()
    .chain(more)
    .collect()
}

#[test]
fn families_have_the_radii_that_they_are_named_by() {
    let at = |profile: &Profile, heights: [f64; 3]| heights.map(|h| profile.radius_at(h));
    let close = |found: [f64; 3], expected: [f64; 3]| {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9)
    };
    let [ball, slot, round, dovetail, barrel, lens, chamfer] = &all()[..7] else { panic!() };
    assert!(close(at(ball, [3.0, 1.5, 9.0]), [3.0, 6.75f64.sqrt(), 1.5]));
    assert!(close(at(slot, [0.0, 9.0, 9.1]), [10.5, 10.5, 5.0]));
    assert!(close(at(round, [0.0, 0.5, 9.1]), [10.0, 10.5, 5.0]));
    assert!(close(at(dovetail, [0.0, 3.0, 6.5]), [8.0, 8.0 - 3f64.sqrt(), 3.0]));
    let center = 0.5 * 21.0;
    assert!(close(at(barrel, [center, center, center]), [5.0; 3]));
    assert!(barrel.radius_at(20.0) < 5.0 && barrel.radius_at(30.0) == barrel.radius_at(20.0));
    assert!(close(at(lens, [8.0, 16.0, 100.0]), [6.0; 3]));
    assert!(close(at(chamfer, [0.0, 2.0, 4.5]), [0.5, 2.5, 5.0]));
    let grows = all().iter().map(Profile::only_widens).collect::<Vec<_>>();
    assert_eq!(grows[..7], [false, false, false, false, false, true, true]);
    let widening =
        [false, false, true, true, true, true, true, true, true, false, false, false, false];
    assert_eq!(grows[7..], widening);
}

#[test]
fn a_profile_is_read_as_it_is_written() {
    for profile in all() {
        assert_eq!(profile.to_string().parse::<Profile>().unwrap(), profile);
        let json = serde_json::to_string(&profile).unwrap();
        assert_eq!(serde_json::from_str::<Profile>(&json).unwrap(), profile);
    }
    let lollipop: Profile = "0:0 1.5:5.598@0:3 | 1.5:20 3:22".parse().unwrap();
    assert!((lollipop.cutting_radius_mm() - 3.0).abs() < 1e-9);
    assert_eq!(lollipop.flutes_mm(), 5.598);
}

#[test]
fn impossible_profiles_are_refused_with_the_place_and_a_remedy() {
    for (text, expected) in [
        ("", "empty"),
        ("1:1 2:2", "first point"),
        ("1:0 2:x", "2:x"),
        ("1:0 2:5 2:4", "height 4 of section 2"),
        ("1:0 -2:5", "radius -2 of section 1"),
        ("1:0 0:5", "upper end"),
        ("1:0 | 1:5", "cutting portion"),
        ("1:0 2:5 | 2:4", "height 4 of section 2"),
        ("0:0 3:3@0:4", "equal ones"),
        ("1:0 3:0@2:0", "across the axis"),
        ("1:0 nan:4", "radius NaN"),
    ] {
        let message = text.parse::<Profile>().unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
    assert!(Profile::lollipop(3.0, 3.0).is_err() && Profile::t_slot(3.0, 1.0, 0.6, 1.0).is_err());
    assert!(Profile::dovetail(3.0, 1.0, 9.0, 1.0).is_err());
    assert!(Profile::barrel(3.0, 1.0, 0.1, 5.0).is_err());
    assert!(Profile::barrel_at(6.0, 48.0, -80.0, [0.0; 2], 24.0).is_err());
    assert!(Profile::oval(3.0, 2.0, 1.0).is_err() && Profile::oval(3.0, 90.0, 3.0).is_err());
    assert!(Profile::tapered_barrel(0.0, 3.0, 9.0, 0.1, [4.0, 0.0]).is_err());
    assert!(Profile::tapered_barrel(2.0, 8.0, 60.0, 0.17, [1.0, 0.0]).is_err());
    assert!(Profile::thread_mill(5.0, 3.0, 0.5, 0.1, 0.2, 3).is_err());
    assert!(Profile::thread_mill(5.0, 3.0, 0.5, 0.0, 1.0, 0).is_err());
    assert!(Profile::corner_rounding(2.0, 0.0, 3.0, 6.0).is_err());
    assert!(Profile::saw(9.0, 1.0, [9.5, 1.0], 3.0).is_err());
    assert!(Profile::face_mill(25.0, 25.0, 0.7, [0.0; 2]).is_err());
    for bad in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        assert!(Profile::center_drill([bad, 3.0], 2.0, [2.0, 1.0]).is_err());
        assert!(Profile::center_drill([1.0, bad], 2.0, [2.0, 1.0]).is_err());
        assert!(Profile::center_drill([1.0, 3.0], bad, [2.0, 1.0]).is_err());
        assert!(Profile::center_drill([1.0, 3.0], 2.0, [bad, 1.0]).is_err());
        assert!(Profile::center_drill([1.0, 3.0], 2.0, [2.0, bad]).is_err());
        assert!(Profile::cylinder(bad, 0.0, 1.0).is_err() && Profile::oval(bad, 9.0, 1.0).is_err());
        assert!(Profile::spheroid(5.0, bad, 1.0).is_err());
        assert!(Profile::tapered_barrel(0.0, bad, 9.0, 0.1, [1.0, 1.0]).is_err());
    }
}

#[test]
fn a_held_profile_ends_in_its_holder() {
    let profile = Profile::t_slot(10.5, 9.0, 0.0, 5.0).unwrap();
    let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
    let held = profile.held(&[step(0.0, 20.0), step(30.0, f64::INFINITY)], 25.0);
    let radii = [4.0, 12.0, 24.9, 25.1, 54.0, 56.0].map(|h| held.radius_at(h));
    assert_eq!(radii, [10.5, 5.0, 5.0, 20.0, 20.0, f64::INFINITY]);
    // Clamped at its flutes.
    let short = profile.held(&[step(0.0, 4.0)], 5.0);
    assert_eq!([4.9, 5.1].map(|h| short.radius_at(h)), [10.5, 10.5]);
    let shank = [[5.0, 20.0], [8.0, 22.0]];
    let whole = profile.with_shank(&shank).unwrap();
    assert_eq!(whole.radius_at(21.0), 6.5);
    assert!(whole.sections()[2..].iter().all(|section| !section.cuts));
}

proptest! {
    #[test]
    fn steps_hold_the_profile(k in 0usize..20, height in 0.0f64..40.0) {
        let profile = &all()[k];
        let steps = crate::tool::cutter::margins::envelope(profile.steps(|_| true));
        let widest = steps.iter().filter(|step| step.height_mm <= height);
        let widest = widest.map(|step| step.radius_mm).fold(0.0, f64::max);
        prop_assert!(profile.radius_at(height) <= widest + 1e-9);
    }
}

#[test]
fn a_margin_is_about_what_does_not_cut_and_the_same_before_and_after_it_is_held() {
    use crate::tool::cutter::{Assembly, Section};
    let profile = Profile::t_slot(10.5, 9.0, 0.0, 5.0).unwrap();
    let profile = profile.with_shank(&[[5.0, 20.0], [8.0, 20.0], [8.0, 40.0]]).unwrap();
    let holder = [Section::cylinder(30.0, 20.0)];
    let tool = Assembly::from_profile(profile, &holder, 35.0).unwrap();
    let before = tool.with_clearance(1.0).unwrap().cutter().unwrap();
    let after = tool.cutter().unwrap().with_clearance(1.0).unwrap();
    let radii = |cutter: &crate::tool::cutter::Cutter| {
        let profile = cutter.profile().unwrap().clone();
        [0.0, 8.9, 9.1, 18.9, 19.1, 33.9, 34.1, 63.9, 64.1].map(|h| profile.radius_at(h))
    };
    let expected = [10.5, 10.5, 6.0, 6.0, 9.0, 9.0, 21.0, 21.0, f64::INFINITY];
    assert_eq!(radii(&before), expected);
    assert_eq!(radii(&after), expected);
    // What goes on above the last point has the margin, too.
    let bare = Profile::t_slot(10.5, 9.0, 0.0, 5.0).unwrap();
    let tool = Assembly::from_profile(bare, &holder, 35.0).unwrap();
    let before = tool.with_clearance(1.0).unwrap().cutter().unwrap();
    let after = tool.cutter().unwrap().with_clearance(1.0).unwrap();
    let expected = [10.5, 10.5, 6.0, 6.0, 6.0, 6.0, 21.0, 21.0, f64::INFINITY];
    assert_eq!([radii(&before), radii(&after)], [expected; 2]);
}

/// Radius at a height of what cuts, dilated, and of what does not: the greatest over places of both.
fn dilated_radius(profile: &Profile, by: f64, height: f64) -> f64 {
    let pieces = profile.pieces();
    let of = |cuts: bool, z: f64| {
        let over = |piece: &&Piece| {
            piece.cuts == cuts && (piece.ends[0][1]..=piece.ends[1][1]).contains(&z)
        };
        let at = |piece: &Piece| match piece.ends {
            [[r0, z0], [r1, z1]] if z0 == z1 => r0.max(r1),
            _ => piece.radius_at(z),
        };
        pieces.iter().filter(over).map(at).fold(f64::NEG_INFINITY, f64::max)
    };
    let turns = (0..=20_000).map(|k| height + by * (f64::from(k) / 1e4 - 1.0));
    let ends = pieces.iter().flat_map(|piece| piece.ends).map(|end| end[1]);
    let near = turns.chain(ends).filter(|z| (z - height).abs() <= by);
    let dilated = near.map(|z| of(true, z) + (by * by - (z - height) * (z - height)).sqrt());
    let top = pieces.last().unwrap().ends[1];
    let above = if height >= top[1] { top[0] } else { 0.0 };
    dilated.fold(of(false, height).max(above), f64::max)
}

#[test]
fn what_cuts_is_dilated_by_a_ball() {
    let shanks: [&[[f64; 2]]; 3] = [&[], &[[1.2, 26.0]], &[[1.2, 24.1], [9.0, 24.3], [9.0, 60.0]]];
    let mut n = 0;
    for (k, profile) in all().into_iter().enumerate() {
        let profile = match profile.flutes_mm() < 24.0 {
            true => profile.with_shank(shanks[k % 3]).unwrap(),
            false => profile,
        };
        for by in [0.05, 0.3, 1.0, 4.0] {
            let dilated = profile.dilated(by);
            let top = profile.flutes_mm() + by;
            let faces: Vec<f64> =
                dilated.pieces().iter().flat_map(|piece| piece.ends.map(|end| end[1])).collect();
            for i in 0..60 {
                let height = -by + (top + by + 2.0) * (f64::from(i) + 0.37) / 60.0;
                if faces.iter().any(|face| (face - height).abs() < 1e-3) {
                    continue;
                }
                let (found, expected) =
                    (dilated.radius_at(height), dilated_radius(&profile, by, height));
                assert!((found - expected).abs() < 2e-3, "{k} {by} {height}: {found} {expected}");
                n += 1;
            }
            assert_eq!(dilated.radius_at(-by - 1e-6), 0.0);
            assert!((dilated.cutting_radius_mm() - profile.cutting_radius_mm() - by).abs() < 1e-6);
            assert!((dilated.flutes_mm() - top).abs() < 1e-6, "{k} {by} {}", dilated.flutes_mm());
        }
    }
    assert!(n > 4000, "{n}");
}

#[test]
fn dilated_families_are_those_of_greater_lengths() {
    let close = |a: &Profile, b: &Profile, by: f64, top: f64| {
        for k in 1..400 {
            let height = top * f64::from(k) / 400.0;
            let radii = [a.radius_at(height - by), b.radius_at(height)];
            assert!((radii[0] - radii[1]).abs() < 1e-9, "{height}: {radii:?}");
        }
    };
    // A ball is a greater one about the same center, as far as the neck.
    let ball = Profile::lollipop(3.0, 1.5).unwrap().dilated(0.5);
    close(&ball, &Profile::lollipop(3.5, 1.5).unwrap(), 0.5, 3.5 + 3.5 * 6.75f64.sqrt() / 3.0);
    // A disc has rounded edges; both faces cut.
    let disc = Profile::t_slot(6.0, 3.0, 0.0, 2.0).unwrap().dilated(0.5);
    close(&disc, &Profile::t_slot(6.5, 4.0, 0.5, 2.0).unwrap(), 0.5, 6.0);
    let faces: Vec<bool> = disc
        .pieces()
        .iter()
        .filter(|piece| piece.ends[0][1] == piece.ends[1][1])
        .map(|piece| piece.cuts)
        .collect();
    assert_eq!(faces, [true, true]);
    let round = Profile::t_slot(6.0, 3.0, 0.4, 2.0).unwrap().dilated(0.5);
    close(&round, &Profile::t_slot(6.5, 4.0, 0.9, 2.0).unwrap(), 0.5, 6.0);
    // A drill leaves stock in its bore.
    let drill = Profile::drill(2.5, 2.0, 30.0).unwrap().dilated(0.2);
    assert!(drill.is_drill() && (drill.radius_at(20.0) - 2.7).abs() < 1e-9);
    // The lower face of a reamer does not cut, however low it is.
    let reamer = Profile::reamer(3.0, 0.0, 30.0).unwrap().dilated(0.2);
    assert!(!reamer.pieces()[0].cuts && reamer.pieces()[0].ends == [[0.0, -0.2], [3.0, -0.2]]);
    // In a holder that begins where the flutes end.
    let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
    let tool = Profile::t_slot(6.0, 3.0, 0.0, 2.0).unwrap();
    let held = tool.held(&[step(0.0, 20.0), step(5.0, f64::INFINITY)], 3.2).dilated(1.0);
    let radii = [2.9, 3.1, 3.9, 8.1, 8.3].map(|height| held.radius_at(height));
    assert_eq!(radii[2..], [20.0, 20.0, f64::INFINITY]);
    assert!((radii[0] - 7.0).abs() < 1e-9 && radii[1] > 6.9 && radii[1] < 7.0);
}
