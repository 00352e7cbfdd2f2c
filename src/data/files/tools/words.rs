//! The form of a tool from a remark: whole words count, whatever their case and what joins them.
//!
//! `4mm_2F_Compression_Carbide_Endmill` has the words 4mm, 2f, compression, carbide, endmill; `Drillpro` is no drill.

use super::described::{Cone, Family, Form};
use crate::geom::units::Length;

/// What a remark says of the form.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Remark {
    Form(Form),
    /// `end mill` and no more.
    EndMill,
    /// A kind that cannot be represented.
    Other(&'static str),
    /// A bull nose without its corner.
    Bull,
    Nothing,
}

const BALL: [&str; 6] = ["ball", "ballnose", "ballend", "ballmill", "ballendmill", "kugel"];
const FLAT: [&str; 4] = ["flat", "square", "flatend", "squareend"];
const BULL: [&str; 4] = ["bull", "bullnose", "torus", "bullend"];
const MILL: [&str; 3] = ["endmill", "slotdrill", "schaftfräser"];

/// Words, alone or two joined, that name what cannot be represented.
const OTHERS: [(&str, &str); 40] = [
    ("probe", "probe"),
    ("toucher", "probe"),
    ("spotdrill", "spot drill"),
    ("spot", "spot drill"),
    ("centerdrill", "center drill"),
    ("centredrill", "center drill"),
    ("centeringdrill", "center drill"),
    ("zentrierbohrer", "center drill"),
    ("drill", "drill"),
    ("drillbit", "drill"),
    ("bohrer", "drill"),
    ("tap", "tap"),
    ("vbit", "V-bit"),
    ("vcarve", "V-bit"),
    ("chamfer", "chamfer mill"),
    ("chamfermill", "chamfer mill"),
    ("countersink", "countersink"),
    ("engraver", "engraver"),
    ("engraving", "engraver"),
    ("engrave", "engraver"),
    ("reamer", "reamer"),
    ("lollipop", "lollipop"),
    ("dovetail", "dovetail"),
    ("thread", "thread mill"),
    ("threadmill", "thread mill"),
    ("saw", "saw"),
    ("facemill", "face mill"),
    ("shellmill", "face mill"),
    ("flycutter", "fly cutter"),
    ("tslot", "T-slot mill"),
    ("taper", "tapered mill"),
    ("tapered", "tapered mill"),
    ("conical", "tapered mill"),
    ("rounding", "corner rounding mill"),
    ("woodruff", "key seat cutter"),
    ("keyseat", "key seat cutter"),
    ("undercut", "undercutting mill"),
    ("laser", "laser"),
    ("drag", "drag knife"),
    ("knife", "knife"),
];

/// What a remark says; numbers without a unit are `bare_mm` millimeters.
pub(super) fn remark(text: &str, bare_mm: f64) -> Remark {
    let words = words(text);
    let has = |known: &[&str]| known.iter().any(|known| is_among(known, &words));
    // A slot drill is an end mill.
    let is_slot_drill = is_among("slotdrill", &words);
    let other = OTHERS.iter().find(|(word, _)| is_among(word, &words));
    let point = other.filter(|_| !is_slot_drill).and_then(|(_, kind)| pointed(kind, text));
    if let Some(form) = point {
        return Remark::Form(form);
    }
    if let Some((_, other)) = other.filter(|(_, kind)| !(is_slot_drill && *kind == "drill")) {
        return Remark::Other(other);
    }
    match [has(&BALL), has(&BULL), has(&FLAT)] {
        [true, false, false] => Remark::Form(Form::Ball),
        [false, true, false] => match corner(text, bare_mm) {
            Some(corner) => Remark::Form(Form::Bull { corner }),
            None => Remark::Bull,
        },
        [false, false, true] => Remark::Form(Form::Flat),
        [false, false, false] if has(&MILL) => Remark::EndMill,
        _ => Remark::Nothing,
    }
}

/// Whether a kind of the list of others is given by the angle of its point.
pub(super) fn is_pointed(kind: &str) -> bool {
    kind == "drill" || Cone::named(kind).is_some()
}

/// A pointed cone or a drill, if the remark has its angle: `V-bit 90°`, `drill 118 deg`; or a reamer. Of a chamfer mill
/// 45° are those of one side and 90° those of both; others may be either.
fn pointed(kind: &str, text: &str) -> Option<Form> {
    if kind == "reamer" {
        return Some(Form::Family(Family::Reamer));
    }
    if kind == "drill" {
        let angle = 0.5 * degrees(text)?.to_radians();
        return Some(Form::Family(Family::Drill { angle }));
    }
    let kind = Cone::named(kind)?;
    let degrees = degrees(text)?;
    let per_side = match kind {
        Cone::Chamfer if degrees == 45.0 || degrees == 90.0 => 45.0,
        Cone::Chamfer => return None,
        _ => 0.5 * degrees,
    };
    Some(Form::Family(Family::Cone { kind, tip: 0.0, angle: per_side.to_radians() }))
}

