//! A tool as a solid of revolution for a 3-D view: radius over height in straight lines.

use super::outline::{Bow, Kind, Outline, Section};
use crate::data::files::tools::Tool;
use std::f64::consts::TAU;

/// A tool from the tip upward.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::report) struct Solid {
    /// Radius and height above the tip, mm, from the axis to the axis.
    pub points: Vec<[f64; 2]>,
    /// Its portions: what they are, and the height above the tip at which they end, mm.
    pub portions: Vec<(Portion, f64)>,
    /// Greatest radius of what cuts, mm.
    pub cutting_radius_mm: f64,
}

/// What a portion of a tool is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::report) enum Portion {
    Cutting,
    Neck,
    Shank,
    Holder,
}

/// No line of an arc is farther from it than this share of the greatest radius.
const OFF: f64 = 1e-3;
/// Most lines of an arc.
const MOST: f64 = 32.0;
/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

impl Solid {
    /// The tool without margin and allowance. A holder without a spindle goes on above its last step: as much of that
    /// is taken as it is wide.
    pub fn of(tool: &Tool) -> Self {
        let outline = Outline::of(tool);
        let mut solid = Solid {
            points: vec![[0.0, 0.0]],
            portions: Vec::new(),
            cutting_radius_mm: outline.widest_cut[0],
        };
        solid.add([outline.start, 0.0]);
        let off = OFF * outline.widest();
        let mut from = [outline.start, 0.0];
        for section in &outline.sections {
            let portion = match section.kind {
                Kind::Cutting => Portion::Cutting,
                Kind::Neck => Portion::Neck,
                Kind::Shank => Portion::Shank,
            };
            let is_below = solid.add_section(from, section, (off, outline.nose));
            solid.end_portion(portion);
            if !is_below {
                break;
            }
            from = section.to;
        }
        solid.add_holder(&outline);
        let top = solid.top();
        solid.add([0.0, top]);
        solid
    }

    fn top(&self) -> f64 {
        self.points[self.points.len() - 1][1]
    }

    fn add(&mut self, point: [f64; 2]) {
        let last = self.points[self.points.len() - 1];
        if (0..2).any(|k| (point[k] - last[k]).abs() > SAME_MM) {
            self.points.push(point);
        }
    }

    /// The portion goes up to the last point.
    fn end_portion(&mut self, portion: Portion) {
        let top = self.top();
        match self.portions.last_mut() {
            Some((last, end)) if *last == portion => *end = top,
            Some((_, end)) if top <= *end => {}
            None if top <= 0.0 => {}
            _ => self.portions.push((portion, top)),
        }
    }

    /// Up to the nose of the holder; returns whether it ends below.
    fn add_section(&mut self, from: [f64; 2], section: &Section, (off, nose): (f64, f64)) -> bool {
        let mut last = from;
        for point in lines(from, section, off) {
            if point[1] > nose {
                let share = (nose - last[1]) / (point[1] - last[1]);
                self.add([last[0] + share * (point[0] - last[0]), nose]);
                return false;
            }
            self.add(point);
            last = point;
        }
        true
    }

    fn add_holder(&mut self, outline: &Outline) {
        let mut radius = 0.0;
        for step in &outline.holder {
            let height = outline.nose + step.height_mm;
            if radius > 0.0 {
                self.add([radius, height]);
            }
            if step.radius_mm.is_infinite() {
                self.end_portion(Portion::Holder);
                return;
            }
            radius = step.radius_mm;
            self.add([radius, height]);
        }
        if radius > 0.0 {
            self.add([radius, self.top() + 2.0 * radius]);
            self.end_portion(Portion::Holder);
        }
    }
}

