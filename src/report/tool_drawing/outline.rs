//! The right half of a tool's outline, from the tip upward.

use crate::data::files::tools::Tool;
use crate::tool::cutter::{Assembly, Step};

/// What a part of the tool is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Cutting,
    Neck,
    Shank,
}

/// Of an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bow {
    pub center: [f64; 2],
    pub radius: f64,
    /// Whether it bulges outward.
    pub is_convex: bool,
}

/// A line or an arc from the end of the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    /// Radius and height, mm.
    pub to: [f64; 2],
    pub arc: Option<Bow>,
    pub kind: Kind,
}

/// Lengths in mm.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outline {
    /// Radius of a flat lower end.
    pub start: f64,
    pub sections: Vec<Section>,
    /// Greatest radius of what cuts, and the height there.
    pub widest_cut: [f64; 2],
    /// Where what cuts ends, if that is stated.
    pub flutes: Option<f64>,
    /// From where on there is nothing but a cylinder, and its radius.
    pub plain_from: f64,
    pub shank: f64,
    /// Height of the holder's nose.
    pub nose: f64,
    /// Heights above the nose.
    pub holder: Vec<Step>,
}

/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

impl Outline {
    pub fn of(tool: &Tool) -> Self {
        let assembly = &tool.assembly;
        let (start, mut sections) = match assembly.profile() {
            Some(_) => of_profile(assembly),
            None => of_steps(assembly),
        };
        let nose = assembly.stick_out_mm();
        let flutes = match assembly.profile() {
            Some(profile) => Some(profile.flutes_mm()),
            None => Some(assembly.flutes_mm()).filter(|flutes| flutes.is_finite()),
        };
        let last = sections.last().map_or([start, 0.0], |section| section.to);
        let kind = if flutes.is_some() { Kind::Shank } else { Kind::Cutting };
        if last[1] < nose {
            sections.push(Section { to: [last[0], nose], arc: None, kind });
        }
        let mut outline = Outline {
            start,
            sections,
            widest_cut: [start, 0.0],
            flutes,
            plain_from: 0.0,
            shank: last[0],
            nose,
            holder: assembly.holder().to_vec(),
        };
        outline.widest_cut = outline.find_widest_cut();
        outline.plain_from = outline.name_shank();
        outline
    }

    /// From where on there is nothing but the last cylinder, which does not cut: it is the shank.
    fn name_shank(&mut self) -> f64 {
        let mut from = self.nose;
        for k in (0..self.sections.len()).rev() {
            let section = self.sections[k];
            let below = if k == 0 { [self.start, 0.0] } else { self.sections[k - 1].to };
            let is_plain = section.arc.is_none() && (section.to[0] - below[0]).abs() < SAME_MM;
            if !is_plain {
                break;
            }
            from = below[1].max(self.flutes.unwrap_or(0.0)).min(from);
            if section.kind == Kind::Cutting {
                break;
            }
            self.sections[k].kind = Kind::Shank;
        }
        from
    }

    /// Pairs of where a section begins and the section.
    fn pairs(&self) -> impl Iterator<Item = ([f64; 2], &Section)> {
        let begins = std::iter::once([self.start, 0.0]);
        let begins = begins.chain(self.sections.iter().map(|section| section.to));
        begins.zip(&self.sections)
    }

    fn find_widest_cut(&self) -> [f64; 2] {
        let mut widest = [self.start, 0.0];
        for (from, section) in self.pairs().filter(|(_, section)| section.kind == Kind::Cutting) {
            let mut points = vec![from, section.to];
            if let Some(Bow { center: [c, z], radius, is_convex: true }) = section.arc
                && (from[1]..=section.to[1]).contains(&z)
            {
                points.push([c + radius, z]);
            }
            for point in points {
                if point[0] > widest[0] + SAME_MM {
                    widest = point;
                }
            }
        }
        widest
    }

    /// Greatest radius below the holder.
    pub fn widest(&self) -> f64 {
        self.widest_below(f64::INFINITY)
    }

    /// Greatest radius below a height.
    pub fn widest_below(&self, height: f64) -> f64 {
        let below = self.pairs().filter(|(from, _)| from[1] < height - SAME_MM);
        let widest = below.map(|(from, section)| from[0].max(section.to[0]));
        let cut = if self.widest_cut[1] < height { self.widest_cut[0] } else { self.start };
        widest.fold(cut, f64::max)
    }

    /// Whether an arc is tangent to the flat lower end.
    pub fn begins_with_corner(&self) -> bool {
        let corner = self.sections.first().and_then(|section| section.arc);
        corner.is_some_and(|bow| bow.is_convex && (bow.center[0] - self.start).abs() < SAME_MM)
    }

    pub fn holder_height(&self) -> f64 {
        self.holder.last().map_or(0.0, |step| step.height_mm)
    }

    /// Where the shank begins, if that is above what cuts.
    pub fn neck_end(&self) -> Option<f64> {
        let has_neck = self.sections.iter().any(|section| section.kind == Kind::Neck);
        (has_neck && self.plain_from < self.nose).then_some(self.plain_from)
    }

    /// Radius at a height, roughly: of the section that ends there or above.
    pub fn radius_at(&self, height: f64) -> f64 {
        let above = self.sections.iter().find(|section| section.to[1] >= height - SAME_MM);
        above.map_or(self.shank, |section| section.to[0])
    }

