//! NPZ archives: named NumPy arrays, and beside them one `metadata.json`.
//!
//! NumPy's `load` gives the arrays by name and the metadata as bytes. Archives are deterministic:
//! the same arrays give the same bytes. A reader takes any real or whole number type, in C or
//! Fortran order, and never reserves memory because a header says so.

use crate::exec::memory;
use crate::geom::formats::npz::{HEAD_BYTES, check_header};
use crate::storage::atomic_file;
use crate::{Error, Result};
use glam::Vec3;
use npyz::npz::file_name_from_array_name;
use npyz::{NpyFile, WriteOptions, WriterBuilder};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

/// Entry that holds the metadata of an archive.
const METADATA: &str = "metadata.json";
/// Most numbers one array may hold; a file that claims more is refused before it is read.
const MOST_NUMBERS: u64 = 1 << 31;
/// Of a number that is read: 8 in a list that doubles when it is full, and 8 in the result.
const BYTES_OF_NUMBER: usize = 32;
/// Longest metadata that is read, bytes.
const LONGEST_METADATA: u64 = 1 << 24;
/// What to do about an archive that cannot be read.
const REMEDY: &str = "write the file again with numpy.savez or with this program";

/// Collects arrays in memory; [`NpzWriter::write`] puts them on disk.
///
/// A failure is kept until then, so that calls can be chained.
pub struct NpzWriter {
    archive: ZipWriter<Cursor<Vec<u8>>>,
    /// Of all arrays so far.
    n_bytes: u64,
    failure: Option<io::Error>,
}

impl Default for NpzWriter {
    fn default() -> Self {
        NpzWriter::new()
    }
}

impl NpzWriter {
    /// An archive without arrays.
    pub fn new() -> Self {
        let archive = ZipWriter::new(Cursor::new(Vec::new()));
        NpzWriter { archive, n_bytes: 0, failure: None }
    }

    /// Adds an array of `shape` (row-major) with the type of its values: `f32`, `f64`, `bool` and
    /// the whole numbers.
    ///
    /// # Panics
    /// If `shape` and the number of values disagree.
    pub fn array<T: npyz::AutoSerialize + Copy>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: &[T],
    ) -> &mut Self {
        assert_eq!(shape.iter().product::<usize>(), values.len(), "shape of {name}");
        let added = self.add(name, shape, values);
        self.failure = self.failure.take().or(added.err());
        self
    }

    fn add<T: npyz::AutoSerialize + Copy>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: &[T],
    ) -> io::Result<()> {
        self.n_bytes += size_of_val(values) as u64;
        // The archive doubles when it is full.
        let remedy = format!("{name}: free some memory");
        let fits = memory::require("writing an array", 2 * self.n_bytes, remedy);
        fits.map_err(io::Error::other)?;
        let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
        self.archive.start_file(file_name_from_array_name(name), entry_options())?;
        let options = WriteOptions::<T>::new().default_dtype().shape(&shape);
        let mut array = options.writer(&mut self.archive).begin_nd()?;
        array.extend(values.iter().copied())?;
        array.finish()
    }

    /// Adds vectors as a `[n, 3]` array of `f32`.
    pub fn vectors(&mut self, name: &str, vectors: &[Vec3]) -> &mut Self {
        let flat: Vec<f32> = vectors.iter().flat_map(|v| v.to_array()).collect();
        self.array(name, &[vectors.len(), 3], &flat)
    }

    /// Adds the metadata; at most once.
    pub fn metadata(&mut self, metadata: &Value) -> &mut Self {
        let text = format!("{metadata:#}\n");
        let entry = self.archive.start_file(METADATA, entry_options()).map_err(io::Error::from);
        let added = entry.and_then(|()| self.archive.write_all(text.as_bytes()));
        self.failure = self.failure.take().or(added.err());
        self
    }

    /// Writes the archive to `path`, whole or not at all.
    ///
    /// # Errors
    /// If an array could not be stored, the archive does not fit into the memory, or the system refuses the file.
    pub fn write(self, path: &Path) -> Result<()> {
        if let Some(failure) = self.failure {
            return Err(Error::write(path, failure));
        }
        let bytes = self.archive.finish().map_err(|e| Error::write(path, e.into()))?;
        atomic_file::write_atomic(path, |file| file.write_all(bytes.get_ref()))
    }
}

/// Compressed, without the time of day.
fn entry_options() -> SimpleFileOptions {
    SimpleFileOptions::default()
        .last_modified_time(zip::DateTime::default())
        .compression_level(Some(4))
}

/// Numbers of an array: whole ones stay exact.
enum Numbers {
    Real(Vec<f64>),
    Whole(Vec<i64>),
}