/// The ends of the lines that a section is drawn with.
fn lines(from: [f64; 2], section: &Section, off: f64) -> Vec<[f64; 2]> {
    let to = section.to;
    let Some(Bow { center: [c, z], radius, is_convex }) = section.arc else { return vec![to] };
    let angle = |[r, h]: [f64; 2]| libm::atan2(h - z, r - c);
    let (first, mut turn) = (angle(from), angle(to) - angle(from));
    // A convex arc turns to the left on its way up.
    let way = if is_convex { 1.0 } else { -1.0 };
    if way * turn < -SAME_MM {
        turn += way * TAU;
    }
    let step = 2.0 * libm::acos((1.0 - off / radius).max(0.0));
    let n = (turn.abs() / step).ceil().clamp(1.0, MOST);
    let at = |k: f64| first + turn * k / n;
    let inner = (1..n as usize).map(|k| at(k as f64));
    let point =
        |angle: f64| [(c + radius * libm::cos(angle)).max(0.0), z + radius * libm::sin(angle)];
    inner.map(point).chain([to]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::{Assembly, Section as Length};

    fn profile(words: &str) -> Solid {
        let holder = [Length::cylinder(30.0, 20.0)];
        let tool = Assembly::from_profile(words.parse().unwrap(), &holder, 40.0).unwrap();
        Solid::of(&Tool::of_assembly("tool", tool, 0.0, String::new()).unwrap())
    }

    #[test]
    fn a_t_slot_cutter_is_its_lines_and_its_holder_up_to_the_spindle() {
        let solid = profile("10:0 10:8 5:8 | 5:30 8:30");
        let by_hand = [
            [0.0, 0.0],
            [10.0, 0.0],
            [10.0, 8.0],
            [5.0, 8.0],
            [5.0, 30.0],
            [8.0, 30.0],
            [8.0, 40.0],
            [20.0, 40.0],
            [20.0, 70.0],
            [0.0, 70.0],
        ];
        assert_eq!(solid.points, by_hand);
        let portions = [
            (Portion::Cutting, 8.0),
            (Portion::Neck, 30.0),
            (Portion::Shank, 40.0),
            (Portion::Holder, 70.0),
        ];
        assert_eq!((&solid.portions[..], solid.cutting_radius_mm), (&portions[..], 10.0));
    }

    #[test]
    fn a_lollipop_is_round_on_both_sides_of_its_equator() {
        // Radius 3 about height 3; the neck of radius 1.5 begins at 3 + √(9 − 2.25).
        let solid = profile("0:0 1.5:5.598076@0:3 | 1.5:40");
        let ball = solid.points.iter().filter(|[r, h]| *h <= 5.5981 && (*r, *h) != (0.0, 0.0));
        let off: Vec<f64> = ball.map(|[r, h]| libm::hypot(*r, h - 3.0) - 3.0).collect();
        assert!(off.len() > 20 && off.iter().all(|off| off.abs() < 1e-5), "{off:?}");
        let widest = solid.points.iter().filter(|[_, h]| *h < 6.0).map(|[r, _]| *r);
        assert!((widest.fold(0.0, f64::max) - 3.0).abs() < 0.01);
        assert_eq!(solid.portions[0].0, Portion::Cutting);
        assert!((solid.portions[0].1 - 5.598076).abs() < 1e-12);
    }

    #[test]
    fn a_ball_end_is_a_quarter_of_a_circle_below_its_flank() {
        let tool = Tool::new("3,20,15,40".parse().unwrap(), None, 0.5).unwrap();
        let solid = Solid::of(&tool);
        let corner: Vec<_> = solid.points.iter().filter(|[_, h]| *h <= 3.0).collect();
        assert!(corner.iter().all(|[r, h]| (libm::hypot(*r, 3.0 - h) - 3.0).abs() < 1e-9));
        // Flank up to the nose at 2·CR + CH, then the holder, FH high.
        let above = [[3.0, 26.0], [15.0, 26.0], [15.0, 66.0], [0.0, 66.0]];
        assert_eq!(solid.points[corner.len()..], above, "the margin is none of the tool");
    }
}
