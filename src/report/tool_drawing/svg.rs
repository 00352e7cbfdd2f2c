//! Lines and words of a drawing.

use super::View;
use super::outline::{Bow, Kind, Outline, Section};
use std::fmt::Write;

/// Fills of what cuts, neck, shank and holder.
const FILLS: [&str; 4] = ["c", "n", "s", "h"];
const STYLE: &str = "text{font:13px sans-serif;fill:#222}.t{font-weight:bold}.g{fill:#555}path{stroke:#222;\
stroke-width:1.2;stroke-linejoin:round}.c{fill:#f3b27a}.n{fill:#dbe3ea}.s{fill:#bccad6}.h{fill:#93a3b1}\
.d{stroke:#456;stroke-width:.8;fill:none}.m{fill:#456;stroke:none}.a{stroke:#a22;stroke-width:.8;\
stroke-dasharray:12 3 2 3;fill:none}";
/// Pixels: above the tool, from its axis to the left edge, length of an arrow.
const ABOVE: f64 = 76.0;
const LEFT: f64 = 210.0;
const ARROW: f64 = 7.0;
/// Between parallel dimensions.
const ROW: f64 = 24.0;
const COLUMN: f64 = 34.0;
/// Height of a word.
const WORD: f64 = 17.0;

/// A drawing in the making.
pub(super) struct Drawing {
    view: View,
    body: String,
    /// Dimensions across, below the tip.
    n_across: usize,
    right: f64,
    /// Words of leaders: where they point and what they are.
    leaders: Vec<([f64; 2], String)>,
    /// Left of the tool.
    left: f64,
}

impl Drawing {
    pub fn new(view: View, widest: f64) -> Self {
        let left = LEFT - view.scale * widest;
        Drawing { view, body: String::new(), n_across: 0, right: 0.0, leaders: vec![], left }
    }

    fn x(&self, radius: f64) -> f64 {
        LEFT + self.view.scale * radius
    }

    fn y(&self, height: f64) -> f64 {
        ABOVE + self.view.y(height)
    }

    fn add(&mut self, element: std::fmt::Arguments) {
        // A text takes everything.
        let _ = self.body.write_fmt(element);
        self.body.push('\n');
    }

    /// A part of the tool, from where it begins; a plain one may be broken.
    pub fn part(&mut self, from: [f64; 2], sections: &[Section]) {
        let class = FILLS[match sections[0].kind {
            Kind::Cutting => 0,
            Kind::Neck => 1,
            Kind::Shank => 2,
        }];
        let mut points = vec![(from, None)];
        points.extend(sections.iter().map(|section| (section.to, section.arc)));
        let top = sections[sections.len() - 1].to;
        if let Some([low, high]) = self.view.gap
            && from[1] < low
            && top[1] > high
        {
            let below = points.iter().take_while(|(to, _)| to[1] <= low).copied();
            let below: Vec<_> = below.chain([([top[0], low], None)]).collect();
            self.closed(class, &below, true, false);
            self.closed(class, &[([top[0], high + 1e-9], None), (top, None)], false, true);
            return;
        }
        self.closed(class, &points, false, false);
    }

    /// Up the right side and down the left.
    fn closed(
        &mut self,
        class: &str,
        points: &[([f64; 2], Option<Bow>)],
        is_broken_above: bool,
        is_broken_below: bool,
    ) {
        let place = |[radius, height]: [f64; 2], side: f64| {
            format!("{} {}", px(LEFT + side * self.view.scale * radius), px(self.y(height)))
        };
        let arc = |of: Option<Bow>| match of {
            None => "L".to_string(),
            Some(Bow { radius, is_convex, .. }) => {
                let r = px(self.view.scale * radius);
                format!("A{r} {r} 0 0 {} ", u8::from(!is_convex))
            }
        };
        let wave = |radius: f64, along: f64| {
            let quarter = along * 0.5 * self.view.scale * radius;
            format!(
                "q{} {} {} 0t{} 0",
                px(quarter),
                px(-6.0 * along),
                px(2.0 * quarter),
                px(2.0 * quarter)
            )
        };
        let first = points[0].0;
        let last = points[points.len() - 1].0;
        let mut path = format!("M{}", place(first, 1.0));
        for (to, of) in &points[1..] {
            path += &(arc(*of) + &place(*to, 1.0));
        }
        match is_broken_above {
            true => path += &wave(last[0], -1.0),
            false => path += &format!("L{}", place(last, -1.0)),
        }
        for k in (1..points.len()).rev() {
            path += &(arc(points[k].1) + &place(points[k - 1].0, -1.0));
        }
        if is_broken_below {
            path += &wave(first[0], 1.0);
        }
        self.add(format_args!("<path class=\"{class}\" d=\"{path}Z\"/>"));
    }

