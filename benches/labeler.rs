//! Time of labels by engine and number of sites, the worst of several parts and cutters.
//!
//! ```text
//! cargo bench --bench labeler -- [--parts FOLDER_OR_FILE…] [--sizes 7000,15000] [--published STRIDE]
//!     [--cutter CR,CH,FR,FH] [--directions 150] [--equal CUTTERS]
//! ```
//!
//! Without parts it draws its own. Parts with an edge of the bounding box below 80 mm are scaled up to
//! 80 mm, as data sets do. Times are the best of the runs in half a second, of three at least (of one beyond
//! 100,000 sites); each size is checked against the batched engine on a few directions before it is timed.
//! `published` runs the paper's method beside it (one thread, `f64`, branches, detection cylinder first) on every
//! STRIDE-th site and multiplies. `equal` measures nothing: it compares the pruned engine with the reference for
//! that many drawn cutters on every part and size.
#![allow(clippy::print_stdout)]

use deepmill::access::{Engine, LabelOptions, Labels, Obstacles, label, label_many};
use deepmill::cutter::{Cutter, CutterParams, CutterSet};
use deepmill::data::generated;
use deepmill::directions::Directions;
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites};
use deepmill::rng::{Purpose, Stream};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// CR, CH, FR, FH, mm: the corners of the ranges 1–2, 0.2–20, 5–90, 0.2–20, and the middle.
const CUTTERS: [[f64; 4]; 8] = [
    [1.0, 0.2, 90.0, 0.2],
    [2.0, 0.2, 5.0, 20.0],
    [1.0, 20.0, 5.0, 20.0],
    [2.0, 20.0, 40.0, 20.0],
    [1.5, 5.0, 20.0, 20.0],
    [1.5, 10.0, 10.0, 10.0],
    [1.5, 6.0, 40.0, 5.0],
    [2.0, 2.0, 90.0, 20.0],
];
const N_GENERATED: u64 = 4;

struct Settings {
    parts: Vec<PathBuf>,
    sizes: Vec<usize>,
    published: usize,
    cutters: Vec<[f64; 4]>,
    n_dirs: usize,
    equal: usize,
}

fn settings() -> Settings {
    let mut settings = Settings {
        parts: vec![],
        sizes: vec![7000, 15_000],
        published: 40,
        cutters: CUTTERS.to_vec(),
        n_dirs: 150,
        equal: 0,
    };
    let mut list = "";
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--bench" => {}
            "--parts" => list = "parts",
            "--sizes" => list = "sizes",
            "--published" => list = "published",
            "--cutter" => list = "cutter",
            "--directions" => list = "directions",
            "--equal" => list = "equal",
            value if list == "directions" => settings.n_dirs = numbers(value)[0],
            value if list == "equal" => settings.equal = numbers(value)[0],
            value if list == "sizes" => settings.sizes = numbers(value),
            value if list == "published" => settings.published = numbers(value)[0],
            value if list == "cutter" => {
                let lengths: Vec<f64> = value.split(',').map(|n| n.parse().unwrap()).collect();
                settings.cutters = vec![lengths.try_into().unwrap()];
            }
            value => settings.parts.push(value.into()),
        }
    }
    settings
}

fn numbers(list: &str) -> Vec<usize> {
    list.split(',').map(|n| n.parse().expect("a list of whole numbers")).collect()
}

fn parts(paths: &[PathBuf]) -> Vec<(String, Mesh)> {
    if paths.is_empty() {
        let named = |index| {
            let (family, mesh) = (generated::family_of(index), generated::mixed_part(1, index));
            (family.name().to_string(), mesh)
        };
        return (0..N_GENERATED).map(named).collect();
    }
    let files = |path: &PathBuf| match path.is_dir() {
        true => std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()).collect(),
        false => vec![path.clone()],
    };
    let mut files: Vec<PathBuf> = paths.iter().flat_map(files).collect();
    files.retain(|path| path.extension().is_some_and(|e| e != "csv"));
    files.sort();
    let read = |path: &PathBuf| {
        let name = Path::file_stem(path).unwrap().to_string_lossy().into_owned();
        (name, read_mesh(path, &ReadOptions::default()).unwrap())
    };
    files.iter().map(read).collect()
}

