//! Answers for the points of a lattice around a part.

use super::super::npz::{NpzReader, NpzWriter};
use super::Provenance;
use super::poses::unit_or_none;
use crate::access::Labels;
use crate::access::surface::SurfaceEvidence;
use crate::answers::SiteAnswer;
use crate::geom::inside::Lattice;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;

/// What a point of space is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum PointAnswer {
    /// The tool can be where it touches the point: it removes what is here.
    Accessible = 0,
    /// In every direction the shank, holder or spindle penetrates the part.
    Inaccessible = 1,
    /// In some direction only the tip does.
    TipDoesNotFit = 2,
    /// The point is inside the part.
    Inside = 3,
}

impl PointAnswer {
    /// All, in the order of their numbers.
    pub const ALL: [PointAnswer; 4] = [
        PointAnswer::Accessible,
        PointAnswer::Inaccessible,
        PointAnswer::TipDoesNotFit,
        PointAnswer::Inside,
    ];

    /// Its name in legends.
    pub fn words(self) -> &'static str {
        ["accessible", "inaccessible", "tip does not fit", "the part"][self as usize]
    }
}

impl From<SiteAnswer> for PointAnswer {
    fn from(answer: SiteAnswer) -> Self {
        match answer {
            SiteAnswer::Accessible => PointAnswer::Accessible,
            SiteAnswer::Inaccessible => PointAnswer::Inaccessible,
            SiteAnswer::TipDoesNotFit => PointAnswer::TipDoesNotFit,
        }
    }
}

/// The answers about the space around one part, for one cutter.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct VolumeFile {
    /// Part, cutter and settings.
    pub provenance: Provenance,
    /// Where the points are.
    pub lattice: Lattice,
    /// Per point of the lattice, in its order.
    pub answers: Vec<PointAnswer>,
    /// Directions of the set in which no step penetrates the part; 0 inside. Empty for tools given by their profile.
    pub collision_free_directions: Vec<u32>,
    /// Of these, those in which the tip fits too; empty likewise.
    pub accessible_directions: Vec<u32>,
    /// Of a tool given by its profile: where it fits, but no retreat is proven, so that the answer is inaccessible.
    /// Empty for other tools.
    pub(crate) retreat_unproven: Vec<bool>,
    /// A direction in which the tip can be there.
    pub witness: Vec<Option<Vec3>>,
    /// What was said while it was computed.
    pub(crate) said: Said,
}

/// Sentences about a volume.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Said {
    /// What is wrong with fixtures and table.
    pub warnings: Vec<String>,
    /// What was left out.
    pub notices: Vec<String>,
}

/// Its array, JSON, if there is a sentence.
const SAID: &str = "said";
/// Array of the points without a proven retreat.
const UNPROVEN: &str = "retreat_unproven";

impl VolumeFile {
    const FORMAT: &str = "deepmill volume labels";

