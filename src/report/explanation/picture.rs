//! A section through tool and part along the tool's axis.

use super::shape::Shape;
use super::{About, answer_words, short, triple};
use crate::geom::Mesh;
use crate::render::image::{Font, Image, fitted};
use crate::report::Rgb;
use crate::tool::cutter::{Assembly, ToolPart};
use glam::{DVec2, DVec3, dvec2};

const PANEL: [u32; 2] = [700, 640];
const HEAD: u32 = 96;
const FOOT: u32 = 64;
const WHITE: Rgb = [255, 255, 255];
const INK: Rgb = [40, 42, 46];
const FAINT: Rgb = [120, 124, 130];
const PART: Rgb = [168, 174, 182];
const FIXTURE: Rgb = [120, 96, 60];
/// What of the tool is in the part.
const PENETRATES: Rgb = [206, 58, 44];
const SITE: Rgb = [20, 20, 20];
/// In the order of [`ToolPart::ALL`].
const TOOL: [Rgb; 5] =
    [[140, 190, 235], [110, 165, 225], [86, 140, 200], [240, 205, 120], [222, 226, 200]];
/// A plane this near to the axis and the normal shows the same, cosine.
const SAME: f64 = 0.9;

/// A section in the plane of the tool's axis and the site's normal, and a second one in that of the axis and the place
/// that blocks if it differs. The direction is the witness, or the one nearest to being free.
pub fn picture(about: &About) -> Image {
    let scene = Scene::of(about);
    let panels = scene.panels();
    let mut image = Image::new(PANEL[0] * panels.len() as u32, HEAD + PANEL[1] + FOOT, WHITE);
    for (k, (across, words)) in panels.iter().enumerate() {
        let left = k as u32 * PANEL[0];
        scene.draw(&mut image, left, *across);
        if k > 0 {
            image.rectangle(left as i32 - 1, HEAD as i32, 2, PANEL[1], FAINT);
        }
        image.text(left as i32 + 20, HEAD as i32 - 22, words, Font::Small, FAINT);
    }
    scene.draw_words(&mut image, about);
    image
}

struct Scene<'a> {
    about: About<'a>,
    /// From tip to spindle.
    axis: DVec3,
    site: DVec3,
    normal: DVec3,
    reference: DVec3,
    at: Option<DVec3>,
    shape: Shape,
    /// Pixels per mm, and height of the picture's middle above the reference point, mm.
    scale: f64,
    middle: f64,
    words: String,
}

impl<'a> Scene<'a> {
    fn of(about: &About<'a>) -> Self {
        let sites = &about.query.file.sites;
        let site = sites.points[about.site].as_dvec3();
        let normal = sites.normals[about.site].as_dvec3().normalize_or(DVec3::Z);
        let nearest = about.why.nearest();
        let witness = about.why.witness.map(|witness| witness.direction);
        let direction = witness.or(nearest.map(|state| state.direction));
        let axis = direction.map_or(normal, |d| d.as_dvec3().normalize());
        let blocked = nearest.and_then(|state| state.blocked).filter(|_| witness.is_none());
        let words = match (witness, blocked) {
            (Some(_), _) => format!("free pose from {}", triple(axis, 3)),
            (None, Some(b)) => format!(
                "nearest to being free: from {}, the {} penetrates by {} mm (x)",
                triple(axis, 3),
                b.part,
                short(b.penetration_mm)
            ),
            (None, None) => {
                nearest.and_then(|state| state.reason()).map_or(String::new(), |reason| {
                    format!("nearest to being free: from {}, {reason}", triple(axis, 3))
                })
            }
        };
        let assembly: &Assembly = &about.query.tool.assembly;
        let shape = Shape::of(assembly, about.query.tool.clearance_mm);
        let reference = match &shape {
            Shape::Steps { corner, side, .. } => {
                let across = normal - axis * normal.dot(axis);
                let away = if *side > 0.0 && across.length() > 1e-6 { *side } else { 0.0 };
                site + normal * *corner + across.normalize_or_zero() * away
            }
            // Where it touches is known of a pose alone.
            Shape::Profile { .. } => {
                let found = about.why.witness.and_then(|witness| witness.tip_mm);
                found.or(about.why.nearest_pose.map(|near| near.pose.tip_mm)).unwrap_or(site)
            }
        };
        let at = blocked.map(|blocked| blocked.at_mm);
        let mut scene = Scene {
            about: *about,
            axis,
            site,
            normal,
            reference,
            at,
            shape,
            scale: 1.0,
            middle: 0.0,
            words,
        };
        scene.fit();
        scene
    }

