//! Slots and bores that are too narrow for the tool.

use super::{PartChange, PartLength, Region, rounded};
use crate::Result;
use crate::access::surface::tolerance::LEAST_MM;
use crate::access::surface::tool::axes;
use crate::answers::SiteAnswer;
use crate::exec::par;
use glam::DVec3;
use std::f64::consts::{SQRT_2, TAU};

/// Walls are opposite where their normals are within this of opposite, as a cosine: 20 degrees.
const OPPOSITE: f64 = 0.94;
/// Nothing narrower is called a slot, mm.
const LEAST_WIDTH_MM: f64 = 0.5;
/// Widths that differ by less than this share are one.
const SAME_WIDTH: f64 = 0.02;
/// What less of a region is freed is no advice.
const LEAST_SHARE: f64 = 0.02;
/// Widths of one region that are looked at.
const N_WIDTHS: usize = 4;
/// Sites that the depth is measured at.
const N_DEPTHS: usize = 16;
/// A bore is as wide across within this share.
const ROUND: f64 = 0.1;
/// Steps along a slot, of an eighth of its width, and halvings of the last.
const STEPS: usize = 400;
const HALVINGS: usize = 20;

/// A site on a wall or between walls, a place of the wall, and the distance of the wall opposite.
#[derive(Clone, Copy)]
struct Wall {
    site: usize,
    at: DVec3,
    normal: DVec3,
    width: f64,
}

/// Heights above a floor, as shares of the tool's radius, from which walls are looked for, and directions there.
const HEIGHTS: [f64; 2] = [0.5, 0.1];
const N_AROUND: usize = 8;

