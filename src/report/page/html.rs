//! The markup of a page. Every string of the user goes through [`text`].

use super::view::REST;
use super::{Page, View};
use crate::data::files::Provenance;
use crate::findings::{Findings, openings_words};
use crate::geom::units::Unit;
use crate::tables::{Cell, Table};
use crate::tool::cutter::ToolPart;
use serde_json::Value;
use std::fmt::Write;

const CSS: &str = include_str!("assets/page.css");
const SCRIPTS: [&str; 5] = [
    include_str!("assets/data.js"),
    include_str!("assets/camera.js"),
    include_str!("assets/gpu.js"),
    include_str!("assets/tool.js"),
    include_str!("assets/ui.js"),
];
/// What a live page has beside these.
const LIVE: &str = include_str!("assets/live.js");
/// Findings listed for each tab; the files have all.
const N_LISTED: usize = 200;
/// What every page may do: nothing but run its own script.
const POLICY: &str = include_str!("assets/policy.txt");

/// What the script of a page reads.
pub struct Script {
    /// The description.
    pub about: Value,
    /// The numbers, in base64.
    pub block: String,
    /// Of a live page: its version, and which of all pages it is.
    pub live: Option<[u64; 2]>,
}

/// The document; `areas` are those that the sites stand for, mm².
pub fn document(page: &Page, areas: &[f64], script: Script) -> String {
    let Script { about, block, live } = script;
    let part = text(page.part);
    let mut out = String::with_capacity(block.len() + 100_000);
    let facts = [
        Some(format!("{} sites", page.sites.len())),
        page.mesh.map(|mesh| format!("{} triangles", mesh.triangles.len())),
        page.mesh.and_then(|mesh| mesh.bounds()).map(|(low, high)| {
            let size = high - low;
            let [x, y, z] = size.to_array().map(|mm| number(length(mm, page.unit)));
            format!("{x:.4} × {y:.4} × {z:.4} {}", page.unit)
        }),
    ];
    let facts = facts.into_iter().flatten().collect::<Vec<_>>().join(" · ");
    let tabs: String = (page.views.iter().enumerate())
        .map(|(v, view)| {
            format!(
                "<button role=\"tab\" id=\"tab{v}\" aria-controls=\"view{v}\" aria-selected=\"{}\">{}</button>",
                v == 0,
                text(&view.name)
            )
        })
        .collect();
    let panels: String =
        page.views.iter().enumerate().map(|(v, view)| panel(v, view, (areas, page.unit))).collect();
    let scripts = SCRIPTS.into_iter().chain(live.map(|_| LIVE));
    let scripts: String = scripts.map(|script| script.replace("\"use strict\";\n", "")).collect();
    let (mark, bar, connect, sent) = match live {
        Some([version, number]) => (
            format!(" data-version=\"{version}\" data-number=\"{number}\""),
            "<div id=\"live\" role=\"status\" aria-live=\"polite\"></div>\n",
            "; connect-src 'self'",
            "It follows the part while deepmill watch runs.",
        ),
        None => (String::new(), "", "", "The page loads nothing; it can be sent as it is."),
    };
    let about = about.to_string().replace('<', "\\u003c");
    let program = Provenance::PROGRAM;
    let has_rests = page.views.iter().flat_map(|view| &view.values).any(|of| of.name == REST);
    let rests = if has_rests || live.is_some() { RESTS } else { "" };
    // Those of a live page may come with a later version.
    let outlines = match (page.outlines.is_empty(), live) {
        (true, None) => String::new(),
        (true, Some(_)) => OUTLINES.replace("<label id", "<label hidden id"),
        (false, _) => OUTLINES.into(),
    };
    let _ = write!(
        out,
        r#"<!DOCTYPE html>
<html lang="en"{mark}>
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{POLICY}{connect}">
<meta name="generator" content="{program}">
<title>{part}: which parts a cutter can reach</title>
<style>
{CSS}</style>
</head>
<body>
<header><h1>{part}</h1><p>{facts}</p><button id="theme" title="Light or dark">◐</button></header>
<main>
<section id="stage" aria-label="3-D view">
<canvas id="canvas" tabindex="0" aria-label="The part. Drag to turn, drag with the right button or two fingers to move, scroll or pinch to zoom, arrow keys to turn; click a site for its finding and the tool there."></canvas>
<img id="print" alt="">
{TOOLS}
<div id="scale"><i></i><span></span></div>
{rests}{outlines}<svg id="axes" viewBox="0 0 84 84" aria-hidden="true"></svg>
<div id="tip"></div>
{bar}<div id="message"><noscript>The 3-D view needs scripts; tables and findings are complete without it.</noscript></div>
</section>
<aside id="side">
{overview}<nav role="tablist" aria-label="Answers"{hidden}>{tabs}</nav>
{panels}<footer>{program}. Areas are estimates from the sites. {sent}</footer>
</aside>
</main>
<script id="about" type="application/json">{about}</script>
<script id="block" type="text/plain">{block}</script>
<script>
"use strict";
{scripts}</script>
</body>
</html>
"#,
        overview = overview(page, areas),
        hidden = if page.views.len() == 1 { " hidden" } else { "" },
    );
    out
}

