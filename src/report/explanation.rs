//! Why a site can or cannot be reached, in words, as JSON and as a picture.

mod picture;
mod shape;

pub use picture::picture;

use crate::Result;
use crate::access::surface::PartChange;
use crate::access::surface::explain::{
    Change, ChangeKind, DirectionState, Explanation, Outcome, short,
};
use crate::answers::{Definition, SiteAnswer};
use crate::data::files::label_query::LabelQuery;
use crate::data::files::tools::steps_words;
use crate::findings::part_change_words;
use crate::tables::{Cell, Facts, Table};
use crate::tool::cutter::{Profile, ToolPart};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

/// What is said about one site.
#[derive(Debug, Clone, Copy)]
pub struct About<'a> {
    /// Labels and what they rest on.
    pub query: &'a LabelQuery,
    /// Row of the site.
    pub site: usize,
    /// The explanation of it.
    pub why: &'a Explanation,
}

/// What of the part would help at a site, in words and as JSON; empty for an accessible one.
///
/// # Errors
/// As [`LabelQuery::part_changes`].
#[doc(hidden)] // of the program
pub fn part_advice(about: &About) -> Result<(Vec<String>, Value)> {
    let changes = match about.why.answer {
        SiteAnswer::Accessible => Vec::new(),
        _ => about.query.part_changes(&[about.site as u32])?,
    };
    let line = |change| format!("Of the part would help: {}.", part_change_words(change));
    let json = |change: &PartChange| {
        json!({
            "kind": change.kind,
            "from": change.from_mm,
            "to": change.to_mm,
            "unit": "mm",
            "depth_mm": change.depth_mm,
            "words": part_change_words(change),
        })
    };
    Ok((changes.iter().map(line).collect(), changes.iter().map(json).collect()))
}

/// The answer in words.
pub fn answer_words(answer: SiteAnswer) -> &'static str {
    match answer {
        SiteAnswer::Accessible => "accessible",
        SiteAnswer::Inaccessible => "inaccessible",
        SiteAnswer::TipDoesNotFit => "tip does not fit",
    }
}

