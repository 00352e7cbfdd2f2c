//! What objects and their pieces are for, as slicers write it beside the model.
//!
//! | who writes it | where | says its role |
//! |---|---|---|
//! | PrusaSlicer | `Slic3r_PE_model.config`: `volume`, triangles of an object's mesh | `volume_type`, once `modifier` |
//! | Bambu Studio, OrcaSlicer | `model_settings.config`: `part`, one of an object's components | `subtype` |
//! | Cura | the model: `metadata` of an object | `cura:infill_mesh` and others |

use super::super::one_line;
use super::Found;
use super::xml::{number, value};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use std::collections::HashMap;
use std::ops::RangeInclusive;

/// Files of the archive that hold roles.
pub(super) const FILES: [&str; 2] =
    ["Metadata/Slic3r_PE_model.config", "Metadata/model_settings.config"];
/// Most bytes of one of them.
pub(super) const MAX_BYTES: u64 = 16 << 20;

/// What a piece is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Role {
    /// Material.
    #[default]
    Solid,
    /// To be cut out of the others.
    Negative,
    /// No material: what it is instead.
    Other(&'static str),
}

impl Role {
    /// As slicers name volumes and parts, whatever the case and what joins the words.
    fn of_volume(name: &str) -> Found<Self> {
        let letters = name.chars().filter(char::is_ascii_alphanumeric);
        Ok(match letters.collect::<String>().to_lowercase().as_str() {
            "modelpart" | "normalpart" => Role::Solid,
            "negativevolume" | "negativepart" => Role::Negative,
            "parametermodifier" | "modifierpart" => Role::Other("a modifier"),
            "supportblocker" => Role::Other("a support blocker"),
            "supportenforcer" => Role::Other("a support enforcer"),
            _ => return Err(format!("the role {:?} is not known", one_line(name))),
        })
    }

    /// As the model types objects.
    pub(super) fn of_object(kind: Option<&str>) -> Found<Self> {
        Ok(match kind.map(str::trim) {
            None | Some("model") => Role::Solid,
            Some("support" | "solidsupport") => Role::Other("a support"),
            Some("surface") => Role::Other("a surface, no solid"),
            Some("other") => Role::Other("of type other, no solid"),
            Some(kind) => return Err(format!("the object type {:?} is not known", one_line(kind))),
        })
    }

    /// As Cura sets objects.
    pub(super) fn of_setting(name: &str) -> Option<Self> {
        match name.rsplit(':').next()? {
            "infill_mesh" | "cutting_mesh" => Some(Role::Other("a modifier")),
            "anti_overhang_mesh" => Some(Role::Other("a support blocker")),
            "support_mesh" => Some(Role::Other("a support")),
            _ => None,
        }
    }
}

/// A piece of an object.
#[derive(Debug, Clone, Default)]
pub(super) struct Piece {
    pub role: Role,
    pub name: Option<String>,
}

/// Triangles of an object's own mesh.
#[derive(Debug, Clone)]
pub(super) struct Volume {
    pub triangles: RangeInclusive<u32>,
    pub piece: Piece,
}

/// All that such files say.
#[derive(Debug, Default)]
pub(super) struct Roles {
    /// By object.
    pub volumes: HashMap<u32, Vec<Volume>>,
    /// By object and component.
    pub parts: HashMap<(u32, u32), Piece>,
}

/// What is being read.
#[derive(Default)]
struct Open {
    object: Option<u32>,
    volume: Option<RangeInclusive<u32>>,
    part: Option<u32>,
    piece: Piece,
}

impl Roles {
    pub(super) fn read(&mut self, text: &str) -> Found<()> {
        let mut xml = Reader::from_str(text);
        let mut open = Open::default();
        loop {
            match xml.read_event().map_err(one_line)? {
                Event::Start(tag) => open.begin(&tag)?,
                Event::Empty(tag) => {
                    open.begin(&tag)?;
                    self.end(tag.local_name().as_ref(), &mut open);
                }
                Event::End(tag) => self.end(tag.local_name().as_ref(), &mut open),
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    fn end(&mut self, name: &str, open: &mut Open) {
        let Some(object) = open.object else { return };
        match name {
            "object" => *open = Open::default(),
            "volume" => {
                if let Some(triangles) = open.volume.take() {
                    let piece = std::mem::take(&mut open.piece);
                    self.volumes.entry(object).or_default().push(Volume { triangles, piece });
                }
            }
            "part" => {
                if let Some(part) = open.part.take() {
                    self.parts.insert((object, part), std::mem::take(&mut open.piece));
                }
            }
            _ => {}
        }
    }
}

impl Open {
    fn begin(&mut self, tag: &BytesStart) -> Found<()> {
        match tag.local_name().as_ref() {
            "object" => *self = Open { object: number(tag, "id").ok(), ..Open::default() },
            "volume" => {
                let [first, last] = ["firstid", "lastid"].map(|name| number(tag, name));
                self.volume = Some(first?..=last?);
                self.piece = Piece::default();
            }
            "part" => {
                self.part = Some(number(tag, "id")?);
                let role = value(tag, "subtype").map(|name| Role::of_volume(&name));
                self.piece = Piece { role: role.transpose()?.unwrap_or_default(), name: None };
            }
            "metadata" if self.volume.is_some() || self.part.is_some() => self.metadata(tag)?,
            _ => {}
        }
        Ok(())
    }

    fn metadata(&mut self, tag: &BytesStart) -> Found<()> {
        let Some(text) = value(tag, "value") else { return Ok(()) };
        match value(tag, "key").as_deref() {
            Some("name") => self.piece.name = Some(text),
            Some("volume_type") => self.piece.role = Role::of_volume(&text)?,
            Some("modifier") if text.trim() == "1" => self.piece.role = Role::Other("a modifier"),
            _ => {}
        }
        Ok(())
    }
}
