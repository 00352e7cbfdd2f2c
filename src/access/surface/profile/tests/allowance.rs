//! Stock to leave, by hand.

use super::drilling::{blind_bore, drill};
use super::*;

fn labels_of(mesh: &Mesh, sites: &Sites, tool: &Assembly) -> SurfaceLabels {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let (up, options) = (Directions::up(), SurfaceOptions::default());
    obstacles.surface_labels(sites, &tool.cutter().unwrap(), &up, &options).unwrap()
}

fn held(profile: Profile) -> Assembly {
    Assembly::from_profile(profile, &[Section::cylinder(30.0, 20.0)], 60.0).unwrap()
}

fn leaving(profile: Profile, allowance: f64) -> Assembly {
    held(profile).with_allowance(allowance).unwrap()
}

#[test]
fn a_disc_that_leaves_stock_reaches_as_a_greater_one_with_rounded_edges() {
    let mesh = t_slot();
    let sites = sites_on(&mesh, 12, |p, n| undercut(p, n) || (p.y < -7.0 && p.y > -33.0));
    let rough =
        labels_of(&mesh, &sites, &leaving(Profile::t_slot(10.0, 7.9, 0.0, 5.0).unwrap(), 0.5));
    let greater = labels_of(&mesh, &sites, &held(Profile::t_slot(10.5, 8.9, 0.5, 5.0).unwrap()));
    assert_eq!(rough.answers, greater.answers);
    assert_eq!(rough.evidence.retreat_unproven, greater.evidence.retreat_unproven);
    let reached = rough.share(SiteAnswer::Accessible);
    assert!(reached > 0.1 && reached < 0.95, "{reached}");
    // The tip is that of the tool itself: 0.5 higher.
    for (own, other) in rough.evidence.witness.iter().zip(&greater.evidence.witness) {
        if let (Some(own), Some(other)) = (own, other) {
            let by = own.tip_mm - other.tip_mm;
            assert!((by - DVec3::Z * 0.5).length() < 1e-6, "{by}");
        }
    }
    // Stock of 0.6 on both faces needs 9.1 of a slot 9 high.
    let walls = sites_on(&mesh, 24, undercut);
    let none = leaving(Profile::t_slot(10.0, 7.9, 0.0, 5.0).unwrap(), 0.6);
    assert_eq!(share(&labels_of(&mesh, &walls, &none)), 0.0);
}

#[test]
fn a_ball_leaves_stock_in_a_bore_iff_it_fits_between_and_the_neck_does_not_grow() {
    // A bore of radius 4, open below.
    let mesh = revolved(&[[4.0, 0.0], [20.0, 0.0], [20.0, 30.0], [4.0, 30.0]], 96);
    let sites =
        sites_on(&mesh, 6, |p, n| p.truncate().length() < 4.1 && n.z.abs() < 0.1 && p.z > 4.0);
    // Ball and stock are 3.9 or 4.1 wide; a neck of 3.9 leaves nothing, and passes.
    let ball = |radius: f64, neck: f64| Profile::lollipop(radius, neck).unwrap();
    for (radius, neck, allowance, expected) in
        [(3.0, 2.9, 0.9, 1.0), (3.0, 2.9, 1.1, 0.0), (3.95, 3.9, 0.0, 1.0), (3.95, 3.9, 0.1, 0.0)]
    {
        let found = share(&labels_of(&mesh, &sites, &leaving(ball(radius, neck), allowance)));
        assert_eq!(found, expected, "{radius} {neck} {allowance}");
    }
}

#[test]
fn a_drill_leaves_stock_in_a_wider_bore_of_its_point() {
    let mesh = blind_bore();
    let walls = sites_on(&mesh, 6, |p, n| p.truncate().length() < 2.6 && n.z.abs() < 0.1);
    let of = |radius: f64, allowance: f64| {
        share(&labels_of(&mesh, &walls, &leaving(drill(radius, 118.0), allowance)))
    };
    assert_eq!([of(2.3, 0.2), of(2.5, 0.0)], [1.0, 1.0]);
    assert_eq!([of(2.3, 0.0), of(2.3, 0.1), of(2.5, 0.2)], [0.0; 3]);
}

#[test]
fn clearance_and_allowance_of_a_profile_are_of_different_parts() {
    // A relieved neck with a margin of 0.4 is thinner than the flutes, whatever they leave.
    let profile: Profile = "3:0 3:6 2.5:6 | 2.5:40".parse().unwrap();
    let both = held(profile.clone()).with_allowance(0.3).unwrap().with_clearance(0.4).unwrap();
    let other = held(profile).with_clearance(0.4).unwrap().with_allowance(0.3).unwrap();
    assert_eq!(both.cutter().unwrap(), other.cutter().unwrap());
    let cutter = both.cutter().unwrap();
    let radii = [-0.29, 3.0, 6.2, 6.4, 30.0].map(|z| cutter.profile().unwrap().radius_at(z));
    assert!((radii[0] - 3.0).abs() < 0.1 && (radii[1] - 3.3).abs() < 1e-9);
    assert!(radii[2] > 3.0 && radii[3..] == [2.9, 2.9], "{radii:?}");
    assert_eq!((cutter.allowance_mm(), both.allowance_mm()), (0.3, 0.3));
}
