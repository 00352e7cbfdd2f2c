//! Mesh files: every way to write a part gives the same part, and every broken file gives one line that names the file,
//! the place and the remedy.
#![cfg(feature = "formats")]

use deepmill::data::files::tools;
use deepmill::geom::formats::{
    MeshOrCloud, ReadOptions, read_cloud, read_mesh, read_part, write_stl,
};
use deepmill::geom::{Mesh, check, solids};
use glam::{DVec3, Vec3};
use std::path::{Path, PathBuf};

fn cube() -> Mesh {
    solids::cuboid(DVec3::new(10.0, 20.0, 30.0))
}

fn put(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn binary_stl(mesh: &Mesh, head: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.stl");
    write_stl(&path, mesh).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[..80].fill(b' ');
    bytes[..head.len()].copy_from_slice(head.as_bytes());
    bytes
}

fn ascii_stl(mesh: &Mesh) -> String {
    let facet = |f: usize| {
        let corner = |v: DVec3| format!("      vertex {:e} {} {}\r\n", v.x, v.y, v.z);
        let corners: String = mesh.corners(f).into_iter().map(corner).collect();
        format!(
            "  facet normal nan 0 0\r\n    outer loop\r\n{corners}    endloop\r\n  endfacet\r\n"
        )
    };
    let facets: String = (0..mesh.triangles.len()).map(facet).collect();
    format!("solid\r\n{facets}endsolid\r\n")
}

fn obj(mesh: &Mesh) -> String {
    let vertices: String =
        mesh.vertices.iter().map(|v| format!("v {} {} {} 1.0\r\n", v.x, v.y, v.z)).collect();
    // Six quads, some counted from the end.
    let faces = "f 4 3 2 1\r\nf 5//1 6//1 7//1 8//1\r\ng walls\r\nusemtl none\r\nf 1/1 2/2 6/3 5/4\r\n\
        f -7 -6 -2 -3\r\nf 3 4 8 7\r\nf 4 1 5 8\r\n";
    format!("# cube\r\nmtllib missing.mtl\r\no cube\r\n{vertices}{faces}")
}

fn three_mf(mesh: &Mesh) -> Vec<u8> {
    let vertex = |v: &DVec3| format!("<vertex x=\"{}\" y=\"{}\" z=\"{}\" />", v.x, v.y, v.z);
    let triangle = |[a, b, c]: &[u32; 3]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>\n");
    let vertices: String = mesh.vertices.iter().map(vertex).collect();
    let triangles: String = mesh.triangles.iter().map(triangle).collect();
    let model = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"millimeter\" xml:lang=\"en-US\" \
         xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources>\
         <object id=\"1\" type=\"model\"><mesh><vertices>{vertices}</vertices><triangles>{triangles}\
         </triangles></mesh></object></resources><build><item objectid=\"1\"/></build></model>"
    );
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    archive.start_file("3D/3dmodel.model", zip::write::SimpleFileOptions::default()).unwrap();
    std::io::Write::write_all(&mut archive, model.as_bytes()).unwrap();
    archive.finish().unwrap().into_inner()
}

#[test]
fn every_way_to_write_a_cube_gives_the_same_cube() {
    let folder = tempfile::tempdir().unwrap();
    let cube = cube();
    let files = [
        put(folder.path(), "ascii.stl", ascii_stl(&cube)),
        put(
            folder.path(),
            "two.STL",
            ascii_stl(&cube).replacen("  facet", "endsolid a\nsolid b\n  facet", 2).replacen(
                "endsolid a\nsolid b\n",
                "",
                1,
            ),
        ),
        put(folder.path(), "binary.stl", binary_stl(&cube, "made by hand")),
        put(folder.path(), "solid.STL", binary_stl(&cube, "solid cube")),
        put(folder.path(), "cube.obj", obj(&cube)),
        put(folder.path(), "cube.3mf", three_mf(&cube)),
    ];
    for path in &files {
        let mesh = read_mesh(path, &ReadOptions::default()).unwrap();
        assert!(check::check(&mesh).findings.is_empty(), "{}", path.display());
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12), "{}", path.display());
        assert_eq!((mesh.volume(), mesh.area()), (cube.volume(), cube.area()));
    }
}

