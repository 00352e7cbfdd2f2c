//! The record of setups.

use super::placed::{OfPlaced, add_mesh, add_on_part, read_mesh, read_on_part};
use super::{REMEDY, add_text, is_about, metadata, open, read_text};
use crate::analysis::clamping::Clamping;
use crate::analysis::fixtures::Fixture;
use crate::analysis::{SetupRequest, SetupsOutcome};
use crate::data::npz::{NpzReader, NpzWriter};
use crate::findings::Findings;
use crate::findings::gate::SiteAreas;
use crate::planning::setups::{Plan, Setup};
use crate::report::folder::SETUPS;
use crate::report::setups::{Held, Setups};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::mem;
use std::path::{Path, PathBuf};

const FORMAT: &str = "deepmill setups";

/// What is no array.
#[derive(Serialize, Deserialize)]
struct OfSetups<'a> {
    #[serde(flatten)]
    placed: OfPlaced<'a>,
    setup_request: Cow<'a, SetupRequest>,
    /// Of the fixtures of single setups the number and the name.
    setup_fixtures: Vec<(usize, Cow<'a, str>)>,
    /// Without what there is per site.
    plan: Plan,
    /// Of every setup, if something holds the part.
    kept_out: Vec<f64>,
    findings: Cow<'a, Findings>,
    n_rests: usize,
    notices: Cow<'a, [String]>,
}

/// Whatever time it took.
impl PartialEq for SetupsOutcome {
    fn eq(&self, other: &Self) -> bool {
        let SetupsOutcome {
            placed,
            request,
            candidates,
            setups,
            findings,
            n_rests,
            notices,
            seconds: _,
        } = self;
        (placed, request, candidates, setups)
            == (&other.placed, &other.request, &other.candidates, &other.setups)
            && (findings, n_rests, notices) == (&other.findings, &other.n_rests, &other.notices)
    }
}

impl SetupsOutcome {
    /// Reads what [`SetupsOutcome::write`] has written: an equal outcome, but for [`SetupsOutcome::seconds`], which no
    /// file has.
    ///
    /// # Errors
    /// If the folder has no `setups.npz`, as those that an earlier version wrote, or it is damaged.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = &folder.join(SETUPS);
        let mut npz = open(path, FORMAT, "run `deepmill setups` again")?;
        let all: OfSetups = read_text(path, &mut npz, "setups")?;
        let placed = read_on_part(all.placed, path, &mut npz)?;
        let bad = |at: &str, found: &str| Error::file(path, at, found, REMEDY);
        let mut request = all.setup_request.into_owned();
        let fixture = |(k, (number, name)): (usize, (usize, Cow<str>))| {
            let mesh = read_mesh(path, &mut npz, &format!("setup_fixture_{k}_"))?;
            Ok((number, Fixture::new(name, mesh)))
        };
        let fixtures = all.setup_fixtures.into_iter().enumerate().map(fixture);
        request.holding.fixtures = fixtures.collect::<Result<_>>()?;
        let (tools, sites) = (&placed.request.tools, &placed.sites);
        let mut plan = all.plan;
        fill((path, &mut npz), &mut plan, [sites.len(), tools.len()])?;
        let of = (sites, tools.len());
        let mesh = placed.mesh().expect("it was read with triangles");
        let (candidates, list) = request.held(mesh, &placed.request.fixtures, of)?;
        if let Some(k) = unknown_in(&plan, (candidates.list().len(), tools.len())) {
            return Err(bad("setups", &format!("setup {} names what is not there", k + 1)));
        }
        let findings = all.findings.into_owned();
        if !is_about(&findings, placed.shown().1) {
            return Err(bad("setups", "findings of other sites"));
        }
        let held = held(&plan, &list, &all.kept_out)
            .ok_or_else(|| bad("setups", "not held as it was requested"))?;
        let (shown, of_shown) = placed.shown();
        let names = tools.iter().map(|tool| tool.name.clone()).collect();
        let areas = SiteAreas::of(of_shown, shown)?;
        let setups = Setups::new(plan, request.machine().clone(), names, areas);
        let setups = if list.is_empty() { setups } else { setups.held(held) };
        Ok(SetupsOutcome {
            candidates,
            setups,
            findings,
            n_rests: all.n_rests,
            request,
            notices: all.notices.into_owned(),
            seconds: [0.0; 4],
            placed,
        })
    }

    /// Writes `setups.npz`; returns its path.
    pub(in crate::analysis) fn write_record(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(SETUPS);
        let mut npz = NpzWriter::new();
        let (mut plan, of_setups) = (self.setups.plan().clone(), &self.request.holding.fixtures);
        take_out(&mut npz, &mut plan);
        let all = OfSetups {
            placed: OfPlaced::of(&self.placed),
            setup_request: Cow::Borrowed(&self.request),
            setup_fixtures: of_setups.iter().map(|(k, f)| (*k, Cow::from(&*f.name))).collect(),
            plan,
            kept_out: self.setups.holders().iter().map(|held| held.kept_out).collect(),
            findings: Cow::Borrowed(&self.findings),
            n_rests: self.n_rests,
            notices: Cow::Borrowed(&self.notices),
        };
        add_text(&path, &mut npz, "setups", &all)?;
        add_on_part(&path, &mut npz, &self.placed)?;
        for (k, (_, fixture)) in of_setups.iter().enumerate() {
            add_mesh(&mut npz, &format!("setup_fixture_{k}_"), &fixture.mesh);
        }
        let meaning = "the chosen setups and what each reaches; texts are JSON";
        npz.metadata(&metadata(FORMAT, self.placed.part(), meaning));
        npz.write(&path)?;
        Ok(path)
    }
}

