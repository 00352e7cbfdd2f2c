//! The entry points `label` and `label_many`: checks the input, runs an engine over all directions, merges the results.

use super::batched::Batched;
use super::clearance::signed_clearance;
use super::cutter_groups::group_by_reference_point;
use super::method::Method;
use super::occlusion::{above_bottom, occlusion_points_above};
use super::order::Order;
use super::predicate::{self, Frame};
use super::problem::{Obstacles, PlacedCutter, Queries, Scene};
use super::pruned::{BetaBounds, Pruned};
use super::reference::Reference;
use super::stats::Stats;
use crate::Result;
use crate::access::extent::Extent;
use crate::access::labels::{Engine, LabelOptions, Labels};
use crate::access::matrix::CollisionMatrix;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::exec::par;
use crate::simd::Isa;
use crate::tool::cutter::{Cutter, require_steps};
use crate::tool::directions::Directions;

/// Labels of `queries` for one cutter; see [`access`](crate::access) for the definition.
///
/// # Errors
/// If a coordinate is not finite or beyond 1 km, a site lacks a unit normal, volume queries have no
/// obstacles of their own, the share is not in (0, 1], the clearance limit is not positive, the tolerance of the bottom
/// rule is negative, or the answers would not fit into the memory.
///
/// ```
/// use deepmill::{access, cutter::*, directions::Directions, geom::Sites};
/// use deepmill::glam::Vec3;
/// // A floor site beside a tall post: the holder hits the post from nearly everywhere.
/// let sites = Sites {
///     points: vec![Vec3::ZERO, Vec3::new(3.0, 0.0, 9.0)],
///     normals: vec![Vec3::Z, Vec3::Z],
///     faces: vec![],
/// };
/// let cutter = Cutter::ball_end(CutterParams::from_array([1.0, 2.0, 20.0, 2.0]))?;
/// let directions = Directions::fibonacci_hemisphere(150)?;
/// let options = access::LabelOptions::default();
/// let labels =
///     access::label(&sites, access::Obstacles::Queries, &cutter, &directions, &options)?;
/// assert_eq!(labels.answers.accessible_directions()[1], 150);
/// assert!(labels.answers.accessible_directions()[0] < 150);
/// # Ok::<(), deepmill::Error>(())
/// ```
pub fn label<'a>(
    queries: impl Into<Queries<'a>>,
    obstacles: Obstacles,
    cutter: &Cutter,
    directions: &Directions,
    options: &LabelOptions,
) -> Result<Labels> {
    let cutters = std::slice::from_ref(cutter);
    let mut labels = label_many(queries, obstacles, cutters, directions, options)?;
    Ok(labels.pop().expect("one cutter gives one result"))
}

