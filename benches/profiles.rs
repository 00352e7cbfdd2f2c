//! Labels of tools given by their profile: time, and equality with a dense search for poses.
//!
//! ```text
//! cargo bench --bench profiles -- times N_SITES N_DIRECTIONS PART.stl…   labels: twelve tools
//! cargo bench --bench profiles -- dense N_SITES N_DIRECTIONS PART.stl…   equality: eleven of them
//! ```
//!
//! *Times*: seconds of the lesser of two runs; ends with the median and the most of all parts and tools.
//!
//! *Dense*: tools that cut with their flank or the end. At every site that the labels do not reach, all poses of a
//! dense set are tried in every direction: places of the cutting profile 0.1 mm apart, 72 turns around the axis; first
//! those with normals up to 7° apart, as the definition has them but for facets, then up to 84°, which pass around
//! edges too. A pose counts if it is free, and so is the tool at every step of a retreat: straight along the axis, or
//! to one of 72 sides and then along it. Profiles are read here from their text. Drills go by closed forms and are left
//! out. A line for a tool: sites, those that labels reach, those that the dense search alone reaches within 7° and
//! within 84°, those without a proven retreat in the labels.
//!
//! Parts with an edge of the bounding box below 80 mm are scaled up to 80 mm.
#![allow(clippy::print_stdout)]

use deepmill::access::Labels;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
use deepmill::answers::SiteAnswer;
use deepmill::cutter::{Assembly, Cutter, Profile, Section};
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::glam::{DVec2, DVec3, Vec3, dvec2};
use std::f64::consts::TAU;
use std::path::Path;
use std::time::Instant;

/// Along the profile, mm, and around the axis.
const STEP_MM: f64 = 0.1;
const TURNS: usize = 72;
/// Of the normals of tool and site.
const LEAST_COSINES: [f64; 2] = [0.993, 0.1];
/// Of a retreat, mm.
const RETREAT_MM: f64 = 0.25;
const STICK_OUT_MM: f64 = 40.0;
/// The only tool that cuts along its axis alone.
const DRILL: &str = "drill";
/// Height and radius of the holder, mm.
const HOLDER: [f64; 2] = [30.0, 20.0];

/// A place of the profile, radius and height, with its outward normal.
struct Place {
    at: DVec2,
    normal: DVec2,
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let [mode, n_sites, n_directions, parts @ ..] = &args[..] else {
        // As `cargo bench` runs all: nothing to read.
        return;
    };
    let number = |text: &str| text.parse().expect("a number");
    let directions = Directions::fibonacci_hemisphere(number(n_directions)).expect("directions");
    let is_dense = match &**mode {
        "dense" => true,
        "times" => false,
        _ => panic!("times or dense; see the first lines of benches/profiles.rs"),
    };
    if is_dense {
        println!(
            "part                      tool                sites  reached  alone 7°  alone 84°  no retreat"
        );
    }
    let mut seconds = Vec::new();
    for part in parts {
        let part = Part::read(part, number(n_sites));
        match is_dense {
            true => part.hold(&directions),
            false => seconds.extend(part.times(&directions)),
        }
    }
    seconds.sort_by(f64::total_cmp);
    if let Some(most) = seconds.last() {
        println!("median {:.3} s, most {most:.3} s", seconds[seconds.len() / 2]);
    }
}

fn tools() -> Vec<(&'static str, Profile)> {
    let text = |text: &str| text.parse::<Profile>();
    let degrees = f64::to_radians;
    [
        ("lollipop 3/1.5", Profile::lollipop(3.0, 1.5)),
        ("lollipop 1.5/0.8", Profile::lollipop(1.5, 0.8)),
        ("lollipop 5/3", Profile::lollipop(5.0, 3.0)),
        ("T-slot", Profile::t_slot(6.0, 3.0, 0.2, 3.0)),
        ("dovetail", Profile::dovetail(6.0, degrees(30.0), 4.0, 2.5)),
        ("barrel R40", Profile::barrel(3.0, 40.0, 0.5, 10.0)),
        ("barrel R85", Profile::barrel(5.0, 85.0, 1.0, 18.0)),
        ("lens", Profile::lens(4.0, 20.0, 1.0, 6.0)),
        // A cone that leans by 5 degrees, on a ball wider than it is where they touch.
        ("tapered ball", text("0:0 2.988584:2.738533@0:3 4:14.299")),
        ("chamfer", Profile::chamfer(0.5, degrees(45.0), 5.0)),
        ("relieved neck", text("2:0 2:6 | 1.7:6 1.7:20 3:22")),
        (DRILL, text("drill 0:0 2.5:1.502 2.5:40")),
    ]
    .into_iter()
    .map(|(name, profile)| (name, profile.expect(name)))
    .collect()
}

