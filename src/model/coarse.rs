//! What the network is told about each site before it looks at the shape: the labels of the published definition, as
//! numbers.
//!
//! ```text
//! tools = the tool; the tool without its holder; the tool, half a finest cell wider
//! for each site and tool:
//!     s = share of the coarse directions in which no other site is in the tool
//!     input = s^(1/4)
//! for each site:
//!     β = number of pairs of at most 150 directions and sites inaccessible to the tool (s = 0) in which it collides with the tool
//!     k = number of occlusion points, the tenth of the sites with the greatest β > 0
//!     r = number of sites with a greater β
//!     d = (k − r − 1/2) / k, at least −1; −1 where β = 0
//!     input = sign(d) √|d|
//! ```
//!
//! The published definition takes milliseconds and is wrong at a tenth of the sites with 150 directions, at a twentieth
//! with 600: between sites and directions it does not look. The network corrects it. The fourth root tells sites of one
//! direction from sites of none; the square root tells the last occlusion point from the first site that is none.

use super::config::{InputConfig, N_COARSE};
use super::cutter_modules::N_LENGTHS;
use crate::Result;
use crate::access::{self, LabelOptions, Obstacles, occlusion_points};
use crate::geom::Sites;
use crate::octree::{Cloud, Octree};
use crate::tool::cutter::{Cutter, CutterParams};
use crate::tool::directions::Directions;

/// A cutter's lengths are at least that; in the cube `[-1, 1]³` no site is told from another by less.
const SHORTEST: f64 = 1e-4;

/// Tools whose shares are read; the first is the cutter itself.
const N_TOOLS: usize = N_COARSE - 1;

/// Directions of β at most: as many as the published labels have.
const MAX_BETA_DIRECTIONS: usize = 150;

/// The paper's share of occlusion points.
const OCCLUSION_SHARE: f64 = 0.1;

/// Coarse answers, `[n_points, N_COARSE]`, of normalized clouds and cutters in their unit; empty if the network does
/// not read them.
///
/// # Errors
/// If a tool is none.
pub(super) fn answers(
    clouds: &[Cloud],
    cutters: &[[f64; N_LENGTHS]],
    input: &InputConfig,
) -> Result<Vec<f32>> {
    if input.coarse_directions == 0 {
        return Ok(Vec::new());
    }
    let directions = Directions::fibonacci_hemisphere(input.coarse_directions)?;
    let n_beta_directions = input.coarse_directions.min(MAX_BETA_DIRECTIONS);
    let of_beta = Directions::fibonacci_hemisphere(n_beta_directions)?;
    let options = LabelOptions { occlusion: false, ..LabelOptions::default() };
    let mut rows = Vec::new();
    for (cloud, &cutter) in clouds.iter().zip(cutters) {
        let (points, normals) = (cloud.points.to_vec(), cloud.normals.to_vec());
        let sites = Sites { points, normals, faces: Vec::new() };
        let tools = tools(cutter, input)?;
        let labels = access::label_many(&sites, Obstacles::Queries, &tools, &directions, &options)?;
        let inaccessible = &labels[0].answers.inaccessible();
        let obstacles = (Obstacles::Queries, access::Counted::All);
        let beta =
            access::count_for((&sites).into(), obstacles, &tools[0], &of_beta, inaccessible)?;
        for (i, in_the_way) in in_the_way(&beta).into_iter().enumerate() {
            let n_accessible =
                labels.iter().map(|of_tool| of_tool.answers.accessible_directions[i]);
            rows.extend(n_accessible.map(|n| (n as f32 / directions.len() as f32).sqrt().sqrt()));
            rows.push(in_the_way);
        }
    }
    Ok(rows)
}

/// Above 0 for occlusion points, below for sites of a smaller β.
fn in_the_way(beta: &[u64]) -> Vec<f32> {
    let n_marked = occlusion_points(beta, OCCLUSION_SHARE).into_iter().filter(|m| *m).count();
    let mut sorted = beta.to_vec();
    sorted.sort_unstable_by(|a, b| b.cmp(a));
    let of_site = |&beta: &u64| {
        if beta == 0 {
            return -1.0;
        }
        let rank = sorted.partition_point(|&other| other > beta);
        let above = (n_marked as f64 - rank as f64 - 0.5) / n_marked as f64;
        (above.abs().min(1.0).sqrt().copysign(above)) as f32
    };
    beta.iter().map(of_site).collect()
}

