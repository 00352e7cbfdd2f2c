//! Findings of one tool or several, and which change of a tool would help.

use crate::Result;
use crate::access::Labels;
use crate::access::surface::explain::RegionAdvice;
use crate::access::surface::{PartChange, PartLength, SurfaceOptions, TriangleObstacles};
use crate::answers::SiteAnswer;
use crate::data::files::tools::Tool;
use crate::exec::par;
use crate::findings::{Findings, Opening, PartAdvice, ToolChange, add_blocking_parts, add_proofs};
use crate::geom::{Mesh, Sites};
use crate::tool::cutter::Assembly;
use crate::tool::directions::{DirectionSet, Directions};
use glam::Vec3;

/// Findings that are shown in words, and for which a change of the tool is looked for.
pub const N_SHOWN: usize = 6;

/// A change of the tool that reaches less of a region is no help.
const LEAST_SHARE: f64 = 0.25;

/// Box axes along which regions are looked at from.
const AXES: [(&str, Vec3); 6] = [
    ("+x", Vec3::X),
    ("-x", Vec3::NEG_X),
    ("+y", Vec3::Y),
    ("-y", Vec3::NEG_Y),
    ("+z", Vec3::Z),
    ("-z", Vec3::NEG_Z),
];
/// Cosine of 8°, about half of the angle between neighbors of the default set: an axis that is nearer to a direction
/// was tested.
const TESTED: f32 = 0.990_27;
/// Sites of a region that are looked at.
const N_OPENED: usize = 192;
/// Openings that are named.
const N_OPENINGS: usize = 2;

/// The findings of every tool, and which other tools help; `names` and `labels` are of the same tools.
///
/// # Errors
/// As [`Findings::of`].
pub fn findings_of_tools(
    sites: &Sites,
    mesh: Option<&Mesh>,
    names: &[&str],
    labels: &[&Labels],
) -> Result<Vec<Findings>> {
    let accessible: Vec<Vec<bool>> = labels.iter().map(|l| l.answers.accessible()).collect();
    let of = |k: usize| {
        let others = (0..names.len()).filter(|other| *other != k);
        let others: Vec<_> = others.map(|o| (names[o], &accessible[o][..])).collect();
        let mut found = Findings::of(sites, mesh, &labels[k].answers, &others)?;
        if let Some(surface) = &labels[k].surface {
            add_proofs(&mut found, &surface.open_directions);
        }
        add_blocking_parts(&mut found, &labels[k].blocked_by);
        Ok(found)
    };
    (0..names.len()).map(of).collect()
}

