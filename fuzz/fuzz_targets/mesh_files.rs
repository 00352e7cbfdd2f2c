//! Any bytes, read as any format: an error or a mesh, never a panic, a hang or gigabytes.
//! The first byte chooses the format.
#![no_main]

use deepmill::geom::formats::{Format, ReadOptions, cloud_from_bytes, mesh_from_bytes};
use libfuzzer_sys::fuzz_target;
use std::io::{Cursor, Write};
use std::path::Path;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

fuzz_target!(|input: &[u8]| {
    let Some((choice, bytes)) = input.split_first() else { return };
    let path = Path::new("part");
    let message = match choice % 8 {
        0 => mesh_from_bytes(bytes, Format::Stl, path, &ReadOptions::default()).err(),
        1 => mesh_from_bytes(bytes, Format::Obj, path, &ReadOptions::default()).err(),
        2 => mesh_from_bytes(bytes, Format::Ply, path, &ReadOptions::default()).err(),
        3 => cloud_from_bytes(bytes, Format::Ply, path, 1.0).err(),
        4 => cloud_from_bytes(bytes, Format::Npz, path, 1.0).err(),
        5 => {
            let npz = archive(&["points.npy", "normals.npy"], bytes);
            cloud_from_bytes(&npz, Format::Npz, path, 1.0).err()
        }
        6 => mesh_from_bytes(bytes, Format::ThreeMf, path, &ReadOptions::default()).err(),
        _ => {
            let model = archive(&["3D/3dmodel.model"], bytes);
            mesh_from_bytes(&model, Format::ThreeMf, path, &ReadOptions::default()).err()
        }
    };
    if let Some(error) = message {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
});

/// An archive with the right checksums, in which every entry is `bytes`.
fn archive(names: &[&str], bytes: &[u8]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for name in names {
        zip.start_file(*name, stored).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}
