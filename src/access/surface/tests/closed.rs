//! Proofs that a triangle collides in all poses within some distance, and the triangles near a point.

use super::*;
use crate::access::Queries;
use crate::access::surface::problem::Problem;
use crate::access::surface::query::Scratch;
use crate::access::surface::tool::{Stand, axes};
use crate::access::surface::triangle::nearest;
use crate::access::surface::verdict::Verdict;

/// Within a ball of radius 1.
fn offset(stream: &mut Stream) -> DVec3 {
    loop {
        let mut next = || stream.range(-1.0, 1.0);
        let p = dvec3(next(), next(), next());
        if p.length() <= 1.0 {
            return p;
        }
    }
}

fn direction(stream: &mut Stream) -> Vec3 {
    offset(stream).try_normalize().unwrap_or(DVec3::Z).as_vec3()
}

fn bodies() -> [Mesh; 3] {
    [tube(2.5, 12.0, 15.0, 12), slotted(4.0, 8.0), solids::torus(12.0, 5.0, 12, 8)]
}

#[test]
fn what_collides_within_a_distance_collides_in_every_pose_within_it() {
    let mut stream = Stream::new(3, 0, 0, Purpose::Probe);
    let (mut n_closed, mut n_balls) = (0, 0);
    for mesh in bodies() {
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let sites = everywhere(&mesh, 1);
        for cutter in cutters() {
            let queries = Queries::Sites(&sites);
            let problem: Problem<'_> = obstacles.problem(queries, &cutter, &exactly(0.02)).unwrap();
            let (triangles, mut scratch) = (problem.triangles(), Scratch::default());
            for _ in 0..400 {
                let stand = Stand {
                    reference: 15.0 * offset(&mut stream),
                    axes: axes(direction(&mut stream)),
                };
                let spread = stream.range(0.0, 1.5);
                let steps = &problem.probes.steps;
                let ball = &problem.probes.ball;
                let collides = steps.collides_within(triangles, &stand, spread, &mut scratch);
                let holds = cutter.side_mm() == 0.0
                    && ball.collides_within(triangles, &stand, spread, &mut scratch);
                n_closed += usize::from(collides);
                n_balls += usize::from(holds);
                for _ in 0..20 {
                    let reference = stand.reference + spread * offset(&mut stream);
                    let moved = Stand { reference, ..stand };
                    if collides {
                        let verdict = steps.verdict(triangles, &moved, &mut scratch);
                        assert_eq!(verdict, Verdict::Collides, "{cutter:?} {stand:?} {spread}");
                    }
                    if holds {
                        let met = ball.ball_meets(triangles, &moved);
                        assert!(!met.is_free(), "{cutter:?} {stand:?} {spread}");
                    }
                }
            }
        }
    }
    assert!(n_closed > 500 && n_balls > 100, "{n_closed} {n_balls}");
}

#[test]
fn without_a_spread_collisions_are_those_of_the_pose() {
    let mut stream = Stream::new(4, 0, 0, Purpose::Probe);
    for mesh in bodies() {
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let sites = everywhere(&mesh, 1);
        for cutter in cutters() {
            let queries = Queries::Sites(&sites);
            let problem = obstacles.problem(queries, &cutter, &exactly(0.02)).unwrap();
            let (triangles, mut scratch) = (problem.triangles(), Scratch::default());
            for _ in 0..200 {
                let stand = Stand {
                    reference: 15.0 * offset(&mut stream),
                    axes: axes(direction(&mut stream)),
                };
                let steps = &problem.probes.steps;
                let collides = steps.collides_within(triangles, &stand, 0.0, &mut scratch);
                let verdict = steps.verdict(triangles, &stand, &mut scratch);
                assert_eq!(collides, verdict == Verdict::Collides, "{cutter:?} {stand:?}");
            }
        }
    }
}

#[test]
fn no_triangle_near_a_point_is_passed_over() {
    let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
    let mut n_near = 0;
    for mesh in bodies() {
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let bvh = &obstacles.bvh;
        for _ in 0..1000 {
            let (point, radius) = (18.0 * offset(&mut stream), stream.range(0.0, 6.0));
            let mut met = Vec::new();
            bvh.near(point, radius, |place| {
                met.push(place);
                false
            });
            for place in 0..bvh.n_triangles() as u32 {
                if nearest(point, bvh.triangle(place)).distance(point) <= radius {
                    n_near += 1;
                    assert!(met.contains(&place), "{point} {radius}");
                }
            }
        }
    }
    assert!(n_near > 1000, "{n_near}");
}