    /// From labels of the points that are not `inside`, in their order. Those without evidence, of a network, have
    /// counts of 0.
    ///
    /// # Errors
    /// If there are not as many labels as points outside.
    pub fn new(
        provenance: Provenance,
        lattice: Lattice,
        inside: &[bool],
        labels: &Labels,
    ) -> Result<Self> {
        let n_outside = inside.iter().filter(|inside| !**inside).count();
        let answers = &labels.answers;
        let zeros = vec![0; answers.len()];
        let none = SurfaceEvidence {
            witness: vec![None; answers.len()],
            collision_free_directions: zeros.clone(),
            ..SurfaceEvidence::default()
        };
        let (evidence, accessible_directions) = match &labels.surface {
            Some(evidence) => (evidence, &answers.accessible_directions),
            None => (&none, &zeros),
        };
        let SurfaceEvidence { collision_free_directions, retreat_unproven, .. } = evidence;
        let [free, accessible] = match retreat_unproven.len() {
            0 => [collision_free_directions.len(), accessible_directions.len()],
            n => [n; 2],
        };
        let counts = [answers.len(), evidence.witness.len(), free, accessible];
        if inside.len() != lattice.len() || counts != [n_outside; 4] {
            let found = format!("{counts:?} answers, {} points", inside.len());
            let expected = format!("{n_outside} answers, {} points", lattice.len());
            let remedy = "label the points outside the part, with counts";
            return Err(Error::argument("labels of the volume", found, expected, remedy));
        }
        let mut file = VolumeFile {
            provenance,
            lattice,
            answers: vec![PointAnswer::Inside; inside.len()],
            collision_free_directions: at_points(inside, collision_free_directions),
            accessible_directions: at_points(inside, accessible_directions),
            retreat_unproven: at_points(inside, retreat_unproven),
            witness: vec![None; inside.len()],
            said: Said::default(),
        };
        for (k, n) in (0..inside.len()).filter(|&n| !inside[n]).enumerate() {
            file.answers[n] = answers.of(k).into();
            file.witness[n] = evidence.witness[k].map(|pose| pose.direction);
        }
        Ok(file)
    }

    /// Of a tool given by its profile: share of the points outside the part where it fits, but no retreat is proven.
    #[doc(hidden)] // of the program
    pub fn unproven_share(&self) -> Option<f64> {
        let n_outside = self.answers.iter().filter(|other| **other != PointAnswer::Inside).count();
        let n_unproven = self.retreat_unproven.iter().filter(|unproven| **unproven).count();
        (!self.retreat_unproven.is_empty()).then(|| n_unproven as f64 / n_outside.max(1) as f64)
    }

