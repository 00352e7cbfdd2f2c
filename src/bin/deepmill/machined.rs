//! `deepmill machined`: the part that tools leave of a stock.

use crate::args::{DirectionArgs, ToolArgs, called, millimeters, name_of};
use crate::clock::Clock;
use crate::machine::{MachineOrFile, machine_or_file};
use crate::mesh_args::{MeshArgs, warn_wide_tools};
use crate::out_folder::check_out;
use crate::output::Output;
use crate::part_itself::SurfaceArgs;
use crate::premise::premise;
use crate::progress::Bars;
use deepmill::analysis::{Analysis, MachinedOutcome, SetupRequest, Stock};
use deepmill::planning::setups::{Machine, direction_of_words};
use deepmill::tables::{Cell, Facts};
use deepmill::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Compute the part that tools leave of a stock: what none of them removes in any direction stays on it.
///
/// Writes to DIR: machined.stl (the part with what is left, one closed surface), rest.stl (what is left, a body each),
/// machined.csv (volume left by each tool alone, and after it; with --machine after each in every setup), rest.csv
/// (volume and place of each body) and machined.png.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill machined part.stl --cutter 3,20,20,40 --out machined\n\
Of a stock 2 mm larger: deepmill machined part.stl --tools tools.csv --stock box:2 --out machined\n\
In setups: deepmill machined part.stl --tools tools.csv --machine 3-axis --setup +z --setup -z --out machined")]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF), closed.
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    #[command(flatten)]
    tools: ToolArgs,
    #[command(flatten)]
    directions: DirectionArgs,
    /// In setups of this machine, one after the other (3-axis, 3+2:DEGREES, 5-axis:DEGREES, 4-axis, 4-axis:x …,
    /// FILE.toml, FILE.fcm, as for `setups`): the fewest that cover 99 % of what can be reached.
    #[arg(long, value_name = "MACHINE", value_parser = machine_or_file,
        conflicts_with_all = ["directions", "fixture", "table"])]
    machine: Option<MachineOrFile>,
    /// In this setup of the machine: the direction of the part that points to the spindle, or along the rotary axis
    /// (+z, -x or X,Y,Z). May be given again: in their order.
    #[arg(long, value_name = "DIRECTION", allow_hyphen_values = true, requires = "machine")]
    setup: Vec<String>,
    #[command(flatten)]
    surface: SurfaceArgs,
    /// What the part is milled from: `box:MM` (its box with so much more on every side), or a closed mesh about it.
    #[arg(long, value_name = "box:MM|FILE", default_value = "box:0")]
    stock: String,
    /// How closely, mm; by default a hundredth of the part's longest side, at most 0.1, but no finer than a 400th of
    /// it.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = millimeters)]
    accuracy: Option<f64>,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Draw no picture.
    #[arg(long)]
    no_picture: bool,
}

impl Args {
    /// The setups of a machine.
    fn setups_on(&self, machine: Machine) -> Result<SetupRequest> {
        let given = self.setup.iter().map(|text| direction_of_words(text));
        let given = given.collect::<Result<_>>().map_err(|error| called(error, "--setup"))?;
        Ok(SetupRequest::on(machine).given(given))
    }

    fn stock(&self, output: &Output) -> Result<Stock> {
        let Some(more) = self.stock.strip_prefix("box:") else {
            let path = Path::new(&self.stock);
            return self.read.read_fixture(path, output).map(Stock::Body);
        };
        millimeters(more).map(Stock::Box).map_err(|found| {
            let remedy = "write for example box:2, or the path of a mesh";
            Error::argument("--stock", format!("`{}`: {found}", self.stock), "box:MM", remedy)
        })
    }
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let tools = args.surface.tolerances.with_allowance(args.tools.tools(output)?)?;
    let options = args.surface.options()?;
    let directions = args.directions.directions()?;
    let machine = args.machine.as_ref().map(MachineOrFile::machine).transpose()?;
    let setups = machine.clone().map(|machine| args.setups_on(machine)).transpose()?;
    let files = output.forms(!args.no_picture, false, &[])?;
    check_out(&args.out)?;
    let mut clock = Clock::start();
    let mesh = args.read.read_bodies(&args.part, false, output)?;
    warn_wide_tools(&mesh, &tools, output);
    let stock = args.stock(output)?;
    clock.lap("read_s", "reading");
    let premise = match machine {
        Some(machine) => format!("machine {machine}, fixtures are not modelled"),
        None => premise(&directions, &args.surface),
    };
    let analysis = Analysis::new(name_of(&args.part), mesh, tools);
    let analysis = analysis.options(options);
    let analysis = match setups {
        Some(_) => analysis,
        None => analysis.directions(directions),
    };
    let analysis = args.surface.add_to(analysis, &args.read, output)?;
    let named = |error: Error| match error {
        Error::Argument { name: "stock", .. } => called(error, "--stock"),
        Error::Argument { name: "accuracy", .. } => called(error, "--accuracy"),
        Error::Argument { name: "setups", .. } => called(error, "--setup"),
        other => other,
    };
    let outcome = analysis.machine(&stock, args.accuracy, setups, &mut Bars::default());
    let outcome = outcome.map_err(named)?;
    outcome.warnings().iter().for_each(|warning| output.warn(warning));
    outcome.notices().iter().for_each(|notice| output.say(notice));
    clock.stages(STAGES, outcome.seconds());
    let paths = outcome.write(&args.out, &files)?;
    clock.lap("write_s", "writing and drawing");
    let facts = facts(&outcome, &clock);
    output.say(&premise);
    output.say(facts.text_in(output.unit()));
    output.files(&paths);
    let (table, bodies) = (outcome.table(), outcome.bodies_table());
    output.say(table.text_in(output.unit()));
    let mut result = facts.json();
    result["premise"] = json!(premise);
    result["tools"] = table.json();
    result["bodies"] = bodies.json();
    args.read.add_origin(&mut result);
    output.result_with_files(result, &paths);
    Ok(())
}

/// Keys and names of what [`MachinedOutcome::seconds`] has.
const STAGES: [[&str; 2]; 2] = [["machined_s", "machined part"], ["join_s", "joining"]];

fn facts(outcome: &MachinedOutcome, clock: &Clock) -> Facts {
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(outcome.part()));
    facts.add("accuracy_mm", "accuracy, mm", Cell::Given(outcome.accuracy_mm()));
    facts.add("n_directions", "directions", Cell::count(outcome.n_directions()));
    facts.add("to_remove_mm3", "to remove, mm³", Cell::Number(outcome.to_remove_mm3()));
    facts.add("left_mm3", "left, mm³", Cell::Number(outcome.left_mm3()));
    facts.add("n_bodies", "bodies that are left", Cell::count(outcome.n_bodies()));
    if !outcome.setups().is_empty() {
        facts.add("n_setups", "setups", Cell::count(outcome.setups().len()));
    }
    facts.add("n_rounds", "rounds", Cell::count(outcome.n_rounds()));
    clock.add_to(&mut facts);
    facts
}
