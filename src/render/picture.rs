//! Pictures of labeled parts: shaded views from above and below and a section, with title, legend and scale.

use super::PartView;
use super::camera::Camera;
use super::color::{Class, Coloring, Rgb};
use super::image::{Font, Image, fitted};
use super::memory::PartSize;
use super::paint::{METAL, Painter};
use super::raster::{Cut, Surface, draw, draw_cut};
use super::shade::{Look, SAMPLES, shade};
use crate::Result;
use crate::geom::{Mesh, Sites};
use glam::DVec3;
use std::path::Path;

/// Width of a view in pixels, and height of a picture without lines about the setup.
const PANEL: u32 = 700;
const HEIGHT: u32 = 800;
/// Height of title, of a line about the setup, and of the legend in pixels.
const HEAD: u32 = 70;
const LINE: u32 = 24;
const FOOT: u32 = 60;
/// Free pixels around the part.
const MARGIN: f64 = 26.0;
const BACKGROUND: Rgb = [255, 255, 255];
const LOOK: Look = Look { background: BACKGROUND, edges: true, from_below: false };
const INK: Rgb = [40, 42, 46];
const FAINT: Rgb = [120, 124, 130];
/// Of outlines of fixtures and table.
const FIXTURE: Rgb = [120, 60, 170];
/// Where the two eyes are: opposite each other, so that every side of a box is seen.
const EYES: [(DVec3, &str); 2] = [
    (DVec3::new(0.75, -1.2, 1.05), "from above, front right"),
    (DVec3::new(-0.75, 1.2, -1.05), "from below, back left"),
];
/// Where the eye looks at the section from, and its words: the part is cut across y, what is in front is left out.
const SECTION_EYE: DVec3 = DVec3::new(0.42, -1.2, 0.48);
/// Colors and directions of the small axes in each view.
const AXES: [(DVec3, &str, Rgb); 3] = [
    (DVec3::X, "x", [190, 50, 50]),
    (DVec3::Y, "y", [40, 130, 60]),
    (DVec3::Z, "z", [40, 80, 180]),
];

/// A picture of `part`: from above, from below and, if there is a mesh, a section, each 700 × 670 pixels. The first
/// line of `caption` says where the colors come from, the others, if any, are shown below the title.
///
/// Each pixel has the color of the nearest site that faces the same way. All views have the same scale. The section is
/// across y, through the middle of the sites of all groups but the first. The result is the same for any number of
/// threads.
///
/// # Panics
/// If `coloring` has not one entry per site.
pub fn render(part: &PartView, caption: &str, coloring: &Coloring) -> Image {
    assert_eq!(coloring.len(), part.sites.len(), "one color per site");
    let painter = Painter::new(part, coloring);
    let lines: Vec<&str> = caption.lines().filter(|line| !line.is_empty()).collect();
    let head = HEAD + LINE * lines.len().saturating_sub(1) as u32;
    let (width, height) = (PANEL, HEIGHT - HEAD - FOOT);
    let cut = part.mesh.and_then(|mesh| section(mesh, part, coloring));
    let mut views: Vec<(DVec3, String, Option<Cut>)> =
        EYES.map(|(eye, words)| (eye, words.to_string(), None)).into();
    if let Some(cut) = cut {
        let words = format!("section at y = {} mm", short(-cut.offset_mm));
        views.push((SECTION_EYE, words, Some(cut)));
    }
    let mut image = Image::new(PANEL * views.len() as u32, head + height + FOOT, BACKGROUND);
    let mut cameras: Vec<Camera> =
        views.iter().map(|(eye, ..)| panel_camera(*eye, width, height)).collect();
    let fit = |camera: &mut Camera| {
        let outlines = part.outlines.iter().flatten().copied();
        camera.center_on(painter.surface.vertices().chain(outlines), margin())
    };
    let scale = cameras.iter_mut().map(fit).fold(f64::INFINITY, f64::min);
    for (k, (camera, (eye, words, cut))) in cameras.iter_mut().zip(&views).enumerate() {
        camera.scale = scale;
        let look = Look { edges: painter.has_edges(), from_below: eye.z < 0.0, ..LOOK };
        let fragments = match cut {
            Some(cut) => draw_cut(&painter.surface, camera, *cut),
            None => draw(&painter.surface, camera),
        };
        let view = shade(&fragments, camera, look, |f, p| painter.at(f, p));
        let x = k as i32 * width as i32;
        image.paste(&view, i64::from(x), i64::from(head));
        let frame = [x, head as i32, width as i32, height as i32];
        draw_outlines(&mut image, (camera, *cut), part.outlines, frame);
        draw_axes(&mut image, camera, x + 46, (head + height) as i32 - 46);
        image.text(x + 20, head as i32 + 4, words, Font::Small, FAINT);
    }
    draw_title(&mut image, part, &lines);
    draw_legend(&mut image, coloring);
    draw_scale_bar(&mut image, scale * SAMPLES_PER_PIXEL.recip());
    image
}

