//! Tests of tools in their holders.

use super::*;
use crate::tool::cutter::CutterParams;

fn radius_at(steps: &[Step], height: f64) -> f64 {
    steps.iter().filter(|s| s.height_mm <= height).map(|s| s.radius_mm).fold(0.0, f64::max)
}

fn er20() -> Vec<Section> {
    let segment = |length_mm, lower: f64, upper: f64| Section {
        length_mm,
        lower_radius_mm: 0.5 * lower,
        upper_radius_mm: 0.5 * upper,
    };
    vec![segment(8.0, 28.0, 34.0), segment(22.0, 34.0, 34.0), segment(40.0, 34.0, 50.0)]
}

#[test]
fn a_ball_in_a_cylindrical_holder_is_the_cutter_of_four_lengths() {
    let tip = TipShape::Straight { radius_mm: 1.5, corner_mm: 1.5 };
    let body = [Section::cylinder(60.0, 1.5)];
    let assembly = Assembly::new(tip, &body, &[Section::cylinder(5.0, 40.0)], 9.0).unwrap();
    let params = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
    assert_eq!(assembly.cutter().unwrap(), Cutter::ball_end(params).unwrap());
    assert_eq!(assembly.excess_mm(), 0.0);
    assert_eq!(assembly.body_cutter().unwrap().steps().len(), 1);
}

#[test]
fn steps_enclose_the_sections_and_exceed_them_by_no_more_than_is_said() {
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 3.0 };
    let body =
        [Section::cylinder(12.0, 3.0), Section::cylinder(18.0, 2.9), Section::cylinder(50.0, 4.0)];
    let assembly = Assembly::new(tip, &body, &er20(), 45.0).unwrap();
    assert!(assembly.excess_mm() > 0.0 && assembly.excess_mm() < 0.6, "{}", assembly.excess_mm());
    assert!(assembly.cutter().unwrap().steps().len() <= 30);
    let true_radius = |mut z: f64| {
        for Section { length_mm, lower_radius_mm, upper_radius_mm } in er20() {
            if z < length_mm {
                return lower_radius_mm + z / length_mm * (upper_radius_mm - lower_radius_mm);
            }
            z -= length_mm;
        }
        f64::INFINITY
    };
    for k in 0..1400 {
        let z = 0.05 * f64::from(k);
        let (found, least) = (radius_at(assembly.holder(), z), true_radius(z));
        assert!(
            found >= least - 1e-12 && found - least <= assembly.excess_mm() + 1e-9
                || found == least,
            "{z}: {found} {least}"
        );
    }
    // The neck counts as wide as the flutes below it.
    assert_eq!(
        assembly.body().iter().map(|s| (s.height_mm, s.radius_mm)).collect::<Vec<_>>(),
        [(6.0, 3.0), (30.0, 4.0)]
    );
}

#[test]
fn a_tapered_ball_is_tangent_to_its_cone_and_enclosed() {
    let taper = 3f64.to_radians();
    let tip =
        TipShape::Tapered { radius_mm: 0.5, corner_mm: 0.5, taper_rad: taper, flutes_mm: 20.0 };
    let shank = [Section::cylinder(55.0, 3.0)];
    let assembly = Assembly::new(tip, &shank, &er20(), 40.0).unwrap();
    assert_eq!(assembly.tip(), [0.5, 0.0]);
    for k in 0..200 {
        let z = 0.5 + 0.0975 * f64::from(k);
        let cone = 0.5 / taper.cos() + (z - 0.5) * taper.tan();
        let found = radius_at(assembly.body(), z);
        assert!(found >= cone - 1e-12 && found <= cone + assembly.excess_mm() + 1e-12, "{z}");
    }
    assert_eq!(radius_at(assembly.body(), 20.1), 3.0);
}

#[test]
fn a_tapered_bull_nose_touches_with_a_corner_tangent_to_disc_and_cone() {
    let taper = 10f64.to_radians();
    let tip =
        TipShape::Tapered { radius_mm: 2.0, corner_mm: 0.5, taper_rad: taper, flutes_mm: 9.0 };
    let assembly = Assembly::new(tip, &[], &er20(), 40.0).unwrap();
    let [corner, side] = assembly.tip();
    // Distance of the corner's center from the flank is its radius.
    let distance = (2.0 + corner * taper.tan() - side) * taper.cos();
    assert!((distance - corner).abs() < 1e-12, "{distance}");
    let flat =
        TipShape::Tapered { radius_mm: 2.0, corner_mm: 0.0, taper_rad: taper, flutes_mm: 9.0 };
    assert_eq!(Assembly::new(flat, &[], &er20(), 40.0).unwrap().tip(), [0.0, 2.0]);
}

