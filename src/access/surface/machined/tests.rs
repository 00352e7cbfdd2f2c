use super::super::profile::Frame;
use super::super::tests::slotted;
use super::super::tool::{Outline, axes};
use super::super::{SurfaceOptions, TriangleObstacles};
use super::footprint::{Cutting, Footprint};
use super::heights::{Buffers, EMPTY, Heights};
use super::pose::{Dropped, Line, Recent};
use super::swept::Swept;
use super::view::View;
use super::*;
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::{Mesh, Sites, check, solids};
use crate::tool::cutter::{Cutter, CutterParams, Step};
use crate::tool::directions::Directions;
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::PI;

mod profiles;

/// A block 40 × 30 × 20 with a pocket 20 × 14, 10 deep, from above: its floor is about (20, 15, 10).
fn pocket() -> Mesh {
    let mut mesh = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
    let mut hole = solids::cuboid(DVec3::new(20.0, 14.0, 10.0));
    hole.vertices.iter_mut().for_each(|v| *v += DVec3::new(10.0, 8.0, 10.0));
    // Corners 4 to 7 of each are the upper ones; between the two squares is a frame of eight triangles.
    let is_top = |t: &[u32; 3]| t.iter().all(|v| *v >= 4);
    mesh.triangles.retain(|t| !is_top(t));
    mesh.vertices.extend(&hole.vertices);
    let inward =
        hole.triangles.iter().filter(|t| !is_top(t)).map(|t| [t[0] + 8, t[2] + 8, t[1] + 8]);
    mesh.triangles.extend(inward);
    for k in 0..4 {
        let ([a, b], [c, d]) = ([4 + k, 4 + (k + 1) % 4], [12 + k, 12 + (k + 1) % 4]);
        mesh.triangles.extend([[a, b, d], [a, d, c]]);
    }
    mesh
}

fn sites(at: &[(DVec3, DVec3)]) -> Sites {
    Sites {
        points: at.iter().map(|(p, _)| p.as_vec3()).collect(),
        normals: at.iter().map(|(_, n)| n.as_vec3()).collect(),
        ..Sites::default()
    }
}

fn rests(mesh: &Mesh, at: &[(DVec3, DVec3)], cutter: &Cutter, directions: &Directions) -> Vec<f64> {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let which: Vec<usize> = (0..at.len()).collect();
    let options = SurfaceOptions::default();
    let found = obstacles.rests((&sites(at), &which), cutter, directions, &options).unwrap();
    found.0.into_iter().map(f64::from).collect()
}

#[test]
fn the_pocket_is_a_closed_solid() {
    let mesh = pocket();
    check::require_labelable(&mesh).unwrap();
    assert!((mesh.volume() - (24000.0 - 2800.0)).abs() < 1e-9);
}

/// A ball of radius R leaves in a corner of two walls what its circle does not reach.
#[test]
fn a_ball_leaves_in_corners_what_its_circle_does_not_reach() {
    let mesh = pocket();
    let up = Directions::up();
    for radius in [1.0, 2.0, 3.0, 5.0] {
        let cutter: Cutter = format!("{radius},20,20,40").parse().unwrap();
        let mut at = Vec::new();
        let mut expected = Vec::new();
        for x in [0.01, 0.1, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 2.9, 4.0, 6.0] {
            // The floor, near the wall at y = 8: the ball's center is R from floor and wall.
            at.push((DVec3::new(20.0, 8.0 + x, 10.0), DVec3::Z));
            let beyond = (radius - x).max(0.0);
            expected.push(radius - (radius * radius - beyond * beyond).sqrt());
            // The wall, near the floor.
            at.push((DVec3::new(20.0, 8.0, 10.0 + x), DVec3::Y));
            let beyond: f64 = (radius - x).max(0.0);
            expected.push(radius - (radius * radius - beyond * beyond).sqrt());
        }
        let found = rests(&mesh, &at, &cutter, &up);
        for ((found, expected), at) in found.iter().zip(&expected).zip(&at) {
            // Near the wall a shift by the gouge tolerance is more along the normal.
            let most = 0.02
                + 0.015
                    * (radius
                        / 0.01f64.max((radius * radius - (radius - expected).powi(2)).sqrt()));
            let most = most.min(0.1);
            assert!((found - expected).abs() < most, "R {radius} at {at:?}: {found} {expected}");
        }
    }
}