/// An archive opened for reading.
pub struct NpzReader {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

impl NpzReader {
    /// Opens the archive at `path`.
    ///
    /// # Errors
    /// If there is no readable file, or it is not a ZIP archive.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::read(path, e))?;
        let archive = ZipArchive::new(BufReader::new(file))
            .map_err(|e| Error::file(path, "archive", e.to_string(), REMEDY))?;
        Ok(NpzReader { path: path.into(), archive })
    }

    /// Whether the archive has an array of that name.
    pub fn has(&self, name: &str) -> bool {
        self.archive.index_for_name(&file_name_from_array_name(name)).is_some()
    }

    /// The metadata; `Null` if the archive has none.
    ///
    /// # Errors
    /// If the entry is not JSON.
    pub fn metadata(&mut self) -> Result<Value> {
        let bad = |e: String| Error::file(&self.path, METADATA, e, REMEDY);
        let entry = match self.archive.by_name(METADATA) {
            Ok(entry) => entry,
            Err(ZipError::FileNotFound) => return Ok(Value::Null),
            Err(e) => return Err(bad(e.to_string())),
        };
        let mut text = String::new();
        entry.take(LONGEST_METADATA).read_to_string(&mut text).map_err(|e| bad(e.to_string()))?;
        serde_json::from_str(&text).map_err(|e| bad(e.to_string()))
    }

    /// An array of `n_columns` numbers per row, as `f32`, row-major. `[n]` counts as `[n, 1]`.
    ///
    /// # Errors
    /// If it is missing, of another shape, or not numeric.
    pub fn f32s(&mut self, name: &str, n_columns: usize) -> Result<Vec<f32>> {
        Ok(match self.numbers(name, n_columns)? {
            Numbers::Real(values) => values.into_iter().map(|v| v as f32).collect(),
            Numbers::Whole(values) => values.into_iter().map(|v| v as f32).collect(),
        })
    }

    /// An array of `n_columns` numbers per row, as `f64`, row-major.
    ///
    /// # Errors
    /// As [`NpzReader::f32s`].
    pub fn f64s(&mut self, name: &str, n_columns: usize) -> Result<Vec<f64>> {
        Ok(match self.numbers(name, n_columns)? {
            Numbers::Real(values) => values,
            Numbers::Whole(values) => values.into_iter().map(|v| v as f64).collect(),
        })
    }

    /// A `[n, 3]` array as vectors.
    ///
    /// # Errors
    /// As [`NpzReader::f32s`], and if a number is infinite or NaN.
    pub fn vectors(&mut self, name: &str) -> Result<Vec<Vec3>> {
        let flat = self.f32s(name, 3)?;
        if let Some(i) = flat.iter().position(|x| !x.is_finite()) {
            let found = format!("row {} has a coordinate that is {}", i / 3, flat[i]);
            return Err(self.bad(name, found, "remove or repair that row"));
        }
        Ok(flat.chunks_exact(3).map(Vec3::from_slice).collect())
    }

    /// A column of truth values; numbers must be 0 or 1.
    ///
    /// # Errors
    /// As [`NpzReader::f32s`], and for any other number.
    pub fn bools(&mut self, name: &str) -> Result<Vec<bool>> {
        self.bool_rows(name, 1)
    }

    /// As [`NpzReader::bools`], of `n_columns` per row, row-major.
    ///
    /// # Errors
    /// As [`NpzReader::bools`].
    pub fn bool_rows(&mut self, name: &str, n_columns: usize) -> Result<Vec<bool>> {
        let values = self.whole(name, n_columns)?;
        match values.iter().position(|v| !matches!(v, 0 | 1)) {
            Some(i) => {
                let found = format!("row {} is {}", i / n_columns.max(1), values[i]);
                Err(self.bad(name, found, "store 0 (no) or 1 (yes)"))
            }
            None => Ok(values.into_iter().map(|v| v == 1).collect()),
        }
    }

    /// A column of counts.
    ///
    /// # Errors
    /// As [`NpzReader::f32s`], and for numbers that are fractional, negative or too great for `T`.
    pub fn counts<T: TryFrom<i64>>(&mut self, name: &str) -> Result<Vec<T>> {
        self.count_rows(name, 1)
    }

    /// As [`NpzReader::counts`], of `n_columns` per row, row-major.
    ///
    /// # Errors
    /// As [`NpzReader::counts`].
    pub fn count_rows<T: TryFrom<i64>>(&mut self, name: &str, n_columns: usize) -> Result<Vec<T>> {
        let values = self.whole(name, n_columns)?;
        let counts: Option<Vec<T>> = values.into_iter().map(|v| T::try_from(v).ok()).collect();
        counts.ok_or_else(|| {
            self.bad(name, "a number is negative or too great".into(), "store counts")
        })
    }

