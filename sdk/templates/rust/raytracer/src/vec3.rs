//! Vectors and colours.

use std::ops::{Add, Index, Mul, Sub};

#[derive(Clone, Copy)]
pub struct Vec3(pub [f64; 3]);

impl Add for Vec3 {
    type Output = Vec3;
    fn add(self, b: Vec3) -> Vec3 {
        Vec3([self[0] + b[0], self[1] + b[1], self[2] + b[2]])
    }
}
impl Sub for Vec3 {
    type Output = Vec3;
    fn sub(self, b: Vec3) -> Vec3 {
        self + -1.0 * b
    }
}
impl Mul<Vec3> for f64 {
    type Output = Vec3;
    fn mul(self, a: Vec3) -> Vec3 {
        Vec3([self * a[0], self * a[1], self * a[2]])
    }
}
/// Per channel, for colours.
impl Mul for Vec3 {
    type Output = Vec3;
    fn mul(self, b: Vec3) -> Vec3 {
        Vec3([self[0] * b[0], self[1] * b[1], self[2] * b[2]])
    }
}
impl Index<usize> for Vec3 {
    type Output = f64;
    fn index(&self, i: usize) -> &f64 {
        &self.0[i]
    }
}

/// From the first three numbers of a slice.
pub fn vec3<Number: Copy + Into<f64>>(numbers: &[Number]) -> Vec3 {
    Vec3([numbers[0].into(), numbers[1].into(), numbers[2].into()])
}
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    Vec3([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
}
pub fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}
pub fn normalised(a: Vec3) -> Vec3 {
    1.0 / length(a) * a
}