#[test]
fn a_cloud_is_told_from_a_mesh_and_its_normals_get_unit_length() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n\
        property double z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n\
        1 2 3 0 0 5\n4 5 6 1e-5 0 0\n";
    let path = put(folder.path(), "cloud.ply", cloud);
    let scale = ReadOptions::default().with_scale(10.0);
    let MeshOrCloud::Cloud(sites) = read_part(&path, &scale).unwrap() else {
        panic!("not a cloud")
    };
    assert_eq!(sites.points[1], Vec3::new(40.0, 50.0, 60.0));
    assert_eq!(sites.normals, [Vec3::Z, Vec3::X]);
    let path = put(folder.path(), "cube.stl", ascii_stl(&cube()));
    assert!(
        matches!(read_part(&path, &scale).unwrap(), MeshOrCloud::Mesh(mesh) if mesh.triangles.len() == 12)
    );
}

/// File name, content, and what the message must say beside the file: place and remedy among it.
type Case = (&'static str, Vec<u8>, &'static [&'static str]);

fn broken_meshes() -> Vec<Case> {
    let whole = binary_stl(&cube(), "cube");
    let solid = binary_stl(&cube(), "solid cube");
    let with = |at: usize, bytes: &[u8]| {
        let mut file = whole.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let text = ascii_stl(&cube());
    let obj = obj(&cube());
    let ply = |vertices: &str, faces: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
             end_header\n{vertices}{faces}"
        )
        .into_bytes()
    };
    let corners = "0 0 0\n1 0 0\n0 1 0\n";
    vec![
        ("empty.stl", vec![], &["byte 0", "empty", "export"]),
        ("empty.obj", vec![], &["byte 0", "empty", "export"]),
        ("empty.ply", vec![], &["byte 0", "empty", "export"]),
        ("short.stl", whole[..50].to_vec(), &["byte 50", "head", "copy"]),
        ("cut.stl", whole[..whole.len() - 7].to_vec(), &["12 triangles", "room for 11", "cut off"]),
        ("cut_solid.stl", solid[..300].to_vec(), &["12 triangles", "room for 4", "cut off"]),
        ("long.stl", [&whole[..], &[0; 3]].concat(), &["byte 684", "more follows"]),
        ("count.stl", with(80, &[13]), &["13 triangles", "room for 12"]),
        ("giant.stl", with(80, &[255; 4]), &["4294967295 triangles", "cut off"]),
        ("none.stl", [&whole[..80], &[0; 4]].concat(), &["no triangle"]),
        ("nan.stl", with(84 + 50 + 12, &f32::NAN.to_le_bytes()), &["triangle 1 at byte 134", "NaN", "finite"]),
        ("inf.stl", with(84 + 16, &f32::INFINITY.to_le_bytes()), &["triangle 0", "inf", "finite"]),
        ("huge.stl", with(84 + 16, &1e30f32.to_le_bytes()), &["vertex 0", "1e12 mm", "unit"]),
        ("text_nan.stl", text.replacen("vertex 1e1", "vertex nan", 1).into(), &["line 5", "NaN"]),
        ("text_word.stl", text.replacen("vertex 1e1", "vertex 1,0", 1).into(), &["line 5", "\"1,0\""]),
        ("text_cut.stl", text.replace("endsolid\r\n", "").into(), &["cut off"]),
        ("text_torn.stl", text[..text.len() - 40].into(), &["z is missing"]),
        ("text_four.stl", text.replacen("    endloop", "      vertex 0 0 0\n    endloop", 1).into(), &["line 7", "\"vertex\""]),
        ("text_two.stl", text.replacen("      vertex 0e0 0 0\r\n", "", 1).into(), &["2 vertices"]),
        ("not.3mf", b"PK and then nothing".to_vec(), &["zip archive", "export"]),
        ("cut.3mf", three_mf(&cube())[..200].to_vec(), &["zip archive", "export"]),
        ("not.stl", b"<html>no such part</html>".to_vec(), &["web page", "download"]),
        ("page.obj", b"\n<!DOCTYPE html><p>v 0 0 0".to_vec(), &["web page", "download"]),
        ("zip.ply", three_mf(&cube()), &["ZIP archive", "unpack"]),
        ("range.obj", obj.replace("f 3 4 8 7", "f 3 4 9 7").into(), &["line 18", "vertex 9", "does not exist", "export"]),
        ("zero.obj", obj.replace("f 3 4 8 7", "f 3 4 0 7").into(), &["line 18", "index 0", "from 1"]),
        ("back.obj", obj.replace("-7", "-9").into(), &["line 17", "index -9", "8 vertices"]),
        ("inf.obj", obj.replacen("v 10", "v inf", 1).into(), &["line 5", "inf"]),
        ("two.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n".to_vec(), &["line 3", "2 corners"]),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n".to_vec(), &["no triangle"]),
        ("bow.obj", b"v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\n".to_vec(), &["line 5", "crosses itself"]),
        ("cut.ply", ply("0 0 0\n1 0 0\n", ""), &["element vertex", "promises 3", "cut off"]),
        ("nan.ply", ply("0 0 0\n1 nan 0\n0 1 0\n", "3 0 1 2\n"), &["line 11"]),
        ("range.ply", ply(corners, "3 0 1 3\n"), &["face 0", "does not exist"]),
        // Found by fuzzing: counting −1 as an unsigned number overflowed in the message.
        ("minus.ply", ply(corners, "3 0 1 -1\n"), &["face 0", "vertex -1 of 3", "does not exist"]),
        ("points.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n".to_vec(), &["no element face", "cloud"]),
        ("head.ply", b"ply\nformat ascii 1.0\nelement vertex three\nend_header\n".to_vec(), &["header line 3"]),
        ("part.step", b"ISO-10303-21;".to_vec(), &["no triangles", "export it as STL"]),
        ("part.txt", b"1 2 3".to_vec(), &["names no format", ".stl"]),
    ]
}

#[test]
fn every_broken_mesh_is_refused_in_one_line_with_file_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, expected) in broken_meshes() {
        let path = put(folder.path(), name, bytes);
        let message = match read_mesh(&path, &ReadOptions::default()) {
            Ok(_) => panic!("{name} was read"),
            Err(error) => error.to_string(),
        };
        verify(name, &message, &path, expected);
    }
    let missing = read_mesh(&folder.path().join("no.stl"), &ReadOptions::default());
    assert!(missing.unwrap_err().to_string().contains("no.stl: cannot be read"));
}

