//! NPZ files, zip archives of NumPy arrays: `points` and `normals` are read, through `npyz`.
//!
//! The array header is looked at before `npyz` sees it: its parser multiplies the dimensions
//! unchecked, allocates what the header's length says, and recurses on brackets.

use super::one_line;
use crate::{Error, Result};
use glam::DVec3;
use npyz::NpyFile;
use npyz::npz::file_name_from_array_name;
use std::io::{Cursor, Read};
use std::path::Path;
use zip::ZipArchive;

/// Most bytes one array may unpack to.
const MAX_ARRAY_BYTES: u64 = 2 << 30;
/// Longest array header; NumPy's own are 118 bytes.
const MAX_HEADER_BYTES: usize = 1024;
const REMEDY: &str = "save float arrays `points` and `normals` of shape [n, 3] with numpy.savez";

/// Points and normals as they are, in file units.
pub(super) fn read_cloud(bytes: &[u8], path: &Path) -> Result<(Vec<DVec3>, Vec<DVec3>)> {
    let fault = |place: &str, found: String| Error::file(path, place, found, REMEDY);
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|e| fault("zip archive", one_line(e)))?;
    let mut array = |name: &str| {
        let place = format!("array {name}");
        rows(&unpack(&mut archive, name)?).map(|rows| (place, rows))
    };
    let (place, points) = array("points").map_err(|found| fault("array points", found))?;
    let (_, normals) = array("normals").map_err(|found| fault("array normals", found))?;
    if points.len() != normals.len() {
        let found = format!("{} points, but {} normals", points.len(), normals.len());
        return Err(fault("arrays points and normals", found));
    }
    match points.iter().position(|p| !p.is_finite()) {
        Some(i) => Err(fault(&format!("{place} row {i}"), format!("{}", points[i]))),
        None => Ok((points, normals)),
    }
}

fn unpack(
    archive: &mut ZipArchive<Cursor<&[u8]>>,
    name: &str,
) -> std::result::Result<Vec<u8>, String> {
    let entry = archive.by_name(&file_name_from_array_name(name));
    let entry = entry.map_err(|e| format!("cannot be opened ({})", one_line(e)))?;
    let mut bytes = Vec::new();
    let read = entry.take(MAX_ARRAY_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|e| format!("cannot be unpacked ({})", one_line(e)))?;
    if bytes.len() as u64 > MAX_ARRAY_BYTES {
        return Err(format!("it unpacks to more than {MAX_ARRAY_BYTES} bytes"));
    }
    Ok(bytes)
}

/// The rows of an array of shape `[n, 3]`, f32 or f64.
fn rows(bytes: &[u8]) -> std::result::Result<Vec<DVec3>, String> {
    check_header(bytes)?;
    let file = NpyFile::new(bytes).map_err(one_line)?;
    let (shape, strides) = (file.shape().to_vec(), file.strides().to_vec());
    let &[n, 3] = shape.as_slice() else {
        return Err(format!("its shape is {shape:?}, not [n, 3]"));
    };
    if n.saturating_mul(12) > bytes.len() as u64 {
        return Err(format!("its header promises {n} rows, it holds {} bytes", bytes.len()));
    }
    let values: std::io::Result<Vec<f64>> = match file.try_data::<f64>() {
        Ok(values) => values.collect(),
        Err(file) => match file.try_data::<f32>() {
            Ok(values) => values.map(|v| v.map(f64::from)).collect(),
            Err(file) => return Err(format!("its type is {}", one_line(file.dtype().descr()))),
        },
    };
    let values = values.map_err(one_line)?;
    let at = |i: u64, j: u64| values[(i * strides[0] + j * strides[1]) as usize];
    Ok((0..n).map(|i| DVec3::new(at(i, 0), at(i, 1), at(i, 2))).collect())
}

/// Most bytes that [`check_header`] looks at.
pub(crate) const HEAD_BYTES: usize = 12 + MAX_HEADER_BYTES;

/// Refuses headers that are not a short dictionary with a shape whose product fits into 64 bits.
pub(crate) fn check_header(bytes: &[u8]) -> std::result::Result<(), String> {
    let word = |i: usize| bytes.get(i).copied().map(usize::from);
    let (begin, length) = match (bytes.starts_with(b"\x93NUMPY"), word(6)) {
        (true, Some(1)) => (10, word(8).zip(word(9)).map(|(low, high)| low + 256 * high)),
        (true, Some(2 | 3)) => {
            let length = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            (12, length.map(|n| n as usize))
        }
        _ => return Err("it is not a NumPy array".into()),
    };
    let length = length.filter(|n| *n <= MAX_HEADER_BYTES);
    let header = length.and_then(|n| bytes.get(begin..begin + n));
    let header = header.ok_or("its header is cut off or too long")?;
    let count = |set: &[u8]| header.iter().filter(|b| set.contains(b)).count();
    // Numbers with 18 digits between them multiply to less than 10^18.
    if count(b"0123456789") > 18 || count(b"([{") > 8 {
        return Err("its header is not that of a plain array of sensible size".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn both_float_widths_and_both_orders_are_read() {
        let numbers: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let wide: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        let narrow: Vec<u8> = numbers.iter().flat_map(|v| (*v as f32).to_be_bytes()).collect();
        let header = |kind: &str, order: &str| {
            format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': (2, 3), }}\n")
        };
        let expected = vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)];
        assert_eq!(rows(&npy(&header("<f8", "False"), &wide)), Ok(expected.clone()));
        assert_eq!(rows(&npy(&header(">f4", "False"), &narrow)), Ok(expected));
        let turned = vec![DVec3::new(1.0, 3.0, 5.0), DVec3::new(2.0, 4.0, 6.0)];
        assert_eq!(rows(&npy(&header("<f8", "True"), &wide)), Ok(turned));
        assert!(rows(&npy(&header("<i8", "False"), &wide)).unwrap_err().contains("<i8"));
        assert!(rows(&npy(&header("<f8", "False"), &wide[..40])).is_err());
    }

    #[test]
    fn hostile_headers_never_reach_the_library() {
        let many =
            "{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999999, 9999999999, 3)}";
        let deep = format!("{{'shape': {}", "(".repeat(900));
        let mut long = npy("", &[]);
        (long[6], long[8], long[9]) = (2, 255, 255);
        long.extend([255, 255]);
        for bytes in [npy(many, &[]), npy(&deep, &[]), long, b"\x93NUMPY".to_vec(), vec![]] {
            assert!(check_header(&bytes).is_err());
        }
        let zero = "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999, 3)}";
        assert!(rows(&npy(zero, &[])).unwrap_err().contains("promises"));
    }
}