#[test]
fn impossible_tools_are_refused() {
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 3.0 };
    let body = [Section::cylinder(12.0, 3.0)];
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e5] {
        assert!(Assembly::new(tip, &body, &er20(), bad).is_err());
        assert!(Assembly::new(tip, &[Section::cylinder(bad, 3.0)], &er20(), 40.0).is_err());
        assert!(Assembly::new(tip, &body, &[Section::cylinder(3.0, bad)], 40.0).is_err());
        let tapered = |radius_mm, taper_rad, flutes_mm| TipShape::Tapered {
            radius_mm,
            corner_mm: 0.0,
            taper_rad,
            flutes_mm,
        };
        for tip in [tapered(bad, 0.1, 9.0), tapered(1.0, bad, 9.0), tapered(1.0, 0.1, bad)] {
            assert!(Assembly::new(tip, &[], &er20(), 40.0).is_err(), "{tip:?}");
        }
    }
    assert!(Assembly::new(tip, &body, &[], 40.0).is_err());
    assert!(
        Assembly::new(TipShape::Straight { radius_mm: 1.0, corner_mm: 1.1 }, &body, &er20(), 9.0)
            .is_err()
    );
}

#[test]
fn no_tool_sticks_out_further_than_it_is_long() {
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
    let tool = Assembly::new(tip, &[Section::cylinder(60.0, 3.0)], &er20(), 40.0).unwrap();
    assert_eq!((tool.overall_mm(), tool.most_stick_out_mm()), (None, f64::INFINITY));
    assert!(tool.raised(ToolPart::Holder, 500.0).is_ok(), "no one said how long it is");
    let error = tool.clone().with_overall(39.0).unwrap_err().to_string();
    assert!(error.contains("stick-out is 40") && error.contains("39 mm; "), "{error}");
    let tool = tool.with_overall(57.0).unwrap();
    assert_eq!(tool.raised(ToolPart::Holder, 17.0).unwrap().stick_out_mm(), 57.0);
    let error = tool.raised(ToolPart::Holder, 17.1).unwrap_err().to_string();
    assert!(error.contains("overall length of 57 mm"), "{error}");
    assert_eq!(tool.with_clearance(0.2).unwrap().overall_mm(), Some(57.0));
    assert!(tool.with_overall(f64::NAN).is_err());
}

#[test]
fn flutes_end_where_it_is_said_and_a_relieved_neck_keeps_its_width() {
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
    let neck =
        [Section::cylinder(12.0, 3.0), Section::cylinder(18.0, 2.5), Section::cylinder(50.0, 2.75)];
    let relieved = Assembly::new(tip, &neck, &er20(), 45.0).unwrap().with_flutes(12.0).unwrap();
    let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
    assert_eq!(relieved.neck_and_shank(), [step(12.0, 2.5), step(30.0, 2.75)]);
    assert_eq!((relieved.flutes_mm(), relieved.body()), (12.0, &[step(6.0, 3.0)][..]));
    // With 0.4 mm around them, neck and shank are still 0.1 mm within the flutes, and 0.15 mm without.
    let held = relieved.with_clearance(0.4).unwrap();
    assert_eq!(held.body(), [step(6.0, 3.0), step(29.6, 3.15)]);
    let plain = Assembly::new(tip, &[Section::cylinder(60.0, 3.0)], &er20(), 45.0).unwrap();
    assert_eq!(plain.flutes_mm(), f64::INFINITY);
    assert_eq!(plain.with_clearance(0.4).unwrap().body(), [step(6.0, 3.0)]);
    let short = plain.with_flutes(9.0).unwrap();
    assert_eq!(short.neck_and_shank(), [step(9.0, 3.0)]);
    assert_eq!(short.with_clearance(0.5).unwrap().body(), [step(6.0, 3.0), step(8.5, 3.5)]);
    // Within the height up to which there is contact, the shank counts from the end of the flutes on.
    assert_eq!(short.clone().with_flutes(2.0).unwrap().body(), [step(2.0, 3.0)]);
    assert!(short.with_flutes(-1.0).is_err());
}

#[test]
fn a_longer_stick_out_only_raises_the_holder() {
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
    let assembly = Assembly::new(tip, &[Section::cylinder(60.0, 3.0)], &er20(), 4.0).unwrap();
    let (short, long) = (assembly.cutter().unwrap(), assembly.at_stick_out(30.0).unwrap());
    for k in 0..200 {
        let z = 0.5 * f64::from(k);
        assert!(radius_at(short.steps(), z) >= radius_at(long.steps(), z));
    }
    // The nose is below the height at which the body begins to count.
    assert_eq!(short.steps()[0].height_mm, 4.0);
}