/// The plane across y through the mean place of the sites that are not of the first group, or else of the box; none of
/// an empty mesh.
fn section(mesh: &Mesh, part: &PartView, coloring: &Coloring) -> Option<Cut> {
    let (low, high) = mesh.bounds()?;
    let shown = (0..part.sites.len()).filter(|&i| coloring.class(i) != 0);
    let (n, sum) =
        shown.fold((0.0, 0.0), |(n, sum), i| (n + 1.0, sum + f64::from(part.sites.points[i].y)));
    let y = if n > 0.0 { sum / n } else { 0.5 * (low.y + high.y) };
    // A little off the middle, where symmetric parts have faces.
    let y = (y + 0.003 * (high.y - low.y)).clamp(low.y, high.y);
    Some(Cut { normal: DVec3::NEG_Y, offset_mm: -y })
}

/// Checks that [`render`] fits into the memory, for `sites` and the surface if there is one.
///
/// # Errors
/// [`Error::TooLarge`](crate::Error::TooLarge) if it does not.
pub fn require_memory(mesh: Option<&Mesh>, sites: &Sites) -> Result<()> {
    let n_samples = (PANEL * (HEIGHT - HEAD - FOOT)) as usize * SAMPLES * SAMPLES;
    PartSize::of(mesh, sites).require_for_picture(n_samples)
}

/// [`render`] into a PNG file.
///
/// # Errors
/// As [`require_memory`], or if the system refuses the file.
///
/// # Panics
/// As [`render`].
pub fn write(path: &Path, part: &PartView, caption: &str, coloring: &Coloring) -> Result<()> {
    require_memory(part.mesh, part.sites)?;
    render(part, caption, coloring).write_png(path)
}

/// A shaded view of a mesh from above, without text, for contact sheets (see [`Image::grid`]).
pub fn thumbnail(mesh: &Mesh, width: u32, height: u32) -> Image {
    let surface = Surface::of_mesh(mesh);
    let mut camera = panel_camera(EYES[0].0, width, height);
    camera.scale = camera.center_on(surface.vertices(), 0.06 * camera.width as f64);
    shade(&draw(&surface, &camera), &camera, LOOK, |_, _| METAL)
}

/// One view of a part from above, without text, for contact sheets (see [`Image::grid`]).
///
/// # Panics
/// As [`render`].
pub fn view(part: &PartView, coloring: &Coloring, width: u32, height: u32) -> Image {
    assert_eq!(coloring.len(), part.sites.len(), "one color per site");
    let painter = Painter::new(part, coloring);
    let mut camera = panel_camera(EYES[0].0, width, height);
    camera.scale = camera.center_on(painter.surface.vertices(), 0.06 * camera.width as f64);
    let look = Look { edges: painter.has_edges(), ..LOOK };
    shade(&draw(&painter.surface, &camera), &camera, look, |f, p| painter.at(f, p))
}

const SAMPLES_PER_PIXEL: f64 = SAMPLES as f64;

fn margin() -> f64 {
    MARGIN * SAMPLES_PER_PIXEL
}

fn panel_camera(eye: DVec3, width: u32, height: u32) -> Camera {
    Camera::new(eye, width as usize * SAMPLES, height as usize * SAMPLES)
}

/// Outlines in front of all but what a section leaves out, within a view's frame: left, top, width, height.
fn draw_outlines(
    image: &mut Image,
    (camera, cut): (&Camera, Option<Cut>),
    outlines: &[[DVec3; 2]],
    [left, top, width, height]: [i32; 4],
) {
    for segment in outlines {
        let kept = cut.map_or(Some(*segment), |cut| {
            let depth = |p: DVec3| cut.offset_mm - cut.normal.dot(p);
            within(*segment, segment.map(depth))
        });
        let projected = kept.map(|kept| kept.map(|p| camera.project(p) / SAMPLES_PER_PIXEL));
        let sides = [
            |p: DVec3, _: DVec3| p.x,
            |p: DVec3, size: DVec3| size.x - p.x,
            |p: DVec3, _: DVec3| p.y,
            |p: DVec3, size: DVec3| size.y - p.y,
        ];
        let size = DVec3::new(f64::from(width - 1), f64::from(height - 1), 0.0);
        let seen = sides.iter().fold(projected, |segment, side| {
            segment.and_then(|segment| within(segment, segment.map(|p| side(p, size))))
        });
        if let Some(seen) = seen {
            let [from, to] = seen.map(|p| [left + p.x.round() as i32, top + p.y.round() as i32]);
            image.line(from, to, 1, FIXTURE);
        }
    }
}