/// Scaled so that the least edge of the bounding box is at least 80 mm.
fn enlarged(mut mesh: Mesh) -> Mesh {
    let (lo, hi) = mesh.bounds().expect("a part has vertices");
    let scale = (80.0 / (hi - lo).min_element()).max(1.0);
    mesh.vertices.iter_mut().for_each(|v| *v = (*v - lo) * scale);
    mesh
}

/// Least wall time and least processor time of the runs in half a second, at least `runs`, s, and the last
/// result.
fn seconds<R>(runs: usize, mut work: impl FnMut() -> R) -> (f64, f64, R) {
    let (mut wall, mut processor, mut total) = (f64::INFINITY, f64::INFINITY, 0.0);
    let mut done = 0;
    loop {
        let (before, start) = (processor_seconds(), Instant::now());
        let result = work();
        let seconds = start.elapsed().as_secs_f64();
        processor = processor.min(processor_seconds() - before);
        (wall, total, done) = (wall.min(seconds), total + seconds, done + 1);
        if done >= runs && total >= 0.5 {
            return (wall, processor, result);
        }
    }
}

/// Processor time of all threads so far, s; 0 where the system does not tell.
fn processor_seconds() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds = threads.filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    });
    nanoseconds.sum::<f64>() / 1e9
}

fn run(sites: &Sites, cutter: &Cutter, directions: &Directions, options: &LabelOptions) -> Labels {
    label(sites, Obstacles::Queries, cutter, directions, options).unwrap()
}

/// The slowest case of a size so far.
#[derive(Default, Clone)]
struct Worst {
    seconds: f64,
    case: String,
}

impl Worst {
    fn meet(&mut self, seconds: f64, case: impl FnOnce() -> String) {
        if seconds > self.seconds {
            *self = Worst { seconds, case: case() };
        }
    }
}

fn main() {
    let settings = settings();
    let directions = Directions::fibonacci_hemisphere(settings.n_dirs).unwrap();
    let parts: Vec<_> =
        parts(&settings.parts).into_iter().map(|(n, mesh)| (n, enlarged(mesh))).collect();
    if settings.equal > 0 {
        return equal(&settings, &parts, &directions);
    }
    println!(
        "{} parts, {} cutters, {} directions, {} threads",
        parts.len(),
        settings.cutters.len(),
        directions.len(),
        deepmill::par::threads()
    );
    println!(
        "{:>9} {:<22} {:<14} {:>9} {:>9} {:>9} {:>9}  {:>5} {:>6} {:>6} {:>6} {:>7}",
        "sites",
        "part",
        "cutter",
        "labels ms",
        "+beta ms",
        "cpu ms",
        "cpu ms",
        "inacc",
        "height",
        "grid",
        "tests",
        "pairs/j"
    );
    let mut fit: [Vec<(f64, f64)>; 2] = Default::default();
    for &n_sites in &settings.sizes {
        let mut worst: [Worst; 2] = Default::default();
        for (name, mesh) in &parts {
            let sites = sample(mesh, &SiteOptions::default().with_n_sites(n_sites)).unwrap();
            for &lengths in &settings.cutters {
                let cutter = Cutter::ball_end(CutterParams::from_array(lengths)).unwrap();
                check(&sites, &cutter, n_sites);
                let runs = if n_sites <= 100_000 { 3 } else { 1 };
                let mut options = LabelOptions::default().with_occlusion(false);
                let (quick, quick_cpu, _) =
                    seconds(runs, || run(&sites, &cutter, &directions, &options));
                options.occlusion = true;
                let (full, full_cpu, labels) =
                    seconds(runs, || run(&sites, &cutter, &directions, &options));
                report(n_sites, name, lengths, [quick, full, quick_cpu, full_cpu], &labels);
                for (worst, seconds) in worst.iter_mut().zip([quick, full]) {
                    worst.meet(seconds, || format!("{name} {lengths:?}"));
                }
                if settings.published > 0 && n_sites <= 20_000 && lengths == CUTTERS[6] {
                    published(&sites, lengths, &directions, settings.published, full);
                }
            }
        }
        for ((fit, worst), what) in fit.iter_mut().zip(&worst).zip(["labels", "labels + beta"]) {
            println!("{n_sites:>9} worst {what}: {:.1} ms ({})", worst.seconds * 1e3, worst.case);
            fit.push((n_sites as f64, worst.seconds));
        }
        println!("{n_sites:>9} peak memory so far: {} MB", peak_megabytes());
    }
    for (fit, what) in fit.iter().zip(["labels", "labels + beta"]) {
        if fit.len() > 1 {
            println!("growth exponent of the worst {what}: {:.2}", exponent(fit));
        }
    }
    if settings.cutters.len() > 1 {
        share_work(&parts[0].1, &directions);
    }
}

