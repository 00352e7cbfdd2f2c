//! Properties of labels and octrees for whatever is drawn, and for numbers at the ends of their range.

use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
use deepmill::access::{
    Engine, LabelOptions, Labels, Obstacles, Queries, gouges, label, label_many,
};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites, solids};
use deepmill::model::{Model, UNetConfig};
use deepmill::octree::{Cloud, Octree, OctreeOptions, key};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

const AXES: [Vec3; 6] = [Vec3::Z, Vec3::X, Vec3::NEG_Y, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z];

fn list(vectors: &[Vec3]) -> Directions {
    let vectors = vectors.iter().map(|d| d.as_dvec3().to_array()).collect();
    Directions::new(DirectionSet::List { vectors }).unwrap()
}

fn ball_end(lengths: [f64; 4]) -> Cutter {
    Cutter::ball_end(CutterParams::from_array(lengths)).unwrap()
}

fn labels(sites: &Sites, obstacles: Obstacles, cutter: &Cutter, directions: &Directions) -> Labels {
    label(sites, obstacles, cutter, directions, &LabelOptions::default()).unwrap()
}

/// Sites on a lattice of quarter millimeters with normals along axes, and a cutter of such lengths: along axes
/// everything is exact.
fn scenes() -> impl Strategy<Value = (Sites, [f64; 4])> {
    let sites = prop::collection::vec((prop::array::uniform3(0u8..40), 0usize..6), 2..120);
    (sites, prop::array::uniform4(1u8..32)).prop_map(|(sites, lengths)| {
        let points = sites.iter().map(|(p, _)| 0.25 * Vec3::from(p.map(f32::from))).collect();
        let normals = sites.iter().map(|(_, n)| AXES[*n]).collect();
        let [cr, ch, more, fh] = lengths.map(|x| 0.25 * f64::from(x));
        (Sites { points, normals, faces: vec![] }, [cr, ch, cr + more, fh])
    })
}

fn moved(sites: &Sites, point: impl Fn(Vec3) -> Vec3, normal: impl Fn(Vec3) -> Vec3) -> Sites {
    Sites {
        points: sites.points.iter().map(|p| point(*p)).collect(),
        normals: sites.normals.iter().map(|n| normal(*n)).collect(),
        faces: vec![],
    }
}

/// A quarter turn about z and one about x.
fn turn(v: Vec3) -> Vec3 {
    Vec3::new(-v.y, -v.z, v.x)
}

