//! What the C interface promises: answers of the library.
#![allow(unsafe_code)]

mod c_library;

use c_library::{Library, block, c, words};
use deepmill::analysis::{Analysis, Outcome};
use deepmill::capi::*;
use deepmill::data::files::tools::Tool;
use deepmill::geom::sites::SiteOptions;
use deepmill::geom::{Mesh, solids};
use deepmill::glam::Vec3;

/// An L of 40 × 30 × 20 mm.
fn step() -> Mesh {
    let outline = [[0.0, 0.0], [40.0, 0.0], [40.0, 6.0], [15.0, 6.0], [15.0, 20.0], [0.0, 20.0]];
    let outline = outline.map(|[x, y]| deepmill::glam::dvec2(x, y));
    solids::prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 30.0)
}

/// The flat end whose holder begins 11 mm above the tip reaches the walls of the block, which are 20 mm high, from
/// 9 mm above its underside on, and the top; the one whose holder begins at 26 mm all but the underside.
#[test]
fn answers_are_those_computed_by_hand() {
    let library = Library::new();
    let (mesh, tools) = (library.mesh(&block()), library.tools(&[5.0, 20.0]));
    let outcome = library.run(library.analysis(mesh, tools));
    let low = block().bounds().unwrap().0.z as f32;
    let points = library.floats(outcome, 0, DM_POINTS);
    let normals = library.floats(outcome, 0, DM_NORMALS);
    let [short, long, both] =
        [0, 1, DM_ALL_TOOLS].map(|tool| library.bytes(outcome, tool, DM_ANSWERS));
    assert_eq!((short.len(), points.len()), (normals.len() / 3, normals.len()));
    let mut n_by_holder = 0;
    for (i, point) in points.chunks_exact(3).enumerate() {
        let (height, is_underside) = (point[2] - low, normals[3 * i + 2] < -0.5);
        assert_eq!(u32::from(long[i]) == DM_INACCESSIBLE, is_underside);
        assert_eq!(both[i], long[i]);
        // Within the tolerance of 0.01 mm either answer is right.
        if (height - 9.0).abs() > 0.02 {
            assert_eq!(u32::from(short[i]), u32::from(height < 9.0), "at {point:?}");
            n_by_holder += usize::from(height < 9.0 && !is_underside);
        }
    }
    assert!(n_by_holder > 50);

    let (mut share, mut mm2, mut n_findings) = (f64::NAN, f64::NAN, 0);
    // SAFETY: pointers to variables.
    unsafe {
        let of_short = dm_outcome_share(library.0, outcome, 0, DM_INACCESSIBLE, &mut share);
        library.done(of_short);
        // The underside of 1200 mm² and 9 of 20 mm of walls of 2800 mm², of 5200 mm².
        assert!((share - (1200.0 + 1260.0) / 5200.0).abs() < 0.02, "{share}");
        library.done(dm_outcome_surface(library.0, outcome, &mut mm2));
        assert!((mm2 - 5200.0).abs() < 1e-9);
        let count = dm_outcome_n_findings(library.0, outcome, DM_ALL_TOOLS, &mut n_findings);
        library.done(count);
        assert_eq!(n_findings, 1);
        let mut finding = std::mem::MaybeUninit::<dm_finding>::uninit();
        let status = dm_outcome_finding(library.0, outcome, DM_ALL_TOOLS, 0, finding.as_mut_ptr());
        library.done(status);
        let finding = finding.assume_init();
        assert_eq!((finding.answer, finding.normal), (DM_INACCESSIBLE, [0.0, 0.0, -1.0]));
        assert!((finding.area_mm2 - 1200.0).abs() < 60.0, "{finding:?}");
        let low = f64::from(low);
        assert_eq!((finding.at_mm[2], finding.low_mm[2], finding.high_mm[2]), (low, low, low));
        assert!(finding.greatest_rest_mm.is_nan() && finding.left_mm3.is_nan());
        let id = words(&|buffer, n, needed| {
            dm_outcome_finding_id(library.0, outcome, DM_ALL_TOOLS, 0, buffer, n, needed)
        });
        assert!(library.text(outcome, DM_ALL_TOOLS, DM_FINDINGS_JSON).contains(&id));
    }
    let numbers = library.wholes(outcome, DM_ALL_TOOLS, DM_FINDING_OF_SITE);
    let n_of_it = numbers.iter().filter(|number| **number == 1).count();
    assert_eq!(n_of_it, long.iter().filter(|answer| **answer != 0).count());
}

/// What the library answers in Rust.
fn in_rust(mesh: Mesh) -> Outcome {
    let flat = |lengths: &str| Tool::new(lengths.parse().unwrap(), Some(0.0), 0.0).unwrap();
    Analysis::new("part", mesh, vec![flat("3,5,20,20"), flat("3,20,20,20")])
        .spread(SiteOptions::default().with_n_sites(400).with_seed(3))
        .directions("cone:60:40".parse().unwrap())
        .table(-1.0)
        .rest(true)
        .run(&mut ())
        .unwrap()
}

