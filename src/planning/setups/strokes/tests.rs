//! Strokes, held against blocks by hand.

use super::*;
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::solids::cuboid;
use crate::planning::setups::{Carrier, Clampings, Kinematics, Machine, RotaryParams};
use glam::{Vec3, dvec3};

/// From -50 to 50, -30 to 30 and -10 to 10 mm.
fn block() -> Mesh {
    let mut part = cuboid(dvec3(100.0, 60.0, 20.0));
    let (low, high) = part.bounds().unwrap();
    part.vertices.iter_mut().for_each(|v| *v -= 0.5 * (low + high));
    part
}

fn of(axes: Vec<RotaryParams>, strokes_mm: DVec3) -> Candidates {
    let machine = Kinematics::new("mill", axes).unwrap().with_strokes_mm(strokes_mm);
    Candidates::new(&block(), Machine::Axes(machine), Clampings::Flat, 30).unwrap()
}

/// Per site, whether it is beyond the strokes for the first candidate with z' upward and the tool along `tool_axis`.
fn beyond_of(candidates: &Candidates, sites: &Sites, tool_axis: Vec3) -> Option<Vec<bool>> {
    let candidate = candidates.list().iter().find(|c| c.direction == Vec3::Z).unwrap();
    let vectors = candidates.directions().vectors();
    let k = candidate.axes.iter().position(|k| (vectors[*k as usize] - tool_axis).length() < 1e-5);
    let k = k.expect("the machine has this tool axis");
    let found = beyond(candidates, candidate, &block(), sites);
    let bits = found.get(k)?.as_ref()?;
    Some((0..sites.len()).map(|i| bits[i / 64] >> (i % 64) & 1 == 1).collect())
}

fn sites() -> Sites {
    sample(&block(), &SiteOptions::default().with_n_sites(2000)).unwrap()
}

/// Those for which a rule by hand holds; borderline sites are in neither.
fn require(found: &[bool], sites: &Sites, is_beyond_by_mm: impl Fn(Vec3) -> f32) {
    let mut counts = [0; 2];
    for (point, found) in sites.points.iter().zip(found) {
        let by = is_beyond_by_mm(*point);
        if by.abs() > 0.01 {
            assert_eq!(by > 0.0, *found, "{point}, by {by} mm");
            counts[usize::from(*found)] += 1;
        }
    }
    assert!(counts.iter().all(|n| *n > 50), "{counts:?}");
}

#[test]
fn a_part_is_turned_by_a_quarter_where_it_fits_so() {
    let sites = sites();
    let long_y = of(vec![], dvec3(80.0, 200.0, 300.0));
    let upright = long_y.list().iter().find(|c| c.direction == Vec3::Z).unwrap();
    assert_eq!(long_y.turn_of(upright)[0], DVec3::Y, "its 100 mm along y'");
    assert_eq!(beyond_of(&long_y, &sites, Vec3::Z), None);
    let long_x = of(vec![], dvec3(200.0, 80.0, 300.0));
    assert_eq!(beyond_of(&long_x, &sites, Vec3::Z), None);
    // Nothing is known: nothing is turned, nothing beyond.
    let unknown = of(vec![], DVec3::INFINITY);
    assert!(unknown.list().iter().all(|candidate| candidate.n_quarters == 0));
    assert_eq!(beyond_of(&unknown, &sites, Vec3::Z), None);
}

#[test]
fn sites_are_beyond_the_strokes_on_both_sides_of_the_middle_and_below_the_highest_place() {
    let sites = sites();
    let small = of(vec![], dvec3(80.0, 50.0, 300.0));
    let found = beyond_of(&small, &sites, Vec3::Z).unwrap();
    require(&found, &sites, |p| (p.x.abs() - 40.0).max(p.y.abs() - 25.0));
    let shallow = of(vec![], dvec3(100.0, 60.0, 15.0));
    let found = beyond_of(&shallow, &sites, Vec3::Z).unwrap();
    require(&found, &sites, |p| -5.0 - p.z);
    // As long as the part: no jump at the last bit.
    assert_eq!(beyond_of(&of(vec![], dvec3(100.0, 60.0, 20.0)), &sites, Vec3::Z), None);
    let less = of(vec![], dvec3(100.0, 60.0, 20.0 - 1e-6));
    assert!(beyond_of(&less, &sites, Vec3::Z).is_none_or(|found| !found.contains(&true)));
}

#[test]
fn a_part_is_measured_as_the_table_has_turned_it() {
    let (sites, strokes) = (sites(), dvec3(200.0, 50.0, 40.0));
    let cradle = RotaryParams::new('A', Carrier::Table, [1.0, 0.0, 0.0]);
    let cradle = || vec![cradle.clone()];
    // +y up: 100, 20 and 60 mm along x, y, z.
    let found = beyond_of(&of(cradle(), strokes), &sites, Vec3::Y).unwrap();
    require(&found, &sites, |p| -10.0 - p.y);
    // +z up: 60 mm along y.
    let found = beyond_of(&of(cradle(), strokes), &sites, Vec3::Z).unwrap();
    require(&found, &sites, |p| p.y.abs() - 25.0);
    // A head turns the tool, and the part lies as it is: 60 mm along y, and 20 along z.
    let head = || vec![RotaryParams::new('A', Carrier::Head, [1.0, 0.0, 0.0])];
    let found = beyond_of(&of(head(), strokes), &sites, Vec3::Y).unwrap();
    require(&found, &sites, |p| p.y.abs() - 25.0);
}

#[test]
fn of_two_ways_to_set_a_tool_axis_one_suffices() {
    // A about x carries C about z carries the part, so that +x up has C at 90° with A at 90°, or both at -90°; with a
    // limit one is left.
    let trunnion = |limits: Option<[f64; 2]>| {
        let c = RotaryParams::new('C', Carrier::Table, [0.0, 0.0, 1.0]);
        let a = RotaryParams::new('A', Carrier::Table, [1.0, 0.0, 0.0]);
        vec![c, RotaryParams { limits_deg: limits, ..a }]
    };
    let (sites, strokes) = (sites(), dvec3(70.0, 70.0, 90.0));
    let both = beyond_of(&of(trunnion(None), strokes), &sites, Vec3::X).unwrap();
    let one = beyond_of(&of(trunnion(Some([-120.0, 30.0])), strokes), &sites, Vec3::X).unwrap();
    require(&one, &sites, |p| -40.0 - p.x);
    assert_eq!(both, one, "both turn the same end up");
}