/// A part with its sites.
struct Part {
    name: String,
    sites: Sites,
    obstacles: TriangleObstacles,
    /// Diagonal of its box, mm.
    size: f64,
}

impl Part {
    fn read(path: &str, n_sites: usize) -> Self {
        let path = Path::new(path);
        let mut mesh = read_mesh(path, &ReadOptions::default()).expect("a mesh");
        let (low, high) = mesh.bounds().expect("a mesh with vertices");
        let factor = (80.0 / (high - low).min_element()).max(1.0);
        mesh.vertices.iter_mut().for_each(|v| *v *= factor);
        Part {
            name: path.file_stem().expect("a file").to_string_lossy().into_owned(),
            sites: sample(&mesh, &SiteOptions::default().with_n_sites(n_sites)).expect("sites"),
            obstacles: TriangleObstacles::new(&mesh, &[]).expect("obstacles"),
            size: factor * (high - low).length(),
        }
    }

    fn labels(&self, cutter: &Cutter, directions: &Directions) -> Labels {
        self.obstacles.label(&self.sites, cutter, directions, &options()).expect("labels")
    }

    /// Seconds of each tool.
    fn times(&self, directions: &Directions) -> Vec<f64> {
        let time = |(tool, profile): (&str, Profile)| {
            let cutter = held(tool, profile);
            let run = || {
                let start = Instant::now();
                let labels = self.labels(&cutter, directions);
                (start.elapsed().as_secs_f64(), labels.answers.share(SiteAnswer::Accessible))
            };
            let ((first, share), (second, _)) = (run(), run());
            let least = first.min(second);
            println!(
                "{:<25} {tool:<17} {least:>7.3} s, {:>5.1} % reached",
                self.name,
                100.0 * share
            );
            least
        };
        tools().into_iter().map(time).collect()
    }

    fn hold(&self, directions: &Directions) {
        for (tool, profile) in tools().into_iter().filter(|(tool, _)| *tool != DRILL) {
            let places = places(&profile.to_string());
            let cutter = held(tool, profile);
            let labels = self.labels(&cutter, directions);
            let options = options();
            let search = Search { part: self, cutter: &cutter, options: &options };
            let reached: Vec<bool> = labels.answers.witness().iter().map(Option::is_some).collect();
            let mut n_alone = [0; 2];
            for i in (0..self.sites.len()).filter(|i| !reached[*i]) {
                let site = [self.sites.points[i], self.sites.normals[i]].map(|p| p.as_dvec3());
                let found = LEAST_COSINES.iter().enumerate().find_map(|(k, least)| {
                    let mut all = directions.vectors().iter();
                    Some((k, all.find_map(|d| search.densely(site, *d, (&places, *least)))?))
                });
                if let Some((k, (direction, tip))) = found {
                    n_alone[k] += 1;
                    let degrees = LEAST_COSINES[k].acos().to_degrees();
                    println!(
                        "  {degrees:.0}°: {site:?} from {direction:?} with the tip at {tip:?}"
                    );
                }
            }
            let n_reached = reached.iter().filter(|reached| **reached).count();
            let evidence = labels.surface.expect("by the mesh");
            let n_unproven = evidence.retreat_unproven.iter().filter(|unproven| **unproven).count();
            println!(
                "{:<25} {tool:<17} {:>7} {n_reached:>8} {:>9} {:>10} {n_unproven:>11}",
                self.name,
                self.sites.len(),
                n_alone[0],
                n_alone[1]
            );
        }
    }
}

fn options() -> SurfaceOptions {
    SurfaceOptions::default().with_occlusion(false).with_refinement(None)
}

