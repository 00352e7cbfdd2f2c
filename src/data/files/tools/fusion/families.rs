//! Families of Fusion 360 beside end mills, as profiles. Lengths are those of its tool editor: `docs/tool-families.md`.

use super::{Geometry, SAME, Spelling};
use crate::data::files::tools::described::{CENTER_RAD, Cone, Family, Form, round};
use crate::tool::cutter::Crest;
use crate::{Error, Result};
use std::f64::consts::FRAC_PI_2;

/// Whether tools of this type are read.
pub(super) fn is_known(kind: &str) -> bool {
    const KNOWN: [&str; 27] = [
        "ball end mill",
        "flat end mill",
        "bull nose end mill",
        "tapered mill",
        "lollipop mill",
        "slot mill",
        "dovetail mill",
        "chamfer mill",
        "corner chamfer end mill",
        "radius mill",
        "face mill",
        "counter bore",
        "counter sink",
        "spot drill",
        "engraving",
        "engraving cutter",
        "engrave mill",
        "thread mill",
        "form mill",
        "circle segment barrel",
        "circle segment lens",
        "circle segment oval",
        "circle segment taper",
        "dovetail",
        "drill",
        "center drill",
        "reamer",
    ];
    KNOWN.contains(&kind)
}

impl Geometry<'_> {
    /// The form of a kind that [`is_known`] and no end mill, and the diameter that it is about.
    pub(super) fn family(&self, kind: &str, corner: f64, diameter: f64) -> Result<(Form, f64)> {
        let family = match kind {
            "lollipop mill" => Family::Lollipop,
            "slot mill" => Family::Slot { corner },
            "dovetail mill" | "dovetail" => self.dovetail(corner, diameter)?,
            "chamfer mill" => self.cone(Cone::Chamfer, self.per_side()?)?,
            "drill" => Family::Drill { angle: self.of_point()? },
            "center drill" => self.center_drill()?,
            "reamer" => Family::Reamer,
            "corner chamfer end mill" => self.corner_chamfer(diameter)?,
            "counter sink" => self.cone(Cone::Countersink, self.of_point()?)?,
            "spot drill" => self.cone(Cone::SpotDrill, self.of_point()?)?,
            "counter bore" => return self.head("counterbore", 0.0, diameter),
            "face mill" => return self.face_mill(corner, diameter),
            "radius mill" => return self.radius_mill(corner, diameter),
            "thread mill" => self.thread_mill(diameter)?,
            "circle segment barrel" => {
                let [arc, lower] = [self.arc()?, self.lower(corner)?];
                let upper = self.or_none("upper-radius")?;
                let center = self.positive("axial-distance")?;
                Family::Barrel { arc, center, corners: [lower, upper] }
            }
            "circle segment lens" => {
                let cap = match self.positive("lower-radius")? {
                    Some(cap) => cap,
                    None => self.arc()?,
                };
                Family::Lens { cap, corner }
            }
            "circle segment oval" => self.oval(corner, diameter)?,
            "circle segment taper" => Family::TaperedBarrel {
                tip: self.or_none("tip-diameter")?,
                arc: self.arc()?,
                angle: self.per_side()?,
                corners: [self.lower(corner)?, self.or_none("upper-radius")?],
            },
            // Those that are left engrave.
            _ => self.cone(Cone::Engraver, self.per_side()?)?,
        };
        Ok((Form::Family(family), diameter))
    }

    fn or_none(&self, key: &'static str) -> Result<f64> {
        Ok(self.length(key)?.unwrap_or(0.0))
    }

    fn arc(&self) -> Result<f64> {
        let missing = || self.missing("profile-radius", "radius of the flank's arc");
        self.positive("profile-radius")?.ok_or_else(missing)
    }

    /// Radius of the corner or ball below.
    fn lower(&self, corner: f64) -> Result<f64> {
        Ok(self.positive("lower-radius")?.unwrap_or(corner))
    }

    /// Angle between flank and axis, radians.
    pub(super) fn per_side(&self) -> Result<f64> {
        self.angle("TA")?.ok_or_else(|| self.missing("TA", "taper angle per side"))
    }

    fn angle(&self, key: &'static str) -> Result<Option<f64>> {
        let degrees = self.number(key)?.filter(|x| *x > 0.0);
        Ok(degrees.map(f64::to_radians))
    }

    /// Half of the angle of the whole point; some files have the angle per side in its place.
    fn of_point(&self) -> Result<f64> {
        if let Some(whole) = self.angle("SIG")? {
            return Ok(0.5 * whole);
        }
        self.angle("TA")?.ok_or_else(|| self.missing("SIG", "angle of the point"))
    }

    /// Of both points the file has the whole angle; `.hsmlib` files name them alike: the blunter is the pilot's.
    fn center_drill(&self) -> Result<Family> {
        let needed = |key: &'static str, what: &str| {
            self.positive(key)?.ok_or_else(|| self.missing(key, what))
        };
        let stated = match self.spelling {
            Spelling::Json => [self.angle("SIG")?, self.angle("TA")?],
            Spelling::Xml => match [self.angle("SIG")?, self.angle("TA2")?] {
                [Some(a), Some(b)] => [Some(a.max(b)), Some(a.min(b))],
                one => one,
            },
        };
        let [point, countersink] = stated;
        let point = point.ok_or_else(|| self.missing("SIG", "angle of the pilot's point"))?;
        let countersink = countersink.unwrap_or(2.0 * CENTER_RAD[0]);
        if countersink < LEAST_COUNTERSINK_DEG.to_radians() {
            let degrees = round(countersink.to_degrees());
            let found = format!("a countersink of {degrees}°, the whole angle, on a center drill");
            return Err(self.place.error(found, "give the angle between its flanks: 60° for most"));
        }
        Ok(Family::CenterDrill {
            pilot: needed("tip-diameter", "diameter of the pilot")?,
            length: needed("tip-length", "length of the pilot")?,
            point: 0.5 * point,
            angle: 0.5 * countersink,
        })
    }

    /// What was taken for an angle that the file does not say.
    pub(super) fn assumed(&self, kind: &str) -> Option<String> {
        let key = if self.spelling == Spelling::Json { "TA" } else { "TA2" };
        let is_said = kind != "center drill" || self.angle(key).is_ok_and(|x| x.is_some());
        let key = self.key(key);
        (!is_said).then(|| {
            self.place.sentence(format!("its {key} is missing: a countersink of 60° counts"))
        })
    }

    fn cone(&self, kind: Cone, angle: f64) -> Result<Family> {
        Ok(Family::Cone { kind, tip: self.or_none("tip-diameter")?, angle })
    }

    /// The width is radial, the angle from the face below.
    fn corner_chamfer(&self, diameter: f64) -> Result<Family> {
        let width = self.positive("chamfer-width")?;
        let width = width.ok_or_else(|| self.missing("chamfer-width", "width of the chamfer"))?;
        let angle = self.angle("chamfer-angle")?;
        let angle = angle.ok_or_else(|| self.missing("chamfer-angle", "angle of the chamfer"))?;
        let tip = diameter - 2.0 * width;
        if tip < 0.0 {
            let found = format!("a chamfer-width of {width} mm on a DC of {diameter} mm");
            return Err(self.place.error(found, "the chamfer fits into the radius: correct one"));
        }
        Ok(Family::Cone { kind: Cone::CornerChamfer, tip, angle: FRAC_PI_2 - angle })
    }

    /// A cylinder; where nothing above it is thinner, a flat or bull nose end mill.
    fn head(&self, kind: &'static str, corner: f64, diameter: f64) -> Result<(Form, f64)> {
        let above = [self.positive("shoulder-diameter")?, self.positive("SFDM")?];
        let is_thinner = |above: &f64| *above < diameter * (1.0 - SAME);
        let form = match above.iter().flatten().any(is_thinner) {
            true => Form::Family(Family::Head { kind, corner }),
            false if corner > 0.0 => Form::Bull { corner },
            false => Form::Flat,
        };
        Ok((form, diameter))
    }

    /// `DC` is the cone's diameter at the height of the tip, `DCX` the greatest.
    fn face_mill(&self, corner: f64, lower: f64) -> Result<(Form, f64)> {
        let Some(angle) = self.angle("TA")? else {
            return self.head("face mill", corner, lower);
        };
        let diameter = match self.positive("DCX")?.filter(|most| *most > lower * (1.0 + SAME)) {
            Some(most) => most,
            None => {
                let flutes = self.positive("LCF")?;
                let flutes = flutes.ok_or_else(|| self.missing("DCX", "greatest diameter"))?;
                lower + 2.0 * flutes * libm::tan(angle)
            }
        };
        let corners = [corner, self.or_none("upper-radius")?];
        Ok((Form::Family(Family::FaceMill { lower, angle, corners }), diameter))
    }

    /// `DC` is the tip's diameter; where `tip-diameter` says so, the greatest.
    fn radius_mill(&self, arc: f64, stated: f64) -> Result<(Form, f64)> {
        if arc <= 0.0 {
            return Err(self.missing("RE", "radius of the arc"));
        }
        let inner = stated - 2.0 * arc;
        let is_inner = |tip: &f64| *tip > 0.0 && (tip - inner).abs() <= SAME * stated;
        let (tip, diameter) = match self.length("tip-diameter")?.filter(is_inner) {
            Some(tip) => (tip, stated),
            None => (stated, stated + 2.0 * arc),
        };
        let tip_height = self.or_none("tip-length")?;
        Ok((Form::Family(Family::Rounding { tip, tip_height, arc }), diameter))
    }

    /// Files measure the angle from the axis or from the face below: the flank must end at the shoulder.
    fn dovetail(&self, corner: f64, diameter: f64) -> Result<Family> {
        let flutes = self.positive("LCF")?.ok_or_else(|| self.missing("LCF", "flute length"))?;
        let neck = self.positive("shoulder-diameter")?;
        let neck = neck.ok_or_else(|| self.missing("shoulder-diameter", "diameter of the neck"))?;
        let stated = self.per_side()?;
        // Where the flank would begin without a corner.
        let lower = |angle: f64| {
            let (cos, sin) = (libm::cos(angle), libm::sin(angle));
            diameter - 2.0 * corner + 2.0 * corner * (1.0 + sin) / cos
        };
        let top = |angle: f64| lower(angle) - 2.0 * flutes * libm::tan(angle);
        let other = FRAC_PI_2 - stated;
        let is_possible = |angle: f64| top(angle) >= neck * (1.0 - SAME);
        let family = |angle: f64| Ok(Family::Dovetail { angle, corner });
        match [stated, other].map(is_possible) {
            [true, false] => family(stated),
            [false, true] => family(other),
            [true, true] if (top(stated) - neck).abs() <= SAME * diameter => family(stated),
            [true, true] if (top(other) - neck).abs() <= SAME * diameter => family(other),
            both => {
                let (degrees, ta) = (stated.to_degrees(), self.key("TA"));
                let found = match both[0] {
                    true => format!("{ta} {degrees}° may be from the axis or from the face below"),
                    false => {
                        format!("with {ta} {degrees}° the flank ends below its neck of {neck} mm")
                    }
                };
                let [dc, lcf] = [self.key("DC"), self.key("LCF")];
                let remedy = format!("correct {dc}, {lcf}, {ta} or shoulder-diameter");
                Err(self.place.error(found, remedy))
            }
        }
    }

    /// A ball below; where its radius is not there, the length of the flutes says it.
    fn oval(&self, corner: f64, diameter: f64) -> Result<Family> {
        let arc = self.arc()?;
        let tip = self.lower(corner)?;
        if tip > 0.0 {
            return Ok(Family::Oval { arc, tip });
        }
        let flutes = self.positive("LCF")?;
        let flutes = flutes.ok_or_else(|| self.missing("lower-radius", "radius of the tip"))?;
        // The tip is tangent to the arc, which is vertical where the flutes end.
        let aside = arc - 0.5 * diameter;
        let tip = (arc * arc - aside * aside - flutes * flutes) / (2.0 * (arc - flutes));
        if tip > 0.0 && tip < 0.5 * diameter {
            return Ok(Family::Oval { arc, tip });
        }
        Err(self.missing("lower-radius", "radius of the tip"))
    }

    /// Rings one `TP` apart, `NT` of them as far as they fit into `LCF`. Their roots follow from the pitch, or are as
    /// wide as the neck where no pitch is stated.
    fn thread_mill(&self, diameter: f64) -> Result<Family> {
        let half = self.angle("thread-profile-angle")?.map(|whole| 0.5 * whole);
        let half = half.filter(|half| *half < FRAC_PI_2);
        let missing = || self.missing("thread-profile-angle", "angle of the thread");
        let half = half.ok_or_else(missing)?;
        let teeth = self.number("NT")?.unwrap_or(1.0).clamp(1.0, MOST_TEETH).floor();
        let crest = match self.word("thread-tip-type") {
            Some("flat") => Crest::Flat(self.or_none("thread-tip-width")?),
            Some("round") => Crest::Round(self.or_none("thread-tip-radius")?),
            _ => Crest::Flat(0.0),
        };
        let [Some(pitch), flutes] = [self.positive("TP")?, self.positive("LCF")?] else {
            let neck = self.positive("shoulder-diameter")?.filter(|_| teeth == 1.0);
            let root = neck.ok_or_else(|| self.missing("TP", "pitch of the thread"))?;
            return Ok(Family::Thread { angle: half, crest, root, pitch: 0.0, n_rings: 1 });
        };
        let fitting = flutes.map_or(teeth, |flutes| (flutes / pitch + SAME).floor().min(teeth));
        if fitting < 1.0 {
            let [tp, lcf] = [self.key("TP"), self.key("LCF")];
            let found = format!("a pitch {tp} of {pitch} mm does not fit into the flutes");
            return Err(self.place.error(found, format!("correct {tp} or {lcf}")));
        }
        let root = diameter - 2.0 * depth(half, pitch, crest, teeth == 1.0);
        Ok(Family::Thread { angle: half, crest, root, pitch, n_rings: fitting as usize })
    }

    fn word(&self, key: &str) -> Option<&str> {
        self.geometry.get(key).and_then(serde_json::Value::as_str)
    }

    pub(super) fn number(&self, key: &'static str) -> Result<Option<f64>> {
        self.place.number(self.geometry, self.key(key))
    }

    pub(super) fn missing(&self, key: &'static str, what: &str) -> Error {
        let key = self.key(key);
        self.place.error(
            format!("{key}, the {what}, is missing or 0"),
            "add it where the tool was made, and export again",
        )
    }
}

/// From crest to root: a flat crest is as wide as the root is, of several rings; a round one has round roots. Those
/// count from where the flank ends, so that the tool is nowhere thinner than it is.
fn depth(half: f64, pitch: f64, crest: Crest, is_single: bool) -> f64 {
    let (sin, cot) = (libm::sin(half), 1.0 / libm::tan(half));
    match crest {
        Crest::Flat(width) if is_single => 0.5 * (pitch - width) * cot,
        Crest::Flat(width) => (0.5 * pitch - width) * cot,
        Crest::Round(radius) if is_single => 0.5 * pitch * cot - radius * (1.0 / sin - 1.0),
        Crest::Round(radius) => {
            0.5 * pitch * cot - 2.0 * radius * (1.0 / sin - 1.0) - radius * (1.0 - sin)
        }
    }
}

/// No center drill has less: it is half of an angle.
const LEAST_COUNTERSINK_DEG: f64 = 45.0;
/// No thread mill has more.
const MOST_TEETH: f64 = 64.0;
