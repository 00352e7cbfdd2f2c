//! The published data format: what the reference implementation's scripts read and write.
//!
//! Under a root folder: `raw_data/models/NAME.txt` with lines `x y z nx ny nz label label_2` in mm (the authors' own
//! are normalized to ±0.8, see [`data::normalized`](crate::data::normalized)),
//! `raw_data/models_cutter/NAME_cutter.txt` with CR, CH, FR, FH in mm; and, prepared from these,
//! `points/models/NAME.ply` (points normalized to ±0.8, six decimals) and `filelist/models_train_val.txt`,
//! `filelist/models_test.txt` with lines `models/NAME.ply 0 CR CH FR FH`.
//!
//! Polarity: `label` 1 means **accessible** there; it is turned round on the way in and out. `label_2` 1 is
//! an occlusion point, as here.

use super::super::sample::Sample;
use crate::answers::SiteAnswers;
use crate::geom::Sites;
use crate::octree::Normalization;
use crate::storage::{atomic_file, input_file};
use crate::tool::cutter::CutterParams;
use crate::{Error, Result};
use glam::Vec3;
use std::collections::HashSet;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const REMEDY: &str = "give a file of the published format, see docs/formats.md";
const COLUMNS: [&str; 8] = ["x", "y", "z", "nx", "ny", "nz", "label", "label_2"];

/// Which of its two lists a sample belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum List {
    /// `models_train_val.txt`.
    TrainVal,
    /// `models_test.txt`.
    Test,
}

impl List {
    fn file(self, root: &Path) -> PathBuf {
        root.join("filelist").join(match self {
            List::TrainVal => "models_train_val.txt",
            List::Test => "models_test.txt",
        })
    }
}

/// Reads all samples of `root/raw_data`, in the order of their names; cutters in mm, points as they are in the files.
///
/// # Errors
/// If a folder or file is missing, or a line is not what the format says: file and line are named.
pub fn read_raw(root: &Path) -> Result<Vec<Sample>> {
    Ok(read_raw_with_notice(root)?.0)
}

/// As [`read_raw`], with a sentence about normals that were replaced.
///
/// # Errors
/// As [`read_raw`].
#[doc(hidden)] // of the program
pub fn read_raw_with_notice(root: &Path) -> Result<(Vec<Sample>, Option<String>)> {
    let folder = root.join("raw_data/models");
    let entries = std::fs::read_dir(&folder).map_err(|e| Error::read(&folder, e))?;
    let mut names = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::read(&folder, e))?.path();
        if path.extension().is_some_and(|e| e == "txt") {
            names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    let sample = |name: &String| {
        let cutters = root.join(format!("raw_data/models_cutter/{name}_cutter.txt"));
        let text = read_text(&cutters)?;
        let cutter = cutter(&text.split_whitespace().collect::<Vec<_>>(), &cutters, "file")?;
        let path = folder.join(format!("{name}.txt"));
        Rows::of_text(&read_text(&path)?, &path)?.sample(name, cutter)
    };
    Ok(with_notice(names.iter().map(sample).collect::<Result<_>>()?))
}

/// Reads the samples of one list of `root`. Their points are normalized: the part's millimeters are not in
/// these files.
///
/// # Errors
/// As [`read_raw`].
pub fn read_list(root: &Path, list: List) -> Result<Vec<Sample>> {
    Ok(read_list_with_notice(root, list)?.0)
}

/// As [`read_list`], with a sentence about normals that were replaced.
///
/// # Errors
/// As [`read_raw`].
#[doc(hidden)] // of the program
pub fn read_list_with_notice(root: &Path, list: List) -> Result<(Vec<Sample>, Option<String>)> {
    let path = list.file(root);
    let text = read_text(&path)?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let sample = |(i, line): (usize, &str)| {
        let place = format!("line {}", i + 1);
        let words: Vec<&str> = line.split_whitespace().collect();
        let cutter = cutter(&words[words.len().saturating_sub(4)..], &path, &place)?;
        let relative = words[0].replace('\\', "/");
        let points = root.join("points").join(&relative);
        let bytes = input_file::read(&points, input_file::TEXT)?;
        Rows::of_ply(&bytes, &points)?.sample(&stem(&relative), cutter)
    };
    Ok(with_notice(lines.map(sample).collect::<Result<_>>()?))
}

/// Samples, and a sentence about their normals that were replaced; given with the number of these.
fn with_notice(samples: Vec<(Sample, usize)>) -> (Vec<Sample>, Option<String>) {
    let n_normals: usize = samples.iter().map(|(_, n)| n).sum();
    let mut replaced = samples.iter().filter(|(_, n)| *n > 0);
    let notice = replaced.next().map(|(first, _)| {
        let n_samples = 1 + replaced.count();
        format!(
            "{n_normals} normals that are no numbers, or have no length, in {n_samples} of {} samples ({} first): \
             they are replaced by (0, 0, 1), as in the published preparation",
            samples.len(),
            first.name
        )
    });
    (samples.into_iter().map(|(sample, _)| sample).collect(), notice)
}