fn verify(name: &str, message: &str, path: &Path, expected: &[&str]) {
    assert!(message.starts_with(&format!("{}: ", path.display())), "{name}: {message}");
    assert!(!message.contains('\n') && message.contains("; "), "{name}: {message}");
    for words in expected {
        assert!(message.contains(words), "{name}: {message} lacks {words:?}");
    }
}

#[test]
fn every_broken_cloud_is_refused_in_one_line_with_file_place_and_remedy() {
    let ply = |properties: &str, rows: &str| {
        let lines: String =
            properties.split_whitespace().map(|p| format!("property float {p}\n")).collect();
        format!("ply\nformat ascii 1.0\nelement vertex 2\n{lines}end_header\n{rows}").into_bytes()
    };
    let full = "x y z nx ny nz";
    let npz = |arrays: &[(&str, &[u64], &[f64])]| {
        use npyz::WriterBuilder;
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, shape, values) in arrays {
            let options = zip::write::SimpleFileOptions::default();
            archive.start_file(format!("{name}.npy"), options).unwrap();
            let options = npyz::WriteOptions::<f64>::new().default_dtype().shape(shape);
            let mut writer = options.writer(&mut archive).begin_nd().unwrap();
            writer.extend(values.iter().copied()).unwrap();
            writer.finish().unwrap();
        }
        archive.finish().unwrap().into_inner()
    };
    let points: &[f64] = &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    let bad: &[f64] = &[0.0, 0.0, 0.0, 1.0, f64::NAN, 1.0];
    let cases: Vec<Case> = vec![
        ("empty.ply", vec![], &["empty"]),
        ("bare.ply", ply("x y z", "0 0 0\n1 1 1\n"), &["no normals", "nx", "export"]),
        ("zero.ply", ply(full, "0 0 0 0 0 1\n1 1 1 0 0 0\n"), &["normal 1", "no direction"]),
        (
            "none.ply",
            ply(full, "").iter().map(|b| if *b == b'2' { b'0' } else { *b }).collect(),
            &["there are none"],
        ),
        ("mesh.stl", ascii_stl(&cube()).into(), &["normals", "as a mesh"]),
        ("text.npz", b"points".to_vec(), &["zip archive", "numpy.savez"]),
        ("bare.npz", npz(&[("points", &[2, 3], points)]), &["array normals", "numpy.savez"]),
        (
            "shape.npz",
            npz(&[("points", &[6], points), ("normals", &[2, 3], points)]),
            &["array points", "shape is [6]"],
        ),
        (
            "uneven.npz",
            npz(&[("points", &[2, 3], points), ("normals", &[1, 3], &points[3..])]),
            &["2 points, but 1 normals"],
        ),
        (
            "nan.npz",
            npz(&[("points", &[2, 3], bad), ("normals", &[2, 3], points)]),
            &["points row 1", "NaN"],
        ),
        (
            "nan_normal.npz",
            npz(&[("points", &[2, 3], points), ("normals", &[2, 3], bad)]),
            &["normal 0", "no direction"],
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, expected) in cases {
        let path = put(folder.path(), name, bytes);
        let message = match read_cloud(&path) {
            Ok(_) => panic!("{name} was read"),
            Err(error) => error.to_string(),
        };
        verify(name, &message, &path, expected);
    }
    let good = npz(&[("normals", &[2, 3], &[0., 0., 2., 3., 0., 0.]), ("points", &[2, 3], points)]);
    let sites = read_cloud(&put(folder.path(), "good.npz", good)).unwrap();
    assert_eq!(sites.normals, [Vec3::Z, Vec3::X]);
}

