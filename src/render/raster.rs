//! A rasterizer with a depth buffer: which face is visible at each pixel.

use super::camera::Camera;
use crate::exec::par;
use crate::geom::{Mesh, Sites};
use glam::{DVec3, Vec3};

/// Faces that meet at less than this angle look smooth: cosine of 35°.
const SMOOTH_COS: f32 = 0.819;
/// Faces lower than this share of the part's diagonal have no normal of their own.
const SLIVER: f64 = 2e-5;
/// Rows per task.
const BAND: usize = 32;
/// Pixels by which faces overlap, so that rounding leaves no gap along a shared edge.
const OVERLAP: f64 = 1e-6;
/// Corners of the disc that stands for a site without a surface.
const DISC_CORNERS: u32 = 8;

/// Triangles with a normal at each corner.
pub struct Surface {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<[Vec3; 3]>,
    /// Whether faces that turn their back to the eye are seen.
    two_sided: bool,
}

impl Surface {
    /// A mesh whose gently curved places look smooth and whose edges stay sharp.
    pub fn of_mesh(mesh: &Mesh) -> Self {
        let areas: Vec<Vec3> =
            (0..mesh.triangles.len()).map(|f| mesh.area_vector(f).as_vec3()).collect();
        let (starts, around) = faces_around(mesh);
        let units = unit_normals(mesh, &areas, &starts, &around);
        let corner = |f: usize, v: u32| {
            let range = starts[v as usize] as usize..starts[v as usize + 1] as usize;
            let near = around[range].iter().map(|g| *g as usize);
            let smooth = near.filter(|g| units[*g].dot(units[f]) > SMOOTH_COS);
            let sum: Vec3 = smooth.map(|g| units[g] * areas[g].length()).sum();
            sum.normalize_or(units[f].normalize_or(Vec3::Z))
        };
        let normals =
            (0..mesh.triangles.len()).map(|f| mesh.triangles[f].map(|v| corner(f, v))).collect();
        let (vertices, triangles) = (mesh.vertices.clone(), mesh.triangles.clone());
        Surface { vertices, triangles, normals, two_sided: true }
    }

    /// One disc per site, seen from the side of its normal only; [`Surface::site_of_disc`] gives the site back.
    pub fn of_sites(sites: &Sites, radius: f64) -> Self {
        let corners = DISC_CORNERS as usize;
        let n_triangles = Surface::n_triangles_of_sites(sites.len());
        let mut surface = Surface {
            vertices: Vec::with_capacity(sites.len() * corners),
            triangles: Vec::with_capacity(n_triangles),
            normals: Vec::with_capacity(n_triangles),
            two_sided: false,
        };
        for (p, n) in sites.points.iter().zip(&sites.normals) {
            let first = surface.vertices.len() as u32;
            let (u, v) = n.as_dvec3().normalize_or(DVec3::Z).any_orthonormal_pair();
            for k in 0..corners {
                let angle = std::f64::consts::TAU * k as f64 / corners as f64;
                let offset = u * libm::cos(angle) + v * libm::sin(angle);
                surface.vertices.push(p.as_dvec3() + radius * offset);
            }
            for k in 1..DISC_CORNERS - 1 {
                surface.triangles.push([first, first + k, first + k + 1]);
                surface.normals.push([*n; 3]);
            }
        }
        surface
    }

    /// Triangles of so many discs.
    pub fn n_triangles_of_sites(n_sites: usize) -> usize {
        n_sites.saturating_mul(DISC_CORNERS as usize - 2)
    }

    /// The site whose disc has this face.
    pub fn site_of_disc(face: u32) -> u32 {
        face / (DISC_CORNERS - 2)
    }

    /// Unit normals at the corners of each triangle.
    pub fn corner_normals(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.normals.iter().copied()
    }

    /// Corners of each triangle, mm, with their unit normals.
    pub fn triangles(&self) -> impl Iterator<Item = [(DVec3, Vec3); 3]> + '_ {
        self.triangles.iter().zip(&self.normals).map(|(corners, normals)| {
            [0, 1, 2].map(|k| (self.vertices[corners[k] as usize], normals[k]))
        })
    }

    /// Corners of all triangles, mm.
    pub fn vertices(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.vertices.iter().copied()
    }
}