fn held(tool: &str, profile: Profile) -> Cutter {
    let holder = [Section::cylinder(HOLDER[0], HOLDER[1])];
    let held = Assembly::from_profile(profile, &holder, STICK_OUT_MM).expect(tool);
    held.cutter().expect(tool)
}

struct Search<'a> {
    part: &'a Part,
    cutter: &'a Cutter,
    options: &'a SurfaceOptions,
}

impl Search<'_> {
    fn free(&self, poses: &[(Vec3, DVec3)]) -> Vec<bool> {
        self.part
            .obstacles
            .are_free(self.cutter, poses, self.options)
            .expect("a tool by its profile")
    }

    /// The first pose of a dense set that is free and may be drawn back.
    fn densely(
        &self,
        [point, normal]: [DVec3; 2],
        direction: Vec3,
        (places, least): (&[Place], f64),
    ) -> Option<(Vec3, DVec3)> {
        let up = direction.as_dvec3().normalize();
        let (u, v) = up.any_orthonormal_pair();
        let poses: Vec<(Vec3, DVec3)> = places
            .iter()
            .flat_map(|place| around(u, v).map(move |toward| (place, toward)))
            .filter(|(place, toward)| {
                let outward = *toward * place.normal.x + up * place.normal.y;
                outward.dot(-normal) >= least
            })
            .map(|(place, toward)| (direction, point - toward * place.at.x - up * place.at.y))
            .collect();
        let free = self.free(&poses);
        let mut free = poses.into_iter().zip(free).filter_map(|(pose, free)| free.then_some(pose));
        free.find(|pose| self.retracts(*pose, up))
    }

    fn retracts(&self, (direction, tip): (Vec3, DVec3), up: DVec3) -> bool {
        let way = |from: DVec3, along: DVec3, length: f64| {
            let n = (length / RETREAT_MM).ceil() as usize;
            let step = move |k: usize| (direction, from + along * (length * k as f64 / n as f64));
            let poses: Vec<_> = (0..=n).map(step).collect();
            self.free(&poses).into_iter().all(|free| free)
        };
        if way(tip, up, 2.0 * self.part.size) {
            return true;
        }
        let (u, v) = up.any_orthonormal_pair();
        around(u, v).any(|aside| {
            let lengths = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
            lengths.into_iter().take_while(|length| way(tip, aside, *length)).any(|length| {
                let tip = tip + aside * length;
                way(tip, up, 2.0 * self.part.size)
            })
        })
    }
}

fn around(u: DVec3, v: DVec3) -> impl Iterator<Item = DVec3> {
    (0..TURNS).map(move |turn| {
        let (sin, cos) = (TAU * turn as f64 / TURNS as f64).sin_cos();
        u * cos + v * sin
    })
}

/// Places of the cutting profile from its text: `start:0 radius:height[@center:height]… | …`.
fn places(text: &str) -> Vec<Place> {
    let pair = |text: &str| {
        let (radius, height) = text.split_once(':').expect("a pair");
        dvec2(radius.parse().expect("a radius"), height.parse().expect("a height"))
    };
    let (mut from, mut places) = (DVec2::ZERO, Vec::new());
    for word in text.split_whitespace().take_while(|word| *word != "|") {
        let (end, center) = word.split_once('@').map_or((word, None), |(e, c)| (e, Some(pair(c))));
        let to = pair(end);
        let (a, b) = match center {
            None => (from, to),
            Some(center) => (from - center, to - center),
        };
        // Counterclockwise, from the axis outward and up: outside is on the right.
        let angle = a.angle_to(b);
        let length = if center.is_some() { a.length() * angle.abs() } else { from.distance(to) };
        let n = (length / STEP_MM).ceil() as usize;
        for k in 0..=n {
            let share = if n > 0 { k as f64 / n as f64 } else { continue };
            let (at, normal) = match center {
                None => (from.lerp(to, share), (to - from).normalize().rotate(dvec2(0.0, -1.0))),
                Some(center) => {
                    let radius = a.rotate(DVec2::from_angle(share * angle));
                    (center + radius, radius.normalize() * angle.signum())
                }
            };
            places.push(Place { at, normal });
        }
        from = to;
    }
    places
}