    /// The holder up to the upper edge, where it is cut off.
    pub fn holder(&mut self, outline: &Outline) {
        let top = self.view.top;
        let mut points = Vec::new();
        let mut radius = 0.0;
        for step in &outline.holder {
            let height = step.height_mm + outline.nose;
            if height >= top || !step.radius_mm.is_finite() {
                break;
            }
            if !points.is_empty() {
                points.push(([radius, height], None));
            }
            radius = step.radius_mm;
            points.push(([radius, height], None));
        }
        if points.is_empty() {
            return;
        }
        points.push(([radius, top], None));
        let half = super::HOLDER_HALF_WIDTH;
        let [x, y, w, h] = [LEFT - half, ABOVE - 10.0, 2.0 * half, super::HOLDER + 20.0].map(px);
        self.add(format_args!(
            "<clipPath id=\"k\"><rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/></clipPath><g clip-path=\"url(#k)\">"
        ));
        self.closed("h", &points, true, false);
        self.add(format_args!("</g>"));
    }

    pub fn axis(&mut self) {
        let (x, low, high) = (px(LEFT), px(self.y(0.0) + 12.0), px(ABOVE - 14.0));
        self.add(format_args!("<path class=\"a\" d=\"M{x} {low}V{high}\"/>"));
    }

    /// A diameter, below the tip; its words are beside the greatest radius. The narrower one comes first.
    pub fn across(&mut self, [radius, height]: [f64; 2], widest: f64, words: &str) {
        self.n_across += 1;
        let row = self.row(self.n_across);
        let [left, right] = [self.x(-radius), self.x(radius)];
        let from = self.y(height) + 3.0;
        let end = px(row + 4.0);
        for side in [left, right] {
            self.add(format_args!("<path class=\"d\" d=\"M{} {}V{end}\"/>", px(side), px(from)));
        }
        let beside = self.x(widest) + 3.0 * ARROW;
        let outward = if right - left > 4.0 * ARROW { 1.0 } else { -1.0 };
        let first = left - if outward > 0.0 { 0.0 } else { 3.0 * ARROW };
        self.line([first, row], [beside, row]);
        self.arrow([left, row], [-outward, 0.0]);
        self.arrow([right, row], [outward, 0.0]);
        self.word([beside + 3.0, row + 4.0], "start", words);
    }

    fn row(&self, k: usize) -> f64 {
        self.y(0.0) + 14.0 + ROW * k as f64
    }

    /// A height above the tip, on the right of all that is below it: from the outline's radius there. The lower ones
    /// come first.
    pub fn up_to(&mut self, height: f64, [radius, widest]: [f64; 2], words: &str) {
        let beside = self.x(widest) + 34.0;
        let x = beside.max(self.right + COLUMN);
        self.right = x;
        let [low, high] = [self.y(0.0), self.y(height)];
        let end = px(x + 4.0);
        self.add(format_args!(
            "<path class=\"d\" d=\"M{} {}H{end}M{} {}H{end}\"/>",
            px(self.x(radius) + 3.0),
            px(high),
            px(LEFT + 4.0),
            px(low)
        ));
        let room = 7.5 * words.chars().count() as f64 + 2.0 * ARROW;
        let is_short = low - high < 4.0 * ARROW;
        let (outward, beyond) = if is_short { (-1.0, 2.0 * ARROW) } else { (1.0, 0.0) };
        self.line([x, low + beyond], [x, high - beyond]);
        self.arrow([x, low], [0.0, outward]);
        self.arrow([x, high], [0.0, -outward]);
        // Words that do not fit between the arrows are above them.
        let (y, anchor) = match low - high > room {
            true => (0.5 * (low + high), "middle"),
            false => (high - beyond - 4.0, "start"),
        };
        self.add(format_args!(
            "<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"{anchor}\">{}</text>",
            px(x - if anchor == "middle" { 4.0 } else { -4.0 }),
            px(y),
            escaped(words)
        ));
    }