/// The piece of a segment between its ends where the depth, which is linear, is not negative.
fn within([a, b]: [DVec3; 2], [at_a, at_b]: [f64; 2]) -> Option<[DVec3; 2]> {
    let crossing = || a + (b - a) * (at_a / (at_a - at_b));
    match (at_a >= 0.0, at_b >= 0.0) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, crossing()]),
        (false, true) => Some([crossing(), b]),
        (false, false) => None,
    }
}

fn draw_title(image: &mut Image, part: &PartView, lines: &[&str]) {
    let width = image.width() - 40;
    let title = format!("{}: {}", part.name, lines.first().unwrap_or(&""));
    image.text(20, 10, &fitted(&title, Font::Normal, width), Font::Normal, INK);
    let mut facts = vec![part.cutter.to_string(), format!("{} sites", part.sites.len())];
    let corners = part.sites.points.iter().map(|p| p.as_dvec3());
    let bounds = part.mesh.and_then(Mesh::bounds).or_else(|| {
        corners.fold(None, |b, p| {
            Some(b.map_or((p, p), |(l, h): (DVec3, DVec3)| (l.min(p), h.max(p))))
        })
    });
    if let Some((lo, hi)) = bounds {
        let size = hi - lo;
        facts.push(format!(
            "box {:.4} × {:.4} × {:.4} mm",
            short(size.x),
            short(size.y),
            short(size.z)
        ));
    }
    facts.extend((!part.outlines.is_empty()).then(|| "fixtures in violet".to_string()));
    facts.retain(|f| !f.is_empty());
    let facts = fitted(&facts.join("  ·  "), Font::Bold, width);
    image.text(20, 38, &facts, Font::Bold, FAINT);
    for (y, line) in (38 + LINE..).step_by(LINE as usize).zip(lines.iter().skip(1)) {
        image.text(20, y as i32, &fitted(line, Font::Bold, width), Font::Bold, FAINT);
    }
}

/// A length with about four digits.
fn short(x: f64) -> String {
    let digits = if x >= 100.0 {
        0
    } else if x >= 10.0 {
        1
    } else {
        3
    };
    format!("{x:.digits$}")
}

/// Groups side by side; in two rows, names cut short, if there is no room for that.
fn draw_legend(image: &mut Image, coloring: &Coloring) {
    let y = (image.height() - FOOT) as i32 + 24;
    let mut x = 260;
    if let Coloring::Difference { positive, .. } = coloring {
        let head = format!("{positive}?");
        image.text(x, y, &head, Font::Bold, INK);
        x += Font::Bold.width(&head) as i32 + 24;
    }
    let room = image.width() as i32 - x;
    let entries = legend_entries(coloring, i32::MAX);
    if entries.iter().map(|(_, text)| entry_width(text)).sum::<i32>() <= room {
        for (color, text) in &entries {
            draw_entry(image, [x, y], *color, text);
            x += entry_width(text);
        }
        return;
    }
    let columns = entries.len().div_ceil(2) as i32;
    let width = room / columns;
    for (i, (color, text)) in (0..).zip(legend_entries(coloring, width)) {
        let place = [x + i % columns * width, y - 14 + i / columns * 26];
        draw_entry(image, place, color, &text);
    }
}

/// Color and words of each group; names are cut so that an entry takes at most `width` pixels.
fn legend_entries(coloring: &Coloring, width: i32) -> Vec<(Rgb, String)> {
    let entry = |(class, share): (&Class, f64)| {
        let share = format!(" {:.1} %", 100.0 * share);
        let room = (width - entry_width(&share)).max(0) as u32;
        (class.color, fitted(class.name, Font::Bold, room) + &share)
    };
    coloring.classes().iter().zip(coloring.legend_shares()).map(entry).collect()
}

/// Pixels that a legend's entry takes, with its box and the gap to the next.
fn entry_width(text: &str) -> i32 {
    26 + Font::Bold.width(text) as i32 + 26
}

fn draw_entry(image: &mut Image, [x, y]: [i32; 2], color: Rgb, text: &str) {
    image.rectangle(x, y, 18, 18, INK);
    image.rectangle(x + 1, y + 1, 16, 16, color);
    image.text(x + 26, y, text, Font::Bold, INK);
}

