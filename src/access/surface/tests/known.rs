//! What a shop knows: floors, corners, fillets and bowls, +z alone, with answers computed by hand.

use super::shapes::quartered;
use super::*;
use crate::access::Queries;
use crate::access::surface::WitnessPose;
use crate::geom::sites::{SiteOptions, sample};
use crate::tool::cutter::{Assembly, Section, TipShape};

/// A block around a hollow: closed rings of as many places each, from its bottom's rim outward, up, inward and down to
/// the floor; both ends are closed by fans about the means of their rings.
fn nested(rings: &[Vec<DVec3>]) -> Mesh {
    let n = rings[0].len() as u32;
    let mut mesh = Mesh { vertices: rings.concat(), triangles: Vec::new() };
    for ring in 1..rings.len() as u32 {
        for k in 0..n {
            let (low, high, next) = ((ring - 1) * n, ring * n, (k + 1) % n);
            mesh.triangles.push([low + k, low + next, high + next]);
            mesh.triangles.push([low + k, high + next, high + k]);
        }
    }
    let last = (rings.len() as u32 - 1) * n;
    for (start, is_floor) in [(0, false), (last, true)] {
        let ring = &mesh.vertices[start as usize..][..n as usize];
        let mean = ring.iter().sum::<DVec3>() / f64::from(n);
        let center = mesh.vertices.len() as u32;
        mesh.vertices.push(mean);
        for k in 0..n {
            let (a, b) = (start + k, start + (k + 1) % n);
            mesh.triangles.push(if is_floor { [a, b, center] } else { [b, a, center] });
        }
    }
    mesh
}

/// The places where rays from the axis through `inner` meet a square of 60 mm.
fn around(inner: &[DVec2]) -> Vec<DVec2> {
    inner.iter().map(|p| *p * (30.0 / p.abs().max_element())).collect()
}

fn at(ring: &[DVec2], z: f64) -> Vec<DVec3> {
    ring.iter().map(|p| p.extend(z)).collect()
}

/// A pocket with this outline in a block 20 high, its floor at z = 6.
fn pocket(outline: &[DVec2]) -> Mesh {
    let outer = around(outline);
    nested(&[at(&outer, 0.0), at(&outer, 20.0), at(outline, 20.0), at(outline, 6.0)])
}

/// A round hollow: radii and heights from the rim down to the floor.
fn turned(down: &[[f64; 2]], n: u32) -> Mesh {
    let ring = |radius: f64| -> Vec<DVec2> {
        let angle = |k: u32| TAU * f64::from(k) / f64::from(n);
        (0..n).map(|k| DVec2::from_angle(angle(k)) * radius).collect()
    };
    let outer = around(&ring(1.0));
    let mut rings = vec![at(&outer, -20.0), at(&outer, down[0][1])];
    rings.extend(down.iter().map(|[radius, z]| at(&ring(*radius), *z)));
    nested(&rings)
}

/// An arc of a hollow about (radius, z) = `middle`, between two angles from straight down, outermost first.
fn arc(middle: [f64; 2], radius: f64, [from, to]: [f64; 2], chord_error: f64) -> Vec<[f64; 2]> {
    let n = (f64::from(facets(radius, chord_error)) * (from - to) / TAU).ceil();
    let angle = |k: f64| from + (to - from) * k / n;
    let place = |a: f64| [middle[0] + radius * a.sin(), middle[1] - radius * a.cos()];
    (0..=n as u32).map(|k| place(angle(f64::from(k)))).collect()
}

/// A rectangle of 2 `half` with corners of a radius, counterclockwise; sharp if the radius is zero.
fn rectangle(half: DVec2, radius: f64, chord_error: f64) -> Vec<DVec2> {
    let n = if radius > 0.0 { facets(radius, chord_error).div_ceil(4) } else { 0 };
    let mut outline = Vec::new();
    for (k, corner) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].iter().enumerate() {
        let middle = dvec2(corner.0, corner.1) * (half - radius);
        for j in 0..=n {
            let angle = 0.5 * PI * (k as f64 + f64::from(j) / f64::from(n.max(1)));
            outline.push(middle + radius * DVec2::from_angle(angle));
        }
    }
    outline
}

