//! `deepmill dataset import`: makes a data set of samples in the published format.

use crate::args::called;
use crate::dataset::show;
use crate::output::Output;
use crate::published_args::PublishedArgs;
use deepmill::access::LabelOptions;
use deepmill::data::Sample;
use deepmill::data::dataset::{DatasetSettings, ImportedSample, Split, import};
use deepmill::data::files::published::{self, List};
use deepmill::data::normalized::{self, ScaleFit};
use deepmill::directions::Directions;
use deepmill::{Error, Result, atomic_file};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Make a data set of samples in the published format.
///
/// Reads the raw text under FOLDER/raw_data, whose lengths are millimeters or, as in the authors' files, normalized to
/// ±0.8; the lists of FOLDER/filelist, where there are any, divide training from test samples, which become the
/// validation split.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill dataset import published --mm-per-unit 28.9 --out data")]
pub struct Args {
    /// Folder with raw_data, or with points and filelist.
    folder: PathBuf,
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Read the prepared points of the lists instead of the raw text: they are normalized, so that the
    /// parts' millimeters are lost.
    #[arg(long)]
    lists: bool,
    /// Length of a unit of normalized points, mm; the same for all samples.
    #[arg(
        long,
        value_name = "MM",
        allow_negative_numbers = true,
        conflicts_with = "recover_scale"
    )]
    mm_per_unit: Option<f64>,
    /// Find the length of a unit of each normalized sample: the one at which exact labels agree best with the stored
    /// ones, in steps of 0.1 mm.
    #[arg(long)]
    recover_scale: bool,
    /// Directions that the labels were made with, as `deepmill label` has them: recorded, and used to recover scales.
    #[arg(long, default_value = "published", value_name = "SET", allow_negative_numbers = true)]
    directions: String,
    #[command(flatten)]
    published: PublishedArgs,
}

/// The reads of `dataset import`, in its order.
pub fn run(args: &Args, output: &Output) -> Result<()> {
    if let Some(scale) = args.mm_per_unit.filter(|scale| !(*scale > 0.0 && *scale <= 1e6)) {
        let remedy = "give the length of a unit of the points in mm";
        return Err(Error::argument("--mm-per-unit", scale, "above 0, at most 1 km", remedy));
    }
    let rule = args.published.options(true)?;
    let directions: Directions =
        args.directions.parse().map_err(|error| called(error, "--directions"))?;
    atomic_file::check_writable_folder(&args.out)?;
    let samples = match args.lists {
        true => from_lists(&args.folder, output)?,
        false => from_raw(&args.folder, output)?,
    };
    let settings = DatasetSettings::default()
        .with_n_sites(samples.first().map_or(0, |(_, sample)| sample.sites.len()))
        .with_directions(directions.set().clone())
        .with_occlusion_rounding(rule.rounding)
        .with_bottom_mm(rule.bottom_mm)
        .with_min_edge_mm(None);
    let samples = in_millimeters(args, samples, (&directions, &rule), output)?;
    show(&import(&args.out, settings, &samples)?, output);
    Ok(())
}