/// What a labeling says that does not depend on the order of directions.
fn said(labels: &Labels) -> (Vec<u32>, Vec<u64>, Vec<bool>) {
    let accessible_directions = labels.answers.accessible_directions();
    let occlusion = labels.answers.occlusion();
    (accessible_directions.to_vec(), labels.beta.clone(), occlusion.to_vec())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn labels_do_not_depend_on_place_and_turn(
        (sites, lengths) in scenes(), shift in prop::array::uniform3(-400i16..400),
    ) {
        let cutter = ball_end(lengths);
        let expected = said(&labels(&sites, Obstacles::Queries, &cutter, &list(&AXES)));
        let shift = 0.25 * Vec3::from(shift.map(f32::from));
        let shifted = moved(&sites, |p| p + shift, |n| n);
        prop_assert_eq!(&said(&labels(&shifted, Obstacles::Queries, &cutter, &list(&AXES))), &expected);
        let turned = moved(&sites, turn, turn);
        let axes = list(&AXES.map(turn));
        prop_assert_eq!(&said(&labels(&turned, Obstacles::Queries, &cutter, &axes)), &expected);
    }

    #[test]
    fn labels_follow_their_sites_through_any_order((sites, lengths) in scenes(), by in 1usize..1000) {
        let (cutter, directions) = (ball_end(lengths), Directions::fibonacci_hemisphere(5).unwrap());
        let expected = labels(&sites, Obstacles::Queries, &cutter, &directions);
        let n = sites.len();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|i| (i * 7919 + by) % 127 * n + i);
        let permuted = Sites {
            points: order.iter().map(|&i| sites.points[i]).collect(),
            normals: order.iter().map(|&i| sites.normals[i]).collect(),
            faces: vec![],
        };
        let found = labels(&permuted, Obstacles::Queries, &cutter, &directions);
        for (p, &i) in order.iter().enumerate() {
            let of = |l: &Labels, i: usize| {
                (l.answers.of(i), l.answers.accessible_directions()[i], l.beta[i], l.witness[i])
            };
            prop_assert_eq!(of(&found, p), of(&expected, i));
        }
    }

    #[test]
    fn more_obstacles_close_and_slender_tools_open(
        (sites, lengths) in scenes(), (more, _) in scenes(), longer in 1u8..20,
    ) {
        let directions = Directions::fibonacci_hemisphere(7).unwrap();
        let open = |obstacles, lengths| {
            let labels = labels(&sites, obstacles, &ball_end(lengths), &directions);
            labels.answers.accessible_directions().to_vec()
        };
        let none_closer = |less: &[u32], more: &[u32]| less.iter().zip(more).all(|(l, m)| l <= m);
        let before = open(Obstacles::Queries, lengths);
        let beset = open(Obstacles::QueriesAnd(&more.points), lengths);
        prop_assert!(none_closer(&beset, &before));
        let [cr, ch, fr, fh] = lengths;
        let longer = 0.25 * f64::from(longer);
        for slender in [[cr, ch, fr, fh + longer], [cr, ch + longer, fr, fh], [cr, ch, cr + 0.5 * (fr - cr), fh]] {
            prop_assert!(none_closer(&before, &open(Obstacles::Queries, slender)), "{slender:?}");
        }
    }

    /// Counted again by the definition, in whole quarters of a millimeter.
    #[test]
    fn beta_is_the_number_of_collisions_of_inaccessible_sites((sites, lengths) in scenes()) {
        let found = labels(&sites, Obstacles::Queries, &ball_end(lengths), &list(&AXES));
        let [cr, ch, fr, fh] = lengths.map(|x| (4.0 * x).round() as i64);
        let quarters = |v: Vec3| (4.0 * v).to_array().map(|x| x as i64);
        let hits = |i: usize, axis: Vec3, j: usize| {
            let center = sites.points[i] + cr as f32 * 0.25 * sites.normals[i];
            let offset = sites.points[j] - center;
            let height = quarters(Vec3::splat(offset.dot(axis)))[0];
            let across: i64 = quarters(offset - offset.dot(axis) * axis).iter().map(|x| x * x).sum();
            let within = |radius: i64| across <= radius * radius;
            i != j && (height > cr + ch + fh
                || height > cr + ch && within(fr)
                || height > cr && within(cr))
        };
        let n = sites.len();
        let is_open = |i: usize, axis: Vec3| !(0..n).any(|j| hits(i, axis, j));
        let mut beta = vec![0u64; n];
        for i in 0..n {
            let n_open = AXES.into_iter().filter(|axis| is_open(i, *axis)).count();
            prop_assert_eq!(found.answers.accessible_directions()[i] as usize, n_open);
            if n_open == 0 {
                for axis in AXES {
                    (0..n).for_each(|j| beta[j] += u64::from(hits(i, axis, j)));
                }
            }
        }
        prop_assert_eq!(found.beta.iter().sum::<u64>(), beta.iter().sum::<u64>());
        prop_assert_eq!(&found.beta, &beta);
    }

    #[test]
    fn octrees_hold_their_points_and_know_their_neighbors(
        cells in prop::collection::vec(prop::array::uniform3(0u8..=64), 1..60),
        (depth, full_depth, cut) in (1usize..7, 0usize..4, 0usize..60),
    ) {
        let points: Vec<Vec3> =
            cells.iter().map(|c| Vec3::from(c.map(f32::from)) / 32.0 - 1.0).collect();
        let options = OctreeOptions::default().with_depth(depth).with_full_depth(full_depth.min(depth));
        let halves = points.split_at(cut.min(points.len() - 1));
        let clouds: Vec<Cloud> = [halves.0, halves.1].into_iter()
            .filter(|points| !points.is_empty()).map(|points| Cloud::new(points, &[])).collect();
        let octree = Octree::build(&clouds, &options).unwrap();
        for (d, level) in octree.levels.iter().enumerate() {
            prop_assert!(level.keys.is_sorted_by(|a, b| a < b), "keys ascend");
            for (row, &code) in level.keys.iter().enumerate() {
                let (cell, shape) = key::decode(code);
                prop_assert_eq!(key::encode(cell, shape), code);
                prop_assert_eq!(octree.find(d, shape, cell), Some(row as u32));
                for (k, &neighbor) in level.neigh[row].iter().enumerate() {
                    let offset = [k / 9, k / 3 % 3, k % 3].map(|o| o as i64 - 1);
                    let at = std::array::from_fn(|i| i64::from(cell[i]) + offset[i]);
                    let inside = at.iter().all(|c| (0..1i64 << d).contains(c));
                    let expected = inside.then(|| octree.find(d, shape, at.map(|c| c as u32))).flatten();
                    prop_assert_eq!(u32::try_from(neighbor).ok(), expected, "offset {:?}", offset);
                }
            }
            let is_parent = |row: &u32| level.children[*row as usize] >= 0;
            prop_assert!(level.nonempty.iter().all(is_parent));
        }
        for (i, &point) in points.iter().enumerate() {
            let shape = octree.point_ranges.iter().position(|range| range.contains(&i)).unwrap();
            let row = octree.finest().nonempty[octree.point_node[i] as usize];
            prop_assert_eq!(octree.locate(depth, shape, point), Some(row));
        }
    }
}