/// Unit normal of each face. Rounding of the corners turns the normal of a sliver anywhere, so a
/// sliver takes that of the sound face on the other side of its longest edge.
fn unit_normals(mesh: &Mesh, areas: &[Vec3], starts: &[u32], around: &[u32]) -> Vec<Vec3> {
    let thin = SLIVER * mesh.diagonal();
    let longest = |f: usize| {
        let length = |k: usize| {
            let [a, b] = [k, (k + 1) % 3].map(|k| mesh.triangles[f][k] as usize);
            mesh.vertices[a].distance(mesh.vertices[b])
        };
        let k = (0..3).max_by(|i, j| length(*i).total_cmp(&length(*j))).unwrap_or(0);
        (mesh.triangles[f][k], mesh.triangles[f][(k + 1) % 3], length(k))
    };
    let is_sliver = |f: usize| f64::from(areas[f].length()) <= thin * longest(f).2;
    let normal = |f: usize| {
        if !is_sliver(f) {
            return areas[f].normalize_or_zero();
        }
        let (a, b, _) = longest(f);
        let range = starts[a as usize] as usize..starts[a as usize + 1] as usize;
        let across = around[range].iter().map(|g| *g as usize);
        let mut across = across.filter(|g| mesh.triangles[*g].contains(&b) && !is_sliver(*g));
        areas[across.next().unwrap_or(f)].normalize_or_zero()
    };
    (0..mesh.triangles.len()).map(normal).collect()
}

/// Faces at each vertex: starts in the list, and the list.
fn faces_around(mesh: &Mesh) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; mesh.vertices.len() + 1];
    mesh.triangles.iter().flatten().for_each(|v| starts[*v as usize + 1] += 1);
    for v in 1..starts.len() {
        starts[v] += starts[v - 1];
    }
    let mut next = starts.clone();
    let mut around = vec![0; 3 * mesh.triangles.len()];
    for (f, corners) in mesh.triangles.iter().enumerate() {
        for v in corners {
            around[next[*v as usize] as usize] = f as u32;
            next[*v as usize] += 1;
        }
    }
    (starts, around)
}

/// What is seen at a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Fragment {
    /// The face, or [`Fragment::NONE`].
    pub face: u32,
    /// Height toward the eye, mm.
    pub depth: f32,
    /// Unit normal, turned toward the eye.
    pub normal: Vec3,
    /// Whether the face is seen from its back.
    back: bool,
}

impl Fragment {
    /// No face: the background.
    pub const NONE: u32 = u32::MAX;
    /// No face: the plane of a section, inside the part.
    const CUT: u32 = u32::MAX - 1;
    const EMPTY: Fragment = Fragment {
        face: Fragment::NONE,
        depth: f32::NEG_INFINITY,
        normal: Vec3::ZERO,
        back: false,
    };

    /// Whether a face is seen.
    pub fn hit(&self) -> bool {
        self.face != Fragment::NONE
    }

    /// Whether it is the plane of a section, inside the part.
    pub fn is_cut(&self) -> bool {
        self.face == Fragment::CUT
    }
}

/// What a section leaves out: points `p` with `normal · p > offset_mm`.
#[derive(Debug, Clone, Copy)]
pub struct Cut {
    /// Unit normal, toward the eye.
    pub normal: DVec3,
    /// Place along it, mm.
    pub offset_mm: f64,
}

/// As [`draw`], of what a section leaves of a closed surface: where the back of a face is seen, the plane cuts the
/// part.
pub fn draw_cut(surface: &Surface, camera: &Camera, cut: Cut) -> Vec<Fragment> {
    let mut fragments = draw_where(surface, camera, |x, y, depth| {
        camera.unproject(x, y, depth).dot(cut.normal) <= cut.offset_mm
    });
    let slope = camera.turn(cut.normal);
    let width = camera.width.max(1);
    for (i, fragment) in fragments.iter_mut().enumerate().filter(|(_, f)| f.back && f.hit()) {
        let foot = camera.unproject((i % width) as f64 + 0.5, (i / width) as f64 + 0.5, 0.0);
        let depth = ((cut.offset_mm - foot.dot(cut.normal)) / slope.z) as f32;
        let normal = cut.normal.as_vec3();
        *fragment = Fragment { face: Fragment::CUT, depth, normal, back: false };
    }
    fragments
}

