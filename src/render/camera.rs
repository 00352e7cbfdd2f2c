//! Parallel projection of a part onto a rectangle of pixels.

use glam::{DMat3, DVec3};

/// An orthographic camera. Pixel `(x, y)` has its center at `(x + ½, y + ½)`, y downward.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    /// Rows: right, up, and toward the eye; orthonormal.
    axes: DMat3,
    /// Point seen at the middle of the image, mm.
    center: DVec3,
    /// Pixels per millimeter.
    pub scale: f64,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl Camera {
    /// A camera of unit scale that looks from `eye` toward the origin, +z up in the image.
    pub fn new(eye: DVec3, width: usize, height: usize) -> Self {
        let back = eye.normalize();
        let right = DVec3::Z.cross(back).normalize();
        let up = back.cross(right);
        let axes = DMat3::from_cols(right, up, back).transpose();
        Camera { axes, center: DVec3::ZERO, scale: 1.0, width, height }
    }

    /// Puts the middle of the points' outline at the middle of the image. Returns the greatest
    /// scale at which all of it is seen with `margin` pixels to spare.
    pub fn center_on(&mut self, points: impl Iterator<Item = DVec3>, margin: f64) -> f64 {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let p = self.axes * p;
            (lo, hi) = (lo.min(p), hi.max(p));
        }
        if !lo.is_finite() || !hi.is_finite() {
            return 1.0;
        }
        self.center = self.axes.transpose() * (0.5 * (lo + hi));
        let room = |pixels: usize, extent: f64| {
            (pixels as f64 - 2.0 * margin).max(1.0) / extent.max(f64::MIN_POSITIVE)
        };
        let scale = room(self.width, hi.x - lo.x).min(room(self.height, hi.y - lo.y));
        if scale.is_finite() && scale < 1e12 { scale } else { 1.0 }
    }

    /// Pixel coordinates, and in z the height toward the eye in millimeters.
    pub fn project(&self, p: DVec3) -> DVec3 {
        let q = self.axes * (p - self.center);
        let (w, h) = (self.width as f64, self.height as f64);
        DVec3::new(0.5 * w + q.x * self.scale, 0.5 * h - q.y * self.scale, q.z)
    }

    /// The point seen at pixel coordinates `x, y` at height `z`; inverse of [`Camera::project`].
    pub fn unproject(&self, x: f64, y: f64, z: f64) -> DVec3 {
        let (w, h) = (self.width as f64, self.height as f64);
        let q = DVec3::new((x - 0.5 * w) / self.scale, (0.5 * h - y) / self.scale, z);
        self.axes.transpose() * q + self.center
    }

    /// A direction in the camera's frame: right, up, toward the eye.
    pub fn turn(&self, direction: DVec3) -> DVec3 {
        self.axes * direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unproject_inverts_project_and_the_box_fits() {
        let corners = [DVec3::new(-1.0, 2.0, 3.0), DVec3::new(40.0, 5.0, -7.0)];
        let mut camera = Camera::new(DVec3::new(1.0, -1.2, 0.9), 300, 200);
        camera.scale = camera.center_on(corners.into_iter(), 10.0);
        for corner in corners {
            let p = camera.project(corner);
            assert!(p.x > 9.9 && p.x < 290.1 && p.y > 9.9 && p.y < 190.1, "{p}");
            assert!((camera.unproject(p.x, p.y, p.z) - corner).length() < 1e-12);
        }
        assert!(camera.turn(DVec3::Z).y > 0.0);
    }

    #[test]
    fn one_point_is_no_division_by_zero() {
        let mut camera = Camera::new(DVec3::new(1.0, -1.0, 1.0), 100, 100);
        assert_eq!(camera.center_on([DVec3::ONE].into_iter(), 5.0), 1.0);
        assert_eq!(camera.center_on(std::iter::empty(), 5.0), 1.0);
    }
}
