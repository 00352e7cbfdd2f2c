//! `deepmill watch`: answers again whenever a file is written, on a page that follows.

mod files;
mod server;

use crate::output::Output;
use crate::{label, setups, tools};
use clap::{ArgMatches, Command, FromArgMatches};
use deepmill::analysis::{Observer, Progress};
use deepmill::findings::Findings;
use deepmill::findings::baseline::{Baseline, BaselineCheck};
use deepmill::geom::units::Unit;
use deepmill::report::page::LivePage;
use deepmill::{Error, Result};
use files::Files;
use serde_json::json;
use server::{Kind, Server};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long a file that cannot be read is taken for one that is still being written.
const PATIENCE: Duration = Duration::from_millis(1000);
/// A finding of the area of fewer sites is not missed when it is gone, as one that is new is not named then.
const SMALL_SITES: f64 = 8.0;
/// Findings that are named one by one when they come or go.
const N_NAMED: usize = 4;

/// Answer again whenever the part or another file that is read is written, on a page that follows in the browser.
///
/// Prints the address of the page, on this machine alone (127.0.0.1), and a line for every version. Ctrl-C ends it.
/// With --out the files of the command are written after every answer; without it, none are.
#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Example: deepmill watch part.stl --cutter 1.5,6,40,5\n\
Setups: deepmill watch setups part.stl --tools shop.csv --machine 3-axis")]
pub struct Args {
    #[command(subcommand)]
    other: Option<Other>,
    #[command(flatten)]
    label: Label,
    /// Port of the page; 0: any that is free.
    #[arg(long, global = true, value_name = "PORT", default_value_t = 0)]
    port: u16,
}

/// The arguments of `label`, which need not be named: there, unless another command is.
// As `Option<label::Args>`, but for arguments that are flattened in turn.
struct Label(Option<Box<label::Args>>);

impl FromArgMatches for Label {
    fn from_arg_matches(matches: &ArgMatches) -> clap::error::Result<Self> {
        let args = matches.contains_id("parts").then(|| label::Args::from_arg_matches(matches));
        Ok(Label(args.transpose()?.map(Box::new)))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> clap::error::Result<()> {
        *self = Label::from_arg_matches(matches)?;
        Ok(())
    }
}

impl clap::Args for Label {
    fn augment_args(command: Command) -> Command {
        label::Args::augment_args(command)
    }

    fn augment_args_for_update(command: Command) -> Command {
        label::Args::augment_args_for_update(command)
    }
}

#[derive(clap::Subcommand)]
enum Other {
    Label(Box<label::Args>),
    Tools(Box<tools::Args>),
    Setups(Box<setups::Args>),
}

/// A command whose answers can be watched.
pub trait Watched {
    /// The files that are read, the part first.
    fn files(&self) -> Vec<PathBuf>;