/// Labels and predictions are about ratios: twice or half as large, everything is the same to the last bit, down to
/// tools of tenths of micrometers and up to parts of hundreds of meters.
#[test]
fn parts_of_any_size_get_the_labels_of_their_ratios() {
    let mesh = solids::torus(20.0, 6.0, 24, 12);
    let sites = sample(&mesh, &SiteOptions::default().with_n_sites(300)).unwrap();
    let directions = Directions::fibonacci_hemisphere(20).unwrap();
    let model = Model::<f32>::new(&UNetConfig::tiny(), 3).unwrap();
    let lengths = [1.5, 2.0, 12.0, 4.0];
    let at = |scale: f64| {
        let sites = moved(&sites, |p| scale as f32 * p, |n| n);
        let lengths = lengths.map(|x| scale * x);
        let options = LabelOptions::default();
        let labels =
            label(&sites, Obstacles::Queries, &ball_end(lengths), &directions, &options).unwrap();
        let prediction = model.predict(&sites.points, &sites.normals, lengths).unwrap();
        (said(&labels), prediction.logits_inaccessible)
    };
    let expected = at(1.0);
    assert!(expected.0.0.contains(&0) && expected.0.0.iter().any(|n| *n > 0));
    for power in [-13, -7, 1, 9] {
        assert!(at(f64::from(power).exp2()) == expected, "2^{power}");
    }
}

/// Added to every coordinate it is what the coordinate is; at the origin it is all there is.
#[test]
fn subnormal_offsets_change_no_label() {
    let mesh = solids::cuboid(DVec3::new(8.0, 6.0, 4.0));
    let options = SiteOptions::default().with_n_sites(200);
    let mut sites = sample(&mesh, &options).unwrap();
    sites.points[0] = Vec3::ZERO;
    let directions = Directions::fibonacci_hemisphere(9).unwrap();
    let cutter = ball_end([1.0, 2.0, 5.0, 2.0]);
    let triangles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let all = |sites: &Sites| {
        let options = LabelOptions::default();
        let of = |engine| {
            let options = options.with_engine(engine);
            said(&label(sites, Obstacles::Queries, &cutter, &directions, &options).unwrap())
        };
        let options = SurfaceOptions::default();
        let part = triangles.label(sites, &cutter, &directions, &options).unwrap();
        let counts = part.answers.accessible_directions().to_vec();
        (Engine::ALL.map(of), part.answers.of_sites().to_vec(), counts)
    };
    let expected = all(&sites);
    for tiny in [f32::from_bits(1), -f32::from_bits(0x7f_ffff), f32::MIN_POSITIVE] {
        let moved = moved(&sites, |p| p + tiny, |n| n);
        assert!(moved.points[0].x == tiny && all(&moved) == expected, "{tiny:e}");
    }
}

