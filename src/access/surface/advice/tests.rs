use super::*;
use crate::geom::Mesh;
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::solids::prism;
use glam::{DVec2, dvec2};

/// A block 60 × 40 mm with a groove along y, of which `floor` is the outline from wall to wall, left to right.
fn grooved(floor: &[DVec2], top: f64) -> Mesh {
    let (left, right) = (floor[0], floor[floor.len() - 1]);
    let mut outline = vec![dvec2(0.0, 0.0), dvec2(60.0, 0.0), dvec2(60.0, top), right];
    outline.extend(floor[1..floor.len() - 1].iter().rev());
    outline.extend([left, dvec2(0.0, top)]);
    let mut mesh = prism(&outline, &cap(&outline), 40.0);
    // The outline is in x and z.
    mesh.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, 40.0 - v.z, v.y));
    mesh
}

/// Triangles of a simple outline that turns left, by cutting off ears.
fn cap(outline: &[DVec2]) -> Vec<[u32; 3]> {
    let mut left: Vec<u32> = (0..outline.len() as u32).collect();
    let mut all = Vec::new();
    let turn = |a: u32, b: u32, c: u32| {
        let [a, b, c] = [a, b, c].map(|k| outline[k as usize]);
        (b - a).perp_dot(c - b)
    };
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|&k| {
            let [a, b, c] = [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
            let is_in = |&p: &u32| {
                ![a, b, c].contains(&p)
                    && [(a, b), (b, c), (c, a)].iter().all(|&(x, y)| turn(x, y, p) >= 0.0)
            };
            turn(a, b, c) > 1e-9 && !left.iter().any(is_in)
        });
        let k = ear.expect("a simple outline that turns left");
        all.push([left[(k + n - 1) % n], left[k], left[(k + 1) % n]]);
        left.remove(k);
    }
    all.push([left[0], left[1], left[2]]);
    all
}

/// A groove with walls at x = 30 ± `half`, `depth` deep, with fillets of radius `fillet` at its floor.
fn groove(half: f64, depth: f64, fillet: f64) -> Mesh {
    let top = 20.0;
    let floor = top - depth;
    let mut outline = vec![dvec2(30.0 - half, top)];
    let arc = |k: u32, sign: f64| {
        let angle = f64::from(k) / 16.0 * std::f64::consts::FRAC_PI_2;
        let middle = dvec2(30.0 + sign * (half - fillet), floor + fillet);
        middle + dvec2(sign * libm::sin(angle), -libm::cos(angle)) * fillet
    };
    if fillet > 0.0 {
        outline.extend((0..=16).rev().map(|k| arc(k, -1.0)));
        outline.extend((0..=16).map(|k| arc(k, 1.0)));
    } else {
        outline.extend([dvec2(30.0 - half, floor), dvec2(30.0 + half, floor)]);
    }
    outline.push(dvec2(30.0 + half, top));
    grooved(&outline, top)
}

/// Advice for all that a tool does not reach from above.
fn advice(mesh: &Mesh, tool: &Assembly, n_sites: usize) -> (Vec<PartChange>, f64) {
    let sites = sample(mesh, &SiteOptions { n_sites, ..SiteOptions::default() }).unwrap();
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let (directions, options) = (Directions::up(), SurfaceOptions::default());
    let labels =
        obstacles.surface_labels(&sites, &tool.cutter().unwrap(), &directions, &options).unwrap();
    // Without the underside and the sides of the block.
    let is_inside = |i: usize| {
        let p = sites.points[i];
        (1.0..59.0).contains(&p.x) && (1.0..39.0).contains(&p.y) && p.z > 1.0
    };
    let is_left = |i: &u32| {
        let i = *i as usize;
        labels.answers[i] != SiteAnswer::Accessible && is_inside(i)
    };
    let members: Vec<u32> = (0..sites.len() as u32).filter(is_left).collect();
    let share = members.len() as f64 / sites.len() as f64;
    let of = (&sites, &members[..]);
    (obstacles.part_changes(of, (tool, 0.0), &directions, &options).unwrap(), share)
}

fn tool(radius_mm: f64, corner_mm: f64, stick_out_mm: f64) -> Assembly {
    use crate::tool::cutter::{Section, TipShape};
    let tip = TipShape::Straight { radius_mm, corner_mm };
    let body = [Section::cylinder(80.0, radius_mm)];
    Assembly::new(tip, &body, &[Section::cylinder(30.0, 15.0)], stick_out_mm).unwrap()
}

