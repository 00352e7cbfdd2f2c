//! `--output-unit`: tables, CSV files and the page in another unit; JSON stays in mm.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, json, text};
use std::path::Path;

#[test]
fn tables_files_and_page_are_in_inches_and_json_stays_in_mm() {
    let folder = Folder::new();
    let part = folder.block();
    let out = folder.path("out");
    let args =
        ["label", &part, "--cutter", "1/8in,20,25,30", "--directions", "up", "--sites", "3000"];
    let inches = ["--no-picture", "--report", "--out", &out, "--output-unit", "in"];
    let said = text(&deepmill(&[&args[..], &inches].concat()).stdout);
    assert!(said.contains("area, in²") && said.contains("x, in"), "{said}");
    let read = |name: &str| std::fs::read_to_string(Path::new(&out).join(name)).unwrap();
    let csv = read("findings.csv");
    let mut rows = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (head, row) = (rows.next().unwrap(), rows.next().unwrap());
    let value = |key: &str| {
        let column = head.iter().position(|known| *known == key);
        row[column.unwrap_or_else(|| panic!("{key} in {head:?}"))].parse::<f64>().unwrap()
    };
    // The underside, 40 × 30 mm.
    assert!((value("area_in2") - 1200.0 / 645.16).abs() < 0.06, "{csv}");
    assert!((value("high_x_in") - 40.0 / 25.4).abs() < 0.05 && !csv.contains("_mm"), "{csv}");
    let page = read("report.html");
    assert!(page.contains(" in²</td>") && page.contains("1.57 × 1.18 × 0.79 in"));
    assert!(!page.contains(" mm²</td>") && page.contains(r#""unit":{"name":"in","mm":25.4}"#));

    let of = |unit: &[&str]| {
        let out = ["--no-picture", "--json", "--out", &out];
        let mut result = json(&deepmill(&[&args[..], &out, unit].concat()));
        let object = result.as_object_mut().unwrap();
        object.retain(|key, _| !key.ends_with("_s"));
        result
    };
    let [millimeters, inches] = [of(&[]), of(&["--output-unit", "in"])];
    assert_eq!(millimeters, inches);
    assert_eq!(
        (&inches["unit"], &inches["findings"]["findings"][0]["cause"]),
        (&"mm".into(), &"inaccessible".into())
    );
}

#[test]
fn tables_of_tools_are_read_again_from_inches() {
    let folder = Folder::new();
    let part = folder.block();
    let library = "name,CR,CH,FR,FH,corner\nD6,3,20,20,30,0\nR2,2.0,12,18,25,2\n";
    let library = folder.file("library.csv", library);
    let [out, again] = [folder.path("out"), folder.path("again")];
    let run = |library: &str, out: &str, more: &[&str]| {
        let args = ["tools", &part, "--library", library, "--directions", "up", "--sites", "300"];
        deepmill(&[&args[..], &["--no-picture", "--out", out], more].concat())
    };
    let said = text(&run(&library, &out, &["--output-unit", "in"]).stdout);
    assert!(said.contains("in²") && !said.contains("mm²"), "{said}");
    let table = format!("{out}/tools.csv");
    let csv = std::fs::read_to_string(&table).unwrap();
    assert!(csv.starts_with("name,CR,CH,FR,FH,") && csv.contains("least_stick_out_in"), "{csv}");
    assert!(csv.contains("0.11811023622in"), "{csv}");
    let curves = std::fs::read_to_string(format!("{out}/stick-out.csv")).unwrap();
    assert!(curves.starts_with("name,stick_out_in,reached,reached_in2"), "{curves}");
    let tools = |library: &str| {
        let result = json(&run(library, &again, &["--json"]));
        let number = |key: &str| result["tools"][0][key].as_f64().unwrap();
        [number("CR"), number("CH"), number("reached"), number("least_stick_out")]
    };
    for (a, b) in tools(&library).iter().zip(tools(&table)) {
        assert!((a - b).abs() < 1e-6, "{a}, not {b}");
    }
    let message = failure(&run(&library, &out, &["--output-unit", "inch"]), 2);
    assert!(message.contains("mm, cm, m or in"), "{message}");
}
