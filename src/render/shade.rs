//! Shading: light, ambient occlusion, edge lines, and the mean of 2 × 2 samples per pixel.

use super::Rgb;
use super::camera::Camera;
use super::image::Image;
use super::raster::Fragment;
use crate::exec::par;
use glam::{DVec3, Vec3};

/// Samples per pixel side.
pub const SAMPLES: usize = 2;
/// Direction to the light in the camera's frame: right, up (down when seen from below), forward.
const LIGHT: DVec3 = DVec3::new(-0.30, 0.40, 0.87);
/// Brightness of a face that faces away from the light, and what full light adds.
const AMBIENT: f32 = 0.30;
const DIFFUSE: f32 = 0.72;
/// Neighboring samples whose normals turn by more than this show an edge line: cosine of 30°.
const EDGE_COS: f32 = 0.866;
/// Samples further than this many pixels off the tangent plane show an edge line.
const EDGE_OFFSET: f32 = 5.0;
/// Brightness of edge lines.
const EDGE_DARKNESS: f32 = 0.45;
/// Rings and spokes of the pattern that looks for what surrounds a sample, and its strength.
const RINGS: [f64; 3] = [7.0, 19.0, 46.0];
const SPOKES: usize = 6;
const CORNER_STRENGTH: f32 = 0.75;

/// How a view is lit.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Color where there is no part.
    pub background: Rgb,
    /// Whether edges get dark lines.
    pub edges: bool,
    /// Whether the light comes from below, with the eye.
    pub from_below: bool,
}

/// Turns `fragments` of `camera` (which has [`SAMPLES`] samples per pixel side) into an image.
///
/// `color` gives the color of a fragment seen at a point (mm) before shading.
pub fn shade(
    fragments: &[Fragment],
    camera: &Camera,
    look: Look,
    color: impl Fn(&Fragment, DVec3) -> Rgb + Sync,
) -> Image {
    let (width, height) = (camera.width / SAMPLES, camera.height / SAMPLES);
    let mut image = Image::new(width as u32, height as u32, look.background);
    let up = if look.from_below { -LIGHT.y } else { LIGHT.y };
    let light = DVec3::new(LIGHT.x, up, LIGHT.z).normalize();
    let scene = Scene { fragments, camera, pattern: pattern(), light, look };
    par::for_each_block(image.bytes_mut(), 3 * width.max(1), |y, row| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let bytes = scene.pixel(x, y, &color).to_array();
            pixel.copy_from_slice(&bytes.map(|c| (c + 0.5).clamp(0.0, 255.0) as u8));
        }
    });
    image
}

struct Scene<'a> {
    fragments: &'a [Fragment],
    camera: &'a Camera,
    pattern: Vec<[i64; 2]>,
    light: DVec3,
    look: Look,
}

impl Scene<'_> {
    /// Mean color of the samples of a pixel, 0 to 255; what encloses it is computed once.
    fn pixel(&self, x: usize, y: usize, color: &impl Fn(&Fragment, DVec3) -> Rgb) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let mut openness = None;
        for k in 0..SAMPLES * SAMPLES {
            let at = [x * SAMPLES + k % SAMPLES, y * SAMPLES + k / SAMPLES];
            let fragment = &self.fragments[at[1] * self.camera.width + at[0]];
            if fragment.hit() {
                let point = self.point(at, fragment);
                let open = *openness.get_or_insert_with(|| self.openness(at, point, fragment));
                let edge = self.look.edges && self.is_edge(at, point, fragment);
                let line = if edge { EDGE_DARKNESS } else { 1.0 };
                sum += vector(color(fragment, point)) * (self.light(fragment) * open * line);
            } else {
                sum += vector(self.look.background);
            }
        }
        sum / (SAMPLES * SAMPLES) as f32
    }

    /// Brightness of a surface by its normal alone; faces turned from the light keep their shape.
    fn light(&self, fragment: &Fragment) -> f32 {
        let normal = self.camera.turn(fragment.normal.as_dvec3());
        AMBIENT + DIFFUSE * (0.5 + 0.5 * normal.dot(self.light) as f32)
    }

    fn point(&self, at: [usize; 2], fragment: &Fragment) -> DVec3 {
        let [x, y] = at.map(|c| c as f64 + 0.5);
        self.camera.unproject(x, y, f64::from(fragment.depth))
    }

    /// The fragment at an offset; `None` outside the image.
    fn neighbor(&self, at: [usize; 2], offset: [i64; 2]) -> Option<([usize; 2], &Fragment)> {
        let x = at[0].checked_add_signed(offset[0] as isize)?;
        let y = at[1].checked_add_signed(offset[1] as isize)?;
        let inside = x < self.camera.width && y < self.camera.height;
        inside.then(|| ([x, y], &self.fragments[y * self.camera.width + x]))
    }

    /// Whether the surface bends or breaks off right beside this sample.
    fn is_edge(&self, at: [usize; 2], point: DVec3, fragment: &Fragment) -> bool {
        let furthest = EDGE_OFFSET / self.camera.scale as f32;
        [[1, 0], [0, 1], [-1, 0], [0, -1]].into_iter().any(|offset| {
            let Some((at, other)) = self.neighbor(at, offset) else { return false };
            let step = || (self.point(at, other) - point).as_vec3();
            !other.hit()
                || fragment.normal.dot(other.normal) < EDGE_COS
                || step().dot(fragment.normal).abs() > furthest
        })
    }

    /// Brightness left by the part around a sample: 1 in the open, less in corners and pockets.
    fn openness(&self, at: [usize; 2], point: DVec3, fragment: &Fragment) -> f32 {
        let reach = 1.5 * RINGS[RINGS.len() - 1] / self.camera.scale;
        let mut sum = 0.0;
        for offset in &self.pattern {
            let Some((at, other)) = self.neighbor(at, *offset) else { continue };
            if !other.hit() {
                continue;
            }
            let step = self.point(at, other) - point;
            let distance = step.length();
            let rise = step.as_vec3().dot(fragment.normal) / distance.max(f64::MIN_POSITIVE) as f32;
            let near = (1.0 - distance / reach).max(0.0) as f32;
            sum += (rise - 0.08).max(0.0) * near;
        }
        1.0 - CORNER_STRENGTH * (sum / self.pattern.len() as f32).min(1.0)
    }
}

/// Offsets of the samples looked at, in sample widths.
fn pattern() -> Vec<[i64; 2]> {
    let spoke = |ring: usize, k: usize| {
        let turn = (k as f64 + ring as f64 / RINGS.len() as f64) / SPOKES as f64;
        let angle = std::f64::consts::TAU * turn;
        [libm::cos(angle), libm::sin(angle)].map(|c| (RINGS[ring] * c).round() as i64)
    };
    (0..RINGS.len()).flat_map(|ring| (0..SPOKES).map(move |k| spoke(ring, k))).collect()
}

fn vector(color: Rgb) -> Vec3 {
    Vec3::from_array(color.map(f32::from))
}
