//! What holds the part in its setups: a vise, a table, fixtures.

mod polygons;
mod tested;
mod vise;

pub(super) use tested::{Tested, Tests};
pub use vise::Vise;

use super::fixtures::Fixture;
use crate::geom::Mesh;
use crate::planning::setups::{Candidate, Candidates, direction_words};
use crate::report::setups::Held;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;
use vise::{Grip, Grips};

/// Beside the fixtures of the analysis, which are there in every setup.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Holding {
    pub vise: Option<Vise>,
    pub table: Option<Table>,
    /// Of the setups with these numbers, from 1. Records have them beside.
    #[serde(skip)]
    pub fixtures: Vec<(usize, Fixture)>,
}

/// A square across z'.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Table {
    /// How far below the lowest place of the part.
    pub below_mm: f64,
    /// Twice the diagonal of the part's box, if there is none.
    pub width_mm: Option<f64>,
}

/// One way to hold the part in a candidate.
#[derive(Debug)]
pub(super) struct Clamping {
    /// Its number.
    pub candidate: usize,
    pub held: Held,
}

/// Every way to hold the part; the candidates in their order.
#[derive(Debug)]
pub(super) struct Clampings {
    pub list: Vec<Clamping>,
    /// What cannot be held.
    pub notice: Option<String>,
}

/// Tables farther below or wider are refused, mm.
const MAX_TABLE_MM: f64 = 1e5;

impl Table {
    fn is_valid(&self) -> bool {
        let is_width = |mm: f64| mm > 0.0 && mm <= MAX_TABLE_MM;
        (0.0..=MAX_TABLE_MM).contains(&self.below_mm) && self.width_mm.is_none_or(is_width)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.below_mm)?;
        self.width_mm.iter().try_for_each(|mm| write!(f, ",{mm}"))
    }
}

impl Holding {
    /// Whether nothing is in the way but the part.
    pub(super) fn is_none(&self, fixtures: &[Fixture]) -> bool {
        let Holding { vise, table, fixtures: of_setups } = self;
        vise.is_none() && table.is_none() && of_setups.is_empty() && fixtures.is_empty()
    }

    /// In words, for settings.
    pub(super) fn words(&self, fixtures: &[Fixture]) -> String {
        let mut words = Vec::new();
        words.extend(self.vise.map(|vise| format!("vise {vise}")));
        words.extend(self.table.map(|table| format!("table {table}")));
        words.extend(fixtures.iter().map(|fixture| fixture.name.clone()));
        let of_setup = |(setup, fixture): &(usize, Fixture)| format!("{setup}: {}", fixture.name);
        words.extend(self.fixtures.iter().map(of_setup));
        words.join(", ")
    }

    /// What is wrong with fixtures of one setup, a sentence each.
    ///
    /// # Errors
    /// As [`Fixture::around`].
    pub(super) fn warnings(&self, part: &Mesh) -> Result<Vec<String>> {
        let fixtures = self.fixtures.iter().map(|(_, fixture)| fixture.clone()).collect();
        Ok(Fixture::around(part, fixtures, None)?.1)
    }

    /// The ways to hold `part` in the candidates, with `fixtures` in all of them. Of `given` candidates each must be
    /// held, of others those that cannot are left out.
    ///
    /// # Errors
    /// If a number is of no setup, the table is above the part or too far, the machine holds the part along a rotary
    /// axis and there is a vise or table, or the vise cannot grip the part.
    pub(super) fn clampings(
        &self,
        part: &Mesh,
        candidates: &Candidates,
        fixtures: &[Fixture],
        given: bool,
    ) -> Result<Clampings> {
        self.check(candidates, given)?;
        let (mut list, mut left_out, mut too_wide_mm) = (Vec::new(), Vec::new(), None::<f64>);
        for (number, candidate) in candidates.list().iter().enumerate() {
            let grips = self.grips(part, candidate, candidates);
            let nearest = |mm: f64| too_wide_mm.map_or(mm, |least| least.min(mm));
            too_wide_mm = grips.too_wide_mm.map(nearest).or(too_wide_mm);
            if grips.list.is_empty() && self.vise.is_some() {
                if given {
                    let words = candidates.machine().setup_words(candidate.direction);
                    return Err(self.refused(Some(words), grips.too_wide_mm));
                }
                left_out.push(direction_words(candidate.direction));
                continue;
            }
            let grips: Vec<Option<&Grip>> = match self.vise {
                Some(_) => grips.list.iter().map(Some).collect(),
                None => vec![None],
            };
            for grip in grips {
                let held =
                    self.held(part, (number, candidates.turn(candidate.direction)), fixtures, grip);
                list.push(Clamping { candidate: number, held });
            }
        }
        if list.is_empty() {
            return Err(self.refused(None, too_wide_mm));
        }
        let notice = (!left_out.is_empty()).then(|| {
            let (n, all) = (left_out.len(), candidates.list().len());
            let up = left_out.join("; ");
            format!("the vise cannot grip the part in {n} of {all} orientations, which are left out: {up} up")
        });
        Ok(Clampings { list, notice })
    }