#[test]
fn answers_have_the_bits_of_the_library_for_every_number_of_threads() {
    let library = Library::new();
    let expected = in_rust(step());
    let flat = |vectors: &[Vec3]| vectors.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
    for n_threads in [0, 1, 3] {
        let analysis = library.analysis(library.mesh(&step()), library.tools(&[5.0, 20.0]));
        // SAFETY: texts end with a zero.
        unsafe {
            library.done(dm_analysis_set_sites(library.0, analysis, 400, 3));
            let set = c("cone:60:40");
            library.done(dm_analysis_set_directions(library.0, analysis, set.as_ptr()));
            library.done(dm_analysis_set_search(library.0, analysis, 32));
            library.done(dm_analysis_set_table(library.0, analysis, -1.0));
            library.done(dm_analysis_set_rest(library.0, analysis, 1));
            library.done(dm_analysis_set_threads(library.0, analysis, n_threads));
        }
        let outcome = library.run(analysis);
        let mut counts = [0; 3];
        let [sites, tools, directions] = &mut counts;
        // SAFETY: pointers to variables.
        let status = unsafe { dm_outcome_counts(library.0, outcome, sites, tools, directions) };
        library.done(status);
        assert_eq!(counts, [expected.sites().len(), 2, 40]);
        assert_eq!(library.floats(outcome, 0, DM_POINTS), flat(&expected.sites().points));
        assert_eq!(library.floats(outcome, 0, DM_NORMALS), flat(&expected.sites().normals));
        assert_eq!(library.wholes(outcome, 0, DM_FACES), expected.sites().faces);
        let vectors = flat(expected.directions().vectors());
        assert_eq!(library.floats(outcome, 0, DM_DIRECTIONS), vectors);
        let shares = library.doubles(outcome, 0, DM_AREA_SHARES);
        assert_eq!(shares, expected.areas().unwrap().shares());
        for (tool, of) in (0..).zip(expected.answers()) {
            let (answers, surface) = (&of.labels.answers, of.labels.surface.as_ref().unwrap());
            let codes: Vec<u8> = answers.of_sites().iter().map(|answer| *answer as u8).collect();
            assert_eq!(library.bytes(outcome, tool, DM_ANSWERS), codes);
            assert_eq!(library.floats(outcome, tool, DM_REST_MM), answers.rest_mm());
            let volume = library.floats(outcome, tool, DM_REST_VOLUME_MM3);
            assert_eq!(volume, answers.rest_volume_mm3());
            let share = library.floats(outcome, tool, DM_ACCESSIBLE_SHARE);
            assert_eq!(share, answers.accessible_share());
            let counts = library.wholes(outcome, tool, DM_ACCESSIBLE_DIRECTIONS);
            assert_eq!(counts, answers.accessible_directions());
            let open = library.floats(outcome, tool, DM_OPEN_DIRECTIONS);
            assert_eq!(open, surface.open_directions);
            assert_eq!(library.doubles(outcome, tool, DM_TOLERANCE_MM), surface.tolerance_mm);
            let numbers = library.wholes(outcome, tool, DM_FINDING_OF_SITE);
            assert_eq!(numbers, of.findings.of_site);
            let witness = library.floats(outcome, tool, DM_WITNESS);
            let tips = library.doubles(outcome, tool, DM_TIP_MM);
            for (i, found) in answers.witness().iter().enumerate() {
                let rows = 3 * i..3 * i + 3;
                let pose = surface.witness[i].map(|pose| pose.tip_mm.to_array());
                match found {
                    Some(direction) => assert_eq!(witness[rows.clone()], direction.to_array()),
                    None => assert!(witness[rows.clone()].iter().all(|x| x.is_nan())),
                }
                match pose {
                    Some(tip) => assert_eq!(tips[rows], tip),
                    None => assert!(tips[rows].iter().all(|x| x.is_nan())),
                }
            }
        }
        let json = library.text(outcome, DM_ALL_TOOLS, DM_FINDINGS_JSON);
        assert_eq!(json, expected.findings().json().to_string());
        let warnings: Vec<String> =
            expected.answers()[0].warnings.iter().map(ToString::to_string).collect();
        assert!(library.text(outcome, 0, DM_WARNINGS).ends_with(&warnings.join("\n")));
    }
}

/// The names after `before` in a text, with what is up to `end`.
fn named<'a>(text: &'a str, before: &str, end: char) -> Vec<(&'a str, &'a str)> {
    let after = text.split(before).skip(1).filter(|rest| rest.starts_with(['d', 'D']));
    after
        .filter_map(|rest| {
            let at = rest.find(|c: char| !c.is_alphanumeric() && c != '_')?;
            Some((&rest[..at], &rest[at..at + rest[at..].find(end)?]))
        })
        .collect()
}

/// `.ci/run` has the header written anew and compares; this finds at once what was forgotten.
#[test]
fn the_header_declares_every_function_and_constant_of_the_sources() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/capi");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let header = read("deepmill.h");
    let (mut n_functions, mut n_constants) = (0, 0);
    for name in ["mod", "mesh", "tools", "analysis", "outcome"] {
        for (function, arguments) in named(&read(&format!("border/{name}.rs")), "\"C\" fn ", ')') {
            let start = format!("{function}(");
            let declared = header.split(&start).nth(1).expect(function);
            let n_declared = declared[..declared.find(')').unwrap()].replace("void", "");
            let n_declared = n_declared.matches(',').count();
            let n_arguments = arguments.trim_end().trim_end_matches(',').matches(',').count();
            assert_eq!(n_declared, n_arguments, "{function}");
            n_functions += 1;
        }
    }
    for name in ["border/mod.rs", "fields.rs", "mesh.rs", "results.rs", "work.rs"] {
        for (constant, value) in named(&read(name), "pub const ", ';') {
            let value = value.trim_start_matches(": u32 = ").replace('_', "");
            let value = if value == "0xffffffff" { "4294967295".into() } else { value };
            assert!(header.contains(&format!("#define {constant} {value}\n")), "{constant}");
            n_constants += 1;
        }
    }
    assert_eq!(n_functions, header.matches("(dm_context *").count() + 4);
    assert_eq!(n_constants, header.matches("#define DM_").count());
}