    /// Words with a line to a point of the outline.
    pub fn leader(&mut self, [radius, height]: [f64; 2], words: &str) {
        let at = [self.x(-radius), self.y(height)];
        self.leaders.push((at, words.into()));
    }

    fn write_leaders(&mut self) {
        let mut leaders = std::mem::take(&mut self.leaders);
        leaders.sort_by(|a, b| a.0[1].total_cmp(&b.0[1]));
        let edge = (self.left - 30.0).max(60.0);
        // From above downward, none over another.
        let mut rows: Vec<f64> = leaders.iter().map(|(at, _)| at[1] - 8.0).collect();
        for k in 1..rows.len() {
            rows[k] = rows[k].max(rows[k - 1] + WORD);
        }
        for ((at, words), row) in leaders.iter().zip(rows) {
            self.line([edge, row], *at);
            self.line([edge - 8.0, row], [edge, row]);
            self.dot(*at);
            self.word([edge - 11.0, row + 4.0], "end", words);
        }
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2]) {
        let [a, b, c, d] = [from[0], from[1], to[0], to[1]].map(px);
        self.add(format_args!("<path class=\"d\" d=\"M{a} {b}L{c} {d}\"/>"));
    }

    fn dot(&mut self, [x, y]: [f64; 2]) {
        self.add(format_args!("<circle class=\"m\" cx=\"{}\" cy=\"{}\" r=\"1.8\"/>", px(x), px(y)));
    }

    /// Its point is at the place.
    fn arrow(&mut self, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) {
        let back = [x - ARROW * dx, y - ARROW * dy];
        let [a, b] = [2.2, -2.2].map(|s| [px(back[0] - s * dy), px(back[1] + s * dx)]);
        self.add(format_args!(
            "<path class=\"m\" d=\"M{} {}L{} {}L{} {}Z\"/>",
            px(x),
            px(y),
            a[0],
            a[1],
            b[0],
            b[1]
        ));
    }

    fn word(&mut self, [x, y]: [f64; 2], anchor: &str, words: &str) {
        let words = escaped(words);
        self.add(format_args!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\">{words}</text>",
            px(x),
            px(y)
        ));
    }

    /// The picture with its title, what the tool is, and a legend.
    pub fn finish(mut self, [name, words, unit]: [&str; 3]) -> String {
        self.write_leaders();
        let bottom = self.row(self.n_across) + 20.0;
        let wide = self.right + 20.0;
        let width = wide.max(10.0 + 7.0 * words.chars().count() as f64).max(460.0);
        let mut x = 12.0;
        for (class, what) in FILLS.iter().zip(["cuts", "neck", "shank", "holder"]) {
            self.add(format_args!(
                "<rect class=\"{class}\" x=\"{x}\" y=\"{}\" width=\"12\" height=\"12\"/>",
                px(bottom + 6.0)
            ));
            self.word([x + 17.0, bottom + 17.0], "start", what);
            x += 72.0;
        }
        self.word([x + 8.0, bottom + 17.0], "start", unit);
        let (w, h) = (width.ceil(), (bottom + 30.0).ceil());
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\">\n\
             <style>{STYLE}</style>\n<rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n\
             <text class=\"t\" x=\"12\" y=\"22\">{}</text>\n<text class=\"g\" x=\"12\" y=\"41\">{}</text>\n{}</svg>\n",
            escaped(name),
            escaped(words),
            self.body
        )
    }
}

/// A place, to a tenth of a pixel.
fn px(x: f64) -> String {
    let text = format!("{x:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
