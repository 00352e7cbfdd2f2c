//! Colors of sites, chosen to stay apart for color-blind eyes and in gray print.

use crate::access::surface::SiteAnswer;

/// Red, green and blue, 0 to 255 each, sRGB.
pub type Rgb = [u8; 3];

/// A group of sites that share a color.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Class<'a> {
    /// Name in legends.
    pub name: &'a str,
    /// Color before shading.
    pub color: Rgb,
}

/// What the colors of the sites say; the slices have one entry per site.
#[derive(Debug, Clone, Copy)]
pub enum Coloring<'a> {
    /// Nothing: this many sites without an answer.
    Plain(usize),
    /// The answers of one engine, exact or predicted.
    Labels {
        /// The cutter collides in every direction.
        inaccessible: &'a [bool],
        /// Among the sites most often in the way.
        occlusion: &'a [bool],
    },
    /// One answer predicted, compared with the true one.
    Difference {
        /// What "yes" means, e.g. "inaccessible".
        positive: &'static str,
        /// The exact answers.
        truth: &'a [bool],
        /// The predicted answers.
        predicted: &'a [bool],
    },
    /// Groups of the caller's own.
    Groups {
        /// The groups, in legend order.
        classes: &'a [Class<'a>],
        /// The group of each site, an index into `classes`.
        of: &'a [usize],
    },
}

const PLAIN: [Class<'static>; 1] = [Class { name: "site", color: [176, 186, 198] }];

const LABELS: [Class<'static>; 4] = [
    Class { name: "accessible", color: [205, 208, 212] },
    Class { name: "inaccessible", color: [206, 58, 44] },
    Class { name: "occlusion", color: [245, 196, 50] },
    Class { name: "both", color: [112, 56, 150] },
];

const DIFFERENCE: [Class<'static>; 4] = [
    Class { name: "agreed: no", color: [212, 214, 217] },
    Class { name: "agreed: yes", color: [122, 134, 150] },
    Class { name: "missed", color: [206, 58, 44] },
    Class { name: "false alarm", color: [50, 120, 200] },
];

const NEITHER: Rgb = [205, 208, 212];

/// The groups of [`Coloring::Difference`] in dark and light shades, for head 0 (inaccessible, red) and head 1 (occlusion,
/// yellow): dark is over-predicted (a false alarm), light is under-predicted (missed), the shade between is agreed.
pub const DARK_AND_LIGHT: [[Class<'static>; 4]; 2] = [
    [
        Class { name: "agreed: not inaccessible", color: NEITHER },
        Class { name: "agreed: inaccessible", color: [206, 82, 66] },
        Class { name: "under-predicted: missed", color: [250, 182, 166] },
        Class { name: "over-predicted: false alarm", color: [104, 14, 10] },
    ],
    [
        Class { name: "agreed: not occlusion", color: NEITHER },
        Class { name: "agreed: occlusion", color: [222, 164, 36] },
        Class { name: "under-predicted: missed", color: [255, 232, 160] },
        Class { name: "over-predicted: false alarm", color: [104, 66, 0] },
    ],
];

/// The groups of answers about the part itself.
pub const PART_ITSELF: [Class<'static>; 6] = [
    Class { name: "accessible", color: [205, 208, 212] },
    Class { name: "inaccessible", color: [206, 58, 44] },
    Class { name: "tip does not fit", color: [50, 120, 200] },
    Class { name: "occlusion", color: [245, 196, 50] },
    Class { name: "inaccessible and occlusion", color: [112, 56, 150] },
    Class { name: "tip and occlusion", color: [60, 150, 120] },
];

/// The group of a site, an index into [`PART_ITSELF`].
pub fn class_of_part_itself(answer: SiteAnswer, occlusion: bool) -> usize {
    let answer = match answer {
        SiteAnswer::Accessible => 0,
        SiteAnswer::Inaccessible => 1,
        SiteAnswer::TipDoesNotFit => 2,
    };
    answer + if occlusion { 3 } else { 0 }
}

impl<'a> Coloring<'a> {
    /// The groups, in legend order.
    pub fn classes(&self) -> &'a [Class<'a>] {
        match self {
            Coloring::Plain(_) => &PLAIN,
            Coloring::Labels { .. } => &LABELS,
            Coloring::Difference { .. } => &DIFFERENCE,
            Coloring::Groups { classes, .. } => classes,
        }
    }

    /// The group of site `i`, an index into [`Coloring::classes`].
    ///
    /// # Panics
    /// If there is no site `i`.
    pub fn class(&self, i: usize) -> usize {
        match self {
            Coloring::Plain(_) => 0,
            Coloring::Labels { inaccessible, occlusion } => {
                usize::from(inaccessible[i]) + 2 * usize::from(occlusion[i])
            }
            Coloring::Difference { truth, predicted, .. } => match (truth[i], predicted[i]) {
                (false, false) => 0,
                (true, true) => 1,
                (true, false) => 2,
                (false, true) => 3,
            },
            Coloring::Groups { of, .. } => of[i],
        }
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        match self {
            Coloring::Plain(n) => *n,
            Coloring::Labels { inaccessible, .. } => inaccessible.len(),
            Coloring::Difference { truth, .. } => truth.len(),
            Coloring::Groups { of, .. } => of.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The color of site `i` before shading.
    ///
    /// # Panics
    /// If there is no site `i`.
    pub fn color(&self, i: usize) -> Rgb {
        self.classes()[self.class(i)].color
    }

    /// Number of sites that the legend states for each group. Labels overlap: a site that is both
    /// counts as inaccessible, as occlusion and as both.
    pub fn legend_counts(&self) -> Vec<usize> {
        let counts = self.counts();
        match (self, &counts[..]) {
            (Coloring::Labels { .. }, [none, first, second, both]) => {
                vec![none + second, first + both, second + both, *both]
            }
            _ => counts,
        }
    }

    /// Number of sites in each group.
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.classes().len()];
        (0..self.len()).for_each(|i| counts[self.class(i)] += 1);
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_combination_has_its_own_class() {
        let (a, b) = ([false, true, false, true], [false, false, true, true]);
        let labels = Coloring::Labels { inaccessible: &a, occlusion: &b };
        assert_eq!([0, 1, 2, 3].map(|i| labels.class(i)), [0, 1, 2, 3]);
        let difference = Coloring::Difference { positive: "x", truth: &a, predicted: &b };
        assert_eq!(
            [0, 1, 2, 3].map(|i| difference.classes()[difference.class(i)].name),
            ["agreed: no", "missed", "false alarm", "agreed: yes"]
        );
        assert_eq!(difference.legend_counts(), [1; 4]);
        assert_eq!(labels.legend_counts(), [2, 2, 2, 1]);
    }
}