#[test]
fn every_broken_tool_table_is_refused_in_one_line_with_file_place_and_remedy() {
    let full = "name,CR,CH,FR,FH\n";
    let row = |row: &str| [full, "a,1,2,3,4\r\n\r\n# note\r\n", row].concat().into_bytes();
    let cases: Vec<Case> = vec![
        ("empty.csv", vec![], &["line 1", "empty", "header row"]),
        ("notes.csv", b"# x\n\n ,, \n".to_vec(), &["line 1", "empty", "header row"]),
        ("header.csv", full.into(), &["line 1", "no tool", "add a row"]),
        ("bare.csv", b"1,2,3,4\n1,2,3,4\n".to_vec(), &["line 1", "no column CR", "header row"]),
        (
            "fh.csv",
            b"\n# x\nCR,CH,FR\n1,2,3\n".to_vec(),
            &["line 3", "no column FH", "CR,CH,FR,FH"],
        ),
        (
            "twice.csv",
            b"CR,CH,cr,FR,FH\n1,2,1,3,4\n".to_vec(),
            &["line 1", "two columns CR", "delete"],
        ),
        ("word.csv", row("b,1,2,x,4\n"), &["line 5", "FR is \"x\"", "not a number", "mm"]),
        ("unit.csv", row("b,1 ell,2,3,4\n"), &["line 5", "CR is \"1 ell\"", "with its unit"]),
        ("gap.csv", row("b,1,,3,4\n"), &["line 5", "CH is empty", "mm"]),
        ("short.csv", row("b,1,2,3\n"), &["line 5", "FH is empty", "mm"]),
        ("comma.csv", row("b,1,5,2,3,4\n"), &["line 5", "6 fields under 5", "semicolons"]),
        ("zero.csv", row("b,0,2,3,4"), &["line 5", "CR is 0", "positive"]),
        ("nan.csv", row("b,1,NaN,3,4"), &["line 5", "CH is NaN", "positive"]),
        ("inf.csv", row("b,1,2,inf,4"), &["line 5", "FR is inf", "positive"]),
        ("narrow.csv", row("b,3,2,1,4"), &["line 5", "FR is 1", "CR = 3 mm"]),
        (
            "corner.csv",
            b"CR,CH,FR,FH,corner\n1,2,3,4,2\n".to_vec(),
            &["line 2", "corner radius is 2"],
        ),
        (
            "margin.csv",
            b"CR;CH;FR;FH;clearance\n1;2;3;4;nan\n".to_vec(),
            &["line 2", "clearance is NaN"],
        ),
        ("names.csv", row("A,1,3,3,4"), &["line 5", "\"A\"", "line 2", "name of its own"]),
        ("quote.csv", row("\"b,1,2,3,4\nc,1,2,3,4\n"), &["line 5", "CR is empty"]),
        ("wide.csv", b"\xff\xfeC\0R\0".to_vec(), &["line 1", "no tool follows"]),
        ("cube.csv", ascii_stl(&cube()).into(), &["line 1", "no column CR"]),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, expected) in cases {
        let path = put(folder.path(), name, bytes);
        // One bad row loses no other tool: it is left out in the same words.
        let message = match tools::read(&path, &tools::MissingParameters::default()) {
            Ok(table) => {
                table.refused.into_iter().next().unwrap_or_else(|| panic!("{name} was read"))
            }
            Err(error) => error.to_string(),
        };
        verify(name, &message, &path, expected);
    }
    // A table that a spreadsheet wrote in its own encoding is read, and that is said.
    let latin = [full.as_bytes(), b"a,1,2,3,4\n\xd86,1,2,3,4"].concat();
    let path = put(folder.path(), "latin.csv", latin);
    let table = tools::read(&path, &tools::MissingParameters::default()).unwrap();
    assert_eq!(table.tools.iter().map(|tool| &tool.name[..]).collect::<Vec<_>>(), ["a", "Ø6"]);
    assert!(table.notices[0].contains("latin.csv: the text is not UTF-8"), "{:?}", table.notices);
}