fn share(mesh: &Mesh, sites: &Sites, cutter: &Cutter) -> f64 {
    let found = answers(mesh, sites, cutter, &up(), &implied());
    n_of(SiteAnswer::Accessible, &found) as f64 / found.len() as f64
}

/// Every `every`th site.
fn some(sites: &Sites, every: usize) -> Sites {
    sites.subset(&(0..sites.len()).step_by(every).collect::<Vec<_>>())
}

#[test]
fn the_floor_of_a_sharp_pocket_is_reached_but_for_what_a_round_tool_leaves_in_its_corners() {
    let half = dvec2(10.0, 7.0);
    let mesh = pocket(&rectangle(half, 0.0, 1.0));
    assert!(crate::geom::check::check(&mesh).is_closed());
    let (n_x, n_y) = (80, 56);
    let place = |k: usize, n: usize, half: f64| half * (2.0 * (k as f64 + 0.5) / n as f64 - 1.0);
    let grid = (0..n_x).flat_map(|i| (0..n_y).map(move |j| (i, j)));
    let points: Vec<DVec2> =
        grid.map(|(i, j)| dvec2(place(i, n_x, half.x), place(j, n_y, half.y))).collect();
    let mut floor = Sites::default();
    for p in &points {
        floor.points.push(p.extend(6.0).as_vec3());
        floor.normals.push(Vec3::Z);
    }
    for radius in [1.5, 3.0, 6.0] {
        let cutter = bull([radius, 30.0, 20.0, 5.0], 0.0);
        let found = answers(&mesh, &floor, &cutter, &up(), &implied());
        let mut n_left = 0;
        for (p, found) in points.iter().zip(&found) {
            // From the place of the tool's axis that is nearest; two tolerances are left undecided.
            let beyond = (p.abs() - (half - radius)).max(DVec2::ZERO).length() - radius;
            if beyond.abs() > 0.03 {
                assert_eq!(*found == SiteAnswer::Accessible, beyond < 0.0, "{radius}: {p}");
            }
            n_left += usize::from(*found != SiteAnswer::Accessible);
        }
        let left = n_left as f64 / points.len() as f64;
        let expected = (4.0 - PI) * radius * radius / (4.0 * half.x * half.y);
        assert!((left - expected).abs() < 0.006, "{radius}: {left}, by hand {expected}");
    }
    assert_eq!(share(&mesh, &floor, &bull([7.2, 30.0, 20.0, 5.0], 0.0)), 0.0, "wider than it");
}

#[test]
fn a_flat_end_of_the_radius_of_a_pockets_corners_reaches_all_of_them() {
    for chord_error in [0.001, 0.005, 0.05] {
        let mesh = pocket(&rectangle(dvec2(12.0, 9.0), 4.0, chord_error));
        let inside = |p: DVec3, n: DVec3| {
            let is_wall = n.z.abs() < 0.1 && n.dot(p) < 0.0;
            is_wall && p.x.abs() > 8.0 && p.y.abs() > 5.0
        };
        let corners = some(&sites_on(&mesh, 3, inside), 3);
        for radius in [3.9, 4.0] {
            let found = share(&mesh, &corners, &bull([radius, 30.0, 20.0, 5.0], 0.0));
            assert_eq!(found, 1.0, "R{radius}, chord error {chord_error}");
        }
        let wide = share(&mesh, &corners, &bull([4.4, 30.0, 20.0, 5.0], 0.0));
        assert!(wide < 0.4, "R4.4, chord error {chord_error}: {wide}");
    }
}

#[test]
fn a_ball_of_the_radius_of_a_fillet_reaches_all_of_it_and_a_wider_one_its_ends() {
    for chord_error in [0.002, 0.01, 0.05] {
        let fillet = arc([9.0, 6.0], 6.0, [0.5 * PI, 0.0], chord_error);
        let mesh = turned(&[vec![[15.0, 20.0]], fillet].concat(), facets(15.0, chord_error));
        let sites = sites_on(&mesh, 1, |p, n| n.z > 0.01 && n.z < 0.9999 && p.z < 6.0);
        let sites = some(&sites, sites.len().div_ceil(400));
        for radius in [5.0, 5.5, 6.0] {
            let found = share(&mesh, &sites, &ball([radius, 30.0, 20.0, 5.0]));
            assert_eq!(found, 1.0, "R{radius}, chord error {chord_error}");
        }
        let wide = share(&mesh, &sites, &ball([7.0, 30.0, 20.0, 5.0]));
        assert!(wide < 0.25, "R7, chord error {chord_error}: {wide}");
    }
}