impl About<'_> {
    /// What the file of labels answers.
    pub fn in_file(&self) -> SiteAnswer {
        self.query.file.labels.answers.of(self.site)
    }

    fn place(&self) -> (Vec3, Vec3) {
        let sites = &self.query.file.sites;
        (sites.points[self.site], sites.normals[self.site])
    }

    /// Site, tool, query and answer.
    pub fn facts(&self) -> Facts {
        let About { query, site, why } = *self;
        let (point, normal) = self.place();
        let mut facts = Facts::new();
        facts.add("part", "part", Cell::text(&query.file.provenance.part));
        facts.add("definition", "definition", Cell::text(query.definition.to_string()));
        facts.add("cutter", "cutter", Cell::text(&query.file.provenance.tool));
        facts.add("site", "site", Cell::count(site));
        facts.add("at", "at x, y, z, mm", Cell::text(triple(point.as_dvec3(), 3)));
        facts.add("normal_words", "normal", Cell::text(triple(normal.as_dvec3(), 3)));
        facts.add("answer", "answer", Cell::text(answer_words(why.answer)));
        if self.in_file() != why.answer {
            let reason = match self.query.is_at_bottom(site) {
                true => "the bottom rule of the published definition",
                false => "another answer, by this version",
            };
            let words = format!("{}: {reason}", answer_words(self.in_file()));
            facts.add("in_file", "in labels.npz", Cell::text(words));
        }
        if let Some(part) = why.blocked_by() {
            facts.add("blocked_by", "blocked by", Cell::text(part.name()));
        } else if why.retreat_unproven() {
            facts.add("blocked_by", "blocked by", Cell::text("nothing; no way out is proven"));
        }
        if query.definition == Definition::Part {
            let rounded = (1e4 * why.tolerance_mm).round() / 1e4;
            facts.add("tolerance_mm", "gouge tolerance, mm", Cell::Given(rounded));
            let finish = query.options.finish_mm;
            facts.add("finish_mm", "finish tolerance, mm", Cell::Given(finish));
            let allowance = query.tool.assembly.allowance_mm();
            if allowance > 0.0 {
                facts.add("allowance_mm", "allowance, mm", Cell::Given(allowance));
            }
        }
        facts.add("n_directions", "directions", Cell::count(why.directions.len()));
        facts
    }

    /// A row per part that blocks, and one for the directions that nothing blocks.
    pub fn table(&self) -> Table {
        let states = &self.why.directions;
        let mut table = Table::new(&[
            ("part", "blocked by"),
            ("n_directions", "directions"),
            ("least_penetration_mm", "penetrates by, least"),
            ("x", "direction x"),
            ("y", "y"),
            ("z", "z"),
        ]);
        for part in ToolPart::ALL {
            let blocked = states.iter().filter_map(|s| s.blocked.map(|b| (b, s)));
            let of: Vec<_> = blocked.filter(|(b, _)| b.part == part).collect();
            let least = of.iter().copied().reduce(|best, next| {
                if next.0.penetration_mm < best.0.penetration_mm { next } else { best }
            });
            let Some((blocked, state)) = least else { continue };
            let mut row = vec![Cell::text(part.name()), Cell::count(of.len())];
            row.push(Cell::Millimeters(blocked.penetration_mm));
            row.extend(state.direction.as_dvec3().to_array().map(Cell::Number));
            table.row(row);
        }
        let reasons = states.iter().filter_map(DirectionState::reason);
        let mut reasons: Vec<&str> = reasons.collect();
        reasons.sort_unstable();
        let free = states.iter().filter(|state| state.is_free()).map(|_| "nothing");
        let others: Vec<&str> = reasons.into_iter().chain(free).collect();
        for of in others.chunk_by(|a, b| a == b) {
            let mut row = vec![Cell::text(of[0]), Cell::count(of.len())];
            row.resize(6, Cell::Missing);
            table.row(row);
        }
        table
    }

    /// Sentences for people: the witness, or the direction nearest to being free and what would help.
    pub fn sentences(&self) -> Vec<String> {
        let About { query, why, .. } = *self;
        let mut lines = Vec::new();
        if let Some(witness) = &why.witness {
            let margin = match witness.margin_mm.is_finite() {
                true => {
                    let least = if query.definition == Definition::Part { "" } else { "at least " };
                    format!("the tool could go {least}{} mm lower", short(witness.margin_mm))
                }
                false => "the tool meets nothing".into(),
            };
            let proof = match why.of_profile {
                true => "and leave",
                false => "by the reference engine",
            };
            lines.push(format!(
                "The tool has a free pose there from direction {}{}, {proof}: {margin}.",
                triple(witness.direction.as_dvec3(), 4),
                witness.tip_mm.map_or(String::new(), tip_words)
            ));
            return lines;
        }
        lines.extend(why.nearest().map(|state| self.nearest_words(state)));
        lines.extend(why.nearest_pose.filter(|nearest| nearest.shrink_mm > 0.0).map(|nearest| {
            format!(
                "The pose nearest to being free is from direction {}{}: the tool would have to be smaller by {} mm all around.",
                triple(nearest.pose.direction.as_dvec3(), 3),
                tip_words(nearest.pose.tip_mm),
                short(nearest.shrink_mm)
            )
        }));
        for change in &why.changes {
            let less = match (change.is_least, change.kind, why.tolerance_mm > 0.0) {
                (false, ..) => String::new(),
                (true, ChangeKind::Diameter, _) if self.is_drill() => {
                    "; sizes nearer to its own were labeled and do not do".into()
                }
                (true, ChangeKind::Diameter, _) => {
                    "; the next larger size was labeled and does not do".into()
                }
                (true, _, true) => {
                    let step = if why.of_profile { 0.01 } else { 2.0 * why.tolerance_mm };
                    format!("; less by {} mm does not do", short(step))
                }
                (true, _, false) => "; less does not do".into(),
            };
            lines.push(format!(
                "Would help: {}; labeled again: accessible from {}{less}.",
                change.words(&query.tool.assembly),
                triple(change.direction.as_dvec3(), 3)
            ));
        }
        if let Some(stopped) = &why.stopped {
            lines.push(format!("Would help, but is not proposed: {}.", stopped.words()));
        }
        if why.changes.is_empty() && query.remedies.only_this_tool {
            lines.push("No stick-out of this tool that it may have helps.".into());
        } else if why.changes.is_empty() {
            lines.push(
                "No change of one length of this tool helps (stick-out, holder, shank, diameter)."
                    .into(),
            );
        }
        if let Some(direction) = why.other_direction {
            lines.push(format!(
                "This tool has a free pose there from {}, which is none of the directions given: another setup.",
                triple(direction.as_dvec3(), 3)
            ));
        }
        lines
    }

    fn nearest_words(&self, state: &DirectionState) -> String {
        let Some(blocked) = state.blocked else { return self.unblocked_words(state) };
        let shrink = match blocked.part {
            _ if self.why.of_profile => String::new(),
            ToolPart::Tip => String::new(),
            _ => format!("; all steps would have to shrink by {} mm", short(-state.clearance_mm)),
        };
        format!(
            "Nearest to being free is direction {}: the {} penetrates by {} mm at {} ({}){shrink}.",
            triple(state.direction.as_dvec3(), 3),
            blocked.part,
            short(blocked.penetration_mm),
            triple(blocked.at_mm, 3),
            self.face_words(blocked.face)
        )
    }

    /// Of a direction in which nothing penetrates and which does not count all the same.
    fn unblocked_words(&self, state: &DirectionState) -> String {
        let tip = self.why.nearest_pose.map_or(String::new(), |near| tip_words(near.pose.tip_mm));
        let from = triple(state.direction.as_dvec3(), 3);
        match state.outcome {
            Outcome::NoRetreat => format!(
                "A pose from direction {from}{tip} is free, but no way out of it is proven: along the axis, or by one \
                 move across it and then along the axis."
            ),
            Outcome::NotAtOwnBore => {
                "This place is not in a bore of about the drill's own diameter.".into()
            }
            Outcome::DoesNotTouch => {
                "Nothing of what cuts has the normal of this site in any direction tested.".into()
            }
            Outcome::Free | Outcome::Blocked => String::new(),
        }
    }

    fn is_drill(&self) -> bool {
        self.query.tool.assembly.profile().is_some_and(Profile::is_drill)
    }

    fn face_words(&self, face: u32) -> String {
        let n = self.query.n_triangles() as u32;
        match self.query.definition {
            Definition::Sites if self.query.centroids_block => {
                format!("the centroid of triangle {face}")
            }
            Definition::Sites | Definition::SitesInSpace => {
                match (face as usize) < self.query.file.sites.len() {
                    true => format!("site {face}"),
                    false => "a further point of the surface".into(),
                }
            }
            Definition::Part | Definition::PartInSpace if face < n => {
                let normal = self.query.mesh.as_ref().map(|mesh| mesh.area_vector(face as usize));
                let normal = normal.unwrap_or_default().normalize_or_zero();
                format!("triangle {face} of the part, normal {}", triple(normal, 2))
            }
            Definition::Part | Definition::PartInSpace => {
                format!("triangle {} of the fixtures", face - n)
            }
        }
    }

    /// Everything, with every direction.
    pub fn json(&self) -> Value {
        let About { query, why, .. } = *self;
        let (point, normal) = self.place();
        let mut value = self.facts().json();
        let more = json!({
            "at_mm": point.to_array(),
            "normal": normal.to_array(),
            "answer": why.answer,
            "in_file": self.in_file(),
            "at_bottom": query.is_at_bottom(self.site),
            "tolerance_mm": why.tolerance_mm,
            "blocked_by": why.blocked_by(),
            "retreat_unproven": why.retreat_unproven(),
            "counts": ToolPart::ALL.iter().zip(why.counts())
                .map(|(part, n)| (part.name().to_string(), json!(n)))
                .collect::<serde_json::Map<String, Value>>(),
            "witness": why.witness.map(|witness| json!({
                "direction": witness.direction.to_array(),
                "tip_mm": witness.tip_mm.map(|tip| tip.to_array()),
                "margin_mm": witness.margin_mm,
            })),
            "nearest": why.nearest().map(|state| self.state_json(state)),
            "nearest_pose": why.nearest_pose.map(|nearest| json!({
                "direction": nearest.pose.direction.to_array(),
                "tip_mm": nearest.pose.tip_mm.to_array(),
                "shrink_mm": nearest.shrink_mm,
            })),
            "changes": why.changes.iter().map(|c| change_json(c, query)).collect::<Vec<_>>(),
            "stopped": why.stopped.map(|stopped| json!({
                "words": stopped.words(),
                "stick_out_mm": stopped.stick_out_mm,
                "most_mm": stopped.most_mm,
                "by_overall_length": stopped.by_overall_length,
            })),
            "other_direction": why.other_direction.map(|d| d.to_array()),
            "directions": why.directions.iter().map(|s| self.state_json(s)).collect::<Vec<_>>(),
        });
        if let (Value::Object(all), Value::Object(more)) = (&mut value, more) {
            for key in ["at", "normal_words"] {
                all.remove(key);
            }
            all.extend(more);
        }
        value
    }

    fn state_json(&self, state: &DirectionState) -> Value {
        json!({
            "direction": state.direction.to_array(),
            "clearance_mm": state.clearance_mm,
            "state": outcome_name(state.outcome),
            "blocked_by": state.blocked.map(|blocked| blocked.part),
            "penetration_mm": state.blocked.map(|blocked| blocked.penetration_mm),
            "at_mm": state.blocked.map(|blocked| blocked.at_mm.to_array()),
            "face": state.blocked.map(|blocked| blocked.face),
            "what": state.blocked.map(|blocked| self.face_words(blocked.face)),
        })
    }
}