    fn whole(&mut self, name: &str, n_columns: usize) -> Result<Vec<i64>> {
        match self.numbers(name, n_columns)? {
            Numbers::Whole(values) => Ok(values),
            Numbers::Real(_) => {
                Err(self.bad(name, "it holds fractional numbers".into(), "store whole numbers"))
            }
        }
    }

    fn numbers(&mut self, name: &str, n_columns: usize) -> Result<Numbers> {
        let bad = |found: String, remedy: &str| Error::file(&self.path, name, found, remedy);
        let entry = match self.archive.by_name(&file_name_from_array_name(name)) {
            Ok(entry) => entry,
            Err(ZipError::FileNotFound) => {
                return Err(bad("there is no such array".into(), REMEDY));
            }
            Err(e) => return Err(bad(e.to_string(), REMEDY)),
        };
        // The header may promise anything: it is looked at before the library allocates what it says.
        let (mut entry, mut head) = (entry, Vec::new());
        let read = entry.by_ref().take(HEAD_BYTES as u64).read_to_end(&mut head);
        read.map_err(|e| bad(e.to_string(), REMEDY))?;
        check_header(&head).map_err(|found| bad(found, REMEDY))?;
        let array =
            NpyFile::new((&head[..]).chain(entry)).map_err(|e| bad(e.to_string(), REMEDY))?;
        let shape = array.shape().to_vec();
        let n_rows = match shape[..] {
            [n] if n_columns == 1 => n,
            [n, c] if c == n_columns as u64 => n,
            _ => {
                let found = format!("its shape is {shape:?}, expected [n, {n_columns}]");
                return Err(bad(found, "store one row per site"));
            }
        };
        if n_rows.saturating_mul(n_columns as u64) > MOST_NUMBERS {
            return Err(bad(format!("it claims {n_rows} rows"), REMEDY));
        }
        let n_bytes = memory::product([n_rows as usize, n_columns, BYTES_OF_NUMBER]);
        memory::require("reading an array", n_bytes, format!("{}: {name}", self.path.display()))?;
        let fortran = array.order() == npyz::Order::Fortran;
        let descriptor = array.dtype().descr();
        let numbers = match read_numbers(array) {
            Some(numbers) => numbers.map_err(|e| bad(e.to_string(), REMEDY))?,
            None => return Err(bad(format!("its type is {descriptor}"), "store plain numbers")),
        };
        Ok(match numbers {
            _ if !fortran => numbers,
            Numbers::Real(values) => Numbers::Real(transposed(&values, n_columns)),
            Numbers::Whole(values) => Numbers::Whole(transposed(&values, n_columns)),
        })
    }

    fn bad(&self, name: &str, found: String, remedy: &str) -> Error {
        Error::file(&self.path, name, found, remedy)
    }
}

/// Rows of a matrix stored column after column.
fn transposed<T: Copy>(values: &[T], n_columns: usize) -> Vec<T> {
    let n_rows = values.len() / n_columns.max(1);
    (0..values.len()).map(|i| values[i % n_columns * n_rows + i / n_columns]).collect()
}

/// The numbers of an array; `None` if they are of no numeric type.
fn read_numbers<R: Read>(mut array: NpyFile<R>) -> Option<io::Result<Numbers>> {
    macro_rules! take {
        ($($kind:ident: $($t:ty),*;)*) => {$($(
            array = match array.try_data::<$t>() {
                Ok(data) => return Some(collect(data, |v| v.try_into().ok()).map(Numbers::$kind)),
                Err(array) => array,
            };
        )*)*};
    }
    take!(Real: f32, f64; Whole: bool, u8, i8, u16, i16, u32, i32, i64, u64;);
    drop(array);
    None
}

