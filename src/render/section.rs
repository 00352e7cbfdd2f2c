//! A section through the space around a part: one layer of a lattice, a square per point.

use super::Rgb;
use super::image::{Font, Image};
use crate::data::files::volume::{PointAnswer, VolumeFile};

/// Colors in the order of [`PointAnswer::ALL`].
const COLORS: [Rgb; 4] = [[223, 228, 233], [206, 58, 44], [50, 120, 200], [96, 102, 110]];
const WHITE: Rgb = [255, 255, 255];
const INK: Rgb = [34, 38, 44];
/// Width and height that the squares are fitted into, pixels.
const AREA: [usize; 2] = [1000, 800];
/// Border, and height of a line of the legend, pixels.
const BORDER: u32 = 20;
const LINE: u32 = 26;

/// The layer across y with the greatest product of accessible and other points outside the part, the first of them.
pub fn most_mixed_layer(file: &VolumeFile) -> usize {
    let [nx, ny, nz] = file.lattice.counts;
    let product = |j: usize| {
        let (mut n_open, mut n_closed) = (1, 1);
        for k in 0..nz {
            for i in 0..nx {
                match file.answers[i + nx * (j + ny * k)] {
                    PointAnswer::Accessible => n_open += 1,
                    PointAnswer::Inside => {}
                    PointAnswer::Inaccessible | PointAnswer::TipDoesNotFit => n_closed += 1,
                }
            }
        }
        n_open * n_closed
    };
    (0..ny).max_by_key(|&j| (product(j), std::cmp::Reverse(j))).unwrap_or(0)
}

/// The layer `j` across y, x to the right and z up.
///
/// # Panics
/// If the lattice has no such layer.
pub fn draw(file: &VolumeFile, j: usize) -> Image {
    let [nx, ny, nz] = file.lattice.counts;
    assert!(j < ny, "layer {j} of {ny}");
    let square = (AREA[0] / nx).min(AREA[1] / nz).clamp(1, 24) as u32;
    let y = file.lattice.origin.y + file.lattice.step_mm * j as f64;
    let titles = [
        format!("{}, space around the part, mesh definition", file.provenance.part),
        file.provenance.tool.clone(),
        format!("section at y = {y:.2} mm, a point every {:.2} mm", file.lattice.step_mm),
    ];
    let legend = PointAnswer::ALL.map(|answer| match answer {
        PointAnswer::Inside => answer.words().to_string(),
        _ => format!("{}: {:.1} % of the space", answer.words(), 100.0 * file.share(answer)),
    });
    let text = titles.iter().map(|title| Font::Bold.width(title));
    let text = text.chain(legend.iter().map(|line| LINE + Font::Normal.width(line)));
    let width = text.fold(square * nx as u32, u32::max) + 2 * BORDER;
    let above = BORDER + LINE * titles.len() as u32;
    let below = LINE * legend.len() as u32 + BORDER;
    let height = above + square * nz as u32 + BORDER / 2 + below;
    let mut image = Image::new(width, height, WHITE);
    for (line, title) in titles.iter().enumerate() {
        let font = if line == 0 { Font::Bold } else { Font::Normal };
        image.text(BORDER as i32, (BORDER / 2 + LINE * line as u32) as i32, title, font, INK);
    }
    for k in 0..nz {
        for i in 0..nx {
            let color = COLORS[file.answers[i + nx * (j + ny * k)] as usize];
            let (x, row) = (BORDER + square * i as u32, (nz - 1 - k) as u32);
            image.rectangle(x as i32, (above + square * row) as i32, square, square, color);
        }
    }
    let legend_top = above + square * nz as u32 + BORDER / 2;
    for (line, words) in legend.iter().enumerate() {
        let y = (legend_top + LINE * line as u32) as i32;
        image.rectangle(BORDER as i32, y + 2, LINE - 8, LINE - 8, COLORS[line]);
        image.text((BORDER + LINE) as i32, y, words, Font::Normal, INK);
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Labels;
    use crate::answers::{SiteAnswer, SiteAnswers};
    use crate::data::files::{AnalysisSettings, Provenance};
    use crate::geom::inside::Lattice;
    use crate::tool::cutter::CutterParams;
    use glam::DVec3;

    #[test]
    fn the_most_mixed_layer_is_shown_with_z_up() {
        let lattice = Lattice::covering(DVec3::ZERO, DVec3::new(2.0, 3.0, 2.0), 1.0).unwrap();
        let mut answers = vec![SiteAnswer::Accessible; 12];
        // x 0, y 1, z 1.
        answers[2 * (1 + 3)] = SiteAnswer::Inaccessible;
        let labels = Labels { answers: SiteAnswers::by_mesh(answers), ..Labels::default() };
        let cutter = CutterParams::from_array([1.0, 2.0, 3.0, 4.0]);
        let provenance = Provenance::ball_end("part", cutter, AnalysisSettings::default());
        let file = VolumeFile::new(provenance, lattice, &[false; 12], &labels).unwrap();
        assert_eq!(most_mixed_layer(&file), 1);
        let image = draw(&file, 1);
        let top = BORDER + 3 * LINE;
        assert_eq!(image.pixel(BORDER + 1, top + 1), Some(COLORS[1]));
        assert_eq!(image.pixel(BORDER + 1, top + 25), Some(COLORS[0]));
        assert_eq!(image.pixel(BORDER + 25, top + 1), Some(COLORS[0]));
    }
}