/// A holder that is narrower than its cutter counts as one of the cutter's width.
fn tools([cr, ch, fr, fh]: [f64; N_LENGTHS], input: &InputConfig) -> Result<[Cutter; N_TOOLS]> {
    let fr = fr.max(cr);
    let half_cell = 1.0 / f64::from(1u32 << input.depth);
    let of = |lengths: [f64; N_LENGTHS]| {
        Cutter::ball_end(CutterParams::from_array(lengths.map(|length| length.max(SHORTEST))))
    };
    Ok([
        of([cr, ch, fr, fh])?,
        of([cr, ch, cr, fh])?,
        of([cr + half_cell, ch, fr + half_cell, fh])?,
    ])
}

/// Means over the points of each finest node, zeros for empty ones, appended to `features: [n_nodes, c]`.
pub(super) fn append(octree: &Octree, features: &[f32], c: usize, answers: &[f32]) -> Vec<f32> {
    let finest = octree.finest();
    let mut sums = vec![[0.0; N_COARSE]; finest.n_nodes()];
    let mut n_points = vec![0.0; finest.n_nodes()];
    for (&leaf, answer) in octree.point_node.iter().zip(answers.as_chunks::<N_COARSE>().0) {
        let node = finest.nonempty[leaf as usize] as usize;
        n_points[node] += 1.0;
        sums[node].iter_mut().zip(answer).for_each(|(sum, x)| *sum += x);
    }
    let mut rows = Vec::with_capacity(finest.n_nodes() * (c + N_COARSE));
    for ((row, sums), n_points) in features.chunks(c).zip(sums).zip(n_points) {
        rows.extend_from_slice(row);
        rows.extend(sums.map(|sum| sum / f32::max(n_points, 1.0)));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::label;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use crate::model::config::CutterInput;
    use crate::model::{Batch, Model, Shape, UNetConfig};

    const CUTTER: [f64; N_LENGTHS] = [1.0, 6.0, 9.0, 5.0];
    /// Fewer than [`MAX_BETA_DIRECTIONS`]: β is of all.
    const N_DIRECTIONS: usize = 50;

    fn config() -> UNetConfig {
        let mut config = UNetConfig::tiny();
        config.input.coarse_directions = N_DIRECTIONS;
        config
    }

    fn sites(n_sites: usize) -> Sites {
        let part = solids::torus(20.0, 6.0, 40, 20);
        sample(&part, &SiteOptions { n_sites, ..Default::default() }).unwrap()
    }

    fn shape(sites: &Sites) -> Shape<'_> {
        Shape::new(&sites.points, &sites.normals, CUTTER)
    }

    /// Lengths are scaled with the part, so labels in millimeters are the same but for sites that rounding decides.
    #[test]
    fn shares_and_occlusion_are_those_of_labels_in_millimeters() {
        let sites = sites(400);
        let batch = Batch::<f64>::new(&[shape(&sites)], &config().input).unwrap();
        let ends = |of: fn(f32, f32) -> f32| sites.points.iter().map(|p| p.x).reduce(of).unwrap();
        let across = f64::from(ends(f32::max) - ends(f32::min));
        assert!(across > 51.0, "the largest edge of the sites' box: {across}");
        let cell_mm = across / f64::from(1 << config().input.depth);
        let [cr, ch, fr, fh] = CUTTER;
        let wider = cell_mm / 2.0;
        let tools = [CUTTER, [cr, ch, cr, fh], [cr + wider, ch, fr + wider, fh]];
        let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS).unwrap();
        for (t, lengths) in tools.into_iter().enumerate() {
            let cutter = Cutter::ball_end(lengths.into()).unwrap();
            let options = LabelOptions::default();
            let labels = label(&sites, Obstacles::Queries, &cutter, &directions, &options).unwrap();
            let counts = labels.answers.accessible_directions;
            let mut different = 0;
            for (n, answer) in counts.iter().zip(batch.coarse_answers.chunks(N_COARSE)) {
                let found = answer[t].powi(4) * N_DIRECTIONS as f64;
                different += u32::from((found - f64::from(*n)).abs() > 0.01);
            }
            assert!(different <= 2, "tool {t}: {different} sites");
            assert!(counts.iter().any(|&n| n > 0) && counts.contains(&0), "tool {t} says nothing");
        }

        let cutter = Cutter::ball_end(CUTTER.into()).unwrap();
        let options = LabelOptions::default();
        let labels = label(&sites, Obstacles::Queries, &cutter, &directions, &options).unwrap();
        let marked = labels.answers.occlusion;
        let found = batch.coarse_answers.iter().skip(N_TOOLS).step_by(N_COARSE);
        let different = found.zip(marked).filter(|(found, marked)| (**found > 0.0) != *marked);
        assert!(different.count() <= 2);
    }

    #[test]
    fn occlusion_changes_sign_after_the_greatest_tenth() {
        let mut beta = vec![0, 1, 10, 11, 22];
        beta.resize(20, 3);
        let root = |x: f64| x.sqrt() as f32;
        let found = in_the_way(&beta);
        assert_eq!([found[4], found[3], found[2]], [root(0.75), root(0.25), -root(0.25)]);
        assert_eq!([found[5], found[1], found[0]], [-root(0.75), -1.0, -1.0]);
        assert_eq!(
            in_the_way(&[0, 5, 0]),
            [-1.0, root(0.5), -1.0],
            "zeros are no occlusion points"
        );
        assert_eq!(in_the_way(&[0; 3]), [-1.0; 3]);
        assert_eq!(in_the_way(&[]), [] as [f32; 0]);
    }

    #[test]
    fn nodes_have_the_means_of_their_points_and_empty_ones_zeros() {
        let sites = sites(200);
        let input = config().input;
        let batch = Batch::<f32>::new(&[shape(&sites)], &input).unwrap();
        let c = input.n_node_channels().unwrap();
        let transform = input.normalization().transform(&sites.points).unwrap();
        let locate = |p| batch.octree.locate(input.depth, 0, transform.apply(p));
        let nodes: Vec<_> = sites.points.iter().map(|&p| locate(p).unwrap()).collect();
        for (node, row) in batch.features.chunks(c).enumerate() {
            let own = |i: &usize| nodes[*i] as usize == node;
            let own: Vec<usize> = (0..nodes.len()).filter(own).collect();
            for t in 0..N_COARSE {
                let sum: f32 = own.iter().map(|i| batch.coarse_answers[N_COARSE * i + t]).sum();
                assert_eq!(row[c - N_COARSE + t], sum / own.len().max(1) as f32);
            }
        }
    }

    #[test]
    fn what_has_no_coarse_answer_is_refused() {
        let model = Model::<f32>::new(&config(), 1).unwrap();
        let sites = sites(50);
        let message = model.predict(&sites.points, &[], CUTTER).unwrap_err().to_string();
        assert!(message.contains("normal"), "{message}");
        let mut config = config();
        config.input.features = "P".into();
        let model = Model::<f32>::new(&config, 1).unwrap();
        let message = model.predict(&sites.points, &[], CUTTER).unwrap_err().to_string();
        assert!(message.starts_with("coarse_directions is 50"), "{message}");
        config.input.cutter = CutterInput::Millimeters;
        let message = Model::<f32>::new(&config, 1).unwrap_err().to_string();
        assert!(message.contains("scaled with coarse_directions"), "{message}");
        config.input.coarse_directions = 100_000;
        assert!(Model::<f32>::new(&config, 1).is_err());
    }

    #[test]
    fn lengths_far_below_the_part_are_no_error() {
        let model = Model::<f32>::new(&config(), 1).unwrap();
        let sites = sites(50);
        let far: Vec<_> = sites.points.iter().map(|p| *p * 100.0).collect();
        let prediction = model.predict(&far, &sites.normals, [0.01, 0.01, 0.02, 0.01]).unwrap();
        assert_eq!(prediction.coarse_answers.len(), 50);
    }
}
