//! Machines in files of results: checked when they are read, and the same to the last bit.

use super::{Carrier, Kinematics, RotaryAxis, RotaryParams};
use glam::DVec3;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
pub(super) struct Stated {
    name: String,
    axes: Vec<StatedAxis>,
    /// None where it is not known.
    strokes_mm: [Option<f64>; 3],
}

#[derive(Serialize, Deserialize)]
struct StatedAxis {
    letter: char,
    on_table: bool,
    about: DVec3,
    limits_deg: Option<[f64; 2]>,
}

/// A unit vector in a file is as near to one as this.
const UNIT: f64 = 1e-9;

impl From<Kinematics> for Stated {
    fn from(of: Kinematics) -> Self {
        let axis = |RotaryAxis { letter, on, about, limits_deg }| StatedAxis {
            letter,
            on_table: on == Carrier::Table,
            about,
            limits_deg: Some(limits_deg).filter(|limits: &[f64; 2]| limits[0].is_finite()),
        };
        Stated {
            name: of.name,
            axes: of.axes.into_iter().map(axis).collect(),
            strokes_mm: of.strokes_mm.to_array().map(|mm| Some(mm).filter(|mm| mm.is_finite())),
        }
    }
}

impl TryFrom<Stated> for Kinematics {
    type Error = String;

    fn try_from(Stated { name, axes, strokes_mm }: Stated) -> Result<Self, String> {
        let about: Vec<DVec3> = axes.iter().map(|axis| axis.about).collect();
        let params = axes.into_iter().map(|axis| RotaryParams {
            letter: axis.letter,
            on: if axis.on_table { Carrier::Table } else { Carrier::Head },
            axis: axis.about.to_array(),
            limits_deg: axis.limits_deg,
        });
        let checked = Kinematics::new(&name, params.collect()).map_err(|fault| fault.found)?;
        if let Some(vector) = about.iter().find(|v| (v.length() - 1.0).abs() > UNIT) {
            return Err(format!("the vector {vector} is not of unit length"));
        }
        if let Some(mm) = strokes_mm.iter().flatten().find(|mm| !(**mm > 0.0 && mm.is_finite())) {
            return Err(format!("a stroke of {mm} mm"));
        }
        // Another division by the length would change the last bit; that of a table is opposite.
        let exact = |(axis, about): (RotaryAxis, DVec3)| RotaryAxis { about, ..axis };
        let axes = checked.axes.into_iter().zip(about).map(exact).collect();
        let strokes = strokes_mm.map(|mm| mm.unwrap_or(f64::INFINITY));
        Ok(Kinematics { name: checked.name, axes, strokes_mm: DVec3::from_array(strokes) })
    }
}