#[test]
fn a_ball_of_the_radius_of_a_bowl_reaches_all_of_it_and_a_wider_one_none() {
    for chord_error in [0.004, 0.02, 0.1] {
        let step = 2.0 * (1.0 - chord_error / 15.0_f64).acos();
        let bowl = arc([0.0, 0.0], 15.0, [0.5 * PI, step], chord_error);
        let mut mesh = turned(&bowl, facets(15.0, chord_error));
        // The middle of the floor is the pole.
        mesh.vertices.last_mut().unwrap().z = -15.0;
        let sites = sites_on(&mesh, 1, |p, n| n.z > 0.0 && p.z < 0.0 && p.length() < 15.01);
        let sites = some(&sites, sites.len().div_ceil(400));
        for radius in [10.0, 12.5, 14.0, 15.0] {
            let found = share(&mesh, &sites, &ball([radius, 60.0, 20.0, 40.0]));
            assert_eq!(found, 1.0, "R{radius}, chord error {chord_error}");
        }
        // Within the tolerances of the rim it is reached.
        let low = sites_on(&mesh, 1, |p, n| n.z > 0.0 && p.z < -2.0 && p.length() < 15.01);
        let low = some(&low, low.len().div_ceil(400));
        let wide = share(&mesh, &low, &ball([15.5, 60.0, 20.0, 40.0]));
        assert_eq!(wide, 0.0, "R15.5, chord error {chord_error}");
    }
}

#[test]
fn a_ball_of_the_radius_of_a_shallow_dimple_reaches_all_of_it_however_few_its_rings() {
    for chord_error in [0.004, 0.02, 0.1] {
        let step = 2.0 * (1.0 - chord_error / 15.0_f64).acos();
        for n_rings in 2..5 {
            let angle = |k: i32| f64::from(k) * step;
            let down: Vec<[f64; 2]> = (1..=n_rings)
                .rev()
                .map(|k| [15.0 * angle(k).sin(), -15.0 * angle(k).cos()])
                .collect();
            let mut mesh = turned(&down, 20 * n_rings as u32);
            mesh.vertices.last_mut().unwrap().z = -15.0;
            let sites = sites_on(&mesh, 3, |p, n| n.z > 0.0 && p.z < down[0][1] - 1e-6);
            for radius in [12.5, 14.0, 15.0] {
                let found = share(&mesh, &sites, &ball([radius, 60.0, 20.0, 40.0]));
                assert_eq!(found, 1.0, "R{radius}, chord error {chord_error}, {n_rings} rings");
            }
        }
    }
}

/// A block with a groove along y whose section is this, from one rim to the other, the rims at z = 0.
fn grooved(section: &[[f64; 2]]) -> Mesh {
    let half = section[0][0].abs() + 20.0;
    let n = section.len() as u32;
    let mut outline = vec![[-half, -40.0], [half, -40.0], [half, 0.0]];
    outline.extend(section.iter().rev());
    outline.push([-half, 0.0]);
    let (right, left) = (2, n + 3);
    // Below the right half of the groove from one corner of the block, below the left from the other.
    let middle = 3 + n / 2;
    let mut cap = vec![[1, right, 3]];
    cap.extend((3..middle).map(|k| [1, k, k + 1]));
    cap.push([0, 1, middle]);
    cap.extend((middle..n + 2).map(|k| [0, k, k + 1]));
    cap.push([0, n + 2, left]);
    let mesh =
        solids::prism(&outline.into_iter().map(DVec2::from_array).collect::<Vec<_>>(), &cap, 30.0);
    Mesh {
        vertices: mesh.vertices.iter().map(|p| dvec3(p.x, -p.z, p.y)).collect(),
        triangles: mesh.triangles,
    }
}