#[test]
fn bad_options_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "cube.stl", ascii_stl(&cube()));
    for (scale, weld) in [(0.0, 0.0), (-1.0, 0.0), (f64::NAN, 0.0), (1.0, -1e-6), (1.0, f64::NAN)] {
        assert!(read_mesh(&path, &ReadOptions::new(scale, weld)).is_err());
    }
}

#[cfg(feature = "cli")]
#[test]
fn the_check_command_prints_one_object_and_mends_what_it_can() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_deepmill"));
        let output = command.args(["check", "--json"]).args(arguments).output().unwrap();
        let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), result, String::from_utf8(output.stderr).unwrap())
    };
    let mut open = cube();
    open.triangles.pop();
    let path = put(folder.path(), "open.stl", ascii_stl(&open));
    let (code, result, words) = run(&[path.to_str().unwrap()]);
    assert_eq!((code, &result["labelable"]), (Some(1), &false.into()));
    assert_eq!(result["findings"][0]["fault"], "open_edge");
    assert_eq!(result["findings"][0]["places"].as_array().unwrap().len(), 3);
    assert_eq!(result["findings"][0]["places"][0]["edge"].as_array().unwrap().len(), 2);
    assert!(words.contains("try `deepmill check --repair`"), "{words}");
    let (_, _, tried) = run(&[path.to_str().unwrap(), "--repair"]);
    assert!(tried.contains("repair could not") && !tried.contains("try `"), "{tried}");
    assert!(words.contains("open.stl: edge") && words.contains("size 10 × 20 × 30 mm"), "{words}");

    let mut doubled = cube();
    doubled.triangles.push(doubled.triangles[4]);
    doubled.triangles[7].swap(0, 1);
    let path = put(folder.path(), "doubled.stl", ascii_stl(&doubled));
    let mended = folder.path().join("mended.stl");
    let arguments = [path.to_str().unwrap(), "--repair", "--out", mended.to_str().unwrap()];
    let (code, result, words) = run(&arguments);
    assert_eq!((code, result["changes"].as_array().unwrap().len()), (Some(0), 2));
    assert!(words.contains("warning: dropped 1 doubled") && words.contains("warning: turned 1"));
    let mesh = read_mesh(&mended, &ReadOptions::default()).unwrap();
    assert!(check::require_labelable(&mesh).is_ok() && mesh.volume() == 6000.0);

    let (code, result, _) = run(&[path.to_str().unwrap(), "--scale", "0.01"]);
    assert_eq!((code, &result["labelable"]), (Some(1), &false.into()));
    let (_, _, words) = run(&[path.to_str().unwrap(), "--scale", "0.01", "--repair"]);
    assert!(words.contains("under 1 mm; the file is probably in cm: give --unit cm"), "{words}");
}