fn machine(mesh: &Mesh, cutters: &[&Cutter], directions: &Directions, accuracy: f64) -> Machined {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let (low, high) = mesh.bounds().unwrap();
    let job = Job { part: mesh, stock_box: [low, high], stock: None, accuracy_mm: accuracy };
    let options = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
    obstacles
        .machine(&job, cutters, std::slice::from_ref(directions), &options, &mut |_, _| Ok(()))
        .unwrap()
}

fn left(machined: &Machined) -> f64 {
    machined.bodies.iter().map(|body| body.volume_mm3).sum()
}

#[test]
fn a_ball_leaves_the_volume_of_its_fillets_in_a_pocket() {
    let (mesh, r) = (pocket(), 3.0);
    let cutter: Cutter = "3,20,20,40".parse().unwrap();
    // Along the floor's edges, in the upright corners, and what a ball leaves of a cube at the floor's corners.
    let profile = (1.0 - PI / 4.0) * r * r;
    let floor = 2.0 * (20.0 - 2.0 * r + 14.0 - 2.0 * r) * profile;
    let upright = 4.0 * (10.0 - r) * profile;
    let corners = 4.0 * (r * r * r - PI * r * r * r / 6.0);
    let by_hand = floor + upright + corners;
    // Of the floor and the walls, what the fillets hide.
    let surface = 2.0 * r * (2.0 * (20.0 + 14.0 - 4.0 * r) + 4.0 * (10.0 - r)) + 12.0 * r * r;
    for accuracy in [0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15] {
        let machined = machine(&mesh, &[&cutter], &Directions::up(), accuracy);
        let most = 0.3 * accuracy * surface;
        assert!(
            (left(&machined) - by_hand).abs() < most,
            "{accuracy}: {} {by_hand}",
            left(&machined)
        );
        for body in &machined.bodies {
            check::require_labelable(&body.mesh).unwrap();
        }
    }
}

/// In an inner corner a ball leaves a layer 0.41·R thick, wherever the nodes of the lattice are.
#[test]
fn a_fillet_thicker_than_the_accuracy_is_left_wherever_the_lattice_is() {
    let cutter: Cutter = "3,20,20,40".parse().unwrap();
    let by_hand = 2.0 * (1.0 - PI / 4.0) * 9.0 * 40.0;
    for k in 0..10 {
        let shift = 0.11 * f64::from(k);
        let mesh = slotted(20.0 + 1.3 * shift, 8.0 + shift);
        for accuracy in [0.4, 0.5, 0.6] {
            let machined = machine(&mesh, &[&cutter], &Directions::up(), accuracy);
            let share = left(&machined) / by_hand;
            // Its rims are thinner than the accuracy.
            assert!((share - 1.0).abs() < 0.25, "shift {shift}, accuracy {accuracy}: {share}");
            // Along the whole corner: two bodies, and none in pieces.
            assert_eq!(machined.bodies.len(), 2, "shift {shift}, accuracy {accuracy}");
        }
    }
}