#[test]
fn two_planes_that_meet_in_a_blunt_edge_are_no_curve_and_a_ball_leaves_its_gusset_there() {
    for turn_deg in [6.0, 12.0, 20.0, 30.0, 36.0, 40.0, 44.0_f64] {
        for width in [6.0, 20.0] {
            let (sin, cos) = (0.5 * turn_deg).to_radians().sin_cos();
            let section = [[-width * cos, 0.0], [0.0, -width * sin], [width * cos, 0.0]];
            let mesh = grooved(&section);
            assert!(crate::geom::check::check(&mesh).is_closed());
            for mesh in [quartered(&mesh, 1), mesh] {
                let of_groove = |p: DVec3, n: DVec3| p.z < -1e-9 && n.z > 0.5 && p.z > -width * sin;
                let sites = sites_on(&mesh, 400 / mesh.triangles.len().min(40), of_groove);
                for radius in [2.0, 5.0, 20.0] {
                    // The ball that rests on both planes touches them here; beyond the rims it does not.
                    let touches = radius * sin / cos;
                    if touches > width {
                        continue;
                    }
                    let cutter = ball([radius, 200.0, radius, 200.0]);
                    let found = answers(&mesh, &sites, &cutter, &up(), &implied());
                    for (p, answer) in sites.points.iter().zip(found) {
                        let from_edge = f64::from(p.x).abs() / cos;
                        let rest = radius.hypot((touches - from_edge).max(0.0)) - radius;
                        let is_reached = answer == SiteAnswer::Accessible;
                        let at = format!("{turn_deg}°, {width} mm, R{radius}, {from_edge}: {rest}");
                        assert!(is_reached || rest > 0.0099, "{at}");
                        assert!(!is_reached || rest < 0.0301, "{at}");
                    }
                }
            }
        }
    }
}

#[test]
fn walls_of_a_block_stay_reached_whatever_clearance_the_holder_is_given() {
    let block = solids::cuboid(dvec3(40.0, 30.0, 20.0));
    let sites = everywhere(&block, 60);
    let upward = |n: &Vec3| n.z > -0.5;
    for clearance in [0.0, 0.1, 0.5, 1.0] {
        let cutter = ball([3.0, 40.0, 25.0, 40.0]).with_clearance(clearance).unwrap();
        let found = answers(&block, &sites, &cutter, &up(), &implied());
        for (normal, found) in sites.normals.iter().zip(found) {
            assert_eq!(found == SiteAnswer::Accessible, upward(normal), "{clearance}, {normal}");
        }
    }
}

#[test]
fn a_floor_along_whose_normal_no_tool_fits_is_not_reached_however_the_part_is_turned() {
    // A round pocket of radius 4, 2 deep, and a flat end of radius 5, which is free 5 mm higher.
    let upright = turned(&[[4.0, 0.0], [4.0, -2.0]], 40);
    let cutter = Cutter::flat_end([5.0, 40.0, 30.0, 40.0].into()).unwrap();
    let options = SurfaceOptions::default().with_refinement(None).with_occlusion(false);
    let mut n_same = 0;
    for k in 0..40 {
        let turn = DQuat::from_axis_angle(dvec3(0.6, -0.8, 0.0), 0.03 * f64::from(k))
            * DQuat::from_rotation_y(0.05 * f64::from(k));
        let mut part = upright.clone();
        part.vertices.iter_mut().for_each(|v| *v = turn * *v);
        let normal = (turn * DVec3::Z).as_vec3();
        let vectors = vec![normal.as_dvec3().to_array()];
        let along = Directions::new(DirectionSet::List { vectors }).unwrap();
        n_same += usize::from(along.vectors()[0] == normal);
        let points: Vec<Vec3> =
            (0..8).map(|k| (turn * dvec3(0.4 * f64::from(k), 0.1, -2.0)).as_vec3()).collect();
        let sites = Sites { normals: vec![normal; points.len()], points, faces: vec![] };
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        let labels = obstacles.surface_labels(&sites, &cutter, &along, &options).unwrap();
        let reached = labels.evidence.witness.iter().flatten().count();
        assert_eq!(reached, 0, "{turn}: {:?}", labels.evidence.witness);
    }
    assert!(n_same > 20, "directions along normals to the last bit: {n_same} of 40");
}