/// Moves what a plan has per site into arrays.
fn take_out(npz: &mut NpzWriter, plan: &mut Plan) {
    let n = plan.first.len();
    npz.array("can_be_reached", &[n], &mem::take(&mut plan.can_be_reached));
    npz.array("only_tip", &[n], &mem::take(&mut plan.only_tip));
    let first = mem::take(&mut plan.first);
    let numbers: Vec<u32> = first.iter().map(|k| k.map_or(0, |k| k as u32 + 1)).collect();
    npz.array("first_setup", &[n], &numbers);
    for (k, setup) in plan.setups.iter_mut().enumerate() {
        npz.array(&format!("setup_{k}_reaches"), &[n], &mem::take(&mut setup.reaches));
        let by_tool = mem::take(&mut setup.by_tool);
        npz.array(&format!("setup_{k}_by_tool"), &[by_tool.len(), n], &by_tool.concat());
        let beyond = mem::take(&mut setup.beyond_strokes);
        if !beyond.is_empty() {
            npz.array(&format!("setup_{k}_beyond_strokes"), &[n], &beyond);
        }
    }
}

/// Back from the arrays, for so many sites and tools.
fn fill(
    (path, npz): (&Path, &mut NpzReader),
    plan: &mut Plan,
    [n, n_tools]: [usize; 2],
) -> Result<()> {
    let require = |name: &str, found: usize, expected: usize| {
        let found_words = format!("{found} numbers, expected {expected}");
        let is_right = found == expected;
        if is_right { Ok(()) } else { Err(Error::file(path, name, found_words, REMEDY)) }
    };
    let of_sites = |npz: &mut NpzReader, name: &str| {
        let flags = npz.bools(name)?;
        require(name, flags.len(), n)?;
        Ok::<_, Error>(flags)
    };
    plan.can_be_reached = of_sites(npz, "can_be_reached")?;
    plan.only_tip = of_sites(npz, "only_tip")?;
    let first: Vec<usize> = npz.counts("first_setup")?;
    require("first_setup", first.len(), n)?;
    if first.iter().any(|k| *k > plan.setups.len()) {
        return Err(Error::file(path, "first_setup", "a number of no setup", REMEDY));
    }
    plan.first = first.into_iter().map(|k| k.checked_sub(1)).collect();
    for (k, setup) in plan.setups.iter_mut().enumerate() {
        setup.reaches = of_sites(npz, &format!("setup_{k}_reaches"))?;
        let name = format!("setup_{k}_by_tool");
        let by_tool = npz.bool_rows(&name, n)?;
        require(&name, by_tool.len(), n_tools * n)?;
        setup.by_tool = by_tool.chunks(n.max(1)).map(<[bool]>::to_vec).collect();
        let name = format!("setup_{k}_beyond_strokes");
        if npz.has(&name) {
            setup.beyond_strokes = of_sites(npz, &name)?;
        }
    }
    Ok(())
}

/// The first setup that names a candidate, a tool or a tool axis that is not there.
fn unknown_in(plan: &Plan, (n_candidates, n_tools): (usize, usize)) -> Option<usize> {
    let is_known = |setup: &Setup| {
        let positions = setup.positions.iter().flat_map(|cover| &cover.chosen);
        setup.candidate() < n_candidates
            && setup.tools.chosen.iter().all(|tool| *tool < n_tools)
            && positions.into_iter().all(|axis| *axis < setup.axes.len())
    };
    plan.setups.iter().position(|setup| !is_known(setup))
}

/// What holds the part in each setup; none if there are not as many.
fn held(plan: &Plan, list: &[Clamping], kept_out: &[f64]) -> Option<Vec<Held>> {
    if list.is_empty() || kept_out.len() != plan.setups.len() {
        return (list.is_empty() && kept_out.is_empty()).then(Vec::new);
    }
    let of = |(setup, kept_out): (&Setup, &f64)| {
        let held = &list.get(setup.candidate())?.held;
        Some(Held { kept_out: *kept_out, ..held.clone() })
    };
    plan.setups.iter().zip(kept_out).map(of).collect()
}