/// `90°`, `90 deg`, `90-degree`: a number before the word.
fn degrees(text: &str) -> Option<f64> {
    let lower = text.to_lowercase();
    let at = lower.find('°').or_else(|| lower.find("deg"))?;
    let before = lower[..at].trim_end_matches([' ', '-', '_']);
    let is_digit = |c: char| c.is_ascii_digit() || c == '.';
    let number = before.rsplit(|c| !is_digit(c)).next()?;
    number.parse().ok().filter(|degrees| *degrees > 0.0 && *degrees < 180.0)
}

/// Words in small letters; `BallEndmill` has two.
fn words(text: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut last = ' ';
    for c in text.chars() {
        let begins = !c.is_alphanumeric() || last.is_lowercase() && c.is_uppercase();
        if begins {
            words.push(String::new());
        }
        if c.is_alphanumeric() {
            words.last_mut().expect("never empty").extend(c.to_lowercase());
        }
        last = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Whether a word is there, alone or made of two; a plural is the same word.
fn is_among(known: &str, words: &[String]) -> bool {
    let is = |word: &str| word == known || word.strip_suffix('s') == Some(known);
    words.iter().any(|word| is(word)) || words.windows(2).any(|pair| is(&pair.concat()))
}

/// `r1`, `R0.5`, `R=0.5`, `R1/16"`: a word of the letter and a length.
fn corner(text: &str, bare_mm: f64) -> Option<f64> {
    let words = text.split(|c: char| c.is_whitespace() || c == '_');
    let lengths = words.filter_map(|word| word.strip_prefix(['r', 'R']));
    let length = |word: &str| {
        Length::read(word.trim_start_matches(['=', ':']).trim_end_matches([',', ')', ';']))
    };
    let corner = lengths.filter_map(length).next()?.mm_of(bare_mm);
    (corner > 0.0).then_some(corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_words_name_the_form() {
        let bull = |corner| Remark::Form(Form::Bull { corner });
        let cone = |kind, degrees: f64| {
            let angle = degrees.to_radians();
            Remark::Form(Form::Family(Family::Cone { kind, tip: 0.0, angle }))
        };
        for (text, expected) in [
            ("6mm ball end", Remark::Form(Form::Ball)),
            ("6mmBallnose", Remark::Form(Form::Ball)),
            ("BALL-NOSE 1/4", Remark::Form(Form::Ball)),
            ("Kugelfräser", Remark::Nothing),
            ("flat_endmill", Remark::Form(Form::Flat)),
            ("Square end", Remark::Form(Form::Flat)),
            ("bull r1", bull(1.0)),
            ("Bull-nose R0.5, long", bull(0.5)),
            ("bull nose R1/16\"", bull(1.5875)),
            ("Bull nose R=0.5", bull(0.5)),
            ("bull", Remark::Bull),
            ("4mm_2F_Compression_Carbide_Endmill", Remark::EndMill),
            ("Banggood - 3.175x2mm Carbide End Mill Drillpro DB-M10", Remark::EndMill),
            ("slot drill 6mm", Remark::EndMill),
            ("tapas", Remark::Nothing),
            ("Ballard flats", Remark::Form(Form::Flat)),
            ("2 drills", Remark::Other("drill")),
            ("Drill 5", Remark::Other("drill")),
            ("center drill 60 deg", Remark::Other("center drill")),
            ("Centre-drill #3", Remark::Other("center drill")),
            ("Zentrierbohrer A2.5", Remark::Other("center drill")),
            (
                "drill, center 118 deg",
                Remark::Form(Form::Family(Family::Drill { angle: 59f64.to_radians() })),
            ),
            ("V-bit", Remark::Other("V-bit")),
            ("face mill 50", Remark::Other("face mill")),
            ("t-slot", Remark::Other("T-slot mill")),
            ("tapered ball", Remark::Other("tapered mill")),
            ("V-bit 60°", cone(Cone::VBit, 30.0)),
            ("90 deg engraver, 0.1", cone(Cone::Engraver, 45.0)),
            ("spot drill 120-degree", cone(Cone::SpotDrill, 60.0)),
            ("chamfer 45°", cone(Cone::Chamfer, 45.0)),
            ("chamfer mill 90°", cone(Cone::Chamfer, 45.0)),
            ("chamfer mill 60°", Remark::Other("chamfer mill")),
            ("V-bit deg", Remark::Other("V-bit")),
            ("V-bit 190°", Remark::Other("V-bit")),
            ("ball or flat", Remark::Nothing),
            (" - ", Remark::Nothing),
        ] {
            assert_eq!(remark(text, 1.0), expected, "{text}");
        }
        assert_eq!(remark("bull r0.0625", 25.4), bull(1.5875));
    }
}
