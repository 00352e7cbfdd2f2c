//! What the arrays of labels mean, in the words of their metadata.

use crate::tool::cutter::CutterParams;
use serde_json::{Value, json};

pub(super) const RETREAT_UNPROVEN: &str = "true: a pose of the tool is free there, but no retreat from one is proven; of tools given by a profile, whose directions are not counted";
const BLOCKED_BY: &str = "part of the tool that blocks in the direction which gets furthest: 0 none (accessible), 1 tip, 2 cutter, 3 shank, 4 holder, 5 spindle";

pub(super) fn label_meaning(part_itself: bool) -> Value {
    if part_itself {
        return json!({
            "definition": "mesh definition: the part's triangles are the obstacles, the tool is shrunk by the tolerance",
            "inaccessible": "true: in every direction the shank, holder or spindle penetrates the part (positive class)",
            "tip_does_not_fit": "true: in some direction only the tip penetrates the part, in none nothing does",
            "collision_free_directions": "number of the directions tested in which no shank, holder or spindle penetrates the part",
            "accessible_directions": "number of these in which the tip fits too; 0 beside an accessible site: a direction between them was found",
            "witness_direction": "unit vector from tip to spindle of a free pose, 0 0 0 if there is none",
            "witness_tip": "lowest point of the tool on its axis in that pose, mm",
            "open_directions": "of a site that is not accessible, the share of directions not proven closed; 0: the answer holds for all directions",
            "tolerance": "gouge tolerance, mm",
            "rests_on_tolerance": "true: accessible by a gouge tolerance above 0.05 mm alone; left out if no site is",
            "clearance": "how far the margin about what does not cut may grow before the site becomes inaccessible, mm; negative: how far all steps must shrink",
            "rest": "how much the tool leaves: distance along the normal to the surface of what it leaves, mm; 0 where accessible; never less than what the pose beside it leaves",
            "rest_volume": "volume of what is left nearer to the site than to other places of the part, mm³",
            "rest_direction": "unit vector from tip to spindle of the pose that leaves least, 0 0 0 if nothing is removed there or the site is accessible",
            "rest_tip": "lowest point of the tool on its axis in that pose, mm",
            "blocked_by": BLOCKED_BY,
            "occlusion": "true: among the sites most often in the way of inaccessible ones (positive class)",
            "beta": "pairs (inaccessible site, direction tested) in which this site is in the shrunk tool's steps",
            "witness": "-1: see witness_direction",
        });
    }
    json!({
        "definition": "the published definition: sites are the obstacles, contact below the ball's top is not tested",
        "inaccessible": "true: the cutter collides in every direction (positive class)",
        "occlusion": "true: among the sites most often in the way of inaccessible ones (positive class)",
        "beta": "pairs (inaccessible site, direction) in which this site collides with the cutter",
        "accessible_directions": "number of directions without collision",
        "witness": "index of the first direction without collision, -1 if there is none",
        "blocked_by": BLOCKED_BY,
        "clearance": "how far heights and radii of the steps may grow before the site becomes inaccessible, mm; negative: must shrink",
    })
}

/// `ball-end CR 1.5, CH 6, FR 40, FH 5 mm`.
pub fn ball_end_words(cutter: CutterParams) -> String {
    let [cr, ch, fr, fh] = cutter.to_array();
    format!("ball-end CR {cr}, CH {ch}, FR {fr}, FH {fh} mm")
}