/// Names of the samples in one list of `root`; `None` if `root` has no such list.
///
/// # Errors
/// If the list cannot be read.
pub fn listed_names(root: &Path, list: List) -> Result<Option<HashSet<String>>> {
    let path = list.file(root);
    if !path.exists() {
        return Ok(None);
    }
    let text = read_text(&path)?;
    Ok(Some(text.lines().filter_map(|line| line.split_whitespace().next()).map(stem).collect()))
}

/// Name of the sample whose points a list has under `relative`.
fn stem(relative: &str) -> String {
    let relative = relative.replace('\\', "/");
    Path::new(&relative).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Writes `samples` under `root` in every form of the format, each file whole or not at all. Samples of the
/// same name (cutters of one part) get numbers.
///
/// # Errors
/// If a sample is inconsistent or the system refuses a file.
pub fn write(root: &Path, samples: &[(List, &Sample)]) -> Result<()> {
    let (mut lists, mut taken) = ([String::new(), String::new()], HashSet::new());
    for (list, sample) in samples {
        sample.check()?;
        let numbered = (1..).map(|k| format!("{}-{k}", sample.name));
        let mut names = std::iter::once(sample.name.clone()).chain(numbered);
        let name = names.find(|name| taken.insert(name.clone())).unwrap_or_default();
        let [cr, ch, fr, fh] = sample.cutter.to_array();
        let raw = root.join("raw_data");
        atomic_file::write_atomic(&raw.join(format!("models_cutter/{name}_cutter.txt")), |file| {
            writeln!(file, "{cr}\n{ch}\n{fr}\n{fh}")
        })?;
        atomic_file::write_atomic(&raw.join(format!("models/{name}.txt")), |file| {
            text_lines(sample, file)
        })?;
        let relative = format!("models/{name}.ply");
        let ply = ply(sample)?;
        atomic_file::write_atomic(&root.join("points").join(&relative), |file| {
            file.write_all(&ply)
        })?;
        lists[*list as usize] += &format!("{relative} 0 {cr:.6} {ch:.6} {fr:.6} {fh:.6}\n");
    }
    for (list, lines) in [List::TrainVal, List::Test].into_iter().zip(lists) {
        atomic_file::write_atomic(&list.file(root), |file| {
            file.write_all(lines.trim_end().as_bytes())
        })?;
    }
    Ok(())
}

/// Labels as the published files have them: accessible, occlusion point.
fn published_labels(sample: &Sample, i: usize) -> [u8; 2] {
    [u8::from(!sample.answers.is_inaccessible(i)), u8::from(sample.answers.occlusion[i])]
}

/// Numbers in the shortest form that reads back to the same bits.
fn text_lines(sample: &Sample, file: &mut (impl Write + ?Sized)) -> io::Result<()> {
    let sites = &sample.sites;
    for (i, (p, n)) in sites.points.iter().zip(&sites.normals).enumerate() {
        let [label, label_2] = published_labels(sample, i);
        writeln!(file, "{} {} {} {} {} {} {label} {label_2}", p.x, p.y, p.z, n.x, n.y, n.z)?;
    }
    Ok(())
}

fn ply(sample: &Sample) -> Result<Vec<u8>> {
    let sites = &sample.sites;
    let transform = Normalization::Mean.transform(&sites.points)?;
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    header += &format!("element vertex {}\n", sites.len());
    header.extend(COLUMNS.map(|column| format!("property float {column}\n")));
    let mut bytes = (header + "end_header\n").into_bytes();
    for (i, (p, n)) in sites.points.iter().zip(&sites.normals).enumerate() {
        let six = |x: f32| ((f64::from(x) * 1e6).round() / 1e6) as f32;
        let labels = published_labels(sample, i).map(f32::from);
        let row =
            transform.apply(*p).to_array().into_iter().chain(n.to_array()).map(six).chain(labels);
        bytes.extend(row.flat_map(f32::to_le_bytes));
    }
    Ok(bytes)
}

fn read_text(path: &Path) -> Result<String> {
    input_file::read_text(path, input_file::TEXT)
}

/// CR, CH, FR, FH of the first four words.
fn cutter(words: &[&str], path: &Path, place: &str) -> Result<CutterParams> {
    let lengths: Option<Vec<f64>> = words.iter().take(4).map(|w| w.parse().ok()).collect();
    let four = lengths.and_then(|l| <[f64; 4]>::try_from(l).ok());
    let good = four.filter(|l| l.iter().all(|x| x.is_finite() && *x > 0.0));
    good.map(CutterParams::from_array).ok_or_else(|| {
        let found = format!("`{}`, expected four lengths CR CH FR FH", words.join(" "));
        Error::file(path, place, found, REMEDY)
    })
}

/// Points, normals and labels of one file.
#[derive(Default)]
struct Rows {
    sites: Sites,
    inaccessible: Vec<bool>,
    occlusion: Vec<bool>,
    /// Normals that were replaced.
    n_replaced: usize,
}

impl Rows {
    fn of_text(text: &str, path: &Path) -> Result<Self> {
        let mut rows = Rows::default();
        for (i, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let words: Vec<&str> = line.split_whitespace().collect();
            let number = |column: usize, word: &str| {
                let is_nan = (3..6).contains(&column) && word.to_lowercase().contains("nan");
                if is_nan { Some(f32::NAN) } else { word.parse().ok() }
            };
            let values = words.iter().enumerate().map(|(c, w)| number(c, w));
            let values: Option<Vec<f32>> = values.collect();
            let row = values.and_then(|v| <[f32; 8]>::try_from(v).ok());
            let fault = |found: String| Error::file(path, format!("line {}", i + 1), found, REMEDY);
            let row = row.ok_or_else(|| fault(format!("`{line}`, expected eight numbers")))?;
            rows.push(row).map_err(fault)?;
        }
        Ok(rows)
    }

    fn of_ply(bytes: &[u8], path: &Path) -> Result<Self> {
        let fault = |place: String, found: String| Error::file(path, place, found, REMEDY);
        let header = |found: &str| fault("header".into(), found.into());
        let mark = b"end_header\n";
        let end = bytes.windows(mark.len()).position(|w| w == mark);
        let end = end.ok_or_else(|| header("it does not end"))?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|_| header("it is no text"))?;
        if !text.contains("format binary_little_endian") {
            return Err(header("it is not binary_little_endian"));
        }
        let columns: Vec<&str> =
            text.lines().filter_map(|l| l.trim().strip_prefix("property float ")).collect();
        let n_properties = text.lines().filter(|l| l.starts_with("property")).count();
        let place = |name: &&str| columns.iter().position(|c| c == name);
        let places: Option<Vec<usize>> = COLUMNS.iter().map(place).collect();
        let Some(places) = places.filter(|_| n_properties == columns.len()) else {
            return Err(header(&format!("its properties are not floats {}", COLUMNS.join(" "))));
        };
        let count = text.lines().find_map(|l| l.trim().strip_prefix("element vertex "));
        let count: Option<usize> = count.and_then(|c| c.trim().parse().ok());
        let body = bytes[end + mark.len()..].as_chunks::<4>().0;
        if count.and_then(|n| n.checked_mul(columns.len())) != Some(body.len()) {
            return Err(header("it promises another number of vertices than there are"));
        }
        let mut rows = Rows::default();
        for (i, row) in body.chunks_exact(columns.len()).enumerate() {
            let row = std::array::from_fn(|c| f32::from_le_bytes(row[places[c]]));
            rows.push(row).map_err(|found| fault(format!("vertex {i}"), found))?;
        }
        Ok(rows)
    }

    /// Adds one line; a normal that is not a number becomes (0, 0, 1), as in the published preparation, and
    /// so does one without a length; others are brought to unit length if they have not got it.
    fn push(&mut self, row: [f32; 8]) -> std::result::Result<(), String> {
        let (point, mut normal) = (Vec3::from_slice(&row[..3]), Vec3::from_slice(&row[3..6]));
        let is_none = normal.is_nan() || normal.length_squared() == 0.0;
        self.n_replaced += usize::from(is_none);
        if is_none {
            normal = Vec3::Z;
        }
        if !point.is_finite() || !normal.is_finite() {
            return Err(format!("point {point} with normal {normal}"));
        }
        if (normal.length_squared() - 1.0).abs() >= 1e-3 {
            normal = normal.normalize_or(Vec3::Z);
        }
        let label = |x: f32| match x {
            0.0 => Ok(false),
            1.0 => Ok(true),
            _ => Err(format!("label {x}, expected 0 or 1")),
        };
        self.inaccessible.push(!label(row[6])?);
        self.occlusion.push(label(row[7])?);
        self.sites.points.push(point);
        self.sites.normals.push(normal);
        Ok(())
    }

    /// The sample, and how many normals of it were replaced.
    fn sample(self, name: &str, cutter: CutterParams) -> Result<(Sample, usize)> {
        let Rows { sites, inaccessible, occlusion, n_replaced } = self;
        let name = name.to_owned();
        let answers = SiteAnswers::new(inaccessible, occlusion);
        let sample = Sample::new(name, Arc::new(sites), cutter, answers);
        sample.check()?;
        Ok((sample, n_replaced))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(name: &str) -> Sample {
        let points: Vec<Vec3> =
            (0..5).map(|i| Vec3::new(0.1 * i as f32, 7.0 / (i + 1) as f32, -3e-5)).collect();
        Sample {
            surface: None,
            name: name.into(),
            sites: Arc::new(Sites {
                normals: vec![Vec3::new(0.6, 0.0, -0.8); 5],
                points,
                faces: vec![],
            }),
            cutter: CutterParams::from_array([1.25, 0.1, 5.5, 10.0]),
            answers: SiteAnswers::new(
                vec![true, false, false, true, false],
                vec![false, true, false, true, false],
            ),
        }
    }

    #[test]
    fn raw_text_reads_back_to_the_same_bits_with_the_polarity_turned() {
        let folder = tempfile::tempdir().unwrap();
        let sample = sample("part");
        write(folder.path(), &[(List::Test, &sample), (List::TrainVal, &sample)]).unwrap();
        let read = read_raw(folder.path()).unwrap();
        assert_eq!(read.len(), 2);
        for (read, name) in read.iter().zip(["part", "part-1"]) {
            assert_eq!((read.name.as_str(), read.cutter), (name, sample.cutter));
            assert_eq!(read.sites, sample.sites);
            assert_eq!(read.answers, sample.answers);
        }
        let text = std::fs::read_to_string(folder.path().join("raw_data/models/part.txt")).unwrap();
        assert!(text.starts_with("0 7 -0.00003 0.6 0 -0.8 0 0\n"), "{text}");
    }

    #[test]
    fn lists_and_clouds_hold_normalized_points_and_the_same_labels() {
        let folder = tempfile::tempdir().unwrap();
        let sample = sample("part");
        write(folder.path(), &[(List::Test, &sample)]).unwrap();
        assert!(read_list(folder.path(), List::TrainVal).unwrap().is_empty());
        let list = folder.path().join("filelist/models_test.txt");
        let text = std::fs::read_to_string(&list).unwrap();
        assert_eq!(text, "models/part.ply 0 1.250000 0.100000 5.500000 10.000000");
        std::fs::write(&list, text.replace('/', "\\")).unwrap();
        let read = read_list(folder.path(), List::Test).unwrap().remove(0);
        assert_eq!(read.answers, sample.answers);
        let most = read.sites.points.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        assert_eq!(most, 0.8);
    }

    #[test]
    fn normals_that_are_no_numbers_point_up_and_faults_name_file_and_line() {
        let read = |text: &str| Rows::of_text(text, Path::new("a.txt"));
        let rows =
            read("# made by hand\n\n1 2 3 -nan(ind) -nan(ind) -nan(ind) 1.000000 0\n").unwrap();
        assert_eq!((rows.sites.normals[0], rows.inaccessible[0]), (Vec3::Z, false));
        assert_eq!(rows.n_replaced, 1);
        let rows = read("1 2 3 0 2 0 1 0\n1 2 3 0 0 0 1 0\n").unwrap();
        assert_eq!((&rows.sites.normals[..], rows.n_replaced), (&[Vec3::Y, Vec3::Z][..], 1));
        let samples = vec![(sample("a"), 0), (sample("b"), 2), (sample("c"), 1)];
        let said = with_notice(samples).1.unwrap();
        assert!(said.starts_with("3 normals that are no numbers"), "{said}");
        assert!(said.contains("in 2 of 3 samples (b first)"), "{said}");
        assert_eq!(with_notice(vec![(sample("a"), 0)]).1, None);
        for (text, part) in [
            ("1 2 3 0 0 1 1", "a.txt: line 1: `1 2 3 0 0 1 1`, expected eight numbers"),
            ("1 2 3 0 0 1 1 0\n1 2 x 0 0 1 1 0", "a.txt: line 2"),
            ("1 2 3 0 0 1 0.5 0", "line 1: label 0.5"),
            ("1 inf 3 0 0 1 0 0", "line 1: point"),
        ] {
            let message = read(text).err().unwrap().to_string();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn damaged_clouds_are_errors() {
        let whole = ply(&sample("part")).unwrap();
        let read = |bytes: &[u8]| Rows::of_ply(bytes, Path::new("a.ply"));
        assert!(read(&whole).is_ok());
        for len in 0..whole.len() {
            assert!(read(&whole[..len]).is_err(), "{len}");
        }
        let text = String::from_utf8_lossy(&whole[..100]).replace("vertex 5", "vertex 9");
        assert!(read(text.as_bytes()).is_err());
    }
}