/// Labels for several cutters on one part, in their order; what does not depend on the cutter is
/// computed once, and cutters with the same ball or corner use each other's answers: one cutter in several
/// lengths takes about half the time of as many calls, β apart.
///
/// # Errors
/// As [`label`].
pub fn label_many<'a>(
    queries: impl Into<Queries<'a>>,
    obstacles: Obstacles,
    cutters: &[Cutter],
    directions: &Directions,
    options: &LabelOptions,
) -> Result<Vec<Labels>> {
    let _floats = par::DefaultFloats::set();
    options.check()?;
    for cutter in cutters {
        require_steps(cutter.profile(), "label against a mesh: access::surface")?;
    }
    let queries = queries.into();
    Extent {
        n_queries: queries.len(),
        n_obstacles: obstacles.n_beside(queries.len()),
        n_cutters: cutters.len(),
        n_directions: directions.len(),
        occlusion: options.occlusion,
    }
    .require_memory()?;
    let scene = Scene::new(queries, obstacles)?.with_bottom(options.bottom_mm);
    let ranked_apart = match obstacles {
        Obstacles::Centroids(_) if options.occlusion => {
            Some(Scene::new(queries, Obstacles::Queries)?.with_bottom(options.bottom_mm))
        }
        _ => None,
    };
    let ranked = ranked_apart.as_ref().unwrap_or(&scene);
    let (n_ranked, bottom) = (ranked.n_ranked, ranked.bottom_of_ranked().to_vec());
    let frames: Vec<Frame> = directions.vectors().iter().map(|&d| predicate::frame(d)).collect();
    let at_once =
        LabelOptions { occlusion: options.occlusion && ranked_apart.is_none(), ..*options };
    let mut labels = label_scene(scene, cutters, &frames, &at_once);
    if let Some(ranked) = ranked_apart {
        for (labels, cutter) in labels.iter_mut().zip(cutters) {
            let tool = (cutter, &labels.answers.inaccessible()[..]);
            labels.beta = count_apart(&ranked, tool, &frames, options);
        }
    }
    if let Some(limit_mm) = options.clearance_limit_mm {
        let scene = Scene::new(queries, obstacles)?;
        let order = Order::compact(&scene);
        let scene = order.apply(scene);
        for (labels, cutter) in labels.iter_mut().zip(cutters) {
            let clearance = signed_clearance(&scene, cutter, &frames, limit_mm, options.isa);
            labels.answers.clearance_mm = order.restore_queries(clearance);
            labels.settle_signs();
        }
    }
    if options.occlusion {
        for labels in &mut labels {
            labels.answers.occlusion =
                occlusion_points_above(&labels.beta[..n_ranked], &bottom, options);
            if !options.beta {
                labels.beta = Vec::new();
            }
        }
    }
    for labels in &mut labels {
        let vector = |k: &Option<u32>| k.map(|k| directions.vectors()[k as usize]);
        labels.answers.witness = labels.witness.iter().map(vector).collect();
    }
    Ok(labels)
}

/// Everything but what needs β of another scene; β in the scene's order, without occlusion points.
fn label_scene(
    scene: Scene,
    cutters: &[Cutter],
    frames: &[Frame],
    options: &LabelOptions,
) -> Vec<Labels> {
    let isa = options.isa;
    match options.engine {
        Engine::Reference => run(&Reference { scene: &scene }, &scene, cutters, frames, options),
        Engine::Batched => run(&Batched { scene: &scene, isa }, &scene, cutters, frames, options),
        Engine::Pruned => {
            let order =
                if options.occlusion { Order::compact(&scene) } else { Order::quick(&scene) };
            let scene = order.apply(scene);
            let counted = options.occlusion && (options.beta || scene.n_ranked < scene.obstacles.n);
            let counting = LabelOptions { occlusion: counted, ..*options };
            let mut labels =
                run(&Pruned { scene: &scene, isa }, &scene, cutters, frames, &counting);
            if options.occlusion && !counted {
                for (labels, cutter) in labels.iter_mut().zip(cutters) {
                    let tool = (cutter, &labels.answers.inaccessible()[..]);
                    labels.beta = count_occluding(&scene, tool, frames, options);
                }
            }
            labels.into_iter().map(|labels| order.restore(labels)).collect()
        }
    }
}

/// β of a scene that others than its obstacles decided in, for the queries that are `marked`.
fn count_apart(
    scene: &Scene,
    (cutter, marked): (&Cutter, &[bool]),
    frames: &[Frame],
    options: &LabelOptions,
) -> Vec<u64> {
    let isa = options.isa;
    match options.engine {
        Engine::Reference => count_by(&Reference { scene }, scene, (cutter, marked), frames),
        Engine::Batched => count_by(&Batched { scene, isa }, scene, (cutter, marked), frames),
        Engine::Pruned => {
            let order = Order::compact(scene);
            let (scene, marked) = (order.apply(scene.clone()), order.of_queries(marked));
            let tool = (cutter, &marked[..]);
            let beta = match options.beta {
                true => count_all(&scene, isa, tool, frames),
                false => count_occluding(&scene, tool, frames, options),
            };
            order.restore(Labels { beta, ..Labels::default() }).beta
        }
    }
}

