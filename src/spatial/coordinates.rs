//! Points as one array per axis, padded for vector kernels.

/// Coordinates as three arrays, each padded to a multiple of [`PADDING`].
#[derive(Debug, Clone, Default)]
pub struct Coordinates {
    /// x, mm.
    pub x: Vec<f32>,
    /// y, mm.
    pub y: Vec<f32>,
    /// z, mm.
    pub z: Vec<f32>,
    /// Number of points without padding.
    pub n: usize,
}

/// Arrays of [`Coordinates`] have a length that is a multiple of this.
pub const PADDING: usize = 64;

impl Coordinates {
    /// `n` points at the origin, padding too.
    pub fn zeros(n: usize) -> Self {
        let zeros = vec![0.0; n.next_multiple_of(PADDING)];
        Coordinates { x: zeros.clone(), y: zeros.clone(), z: zeros, n }
    }

    /// Becomes `n` points long; what the places hold is unspecified.
    pub fn resize(&mut self, n: usize) {
        let len = n.next_multiple_of(PADDING);
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(len, 0.0);
        }
        self.n = n;
    }

    /// Point `i`.
    pub fn get(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }

    /// Puts `point` in place `i`.
    pub fn set(&mut self, i: usize, point: [f32; 3]) {
        [self.x[i], self.y[i], self.z[i]] = point;
    }

    /// Gives every place of the padding this height.
    pub fn pad_z(&mut self, z: f32) {
        self.z[self.n..].fill(z);
    }
}