    /// Radius and a height of the shank and of the longest cylinder of the neck.
    pub fn cylinders(&self) -> Vec<(f64, f64)> {
        let mut found = Vec::new();
        for kind in [Kind::Neck, Kind::Shank] {
            let of_kind = self.pairs().filter(|(from, section)| {
                section.kind == kind
                    && section.arc.is_none()
                    && (section.to[0] - from[0]).abs() < SAME_MM
                    && section.to[1] > from[1] + SAME_MM
            });
            let longest =
                of_kind.max_by(|(a, x), (b, y)| (x.to[1] - a[1]).total_cmp(&(y.to[1] - b[1])));
            found.extend(longest.map(|(from, section)| {
                // The shank may be broken in its middle.
                let share = if kind == Kind::Shank { 0.12 } else { 0.5 };
                (section.to[0], from[1] + share * (section.to[1] - from[1]))
            }));
        }
        found.dedup_by(|a, b| (a.0 - b.0).abs() < SAME_MM);
        found
    }

    /// A point on each arc that cuts, and its radius; each radius once.
    pub fn arcs(&self) -> Vec<([f64; 2], f64)> {
        let mut found: Vec<([f64; 2], f64)> = Vec::new();
        for (from, section) in self.pairs().filter(|(_, section)| section.kind == Kind::Cutting) {
            let Some(Bow { center: [c, z], radius, is_convex }) = section.arc else { continue };
            if found.iter().any(|(_, other)| (other - radius).abs() < SAME_MM * radius.max(1.0)) {
                continue;
            }
            let height = 0.5 * (from[1] + section.to[1]);
            let half = (radius * radius - (height - z) * (height - z)).max(0.0).sqrt();
            found.push(([if is_convex { c + half } else { c - half }, height], radius));
        }
        found.truncate(MOST);
        found
    }

    /// A point on each slope that cuts, and its angle to the axis in degrees; each angle once.
    pub fn slopes(&self) -> Vec<([f64; 2], f64)> {
        let mut found: Vec<([f64; 2], f64)> = Vec::new();
        for (from, section) in self.pairs().filter(|(_, section)| section.kind == Kind::Cutting) {
            let [dr, dz] = [section.to[0] - from[0], section.to[1] - from[1]];
            if section.arc.is_some() || dz < SAME_MM || dr.abs() < SAME_MM {
                continue;
            }
            let degrees = libm::atan2(dr.abs(), dz).to_degrees();
            if found.iter().any(|(_, other)| (other - degrees).abs() < 0.01) {
                continue;
            }
            found.push(([from[0] + 0.5 * dr, from[1] + 0.5 * dz], degrees));
        }
        // Those of polygons are none of a maker.
        if found.len() > MOST { Vec::new() } else { found }
    }
}

/// More labels of a kind say no more.
const MOST: usize = 3;

fn of_profile(assembly: &Assembly) -> (f64, Vec<Section>) {
    let pieces = assembly.profile().map(|profile| profile.pieces()).unwrap_or_default();
    let mut start = 0.0;
    let mut sections = Vec::new();
    for (k, piece) in pieces.iter().enumerate() {
        let [from, to] = piece.ends;
        if k == 0 && from == [0.0, 0.0] && to[1] == 0.0 && piece.arc.is_none() {
            start = to[0];
            continue;
        }
        let kind = if piece.cuts { Kind::Cutting } else { Kind::Neck };
        let arc = piece.arc.map(|arc| Bow {
            center: arc.center,
            radius: arc.radius,
            is_convex: arc.is_convex,
        });
        sections.push(Section { to, arc, kind });
    }
    (start, sections)
}

fn of_steps(assembly: &Assembly) -> (f64, Vec<Section>) {
    let [corner, side] = assembly.tip();
    let (radius, nose) = (corner + side, assembly.stick_out_mm());
    let flutes = assembly.flutes_mm();
    let end = flutes.min(nose);
    let cutting: Vec<Step> =
        assembly.own_body().into_iter().filter(|step| step.height_mm < flutes).collect();
    let widest = cutting.last().map_or(radius, |step| step.radius_mm);
    let mut sections = Vec::new();
    let mut cut = |to: [f64; 2], arc| {
        sections.push(Section { to, arc, kind: Kind::Cutting });
    };
    let bulge = Some(Bow { center: [side, corner], radius: corner, is_convex: true });
    if widest > radius + SAME_MM {
        // The cone is tangent to the corner and ends as wide as the last step.
        let [dr, dz] = [widest - side, end - corner];
        let along = libm::atan2(dz, dr) + libm::asin((corner / libm::hypot(dr, dz)).min(1.0));
        if corner > 0.0 {
            let touch = [side + corner * libm::sin(along), corner * (1.0 - libm::cos(along))];
            cut(touch, bulge);
        }
        cut([widest, end], None);
    } else {
        if corner > 0.0 {
            cut([radius, corner], bulge);
        }
        if end > corner {
            cut([radius, end], None);
        }
    }
    let upper = assembly.neck_and_shank();
    for (k, step) in upper.iter().enumerate() {
        let until = upper.get(k + 1).map_or(nose, |next| next.height_mm).min(nose);
        let from = step.height_mm.max(end);
        if until > from {
            sections.push(Section { to: [step.radius_mm, from], arc: None, kind: Kind::Neck });
            sections.push(Section { to: [step.radius_mm, until], arc: None, kind: Kind::Neck });
        }
    }
    (side, sections)
}
