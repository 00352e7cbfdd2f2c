//! `deepmill generate`: writes parts made from a seed as STL files with an index.

use crate::output::Output;
use deepmill::data::generated::{self, Family, Lie};
use deepmill::geom::{Mesh, formats};
use deepmill::report::image::Image;
use deepmill::report::picture;
use deepmill::{Error, Result, atomic_file, par};
use indicatif::ProgressBar;
use serde_json::json;
use std::path::PathBuf;

/// Parts generated, written and forgotten together.
const BATCH: usize = 64;
/// Size of a part on the contact sheet, and parts in a row.
const THUMBNAIL: [u32; 2] = [128, 104];
const SHEET_COLUMNS: usize = 8;

/// Make parts from a seed: closed, one body each, 40-250 mm.
///
/// Writes NAME.stl (binary, mm) for each part and index.csv. The same numbers give the same bytes
/// on every machine. Without --family the families take turns.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill generate --count 500 --seed 7 --out parts")]
pub struct Args {
    /// Number of parts.
    #[arg(long, default_value_t = 10)]
    count: usize,
    /// Seed of the series.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the files; made if missing.
    #[arg(long, value_name = "DIR", required_unless_present_any = ["list", "sheet"])]
    out: Option<PathBuf>,
    /// Only this family; see --list.
    #[arg(long, value_name = "NAME", value_parser = family)]
    family: Option<Family>,
    /// Leave the parts as drawn, main opening mostly up, instead of turning some.
    #[arg(long)]
    upright: bool,
    /// Write a PNG with a picture of every part.
    #[arg(long, value_name = "FILE")]
    sheet: Option<PathBuf>,
    /// List the families and stop.
    #[arg(long)]
    list: bool,
}

fn family(name: &str) -> std::result::Result<Family, String> {
    name.parse().map_err(|_: Error| "not a family; `deepmill generate --list` shows all".into())
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    if args.list {
        return list(output);
    }
    if args.count == 0 {
        return Err(Error::argument("count", 0, "at least 1", "say how many parts to make"));
    }
    args.out.iter().try_for_each(|path| atomic_file::check_writable_folder(path))?;
    args.sheet.iter().try_for_each(|path| atomic_file::check_writable_file(path))?;
    let mut index = String::from(HEADER);
    let mut thumbnails = Vec::new();
    let progress = ProgressBar::new(args.count as u64);
    for start in (0..args.count).step_by(BATCH) {
        let parts = par::map(BATCH.min(args.count - start), |k| make(args, (start + k) as u64));
        for part in parts {
            let part = part?;
            index += &part.row;
            thumbnails.extend(part.thumbnail);
        }
        progress.set_position((start + BATCH).min(args.count) as u64);
    }
    progress.finish_and_clear();
    if let Some(out) = &args.out {
        atomic_file::write_atomic(&out.join("index.csv"), |file| file.write_all(index.as_bytes()))?;
        output.say(format!("{} parts and index.csv in {}", args.count, out.display()));
    }
    if let Some(sheet) = &args.sheet {
        Image::grid(&thumbnails, SHEET_COLUMNS).write_png(sheet)?;
        output.say(format!("contact sheet in {}", sheet.display()));
    }
    output.result(&json!({
        "count": args.count, "seed": args.seed, "out": args.out, "sheet": args.sheet,
    }));
    Ok(())
}

fn list(output: &Output) -> Result<()> {
    for family in Family::ALL {
        output.say(format!("{:16} {}", family.name(), family.description()));
    }
    let names: Vec<_> = Family::ALL.iter().map(|f| f.name()).collect();
    output.result(&json!({ "families": names }));
    Ok(())
}

/// What remains of a part after its file is written.
struct Made {
    row: String,
    thumbnail: Option<(Image, String)>,
}

fn make(args: &Args, index: u64) -> Result<Made> {
    let lie = if args.upright { Lie::AsDrawn } else { Lie::Turned };
    let family = args.family.unwrap_or_else(|| generated::family_of(index));
    let mesh = generated::part_lying(family, args.seed, index, lie);
    let name = format!("{}-{index:04}", family.name());
    if let Some(out) = &args.out {
        formats::write_stl(&out.join(format!("{name}.stl")), &mesh)?;
    }
    let [width, height] = THUMBNAIL;
    let picture = || (picture::thumbnail(&mesh, width, height), family.name().to_string());
    Ok(Made { row: row(&name, family, &mesh), thumbnail: args.sheet.is_some().then(picture) })
}

const HEADER: &str =
    "name,family,triangles,min_x,min_y,min_z,max_x,max_y,max_z,area_mm2,volume_mm3\n";

fn row(name: &str, family: Family, mesh: &Mesh) -> String {
    let (low, high) = mesh.bounds().unwrap_or_default();
    let corners = [low, high].map(|c| format!("{:.4},{:.4},{:.4}", c.x, c.y, c.z)).join(",");
    format!(
        "{name},{},{},{corners},{:.1},{:.1}\n",
        family.name(),
        mesh.triangles.len(),
        mesh.area(),
        mesh.volume()
    )
}