/// The nearest face at every pixel of the camera, row by row; ties go to the lower face index.
pub fn draw(surface: &Surface, camera: &Camera) -> Vec<Fragment> {
    draw_where(surface, camera, |_, _, _| true)
}

/// As [`draw`], of the points that `keep` admits by their pixel and height.
fn draw_where(
    surface: &Surface,
    camera: &Camera,
    keep: impl Fn(f64, f64, f64) -> bool + Sync,
) -> Vec<Fragment> {
    let width = camera.width;
    let corners: Vec<DVec3> = surface.vertices.iter().map(|v| camera.project(*v)).collect();
    let mut fragments = vec![Fragment::EMPTY; width * camera.height];
    par::for_each_block(&mut fragments, BAND * width.max(1), |band, fragments| {
        for f in 0..surface.triangles.len() {
            draw_face(surface, camera, &corners, f, band * BAND, fragments, &keep);
        }
    });
    fragments
}

/// Draws face `f` into the rows of a band that starts at row `top`.
fn draw_face(
    surface: &Surface,
    camera: &Camera,
    corners: &[DVec3],
    f: usize,
    top: usize,
    band: &mut [Fragment],
    keep: &impl Fn(f64, f64, f64) -> bool,
) {
    let [a, b, c] = surface.triangles[f].map(|v| corners[v as usize]);
    let double = (b - a).truncate().perp_dot((c - a).truncate());
    // Rows grow downward, so a face seen from its front has negative area here.
    let hidden = !surface.two_sided && double > 0.0;
    if double == 0.0 || !double.is_finite() || hidden {
        return;
    }
    let (width, n_rows) = (camera.width, band.len() / camera.width);
    let (low, high) = (a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y));
    let rows = pixels(low, high, top, top + n_rows);
    for row in rows {
        let y = row as f64 + 0.5;
        let edges = [(b, c), (c, a), (a, b)].map(|(p, q)| Edge::new(p, q, y, double));
        let (mut left, mut right) = (f64::NEG_INFINITY, f64::INFINITY);
        edges.iter().for_each(|e| e.narrow(&mut left, &mut right));
        for x in pixels(left - OVERLAP, right + OVERLAP, 0, width) {
            let weights = edges.map(|e| e.weight(x as f64 + 0.5));
            let depth = (weights[0] * a.z + weights[1] * b.z + weights[2] * c.z) as f32;
            let fragment = &mut band[(row - top) * width + x];
            if depth > fragment.depth && keep(x as f64 + 0.5, y, f64::from(depth)) {
                let corner = |k: usize| surface.normals[f][k] * weights[k] as f32;
                let normal = (corner(0) + corner(1) + corner(2)).normalize_or(Vec3::Z);
                let away = camera.turn(normal.as_dvec3()).z < 0.0;
                let normal = if away { -normal } else { normal };
                *fragment = Fragment { face: f as u32, depth, normal, back: double > 0.0 };
            }
        }
    }
}

/// Pixels whose centers lie in `[low, high]`, cut to `first..end`.
fn pixels(low: f64, high: f64, first: usize, end: usize) -> std::ops::Range<usize> {
    let begin = (low - 0.5).ceil().max(first as f64);
    let stop = ((high - 0.5).floor() + 1.0).min(end as f64);
    if begin < stop { begin as usize..stop as usize } else { 0..0 }
}

/// The weight of one corner along a row: `slope · x + start`, 1 at the corner, 0 on the far edge.
#[derive(Clone, Copy)]
struct Edge {
    slope: f64,
    start: f64,
}

impl Edge {
    fn new(p: DVec3, q: DVec3, y: f64, double_area: f64) -> Self {
        let slope = (p.y - q.y) / double_area;
        Edge { slope, start: (q.x - p.x) * (y - p.y) / double_area - slope * p.x }
    }

    fn weight(self, x: f64) -> f64 {
        self.slope * x + self.start
    }