/// What is left, in a section.
const RESTS: &str = "<svg id=\"rests\" aria-hidden=\"true\"></svg>\n";

/// Outlines of fixtures and table over the view, and the box that shows them.
const OUTLINES: &str = r#"<svg id="outlines" aria-hidden="true"><path d=""/></svg>
<label id="fixtures"><input type="checkbox" checked> fixtures</label>
"#;

const TOOLS: &str = r#"<div class="tools">
<div class="group"><button id="home" title="All of the part">Fit</button><button data-look="-58,30" title="From above, front right">Iso</button><button data-look="-90,90" title="From above">Top</button><button data-look="-90,0" title="From the front">Front</button><button data-look="0,0" title="From the right">Right</button><button data-look="122,-30" title="From below, back left">Below</button></div>
<div class="group"><label for="axis">Section</label><select id="axis"><option value="off">off</option><option value="x">x</option><option value="y">y</option><option value="z">z</option><option value="view">as seen</option><option value="tool" hidden>through the tool</option><option value="free" hidden>before finding</option></select><span id="cutting" hidden><input id="cut" type="range" aria-label="Place of the section"><button id="flip" title="Other side">⇄</button><label id="place"></label></span></div>
<div class="group" id="toolbox" hidden><label title="At a site that is clicked, in a pose in which it is reached"><input id="tool" type="checkbox" checked> Tool</label></div>
</div>"#;

/// All tabs in one table, if there are several.
fn overview(page: &Page, areas: &[f64]) -> String {
    let unit = page.unit;
    let rows: String = page
        .views
        .iter()
        .filter_map(|view| view.findings.as_ref().map(|findings| (view, findings)))
        .map(|(view, findings)| {
            let area: f64 =
                findings.list.iter().map(|f| f.area_mm2).sum::<f64>() + findings.scattered.area_mm2;
            format!(
                "<tr><td class=\"w\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
                text(&view.name),
                area_words(area, unit),
                percent(area, areas.iter().sum()),
                findings.list.len(),
                area_words(findings.largest_mm2, unit)
            )
        })
        .collect();
    if page.views.len() < 2 || rows.is_empty() {
        return String::new();
    }
    format!(
        "<details open><summary>All answers</summary><div class=\"wide\"><table><tr><th>answers</th><th class=\"n\">out of reach</th><th></th><th class=\"n\">findings</th><th class=\"n\">largest</th></tr>{rows}</table></div></details>\n"
    )
}

fn panel(v: usize, view: &View, (areas, unit): (&[f64], Unit)) -> String {
    let mut out = format!(
        "<section role=\"tabpanel\" id=\"view{v}\" aria-labelledby=\"tab{v}\">\n<h2>{}</h2>\n<p class=\"about\">{}{}</p>\n",
        text(&view.name),
        text(&view.caption),
        if view.tool.is_empty() { String::new() } else { format!("<br>{}", text(&view.tool)) },
    );
    if !view.warnings.is_empty() {
        let items = view.warnings.iter().map(|w| format!("<li>{}</li>", text(w)));
        let _ = writeln!(out, "<ul class=\"warnings\">{}</ul>", items.collect::<String>());
    }
    out.push_str(&legend(view, areas, unit));
    for (title, rows) in &view.tables {
        out.push_str(&table(title, rows, unit));
    }
    if let Some(findings) = &view.findings {
        out.push_str(&list(findings, unit));
    }
    let rows: String = flat("", &view.settings)
        .into_iter()
        .map(|(name, value)| {
            format!("<tr><td>{}</td><td class=\"w\">{}</td></tr>", text(&name), text(&value))
        })
        .collect();
    if !rows.is_empty() {
        let _ =
            writeln!(out, "<details><summary>Settings</summary><table>{rows}</table></details>");
    }
    out.push_str("</section>\n");
    out
}

