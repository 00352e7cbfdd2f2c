//! Claims about archives, each on a small one.

use super::*;
use glam::DVec3;
use std::io::Write;
use zip::write::SimpleFileOptions;

fn archive(entries: &[(&str, &str)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in entries {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn tetrahedron(id: u32) -> String {
    let corners = ["0 0 0", "1 0 0", "0 2 0", "0 0 3"].map(|corner| {
        let [x, y, z] = [0, 1, 2].map(|k| corner.split(' ').nth(k).unwrap());
        format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>")
    });
    let faces = ["021", "013", "123", "032"].map(|f| {
        format!("<m:triangle v1=\"{}\" v2=\"{}\" v3=\"{}\" pid='5'/>", &f[..1], &f[1..2], &f[2..])
    });
    format!(
        "<object id=\"{id}\"><mesh><vertices>{}</vertices><triangles>{}</triangles></mesh></object>",
        corners.concat(),
        faces.concat()
    )
}

fn model(unit: &str, resources: &str, build: &str) -> String {
    format!(
        "\u{feff}<?xml version=\"1.0\"?><!-- made by hand --><model {unit} xmlns:m='x'>\
         <metadata name=\"Title\">a &amp; b</metadata>\
         <resources>{resources}</resources><build>{build}</build></model>"
    )
}

fn read_model(text: &str) -> Result<Mesh> {
    read(&archive(&[(USUAL_MODEL, text)]), Path::new("part.3mf")).map(|(mesh, _)| mesh)
}

#[test]
fn objects_are_placed_scaled_and_mirrored_as_the_build_says() {
    let inch = model("unit=\"inch\"", &tetrahedron(4), "<item objectid=\"4\"/>");
    let mesh = read_model(&inch).unwrap();
    assert!((mesh.volume() / 25.4f64.powi(3) - 1.0).abs() < 1e-12);
    // A quarter turn about z, a shift, and in the outer object a mirror image.
    let nest = "<object id=\"7\"><components>\
         <component objectid=\"4\" transform=\"0 1 0 -1 0 0 0 0 1 10 0 0\"/>\
         </components></object>";
    let mirror = "<item objectid=\"7\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 5\"/>";
    let text = model("", &(tetrahedron(4) + nest), mirror);
    let mesh = read_model(&text).unwrap();
    assert_eq!(mesh.volume(), 1.0);
    assert_eq!(mesh.bounds().unwrap(), (DVec3::new(-10.0, 0.0, 5.0), DVec3::new(-8.0, 1.0, 8.0)));
}

#[test]
fn the_relationships_name_the_model() {
    let text = model("", &tetrahedron(1), "<item objectid=\"1\"/>");
    let relation = "<Relationships><Relationship Target=\"/a/b.model\" Id=\"r\" \
         Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
    let bytes = archive(&[(RELATIONSHIPS, relation), ("a/b.model", &text)]);
    assert_eq!(read(&bytes, Path::new("x")).unwrap().0.triangles.len(), 4);
}

#[test]
fn broken_models_are_one_line_that_says_where() {
    let whole = model("", &tetrahedron(1), "<item objectid=\"1\"/>");
    let nested = |id: u32| {
        let part = format!("<component objectid=\"{}\"/>", id - 1).repeat(9);
        format!("<object id=\"{id}\"><components>{part}</components></object>")
    };
    let bomb: String = (2..20).map(nested).collect();
    let cases = [
        (whole.replace("v1=\"1\"", "v1=\"9\""), "object 1: vertex 9 of 4"),
        (whole.replace("v1=\"1\"", "v1=\"-1\""), "v1 is \"-1\""),
        (whole.replace("x=\"1\"", "x=\"nan\""), "coordinate x is NaN"),
        (whole.replace("x=\"1\"", "q=\"1\""), "<vertex> has no x"),
        (whole.replace("objectid=\"1\"", "objectid=\"2\""), "object 2 does not exist"),
        (
            whole.replace("objectid=\"1\"", "p:path=\"/b.model\" objectid=\"1\""),
            "part.3mf: b.model: ",
        ),
        (whole.replace("<object ", "<object type=\"solid\" "), "object type \"solid\""),
        (whole.replace("<vertices>", "<b:booleanshape/><vertices>"), "object 1 is a booleanshape"),
        (
            whole.replace("<model", "<model requiredextensions=\"m s\" xmlns:s=\"http://x/slice\""),
            "requires the extension m (x), which",
        ),
        (whole.replace("objectid=\"1\"", "objectid=\"1\" transform=\"1 0\""), "2 numbers, not 12"),
        (whole.replace("<item", "<none"), "places no object"),
        (whole.replace("<model", "<model unit=\"parsec\""), "the unit is \"parsec\""),
        (whole.replace("</build></model>", ""), "cut off"),
        ("no xml at all".into(), "no model"),
        (
            model(
                "",
                "<object id=\"1\"><components><component objectid=\"1\"/></components></object>",
                "<item objectid=\"1\"/>",
            ),
            "multiply without end",
        ),
        (model("", &(tetrahedron(1) + &bomb), "<item objectid=\"19\"/>"), "multiply without end"),
    ];
    for (text, expected) in cases {
        let message = read_model(&text).unwrap_err().to_string();
        assert!(message.contains(expected) && !message.contains('\n'), "{expected}: {message}");
    }
}

/// A block from one corner to another.
fn block(id: u32, more: &str, low: i32, high: i32) -> String {
    let cube = cuboid(low, high);
    format!("<object id=\"{id}\" {more}><mesh>{cube}</mesh></object>")
}

fn cuboid(low: i32, high: i32) -> String {
    let (vertices, triangles) = cuboid_parts(low, high, 0);
    format!("<vertices>{vertices}</vertices><triangles>{triangles}</triangles>")
}

fn cuboid_parts(low: i32, high: i32, first: u32) -> (String, String) {
    let at = |k: usize, axis: usize| if k >> axis & 1 == 1 { high } else { low };
    let vertex = |k| {
        let [x, y, z] = [0, 1, 2].map(|axis| at(k, axis));
        format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>")
    };
    let sides = ["0231", "4576", "0154", "2673", "0462", "1375"];
    let corner = |side: &str, k: usize| side.as_bytes()[k] as u32 - 48 + first;
    let half = |side: &str, [a, b, c]: [usize; 3]| {
        let [a, b, c] = [a, b, c].map(|k| corner(side, k));
        format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>")
    };
    let side = |side: &&str| half(side, [0, 1, 2]) + &half(side, [0, 2, 3]);
    ((0..8).map(vertex).collect(), sides.iter().map(side).collect())
}

/// Volume and what was left out of a model with a file of roles.
fn read_with(text: &str, name: &str, roles: &str) -> Result<(f64, Vec<String>)> {
    let bytes = archive(&[(USUAL_MODEL, text), (name, roles)]);
    let (mesh, left_out) = super::read(&bytes, Path::new("part.3mf"))?;
    let used = mesh.triangles.iter().flatten().collect::<std::collections::HashSet<_>>();
    assert_eq!(used.len(), mesh.vertices.len(), "every vertex belongs to a triangle");
    Ok((mesh.volume(), left_out))
}

#[test]
fn what_is_no_part_of_the_solid_is_left_out_by_name() {
    let items = "<item objectid=\"1\"/><item objectid=\"2\"/>";
    for (more, words) in [
        ("type=\"support\"", "object 2 is a support; it is left out"),
        ("type=\"solidsupport\" name=\"foot\"", "object 2 \"foot\" is a support"),
        ("type=\"surface\"", "is a surface"),
        ("type=\"other\"", "is of type other"),
        (
            "type=\"support\" name=\"1/4&quot; &amp; more\"",
            "object 2 \"1/4\\\" & more\" is a support",
        ),
    ] {
        let text = model("", &(block(1, "type=\"model\"", 0, 1) + &block(2, more, 2, 4)), items);
        let (volume, left_out) = read_with(&text, "none", "").unwrap();
        assert_eq!((volume, left_out.len()), (1.0, 1));
        assert!(left_out[0].contains(words), "{words}: {left_out:?}");
        let alone = model("", &block(2, more, 2, 4), "<item objectid=\"2\"/>");
        let message = read_model(&alone).unwrap_err().to_string();
        assert!(message.contains("nothing is left of it: object 2"), "{message}");
    }
    let both = block(1, "", 0, 1) + &block(2, "", 2, 4);
    let items = "<item objectid=\"1\" printable=\"1\"/><item objectid=\"2\" printable=\"0\"/>";
    let (volume, left_out) = read_with(&model("", &both, items), "none", "").unwrap();
    assert_eq!(volume, 1.0);
    assert!(left_out[0].contains("object 2 is not to be printed"), "{left_out:?}");
    let setting =
        "<metadatagroup><metadata name=\"cura:infill_mesh\">True</metadata></metadatagroup><mesh>";
    let cura = both.replacen("<mesh>", setting, 1);
    let items = "<item objectid=\"1\"/><item objectid=\"2\"/>";
    let (volume, left_out) = read_with(&model("", &cura, items), "none", "").unwrap();
    assert_eq!(volume, 8.0);
    assert!(left_out[0].contains("object 1 is a modifier"), "{left_out:?}");
}

#[test]
fn volumes_and_parts_have_the_roles_that_slicers_write_beside_the_model() {
    let (a, b) = (cuboid_parts(0, 1, 0), cuboid_parts(2, 4, 8));
    let one = format!(
        "<object id=\"1\"><mesh><vertices>{}{}</vertices><triangles>{}{}</triangles></mesh></object>",
        a.0, b.0, a.1, b.1
    );
    let one = model("", &one, "<item objectid=\"1\"/>");
    let two = block(1, "", 0, 1)
        + &block(2, "", 2, 4)
        + "<object id=\"3\" name=\"part\"><components><component objectid=\"1\"/>\
           <component objectid=\"2\"/></components></object>";
    let two = model("", &two, "<item objectid=\"3\"/>");
    let prusa = |second: &str| {
        format!(
            "<config><object id=\"1\"><metadata type=\"object\" key=\"name\" value=\"a\"/>\
             <volume firstid=\"0\" lastid=\"11\"><metadata key=\"volume_type\" value=\"ModelPart\"/></volume>\
             <volume firstid=\"12\" lastid=\"23\"><metadata key=\"name\" value=\"tool\"/>{second}</volume>\
             </object></config>"
        )
    };
    let kind = |kind: &str| prusa(&format!("<metadata key=\"volume_type\" value=\"{kind}\"/>"));
    let bambu = |kind: &str| {
        format!(
            "<config><object id=\"3\"><part id=\"1\" subtype=\"normal_part\"/>\
             <part id=\"2\" subtype=\"{kind}\"><metadata key=\"name\" value=\"tool\"/></part></object></config>"
        )
    };
    let [slic3r, bbs] = roles::FILES;
    for (text, file, roles, words) in [
        (&one, slic3r, kind("ParameterModifier"), "volume \"tool\" of object 1 is a modifier"),
        (&one, slic3r, prusa("<metadata key=\"modifier\" value=\"1\"/>"), "is a modifier"),
        (&one, slic3r, kind("SupportBlocker"), "is a support blocker"),
        (&two, bbs, bambu("modifier_part"), "part \"tool\" of object 3 \"part\" is a modifier"),
        (&two, bbs, bambu("support_enforcer"), "is a support enforcer"),
    ] {
        let (volume, left_out) = read_with(text, file, &roles).unwrap();
        assert_eq!((volume, left_out.len()), (1.0, 1), "{words}");
        assert!(left_out[0].contains(words), "{words}: {left_out:?}");
    }
    assert_eq!(read_with(&one, slic3r, &kind("ModelPart")).unwrap(), (9.0, vec![]));
    assert_eq!(read_with(&two, bbs, &bambu("normal_part")).unwrap(), (9.0, vec![]));
    for (text, file, roles, words) in [
        (
            &one,
            slic3r,
            kind("NegativeVolume"),
            "volume \"tool\" of object 1: it is a negative part",
        ),
        (
            &two,
            bbs,
            bambu("negative_part"),
            "part \"tool\" of object 3 \"part\": it is a negative part",
        ),
        (&two, bbs, bambu("new_part"), "model_settings.config: the role \"new_part\""),
        (&two, bbs, "<config><object".into(), "model_settings.config: "),
    ] {
        let message = read_with(text, file, &roles).unwrap_err().to_string();
        assert!(message.contains(words) && !message.contains('\n'), "{words}: {message}");
    }
}

#[test]
fn objects_of_other_models_of_the_archive_are_placed() {
    let production = "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" \
         requiredextensions=\"p\"";
    let nest = "<object id=\"7\"><components>\
         <component p:path=\"/3D/Objects/a.model\" objectid=\"1\"/>\
         <component p:path=\"/3d/objects/B.model\" objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 9 0 0\"/>\
         </components></object>";
    let items = "<item objectid=\"7\"/><item objectid=\"5\" p:path=\"/3D/Objects/a.model\"/>";
    let main = model(production, nest, items);
    let a = model("", &(block(1, "", 0, 1) + &block(5, "", 20, 23)), "<item objectid=\"1\"/>");
    let b = model("", &block(1, "", 0, 2), "");
    let read = |a: &str, b: &str| {
        let entries = [(USUAL_MODEL, &*main), ("3D/Objects/a.model", a), ("3D/Objects/b.model", b)];
        super::read(&archive(&entries), Path::new("part.3mf")).map(|(mesh, _)| mesh)
    };
    let mesh = read(&a, &b).unwrap();
    assert_eq!((mesh.volume(), mesh.triangles.len()), (1.0 + 8.0 + 27.0, 36));
    assert_eq!(mesh.bounds().unwrap().1, DVec3::splat(23.0));
    let inch = b.replace("<model ", "<model unit=\"inch\" ");
    let nested = b.replace("<resources>", &format!("<resources>{nest}"));
    for (b, words) in [
        (inch, "its unit has 25.4 mm, that of the main model 1 mm"),
        (nested, "it takes objects from 3D/Objects/a.model"),
        (b.replace("id=\"1\"", "id=\"2\""), "object 1 of 3d/objects/B.model does not exist"),
    ] {
        let message = read(&a, &b).unwrap_err().to_string();
        assert!(message.contains(words), "{words}: {message}");
    }
}

#[test]
fn an_archive_that_unpacks_to_far_more_than_it_is_is_refused() {
    let blank = " ".repeat(50 << 20);
    let text = model("", &(tetrahedron(1) + &blank), "<item objectid=\"1\"/>");
    let message = read_model(&text).unwrap_err().to_string();
    assert!(message.contains("unpacks to over"), "{message}");
    assert!(read(b"PK\x03\x04", Path::new("x")).is_err());
}