/// A wall 50 high beside a floor: a holder of radius 10, 20 above the tip, keeps a cutter of radius 3 off the lower 30
/// within 7 of the wall. What stays there keeps the holder off again.
#[test]
fn what_is_left_keeps_holders_off_too() {
    let outline =
        [[-10.0, -10.0], [40.0, -10.0], [40.0, 0.0], [0.0, 0.0], [0.0, 50.0], [-10.0, 50.0]];
    let cap = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let mut mesh = solids::prism(&outline.map(DVec2::from_array), &cap, 30.0);
    mesh.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, -v.z, v.y));
    check::require_labelable(&mesh).unwrap();
    let lengths = CutterParams::from_array([3.0, 14.0, 10.0, 200.0]);
    let cutter = Cutter::flat_end(lengths).unwrap();
    let machined = machine(&mesh, &[&cutter], &Directions::up(), 0.5);
    assert!(machined.n_rounds >= 2);
    let at_first = 30.0 * 7.0 * 30.0;
    let by_hand = at_first + 30.0 * 7.0 * 10.0;
    assert!((machined.alone_mm3[0] / at_first - 1.0).abs() < 0.03, "{:?}", machined.alone_mm3);
    assert!((left(&machined) / by_hand - 1.0).abs() < 0.03, "{} {by_hand}", left(&machined));
    // A longer tool reaches all.
    let long = Cutter::flat_end(CutterParams { ch_mm: 50.0, ..lengths }).unwrap();
    let both = machine(&mesh, &[&cutter, &long], &Directions::up(), 0.5);
    assert_eq!((both.bodies.len(), both.after_mm3[0][1], both.n_rounds), (0, 0.0, 1));
    assert!((both.alone_mm3[0] - at_first).abs() < 0.03 * at_first);
}

/// In a slot 4 wide a cutter 6 wide cuts but segments of a circle at the open ends.
#[test]
fn a_slot_that_is_too_narrow_stays_full() {
    let mesh = slotted(4.0, 10.0);
    let cutter = Cutter::flat_end(CutterParams::from_array([3.0, 20.0, 3.0, 20.0])).unwrap();
    let machined = machine(&mesh, &[&cutter], &Directions::up(), 0.25);
    let segment = 9.0 * (2f64 / 3.0).asin() - 2.0 * 5f64.sqrt();
    let by_hand = 10.0 * (40.0 * 4.0 - 2.0 * segment);
    assert!((left(&machined) / by_hand - 1.0).abs() < 0.03, "{} {by_hand}", left(&machined));
    let fits = Cutter::flat_end(CutterParams::from_array([2.0, 20.0, 2.0, 20.0])).unwrap();
    assert_eq!(machine(&mesh, &[&fits], &Directions::up(), 0.25).bodies.len(), 0);
}

/// A gap thinner than what is taken for a site's own wall: the other wall is not missed.
#[test]
fn no_more_is_left_in_a_thin_gap_than_its_width() {
    let cutter = Cutter::flat_end(CutterParams::from_array([3.0, 20.0, 3.0, 20.0])).unwrap();
    for width in [1e-6, 1e-3, 0.015, 0.025, 0.5] {
        let mesh = slotted(width, 10.0);
        let at = [(DVec3::new(-0.5 * width, 0.0, 15.0), DVec3::X)];
        let found = rests(&mesh, &at, &cutter, &Directions::up());
        assert!((found[0] - width).abs() < 1e-5, "{width} {}", found[0]);
    }
}