    /// The tip, the nose of the holder, the site and the place that blocks are seen.
    fn fit(&mut self) {
        let height = |p: DVec3| (p - self.reference).dot(self.axis);
        let distance = |p: DVec3| {
            let offset = p - self.reference;
            (offset - self.axis * offset.dot(self.axis)).length()
        };
        let end = self.shape.radius();
        let mut low = -self.shape.above_tip() - 0.5 * end;
        let mut high = 3.0 * end;
        let mut wide = 3.0 * end;
        if let Some(nose) = self.shape.nose() {
            high = high.max(nose + end);
        }
        for p in self.at.into_iter().chain([self.site]) {
            low = low.min(height(p));
            high = high.max(height(p) + end);
            wide = wide.max(distance(p) + end);
        }
        let [width, rows] = PANEL.map(f64::from);
        let margin = 1.25;
        self.scale = (rows / (margin * (high - low))).min(width / (2.0 * margin * wide));
        self.middle = 0.5 * (low + high);
    }

    /// Unit vectors across the axis, each for a picture, and what it shows.
    fn panels(&self) -> Vec<(DVec3, String)> {
        let across = |v: DVec3| (v - self.axis * v.dot(self.axis)).try_normalize();
        let normal = across(self.normal).filter(|_| self.normal.dot(self.axis).abs() < 0.9999);
        let blocking = self.at.and_then(|at| across(at - self.reference));
        let same_side = |b: DVec3| if normal.is_some_and(|n| n.dot(b) < 0.0) { -b } else { b };
        let blocking = blocking.map(same_side);
        let mut panels = Vec::new();
        if let Some(normal) = normal {
            panels.push((normal, "section in the plane of axis and normal".to_string()));
        }
        if let Some(blocking) = blocking
            && normal.is_none_or(|normal| normal.dot(blocking).abs() < SAME)
        {
            panels.push((blocking, "section through axis and the place that blocks".to_string()));
        }
        if panels.is_empty() {
            let any = self.axis.any_orthonormal_vector();
            panels.push((any, "section through the axis".to_string()));
        }
        panels
    }

    /// Where a point of the plane is in the panel.
    fn pixel(&self, p: DVec2) -> DVec2 {
        let [width, height] = PANEL.map(f64::from);
        dvec2(0.5 * width + self.scale * p.x, 0.5 * height - self.scale * (p.y - self.middle))
    }

    fn draw(&self, image: &mut Image, left: u32, across: DVec3) {
        let segments = |mesh: Option<&Mesh>| {
            let cut = mesh.map(|mesh| cut(mesh, self.reference, [across, self.axis]));
            let place = |[a, b]: [DVec2; 2]| [self.pixel(a), self.pixel(b)];
            cut.unwrap_or_default().into_iter().map(place).collect::<Vec<_>>()
        };
        let part = segments(self.about.query.mesh.as_ref());
        let inside = rows(&part);
        for y in 0..PANEL[1] {
            let mut crossings = inside[y as usize].iter().peekable();
            let mut is_inside = false;
            let height =
                self.middle + (0.5 * f64::from(PANEL[1]) - f64::from(y) - 0.5) / self.scale;
            let parts = self.shape.at(height);
            for x in 0..PANEL[0] {
                while crossings.next_if(|at| **at <= f64::from(x) + 0.5).is_some() {
                    is_inside = !is_inside;
                }
                let along = (f64::from(x) + 0.5 - 0.5 * f64::from(PANEL[0])) / self.scale;
                let part = parts.iter().find(|(_, radius)| along.abs() <= *radius);
                let color = match (part, is_inside) {
                    (Some(_), true) => PENETRATES,
                    (Some((part, _)), false) => TOOL[*part as usize],
                    (None, true) => PART,
                    (None, false) => continue,
                };
                image.set(i64::from(left + x), i64::from(HEAD + y), color);
            }
        }
        let mut lines = |segments: &[[DVec2; 2]], color: Rgb| {
            for [a, b] in segments.iter().filter_map(|s| clipped(*s)) {
                let at =
                    |p: DVec2| [(f64::from(left) + p.x) as i32, (f64::from(HEAD) + p.y) as i32];
                image.line(at(a), at(b), 1, color);
            }
        };
        lines(&part, INK);
        lines(&segments(self.about.query.fixtures.as_ref()), FIXTURE);
        self.draw_marks(image, left, across);
    }