    /// Refuses what does not suit the machine or the setups.
    fn check(&self, candidates: &Candidates, given: bool) -> Result<()> {
        if candidates.machine().is_chucked() {
            let expected = "a machine on whose table the part lies";
            let remedy = "here the part is held along the rotary axis: leave it out, or give the chuck as a fixture";
            if let Some(vise) = self.vise {
                return Err(Error::argument("vise", vise, expected, remedy));
            }
            if let Some(table) = self.table {
                return Err(Error::argument("table", table, expected, remedy));
            }
        }
        if let Some(table) = self.table.filter(|table| !table.is_valid()) {
            let expected = "0 to 100 m below the part, and a width above 0";
            let remedy =
                "write 0 if the part lies on it, for example 20,400 for a table of 400 mm 20 below";
            return Err(Error::argument("table", table, expected, remedy));
        }
        let n = if given { candidates.list().len() } else { 0 };
        if let Some((setup, fixture)) = self.fixtures.iter().find(|(k, _)| !(1..=n).contains(k)) {
            let found = format!("{setup}:{}", fixture.name);
            let expected = match n {
                0 => "a fixture of every setup, where none is given".into(),
                n => format!("the number of a given setup, 1 to {n}"),
            };
            let remedy = "give the setups with --setup (`given` in a program), or the fixture without a number";
            return Err(Error::argument("fixture", found, expected, remedy));
        }
        Ok(())
    }

    fn grips(&self, part: &Mesh, candidate: &Candidate, candidates: &Candidates) -> Grips {
        let of = |vise: Vise| vise.grips(part, candidate.direction, candidates.faces());
        self.vise.map(of).unwrap_or_default()
    }

    /// What is around the part in a setup.
    fn held(
        &self,
        part: &Mesh,
        (number, turn): (usize, [DVec3; 3]),
        fixtures: &[Fixture],
        grip: Option<&Grip>,
    ) -> Held {
        let of_setup = self.fixtures.iter().filter(|(setup, _)| *setup == number + 1);
        let fixtures = fixtures.iter().chain(of_setup.map(|(_, fixture)| fixture));
        let (mut words, mut bodies) = (Vec::new(), Vec::new());
        if let Some(grip) = grip {
            words.push(format!("vise on {}", faces_words(grip.across)));
            bodies.push(grip.body.clone());
        }
        if let Some(Table { below_mm, width_mm }) = self.table {
            words.push("table".into());
            bodies.push(Fixture::table_below(part, turn, below_mm, width_mm).mesh);
        }
        for fixture in fixtures {
            words.push(fixture.name.clone());
            bodies.push(fixture.mesh.clone());
        }
        Held {
            words: words.join(" + "),
            opening_mm: grip.map(|grip| grip.opening_mm),
            grip_mm: grip.map(|grip| grip.height_mm),
            under_jaws_mm2: grip.map(|grip| grip.under_jaws_mm2),
            kept_out: 0.0,
            bodies,
        }
    }

    /// The error of a vise that grips nothing, in a setup or in any.
    fn refused(&self, setup: Option<String>, too_wide_mm: Option<f64>) -> Error {
        let vise = self.vise.map(|vise| vise.to_string()).unwrap_or_default();
        let of = setup.map(|words| format!(" in the setup {words}")).unwrap_or_default();
        let (expected, remedy) = match too_wide_mm {
            Some(mm) => {
                let mm = (1e3 * mm).round() / 1e3;
                let expected = format!("an opening of {mm} mm or more{of}");
                (
                    expected,
                    "no opposite flat faces are nearer: take a vise that opens wider".to_string(),
                )
            }
            None => {
                let expected = format!(
                    "two opposite flat faces across z'{of} that both jaws touch on half of what is in front of the part"
                );
                let remedy =
                    "take other jaws or clampings, or leave the vise out and give the fixtures";
                (expected, remedy.to_string())
            }
        };
        Error::argument("vise", vise, expected, remedy)
    }
}

/// `±y`, or `±(0.6, 0.8, 0)`.
fn faces_words(across: DVec3) -> String {
    let words = direction_words(across.as_vec3());
    match words.trim_start_matches(['+', '-']) {
        name if name.len() == 1 => format!("±{name}"),
        _ => format!("±({words})"),
    }
}
