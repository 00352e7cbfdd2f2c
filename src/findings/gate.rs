//! Limits that a result must keep: `inaccessible>5%`, `tip_does_not_fit>20mm2`, `finding>50mm2`, `finding>2mm3`,
//! `rest>0.5mm`.
//!
//! ```text
//! LIMIT    = QUANTITY ('>' | '<') NUMBER UNIT
//! QUANTITY = one of the names of QUANTITIES; or 'finding': the largest region that is out of reach; or
//!            'no-tool-reaches': what is out of reach of every tool together; or
//!            'rest': the most that all tools together leave. _ may replace -
//! UNIT     = '%', a share of the surface | 'mm2' or 'mm²', an area | of 'rest': 'mm' |
//!            of 'finding' also 'mm3' or 'mm³': the most that is left about one; 'in2' and so on for other units
//! ```

use super::{Finding, FindingStatus, Findings};
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::geom::units::length::unit_mm;
use crate::geom::{Mesh, Sites, spacing};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// What a limit can be about.
struct Quantity {
    name: &'static str,
    /// Whether the answers say it.
    is_answered: fn(&SiteAnswers) -> bool,
    /// Whether a site counts.
    counts: fn(&SiteAnswers, usize) -> bool,
}

/// All quantities; a further one is an entry here.
const QUANTITIES: [Quantity; 4] = [
    Quantity { name: "inaccessible", is_answered: |_| true, counts: SiteAnswers::is_inaccessible },
    Quantity {
        name: "tip_does_not_fit",
        is_answered: SiteAnswers::tests_tip,
        counts: |answers, i| answers.of(i) == SiteAnswer::TipDoesNotFit,
    },
    Quantity {
        name: "occlusion",
        is_answered: |answers| !answers.occlusion.is_empty(),
        counts: |answers, i| answers.occlusion[i],
    },
    UNREACHABLE,
];

/// Either of both.
const UNREACHABLE: Quantity = Quantity {
    name: "unreachable",
    is_answered: |_| true,
    counts: |answers, i| answers.of(i) != SiteAnswer::Accessible,
};

/// The names of limits on what no list of sites of one tool says.
const OTHERS: [&str; 3] = ["finding", "no-tool-reaches", "rest"];
/// The largest region that is out of reach.
const FINDING: usize = QUANTITIES.len();
/// What no tool reaches.
const NO_TOOL: usize = QUANTITIES.len() + 1;

/// The most that all tools leave.
const REST: usize = QUANTITIES.len() + 2;

/// A limit on the area of some quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
#[doc(hidden)] // of the program
pub struct Limit {
    /// Place in [`QUANTITIES`]; beyond them in [`OTHERS`].
    quantity: usize,
    is_most: bool,
    bound: Bound,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Bound {
    /// Of the surface, from 0 to 1.
    Share(f64),
    /// mm².
    Area(f64),
    /// mm.
    Length(f64),
    /// mm³.
    Volume(f64),
}

impl FromStr for Limit {
    type Err = Error;