/// β of the obstacles that may be occlusion points, all of which are ranked; 0 of the others.
fn count_occluding(
    scene: &Scene,
    tool: (&Cutter, &[bool]),
    frames: &[Frame],
    options: &LabelOptions,
) -> Vec<u64> {
    let ranked = above_bottom(scene.n_ranked, scene.bottom_of_ranked());
    let n_top = options.rounding.n_of_share(options.share, ranked.len());
    if ranked.len() == scene.obstacles.n {
        return count_greatest(scene, options.isa, tool, frames, n_top);
    }
    let of_ranked = scene.clone().with_obstacles(&ranked);
    let counted = count_greatest(&of_ranked, options.isa, tool, frames, n_top);
    let mut beta = vec![0; scene.obstacles.n];
    ranked.iter().zip(counted).for_each(|(&j, counted)| beta[j] = counted);
    beta
}

/// Of which obstacles β is counted.
#[derive(Clone, Copy)]
pub(crate) enum Counted<'a> {
    All,
    /// Of these alone, in their order.
    Chosen(&'a [usize]),
    /// Of those that may be among so many of greatest β; the others have 0.
    Greatest(usize),
}

/// β for the queries that are `marked`, whatever marks them.
///
/// # Errors
/// As [`label`].
pub(crate) fn count_for(
    queries: Queries,
    (obstacles, counted): (Obstacles, Counted),
    cutter: &Cutter,
    directions: &Directions,
    marked: &[bool],
) -> Result<Vec<u64>> {
    let _floats = par::DefaultFloats::set();
    let scene = Scene::new(queries, obstacles)?;
    let scene = match counted {
        Counted::Chosen(chosen) => scene.with_obstacles(chosen),
        Counted::All | Counted::Greatest(_) => scene,
    };
    let frames: Vec<Frame> = directions.vectors().iter().map(|&d| predicate::frame(d)).collect();
    let order = Order::compact(&scene);
    let scene = order.apply(scene);
    let (marked, isa) = (order.of_queries(marked), Isa::active());
    let beta = match counted {
        Counted::Greatest(n) => count_greatest(&scene, isa, (cutter, &marked), &frames, n),
        Counted::All | Counted::Chosen(_) => count_all(&scene, isa, (cutter, &marked), &frames),
    };
    Ok(order.restore(Labels { beta, ..Labels::default() }).beta)
}

/// [`Counted::Greatest`].
///
/// ```text
/// bounds of β of all obstacles, over all directions
/// least = the n-th greatest lower bound
/// count β of the obstacles whose upper bound is at least that
/// ```
fn count_greatest(
    scene: &Scene,
    isa: Isa,
    (cutter, marked): (&Cutter, &[bool]),
    frames: &[Frame],
    n: usize,
) -> Vec<u64> {
    let n_obstacles = scene.obstacles.n;
    if n == 0 {
        return vec![0; n_obstacles];
    }
    let method = Pruned { scene, isa };
    let placed = PlacedCutter::new(scene, cutter).restricted_to(&indices(marked));
    let (_, workers) = par::map_with(
        frames.len(),
        || (method.scratch(), BetaBounds::zeros(n_obstacles)),
        |(scratch, bounds), k| {
            method.enter(scratch, &frames[k]);
            method.bound(scratch, &placed, bounds);
        },
    );
    let mut bounds = BetaBounds::zeros(n_obstacles);
    workers.iter().for_each(|(_, own)| bounds.add(own));
    let chosen = bounds.may_be_among_the_greatest(n, frames.len() as u64);
    let counted = count_all(&scene.clone().with_obstacles(&chosen), isa, (cutter, marked), frames);
    let mut beta = vec![0; n_obstacles];
    chosen.iter().zip(counted).for_each(|(&j, counted)| beta[j] = counted);
    beta
}

/// [`Counted::All`].
fn count_all(
    scene: &Scene,
    isa: Isa,
    (cutter, marked): (&Cutter, &[bool]),
    frames: &[Frame],
) -> Vec<u64> {
    count_by(&Pruned { scene, isa }, scene, (cutter, marked), frames)
}