    /// Cuts the interval to where the weight is not negative.
    fn narrow(self, left: &mut f64, right: &mut f64) {
        if self.slope > 0.0 {
            *left = left.max(-self.start / self.slope);
        } else if self.slope < 0.0 {
            *right = right.min(-self.start / self.slope);
        } else if self.start < 0.0 {
            *right = f64::NEG_INFINITY;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares one above the other, the lower one larger.
    fn steps() -> Mesh {
        let square = |s: f64, z: f64| {
            [(-s, -s), (s, -s), (s, s), (-s, s)].map(|(x, y)| DVec3::new(x, y, z)).to_vec()
        };
        let vertices = [square(2.0, 0.0), square(1.0, 1.0)].concat();
        Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]] }
    }

    #[test]
    fn nearer_faces_hide_others_and_shared_edges_leave_no_gap() {
        let mut camera = Camera::new(DVec3::new(0.0, -1e-9, 1.0), 64, 64);
        camera.scale = 12.4;
        let surface = Surface::of_mesh(&steps());
        let fragments = draw(&surface, &camera);
        let count = |faces: [u32; 2]| fragments.iter().filter(|f| faces.contains(&f.face)).count();
        assert_eq!((count([2, 3]), count([0, 1])), (24 * 24, 50 * 50 - 24 * 24));
        assert!((fragments[32 * 64 + 32].depth - 1.0).abs() < 1e-6);
        let one = par::with_threads(1, || draw(&surface, &camera)).unwrap();
        assert!(one.iter().zip(&fragments).all(|(a, b)| a.face == b.face && a.depth == b.depth));
    }

    #[test]
    fn discs_lie_at_their_sites_and_face_along_the_normal() {
        let points = vec![Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO];
        let sites = Sites { points, normals: vec![Vec3::X, Vec3::Z], ..Sites::default() };
        let surface = Surface::of_sites(&sites, 0.5);
        assert_eq!(Surface::site_of_disc(surface.triangles.len() as u32 - 1), 1);
        for v in &surface.vertices[..8] {
            assert!((v.x - 1.0).abs() < 1e-12 && (v - DVec3::new(1.0, 2.0, 3.0)).length() < 0.51);
        }
        let triangle = surface.triangles[0].map(|v| surface.vertices[v as usize]);
        assert!((triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).x > 0.0);
    }

    #[test]
    fn slivers_take_the_normal_of_their_neighbor() {
        let mut mesh = steps();
        mesh.vertices.push(DVec3::new(0.0, -2.0 - 1e-6, 1e-5));
        mesh.triangles.push([0, 8, 1]);
        let surface = Surface::of_mesh(&mesh);
        assert!(surface.normals[4].iter().all(|n| n.distance(Vec3::Z) < 1e-6));
    }

    #[test]
    fn a_section_shows_the_plane_inside_the_part_and_the_walls_behind() {
        let block = crate::geom::solids::cuboid(DVec3::new(10.0, 8.0, 6.0));
        let surface = Surface::of_mesh(&block);
        let mut camera = Camera::new(DVec3::new(0.0, -1.0, 0.0), 64, 64);
        camera.scale = 0.9 * camera.center_on(surface.vertices(), 2.0);
        let cut = Cut { normal: DVec3::NEG_Y, offset_mm: -3.0 };
        let fragments = draw_cut(&surface, &camera, cut);
        let middle = fragments[32 * 64 + 32];
        assert!(middle.is_cut() && middle.normal == Vec3::NEG_Y);
        assert!((camera.unproject(32.5, 32.5, f64::from(middle.depth)).y - 3.0).abs() < 1e-4);
        let before = draw(&surface, &camera);
        assert!(!before[32 * 64 + 32].is_cut());
        assert!(before.iter().zip(&fragments).all(|(a, b)| a.hit() == b.hit()));
        let behind = Cut { offset_mm: -9.0, ..cut };
        assert!(draw_cut(&surface, &camera, behind).iter().all(|f| !f.hit()));
    }

    #[test]
    fn degenerate_faces_are_not_drawn() {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let mesh = Mesh { vertices, triangles: vec![[0, 1, 2]] };
        let camera = Camera::new(DVec3::new(0.3, -1.0, 1.0), 16, 16);
        assert!(draw(&Surface::of_mesh(&mesh), &camera).iter().all(|f| !f.hit()));
    }
}