/// A bar of a round number of millimeters at the lower left; `scale` is pixels per millimeter.
fn draw_scale_bar(image: &mut Image, scale: f64) {
    let (length, pixels) = scale_bar(scale);
    let (x, y) = (24, (image.height() - 18) as i32);
    image.rectangle(x, y - 2, pixels as u32, 3, INK);
    image.rectangle(x, y - 8, 2, 14, INK);
    image.rectangle(x + pixels as i32 - 2, y - 8, 2, 14, INK);
    image.text(x, y - 30, &format!("{length} mm"), Font::Bold, INK);
}

/// The greatest length 1, 2 or 5 × 10^k mm that takes at most 200 pixels, and its pixels.
fn scale_bar(scale: f64) -> (f64, f64) {
    let exponents = (-6..7).map(|k| if k < 0 { 1.0 / ten_to(-k) } else { ten_to(k) });
    let lengths = exponents.flat_map(|e| [e, 2.0 * e, 5.0 * e]);
    let length = lengths.take_while(|l| l * scale <= 200.0).last().unwrap_or(1.0);
    (length, (length * scale).round().max(1.0))
}

fn ten_to(k: i32) -> f64 {
    (0..k).fold(1.0, |x, _| x * 10.0)
}

fn draw_axes(image: &mut Image, camera: &Camera, x: i32, y: i32) {
    let mut axes = AXES.map(|(axis, name, color)| (camera.turn(axis), name, color));
    axes.sort_by(|a, b| a.0.z.total_cmp(&b.0.z));
    for (axis, name, color) in axes {
        let tip = [x + (axis.x * 30.0).round() as i32, y - (axis.y * 30.0).round() as i32];
        image.line([x, y], tip, 2, color);
        let letter = [x + (axis.x * 40.0).round() as i32, y - (axis.y * 40.0).round() as i32];
        image.text(letter[0] - 3, letter[1] - 7, name, Font::Small, color);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::par;
    use glam::Vec3;

    #[test]
    fn entries_of_a_crowded_legend_are_cut_to_their_room() {
        let long = "a tool that has a very long name indeed";
        let classes = [Class { name: long, color: INK }, Class { name: "b", color: INK }];
        let groups = Coloring::Groups { classes: &classes, of: &[0, 1, 1, 1], areas: &[] };
        let cut = legend_entries(&groups, 285);
        assert!(cut.iter().all(|(_, text)| entry_width(text) <= 285), "{cut:?}");
        assert!(cut[0].1.starts_with("a tool that") && cut[0].1.ends_with(".. 25.0 %"), "{cut:?}");
        assert_eq!(cut[1].1, "b 75.0 %");
        assert!(legend_entries(&groups, i32::MAX)[0].1.starts_with(long));
    }

    /// A block 40 × 20 × 10 mm and a lattice of sites on it.
    fn block() -> (Mesh, Sites) {
        let corner = |i: usize| {
            let bit = |k: usize| f64::from(u8::from(i >> k & 1 == 1));
            DVec3::new(40.0 * bit(0), 20.0 * bit(1), 10.0 * bit(2))
        };
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        let mesh = Mesh { vertices: (0..8).map(corner).collect(), triangles: triangles.collect() };
        let mut sites = Sites::default();
        for (face, quad) in quads.iter().enumerate() {
            let [a, b, _, d] = quad.map(|v| corner(v as usize));
            let normal = mesh.area_vector(2 * face).normalize().as_vec3();
            for k in 0..64 {
                let (s, t) = ((f64::from(k % 8) + 0.5) / 8.0, (f64::from(k / 8) + 0.5) / 8.0);
                sites.points.push((a + (b - a) * s + (d - a) * t).as_vec3());
                sites.normals.push(normal);
                sites.faces.push(2 * face as u32);
            }
        }
        (mesh, sites)
    }

    fn reddish(p: Rgb) -> bool {
        p[0] > 100 && p[0] / 2 > p[1] && p[0] / 2 > p[2]
    }

    #[test]
    fn each_side_shows_its_own_color_with_and_without_a_mesh() {
        let (mesh, sites) = block();
        let below: Vec<bool> = sites.normals.iter().map(|n| n.z < -0.5).collect();
        let none = vec![false; sites.len()];
        let coloring = Coloring::Labels { inaccessible: &below, occlusion: &none };
        for mesh in [Some(&mesh), None] {
            let part =
                PartView { name: "block", mesh, sites: &sites, cutter: "CR 1", outlines: &[] };
            let image = render(&part, "test", &coloring);
            let count = |columns: std::ops::Range<u32>| {
                let rows = HEAD + 20..HEIGHT - FOOT - 90;
                let seen = |y| columns.clone().filter_map(|x| image.pixel(x, y)).collect();
                rows.flat_map(|y| -> Vec<Rgb> { seen(y) }).filter(|p| reddish(*p)).count()
            };
            assert_eq!(count(0..700), 0, "nothing red is seen from above");
            assert!(count(700..1400) > 20_000, "the underside is red");
            let gray = |p: &Rgb| (90..=125).contains(&p[0]) && p[2] > p[0] && p[2] - p[0] < 30;
            let cut =
                (1400..image.width()).flat_map(|x| (HEAD..HEIGHT - FOOT).map(move |y| (x, y)));
            let cut = cut.filter(|(x, y)| image.pixel(*x, *y).is_some_and(|p| gray(&p))).count();
            assert_eq!(cut > 20_000, mesh.is_some(), "the section shows the inside: {cut}");
        }
    }

    #[test]
    fn outlines_are_drawn_over_the_part_but_not_in_front_of_a_section() {
        let (mesh, sites) = block();
        let coloring = Coloring::Plain(sites.len());
        let [low, high] = [DVec3::new(0.0, -3.0, 5.0), DVec3::new(40.0, -3.0, 5.0)];
        let count = |outlines: &[[DVec3; 2]], panel: u32| {
            let part =
                PartView { name: "b", mesh: Some(&mesh), sites: &sites, cutter: "", outlines };
            let image = render(&part, "", &coloring);
            let xs = panel * PANEL..(panel + 1) * PANEL;
            let pixels = xs.flat_map(|x| (HEAD..HEIGHT - FOOT).map(move |y| (x, y)));
            pixels.filter(|(x, y)| image.pixel(*x, *y) == Some(FIXTURE)).count()
        };
        let front = [[low, high]];
        assert_eq!([0, 1, 2].map(|panel| count(&[], panel)), [0, 0, 0]);
        assert!(count(&front, 0) > 200 && count(&front, 1) > 200);
        assert_eq!(count(&front, 2), 0, "the section leaves out what is in front of it");
        let through = [[low, low.with_y(23.0)]];
        assert!(count(&through, 2) > 50);
        let far = [[low, DVec3::new(1e5, -3.0, 5.0)]];
        assert!(count(&far, 0) > 0);
    }

    #[test]
    fn pictures_do_not_depend_on_the_number_of_threads() {
        let (mesh, sites) = block();
        let truth: Vec<bool> = (0..sites.len()).map(|i| i % 3 == 0).collect();
        let predicted: Vec<bool> = (0..sites.len()).map(|i| i % 4 == 0).collect();
        let coloring =
            Coloring::Difference { positive: "inaccessible", truth: &truth, predicted: &predicted };
        let part =
            PartView { name: "block", mesh: Some(&mesh), sites: &sites, cutter: "", outlines: &[] };
        let [one, three] =
            [1, 3].map(|n| par::with_threads(n, || render(&part, "", &coloring)).unwrap());
        assert!(one == three);
    }

    #[test]
    fn further_lines_of_the_caption_take_room_of_their_own() {
        let (mesh, sites) = block();
        let part = PartView {
            name: "block",
            mesh: Some(&mesh),
            sites: &sites,
            cutter: "CR 1",
            outlines: &[],
        };
        let coloring = Coloring::Plain(sites.len());
        let [one, two] =
            ["a", "a\n150 directions"].map(|caption| render(&part, caption, &coloring));
        assert_eq!((one.height(), two.height()), (HEIGHT, HEIGHT + LINE));
        let inked = |y: u32| (0..two.width()).any(|x| two.pixel(x, y) != Some(BACKGROUND));
        assert!((38 + LINE..38 + 2 * LINE).any(inked));
    }

    #[test]
    fn scale_bars_are_round_and_fit() {
        assert_eq!(scale_bar(4.0), (50.0, 200.0));
        assert_eq!(scale_bar(0.3), (500.0, 150.0));
        assert_eq!(scale_bar(1000.0), (0.2, 200.0));
    }

    #[test]
    fn empty_and_flat_inputs_draw_something() {
        let nothing = Mesh::default();
        assert_eq!(thumbnail(&nothing, 40, 30).pixel(20, 15), Some(BACKGROUND));
        let sites = Sites { points: vec![Vec3::ONE], normals: vec![Vec3::Z], faces: vec![] };
        let coloring = Coloring::Labels { inaccessible: &[true], occlusion: &[false] };
        let part = PartView { name: "dot", mesh: None, sites: &sites, cutter: "", outlines: &[] };
        let image = render(&part, "", &coloring);
        assert!(image.pixel(350, 400).is_some_and(reddish));
    }
}
