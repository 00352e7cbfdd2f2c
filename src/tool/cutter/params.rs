//! The four lengths of a published cutter, and the sets that they are drawn from.

use crate::numeric::rng::Stream;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Lengths of a ball-end cutter with a holder, mm, unchecked; the order is `CR, CH, FR, FH` everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CutterParams {
    /// CR: radius of the ball and of the cylinder above it.
    pub cr_mm: f64,
    /// CH: height of that cylinder, from the top of the ball to the holder.
    pub ch_mm: f64,
    /// FR: radius of the holder.
    pub fr_mm: f64,
    /// FH: height of the holder; above it everything is spindle.
    pub fh_mm: f64,
}

impl CutterParams {
    /// From `[CR, CH, FR, FH]`, mm.
    pub fn from_array([cr_mm, ch_mm, fr_mm, fh_mm]: [f64; 4]) -> Self {
        CutterParams { cr_mm, ch_mm, fr_mm, fh_mm }
    }

    /// `[CR, CH, FR, FH]`, mm.
    pub fn to_array(self) -> [f64; 4] {
        [self.cr_mm, self.ch_mm, self.fr_mm, self.fh_mm]
    }
}

impl From<[f64; 4]> for CutterParams {
    fn from(lengths_mm: [f64; 4]) -> Self {
        CutterParams::from_array(lengths_mm)
    }
}

impl From<CutterParams> for [f64; 4] {
    fn from(params: CutterParams) -> Self {
        params.to_array()
    }
}

/// Writes `CR,CH,FR,FH`, mm.
impl fmt::Display for CutterParams {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [cr, ch, fr, fh] = self.to_array();
        write!(f, "{cr},{ch},{fr},{fh}")
    }
}

/// Reads `CR,CH,FR,FH`, mm. Whether the lengths make a cutter is for [`Cutter`](super::Cutter) to say.
///
/// ```
/// use deepmill::cutter::{Cutter, CutterParams};
/// let params: CutterParams = "1.5, 6, 40, 5".parse()?;
/// assert_eq!(params, [1.5, 6.0, 40.0, 5.0].into());
/// let cutter: Cutter = "1.5,6,40,5".parse()?;
/// assert_eq!(cutter, Cutter::ball_end(params)?);
/// # Ok::<(), deepmill::Error>(())
/// ```
impl FromStr for CutterParams {
    type Err = Error;

    /// # Errors
    /// If the text is not four numbers with commas between.
    fn from_str(text: &str) -> Result<Self> {
        let lengths: Option<Vec<f64>> =
            text.split(',').map(|length| length.trim().parse().ok()).collect();
        let four = lengths.and_then(|lengths| <[f64; 4]>::try_from(lengths).ok());
        four.map(CutterParams::from_array).ok_or_else(|| {
            let expected = "four lengths in mm: CR,CH,FR,FH";
            let remedy = "write for example 1.5,6,40,5";
            Error::argument("cutter", format!("`{text}`"), expected, remedy)
        })
    }
}

/// Ranges that cutters are drawn from; each length is uniform and independent. All but [`CutterSet::Full`] are
/// published.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CutterSet {
    /// Training and main test set: CR 1–2, CH 0.1–10.1, FR 5–100, FH 0.1–10.1.
    Uniform,
    /// Hardly any stick-out: CR 1–2, CH 0.1–0.2, FR 80–100, FH 0.1–0.2.
    Short,
    /// Long and slender: CR 1–2, CH 10–10.1, FR 5–5.1, FH 10–10.1.
    Long,
    /// Beyond the training range: CR 1–2, CH 20–20.1, FR 5–5.1, FH 20–20.1.
    Extreme,
    /// Every length from short to extreme: CR 1–2, CH 0.1–20.1, FR 5–100, FH 0.1–20.1.
    Full,
}

impl CutterSet {
    const ALL: [CutterSet; 5] = [
        CutterSet::Uniform,
        CutterSet::Short,
        CutterSet::Long,
        CutterSet::Extreme,
        CutterSet::Full,
    ];

    /// The published sets, in the order of the paper.
    pub const PUBLISHED: [CutterSet; 4] =
        [CutterSet::Uniform, CutterSet::Short, CutterSet::Long, CutterSet::Extreme];

    /// `uniform`, `short`, `long`, `extreme` or `full`.
    pub fn name(self) -> &'static str {
        match self {
            CutterSet::Uniform => "uniform",
            CutterSet::Short => "short",
            CutterSet::Long => "long",
            CutterSet::Extreme => "extreme",
            CutterSet::Full => "full",
        }
    }

    /// Ranges `[low, high)` of CR, CH, FR, FH, mm.
    pub fn ranges_mm(self) -> [[f64; 2]; 4] {
        let cr = [1.0, 2.0];
        match self {
            CutterSet::Uniform => [cr, [0.1, 10.1], [5.0, 100.0], [0.1, 10.1]],
            CutterSet::Short => [cr, [0.1, 0.2], [80.0, 100.0], [0.1, 0.2]],
            CutterSet::Long => [cr, [10.0, 10.1], [5.0, 5.1], [10.0, 10.1]],
            CutterSet::Extreme => [cr, [20.0, 20.1], [5.0, 5.1], [20.0, 20.1]],
            CutterSet::Full => [cr, [0.1, 20.1], [5.0, 100.0], [0.1, 20.1]],
        }
    }

    /// One cutter of the set; takes four numbers from the stream.
    pub fn draw(self, stream: &mut Stream) -> CutterParams {
        CutterParams::from_array(self.ranges_mm().map(|[low, high]| stream.range(low, high)))
    }
}

impl fmt::Display for CutterSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Reads a [name](CutterSet::name).
impl FromStr for CutterSet {
    type Err = Error;

    /// # Errors
    /// If no set has it.
    fn from_str(name: &str) -> Result<Self> {
        CutterSet::ALL.into_iter().find(|set| set.name() == name).ok_or_else(|| {
            let expected = "uniform, short, long, extreme or full";
            Error::argument("cutter set", name, expected, "name one of these")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::Purpose;
    use crate::tool::cutter::Cutter;

    #[test]
    fn drawn_cutters_lie_in_their_ranges_and_are_valid() {
        for set in CutterSet::ALL {
            assert_eq!(set.name().parse::<CutterSet>().unwrap(), set);
            let mut stream = Stream::new(1, 0, 0, Purpose::Cutter);
            for _ in 0..100 {
                let params = set.draw(&mut stream);
                for ([low, high], length) in set.ranges_mm().into_iter().zip(params.to_array()) {
                    assert!((low..high).contains(&length));
                }
                Cutter::ball_end(params).unwrap();
            }
        }
        let message = "huge".parse::<CutterSet>().unwrap_err().to_string();
        assert!(message.contains("huge"), "{message}");
        assert!(CutterSet::ALL.iter().all(|set| message.contains(set.name())), "{message}");
    }
}