fn change_json(change: &Change, query: &LabelQuery) -> Value {
    let tool = &change.tool;
    let (kind, part) = match change.kind {
        ChangeKind::Raise(part) => ("longer", Some(part)),
        ChangeKind::Narrow(part) => ("thinner", Some(part)),
        ChangeKind::Diameter => ("diameter", None),
    };
    json!({
        "words": change.words(&query.tool.assembly),
        "kind": kind,
        "part": part,
        "by_mm": change.by_mm,
        "stick_out_longer_mm": change.longer_mm,
        "is_least": change.is_least,
        "direction": change.direction.to_array(),
        "tool": {
            "corner_mm": tool.tip()[0],
            "side_mm": tool.tip()[1],
            "body": steps_words(&tool.own_body()),
            "holder": steps_words(tool.holder()),
            "stick_out_mm": tool.stick_out_mm(),
            "profile": tool.profile().map(ToString::to_string),
        },
    })
}

fn tip_words(tip: DVec3) -> String {
    format!(", with its tip at {}", triple(tip, 3))
}

fn triple(p: DVec3, decimals: usize) -> String {
    let [x, y, z] = p.to_array().map(|x| {
        let words = format!("{x:.decimals$}");
        // Never minus zero.
        if words.trim_start_matches(['-', '0', '.']).is_empty() { "0".into() } else { words }
    });
    format!("{x}, {y}, {z}")
}

/// As JSON has it.
fn outcome_name(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Free => "free",
        Outcome::NoRetreat => "no-retreat",
        Outcome::NotAtOwnBore => "not-at-own-bore",
        Outcome::Blocked => "blocked",
        Outcome::DoesNotTouch => "does-not-touch",
    }
}
