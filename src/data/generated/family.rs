//! The list of families.

use super::solid::Solid;
use super::*;

macro_rules! families {
    ($($variant:ident $name:literal $recipe:path, $text:literal;)*) => {
        /// A recipe for parts with random sizes.
        ///
        /// The order decides the random streams: add at the end only.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
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
    TSlot "t_slot" blocks::t_slot, "Table with T-slots, some crossing.";
    Dovetail "dovetail" blocks::dovetail, "Slide with dovetail grooves or ridges.";
    Rail "rail" blocks::rail, "Extruded profile with a T-groove on each side.";
    Rack "rack" blocks::rack, "Toothed rack with mounting holes.";
    Gear "gear" wheels::gear, "Spur, helical or ring gear with hub, web and keyway.";
    Cam "cam" wheels::cam, "Cam disc with hub, some with a face groove.";
    Scroll "scroll" wheels::scroll, "Spiral wall on a disc.";
    Twisted "twisted" freeform::twisted, "Column over a polygon or star, twisted and tapered.";
    Knot "knot" freeform::knot, "Ring, wavy ring or torus knot with a fluted section.";
    RandomBodies "random_bodies" freeform::random_bodies, "Boxes, cylinders, cones, balls and rings, united and cut at random.";
}

impl Family {
    /// The family called `name`.
    pub fn named(name: &str) -> Option<Family> {
        Family::ALL.iter().copied().find(|f| f.name() == name)
    }
}
