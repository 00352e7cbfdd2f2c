//! Colors of sites, chosen to stay apart for color-blind eyes and in gray print.

use crate::answers::SiteAnswer;

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
#[non_exhaustive]
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
    /// Exact answers by the mesh definition.
    Surface {
        /// The answers.
        answers: &'a [SiteAnswer],
        /// Among the sites most often in the way; empty: that layer is not shown.
        occlusion: &'a [bool],
        /// Share of the surface that each site stands for.
        areas: &'a [f64],
    },
    /// Groups of the caller's own.
    Groups {
        /// The groups, in legend order.
        classes: &'a [Class<'a>],
        /// The group of each site, an index into `classes`.
        of: &'a [usize],
        /// Share of the surface that each site stands for; empty: sites count alike.
        areas: &'a [f64],
    },
}

const PLAIN: [Class<'static>; 1] = [Class { name: "site", color: [176, 186, 198] }];

pub(crate) const LABELS: [Class<'static>; 4] = [
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

/// The groups of [`Coloring::Difference`] in dark and light shades, for head 0 (inaccessible, red) and head 1
/// (occlusion, yellow): dark is over-predicted (a false alarm), light is under-predicted (missed), the shade between is
/// agreed.
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

/// Number of answers by the mesh definition.
const N_ANSWERS: usize = 3;

/// The groups of answers by the mesh definition, then the same with the layer of occlusion points upon them.
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
    answer + if occlusion { N_ANSWERS } else { 0 }
}

/// Answers and a layer upon them: the groups without the layer, and the color that each has with it.
pub(crate) fn layered(
    with_layer: &'static [Class<'static>],
) -> (&'static [Class<'static>], Vec<Rgb>) {
    let (answers, layer) = with_layer.split_at(with_layer.len() / 2);
    (answers, layer.iter().map(|class| class.color).collect())
}

impl<'a> Coloring<'a> {
    /// The groups, in legend order.
    pub fn classes(&self) -> &'a [Class<'a>] {
        match self {
            Coloring::Plain(_) => &PLAIN,
            Coloring::Labels { .. } => &LABELS,
            Coloring::Difference { .. } => &DIFFERENCE,
            Coloring::Surface { occlusion: [], .. } => &PART_ITSELF[..N_ANSWERS],
            Coloring::Surface { .. } => &PART_ITSELF,
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
            Coloring::Surface { answers, occlusion, .. } => {
                class_of_part_itself(answers[i], occlusion.get(i).copied().unwrap_or(false))
            }
            Coloring::Groups { of, .. } => of[i],
        }
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        match self {
            Coloring::Plain(n) => *n,
            Coloring::Labels { inaccessible, .. } => inaccessible.len(),
            Coloring::Difference { truth, .. } => truth.len(),
            Coloring::Surface { answers, .. } => answers.len(),
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

    /// Share that the legend states for each group: of the surface where areas are given, else of the sites. Occlusion
    /// points are a layer upon the
    /// answers: a site counts for its answer, for *occlusion*, and where it is both for that.
    pub fn legend_shares(&self) -> Vec<f64> {
        let areas = match self {
            Coloring::Surface { areas, .. } | Coloring::Groups { areas, .. } => *areas,
            _ => &[],
        };
        let even = 1.0 / self.len().max(1) as f64;
        let mut shares = vec![0.0; self.classes().len()];
        for i in 0..self.len() {
            let share = areas.get(i).copied().unwrap_or(even);
            self.entries(self.class(i)).for_each(|entry| shares[entry] += share);
        }
        shares
    }

    /// The legend's entries that a site of a group counts for.
    fn entries(&self, class: usize) -> impl Iterator<Item = usize> {
        let (answer, layer) = match self {
            Coloring::Labels { .. } => (class % 2, (class > 1).then_some(2)),
            Coloring::Surface { .. } => {
                (class % N_ANSWERS, (class >= N_ANSWERS).then_some(N_ANSWERS))
            }
            _ => (class, None),
        };
        // The layer upon the first answer has the layer's own name.
        let both = layer.filter(|layer| class > *layer).map(|_| class);
        [Some(answer), layer, both].into_iter().flatten()
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
        assert_eq!(difference.legend_shares(), [0.25; 4]);
        assert_eq!(labels.legend_shares(), [0.5, 0.5, 0.5, 0.25]);
    }

    #[test]
    fn what_is_accessible_does_not_depend_on_the_layer_of_occlusion_points() {
        use SiteAnswer::{Accessible, Inaccessible, TipDoesNotFit};
        let answers = [Accessible, Accessible, Inaccessible, Inaccessible, TipDoesNotFit];
        let areas = [0.3, 0.2, 0.25, 0.125, 0.125];
        let off = Coloring::Surface { answers: &answers, occlusion: &[], areas: &areas };
        let occlusion = [true, false, true, false, true];
        let on = Coloring::Surface { answers: &answers, occlusion: &occlusion, areas: &areas };
        assert_eq!(off.legend_shares(), [0.5, 0.375, 0.125]);
        assert_eq!(on.legend_shares(), [0.5, 0.375, 0.125, 0.3 + 0.25 + 0.125, 0.25, 0.125]);
        assert_eq!((0..5).map(|i| on.class(i)).collect::<Vec<_>>(), [3, 0, 4, 1, 5]);
        let names: Vec<&str> = off.classes().iter().map(|class| class.name).collect();
        assert_eq!(names, ["accessible", "inaccessible", "tip does not fit"]);
    }
}