/// How far a point is from the end of a bull nose in a pose, mm; negative inside.
fn away([radius, corner]: [f64; 2], point: Vec3, pose: &WitnessPose) -> f64 {
    let axis = pose.direction.as_dvec3().normalize();
    let from = point.as_dvec3() - pose.tip_mm;
    let height = from.dot(axis);
    let across = (from - axis * height).length();
    // A disc within the corner, a torus around it, a cylinder above.
    match height < corner {
        true => dvec2((across - (radius - corner)).max(0.0), height - corner).length() - corner,
        false => across - radius,
    }
}

const BULL_NOSES: [[f64; 2]; 3] = [[3.0, 0.0], [3.0, 1.0], [2.0, 2.0]];

#[test]
fn the_tool_touches_its_point_of_space_in_every_witness() {
    // Between the point and the end of the tool is the finish tolerance, and nothing else.
    let part = turned(&[[6.0, 0.0], [5.0, -4.0], [2.0, -7.0]], 24);
    let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
    let at =
        |k: i32| Vec3::new((k % 9 - 4) as f32, (k / 9 % 9 - 4) as f32, (k / 81) as f32 * 0.8 - 6.5);
    let points: Vec<Vec3> = (0..9 * 9 * 9).map(at).collect();
    let directions = Directions::fibonacci_hemisphere(40).unwrap();
    let options = SurfaceOptions::default().with_refinement(None).with_occlusion(false);
    let mut n_reached = 0;
    for end in BULL_NOSES {
        let cutter = Cutter::bull_nose([end[0], 20.0, 20.0, 30.0].into(), end[1]).unwrap();
        let labels = obstacles
            .surface_labels(Queries::Volume(&points), &cutter, &directions, &options)
            .unwrap();
        for (point, pose) in points.iter().zip(&labels.evidence.witness) {
            let Some(pose) = pose else { continue };
            let away = away(end, *point, pose);
            assert!(away < options.finish_mm + 1e-6, "{cutter}: {point} {pose:?} {away}");
            n_reached += 1;
        }
    }
    assert!(n_reached > 500, "{n_reached}");
}

#[test]
fn the_tool_touches_its_site_in_every_witness_of_labels_and_of_libraries() {
    let turn = DQuat::from_axis_angle(dvec3(0.6, -0.8, 0.0), 0.3);
    let mut part = turned(&[[6.0, 0.0], [5.0, -4.0], [2.0, -7.0]], 16);
    part.vertices.iter_mut().for_each(|v| *v = turn * *v);
    let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
    let sites = sample(&part, &SiteOptions::default().with_n_sites(600)).unwrap();
    // Along every normal, to the last bit; and an even set with the directions between.
    let mut vectors: Vec<[f64; 3]> =
        sites.normals.iter().map(|n| n.as_dvec3().to_array()).collect();
    vectors.dedup();
    let along_normals = Directions::new(DirectionSet::List { vectors }).unwrap();
    let options = SurfaceOptions::default().with_occlusion(false);
    let mut n_reached = 0;
    for directions in [along_normals, Directions::fibonacci_hemisphere(40).unwrap()] {
        for end in BULL_NOSES {
            let tip = TipShape::Straight { radius_mm: end[0], corner_mm: end[1] };
            let sections = [Section::cylinder(20.0, end[0]), Section::cylinder(30.0, 20.0)];
            let tool = Assembly::new(tip, &sections[..1], &sections[1..], 20.0).unwrap();
            let cutter = tool.cutter().unwrap();
            let labels = obstacles.surface_labels(&sites, &cutter, &directions, &options).unwrap();
            let reach = obstacles.reach_many(&sites, &[tool], &directions, &options).unwrap();
            for witness in [&labels.evidence.witness, &reach[0].witness] {
                for (i, pose) in witness.iter().enumerate() {
                    let Some(pose) = pose else { continue };
                    let away = away(end, sites.points[i], pose);
                    assert!(away < options.finish_mm + 1e-6, "{cutter}: {i} {pose:?} {away}");
                    n_reached += 1;
                }
            }
        }
    }
    assert!(n_reached > 2000, "{n_reached}");
}