#[test]
fn more_tools_and_more_directions_leave_no_more_and_a_second_time_adds_nothing() {
    let mesh = pocket();
    let [thick, thin]: [Cutter; 2] = ["4,30,20,40", "1.5,12,20,40"].map(|c| c.parse().unwrap());
    let all = machine(&mesh, &[&thick, &thin], &Directions::up(), 0.4);
    assert!(all.after_mm3[0][1] <= all.after_mm3[0][0] && all.after_mm3[0][1] <= all.alone_mm3[1]);
    let some = Directions::fibonacci_hemisphere(20).unwrap();
    let tilted = machine(&mesh, &[&thick], &some, 0.4);
    assert!(left(&tilted) <= left(&machine(&mesh, &[&thick], &Directions::up(), 0.4)) + 1e-9);
    let mut whole = mesh.clone();
    for body in &all.bodies {
        let first = whole.vertices.len() as u32;
        whole.vertices.extend(&body.mesh.vertices);
        whole.triangles.extend(body.mesh.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    let again = machine(&whole, &[&thick, &thin], &Directions::up(), 0.4);
    assert!(left(&again) < 0.05 * left(&all), "{} of {}", left(&again), left(&all));
}

#[test]
fn results_do_not_depend_on_threads() {
    let mesh = pocket();
    let cutter: Cutter = "3,20,20,40".parse().unwrap();
    let directions = Directions::fibonacci_hemisphere(12).unwrap();
    let run = |n: usize| {
        par::with_threads(n, || {
            let machined = machine(&mesh, &[&cutter], &directions, 0.5);
            let meshes: Vec<Mesh> = machined.bodies.into_iter().map(|body| body.mesh).collect();
            let at: Vec<(DVec3, DVec3)> = (0..30)
                .map(|k| (DVec3::new(11.0 + 0.6 * f64::from(k), 8.5, 10.0), DVec3::Z))
                .collect();
            (meshes, rests(&mesh, &at, &cutter, &directions))
        })
        .unwrap()
    };
    let one = run(1);
    assert!(one.1.iter().any(|rest| *rest > 0.0) && one == run(3));
}

/// Images against plain loops over all pixels of the tool.
#[test]
fn images_are_those_of_plain_loops() {
    let mesh = pocket();
    let triangles: Vec<_> = (0..mesh.triangles.len()).map(|f| mesh.corners(f)).collect();
    // A holder that widens twice.
    let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
    let upper = vec![step(4.0, 4.0), step(7.0, 11.0), step(16.0, f64::INFINITY)];
    let cutter = Cutter::from_parts([0.7, 1.3], vec![step(1.3, 2.0)], upper).unwrap();
    let (low, high) = mesh.bounds().unwrap();
    let pitch = 0.4;
    for direction in [Vec3::Z, Vec3::new(0.3, -0.5, 0.8).normalize()] {
        let outline = Outline::new(&cutter, 0.01);
        let footprint = Footprint::new(&outline, 0.1, pitch);
        let view = View::new(axes(direction), [low, high], pitch, footprint.margin());
        let (width, [n_across, n_along]) = (view.width, view.n_tiles());
        let buffers = Buffers::default();
        let heights = Heights::new(view, &triangles, &buffers);
        // Some tiles about the middle.
        let wanted: Vec<bool> = (0..n_across * n_along)
            .map(|t| {
                (t % n_across).abs_diff(n_across / 2) <= 1
                    && (t / n_across).abs_diff(n_along / 2) < 6
            })
            .collect();
        let swept = Swept::new([&heights; 2], &footprint, &wanted, &buffers);
        let cutting = Cutting::new(&outline, 0.1);
        let [_, wide] = footprint.discs[..] else { panic!("two steps") };
        let reach = wide.radius.ceil() as isize;
        let offsets: Vec<([isize; 2], f64)> = (-reach..=reach)
            .flat_map(|y| (-reach..=reach).map(move |x| [x, y]))
            .map(|[x, y]| ([x, y], (x as f64).hypot(y as f64)))
            .collect();
        let at = |image: &[f32], n: usize, [x, y]: [isize; 2]| {
            image[n.checked_add_signed(y * width as isize + x).unwrap()]
        };
        let stop = |n: usize| {
            let of = |(offset, distance): &([isize; 2], f64)| {
                let height = at(&heights.image, n, *offset);
                let cuts = (*distance * pitch <= cutting.radius)
                    .then(|| height - cutting.height(*distance * pitch) as f32);
                let holds = footprint.discs.iter().filter(|disc| *distance <= disc.radius);
                let holds = holds.map(|disc| height - disc.height);
                cuts.into_iter().chain(holds).fold(EMPTY, f32::max)
            };
            let spindle = footprint.spindle.map_or(EMPTY, |height| heights.highest - height);
            offsets.iter().map(of).fold(spindle, f32::max)
        };
        let tile = |n: usize| n / width / 8 * n_across + n % width / 64;
        let some = (0..heights.image.len()).filter(|n| wanted[tile(*n)] && n % 37 == 0);
        let mut n_left = 0;
        for n in some {
            assert_eq!(swept.stops[n], stop(n), "stop at {n}");
            let of = |(offset, distance): &([isize; 2], f64)| {
                let cuts = *distance * pitch <= cutting.radius;
                cuts.then(|| {
                    at(&swept.stops, n, *offset) + cutting.height(*distance * pitch) as f32
                })
            };
            let left = offsets.iter().filter_map(of).fold(f32::INFINITY, f32::min);
            assert_eq!(swept.left[n], left, "left at {n}");
            n_left += usize::from(left > -100.0);
        }
        assert!(n_left > 20, "{n_left}");
    }
}

/// Against all places of the axis on a fine grid, where the tool stops by the closed formulas.
#[test]
fn rests_are_no_more_than_a_dense_search_finds() {
    let lengths = CutterParams::from_array([2.0, 8.0, 7.0, 30.0]);
    let directions: Directions = "cone:50:6".parse().unwrap();
    let (mut n_sites, mut n_worse) = (0, 0);
    for mesh in [pocket(), slotted(3.4, 8.0)] {
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let options = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
        let sites = sample(&mesh, &SiteOptions { n_sites: 100, ..SiteOptions::default() }).unwrap();
        for corner in [2.0, 0.0, 0.6] {
            let cutter = Cutter::bull_nose(lengths, corner).unwrap();
            let labels = obstacles.surface_labels(&sites, &cutter, &directions, &options).unwrap();
            let reached = |i: &usize| labels.answers[*i] == SiteAnswer::Accessible;
            let which: Vec<usize> = (0..sites.len()).filter(|i| !reached(i)).step_by(4).collect();
            let of = (&sites, &which[..]);
            let (found, _) = obstacles.rests(of, &cutter, &directions, &options).unwrap();
            let outline = Outline::new(&cutter, options.finish_mm);
            let tolerances = options
                .tolerance
                .of_triangles(&outline, &obstacles.chords, &obstacles.bvh)
                .unwrap();
            let cutting = Cutting::new(&outline, 0.9 * tolerances.least);
            let (bvh, tolerances, outline) = (&obstacles.bvh, &tolerances, &outline);
            let dropped = Dropped { bvh, tolerances, outline, cutting: &cutting };
            let frames = obstacles.frames(&directions, &options).unwrap();
            for &i in &which {
                let rest = f64::from(found[i]);
                let (from, along) = (sites.points[i].as_dvec3(), sites.normals[i].as_dvec3());
                let (low, high) = mesh.bounds().unwrap();
                let line = Line { from, along, length: obstacles.length(from, along, [low, high]) };
                let dense = dense(&dropped, &line, &frames, cutting.radius);
                n_sites += 1;
                n_worse += usize::from(rest > dense + 0.02);
                assert!(rest <= dense + 0.3, "{i}: {rest} {dense}");
            }
        }
    }
    assert!(n_sites > 35 && n_worse * 20 <= n_sites, "{n_worse} of {n_sites}");
}

fn dense(dropped: &Dropped, line: &Line, frames: &[Frame], radius: f64) -> f64 {
    const N: i32 = 24;
    let mut recent = Recent::default();
    let mut least = line.length;
    for frame in frames {
        let [u, v, _] = frame.axes;
        // Within the radius of some place of the line.
        let way = DVec2::new(line.along.dot(u), line.along.dot(v));
        let n_along = (way.length() * line.length / radius).ceil().min(6.0) as i32;
        for place in 0..=n_along {
            let about = way * (f64::from(place) * radius / way.length().max(1e-9)).min(line.length);
            for (x, y) in (-N..=N).flat_map(|y| (-N..=N).map(move |x| (x, y))) {
                let x = about + DVec2::new(f64::from(x), f64::from(y)) * (radius / f64::from(N));
                let below = |mm: f64, recent: &mut Recent| {
                    let found = dropped.left(line, frame.axes, (x, mm), recent);
                    found.filter(|(left, _)| *left <= mm)
                };
                // With the bound, and with what stopped tools before, as without.
                let found = below(line.length, &mut Recent::default());
                for mm in [least, 0.5 * least] {
                    let expected = found.filter(|(left, _)| *left <= mm);
                    assert_eq!(below(mm, &mut recent), expected, "below {mm} mm");
                }
                least = found.map_or(least, |(left, _)| least.min(left));
            }
        }
    }
    least
}

/// The volume about sites spread over a part, of rests against all directions given.
fn left_about_sites(mesh: &Mesh, cutter: &Cutter, directions: &Directions) -> f64 {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let options = SiteOptions { n_sites: 6000, ..SiteOptions::default() };
    let (sites, options) = (sample(mesh, &options).unwrap(), SurfaceOptions::default());
    let answers = obstacles.surface_labels(&sites, cutter, directions, &options).unwrap().answers;
    let which: Vec<usize> =
        (0..sites.len()).filter(|&i| answers[i] != SiteAnswer::Accessible).collect();
    let (rests, _) = obstacles.rests((&sites, &which), cutter, directions, &options).unwrap();
    let areas = crate::geom::spacing::areas_on(&sites, Some(mesh)).unwrap();
    let volumes = obstacles.rest_volumes(&sites, &rests, &areas).unwrap();
    volumes.into_iter().map(f64::from).sum()
}

/// Two walls of a corner share what is left between them, so do the two of a slot.
#[test]
fn volumes_about_sites_add_up_to_those_by_hand() {
    let (mesh, up) = (pocket(), Directions::up());
    // Wider than three times the distance of sites, which is 1 mm.
    for r in [3.0f64, 5.0] {
        let cutter: Cutter = format!("{r},20,20,40").parse().unwrap();
        let profile = (1.0 - PI / 4.0) * r * r;
        let along = 2.0 * (20.0 + 14.0 - 4.0 * r) + 4.0 * (10.0 - r);
        let by_hand = along * profile + 4.0 * (r * r * r - PI * r * r * r / 6.0);
        let found = left_about_sites(&mesh, &cutter, &up);
        assert!((found / by_hand - 1.0).abs() < 0.08, "R {r}: {found} {by_hand}");
    }
    // Wider than the pocket: it stays full.
    let wide: Cutter = "8,20,20,40".parse().unwrap();
    let found = left_about_sites(&mesh, &wide, &up);
    let sag = 8.0 - (64.0f64 - 49.0).sqrt();
    assert!(found < 2800.0 && found > 2800.0 - 20.0 * 14.0 * sag, "{found}");
}

/// A block of 20 in a stock of 24: from above all but what is beside the block and below the tool's reach goes, from
/// below the rest, without a difference to both at once; a setup from the same side adds nothing.
#[test]
fn setups_take_from_what_those_before_have_left() {
    let mesh = solids::cuboid(DVec3::splat(20.0));
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let stock_box = [DVec3::splat(-2.0), DVec3::splat(22.0)];
    let job = Job { part: &mesh, stock_box, stock: None, accuracy_mm: 0.5 };
    let options = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
    // Of radius 3; a holder of radius 8, 18 above the tip.
    let cutter = Cutter::flat_end(CutterParams::from_array([3.0, 12.0, 8.0, 40.0])).unwrap();
    let along = |z: i32| format!("list:0,0,{z}").parse::<Directions>().unwrap();
    let left = |setups: &[Directions]| {
        let found = obstacles.machine(&job, &[&cutter], setups, &options, &mut |_, _| Ok(()));
        found.unwrap()
    };
    let (up, down) = (along(1), along(-1));
    let one_side = left(&[up.clone(), up.clone()]);
    let [first, again] = [one_side.after_mm3[0][0], one_side.after_mm3[1][0]];
    assert_eq!(first, again);
    // The holder comes down to the block's top: the tip to 18 below. What is lower stays, and all beneath the block.
    let by_hand = 20.0 * 20.0 * 2.0 + (24.0 * 24.0 - 20.0 * 20.0) * 4.0;
    assert!((first / by_hand - 1.0).abs() < 0.05, "{first} {by_hand}");
    assert!(one_side.alone_mm3.is_empty() && one_side.after_mm3.len() == 2);
    let both = left(&[up, down]);
    assert_eq!(both.after_mm3[0][0], first);
    assert!(both.after_mm3[1][0] < 0.01 * first, "{:?}", both.after_mm3);
}