/// Most memory of the process at any time, megabytes; 0 where the system does not tell.
fn peak_megabytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().split(' ').next()?.parse::<u64>().ok()).unwrap_or(0) / 1000
}

/// Compares the pruned engine with the reference, labels, directions, witnesses and counts, for cutters
/// drawn from all sets in turn, every third with the ball of the one before.
fn equal(settings: &Settings, parts: &[(String, Mesh)], directions: &Directions) {
    let mut stream = Stream::new(4, 0, 0, Purpose::Cutter);
    let mut cr_mm = 0.0;
    let draw = |i: usize| {
        let mut params = CutterSet::PUBLISHED[i % 4].draw(&mut stream);
        if i % 3 == 2 {
            params.cr_mm = cr_mm;
        }
        cr_mm = params.cr_mm;
        Cutter::ball_end(params).unwrap()
    };
    let cutters: Vec<Cutter> = (0..settings.equal).map(draw).collect();
    for &n_sites in &settings.sizes {
        for (name, mesh) in parts {
            let sites = sample(mesh, &SiteOptions::default().with_n_sites(n_sites)).unwrap();
            let answer = |engine| {
                let options = LabelOptions::default().with_engine(engine);
                let labels = label_many(&sites, Obstacles::Queries, &cutters, directions, &options);
                let parts = |l: Labels| (l.answers, l.witness, l.beta);
                labels.unwrap().into_iter().map(parts).collect::<Vec<_>>()
            };
            assert!(answer(Engine::Pruned) == answer(Engine::Reference), "engines differ: {name}");
            let (n_dirs, n_cutters) = (directions.len(), cutters.len());
            println!("{n_sites} sites of {name}, {n_cutters} cutters, {n_dirs} directions: equal");
        }
    }
}

/// Pruned equals batched on a few directions of this very case; of very many sites, some are queries and all are
/// obstacles.
fn check(sites: &Sites, cutter: &Cutter, n_sites: usize) {
    let n_dirs = if (20_000..200_000).contains(&n_sites) { 1 } else { 3 };
    let few = Directions::fibonacci_hemisphere(n_dirs).unwrap();
    let stride = if n_sites < 200_000 { 1 } else { n_sites / 15_000 };
    let some = Sites {
        points: sites.points.iter().copied().step_by(stride).collect(),
        normals: sites.normals.iter().copied().step_by(stride).collect(),
        faces: vec![],
    };
    let obstacles = if stride == 1 { Obstacles::Queries } else { Obstacles::Points(&sites.points) };
    let answer = |engine| {
        let options = LabelOptions::default().with_engine(engine);
        let labels = label(&some, obstacles, cutter, &few, &options).unwrap();
        (labels.answers, labels.witness, labels.beta)
    };
    assert!(answer(Engine::Pruned) == answer(Engine::Batched), "engines differ");
}

fn report(n: usize, name: &str, lengths: [f64; 4], times: [f64; 4], labels: &Labels) {
    let s = labels.stats;
    let share = |part: u64| 100.0 * part as f64 / s.queries as f64;
    let [cr, ch, fr, fh] = lengths;
    println!(
        "{n:>9} {name:<22} {:<14} {:>9.1} {:>9.1} {:>9.1} {:>9.1}  {:>4.0}% {:>5.1}% {:>5.1}% {:>6.2} {:>7.1}",
        format!("{cr},{ch},{fr},{fh}"),
        times[0] * 1e3,
        times[1] * 1e3,
        times[2] * 1e3,
        times[3] * 1e3,
        100.0 * labels.answers.n_inaccessible() as f64 / n as f64,
        share(s.by_height),
        share(s.by_grid),
        s.pairs_tested as f64 / s.queries as f64,
        s.beta_pairs_tested as f64 / s.queries as f64,
    );
}

