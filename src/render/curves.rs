//! Curves over epochs as SVG.

use super::Rgb;
use crate::storage::atomic_file;
use crate::{Error, Result};
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Width of the picture and height of one chart, in pixels.
const WIDTH: u32 = 900;
const CHART_HEIGHT: u32 = 320;
/// Colors of the curves of a chart, in order; they stay apart for color-blind eyes.
const COLORS: [Rgb; 6] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [148, 80, 160], [120, 120, 120], [200, 150, 0]];

/// One named curve. Points that are not finite are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// `(x, y)`, x ascending.
    pub points: Vec<(f64, f64)>,
}

/// Curves that share their axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// What y shows.
    pub title: String,
    /// The curves.
    pub series: Vec<Series>,
}

/// Writes charts below each other, all over the same `x_name`, as an SVG file.
///
/// # Errors
/// If the system refuses the file.
pub fn write_curves(path: &Path, x_name: &str, charts: &[Chart]) -> Result<()> {
    let svg = draw(x_name, charts).map_err(|e| {
        let source = std::io::Error::other(e);
        Error::write(path, source)
    })?;
    atomic_file::write_atomic(path, |file| file.write_all(svg.as_bytes()))
}

fn draw(x_name: &str, charts: &[Chart]) -> std::result::Result<String, String> {
    let mut svg = String::new();
    let n_charts = charts.len().max(1);
    {
        let size = (WIDTH, CHART_HEIGHT * n_charts as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| e.to_string())?;
        for (area, chart) in root.split_evenly((n_charts, 1)).iter().zip(charts) {
            draw_chart(area, x_name, chart).map_err(|e| e.to_string())?;
        }
        root.present().map_err(|e| e.to_string())?;
    }
    Ok(svg)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw_chart(
    area: &Area,
    x_name: &str,
    chart: &Chart,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let finite = |series: &Series| -> Vec<(f64, f64)> {
        series.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
    };
    let curves: Vec<Vec<(f64, f64)>> = chart.series.iter().map(finite).collect();
    let x = span(curves.iter().flatten().map(|p| p.0), 0.0);
    let y = span(curves.iter().flatten().map(|p| p.1), 0.05);
    let mut axes = ChartBuilder::on(area)
        .caption(&chart.title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)?;
    axes.configure_mesh().x_desc(x_name).light_line_style(WHITE).draw()?;
    for (k, (series, points)) in chart.series.iter().zip(curves).enumerate() {
        let [r, g, b] = COLORS[k % COLORS.len()];
        let style = RGBColor(r, g, b).stroke_width(2);
        let marks: Vec<_> =
            if points.len() == 1 { vec![Circle::new(points[0], 3, style)] } else { vec![] };
        axes.draw_series(LineSeries::new(points, style))?
            .label(series.name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        axes.draw_series(marks)?;
    }
    let box_style = WHITE.mix(0.8);
    axes.configure_series_labels().background_style(box_style).border_style(BLACK).draw()?;
    Ok(())
}

/// Least to greatest value with a free `border` (share of the extent), never empty.
fn span(values: impl Iterator<Item = f64>, border: f64) -> Range<f64> {
    let (lo, hi) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if lo > hi {
        return 0.0..1.0;
    }
    let extent = hi - lo;
    let room = if extent > 0.0 { border * extent } else { 0.5 * lo.abs().max(1.0) };
    lo - room..hi + room
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> Chart {
        let series = Series { name: "loss <train>".into(), points: points.to_vec() };
        Chart { title: "loss".into(), series: vec![series] }
    }

    #[test]
    fn curves_are_svg_with_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curves.svg");
        let charts = [chart(&[(1.0, 0.7), (2.0, 0.5), (3.0, f64::NAN)]), chart(&[(1.0, 5.0)])];
        write_curves(&path, "epoch", &charts).unwrap();
        let svg = std::fs::read_to_string(path).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("epoch") && svg.contains("loss &lt;train&gt;"));
        assert!(svg.contains("<polyline") && !svg.contains("NaN"));
    }

    #[test]
    fn nothing_to_draw_is_no_failure() {
        assert!(draw("epoch", &[]).unwrap().contains("svg"));
        assert!(draw("epoch", &[chart(&[])]).unwrap().contains("epoch"));
        assert_eq!(span([f64::MIN_POSITIVE; 2].into_iter(), 0.1).start, -0.5);
    }
}
