//! A page of any words and any sites: its words stay text, and its data read back: the description as JSON, the block
//! of numbers as the groups and places that were put in.
#![no_main]

use deepmill::geom::Sites;
use deepmill::geom::units::Unit;
use deepmill::report::page::{Page, View};
use flate2::read::ZlibDecoder;
use glam::{DVec3, Vec3};
use libfuzzer_sys::fuzz_target;
use serde_json::Value;
use std::io::Read;

/// Between two places of the page, the only ones of their kind.
fn between<'a>(html: &'a str, from: &str, to: &str) -> &'a str {
    let mut found = html.split(from);
    let after = found.nth(1).expect("the beginning");
    assert!(found.next().is_none(), "two of {from}");
    after.split(to).next().expect("the end")
}

fn unpacked(base64: &str) -> Vec<u8> {
    let digit = |b: u8| match b {
        b'A'..=b'Z' => b - b'A',
        b'a'..=b'z' => b - b'a' + 26,
        b'0'..=b'9' => b - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("digit {b}"),
    };
    let mut bytes = Vec::new();
    for four in base64.trim_end_matches('=').as_bytes().chunks(4) {
        let bits = four.iter().fold(0u32, |bits, b| bits << 6 | u32::from(digit(*b)));
        let bits = bits << (6 * (4 - four.len()));
        bytes.extend_from_slice(&bits.to_be_bytes()[1..four.len()]);
    }
    let mut block = Vec::new();
    ZlibDecoder::new(&bytes[..]).read_to_end(&mut block).expect("a whole stream");
    block
}

fuzz_target!(|input: (&str, &str, &str, Vec<(i16, i16, i16, u8)>, i8)| {
    let (part, words, warning, sites, power) = input;
    let scale = (f32::from(power) / 16.0).exp2();
    let axes = [Vec3::X, Vec3::NEG_Y, Vec3::Z, Vec3::new(-0.6, 0.0, -0.8)];
    let points = sites.iter().map(|(x, y, z, _)| scale * Vec3::from([*x, *y, *z].map(f32::from)));
    let normals = sites.iter().map(|(.., k)| axes[usize::from(k % 4)]).collect();
    let sites_of = Sites { points: points.collect(), normals, faces: vec![] };
    let mut view = View::default();
    view.name = words.into();
    view.caption = warning.into();
    view.tool = part.into();
    view.classes = vec![(words.into(), [1, 2, 3]), (part.into(), [4, 5, 6])];
    view.of = sites.iter().map(|(.., k)| k >> 7).collect();
    view.settings = Value::String(words.into());
    view.warnings = vec![warning.into()];
    let unit = Unit::ALL[sites.len() % Unit::ALL.len()];
    let page =
        Page { part, mesh: None, sites: &sites_of, views: &[view.clone()], unit, outlines: &[] };
    let Ok(html) = page.html() else { return };
    assert_eq!(html.matches("<script").count(), html.matches("</script>").count());
    let about = between(&html, "<script id=\"about\" type=\"application/json\">", "</script>");
    let about: Value = serde_json::from_str(about).expect("JSON");
    assert_eq!(about["views"][0]["name"], words);
    let block = between(&html, "<script id=\"block\" type=\"text/plain\">", "</script>");
    let block = unpacked(block);
    let part_of = |name: &str| {
        let [at, len] = [0, 1].map(|i| about["parts"][name][i].as_u64().expect(name) as usize);
        &block[at..at + len]
    };
    assert_eq!(part_of("view0.class"), view.of);
    let n = sites.len();
    let low: DVec3 = serde_json::from_value(about["low_mm"].clone()).expect("a corner");
    let step = about["step_mm"].as_f64().expect("a length");
    let places = part_of("sites.places");
    assert_eq!(places.len(), 6 * n);
    for c in 0..3 {
        let mut place = 0u16;
        for (i, point) in sites_of.points.iter().enumerate() {
            let code = u16::from_le_bytes([places[2 * c * n + i], places[(2 * c + 1) * n + i]]);
            place = place.wrapping_add((code >> 1) ^ (code & 1).wrapping_neg());
            let found = low[c] + step * f64::from(place);
            let off = (found - f64::from(point[c])).abs();
            assert!(off <= 0.5001 * step, "{found} for {point}, a step is {step}");
        }
    }
});