    /// # Errors
    /// If the text is no limit, or names an unknown quantity.
    fn from_str(text: &str) -> Result<Self> {
        let refuse = |expected: String| {
            let remedy =
                "write for example 'inaccessible>5%' or 'tip_does_not_fit>20mm2', in quotes";
            Error::argument("limit", format!("`{text}`"), expected, remedy)
        };
        let form = || refuse("QUANTITY>NUMBER% or QUANTITY>NUMBERmm2, or < in place of >".into());
        let at = text.find(['>', '<']).ok_or_else(form)?;
        let (name, rest) = (text[..at].trim(), text[at + 1..].trim());
        let mut names: Vec<&str> = QUANTITIES.iter().map(|quantity| quantity.name).collect();
        names.extend(OTHERS);
        let same = |known: &str| known.replace('-', "_") == name.replace('-', "_");
        let quantity = names.iter().position(|known| same(known));
        let quantity =
            quantity.ok_or_else(|| refuse(format!("a quantity of {}", names.join(", "))))?;
        if quantity == REST {
            let length = || refuse("rest>NUMBERmm, of 0 mm or more".into());
            let value = measure(rest, 1).ok_or_else(length)?;
            if !(0.0..f64::INFINITY).contains(&value) {
                return Err(length());
            }
            let is_most = text[at..].starts_with('>');
            return Ok(Limit { quantity, is_most, bound: Bound::Length(value) });
        }
        let share = rest.strip_suffix('%').and_then(|number| number.trim_end().parse().ok());
        let area = measure(rest, 2);
        let volume = measure(rest, 3).filter(|_| quantity == FINDING);
        let value: f64 = share.or(area).or(volume).ok_or_else(form)?;
        let most = if share.is_some() { 100.0 } else { f64::MAX };
        if !(0.0..=most).contains(&value) {
            return Err(refuse("0 to 100 %, or an area or volume of 0 or more".into()));
        }
        let bound = match (share, area) {
            (Some(_), _) => Bound::Share(value / 100.0),
            (None, Some(_)) => Bound::Area(value),
            (None, None) => Bound::Volume(value),
        };
        Ok(Limit { quantity, is_most: text[at..].starts_with('>'), bound })
    }
}

/// A length, area or volume with its unit, such as `20mm2` or `0.5 in²`, in mm to that power.
fn measure(text: &str, power: i32) -> Option<f64> {
    let text = match power {
        1 => text,
        2 => text.strip_suffix(['2', '²'])?,
        _ => text.strip_suffix(['3', '³'])?,
    };
    let at = text.find(|c: char| c.is_alphabetic() && !matches!(c, 'e' | 'E'))?;
    let (number, unit) = (text[..at].trim_end(), unit_mm(&text[at..])?);
    number.parse::<f64>().ok().map(|value| value * unit.powi(power))
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.is_most { '>' } else { '<' };
        write!(f, "{}{sign}", self.quantity())?;
        match self.bound {
            Bound::Share(share) => write!(f, "{}%", (1e11 * share).round() / 1e9),
            Bound::Area(area) => write!(f, "{area}mm2"),
            Bound::Length(length) => write!(f, "{length}mm"),
            Bound::Volume(volume) => write!(f, "{volume}mm3"),
        }
    }
}

/// The area that each site stands for: relative ones, scaled to the area of the mesh; on an open
/// mesh, such as a region, all alike.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteAreas {
    /// Per site, as shares of the sum.
    shares: Vec<f64>,
    /// mm²; none for a cloud.
    total_mm2: Option<f64>,
}

impl SiteAreas {
    /// The areas of `sites`, which lie on `mesh` if there is one.
    ///
    /// # Errors
    /// If the sites fail [`Sites::check`].
    pub fn of(sites: &Sites, mesh: Option<&Mesh>) -> Result<Self> {
        let mut shares = spacing::relative_areas(sites)?;
        if spacing::are_even_on(mesh) {
            shares.fill(1.0);
        }
        let sum: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= if sum > 0.0 { sum } else { 1.0 });
        Ok(SiteAreas { shares, total_mm2: mesh.map(Mesh::area) })
    }

    /// What a share of an answer is of: by the mesh definition of the surface, as [`SiteAreas::of`]; by the published
    /// definition, which is
    /// about sites, of the sites.
    ///
    /// # Errors
    /// As [`SiteAreas::of`].
    pub fn by_definition(sites: &Sites, mesh: Option<&Mesh>, of_mesh: bool) -> Result<Self> {
        match of_mesh {
            true => SiteAreas::of(sites, mesh),
            false => Ok(SiteAreas::even(sites.len())),
        }
    }

    /// `n` sites that count alike.
    pub fn even(n: usize) -> Self {
        SiteAreas { shares: vec![1.0 / n.max(1) as f64; n], total_mm2: None }
    }

    /// Whether all sites count alike.
    pub fn are_even(&self) -> bool {
        self.shares.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// Per site, its share of the surface.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// Area of the surface, mm²; none for a cloud.
    pub fn total_mm2(&self) -> Option<f64> {
        self.total_mm2
    }

    /// Share of the surface of the sites that count.
    pub fn share(&self, counts: impl Fn(usize) -> bool) -> f64 {
        let counted = self.shares.iter().enumerate().filter(|(i, _)| counts(*i));
        // The sum of all is 1 but for roundings.
        counted.fold(0.0, |sum, (_, share)| sum + share).min(1.0)
    }
}

const NO_REGION: &str = "no region is out of reach";

/// A finding in a sentence.
fn place(found: &Finding) -> String {
    let [x, y, z] = found.at_mm.to_array().map(|x| (1e3 * x).round() / 1e3 + 0.0);
    format!("{} at {x}, {y}, {z}", found.words())
}

