//! The demo's part: small, with one example of each kind of feature that is hard to reach.

use super::finish;
use super::outline::Outline;
use super::solid::Solid;
use crate::geom::Mesh;
use glam::DMat3;

/// A machined block of 100 × 70 × 40 mm, centered in x and y, standing on z = 0.
///
/// From left to right: a T-slot along y (an undercut), a pocket with filleted corners and a boss on
/// its floor, a deep narrow slot along x in front of it, a counterbored through hole behind, and a
/// step on the right.
pub fn demo_part() -> Mesh {
    let mut body = Solid::prism(&Outline::rounded(100.0, 70.0, 4.0), 0.0, 40.0);
    body -= Solid::block([-38.0, -40.0, 22.0], [-30.0, 40.0, 41.0]);
    body -= Solid::block([-44.0, -40.0, 14.0], [-24.0, 40.0, 23.0]);
    let boss = Solid::cylinder(6.0, 9.0, 24.0).at(2.0, 10.0, 0.0);
    let pocket = Solid::prism(&Outline::rounded(40.0, 38.0, 7.0).at(2.0, 10.0), 16.0, 41.0);
    body -= pocket - boss;
    body -= Solid::prism(&Outline::oblong(56.0, 3.5).at(12.0, -22.0), 8.0, 41.0);
    body -= Solid::block([40.0, -36.0, 26.0], [51.0, 36.0, 41.0]);
    body -= Solid::cylinder(4.5, -1.0, 41.0).at(32.0, 14.0, 0.0);
    body -= Solid::cylinder(7.5, 31.0, 41.0).at(32.0, 14.0, 0.0);
    body -= Solid::cylinder(3.0, -1.0, 5.0).along_x().at(46.0, 0.0, 12.0);
    finish::finish(&body, &DMat3::IDENTITY).expect("the demo part is one sound body")
}