    fn draw_marks(&self, image: &mut Image, left: u32, across: DVec3) {
        let in_plane = |p: DVec3| {
            let offset = p - self.reference;
            let p = self.pixel(dvec2(offset.dot(across), offset.dot(self.axis)));
            [(f64::from(left) + p.x) as i32, (f64::from(HEAD) + p.y) as i32]
        };
        let [x, y] = in_plane(self.site);
        image.line([x - 7, y], [x + 7, y], 2, SITE);
        image.line([x, y - 7], [x, y + 7], 2, SITE);
        image.text(x + 9, y + 3, "site", Font::Small, SITE);
        let Some(at) = self.at else { return };
        let offset = at - self.reference;
        let away = offset - self.axis * offset.dot(self.axis);
        let beside = (away - across * away.dot(across)).length();
        if beside * self.scale < 3.0 || away.dot(across).abs() >= SAME * away.length() {
            let [x, y] = in_plane(at);
            for (dx, dy) in [(-8, -8), (-8, 8)] {
                image.line([x + dx, y + dy], [x - dx, y - dy], 3, [120, 0, 0]);
            }
        }
    }

    /// What cuts and what does not, of a profile.
    fn name_of(&self, part: ToolPart) -> &'static str {
        match (&self.shape, part) {
            (Shape::Profile { .. }, ToolPart::Tip) => "what cuts",
            (Shape::Profile { .. }, ToolPart::Shank) => "neck and shank",
            _ => part.name(),
        }
    }

    fn draw_words(&self, image: &mut Image, about: &About) {
        let provenance = &about.query.file.provenance;
        let width = image.width();
        let title = format!(
            "{}, site {} at {}: {}",
            provenance.part,
            about.site,
            triple(self.site, 2),
            answer_words(about.why.answer)
        );
        let lines = [(title, Font::Bold), (provenance.tool.clone(), Font::Small)];
        let lines = lines.into_iter().chain([(self.words.clone(), Font::Small)]);
        for (k, (line, font)) in lines.enumerate() {
            let line = fitted(&line, font, width - 40);
            image.text(20, 8 + 22 * k as i32, &line, font, INK);
        }
        let mut x = 20;
        let y = (HEAD + PANEL[1] + 10) as i32;
        let mut legend: Vec<(Rgb, String)> = ToolPart::ALL
            .iter()
            .filter(|part| about.query.tool.assembly.has(**part))
            .map(|part| (TOOL[*part as usize], self.name_of(*part).to_string()))
            .collect();
        legend.push((PART, "part".into()));
        legend.push((PENETRATES, "tool in the part".into()));
        if about.query.fixtures.is_some() {
            legend.push((FIXTURE, "fixtures".into()));
        }
        for (color, words) in legend {
            image.rectangle(x, y, 14, 14, color);
            image.text(x + 19, y, &words, Font::Small, INK);
            x += 19 + Font::Small.width(&words) as i32 + 16;
        }
        let (length, pixels) = bar(self.scale);
        let y = (HEAD + PANEL[1] + 44) as i32;
        image.line([20, y], [20 + pixels as i32, y], 3, INK);
        image.text(28 + pixels as i32, y - 7, &format!("{length} mm"), Font::Small, INK);
    }
}

