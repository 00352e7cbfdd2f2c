//! Findings that are known: `--baseline`, `--write-baseline`.

use crate::output::Output;
use deepmill::findings::baseline::{Baseline, BaselineCheck, Grown, KnownFinding};
use deepmill::findings::{Finding, Findings};
use deepmill::{Error, Result, atomic_file};
use glam::DVec3;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

#[derive(Clone, clap::Args)]
pub struct BaselineArgs {
    /// Findings that are known (TOML, of --write-baseline): exit with code 3, after everything is written, if a finding
    /// is new, or a known one has grown. 'finding' limits of --fail-if then count what is not known alone.
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Write the findings to this file, as known from now on. If it is there, findings that are still found keep their
    /// names, reasons and dates, and those that are gone are dropped.
    #[arg(long, value_name = "FILE", conflicts_with = "baseline")]
    write_baseline: Option<PathBuf>,
}

/// What is known, and what to do with it.
#[derive(Default)]
pub struct Known {
    path: PathBuf,
    /// None if it is still to be written.
    baseline: Option<Baseline>,
    is_held: bool,
    is_written: bool,
}

impl BaselineArgs {
    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.baseline.iter()
    }

    /// Refuses to write where a part is watched.
    pub fn refuse_to_write(&self) -> Result<()> {
        match &self.write_baseline {
            Some(_) => {
                let remedy = "write it with the command itself, and watch with --baseline";
                Err(Error::argument("--write-baseline", "given with watch", "one of both", remedy))
            }
            None => Ok(()),
        }
    }

    /// Refuses both options beside another.
    pub fn refuse(&self, other: &'static str, remedy: &str) -> Result<()> {
        let named = [("--baseline", &self.baseline), ("--write-baseline", &self.write_baseline)];
        match named.into_iter().find(|(_, path)| path.is_some()) {
            Some((name, _)) => {
                Err(Error::argument(other, format!("given with {name}"), "one of both", remedy))
            }
            None => Ok(()),
        }
    }

    /// Reads what is known, before other work begins.
    pub fn open(&self) -> Result<Known> {
        if let Some(path) = &self.baseline {
            let baseline = Some(Baseline::read(path)?);
            return Ok(Known { path: path.clone(), baseline, is_held: true, is_written: false });
        }
        let Some(path) = &self.write_baseline else { return Ok(Known::default()) };
        atomic_file::check_writable_file(path)?;
        let baseline = path.exists().then(|| Baseline::read(path)).transpose()?;
        Ok(Known { path: path.clone(), baseline, is_held: false, is_written: true })
    }
}

impl Known {
    /// Whether what is not known fails the run.
    pub fn is_held(&self) -> bool {
        self.is_held
    }

    /// Holds findings against what is known, if anything is.
    pub fn check(&self, hold: impl FnOnce(&Baseline) -> BaselineCheck) -> Option<BaselineCheck> {
        self.baseline.as_ref().map(hold)
    }

    /// What is not known, if that fails the run.
    pub fn broken(&self, check: &BaselineCheck) -> Option<String> {
        let (new, grown) = (count(check.new.len(), "new finding"), check.grown.len());
        let of = self.path.display();
        let is_broken = self.is_held && check.is_broken();
        is_broken.then(|| format!("{new} and {grown} grown, against the baseline {of}"))
    }

    /// Writes the baseline of this day, if that is wanted.
    pub fn write(&self, of: impl FnOnce(&str) -> Result<Baseline>) -> Result<Option<PathBuf>> {
        if !self.is_written {
            return Ok(None);
        }
        of(&today())?.write(&self.path)?;
        Ok(Some(self.path.clone()))
    }