/// Adds to the largest findings the box axes that were not tested and along which one of the tools reaches them.
///
/// # Errors
/// As [`TriangleObstacles::label`].
pub(super) fn add_openings(
    findings: &mut Findings,
    sites: &Sites,
    tools: &[Tool],
    obstacles: &TriangleObstacles,
    (directions, options): (&Directions, &SurfaceOptions),
) -> Result<()> {
    let is_tested = |axis: Vec3| directions.vectors().iter().any(|d| d.dot(axis) > TESTED);
    let axes = AXES.into_iter().filter(|(_, axis)| !is_tested(*axis));
    let alone = |(name, axis): (&'static str, Vec3)| {
        let set = DirectionSet::List { vectors: vec![axis.as_dvec3().to_array()] };
        Directions::new(set).map(|directions| (name, directions))
    };
    let axes = axes.map(alone).collect::<Result<Vec<(&'static str, Directions)>>>()?;
    if axes.is_empty() {
        return Ok(());
    }
    let n_found = findings.list.len().min(N_SHOWN);
    let regions = (1..).take(n_found).map(|number: u32| {
        let all = 0..findings.of_site.len();
        let all: Vec<usize> = all.filter(|i| findings.of_site[*i] == number).collect();
        let step = all.len().div_ceil(N_OPENED).max(1);
        sites.subset(&all.into_iter().step_by(step).collect::<Vec<_>>())
    });
    let regions: Vec<Sites> = regions.collect();
    // Few sites at a time do not keep all threads busy.
    let shares = par::map(n_found * axes.len(), |pair| -> Result<f64> {
        let (region, (_, axis)) = (&regions[pair / axes.len()], &axes[pair % axes.len()]);
        let quick = SurfaceOptions { refinement: None, ..options.for_few(region.len()) };
        let mut is_reached = vec![false; region.len()];
        for tool in tools {
            let found = obstacles.surface_labels(region, &tool.cutter, axis, &quick)?;
            for (reached, answer) in is_reached.iter_mut().zip(found.answers) {
                *reached |= answer == SiteAnswer::Accessible;
            }
        }
        let n_reached = is_reached.iter().filter(|reached| **reached).count();
        Ok(n_reached as f64 / is_reached.len().max(1) as f64)
    });
    let mut shares = shares.into_iter();
    for finding in &mut findings.list[..n_found] {
        let mut opens = Vec::new();
        for ((name, _), share) in axes.iter().zip(&mut shares) {
            let share = share?;
            if share >= LEAST_SHARE {
                opens.push(Opening::new(name, share));
            }
        }
        // Stable: among equals, in the order of the axes.
        opens.sort_by(|a: &Opening, b| b.share.total_cmp(&a.share));
        opens.truncate(N_OPENINGS);
        finding.opens = opens;
    }
    Ok(())
}

/// Tools whose changes are looked for where no tool reaches.
const N_ADVISED: usize = 3;
/// Of tools that free this share of what the best one frees, the one that needs the least change is named.
const AS_MUCH: f64 = 0.9;

/// A tool whose changes are looked for, with its name where there are others.
pub(super) type Advised<'a> = (Option<&'a str>, &'a Assembly);

/// Of several tools, those that changes are looked for: the one that reaches most sites, the thinnest and the longest;
/// the first among equals, and none that is given by its profile.
pub(super) fn advised(tools: &[Tool], accessible: &[Vec<bool>]) -> Vec<usize> {
    let of_lengths = |k: &usize| tools[*k].assembly.profile().is_none();
    let greatest = |of: &dyn Fn(usize) -> f64| {
        let better = |a: usize, b: usize| if of(b) > of(a) { b } else { a };
        (0..tools.len()).filter(of_lengths).reduce(better)
    };
    let n_reached = |k: usize| accessible[k].iter().filter(|reached| **reached).count() as f64;
    let thin = |k: usize| -(tools[k].cutter.corner_mm() + tools[k].cutter.side_mm());
    let long = |k: usize| tools[k].assembly.stick_out_mm();
    let mut chosen: Vec<usize> = Vec::with_capacity(N_ADVISED);
    for k in [greatest(&n_reached), greatest(&thin), greatest(&long)].into_iter().flatten() {
        if !chosen.contains(&k) {
            chosen.push(k);
        }
    }
    chosen
}

/// Adds to the largest findings a change of one of the tools that helps most of the region, and changes of the part, if
/// `change_for` a tool and its sites finds any.
///
/// # Errors
/// Those of `change_for`.
pub(super) fn advise(
    findings: &mut Findings,
    tools: &[Advised],
    change_for: impl Fn(usize, &[u32]) -> Result<(RegionAdvice, Vec<PartChange>)> + Sync,
) -> Result<()> {
    let (of_site, n_tools) = (&findings.of_site, tools.len());
    let members_of = |number: u32| -> Vec<u32> {
        (0..of_site.len() as u32).filter(|&i| of_site[i as usize] == number).collect()
    };
    let members: Vec<Vec<u32>> =
        (1..).take(findings.list.len().min(N_SHOWN)).map(members_of).collect();
    // Few sites at a time do not keep all threads busy.
    let found = par::map(members.len() * n_tools, |pair| {
        change_for(pair % n_tools, &members[pair / n_tools])
    });
    let mut found = found.into_iter();
    for finding in findings.list.iter_mut().take(members.len()) {
        let (mut change, mut stopped): (Option<ToolChange>, _) = (None, None);
        let mut of_part = Vec::new();
        for ((name, tool), found) in tools.iter().zip(&mut found) {
            let named = |words: String| match name {
                Some(name) => format!("{name}: {words}"),
                None => words,
            };
            let (advice, of_tool) = found?;
            let found = advice.change.filter(|found| found.share >= LEAST_SHARE);
            let is_best = |share: f64| change.as_ref().is_none_or(|best| share > best.share);
            let is_found = found.is_some();
            if let Some(found) = found.filter(|found| is_best(found.share)) {
                change = Some(ToolChange::new(named(found.change.words(tool)), found.share));
            }
            let told = advice.stopped.filter(|s| s.by_overall_length || !is_found);
            stopped =
                stopped.or(told.map(|stopped| (stopped.by_overall_length, named(stopped.words()))));
            of_part.extend(of_tool.into_iter().map(|change| (*name, change)));
        }
        let of_area =
            |(name, of): &(Option<&str>, PartChange)| PartAdvice::new(of, finding.area_mm2, *name);
        finding.advice = least_changes(of_part).iter().map(of_area).collect();
        // What is too slender matters only where nothing else helps.
        let is_told =
            |(by_overall_length, _): &(bool, String)| *by_overall_length || change.is_none();
        finding.stopped = stopped.filter(is_told).map(|(_, words)| words);
        finding.change = change;
    }
    Ok(())
}

/// For each length of the part the changes for one tool: of those that free about as much as any, the one that needs
/// least; the change that frees most first.
fn least_changes(all: Vec<(Option<&str>, PartChange)>) -> Vec<(Option<&str>, PartChange)> {
    let by = |change: &PartChange| (change.to_mm - change.from_mm).abs();
    let chosen_for = |kind: PartLength| {
        let of_kind = || all.iter().filter(move |(_, change)| change.kind == kind);
        let most = of_kind().map(|(_, change)| change.share).fold(0.0, f64::max);
        let enough = of_kind().filter(|(_, change)| change.share >= AS_MUCH * most);
        let least = enough.reduce(|a, b| if by(&b.1) < by(&a.1) { b } else { a });
        least.map(|(name, _)| *name)
    };
    let is_chosen =
        |(name, change): &&(Option<&str>, PartChange)| chosen_for(change.kind) == Some(*name);
    let mut left: Vec<_> = all.iter().filter(is_chosen).copied().collect();
    left.sort_by(|a, b| b.1.share.total_cmp(&a.1.share));
    left
}
