//! What the network is told about each site before it looks at the shape: in which share of a few directions tools collide
//! with no other site.
//!
//! ```text
//! tools = the tool; the tool without its holder; the tool, half a finest cell wider
//! for each site and tool:
//!     s = share of the directions in which no other site is in the tool     (published definition)
//!     input = s^(1/4)
//! ```
//!
//! The published definition takes milliseconds and is wrong at a tenth of the sites with 150 directions, at a twentieth with 600: between
//! sites and directions it does not look. The network corrects it. The root tells sites of one direction from sites of none.

use super::config::{InputConfig, N_COARSE};
use super::cutter_modules::N_LENGTHS;
use crate::access::{self, LabelOptions, Obstacles};
use crate::cutter::{Cutter, CutterParams};
use crate::directions::Directions;
use crate::geom::Sites;
use crate::octree::{Cloud, Octree};
use crate::{Error, Result};

/// A cutter's lengths are at least that; in the cube `[-1, 1]³` no site is told from another by less.
const SHORTEST: f64 = 1e-4;

/// Roots of the shares, `[n_points, N_COARSE]`, of normalized clouds and cutters in their unit; empty if the network does not read them.
///
/// # Errors
/// If the clouds have no normals.
pub(super) fn shares(
    clouds: &[Cloud],
    cutters: &[[f64; N_LENGTHS]],
    input: &InputConfig,
) -> Result<Vec<f32>> {
    if input.coarse_directions == 0 {
        return Ok(Vec::new());
    }
    let directions = Directions::fibonacci_hemisphere(input.coarse_directions)?;
    let options = LabelOptions { occlusion: false, ..LabelOptions::default() };
    let mut rows = Vec::new();
    for (cloud, &cutter) in clouds.iter().zip(cutters) {
        if cloud.normals.is_empty() {
            let (found, expected) = (input.coarse_directions, "0 for points without normals");
            let remedy = "give the points normals, or train without (docs/training.md)";
            return Err(Error::argument("coarse_directions", found, expected, remedy));
        }
        let (points, normals) = (cloud.points.to_vec(), cloud.normals.to_vec());
        let sites = Sites { points, normals, faces: Vec::new() };
        let tools = tools(cutter, input)?;
        let labels = access::label_many(&sites, Obstacles::Queries, &tools, &directions, &options)?;
        for i in 0..sites.points.len() {
            let n_accessible =
                labels.iter().map(|of_tool| of_tool.answers.accessible_directions[i]);
            rows.extend(n_accessible.map(|n| (n as f32 / directions.len() as f32).sqrt().sqrt()));
        }
    }
    Ok(rows)
}

/// A holder that is narrower than its cutter counts as one of the cutter's width.
fn tools([cr, ch, fr, fh]: [f64; N_LENGTHS], input: &InputConfig) -> Result<[Cutter; N_COARSE]> {
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
pub(super) fn append(octree: &Octree, features: &[f32], c: usize, shares: &[f32]) -> Vec<f32> {
    let finest = octree.finest();
    let mut sums = vec![[0.0; N_COARSE]; finest.n_nodes()];
    let mut n_points = vec![0.0; finest.n_nodes()];
    for (&leaf, shares) in octree.point_node.iter().zip(shares.as_chunks::<N_COARSE>().0) {
        let node = finest.nonempty[leaf as usize] as usize;
        n_points[node] += 1.0;
        sums[node].iter_mut().zip(shares).for_each(|(sum, share)| *sum += share);
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
        Shape { points: &sites.points, normals: &sites.normals, cutter_mm: CUTTER }
    }

    /// Lengths are scaled with the part, so labels in millimeters are the same but for sites that rounding decides.
    #[test]
    fn shares_are_those_of_labels_in_millimeters() {
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
            for (n, shares) in counts.iter().zip(batch.point_shares.chunks(N_COARSE)) {
                let found = shares[t].powi(4) * N_DIRECTIONS as f64;
                different += u32::from((found - f64::from(*n)).abs() > 0.01);
            }
            assert!(different <= 2, "tool {t}: {different} sites");
            assert!(counts.iter().any(|&n| n > 0) && counts.contains(&0), "tool {t} says nothing");
        }
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
                let sum: f32 = own.iter().map(|i| batch.point_shares[N_COARSE * i + t]).sum();
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
        assert_eq!(prediction.coarse_shares.len(), 50);
    }
}