/// β of all obstacles by an engine.
fn count_by<M: Method>(
    method: &M,
    scene: &Scene,
    (cutter, marked): (&Cutter, &[bool]),
    frames: &[Frame],
) -> Vec<u64> {
    let answers = SiteAnswers::new(marked.to_vec(), Vec::new());
    let mut labels = [Labels { answers, ..Labels::default() }];
    let cutter = PlacedCutter::new(scene, cutter);
    count(method, scene, &[cutter], frames, &mut labels);
    let [labels] = labels;
    labels.beta
}

fn run<M: Method>(
    method: &M,
    scene: &Scene,
    cutters: &[Cutter],
    frames: &[Frame],
    options: &LabelOptions,
) -> Vec<Labels> {
    let placed = |cutter| PlacedCutter::new(scene, cutter);
    let mut cutters: Vec<PlacedCutter> = cutters.iter().map(placed).collect();
    let order = group_by_reference_point(&mut cutters);
    let mut labels = collide(method, scene, &cutters, &order, frames);
    for labels in &mut labels {
        let of_sites = labels.answers.of_sites.iter_mut().zip(&scene.bottom);
        let at_bottom = of_sites.filter(|(_, at_bottom)| **at_bottom);
        at_bottom.for_each(|(answer, _)| *answer = SiteAnswer::Accessible);
    }
    if options.occlusion {
        count(method, scene, &cutters, frames, &mut labels);
    }
    if !options.collision_matrix {
        labels.iter_mut().for_each(|labels| labels.collision_matrix = None);
    }
    labels
}

/// Everything but β.
fn collide<M: Method>(
    method: &M,
    scene: &Scene,
    cutters: &[PlacedCutter],
    order: &[usize],
    frames: &[Frame],
) -> Vec<Labels> {
    let n_queries = scene.n_queries();
    let (by_direction, _) = par::map_with(
        frames.len(),
        || method.scratch(),
        |scratch, k| {
            method.enter(scratch, &frames[k]);
            let answer = |&c: &usize| {
                let mut row = vec![0; n_queries.div_ceil(64)];
                let stats = method.collide(scratch, &cutters[c], &mut row);
                (row, stats)
            };
            order.iter().map(answer).collect::<Vec<_>>()
        },
    );
    let mut rows: Vec<Vec<Vec<u64>>> = cutters.iter().map(|_| Vec::new()).collect();
    let mut stats = vec![Stats::default(); cutters.len()];
    for answers in by_direction {
        for (&c, (row, more)) in order.iter().zip(answers) {
            rows[c].push(row);
            stats[c] += more;
        }
    }
    let labels = rows.into_iter().zip(stats).map(|(rows, stats)| {
        let matrix = CollisionMatrix::new(n_queries, rows);
        let (inaccessible, accessible_directions, witness) = matrix.summary();
        let answers = SiteAnswers::new(inaccessible, Vec::new());
        let answers = SiteAnswers { accessible_directions, ..answers };
        Labels {
            answers: answers.with_shares_of(matrix.n_dirs()),
            witness,
            collision_matrix: Some(matrix),
            stats,
            ..Labels::default()
        }
    });
    labels.collect()
}