/// A round length and its pixels.
fn bar(scale: f64) -> (f64, f64) {
    let lengths = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0];
    let length = lengths.into_iter().filter(|l| l * scale <= 180.0).fold(0.1, f64::max);
    (length, length * scale)
}

/// Where a plane through `origin` cuts the triangles of a mesh, along its two unit vectors.
fn cut(mesh: &Mesh, origin: DVec3, [across, axis]: [DVec3; 2]) -> Vec<[DVec2; 2]> {
    let normal = across.cross(axis);
    let mut segments = Vec::new();
    for f in 0..mesh.triangles.len() {
        let corners = mesh.corners(f).map(|p| p - origin);
        // A little aside, where no corner is.
        let beside = corners.map(|p| p.dot(normal) - 1e-7);
        let mut ends = [DVec2::ZERO; 2];
        let mut n = 0;
        for k in 0..3 {
            let (a, b) = (beside[k], beside[(k + 1) % 3]);
            if (a > 0.0) != (b > 0.0) && n < 2 {
                let p = corners[k].lerp(corners[(k + 1) % 3], a / (a - b));
                ends[n] = dvec2(p.dot(across), p.dot(axis));
                n += 1;
            }
        }
        if n == 2 {
            segments.push(ends);
        }
    }
    segments
}

/// Where segments cross the middle of each row of pixels, from left to right.
fn rows(segments: &[[DVec2; 2]]) -> Vec<Vec<f64>> {
    let mut rows = vec![Vec::new(); PANEL[1] as usize];
    for [a, b] in segments {
        let (low, high) = (a.y.min(b.y), a.y.max(b.y));
        let first = (low - 0.5).ceil().max(0.0);
        let mut row = first;
        while row + 0.5 < high && row < f64::from(PANEL[1]) {
            if row + 0.5 >= low {
                let share = (row + 0.5 - a.y) / (b.y - a.y);
                rows[row as usize].push(a.x + share * (b.x - a.x));
            }
            row += 1.0;
        }
    }
    rows.iter_mut().for_each(|row| row.sort_by(f64::total_cmp));
    rows
}

/// The part of a segment in the panel.
fn clipped([a, b]: [DVec2; 2]) -> Option<[DVec2; 2]> {
    let (low, high) = (DVec2::ZERO, dvec2(f64::from(PANEL[0]), f64::from(PANEL[1])) - 1.0);
    let run = b - a;
    let (mut start, mut end) = (0.0f64, 1.0f64);
    for k in 0..2 {
        if run[k] == 0.0 {
            if a[k] < low[k] || a[k] > high[k] {
                return None;
            }
            continue;
        }
        let (s, t) = ((low[k] - a[k]) / run[k], (high[k] - a[k]) / run[k]);
        start = start.max(s.min(t));
        end = end.min(s.max(t));
    }
    (start < end).then(|| [a + run * start, a + run * end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::cuboid;

    #[test]
    fn a_cut_cube_is_a_square_and_its_rows_are_inside_between_two_crossings() {
        let mesh = cuboid(DVec3::splat(20.0));
        let origin = DVec3::new(10.0, 9.0, 10.0);
        let segments = cut(&mesh, origin, [DVec3::X, DVec3::Z]);
        let length: f64 = segments.iter().map(|[a, b]| a.distance(*b)).sum();
        assert!((length - 80.0).abs() < 1e-9, "{length}");
        let placed: Vec<[DVec2; 2]> =
            segments.iter().map(|s| s.map(|p| dvec2(350.0, 320.0) + 10.0 * p)).collect();
        for (y, row) in rows(&placed).iter().enumerate() {
            let expected = if (220..420).contains(&y) { 2 } else { 0 };
            assert_eq!(row.len(), expected, "{y}");
        }
        let outside = [dvec2(-50.0, 10.0), dvec2(-10.0, 10.0)];
        assert!(clipped(outside).is_none());
        let [a, b] = clipped([dvec2(-50.0, 10.0), dvec2(50.0, 10.0)]).unwrap();
        assert!(a.x == 0.0 && b.x == 50.0);
    }
}