/// NaN, infinities and numbers beyond every part, at every entry: an error of one line that says where.
#[test]
fn numbers_that_are_none_are_refused_at_every_entry() {
    let mesh = solids::cuboid(DVec3::new(8.0, 6.0, 4.0));
    let good = sample(&mesh, &SiteOptions::default().with_n_sites(20)).unwrap();
    let directions = Directions::up();
    let cutter = ball_end([1.0, 2.0, 5.0, 2.0]);
    let triangles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let model = Model::<f32>::new(&UNetConfig::tiny(), 3).unwrap();
    let mut refused: Vec<(String, String)> = Vec::new();
    let mut refuse = |what: &str, value: f64, error: Option<deepmill::Error>| {
        let error = error.unwrap_or_else(|| panic!("{what} {value} was taken")).to_string();
        assert!(!error.contains('\n') && error.contains("; "), "{what} {value}: {error}");
        refused.push((what.into(), error));
    };
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e30, -1e39] {
        let number = value as f32;
        let point = moved(&good, |p| if p == good.points[7] { p.with_y(number) } else { p }, |n| n);
        let mut normal = good.clone();
        normal.normals[3].z = number;
        let tools = std::slice::from_ref(&cutter);
        let (options, of_part) = (LabelOptions::default(), SurfaceOptions::default());
        for (what, sites) in [("a point", &point), ("a normal", &normal)] {
            for engine in Engine::ALL {
                let options = options.with_engine(engine);
                let found = label_many(sites, Obstacles::Queries, tools, &directions, &options);
                refuse(what, value, found.err());
            }
            refuse(what, value, triangles.label(sites, &cutter, &directions, &of_part).err());
            let found = triangles.accessible_directions(sites, &cutter, &directions, &of_part);
            refuse(what, value, found.err());
            refuse(what, value, gouges(sites, &good.points, &cutter, 0.1).err());
            let found = model.predict(&sites.points, &sites.normals, [1.0, 2.0, 5.0, 2.0]);
            refuse(what, value, found.err());
        }
        let obstacles = Obstacles::QueriesAnd(&point.points);
        refuse("an obstacle", value, label(&good, obstacles, &cutter, &directions, &options).err());
        let volume = Queries::Volume(&point.points);
        let found = label(volume, Obstacles::Points(&good.points), &cutter, &directions, &options);
        refuse("a query", value, found.err());
        let cloud = [Cloud::new(&point.points, &good.normals)];
        refuse("an octree", value, Octree::build(&cloud, &OctreeOptions::default()).err());
        let mut bad = mesh.clone();
        bad.vertices[2].x = value;
        refuse("a vertex", value, TriangleObstacles::new(&bad, &[]).err());
        refuse("a fixture", value, TriangleObstacles::new(&mesh, &[bad.clone()]).err());
        if !value.is_finite() {
            refuse("a vertex", value, sample(&bad, &SiteOptions::default()).err());
            let vectors = vec![[0.0, value, 1.0]];
            let list = Directions::new(DirectionSet::List { vectors });
            refuse("a direction", value, list.err());
        }
        for i in 0..4 {
            let mut lengths = [1.0, 2.0, 5.0, 2.0];
            lengths[i] = value;
            let cutter = Cutter::ball_end(CutterParams::from_array(lengths));
            refuse("a length", value, cutter.err());
        }
        let limit = options.with_clearance_limit_mm(Some(value));
        if !(value > 0.0 && value.is_finite()) {
            let found = label(&good, Obstacles::Queries, &cutter, &directions, &limit);
            refuse("a clearance", value, found.err());
        }
        let share = options.with_share(value);
        let found = label(&good, Obstacles::Queries, &cutter, &directions, &share);
        refuse("a share", value, found.err());
    }
    assert!(refused.len() > 100);
}

#[test]
fn weights_beyond_all_numbers_give_an_error_and_no_answer() {
    let good = sample(&solids::cuboid(DVec3::ONE), &SiteOptions::default().with_n_sites(20));
    let good = good.unwrap();
    for value in [f32::NAN, f32::INFINITY, 1e38] {
        let mut model = Model::<f32>::new(&UNetConfig::tiny(), 3).unwrap();
        let n = model.params.len();
        model.params[n / 2..].fill(value);
        let found = model.predict(&good.points, &good.normals, [0.1, 0.2, 0.5, 0.2]);
        let message = found.unwrap_err().to_string();
        assert!(message.starts_with("logits of site ") && message.contains("; "), "{message}");
    }
}

/// Of any finite triangles: an error, or as many finite sites as wanted.
#[test]
fn tiny_huge_and_flat_parts_are_sampled_or_refused() {
    let scaled = |by: DVec3| {
        let mut mesh: Mesh = solids::cuboid(DVec3::ONE);
        mesh.vertices.iter_mut().for_each(|v| *v *= by);
        mesh
    };
    for by in [
        DVec3::splat(1e-300),
        DVec3::splat(1e-160),
        DVec3::splat(1e-40),
        DVec3::splat(1e-6),
        DVec3::splat(1e6),
        DVec3::splat(1e100),
        DVec3::splat(1e300),
        DVec3::new(1e-9, 1.0, 1e9),
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::new(f64::from_bits(1), 1.0, 1.0),
    ] {
        match sample(&scaled(by), &SiteOptions::default().with_n_sites(50)) {
            Ok(sites) => assert!(
                sites.len() == 50
                    && sites.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5)
                    && sites.points.iter().all(|p| !p.is_nan()),
                "{by}"
            ),
            Err(error) => assert!(error.to_string().contains("; "), "{by}: {error}"),
        }
    }
}