/// Slope of log time over log size, least squares.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (mx, my) = logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let over = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    over / logs.iter().map(|(x, _)| (x - mx).powi(2)).sum::<f64>()
}

/// The paper's method: for each site and direction the points inside a cylinder around the axis, tested
/// one by one; an inaccessible site's colliders are counted in all directions.
fn published(sites: &Sites, lengths: [f64; 4], directions: &Directions, stride: usize, ours: f64) {
    let [cr, ch, fr, fh] = lengths;
    let points: Vec<_> = sites.points.iter().map(|p| p.as_dvec3()).collect();
    let detection = cr.max(fr) + 0.1;
    let mut beta = vec![0u64; points.len()];
    let start = Instant::now();
    for i in (0..points.len()).step_by(stride) {
        let center = points[i] + cr * sites.normals[i].as_dvec3();
        let collides = |d: glam::DVec3, j: usize| {
            let offset = points[j] - center;
            let height = offset.dot(d);
            let radius = (offset - height * d).length();
            if radius > detection {
                return height > cr + ch + fh;
            }
            height > cr + ch + fh
                || (height > cr + ch && radius <= fr)
                || (height > cr && radius <= cr)
        };
        let blocked = |d: glam::DVec3| (0..points.len()).any(|j| j != i && collides(d, j));
        if directions.vectors().iter().all(|d| blocked(d.as_dvec3())) {
            for d in directions.vectors() {
                for (j, count) in beta.iter_mut().enumerate() {
                    if j != i && collides(d.as_dvec3(), j) {
                        *count += 1;
                    }
                }
            }
        }
    }
    let theirs = start.elapsed().as_secs_f64() * stride as f64;
    std::hint::black_box(&beta);
    println!("{:>9} published method: {theirs:.1} s, ratio {:.0}", points.len(), theirs / ours);
}

/// Several cutters on one part, together and one by one.
fn share_work(mesh: &Mesh, directions: &Directions) {
    let sites = sample(mesh, &SiteOptions::default()).unwrap();
    let lengths = |cr, lengths: &[f64]| {
        lengths.iter().map(|&length| [cr, length, 20.0, 20.0]).collect::<Vec<_>>()
    };
    let few = [4.0, 8.0, 12.0, 20.0];
    let thirty: Vec<f64> = (0..30).map(|i| 2.0 + 0.6 * f64::from(i)).collect();
    let sets = [
        ("corners of the ranges", CUTTERS.to_vec()),
        ("two balls, four lengths each", [lengths(1.0, &few), lengths(2.0, &few)].concat()),
        ("one cutter, eight lengths", lengths(1.5, &[2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0])),
        ("one cutter, thirty lengths", lengths(1.5, &thirty)),
    ];
    for (name, set) in sets {
        let cutters: Vec<Cutter> = set
            .into_iter()
            .map(|lengths| Cutter::ball_end(CutterParams::from_array(lengths)).unwrap())
            .collect();
        for occlusion in [false, true] {
            let options = LabelOptions::default().with_occlusion(occlusion);
            let all =
                || label_many(&sites, Obstacles::Queries, &cutters, directions, &options).unwrap();
            let (together, together_cpu, _) = seconds(3, all);
            let each =
                || cutters.iter().map(|c| run(&sites, c, directions, &options)).collect::<Vec<_>>();
            let (alone, alone_cpu, _) = seconds(3, each);
            println!(
                "{name}, beta {occlusion}: together {:.1} ms ({:.1} cpu), one by one {:.1} ms ({:.1} cpu)",
                together * 1e3,
                together_cpu * 1e3,
                alone * 1e3,
                alone_cpu * 1e3
            );
        }
    }
}