impl Region<'_> {
    /// What width slots and bores would need, one for every width that they have, the widest first.
    pub(super) fn width(&self) -> Result<Vec<PartChange>> {
        let diameter = 2.0 * (self.cutter.corner_mm() + self.cutter.side_mm());
        let mut walls: Vec<Wall> =
            par::map(self.n(), |site| self.wall(site)).into_iter().flatten().collect();
        walls.retain(|w| (LEAST_WIDTH_MM..diameter - 2.0 * LEAST_MM).contains(&w.width));
        walls.sort_by(|a, b| b.width.total_cmp(&a.width));
        let mut counted = vec![false; self.n()];
        let mut all = Vec::new();
        let is_same = |a: &Wall, b: &Wall| a.width - b.width <= SAME_WIDTH * a.width;
        for group in walls.chunk_by(is_same).take(N_WIDTHS) {
            let least = group.last().map_or(0.0, |wall| wall.width);
            let thinner = self.tool.clone().without_overall();
            let Ok(thinner) = thinner.with_smaller_end((least - 2.0 * LEAST_MM) / diameter) else {
                continue;
            };
            let cutter = thinner.with_clearance(self.clearance_mm)?.cutter()?;
            let places: Vec<_> = self.points.iter().copied().zip(self.normals.clone()).collect();
            let labels = self.label(&cutter, &places, self.directions)?;
            let is_new = |i: &usize| labels.answers[*i] == SiteAnswer::Accessible && !counted[*i];
            let freed: Vec<usize> = (0..self.n()).filter(is_new).collect();
            freed.iter().for_each(|&i| counted[i] = true);
            let share = freed.len() as f64 / self.n() as f64;
            let direction =
                |wall: &Wall| labels.evidence.witness[wall.site].map(|w| w.direction.as_dvec3());
            let deep = group.iter().filter(|wall| freed.contains(&wall.site));
            let deep = deep.filter_map(|wall| Some((wall, direction(wall)?))).take(N_DEPTHS);
            let measured = deep.map(|(wall, d)| (self.depth(wall, d), wall, d));
            let deepest = measured.reduce(|a, b| if b.0 > a.0 { b } else { a });
            let (true, Some((depth, wall, direction))) = (share >= LEAST_SHARE, deepest) else {
                continue;
            };
            let is_bore = self.is_bore(wall, direction);
            all.push(PartChange {
                kind: if is_bore { PartLength::BoreDiameter } else { PartLength::SlotWidth },
                from_mm: rounded(least),
                to_mm: rounded(diameter + 2.0 * LEAST_MM),
                at_mm: wall.at,
                depth_mm: Some(rounded(depth)),
                share,
            });
        }
        Ok(all)
    }

    /// Of a site on a wall, that wall; of one on a floor, the walls beside it that are nearest to each other.
    fn wall(&self, site: usize) -> Option<Wall> {
        let (point, normal) = (self.points[site], self.normals[site]);
        let radius = self.cutter.corner_mm() + self.cutter.side_mm();
        let beside = |height: f64| {
            let [u, v, _] = axes(normal.as_vec3());
            let from = point + normal * (height * radius);
            let around = (0..N_AROUND).filter_map(move |k| {
                let angle = TAU * k as f64 / N_AROUND as f64;
                let ray = u * libm::cos(angle) + v * libm::sin(angle);
                let (t, place) = self.obstacles.ray(from, ray, 0.0)?;
                let facing = self.obstacles.facing(place);
                let is_near = t < 2.0 * radius && facing.dot(ray) < 0.0;
                is_near.then(|| self.opposite(site, from + ray * t, facing)).flatten()
            });
            around.reduce(|a, b| if b.width < a.width { b } else { a })
        };
        self.opposite(site, point, normal).or_else(|| HEIGHTS.into_iter().find_map(beside))
    }

    /// A place of a wall and the wall opposite, if there is one of the part.
    fn opposite(&self, site: usize, at: DVec3, normal: DVec3) -> Option<Wall> {
        let (width, place) = self.obstacles.ray(at, normal, LEAST_MM)?;
        let is_of_part = self.obstacles.bvh.face(place) < self.obstacles.n_of_part();
        let is_opposite = self.obstacles.facing(place).dot(normal) <= -OPPOSITE;
        (is_of_part && is_opposite).then_some(Wall { site, at, normal, width })
    }

    /// Between the two walls.
    fn middle(&self, wall: &Wall) -> DVec3 {
        wall.at + wall.normal * (0.5 * wall.width)
    }

    /// How deep the slot is at a wall along a direction: from where it is open to its floor.
    fn depth(&self, wall: &Wall, direction: DVec3) -> f64 {
        let (middle, normal) = (self.middle(wall), wall.normal);
        let is_between = |height: f64| {
            let at = middle + direction * height;
            let meets =
                |u: DVec3| self.obstacles.ray(at, u, 0.0).is_some_and(|(t, _)| t <= wall.width);
            meets(normal) && meets(-normal)
        };
        let run = |sign: f64| {
            let step = sign * wall.width / 8.0;
            let n = (1..=STEPS).find(|&n| !is_between(step * n as f64)).unwrap_or(STEPS);
            let (mut low, mut high) = (step * (n - 1) as f64, step * n as f64);
            for _ in 0..HALVINGS {
                let half = 0.5 * (low + high);
                if is_between(half) { low = half } else { high = half }
            }
            low.abs()
        };
        let floor = self.obstacles.ray(middle, -direction, 0.0).map_or(f64::INFINITY, |(t, _)| t);
        run(1.0) + run(-1.0).min(floor)
    }

    /// Whether the walls are as far apart across and between.
    fn is_bore(&self, wall: &Wall, direction: DVec3) -> bool {
        let (middle, normal) = (self.middle(wall), wall.normal);
        let across = normal.cross(direction).normalize_or_zero();
        let span = |u: DVec3| {
            let of = |u: DVec3| self.obstacles.ray(middle, u, 0.0).map(|(t, _)| t);
            of(u).zip(of(-u)).map_or(f64::INFINITY, |(a, b)| a + b)
        };
        let is_as_wide = |u: DVec3| (span(u) - wall.width).abs() <= ROUND * wall.width;
        is_as_wide(across) && is_as_wide((across + normal) / SQRT_2)
    }
}