#[test]
fn a_sharp_corner_at_a_floor_needs_the_radius_of_the_ball() {
    let (found, share) = advice(&groove(10.0, 10.0, 0.0), &tool(3.0, 3.0, 40.0), 3000);
    assert!(share > 0.03, "{share}");
    let [one] = &found[..] else { panic!("{found:?}") };
    assert_eq!((one.kind, one.from_mm, one.to_mm), (PartLength::CornerRadius, 0.0, 3.0));
    assert!(one.share > 0.95, "{one:?}");
    assert!(one.depth_mm.is_none() && one.at_mm.z < 13.1);
}

#[test]
fn a_bull_nose_needs_its_corner_at_the_floor_and_a_flat_end_nothing() {
    let (found, _) = advice(&groove(10.0, 10.0, 0.0), &tool(3.0, 1.0, 40.0), 6000);
    let [one] = &found[..] else { panic!("{found:?}") };
    assert_eq!((one.kind, one.from_mm, one.to_mm), (PartLength::CornerRadius, 0.0, 1.0));
    assert!(one.share > 0.9, "{one:?}");
    let (found, share) = advice(&groove(10.0, 10.0, 0.0), &tool(3.0, 0.0, 40.0), 3000);
    assert!(found.is_empty() && share == 0.0, "{found:?}");
}

#[test]
fn a_fillet_of_one_needs_two_for_a_ball_of_two() {
    let (found, share) = advice(&groove(10.0, 10.0, 1.0), &tool(2.0, 2.0, 40.0), 6000);
    assert!(share > 0.02, "{share}");
    let [one] = &found[..] else { panic!("{found:?}") };
    assert!((one.from_mm - 1.0).abs() < 0.04 && one.to_mm == 2.0, "{one:?}");
    assert!(one.share > 0.9, "{one:?}");
    let (found, share) = advice(&groove(10.0, 10.0, 2.0), &tool(2.0, 2.0, 40.0), 6000);
    assert!(found.is_empty() && share == 0.0, "its own radius: {share} {found:?}");
}

#[test]
fn a_chamfer_is_no_fillet() {
    let floor =
        [[20.0, 20.0], [20.0, 12.0], [22.0, 10.0], [38.0, 10.0], [40.0, 12.0], [40.0, 20.0]];
    let floor = floor.map(DVec2::from_array);
    let (found, _) = advice(&grooved(&floor, 20.0), &tool(5.0, 5.0, 40.0), 4000);
    assert!(found.iter().all(|one| one.from_mm == 0.0), "{found:?}");
}

#[test]
fn a_slot_of_four_needs_six_for_a_mill_of_six() {
    let (found, share) = advice(&groove(2.0, 6.0, 0.0), &tool(3.0, 0.0, 40.0), 3000);
    assert!(share > 0.04, "{share}");
    let [one] = &found[..] else { panic!("{found:?}") };
    assert_eq!((one.kind, one.from_mm, one.to_mm), (PartLength::SlotWidth, 4.0, 6.02));
    assert!(one.depth_mm == Some(6.0) && one.share > 0.95, "{one:?}");
}

#[test]
fn what_a_holder_keeps_off_is_no_matter_of_corners() {
    // The groove is 30 deep less the floor; the holder, 15 mm in radius, is 8 mm above the tip.
    let (found, share) = advice(&groove(10.0, 18.0, 0.0), &tool(3.0, 3.0, 8.0), 3000);
    assert!(share > 0.1, "{share}");
    assert!(found.iter().all(|one| one.share < 0.1), "{found:?}");
}

/// The groove's outline as that of the block: the corners between the walls run along the direction.
#[test]
fn a_flat_end_needs_its_radius_in_upright_corners() {
    let outline = [[0, 0], [60, 0], [60, 40], [40, 40], [40, 15], [20, 15], [20, 40], [0, 40]];
    let outline = outline.map(|[x, y]| dvec2(f64::from(x), f64::from(y)));
    let mesh = prism(&outline, &cap(&outline), 20.0);
    let (found, share) = advice(&mesh, &tool(3.0, 0.0, 40.0), 4000);
    assert!(share > 0.015, "{share}");
    let [one] = &found[..] else { panic!("{found:?}") };
    assert_eq!((one.kind, one.from_mm, one.to_mm), (PartLength::CornerRadius, 0.0, 3.0));
    assert!(one.share > 0.95, "{one:?}");
}