impl Limit {
    /// The name of what it limits.
    pub fn quantity(&self) -> &'static str {
        let other = || OTHERS[self.quantity - QUANTITIES.len()];
        QUANTITIES.get(self.quantity).map_or_else(other, |quantity| quantity.name)
    }

    /// Whether it is about the largest region that is out of reach ([`Limit::broken_by_findings`]).
    pub fn is_about_findings(&self) -> bool {
        self.quantity == FINDING
    }

    /// Whether it is about all tools together: to be held against the answers
    /// [`for_all_tools`](super::for_all_tools).
    pub fn is_about_all_tools(&self) -> bool {
        matches!(self.quantity, NO_TOOL | REST)
    }

    /// Whether it is about how much is left.
    pub fn is_about_rest(&self) -> bool {
        self.quantity == REST || matches!(self.bound, Bound::Volume(_))
    }

    /// Why the largest region breaks the limit, or the one about which most is left; `None` if it keeps it, or the
    /// limit is not about regions. Of findings that were held against a baseline, only those that are listed and not
    /// known count.
    pub fn broken_by_findings(&self, findings: &Findings) -> Option<String> {
        let counted = findings.list.iter().filter(|f| f.status != Some(FindingStatus::Known));
        if let Bound::Volume(bound) = self.bound {
            let most = counted.reduce(|most, f| if f.left_mm3 > most.left_mm3 { f } else { most });
            let most = if findings.are_held { most } else { findings.most_left.as_ref() };
            return self.broken_by_left(most, bound);
        }
        let (largest, n) = match findings.are_held {
            true => (counted.clone().next(), counted.count()),
            false => {
                let n = findings.list.len() + findings.scattered.n_regions;
                (findings.largest.as_ref(), n)
            }
        };
        let area = largest.map_or(0.0, |finding| finding.area_mm2);
        let share = if area > 0.0 { area / findings.surface_mm2 } else { 0.0 };
        let (value, bound) = match self.bound {
            Bound::Share(bound) => (share, bound),
            Bound::Area(bound) | Bound::Length(bound) | Bound::Volume(bound) => (area, bound),
        };
        let is_broken = if self.is_most { value > bound } else { value < bound };
        if !self.is_about_findings() || !is_broken {
            return None;
        }
        let of = if findings.are_held { "findings that are not known" } else { "findings" };
        let none = if findings.are_held { "no finding that is not known" } else { "no region" };
        let which = largest.map_or(format!("{none} is out of reach"), |found| {
            format!("the largest of {n} {of}, {}, is", place(found))
        });
        Some(format!("{which} {area:.1} mm2 ({:.2} %): {self}", 100.0 * share))
    }

    fn broken_by_left(&self, most: Option<&Finding>, bound: f64) -> Option<String> {
        let left = most.and_then(|finding| finding.left_mm3).unwrap_or(0.0);
        let is_broken = if self.is_most { left > bound } else { left < bound };
        let which = || match most {
            Some(found) => format!("about {} is most left,", place(found)),
            None => format!("{NO_REGION},"),
        };
        is_broken.then(|| format!("{} {left:.2} mm3: {self}", which()))
    }

    /// The error of a limit on what is not answered.
    pub fn not_answered(&self) -> Error {
        let expected = "a quantity that this command answers";
        let remedy = "inaccessible and unreachable are always answered";
        Error::argument("limit", format!("`{self}`"), expected, remedy)
    }

    /// Why the answers break the limit; `None` if they keep it.
    ///
    /// # Errors
    /// If the answers do not say the quantity, the limit is about findings, or the limit is an area and the sites lie
    /// on no mesh. One about all tools takes the answers for all of them.
    pub fn broken_by(&self, answers: &SiteAnswers, areas: &SiteAreas) -> Result<Option<String>> {
        if let (REST, Bound::Length(bound)) = (self.quantity, self.bound) {
            let most = answers.rest_mm.iter().copied().reduce(f32::max);
            let most = f64::from(most.ok_or_else(|| self.not_answered())?);
            let is_broken = if self.is_most { most > bound } else { most < bound };
            return Ok(is_broken.then(|| format!("the greatest rest is {most:.3} mm: {self}")));
        }
        let is_unreached = Quantity { name: OTHERS[1], ..UNREACHABLE };
        let quantity = match self.is_about_all_tools() {
            true => Some(&is_unreached),
            false => QUANTITIES.get(self.quantity),
        };
        let quantity = quantity.filter(|quantity| (quantity.is_answered)(answers));
        let Some(Quantity { name, counts, .. }) = quantity else {
            return Err(self.not_answered());
        };
        let share = areas.share(|i| counts(answers, i));
        let (is_more, is_less) = match self.bound {
            Bound::Share(bound) => (share > bound, share < bound),
            Bound::Area(bound) => {
                let area = share * self.total(areas)?;
                (area > bound, area < bound)
            }
            Bound::Length(_) | Bound::Volume(_) => return Err(self.not_answered()),
        };
        if !(if self.is_most { is_more } else { is_less }) {
            return Ok(None);
        }
        let area =
            areas.total_mm2.map_or(String::new(), |total| format!(" ({:.1} mm2)", share * total));
        Ok(Some(format!("{name} is {:.2} %{area}: {self}", 100.0 * share)))
    }

    fn total(&self, areas: &SiteAreas) -> Result<f64> {
        areas.total_mm2.ok_or_else(|| {
            let remedy = "a cloud has no area in mm2: limit a share in %";
            Error::argument("limit", format!("`{self}`"), "a limit in %", remedy)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn lattice() -> Sites {
        let points = (0..100).map(|i| Vec3::new((i % 10) as f32, (i / 10) as f32, 0.0)).collect();
        Sites::new(points, vec![Vec3::Z; 100]).unwrap()
    }

    #[test]
    fn areas_of_sites_are_shares_of_the_surface() {
        let areas = SiteAreas::of(&lattice(), None).unwrap();
        assert!((areas.share(|_| true) - 1.0).abs() < 1e-12 && areas.total_mm2().is_none());
        assert!((areas.share(|i| i < 50) - 0.5).abs() < 0.01);
    }

    #[test]
    fn limits_say_why_they_are_broken() {
        let areas = SiteAreas { shares: vec![0.01; 100], total_mm2: Some(400.0) };
        let answers = SiteAnswers::new((0..100).map(|i| i < 10).collect(), vec![]);
        let broken =
            |text: &str| text.parse::<Limit>().unwrap().broken_by(&answers, &areas).unwrap();
        for kept in ["inaccessible>11%", "inaccessible>45mm2", "unreachable<9%"] {
            assert_eq!(broken(kept), None, "{kept}");
        }
        let why = broken("inaccessible>5%").unwrap();
        assert_eq!(why, "inaccessible is 10.00 % (40.0 mm2): inaccessible>5%");
        assert!(broken(" inaccessible < 50 mm² ").unwrap().ends_with("inaccessible<50mm2"));
        let unknown = "occlusion>5%".parse::<Limit>().unwrap().broken_by(&answers, &areas);
        assert!(unknown.unwrap_err().to_string().contains("this command answers"));
        let cloud = SiteAreas { total_mm2: None, ..areas.clone() };
        let error = "inaccessible>5mm2".parse::<Limit>().unwrap().broken_by(&answers, &cloud);
        assert!(error.unwrap_err().to_string().contains("cloud"));
    }

    #[test]
    fn the_greatest_rest_of_all_tools_is_limited_in_mm() {
        let areas = SiteAreas { shares: vec![0.5; 2], total_mm2: Some(400.0) };
        let mut answers = SiteAnswers::new(vec![true, false], vec![]);
        let limit: Limit = "rest > 0.5 mm".parse().unwrap();
        assert!(limit.is_about_rest() && limit.is_about_all_tools());
        assert_eq!(limit.to_string(), "rest>0.5mm");
        let error = limit.broken_by(&answers, &areas).unwrap_err().to_string();
        assert!(error.contains("this command answers"), "{error}");
        answers.rest_mm = vec![0.75, 0.0];
        let why = limit.broken_by(&answers, &areas).unwrap().unwrap();
        assert_eq!(why, "the greatest rest is 0.750 mm: rest>0.5mm");
        let kept: Limit = "rest>0.0315in".parse().unwrap();
        assert_eq!(kept.broken_by(&answers, &areas).unwrap(), None);
        for bad in ["rest>5%", "rest>5mm2", "rest>-1mm", "rest>xmm", "rest>infmm", "rest>1ell"] {
            let error = bad.parse::<Limit>().unwrap_err().to_string();
            assert!(error.contains("rest>NUMBERmm"), "{error}");
        }
        assert!("inaccessible>5mm".parse::<Limit>().is_err());
    }

    #[test]
    fn the_most_that_is_left_about_a_region_is_limited_in_cubic_millimeters() {
        let sites = lattice();
        let mut answers = SiteAnswers::new((0..100).map(|i| i % 10 < 2).collect(), vec![]);
        answers.of_sites[99] = SiteAnswer::Inaccessible;
        answers.rest_volume_mm3 = (0..100).map(|i| if i == 99 { 3.0 } else { 0.1 }).collect();
        let findings = Findings::of(&sites, None, &answers, &[]).unwrap();
        assert!((findings.list[0].left_mm3.unwrap() - 2.0).abs() < 1e-6);
        let broken = |text: &str| {
            let limit: Limit = text.parse().unwrap();
            assert!(limit.is_about_findings() && limit.is_about_rest(), "{text}");
            limit.broken_by_findings(&findings)
        };
        // A single site with much beside it counts, although its area is small.
        let why = broken("finding > 2.5 mm3").unwrap();
        assert!(why.contains("inaccessible at 9, 9, 0 is most left, 3.00 mm3"), "{why}");
        assert_eq!(broken("finding>3mm³"), None);
        assert!(broken("finding<4mm3").is_some());
        for bad in ["inaccessible>2mm3", "finding>-1mm3", "finding>nanmm3", "finding>mm3"] {
            assert!(bad.parse::<Limit>().is_err(), "{bad}");
        }
    }

    #[test]
    fn what_no_tool_reaches_is_a_share_like_the_others() {
        let areas = SiteAreas { shares: vec![0.01; 100], total_mm2: Some(400.0) };
        let answer = |i| match i {
            0..10 => SiteAnswer::Inaccessible,
            10..30 => SiteAnswer::TipDoesNotFit,
            _ => SiteAnswer::Accessible,
        };
        let all = SiteAnswers::by_mesh((0..100).map(answer).collect());
        for text in ["no-tool-reaches>20%", "no_tool_reaches > 100mm2", "no-tool-reaches>0.18in2"] {
            let limit: Limit = text.parse().unwrap();
            assert!(limit.is_about_all_tools() && !limit.is_about_findings());
            let why = limit.broken_by(&all, &areas).unwrap().unwrap();
            assert!(why.starts_with("no-tool-reaches is 30.00 % (120.0 mm2): no-tool"), "{why}");
        }
        let kept: Limit = "no-tool-reaches>30.5%".parse().unwrap();
        assert_eq!(kept.broken_by(&all, &areas).unwrap(), None);
        assert_eq!(
            kept.broken_by_findings(&Findings::of(&lattice(), None, &all, &[]).unwrap()),
            None
        );
    }

    #[test]
    fn the_largest_finding_is_named_with_its_place() {
        let sites = lattice();
        let blocked = |p: &Vec3| p.x < 3.5 || (p.x > 7.5 && p.y > 7.5);
        let answers = SiteAnswers::new(sites.points.iter().map(blocked).collect(), vec![]);
        let found = Findings::of(&sites, None, &answers, &[]).unwrap();
        assert_eq!(found.list.len(), 2);
        let broken = |text: &str| text.parse::<Limit>().unwrap().broken_by_findings(&found);
        let why = broken("finding > 30 mm2").unwrap();
        assert!(why.starts_with("the largest of 2 findings, inaccessible at "), "{why}");
        assert!(why.contains(" mm2 (") && why.ends_with("finding>30mm2"), "{why}");
        assert!(broken("finding>5%").is_some() && broken("finding<99%").is_some());
        assert_eq!((broken("finding>60mm2"), broken("finding>60%")), (None, None));
        assert_eq!(broken("inaccessible>0%"), None);
        let areas = SiteAreas::of(&sites, None).unwrap();
        assert!("finding>5%".parse::<Limit>().unwrap().broken_by(&answers, &areas).is_err());
        let none = SiteAnswers::new(vec![false; 100], vec![]);
        let none = Findings::of(&sites, None, &none, &[]).unwrap();
        assert_eq!("finding>0mm2".parse::<Limit>().unwrap().broken_by_findings(&none), None);
    }

    #[test]
    fn what_is_no_limit_is_refused_with_an_example() {
        for text in [
            "",
            ">",
            "inaccessible",
            "inaccessible>5",
            "inaccessible=5%",
            "x>5%",
            "inaccessible>NaN%",
            "inaccessible>-1%",
            "inaccessible>101%",
            "inaccessible>infmm2",
            "inaccessible>5ell2",
        ] {
            let message = text.parse::<Limit>().unwrap_err().to_string();
            assert!(
                message.starts_with("limit is `") && message.contains("inaccessible>5%"),
                "{message}"
            );
        }
    }
}
