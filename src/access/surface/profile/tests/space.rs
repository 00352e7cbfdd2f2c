//! Points of the space around a part.

use super::search::{Searched, groove, held_against_dense};
use super::*;
use crate::access::surface::profile::Frame;
use crate::access::surface::tool::Contact;
use crate::tool::cutter::TipShape;

/// Points of a lattice with this step in a box.
fn lattice(low: [f32; 3], high: [f32; 3], step: f32) -> Vec<Vec3> {
    let n = |axis: usize| ((high[axis] - low[axis]) / step) as u32;
    let [nx, ny, nz] = [0, 1, 2].map(n);
    let all = (0..=nz).flat_map(|k| (0..=ny).flat_map(move |j| (0..=nx).map(move |i| [i, j, k])));
    all.map(|at| Vec3::from(low) + step * Vec3::from(at.map(|k| k as f32))).collect()
}

fn held(profile: Profile, stick_out: f64) -> crate::tool::cutter::Cutter {
    let holder = [Section::cylinder(30.0, 20.0)];
    Assembly::from_profile(profile, &holder, stick_out).unwrap().cutter().unwrap()
}

fn answers(mesh: &Mesh, points: &[Vec3], profile: Profile) -> SurfaceLabels {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let (up, options) = (Directions::up(), SurfaceOptions::default());
    obstacles.surface_labels(Queries::Volume(points), &held(profile, 60.0), &up, &options).unwrap()
}

#[test]
fn a_t_slot_is_emptied_by_its_cutter_and_by_no_other() {
    let mesh = t_slot();
    // Below the lips, where no cutter that stands before an end of the slot comes to.
    let below = |p: &Vec3| p.x.abs() > 5.6;
    let slot = lattice([-10.5, -28.0, 19.05], [10.5, -12.0, 27.9], 1.3);
    let undercut: Vec<Vec3> = slot.iter().copied().filter(below).collect();
    let middle: Vec<Vec3> = slot.iter().copied().filter(|p| p.x.abs() < 4.9).collect();
    assert!(undercut.len() > 300 && middle.len() > 300);
    let of = |points: &[Vec3], profile: &str| answers(&mesh, points, profile.parse().unwrap());
    let right = of(&undercut, "10.5:0 10.5:8.9 5:8.9 | 5:60");
    assert_eq!(share(&right), 1.0);
    assert_eq!(right.evidence.witness.len(), undercut.len());
    assert!(right.evidence.retreat_unproven.iter().all(|unproven| !unproven));
    // Too high by 0.2 mm; with a neck that does not fit between the lips; an end mill.
    for wrong in ["10.5:0 10.5:9.2 5:9.2 | 5:60", "10.5:0 10.5:8.9 5.6:8.9 | 5.6:60"] {
        assert_eq!(share(&of(&undercut, wrong)), 0.0, "{wrong}");
        assert_eq!(share(&of(&middle, wrong)), 0.0, "{wrong}");
    }
    assert_eq!(share(&of(&undercut, "5:0 5:30 | 5:60")), 0.0);
    assert_eq!(share(&of(&middle, "5:0 5:30 | 5:60")), 1.0);
    // Above the part everything is.
    let above = lattice([-30.0, -40.0, 40.5], [30.0, 0.0, 60.0], 6.0);
    assert_eq!(share(&of(&above, "10.5:0 10.5:8.9 5:8.9 | 5:60")), 1.0);
}

#[test]
fn a_slot_without_a_way_out_is_not_emptied() {
    let mesh = closed_t_slot();
    let points = lattice([-10.0, -27.0, 19.5], [10.0, -13.0, 27.5], 2.0);
    let labels = answers(&mesh, &points, Profile::t_slot(10.5, 8.9, 0.0, 5.0).unwrap());
    assert_eq!(share(&labels), 0.0);
    assert!(labels.evidence.retreat_unproven.iter().all(|unproven| *unproven));
    assert!(labels.answers.iter().all(|answer| *answer == SiteAnswer::Inaccessible));
}