/// Groups with their shares, a click hides a color; then the layer with the box that shows it, which is no group: the
/// shares do not depend on it.
fn legend(view: &View, areas: &[f64], unit: Unit) -> String {
    let mut sums = vec![(0usize, 0.0); view.classes.len()];
    for (&class, area) in view.of.iter().zip(areas) {
        let (count, sum) = &mut sums[usize::from(class)];
        *count += 1;
        *sum += area;
    }
    let total: f64 = areas.iter().sum();
    let n_sites = view.of.len();
    let share = |(count, area): (usize, f64)| match view.counts_sites {
        true => percent(count as f64, n_sites as f64),
        false => percent(area, total),
    };
    let mut rows: String = (view.classes.iter().zip(sums).enumerate())
        .filter(|(_, (_, (count, _)))| *count > 0)
        .map(|(k, ((name, [r, g, b]), (count, area)))| {
            format!(
                "<tr data-class=\"{k}\" tabindex=\"0\"><td><span class=\"swatch\" style=\"background:rgb({r},{g},{b})\"></span></td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{count}</td></tr>",
                text(name),
                share((count, area)),
                area_words(area, unit),
            )
        })
        .collect();
    if let Some(layer) = &view.layer {
        let marked = layer.of.iter().zip(areas).filter(|(mark, _)| **mark);
        let (count, area) = marked.fold((0, 0.0), |(n, sum), (_, area)| (n + 1, sum + area));
        let [r, g, b] = layer.colors.first().copied().unwrap_or_default();
        let _ = write!(
            rows,
            "<tr class=\"layer\"><td><span class=\"swatch\" style=\"background:rgb({r},{g},{b})\"></span></td><td><label><input type=\"checkbox\" data-layer{}> {}</label></td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{count}</td></tr>",
            if layer.is_shown { " checked" } else { "" },
            text(&layer.name),
            share((count, area)),
            area_words(area, unit),
        );
    }
    format!(
        "<table class=\"legend\"><tr><th></th><th>color</th><th class=\"n\">share</th><th class=\"n\">area</th><th class=\"n\">sites</th></tr>{rows}</table>\n"
    )
}

/// A table of numbers under its title.
fn table(title: &str, table: &Table, unit: Unit) -> String {
    let (headings, rows) = table.shown_in(unit);
    let class = |k: usize| match rows.first().is_some_and(|row| row[k].is_number()) {
        true => "n",
        // What names the row stays on one line.
        false if k == 0 => "p",
        false => "w",
    };
    let head: String = (headings.iter().enumerate())
        .map(|(k, heading)| format!("<th class=\"{}\">{}</th>", class(k), text(heading)))
        .collect();
    let cells = |row: &Vec<Cell>| -> String {
        let cell = |(k, cell): (usize, &Cell)| {
            format!("<td class=\"{}\">{}</td>", class(k), text(&cell.show()))
        };
        format!("<tr>{}</tr>", row.iter().enumerate().map(cell).collect::<String>())
    };
    let rows: String = rows.iter().map(cells).collect();
    format!(
        "<h3>{}</h3>\n<div class=\"wide\"><table><tr>{head}</tr>{rows}</table></div>\n",
        text(title)
    )
}

