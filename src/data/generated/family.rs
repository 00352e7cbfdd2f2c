//! The list of families of generated parts.

use super::solid::Solid;
use super::*;
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

macro_rules! families {
    ($($variant:ident $name:literal $recipe:path, $text:literal;)*) => {
        /// A recipe for parts with random sizes.
        ///
        /// The order decides the random streams: add at the end only.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Family {
            $(#[doc = $text] $variant,)*
        }

        impl Family {
            /// Every family, in order.
            pub const ALL: &'static [Family] = &[$(Family::$variant),*];

            /// Name in lower case with underscores, as `deepmill generate --family` takes it.
            pub fn name(self) -> &'static str {
                match self { $(Family::$variant => $name,)* }
            }

            /// One line for people.
            pub fn description(self) -> &'static str {
                match self { $(Family::$variant => $text,)* }
            }

            /// One solid as drawn; not yet checked.
            pub(super) fn draw(self, random: &mut Stream) -> Solid {
                match self { $(Family::$variant => $recipe(random),)* }
            }
        }
    };
}

families! {
    PocketBlock "pocket_block" blocks::pocket_block, "Block with filleted pockets, islands and holes.";
    StepPlate "step_plate" blocks::step_plate, "Plate with steps cut from its sides and counterbored holes.";
    Fixture "fixture" blocks::fixture, "Base plate with a grid of holes, stops and pins.";
    AngledSlots "angled_slots" blocks::angled_slots, "Block with slots that enter aslant.";
    LipPocket "lip_pocket" blocks::lip_pocket, "Block with cavities wider than their mouths.";
    TSlot "t_slot" grooves::t_slot, "Table with T-slots, some crossing.";
    Dovetail "dovetail" grooves::dovetail, "Slide with dovetail grooves or ridges.";
    Rail "rail" grooves::rail, "Extruded profile with a T-groove on each side.";
    Rack "rack" grooves::rack, "Toothed rack with mounting holes.";
    Gear "gear" wheels::gear, "Spur, helical or ring gear with hub, web and keyway.";
    Cam "cam" wheels::cam, "Cam disc with hub, some with a face groove.";
    Scroll "scroll" wheels::scroll, "Spiral wall on a disc.";
    Twisted "twisted" freeform::twisted, "Column over a polygon or star, twisted and tapered.";
    Knot "knot" freeform::knot, "Ring, wavy ring or torus knot with a fluted section.";
    RandomBodies "random_bodies" freeform::random_bodies, "Boxes, cylinders, cones, balls and rings, united and cut at random.";
    GridPanel "grid_panel" plates::grid_panel, "Panel of pockets between thin ribs, some under flanges.";
    Terraces "terraces" plates::terraces, "Lobed steps, raised or sunk.";
    Maze "maze" plates::maze, "Winding channel, some of it under a lid.";
    HeatSink "heat_sink" plates::heat_sink, "Thin fins or posts on a base.";
    Lattice "lattice" plates::lattice, "Frame of struts with windows along two or three axes.";
    Manifold "manifold" plates::manifold, "Block with deep bores that meet inside.";
    CylinderBlock "cylinder_block" plates::cylinder_block, "Bores with narrow water jackets.";
    Engraved "engraved" plates::engraved, "Plate with signs, cut or proud.";
    DomeBlock "dome_block" relief::dome_block, "Block with a curved top, holes, pockets and slots.";
    Mold "mold" relief::mold, "Mold half with cavity, gate and guide pins.";
    Lump "lump" relief::lump_with_cuts, "Smooth lump with flat base, bores and pockets.";
    Superquadric "superquadric" relief::superquadric, "Rounded box to spindle, with bores.";
    AngleBracket "angle_bracket" brackets::angle_bracket, "Two plates at a right angle with ribs and holes.";
    UBracket "u_bracket" brackets::u_bracket, "Channel with a cross bore.";
    Clevis "clevis" brackets::clevis, "Fork with a cross bore and a shank.";
    Conrod "conrod" brackets::conrod, "Connecting rod with an I-shaped beam.";
    Lever "lever" brackets::lever, "Arms and bosses around a hub.";
    Hook "hook" brackets::hook, "Hook with an eye.";
    Gripper "gripper" brackets::gripper, "Two fingers with teeth on a palm.";
    Hinge "hinge" brackets::hinge, "Hinge leaf with knuckles and counterbores.";
    Flange "flange" turned::flange, "Pipe flange with filleted neck and bolt circle.";
    Pulley "pulley" turned::pulley, "V-belt pulley with web and keyway.";
    Shaft "shaft" turned::shaft, "Stepped shaft with grooves, keyway and bores.";
    Collar "collar" turned::collar, "Clamp collar with slit and screws.";
    Coupling "coupling" turned::coupling, "Jaw or beam coupling.";
    Collet "collet" turned::collet, "Cone with thin slits.";
    Knob "knob" turned::knob, "Lobed, domed knob with a blind bore.";
    Handwheel "handwheel" turned::handwheel, "Rim, spokes and keyed hub.";
    Impeller "impeller" blades::impeller, "Pump wheel, open or shrouded.";
    Blisk "blisk" blades::blisk, "Bladed disc, some with an outer ring.";
    TurbineBlade "turbine_blade" blades::turbine_blade, "Twisted blade on a shelf with a fir-tree root.";
    Propeller "propeller" blades::propeller, "Hub with two to five twisted blades.";
    Screw "screw" blades::screw, "Auger or rotor with one to four starts.";
    Enclosure "enclosure" shells::enclosure, "Open box with posts, ribs, slits and a port.";
    ClosedShell "closed_shell" shells::closed_shell, "Hollow box, drum or ball with windows only.";
    Vessel "vessel" shells::vessel, "Thin-walled vase, some with a handle.";
    Drum "drum" shells::drum, "Perforated drum with inner flanges.";
    PipeElbow "pipe_elbow" shells::pipe_elbow, "Bent pipe with bolted flanges.";
    ValveBody "valve_body" shells::valve_body, "Hollow belly with three flanged ports.";
    BearingHousing "bearing_housing" shells::bearing_housing, "Foot-mounted housing, bore wider inside.";
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Family {
    type Err = Error;

    fn from_str(name: &str) -> Result<Family> {
        Family::ALL.iter().copied().find(|f| f.name() == name).ok_or_else(|| {
            Error::argument(
                "family",
                name,
                "the name of a family",
                "one of `Family::ALL`; `deepmill generate --list` shows them",
            )
        })
    }
}