    /// Says what is new, grown and gone; as JSON for the result.
    pub fn say(&self, check: Option<BaselineCheck>, findings: &Findings, output: &Output) -> Value {
        if !self.is_held && !self.is_written {
            return Value::Null;
        }
        let list = &findings.list;
        // A file that was not there knows nothing.
        let Some(check) = check else {
            let ids: Vec<&str> = list.iter().map(|finding| &*finding.id).collect();
            output.say(format!(
                "baseline {}: {}",
                self.path.display(),
                count(ids.len(), "finding")
            ));
            return json!({
                "file": self.path, "known": [], "new": ids, "grown": [], "small": [], "gone": [],
            });
        };
        check.warnings.iter().for_each(|warning| output.warn(warning));
        let counts = format!(
            "{} known, {} new, {} grown, {} small, {} gone",
            check.known.len(),
            check.new.len(),
            check.grown.len(),
            check.small.len(),
            check.gone.len()
        );
        output.say(format!("baseline {}: {counts}", self.path.display()));
        for &k in &check.new {
            output.say(format!("  new   {}", words(&list[k])));
        }
        for (k, grown) in &check.grown {
            output.say(format!("  grown {}; {}", words(&list[*k]), words_of_grown(grown)));
        }
        for &k in &check.small {
            output.say(format!("  small {}", words(&list[k])));
        }
        for gone in &check.gone {
            output.say(format!("  gone  {}", words_of_known(gone)));
        }
        self.broken(&check).into_iter().for_each(|why| output.break_limit(why));
        let id = |k: usize| &*list[k].id;
        json!({
            "file": self.path,
            "known": check.known.iter().map(|k| id(*k)).collect::<Vec<_>>(),
            "new": check.new.iter().map(|k| id(*k)).collect::<Vec<_>>(),
            "grown": check.grown.iter().map(|(k, _)| id(*k)).collect::<Vec<_>>(),
            "small": check.small.iter().map(|k| id(*k)).collect::<Vec<_>>(),
            "gone": check.gone.iter().map(|gone| &*gone.id).collect::<Vec<_>>(),
        })
    }
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn place(at: DVec3) -> String {
    let [x, y, z] = at.to_array().map(|x| (1e3 * x).round() / 1e3 + 0.0);
    format!("{x}, {y}, {z}")
}

fn words(finding: &Finding) -> String {
    let Finding { id, area_mm2, at_mm, .. } = finding;
    format!("{id}: {}, {area_mm2:.1} mm2 at {}", finding.words(), place(*at_mm))
}

fn words_of_grown(grown: &Grown) -> String {
    let Grown { was_mm2, is_mm2, patch, .. } = grown;
    match patch {
        Some((mm2, at)) => format!("{mm2:.1} mm2 at {} are not known", place(*at)),
        None => format!("it and its pieces are {is_mm2:.1} mm2, and were {was_mm2:.1} mm2"),
    }
}

fn words_of_known(known: &KnownFinding) -> String {
    let KnownFinding { id, area_mm2, at_mm, reason, .. } = known;
    let because = if reason.is_empty() { String::new() } else { format!(" ({reason})") };
    format!("{id}: {}, {area_mm2:.1} mm2 at {}{because}", known.words(), place(*at_mm))
}

/// The day by the system's clock, at Greenwich.
pub fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    // Four digits of a year, whatever the clock.
    day((seconds / 86_400).min(2_932_896))
}

/// The day so many days after 1970-01-01.
fn day(n_days: u64) -> String {
    let is_leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut year, mut rest) = (1970, n_days);
    while rest >= 365 + u64::from(is_leap(year)) {
        rest -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if rest < length {
            break;
        }
        rest -= length;
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", rest + 1)
}

#[cfg(test)]
mod tests {
    use super::day;

    #[test]
    fn days_are_those_of_the_calendar() {
        for (n_days, expected) in [
            (0, "1970-01-01"),
            (58, "1970-02-28"),
            (59, "1970-03-01"),
            (789, "1972-02-29"),
            (790, "1972-03-01"),
            (10_956, "1999-12-31"),
            (11_016, "2000-02-29"),
            (20_783, "2026-11-26"),
            (2_932_896, "9999-12-31"),
        ] {
            assert_eq!(day(n_days), expected);
        }
    }
}