/// Fills in β. Each worker has its own sums; integers add up alike in any order.
fn count<M: Method>(
    method: &M,
    scene: &Scene,
    cutters: &[PlacedCutter],
    frames: &[Frame],
    labels: &mut [Labels],
) {
    let restrict = |(cutter, labels): (&PlacedCutter, &Labels)| {
        cutter.restricted_to(&indices(&labels.answers.inaccessible()))
    };
    let cutters: Vec<PlacedCutter> = cutters.iter().zip(&*labels).map(restrict).collect();
    let zeros = || cutters.iter().map(|_| vec![0; scene.obstacles.n]).collect::<Vec<Vec<u64>>>();
    labels.iter_mut().zip(zeros()).for_each(|(labels, zeros)| labels.beta = zeros);
    if cutters.iter().all(|cutter| cutter.n() == 0) {
        return;
    }
    let (by_direction, workers) = par::map_with(
        frames.len(),
        || (method.scratch(), zeros()),
        |(scratch, beta), k| {
            method.enter(scratch, &frames[k]);
            let cutters = cutters.iter().zip(beta);
            cutters.map(|(cutter, beta)| method.count(scratch, cutter, beta)).collect::<Vec<_>>()
        },
    );
    for stats in by_direction {
        labels.iter_mut().zip(stats).for_each(|(labels, more)| labels.stats += more);
    }
    for (_, beta) in workers {
        for (labels, beta) in labels.iter_mut().zip(beta) {
            labels.beta.iter_mut().zip(beta).for_each(|(sum, more)| *sum += more);
        }
    }
}

fn indices(marks: &[bool]) -> Vec<u32> {
    (0..marks.len() as u32).filter(|&i| marks[i as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::n_of_share;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;

    #[test]
    fn beta_of_some_obstacles_is_their_beta_among_all() {
        let part = solids::torus(20.0, 6.0, 40, 20);
        let sites = sample(&part, &SiteOptions { n_sites: 1500, ..Default::default() }).unwrap();
        let directions = Directions::fibonacci_hemisphere(40).unwrap();
        let marked: Vec<bool> = (0..sites.len()).map(|i| i % 3 != 1).collect();
        // The last is so thin that a site collides with the tool that stands at it, and is left out.
        for cutter in ["1,6,9,5", "0.5,2,30,2", "0.001,0.001,0.001,5"] {
            let cutter: Cutter = cutter.parse().unwrap();
            let count = |counted: Counted| {
                let obstacles = (Obstacles::Queries, counted);
                count_for((&sites).into(), obstacles, &cutter, &directions, &marked).unwrap()
            };
            let all = count(Counted::All);
            assert!(all.iter().any(|beta| *beta > 0));
            for chosen in [(0..1500).step_by(7).collect(), (3..9).collect(), vec![1499], vec![]] {
                let expected: Vec<u64> = chosen.iter().map(|&j: &usize| all[j]).collect();
                assert_eq!(count(Counted::Chosen(&chosen)), expected);
            }
        }
    }

    #[test]
    fn occlusion_points_need_no_beta_of_all() {
        let part = solids::torus(20.0, 6.0, 40, 20);
        let sites = sample(&part, &SiteOptions { n_sites: 1500, ..Default::default() }).unwrap();
        let directions = Directions::fibonacci_hemisphere(40).unwrap();
        for name in ["1,6,9,5", "0.5,2,30,2", "0.001,0.001,0.001,5", "2,1,90,1"] {
            let cutter: Cutter = name.parse().unwrap();
            for share in [0.001, 0.1, 0.5, 1.0] {
                let label = |beta| {
                    let options = LabelOptions { share, beta, ..LabelOptions::default() };
                    label(&sites, Obstacles::Queries, &cutter, &directions, &options).unwrap()
                };
                let (all, few) = (label(true), label(false));
                assert_eq!((&few.answers, few.beta.len()), (&all.answers, 0));
                let n_top = n_of_share(share, sites.len());
                let obstacles = (Obstacles::Queries, Counted::Greatest(n_top));
                let marked = &all.answers.inaccessible();
                let found =
                    count_for((&sites).into(), obstacles, &cutter, &directions, marked).unwrap();
                let mut greatest = all.beta.clone();
                greatest.sort_unstable_by(|a, b| b.cmp(a));
                let least = greatest[n_top - 1];
                for (found, beta) in found.iter().zip(&all.beta) {
                    assert!(found == beta || (*found == 0 && *beta < least), "{found} for {beta}");
                }
                let n_counted = found.iter().filter(|beta| **beta > 0).count();
                assert!(share > 0.1 || name != "2,1,90,1" || n_counted < 1000, "{n_counted}");
            }
        }
    }
}