    /// Answers. The findings get the names that they have in `before`. If a part of the answer is there long before
    /// the rest, `look` gets it.
    ///
    /// # Errors
    /// As the command, or those of `look`.
    fn answer(
        &self,
        before: Option<&Baseline>,
        observer: &mut dyn Observer,
        look: &mut Look,
        output: &Output,
    ) -> Result<Answer>;
}

/// Is given an answer that is not complete.
pub type Look<'a> = dyn FnMut(Answer) -> Result<()> + 'a;

/// What is shown of an answer.
pub struct Answer {
    pub page: LivePage,
    /// The findings, held against those before.
    pub check: Option<BaselineCheck>,
    pub findings: Baseline,
    /// Limits that are broken.
    pub broken: Vec<String>,
    /// Writes the files of the command, if there is a folder for them.
    pub write: Option<Box<Write>>,
}

/// Writes files.
type Write = dyn FnOnce(&mut dyn Observer) -> Result<()>;

/// What writes files into a folder, if there is one.
pub fn writer(
    folder: Option<&Path>,
    write: impl FnOnce(&Path, &mut dyn Observer) -> Result<()> + 'static,
) -> Option<Box<Write>> {
    let folder = folder?.to_path_buf();
    Some(Box::new(move |observer| write(&folder, observer)))
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let watched: &dyn Watched = match (&args.other, &args.label.0) {
        (Some(Other::Label(args)), _) => &**args,
        (Some(Other::Tools(args)), _) => &**args,
        (Some(Other::Setups(args)), _) => &**args,
        (None, Some(args)) => &**args,
        (None, None) => {
            let remedy = "name the file of a part";
            return Err(Error::argument("PART", "none", "a part to watch", remedy));
        }
    };
    let files = Files::watch(&watched.files())?;
    let server = Server::start(args.port)?;
    let start = Instant::now();
    let mut seen = files.n_written();
    let mut screen = Screen { server: &server, output, n_pages: 0, look_s: None };
    let mut shown = watched.answer(None, &mut (), &mut |_| Ok(()), output)?;
    screen.show(&mut shown, None, start)?;
    let address = server.address();
    output.say(format!("watching {}: {address}", words(&watched.files())));
    output.result(&json!({ "address": address, "files": watched.files() }));
    let quiet = output.of_repetition();
    loop {
        write(&mut shown, &files, seen, output);
        seen = files.wait(seen);
        let start = Instant::now();
        server.say(Kind::Working, "A file was written: computing");
        let mut look = |next: Answer| screen.look(next, &shown, start);
        match answer(watched, (&files, seen), (&shown.findings, &mut look), &quiet) {
            Ok(Some(mut next)) => {
                screen.show(&mut next, Some(&shown), start)?;
                shown = next;
            }
            // Written again meanwhile.
            Ok(None) => {}
            Err(error) => {
                screen.go_back_to(&mut shown)?;
                output.warn(format!("{error}; the page shows the version before"));
                server.say(Kind::Error, &format!("{error}. This is the version before."));
            }
        }
    }
}

/// Answers for files that were written; nothing if they are written again meanwhile. One that cannot be read may not be
/// complete yet: it is waited for.
fn answer(
    watched: &dyn Watched,
    (files, seen): (&Files, u64),
    (before, look): (&Baseline, &mut Look),
    output: &Output,
) -> Result<Option<Answer>> {
    let mut observer = |_: Progress| match files.n_written() == seen {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    };
    match watched.answer(Some(before), &mut observer, look, output) {
        Ok(answer) => Ok(Some(answer)),
        Err(_) if files.is_written_within(seen, PATIENCE) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Writes the files of an answer, if that is wanted and nothing newer is there.
fn write(shown: &mut Answer, files: &Files, seen: u64, output: &Output) {
    if let Some(write) = shown.write.take().filter(|_| files.n_written() == seen)
        && let Err(error) = write(&mut ())
    {
        output.warn(error);
    }
}

/// Where answers are shown.
struct Screen<'a> {
    server: &'a Server,
    output: &'a Output,
    n_pages: u64,
    /// When the newest page was shown, if its answer is not complete: seconds after the files were written.
    look_s: Option<f64>,
}

impl Screen<'_> {
    /// Shows an answer, and what changed since the one before.
    fn show(&mut self, next: &mut Answer, before: Option<&Answer>, start: Instant) -> Result<()> {
        let html = self.page(next, before)?;
        let mut line = heading(next);
        let changes = before.map_or_else(Vec::new, |before| changes(next, before));
        let broken = next.broken.iter().map(|why| format!("limit broken: {why}"));
        let changes: Vec<String> = changes.into_iter().chain(broken).collect();
        let complete_s = start.elapsed().as_secs_f64();
        line += &match self.look_s.take() {
            Some(look_s) => {
                format!("; shown after {look_s:.2} s, complete after {complete_s:.2} s")
            }
            None => format!("; {complete_s:.2} s"),
        };
        self.output.say(&line);
        changes.iter().for_each(|change| self.output.say(format!("  {change}")));
        self.server.show(html, numbers(next), (Kind::Shown, &line), &changes);
        Ok(())
    }

    /// Shows an answer that is not complete.
    fn look(&mut self, mut next: Answer, before: &Answer, start: Instant) -> Result<()> {
        let html = self.page(&mut next, Some(before))?;
        let words = format!("{}; computing what is in the way and would help", heading(&next));
        let changes = changes(&next, before);
        self.server.show(html, numbers(&next), (Kind::Working, &words), &changes);
        self.look_s = Some(start.elapsed().as_secs_f64());
        Ok(())
    }

    /// Shows an answer again, if another one was shown that will not be complete.
    fn go_back_to(&mut self, shown: &mut Answer) -> Result<()> {
        if self.look_s.take().is_some() {
            let html = self.page(shown, None)?;
            self.server.show(html, numbers(shown), (Kind::Working, ""), &[]);
        }
        Ok(())
    }

    /// The page of an answer, which is made the newest.
    fn page(&mut self, next: &mut Answer, before: Option<&Answer>) -> Result<String> {
        if let Some(before) = before {
            next.page.follow(&before.page);
        }
        self.n_pages += 1;
        next.page.number = self.n_pages;
        next.page.html()
    }
}

fn numbers(answer: &Answer) -> [u64; 2] {
    [answer.page.version, answer.page.number]
}

/// The version, and how much it reaches.
fn heading(answer: &Answer) -> String {
    let page = &answer.page;
    let mut line = format!("version {}", page.version);
    if let Some(findings) = findings(page) {
        let reached_mm2 = page.reached_mm2().unwrap_or_default();
        let share = 100.0 * reached_mm2 / findings.surface_mm2.max(f64::MIN_POSITIVE);
        line += &format!(": {share:.2} % of the surface is reached");
    }
    line
}

/// What changed, in words.
fn changes(next: &Answer, before: &Answer) -> Vec<String> {
    let mut lines = Vec::new();
    if let (Some(is), Some(was)) = (next.page.reached_mm2(), before.page.reached_mm2()) {
        lines.push(format!("{} reachable", area(is - was, next.page.unit, true)));
    }
    let (Some(check), Some(findings)) = (&next.check, findings(&next.page)) else { return lines };
    let unit = next.page.unit;
    let listed = |numbers: &mut dyn Iterator<Item = usize>| {
        let of = |k: usize| (findings.list[k].id.clone(), findings.list[k].area_mm2);
        numbers.map(of).collect::<Vec<_>>()
    };
    // Smaller ones come and go with the sites.
    let least_mm2 = SMALL_SITES * findings.surface_mm2 / findings.of_site.len().max(1) as f64;
    let gone = check.gone.iter().filter(|known| known.area_mm2 >= least_mm2);
    let gone = gone.map(|known| (known.id.clone(), known.area_mm2)).collect();
    let new = listed(&mut check.new.iter().copied());
    let grown = listed(&mut check.grown.iter().map(|(k, _)| *k));
    for (list, is_what) in [(gone, "gone"), (new, "new"), (grown, "larger")] {
        lines.extend(named(&list, is_what, unit));
    }
    lines
}

fn findings(page: &LivePage) -> Option<&Findings> {
    page.views.first()?.findings.as_ref()
}

/// `finding A (3.1 mm²), finding B (2 mm²) and 5 more are gone`; nothing of nothing.
fn named(list: &[(String, f64)], is_what: &str, unit: Unit) -> Option<String> {
    let words = |(id, mm2): &(String, f64)| format!("finding {id} ({})", area(*mm2, unit, false));
    let first: Vec<String> = list.iter().take(N_NAMED).map(words).collect();
    let verb = if list.len() == 1 { "is" } else { "are" };
    match list.len().checked_sub(N_NAMED) {
        _ if list.is_empty() => None,
        None | Some(0) => Some(format!("{} {verb} {is_what}", first.join(", "))),
        Some(more) => Some(format!("{} and {more} more {verb} {is_what}", first.join(", "))),
    }
}

/// An area in the square of a unit.
fn area(mm2: f64, unit: Unit, signed: bool) -> String {
    let area = mm2 / unit.millimeters().powi(2);
    // No minus before a zero.
    let area = if area.abs() < 5e-4 { 0.0 } else { area };
    let digits = if area.abs() < 10.0 { 3 } else { 1 };
    match signed {
        true => format!("{area:+.digits$} {unit}²"),
        false => format!("{area:.digits$} {unit}²"),
    }
}

fn words(files: &[PathBuf]) -> String {
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_have_the_sign_of_the_change_and_the_unit_of_the_output() {
        assert_eq!(area(312.04, Unit::Millimeter, true), "+312.0 mm²");
        assert_eq!(area(-2.71, Unit::Millimeter, true), "-2.710 mm²");
        assert_eq!(area(-1e-9, Unit::Millimeter, true), "+0.000 mm²");
        assert_eq!(area(645.16, Unit::Inch, false), "1.000 in²");
    }

    #[test]
    fn many_findings_are_counted() {
        let list: Vec<(String, f64)> = (0..6).map(|k| (format!("f{k}"), f64::from(k))).collect();
        assert_eq!(named(&[], "gone", Unit::Millimeter), None);
        let one = named(&list[1..2], "gone", Unit::Millimeter).unwrap();
        assert_eq!(one, "finding f1 (1.000 mm²) is gone");
        let all = named(&list, "new", Unit::Millimeter).unwrap();
        assert!(
            all.starts_with("finding f0 (0.000 mm²), finding f1")
                && all.ends_with(" and 2 more are new")
        );
    }
}