/// The findings; a click flies to one.
fn list(findings: &Findings, unit: Unit) -> String {
    let has_help = findings.list.iter().any(|f| f.helps.is_some());
    let mut out = String::from("<h3>Findings</h3>\n");
    if findings.list.is_empty() && findings.scattered.n_regions == 0 {
        out.push_str("<p class=\"about\">Everything is accessible.</p>\n");
        return out;
    }
    let _ = write!(
        out,
        "<div class=\"wide\"><table><tr><th></th><th>cause</th><th class=\"n\">area</th><th class=\"n\">share</th><th>at x, y, z, {}</th>",
        unit
    );
    out.push_str(if has_help { "<th>helps</th></tr>" } else { "</tr>" });
    for (number_of, f) in (1..).zip(&findings.list).take(N_LISTED) {
        // To a tenth of a millimeter or thousandth of another unit, and never minus zero.
        let (ten, digits) = if unit == Unit::Millimeter { (10.0, 1) } else { (1e3, 3) };
        let rounded = |mm: f64| (ten * length(mm, unit)).round() / ten + 0.0;
        let [x, y, z] = f.at_mm.to_array().map(rounded);
        let mut cause = f.words().to_string();
        if let Some(part) = f.blocked_by.filter(|part| *part != ToolPart::Tip) {
            let _ = write!(cause, ", by the {part}");
        }
        if let Some(found) = &f.fixture {
            let share = percent(found.share, 1.0);
            let _ = write!(cause, ", {} in the way of {share}", text(&found.fixture));
        }
        if f.proven == Some(1.0) {
            cause.push_str(", proven");
        }
        if let Some(clearance) = f.worst_clearance_mm {
            let clearance = number(length(f64::from(clearance), unit));
            let _ = write!(cause, ", clearance {clearance} {}", unit);
        }
        if let Some(rest) = f.greatest_rest_mm {
            let rest = number(length(f64::from(rest), unit));
            let _ = write!(cause, ", up to {rest} {} left", unit);
        }
        if let Some(left) = f.left_mm3 {
            let _ = write!(cause, ", {}", volume_words(left, unit));
        }
        let _ = write!(cause, "; {}", text(&f.id));
        if let Some(status) = f.status {
            let _ = write!(cause, ", {}", status.name());
        }
        if let Some(reason) = f.reason.as_ref().filter(|reason| !reason.is_empty()) {
            let _ = write!(cause, ": {}", text(reason));
        }
        let _ = write!(
            out,
            "<tr data-finding=\"{number_of}\" tabindex=\"0\"{}><td>{number_of}</td><td>{cause}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"p\">{x:.digits$}, {y:.digits$}, {z:.digits$}</td>",
            if f.change.is_some()
                || f.stopped.is_some()
                || !f.advice.is_empty()
                || !f.opens.is_empty()
            {
                " class=\"more\""
            } else {
                ""
            },
            area_words(f.area_mm2, unit),
            percent(f.area_share, 1.0),
        );
        if has_help {
            let help = f.helps.as_ref().map_or("–".into(), |help| {
                format!("{} ({})", text(&help.tool), percent(help.share, 1.0))
            });
            let _ = write!(out, "<td class=\"w\">{help}</td>");
        }
        out.push_str("</tr>");
        let n_columns = if has_help { 5 } else { 4 };
        let mut helps = |words: &str| {
            let _ = write!(
                out,
                "<tr class=\"helps\"><td></td><td colspan=\"{n_columns}\">{}</td></tr>",
                text(words)
            );
        };
        if let Some(stopped) = &f.stopped {
            helps(&format!("not proposed: {stopped}"));
        }
        if !f.opens.is_empty() {
            helps(&openings_words(&f.opens));
        }
        for advice in &f.advice {
            helps(&format!("of the part: {}", advice.words));
        }
        if let Some(change) = &f.change {
            helps(&format!("{}: reaches {} of it", change.words, percent(change.share, 1.0)));
        }
    }
    let more = findings.list.len().saturating_sub(N_LISTED);
    if more > 0 {
        let _ = write!(out, "<tr><td></td><td colspan=\"4\">{more} more in findings.csv</td></tr>");
    }
    let small = &findings.scattered;
    if small.n_regions > 0 {
        let _ = write!(
            out,
            "<tr><td></td><td>{} small regions</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td></td></tr>",
            small.n_regions,
            area_words(small.area_mm2, unit),
            percent(small.area_mm2, findings.surface_mm2),
        );
    }
    out.push_str("</table></div>\n");
    out
}

/// Every value with the path to it.
fn flat(path: &str, value: &Value) -> Vec<(String, String)> {
    let below = |key: &str| match path {
        "" => key.to_string(),
        path => format!("{path}.{key}"),
    };
    match value {
        Value::Object(map) => {
            map.iter().flat_map(|(key, value)| flat(&below(key), value)).collect()
        }
        Value::Null => Vec::new(),
        Value::Array(list) if list.is_empty() => Vec::new(),
        Value::Array(list) => {
            let words: Vec<String> = list.iter().map(plain).collect();
            vec![(path.into(), words.join(", "))]
        }
        value => vec![(path.into(), plain(value))],
    }
}

/// A string without its quotes, or the value as JSON.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A length, mm, in the unit of the page.
fn length(mm: f64, unit: Unit) -> f64 {
    mm / unit.millimeters()
}

/// An area, mm², in the unit of the page.
fn area_words(mm2: f64, unit: Unit) -> String {
    let area = length(length(mm2, unit), unit);
    let shown =
        if unit != Unit::Millimeter && area < 10.0 { format!("{area:.4}") } else { number(area) };
    format!("{shown} {unit}²")
}

fn volume_words(mm3: f64, unit: Unit) -> String {
    let volume = length(length(length(mm3, unit), unit), unit);
    let shown = match unit {
        Unit::Millimeter => number(volume),
        _ if volume < 10.0 => format!("{volume:.5}"),
        _ => number(volume),
    };
    format!("{shown} {unit}³")
}

/// A number with about three digits.
fn number(x: f64) -> String {
    match x.abs() {
        a if a >= 100.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        _ => format!("{x:.2}"),
    }
}

fn percent(part: f64, whole: f64) -> String {
    if whole > 0.0 { format!("{:.1} %", 100.0 * part / whole) } else { "–".into() }
}

/// A string as text of the document or of an attribute.
fn text(raw: &str) -> String {
    let mut out = String::with_capacity(raw.len());
    for c in raw.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}