/// A plate, and on it a rib this high.
fn ribbed(rib: f64) -> Mesh {
    let top = 10.0 + rib;
    let outline = [[0.0, 0.0], [60.0, 0.0], [60.0, 10.0], [30.0, 10.0]];
    let outline = outline.into_iter().chain([[30.0, top], [28.0, top], [28.0, 10.0], [0.0, 10.0]]);
    let outline: Vec<DVec2> = outline.map(DVec2::from_array).collect();
    let mut mesh = prism(&outline, &cap(&outline), 40.0);
    mesh.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, 40.0 - v.z, v.y));
    mesh
}

/// The holder, 15 mm in radius, is 8 mm above the tip.
#[test]
fn a_rib_in_the_way_of_the_holder_would_have_to_be_lower() {
    let (found, share) = advice(&ribbed(16.0), &tool(1.0, 0.0, 8.0), 3000);
    assert!(share > 0.1, "{share}");
    let lower = found.iter().find(|one| one.kind == PartLength::HeightInTheWay);
    let lower = lower.unwrap_or_else(|| panic!("{found:?}"));
    assert!((lower.from_mm - 8.0).abs() < 0.03, "from 16 to 8 mm above the plate: {lower:?}");
    assert!(lower.share > 0.8 && lower.at_mm.z > 25.9, "{lower:?}");
    let (_, left) = advice(&ribbed(16.0 - lower.from_mm), &tool(1.0, 0.0, 8.0), 3000);
    assert!(left < 0.01 * share, "the part so changed: {left}");
}

#[test]
fn a_part_changed_as_advised_is_reached() {
    let (found, left) = advice(&groove(3.01, 6.0, 0.0), &tool(3.0, 0.0, 40.0), 3000);
    assert!(left == 0.0 && found.is_empty(), "a slot of 6.02 mm: {left}");
    let (_, left) = advice(&groove(10.0, 10.0, 1.0), &tool(3.0, 1.0, 40.0), 3000);
    assert_eq!(left, 0.0, "fillets of the bull nose's corner");
    let (_, left) = advice(&groove(10.0, 10.0, 3.0), &tool(3.0, 3.0, 40.0), 3000);
    assert_eq!(left, 0.0, "fillets of the ball's radius");
}

/// A disc of 24 mm with a bore through it.
fn bored(radius: f64, height: f64) -> Mesh {
    const N: u32 = 48;
    let mut mesh = Mesh::default();
    for k in 0..N {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(N);
        let out = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
        // Inside and outside, below and above.
        for (r, z) in [(radius, 0.0), (12.0, 0.0), (12.0, height), (radius, height)] {
            mesh.vertices.push(DVec3::new(15.0, 15.0, z) + out * r);
        }
        for side in 0..4 {
            let [a, b] = [side, (side + 1) % 4];
            let at = |k: u32, corner: u32| 4 * (k % N) + corner;
            let [p, q, r, s] = [at(k, a), at(k + 1, a), at(k + 1, b), at(k, b)];
            mesh.triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh
}

#[test]
fn a_bore_of_four_needs_six_for_a_mill_of_six() {
    let mesh = bored(2.0, 12.0);
    assert!(mesh.volume() > 0.0, "it faces outward");
    let (found, share) = advice(&mesh, &tool(3.0, 0.0, 40.0), 3000);
    assert!(share > 0.03, "{share}");
    let one = found.iter().find(|one| one.kind == PartLength::BoreDiameter);
    let one = one.unwrap_or_else(|| panic!("{found:?}"));
    assert!((one.from_mm - 4.0).abs() < 0.02 && one.to_mm == 6.02, "{one:?}");
    assert_eq!((one.depth_mm, one.share > 0.95), (Some(12.0), true), "{one:?}");
}

#[test]
fn the_same_with_any_number_of_threads() {
    let mesh = groove(10.0, 10.0, 1.0);
    let of = |n: usize| {
        crate::exec::par::with_threads(n, || advice(&mesh, &tool(2.0, 2.0, 40.0), 3000)).unwrap()
    };
    assert_eq!(of(1), of(3));
}
