//! A page that stays open while its part is edited: versions of it, and what changed from one to the next.

use super::{Page, View};
use crate::Result;
use crate::exec::par;
use crate::geom::units::Unit;
use crate::geom::{Mesh, Sites};
use crate::spatial::PointGrid;
use glam::DVec3;

/// A site has a new answer if no site of the version before has its answer within so many spacings: what moved less
/// may be other sites of the same surface.
const SPACINGS: f64 = 2.0;
/// Sites whose normals are further apart than this cosine are on other sides of the part.
const SAME_SIDE: f32 = 0.5;

/// A version of a page, with all that it shows.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct LivePage {
    /// Name of the part.
    pub part: String,
    /// The surface, mm.
    pub mesh: Option<Mesh>,
    /// The sites of all tabs, mm.
    pub sites: Sites,
    /// The tabs.
    pub views: Vec<View>,
    /// Of lengths and areas.
    pub unit: Unit,
    /// Outlines of what blocks beside the part, mm.
    pub outlines: Vec<[DVec3; 2]>,
    /// Number of the version, from 1 on.
    pub version: u64,
    /// Which of all pages it is: a version may have several, the later with more answers.
    pub number: u64,
}

impl LivePage {
    /// The first version of a page.
    pub fn of(page: Page) -> Self {
        LivePage {
            part: page.part.to_owned(),
            mesh: page.mesh.cloned(),
            sites: page.sites.clone(),
            views: page.views.to_vec(),
            unit: page.unit,
            outlines: page.outlines.to_vec(),
            version: 1,
            number: 1,
        }
    }

    /// Makes it the version after another: in every tab that both have, sites are marked whose answer is a new one
    /// there.
    pub fn follow(&mut self, before: &LivePage) {
        self.version = before.version + 1;
        let grid = PointGrid::new(&before.sites.points);
        let spacing_mm = self.spacing_mm().max(before.spacing_mm());
        for view in &mut self.views {
            let same = before.views.iter().find(|other| other.name == view.name);
            view.changed =
                same.map(|same| changed((&self.sites, view), (before, same), &grid, spacing_mm));
        }
    }

    /// Area within reach by the first tab, mm², if that tab has findings.
    pub fn reached_mm2(&self) -> Option<f64> {
        let findings = self.views.first()?.findings.as_ref()?;
        let out = findings.list.iter().map(|finding| finding.area_mm2).sum::<f64>();
        Some(findings.surface_mm2 - out - findings.scattered.area_mm2)
    }

    /// The document, which follows the versions that its server has.
    ///
    /// # Errors
    /// As [`Page::html`].
    pub fn html(&self) -> Result<String> {
        let LivePage { part, mesh, sites, views, outlines, .. } = self;
        let (mesh, unit) = (mesh.as_ref(), self.unit);
        Page { part, mesh, sites, views, unit, outlines }
            .document(Some([self.version, self.number]))
    }

    fn spacing_mm(&self) -> f64 {
        let area_mm2 = self.mesh.as_ref().map_or(0.0, Mesh::area);
        (area_mm2 / self.sites.len().max(1) as f64).sqrt()
    }
}

/// Whether each site of a tab has another answer than the sites about its place had.
fn changed(
    (sites, view): (&Sites, &View),
    (before, same): (&LivePage, &View),
    grid: &PointGrid,
    spacing_mm: f64,
) -> Vec<bool> {
    // Groups by name: another version may have other ones.
    let group = |(name, _): &(String, _)| same.classes.iter().position(|(n, _)| n == name);
    let group: Vec<Option<usize>> = view.classes.iter().map(group).collect();
    let within_mm = (SPACINGS * spacing_mm) as f32;
    let is_new = |i: usize| {
        let Some(group) = group[usize::from(view.of[i])] else { return true };
        let (place, normal) = (sites.points[i], sites.normals[i]);
        let mut is_known = false;
        grid.for_each_within(place, within_mm, |j, _| {
            let j = j as usize;
            let is_beside = before.sites.normals[j].dot(normal) > SAME_SIDE;
            is_known |= is_beside && usize::from(same.of[j]) == group;
        });
        !is_known
    };
    par::map(view.of.len(), is_new)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids::cuboid;

    /// A block whose sites above a height are out of reach.
    fn page(size: DVec3, seed: u64, above_mm: f32) -> LivePage {
        let mesh = cuboid(size);
        let options = SiteOptions { n_sites: 2000, seed, ..SiteOptions::default() };
        let sites = sample(&mesh, &options).unwrap();
        let classes = vec![("reached".into(), [0; 3]), ("out of reach".into(), [255; 3])];
        let of = sites.points.iter().map(|p| u8::from(p.z > above_mm)).collect();
        let view = View { name: "exact".into(), classes, of, ..View::default() };
        let views = &[view][..];
        let unit = Unit::Millimeter;
        let (part, outlines) = ("block", &[][..]);
        LivePage::of(Page { part, mesh: Some(&mesh), sites: &sites, views, unit, outlines })
    }

    fn marked(page: &LivePage) -> Vec<f32> {
        let changed = page.views[0].changed.as_ref().unwrap();
        let places = page.sites.points.iter().zip(changed);
        places.filter(|(_, changed)| **changed).map(|(p, _)| p.z).collect()
    }

    #[test]
    fn other_sites_of_the_same_answers_are_no_change() {
        let size = DVec3::new(40.0, 30.0, 20.0);
        let before = page(size, 1, 12.0);
        let mut after = page(size, 2, 12.0);
        after.follow(&before);
        assert_eq!(after.version, 2);
        assert_eq!(marked(&after), [0.0; 0]);
    }

    #[test]
    fn sites_with_a_new_answer_are_marked_and_no_others() {
        let size = DVec3::new(40.0, 30.0, 20.0);
        let before = page(size, 1, 12.0);
        let mut after = page(size, 2, 4.0);
        after.follow(&before);
        // 2,000 sites on 5,200 mm²: spacing 1.6 mm. New between 4 and 12 mm, but for two spacings from above.
        let heights = marked(&after);
        assert!(heights.iter().all(|z| (4.0..=12.0).contains(z)), "{heights:?}");
        let inner = |z: &f32| (4.0..8.0).contains(z);
        let n_inner = after.sites.points.iter().filter(|p| p.z > 4.0 && inner(&p.z)).count();
        assert_eq!(heights.iter().filter(|z| inner(z)).count(), n_inner);
        assert!(n_inner > 100);
    }

    #[test]
    fn new_surface_is_marked() {
        let before = page(DVec3::new(40.0, 30.0, 20.0), 1, 99.0);
        let mut after = page(DVec3::new(40.0, 30.0, 30.0), 2, 99.0);
        after.follow(&before);
        let heights = marked(&after);
        assert!(heights.iter().all(|z| *z > 20.0) && heights.contains(&30.0));
    }

    #[test]
    fn a_live_page_may_ask_its_server_and_a_report_nobody() {
        let page = page(DVec3::splat(10.0), 1, 5.0);
        let html = page.html().unwrap();
        assert!(
            html.contains("connect-src 'self'")
                && html.contains("data-version=\"1\" data-number=\"1\"")
        );
        assert!(html.contains("class Live") && html.contains("id=\"live\""));
        let LivePage { part, mesh, sites, views, unit, outlines, .. } = &page;
        let page = Page { part, mesh: mesh.as_ref(), sites, views, unit: *unit, outlines };
        let html = page.html().unwrap();
        let live = ["connect-src", "class Live", "id=\"live\"", "data-version", "data-number"];
        assert!(live.iter().all(|words| !html.contains(words)));
    }
}