/// Every sample in mm; refused where that is not known.
fn in_millimeters(
    args: &Args,
    samples: Vec<(Split, Sample)>,
    rule: (&Directions, &LabelOptions),
    output: &Output,
) -> Result<Vec<ImportedSample>> {
    let n_normalized = samples.iter().filter(|(_, s)| normalized::is_normalized(s)).count();
    let is_scaled = args.mm_per_unit.is_some() || args.recover_scale;
    if let Some((_, sample)) = samples.iter().find(|(_, s)| normalized::is_normalized(s))
        && !is_scaled
        && !args.lists
    {
        let found = format!(
            "points normalized to \u{b1}0.8 beside a cutter in mm, in {n_normalized} of {} samples: \
             the parts' scale is missing",
            samples.len()
        );
        let place = format!("sample {}", sample.name);
        let remedy =
            "give the scale with --mm-per-unit MM, or fit it to the labels with --recover-scale";
        return Err(Error::file(&args.folder, place, found, remedy));
    }
    if args.lists && !is_scaled {
        output.warn(
            "the points of these lists are normalized, cutters are in mm: lengths of the parts are lost \
             without --mm-per-unit or --recover-scale",
        );
    }
    let mut imported = Vec::with_capacity(samples.len());
    for (split, sample) in samples {
        let mm_per_unit = match (args.mm_per_unit, normalized::is_normalized(&sample)) {
            (Some(scale), _) => scale,
            (None, true) if args.recover_scale => recover(&sample, rule, output)?,
            (None, _) => 1.0,
        };
        let sample = match mm_per_unit {
            1.0 => sample,
            scale => normalized::in_millimeters(&sample, scale)?,
        };
        imported.push(ImportedSample::new(split, sample, mm_per_unit));
    }
    Ok(imported)
}

/// Below this agreement a scale is doubtful.
const DOUBTFUL: f64 = 0.97;

/// The scale that fits best; says how well it does.
fn recover(
    sample: &Sample,
    (directions, rule): (&Directions, &LabelOptions),
    output: &Output,
) -> Result<f64> {
    let ScaleFit { best, exchanged, n_occlusion_stored, .. } =
        normalized::fit_scale(sample, directions, rule)?;
    let (name, percent) = (&sample.name, |share: f64| format!("{:.2} %", 100.0 * share));
    output.say(format!(
        "{name}: {} mm per unit, {} of the labels agree, {} occlusion points \
         ({n_occlusion_stored} stored)",
        best.mm_per_unit,
        percent(best.agreement),
        best.n_occlusion
    ));
    if best.agreement < DOUBTFUL {
        output.warn(format!(
            "{name}: at no scale more than {} of the labels agree: they may be of another definition",
            percent(best.agreement)
        ));
    }
    if let Some(twin) = exchanged {
        output.warn(format!(
            "{name}: with CH and FH exchanged {} mm per unit fits as well: {}, {} occlusion points",
            twin.mm_per_unit,
            percent(twin.agreement),
            twin.n_occlusion
        ));
    }
    Ok(best.mm_per_unit)
}

/// All samples of the lists.
fn from_lists(folder: &Path, output: &Output) -> Result<Vec<(Split, Sample)>> {
    let mut samples = Vec::new();
    for (list, split) in LISTS {
        let (of_list, notice) = published::read_list_with_notice(folder, list)?;
        notice.iter().for_each(|notice| output.warn(notice));
        samples.extend(of_list.into_iter().map(|s| (split, s)));
    }
    Ok(samples)
}

/// All samples of the raw text, in the splits that the lists beside it name.
fn from_raw(folder: &Path, output: &Output) -> Result<Vec<(Split, Sample)>> {
    let (samples, notice) = published::read_raw_with_notice(folder)?;
    notice.iter().for_each(|notice| output.warn(notice));
    let [train, test] = LISTS.map(|(list, _)| published::listed_names(folder, list));
    let (train, test) = (train?, test?);
    let in_list = |names: &Option<HashSet<String>>, sample: &Sample| {
        names.as_ref().is_some_and(|names| names.contains(&sample.name))
    };
    let unlisted = samples.iter().filter(|s| !in_list(&train, s) && !in_list(&test, s)).count();
    if unlisted > 0 {
        let lists = "the lists in `filelist` (models_train_val.txt, models_test.txt)";
        output.warn(format!("{unlisted} samples are not in {lists}: they are for training"));
    }
    let split = |sample: &Sample| match in_list(&test, sample) {
        true => Split::Validation,
        false => Split::Train,
    };
    Ok(samples.into_iter().map(|sample| (split(&sample), sample)).collect())
}

const LISTS: [(List, Split); 2] = [(List::TrainVal, Split::Train), (List::Test, Split::Validation)];