    /// Share of the points outside the part with this answer; 0 if there are none.
    pub fn share(&self, answer: PointAnswer) -> f64 {
        let count = |counts: &dyn Fn(PointAnswer) -> bool| {
            self.answers.iter().filter(|other| counts(**other)).count() as f64
        };
        count(&|other| other == answer) / count(&|other| other != PointAnswer::Inside).max(1.0)
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If the system refuses it.
    pub fn write(&self, path: &Path) -> Result<()> {
        let n = [self.lattice.len()];
        let counts = self.lattice.counts.map(|count| count as u64);
        let numbers: Vec<u8> = self.answers.iter().map(|answer| *answer as u8).collect();
        let witness = self.witness.iter().flat_map(|w| w.unwrap_or(Vec3::ZERO).to_array());
        let mut npz = NpzWriter::new();
        npz.array("origin", &[3], &self.lattice.origin.to_array())
            .array("step", &[1], &[self.lattice.step_mm])
            .array("counts", &[3], &counts)
            .array("cutter", &[4], &self.provenance.cutter.to_array())
            .array("answer", &n, &numbers);
        let is_counted = self.retreat_unproven.is_empty();
        if is_counted {
            npz.array("collision_free_directions", &n, &self.collision_free_directions);
            npz.array("accessible_directions", &n, &self.accessible_directions);
        } else {
            npz.array(UNPROVEN, &n, &self.retreat_unproven);
        }
        npz.array("witness_direction", &[n[0], 3], &witness.collect::<Vec<f32>>());
        npz.metadata(&self.provenance.metadata(Self::FORMAT, meaning(is_counted)));
        if self.said != Said::default() {
            let text = serde_json::to_vec(&self.said).map_err(|e| Error::write(path, e.into()))?;
            npz.array(SAID, &[text.len()], &text);
        }
        npz.write(path)
    }

    /// Reads a file that [`VolumeFile::write`] has written.
    ///
    /// # Errors
    /// If it is no such file, or an array is missing, of the wrong length or out of range.
    pub fn read(path: &Path) -> Result<Self> {
        let mut npz = NpzReader::open(path)?;
        let provenance = Provenance::read(path, &mut npz, Self::FORMAT)?;
        let remedy = "name a file that this version of deepmill has written";
        let bad = |array: &str, found: String| Error::file(path, array, found, remedy);
        let (origin, step) = (npz.f64s("origin", 1)?, npz.f64s("step", 1)?);
        let (&[x, y, z], &[step_mm]) = (&origin[..], &step[..]) else {
            return Err(bad("origin", format!("{} and {} numbers", origin.len(), step.len())));
        };
        let counts = npz.counts::<usize>("counts")?;
        let &[nx, ny, nz] = &counts[..] else {
            return Err(bad("counts", format!("{} numbers, expected three", counts.len())));
        };
        let lattice = Lattice { origin: DVec3::new(x, y, z), step_mm, counts: [nx, ny, nz] };
        let answers = npz.counts::<u8>("answer")?.into_iter().map(|number| {
            let answer = PointAnswer::ALL.get(usize::from(number)).copied();
            answer.ok_or_else(|| bad("answer", format!("the number {number}")))
        });
        let mut said = Said::default();
        if npz.has(SAID) {
            let text = npz.counts::<u8>(SAID)?;
            said = serde_json::from_slice(&text).map_err(|e| bad(SAID, e.to_string()))?;
        }
        let answers = answers.collect::<Result<_>>()?;
        // Tools of any profile: directions are not counted.
        let is_counted = !npz.has(UNPROVEN);
        let mut counts = |array: &str| match is_counted {
            true => npz.counts(array),
            false => Ok(Vec::new()),
        };
        let file = VolumeFile {
            said,
            answers,
            collision_free_directions: counts("collision_free_directions")?,
            accessible_directions: counts("accessible_directions")?,
            retreat_unproven: if is_counted { Vec::new() } else { npz.bools(UNPROVEN)? },
            witness: unit_or_none(path, &mut npz, "witness_direction")?,
            provenance,
            lattice,
        };
        let n = [nx, ny, nz].into_iter().try_fold(1, usize::checked_mul).unwrap_or(usize::MAX);
        let counted = [
            ("collision_free_directions", file.collision_free_directions.len()),
            ("accessible_directions", file.accessible_directions.len()),
        ];
        let unproven = [(UNPROVEN, file.retreat_unproven.len())];
        let lists = if is_counted { &counted[..] } else { &unproven };
        let all = [("answer", file.answers.len()), ("witness_direction", file.witness.len())];
        for &(array, len) in all.iter().chain(lists) {
            if len != n {
                return Err(bad(array, format!("{len} entries for {n} points")));
            }
        }
        Ok(file)
    }
}

/// The values of the points outside, in turn, on the whole lattice; empty if there are none.
fn at_points<T: Copy + Default>(inside: &[bool], values: &[T]) -> Vec<T> {
    if values.is_empty() {
        return Vec::new();
    }
    let mut left = values.iter().copied();
    let at = |is_inside: &bool| if *is_inside { None } else { left.next() };
    inside.iter().map(at).map(Option::unwrap_or_default).collect()
}

fn meaning(is_counted: bool) -> Value {
    let mut meaning = json!({
        "definition": "mesh definition: the part's triangles are the obstacles, the tool is shrunk by the tolerance; it touches the point with any of its cutting portion",
        "points": "origin + step · (i, j, k) with i fastest: reshape arrays to counts[2], counts[1], counts[0] for the axes z, y, x",
        "answer": "0 accessible, 1 inaccessible: in every direction the shank, holder or spindle penetrates the part, \
                   2 the tip does not fit, 3 inside the part",
    });
    if is_counted {
        meaning["collision_free_directions"] = json!(
            "number of the directions tested in which no shank, holder or spindle penetrates the part"
        );
        meaning["accessible_directions"] = json!("number of these in which the tip fits too");
        meaning["witness_direction"] = json!(
            "unit vector from tip to spindle in which the tip may be there, 0 0 0 if there is none"
        );
    } else {
        meaning[UNPROVEN] =
            json!("1: the tool fits, and no retreat is proven; the answer is inaccessible");
        meaning["witness_direction"] = json!(
            "unit vector from tip to spindle in which the tool removes the point, 0 0 0 if there is none"
        );
    }
    meaning
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::surface::WitnessPose;
    use crate::answers::SiteAnswers;
    use crate::data::files::AnalysisSettings;
    use crate::tool::cutter::CutterParams;

    #[test]
    fn what_is_written_is_read() {
        let lattice = Lattice::covering(DVec3::ZERO, DVec3::new(2.0, 1.0, 3.0), 1.0).unwrap();
        let inside = [false, true, false, false, true, false];
        let answers = vec![
            SiteAnswer::Accessible,
            SiteAnswer::Inaccessible,
            SiteAnswer::TipDoesNotFit,
            SiteAnswer::Accessible,
        ];
        let answers = SiteAnswers {
            accessible_directions: vec![3, 0, 0, 1],
            ..SiteAnswers::by_mesh(answers)
        };
        let evidence = SurfaceEvidence {
            witness: [Some(Vec3::Z), None, None, Some(Vec3::X)]
                .map(|d| d.map(|direction| WitnessPose { direction, tip_mm: DVec3::ZERO }))
                .to_vec(),
            collision_free_directions: vec![3, 0, 2, 1],
            ..SurfaceEvidence::default()
        };
        let with = |evidence: &SurfaceEvidence| Labels {
            answers: answers.clone(),
            surface: Some(evidence.clone()),
            ..Labels::default()
        };
        let labels = with(&evidence);
        let cutter = CutterParams::from_array([1.0, 2.0, 3.0, 4.0]);
        let provenance = Provenance::ball_end("a part", cutter, AnalysisSettings::default());
        let file = VolumeFile::new(provenance.clone(), lattice, &inside, &labels).unwrap();
        assert_eq!(file.answers[4], PointAnswer::Inside);
        assert_eq!(file.answers[3], PointAnswer::TipDoesNotFit);
        assert_eq!(file.share(PointAnswer::Accessible), 0.5);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.npz");
        file.write(&path).unwrap();
        assert_eq!(VolumeFile::read(&path).unwrap(), file);
        let short = with(&SurfaceEvidence { witness: vec![], ..evidence.clone() });
        assert!(VolumeFile::new(provenance.clone(), lattice, &inside, &short).is_err());

        // Of a tool given by its profile.
        let mut labels = with(&SurfaceEvidence {
            collision_free_directions: vec![],
            retreat_unproven: vec![false, true, false, false],
            ..evidence
        });
        labels.answers.accessible_directions.clear();
        let file = VolumeFile::new(provenance, lattice, &inside, &labels).unwrap();
        assert_eq!(file.unproven_share(), Some(0.25));
        file.write(&path).unwrap();
        assert_eq!(VolumeFile::read(&path).unwrap(), file);
        let whole = std::fs::read(&path).unwrap();
        for cut in [0, 30, whole.len() / 2, whole.len() - 10] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(VolumeFile::read(&path).unwrap_err().to_string().contains("volume.npz"));
        }
        let mut npz = NpzWriter::new();
        npz.array("origin", &[3], &[0.0; 3])
            .array("step", &[1], &[1.0])
            .array("counts", &[3], &file.lattice.counts.map(|count| count as u64))
            .array("cutter", &[4], &cutter.to_array())
            .array("answer", &[6], &[0u8; 6])
            .array(UNPROVEN, &[5], &[false; 5])
            .array("witness_direction", &[6, 3], &[0f32; 18])
            .metadata(&file.provenance.metadata(VolumeFile::FORMAT, meaning(false)));
        npz.write(&path).unwrap();
        let message = VolumeFile::read(&path).unwrap_err().to_string();
        assert!(message.contains("retreat_unproven: 5 entries for 6 points"), "{message}");
    }
}