/// All values of an array, converted; nothing is reserved in advance.
fn collect<T: npyz::Deserialize, U, R: Read>(
    data: npyz::NpyReader<T, R>,
    convert: impl Fn(T) -> Option<U>,
) -> io::Result<Vec<U>> {
    let too_great = || io::Error::other("a number is too great");
    let mut values = Vec::new();
    for value in data {
        values.push(convert(value?).ok_or_else(too_great)?);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_exactly_and_bytes_repeat() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = folder.path().join(name);
            let mut npz = NpzWriter::new();
            npz.vectors("points", &[Vec3::new(0.1, -2.0, 3.5e-20), Vec3::ONE]);
            npz.array("beta", &[2], &[u64::from(u32::MAX) + 7, 0]);
            npz.array("inaccessible", &[2], &[true, false]);
            npz.array("cutter", &[4], &[1.5f64, 6.0, 40.0, 0.1]);
            npz.metadata(&serde_json::json!({ "unit": "mm" }));
            npz.write(&path).unwrap();
            path
        };
        let path = write("a.npz");
        let mut npz = NpzReader::open(&path).unwrap();
        assert_eq!(npz.vectors("points").unwrap(), [Vec3::new(0.1, -2.0, 3.5e-20), Vec3::ONE]);
        assert_eq!(npz.counts::<u64>("beta").unwrap(), [u64::from(u32::MAX) + 7, 0]);
        assert!(npz.counts::<u32>("beta").is_err());
        assert_eq!(npz.bools("inaccessible").unwrap(), [true, false]);
        assert_eq!(npz.f64s("cutter", 1).unwrap(), [1.5, 6.0, 40.0, 0.1]);
        assert_eq!(npz.metadata().unwrap()["unit"], "mm");
        assert!(npz.has("beta") && !npz.has("metadata"));
        assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(write("b.npz")).unwrap());
    }

    #[test]
    fn faults_name_file_array_and_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.npz");
        std::fs::write(&path, b"not a zip").unwrap();
        let message = NpzReader::open(&path).err().unwrap().to_string();
        assert!(message.contains("bad.npz: archive:"), "{message}");
        let mut npz = NpzWriter::new();
        npz.array("points", &[2, 2], &[1.0f32; 4]).array("normals", &[1, 3], &[f32::NAN; 3]);
        npz.array("inaccessible", &[2], &[0u8, 2]);
        npz.write(&path).unwrap();
        let mut npz = NpzReader::open(&path).unwrap();
        for (message, part) in [
            (npz.vectors("points").unwrap_err().to_string(), "points: its shape is [2, 2]"),
            (npz.vectors("normals").unwrap_err().to_string(), "normals: row 0 has a coordinate"),
            (npz.bools("inaccessible").unwrap_err().to_string(), "inaccessible: row 1 is 2"),
            (npz.bools("occlusion").unwrap_err().to_string(), "occlusion: there is no such array"),
        ] {
            assert!(message.contains("bad.npz") && message.contains(part), "{message}");
        }
    }

    #[test]
    fn truncated_archives_and_boastful_headers_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.npz");
        let mut npz = NpzWriter::new();
        npz.array("points", &[100, 3], &[1.0f32; 300]);
        npz.write(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for len in 0..whole.len() {
            std::fs::write(&path, &whole[..len]).unwrap();
            assert!(NpzReader::open(&path).and_then(|mut z| z.vectors("points")).is_err());
        }
        let zip_of = |header: &[u8]| {
            let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
            zip.start_file("points.npy", entry_options()).unwrap();
            zip.write_all(b"\x93NUMPY\x01\x00").unwrap();
            zip.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
            zip.write_all(header).unwrap();
            zip.finish().unwrap().into_inner()
        };
        let bytes =
            zip_of(b"{'descr': '<f4', 'fortran_order': False, 'shape': (4000000000, 3), }\n");
        std::fs::write(&path, bytes).unwrap();
        let message = NpzReader::open(&path).unwrap().vectors("points").unwrap_err().to_string();
        assert!(message.contains("claims 4000000000 rows"), "{message}");
        let boastful = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000, 3), }\n";
        std::fs::write(&path, zip_of(boastful)).unwrap();
        assert!(NpzReader::open(&path).unwrap().vectors("points").is_err());
        // A header that says that it is 4 GB long.
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        zip.start_file("points.npy", entry_options()).unwrap();
        zip.write_all(b"\x93NUMPY\x02\x00\xff\xff\xff\xff{").unwrap();
        std::fs::write(&path, zip.finish().unwrap().into_inner()).unwrap();
        let message = NpzReader::open(&path).unwrap().vectors("points").unwrap_err().to_string();
        assert!(message.contains("points: its header is cut off or too long"), "{message}");
        // The library's own words about a bad header are several lines.
        let bytes = zip_of(b"{'descr': '<f4', 'fortran_order': False, 'shape': (12, 3, ), } ?\n");
        std::fs::write(&path, bytes).unwrap();
        let message = NpzReader::open(&path).unwrap().vectors("points").unwrap_err().to_string();
        assert!(message.contains("points: ") && !message.contains('\n'), "{message}");
    }

    #[test]
    fn fortran_order_is_turned_around() {
        assert_eq!(transposed(&[1, 4, 2, 5, 3, 6], 3), [1, 2, 3, 4, 5, 6]);
    }
}
