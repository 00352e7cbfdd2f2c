//! Pictures of how much is left.

use super::{Shown, Writer, point_values, setup};
use crate::Result;
use crate::data::files::LabelFile;
use crate::findings::gate::SiteAreas;
use crate::report::{Class, Coloring};
use std::path::PathBuf;

/// Upper ends of the bands, mm, but for the last.
const ENDS_MM: [f32; 7] = [0.001, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0];

/// Gray where nothing is left, then from pale yellow to dark violet: the more, the darker.
pub(crate) const CLASSES: [Class<'static>; 8] = [
    Class { name: "nothing left", color: [205, 208, 212] },
    Class { name: "up to 0.05 mm", color: [252, 236, 170] },
    Class { name: "to 0.1 mm", color: [253, 204, 110] },
    Class { name: "to 0.25 mm", color: [248, 162, 70] },
    Class { name: "to 0.5 mm", color: [233, 113, 60] },
    Class { name: "to 1 mm", color: [205, 66, 66] },
    Class { name: "to 2 mm", color: [154, 40, 90] },
    Class { name: "more than 2 mm", color: [92, 24, 100] },
];

/// Of each rest, mm, its band.
pub(crate) fn bands(rests: &[f32]) -> Vec<usize> {
    rests.iter().map(|rest| ENDS_MM.partition_point(|end| end < rest)).collect()
}

/// Writes `rest.ply` and, if wanted, `rest.png`.
pub(super) fn write(writer: &Writer, file: &LabelFile, rests: &[f32]) -> Result<Vec<PathBuf>> {
    let of = bands(rests);
    let areas = SiteAreas::of(&file.sites, None)?;
    let coloring = Coloring::Groups { classes: &CLASSES, of: &of, areas: areas.shares() };
    let values = point_values(&file.labels.answers, rests.len());
    let caption = format!("how much the tool leaves\n{}", setup(&file.provenance));
    let notes =
        ["rest: distance along the normal to the surface of what the tool leaves, mm".into()];
    writer.write("rest", &Shown { caption: &caption, coloring, values: &values, notes: &notes })
}