#[test]
fn a_tip_that_is_too_wide_does_not_fit_and_a_holder_collides() {
    // A slot 6 mm wide, 40 mm deep.
    let half = [[13.0, -40.0], [13.0, 15.0], [3.0, 15.0], [3.0, -25.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<[f64; 2]> = half.iter().copied().chain(other).collect();
    let mesh = drawn_along_y(&outline, 40.0);
    let points = lattice([-1.0, -21.0, -10.0], [1.0, -19.0, 10.0], 1.0);
    let wide: Profile = "0:0 4:4@0:4 | 1:4 1:60".parse().unwrap();
    let labels = answers(&mesh, &points, wide);
    assert!(labels.answers.iter().all(|answer| *answer == SiteAnswer::TipDoesNotFit));
    let labels = answers(&mesh, &points, "0:0 2:2@0:2 2:8 | 4:8 4:60".parse().unwrap());
    for (point, answer) in points.iter().zip(&labels.answers) {
        // What cuts ends at 8 mm, the slot at z = 15.
        let expected = match point.z >= 7.0 {
            true => SiteAnswer::Accessible,
            false => SiteAnswer::Inaccessible,
        };
        assert_eq!(*answer, expected, "{point}");
    }
}

#[test]
fn few_points_are_missed_that_some_pose_removes() {
    let directions = [[0.0, 0.0, 1.0], [0.5, 0.2, 0.8], [-0.9, 0.1, 0.2]];
    let frames: Vec<Frame> = directions.map(|d| Frame::along(Vec3::from(d).normalize())).into();
    let (mut n_removed, mut n_missed) = (0, 0);
    for mesh in [t_slot(), groove()] {
        let part = Searched::of(&mesh);
        let sites = sites_on(&mesh, 2, |_, _| true);
        let every = sites.len().div_ceil(60);
        for profile in [
            Profile::lollipop(3.0, 1.5),
            Profile::t_slot(4.0, 2.0, 0.3, 2.0),
            Profile::dovetail(4.5, 30f64.to_radians(), 3.0, 2.0),
            Profile::barrel(3.0, 40.0, 0.5, 8.0),
        ] {
            let cutter = held(profile.unwrap(), 60.0);
            let (tool, contacts) = part.tool(&cutter);
            for i in (0..sites.len()).step_by(every) {
                // Near the surface, as far as a millimeter off.
                let off = [0.02, 0.2, 1.0][i % 3] * sites.normals[i].as_dvec3();
                let contact = Contact { point: sites.points[i].as_dvec3() + off, normal: None };
                let [removed, missed] = held_against_dense((&tool, &contacts), &contact, &frames);
                n_removed += usize::from(removed);
                n_missed += usize::from(missed);
            }
        }
    }
    assert!(n_removed > 150 && n_missed * 50 <= n_removed, "{n_missed} of {n_removed}");
}

#[test]
fn a_profile_that_only_widens_removes_what_its_lengths_do() {
    let mesh = groove();
    let outside = |p: &Vec3| {
        let (radius, z) = (p.truncate().length(), p.z);
        let bore =
            if (9.0..17.0).contains(&z) { 4.9 + (4.0 - (z - 13.0).abs()).min(2.4) } else { 4.9 };
        radius > 14.1 || radius < bore || !(-0.1..=24.1).contains(&z)
    };
    let points = lattice([-17.0, -17.0, -2.0], [17.0, 17.0, 27.0], 2.3);
    let points: Vec<Vec3> = points.into_iter().filter(outside).collect();
    let directions = Directions::fibonacci_hemisphere(16).unwrap();
    let options = SurfaceOptions::default().with_refinement(None);
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let holder = [Section::cylinder(10.0, 8.0)];
    let mut n_accessible = 0;
    for (radius, corner) in [(2.0, 2.0), (2.0, 0.0), (4.0, 1.0)] {
        let flat = radius - corner;
        let round = if corner > 0.0 {
            format!("{radius}:{corner}@{flat}:{corner} ")
        } else {
            String::new()
        };
        let profile: Profile = format!("{flat}:0 {round}{radius}:9 | {radius}:60").parse().unwrap();
        let tip = TipShape::Straight { radius_mm: radius, corner_mm: corner };
        let body = [Section::cylinder(9.0, radius), Section::cylinder(60.0, radius)];
        let lengths = Assembly::new(tip, &body, &holder, 14.0).unwrap().with_flutes(9.0).unwrap();
        let of = [Assembly::from_profile(profile, &holder, 14.0).unwrap(), lengths];
        let [found, expected] = of.map(|tool| {
            let queries = Queries::Volume(&points);
            obstacles
                .surface_labels(queries, &tool.cutter().unwrap(), &directions, &options)
                .unwrap()
        });
        let both = found.answers.iter().zip(&expected.answers);
        let accessible = |answer: &SiteAnswer| *answer == SiteAnswer::Accessible;
        let n_other = both.filter(|(a, b)| accessible(a) != accessible(b)).count();
        n_accessible += expected.answers.iter().filter(|answer| accessible(answer)).count();
        assert!(n_other * 100 <= points.len(), "{radius} {corner}: {n_other} of {}", points.len());
    }
    assert!(n_accessible > points.len() && n_accessible < 3 * points.len());
}

/// The cap below the disc does not cut: of a slot it leaves what is below the disc.
#[test]
fn a_saw_removes_what_its_disc_cuts_and_nothing_with_its_cap() {
    let half = [[30.0, 0.0], [30.0, 40.0], [5.5, 40.0], [5.5, 28.0], [10.6, 28.0], [10.6, 19.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<[f64; 2]> = half.iter().copied().chain(other).collect();
    let mesh = drawn_along_y(&outline, 40.0);
    let saw = Profile::saw(10.5, 3.0, [4.0, 2.0], 5.0).unwrap();
    // The disc is from 2 to 5 mm above the tip, which is on the floor at 19 at the lowest.
    let points = lattice([-10.0, -28.0, 19.3], [10.0, -12.0, 27.8], 1.7);
    let labels = answers(&mesh, &points, saw.clone());
    let mut n_below = 0;
    for (point, answer) in points.iter().zip(&labels.answers) {
        let expected = point.z > 20.95;
        assert_eq!(*answer == SiteAnswer::Accessible, expected, "{point}");
        n_below += usize::from(!expected);
    }
    assert!(n_below > 100 && labels.answers.len() > 3 * n_below);
}

#[test]
fn a_drill_removes_what_is_in_it_as_it_comes_down() {
    // A block with a bore of 6 mm, 20 deep.
    let bore = revolved(&[[3.0, 10.0], [14.0, 10.0], [14.0, 30.0], [3.0, 30.0]], 60);
    let drill: Profile = "drill 0:0 2.9:1.7 2.9:12 | 2.9:60".parse().unwrap();
    let points: Vec<Vec3> = (0..40).map(|k| Vec3::new(0.4, -0.3, k as f32)).collect();
    let labels = answers(&bore, &points, drill.clone());
    assert_eq!(share(&labels), 1.0);
    let aside: Vec<Vec3> = (11..30).map(|k| Vec3::new(2.99, 0.0, k as f32)).collect();
    assert_eq!(share(&answers(&bore, &aside, drill)), 1.0);
    let wide: Profile = "drill 0:0 3.2:1.7 3.2:12 | 3.2:60".parse().unwrap();
    let inside: Vec<Vec3> = points.iter().copied().filter(|p| p.z < 27.0).collect();
    assert_eq!(share(&answers(&bore, &inside, wide)), 0.0);
}

#[test]
fn answers_of_points_depend_on_no_other_points_and_on_no_number_of_threads() {
    let mesh = t_slot();
    let points = lattice([-10.0, -28.0, 19.3], [10.0, -12.0, 45.0], 2.3);
    let tool = || Profile::t_slot(10.5, 8.9, 0.0, 5.0).unwrap();
    let all = par::with_threads(1, || answers(&mesh, &points, tool())).unwrap();
    assert!((0.1..1.0).contains(&share(&all)));
    let every: Vec<usize> = (0..points.len()).step_by(7).collect();
    let some: Vec<Vec3> = every.iter().map(|i| points[*i]).collect();
    let found = par::with_threads(3, || answers(&mesh, &some, tool())).unwrap();
    for (k, i) in every.into_iter().enumerate() {
        assert_eq!(found.answers[k], all.answers[i], "{i}");
        assert_eq!(found.evidence.witness[k], all.evidence.witness[i], "{i}");
    }
}
