//! Input of the `bench` commands: a network of some preset, clouds of points, and a timer.

use deepmill::geom::{Sites, formats, sites};
use deepmill::model::{Batch, Shape, UNetConfig};
use deepmill::{Result, data::generated};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Instant;

/// Any cutter will do.
const CUTTER_MM: [f64; 4] = [1.5, 6.0, 40.0, 5.0];

#[derive(clap::Args)]
pub struct Args {
    /// Clouds (NPZ or PLY with normals); without any, generated parts are sampled.
    clouds: Vec<PathBuf>,
    /// Network: `reference`, `small` or `tiny`.
    #[arg(long, default_value = "reference")]
    pub preset: String,
    /// Shapes in the batch; clouds repeat if there are fewer.
    #[arg(long, default_value = "8")]
    pub batch: NonZeroUsize,
    /// Sites on each generated part.
    #[arg(long, default_value_t = 7000)]
    sites: usize,
    /// Depth of the octree instead of the preset's.
    #[arg(long)]
    depth: Option<usize>,
    /// Time for each measurement, s.
    #[arg(long, default_value_t = 2.0)]
    pub seconds: f64,
}

impl Args {
    pub fn config(&self) -> Result<UNetConfig> {
        let mut config = UNetConfig::preset(&self.preset)?;
        config.input.depth = self.depth.unwrap_or(config.input.depth);
        Ok(config)
    }

    pub fn clouds(&self) -> Result<Vec<Sites>> {
        let n = self.batch.get();
        if self.clouds.is_empty() {
            let options = sites::SiteOptions::default().with_n_sites(self.sites);
            let part = |i| sites::sample(&generated::mixed_part(0, i), &options);
            return (0..n as u64).map(part).collect();
        }
        self.clouds.iter().cycle().take(n).map(|path| formats::read_cloud(path)).collect()
    }
}

pub fn batch(clouds: &[Sites], config: &UNetConfig) -> Result<Batch<f32>> {
    Batch::new(&clouds.iter().map(shape).collect::<Vec<_>>(), &config.input)
}

fn shape(cloud: &Sites) -> Shape<'_> {
    Shape::new(&cloud.points, &cloud.normals, CUTTER_MM)
}

/// Median time of `work`, s, and the number of repeats; the first run does not count.
pub fn median_seconds(limit: f64, mut work: impl FnMut()) -> (f64, usize) {
    work();
    let (start, mut times) = (Instant::now(), Vec::new());
    while times.is_empty() || start.elapsed().as_secs_f64() < limit {
        let before = Instant::now();
        work();
        times.push(before.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times.len())
}
