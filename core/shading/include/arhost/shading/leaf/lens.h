// SPDX-License-Identifier: Apache-2.0
// Lens distortion: maps directions to image points. Axes: x right, y down, z forward (OpenCV). An image point is
// (x'', y'', 1); focal lengths and principal point map it to a pixel. A leaf file: see ../scalar.hpp.
//
// The inverse has no closed form: ../lens.hpp computes it iteratively. Shaders read a ray table, which
// ../lens.hpp has computed.

// Coefficients in OpenCV's order.
struct BrownConrady {
    Float k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4;
};
struct KannalaBrandt {
    Float k1, k2, k3, k4;
};

// Brown–Conrady as in OpenCV's calib3d ("Detailed Description" of camera calibration): radial scale at squared
// radius r2.
ARHOST_LEAF Float brown_conrady_radial(BrownConrady k, Float r2) {
    return (Float(1.0) + r2 * (k.k1 + r2 * (k.k2 + r2 * k.k3))) /
           (Float(1.0) + r2 * (k.k4 + r2 * (k.k5 + r2 * k.k6)));
}

// Image point of the direction p = (x, y, 1), with radial, tangential and thin-prism distortion.
ARHOST_LEAF Vec3 brown_conrady(BrownConrady k, Vec3 p) {
    Float r2 = p.x * p.x + p.y * p.y;
    Float scale = brown_conrady_radial(k, r2);
    return vec3(
        p.x * scale + Float(2.0) * k.p1 * p.x * p.y + k.p2 * (r2 + Float(2.0) * p.x * p.x) + r2 * (k.s1 + r2 * k.s2),
        p.y * scale + k.p1 * (r2 + Float(2.0) * p.y * p.y) + Float(2.0) * k.p2 * p.x * p.y + r2 * (k.s3 + r2 * k.s4),
        Float(1.0));
}

// Kannala–Brandt as in OpenCV's fisheye (after Kannala and Brandt, IEEE PAMI 28(8), 2006): radius of the image point
// of a direction θ = `angle` radians off the axis, θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
ARHOST_LEAF Float kannala_brandt_radius(KannalaBrandt k, Float angle) {
    Float a2 = angle * angle;
    return angle * (Float(1.0) + a2 * (k.k1 + a2 * (k.k2 + a2 * (k.k3 + a2 * k.k4))));
}

// Derivative of kannala_brandt_radius with respect to the angle.
ARHOST_LEAF Float kannala_brandt_slope(KannalaBrandt k, Float angle) {
    Float a2 = angle * angle;
    return Float(1.0) +
           a2 * (Float(3.0) * k.k1 + a2 * (Float(5.0) * k.k2 + a2 * (Float(7.0) * k.k3 + a2 * (Float(9.0) * k.k4))));
}

// Image point of a direction, which may have any length and point backwards.
ARHOST_LEAF Vec3 kannala_brandt(KannalaBrandt k, Vec3 direction) {
    Float across = sqrt(direction.x * direction.x + direction.y * direction.y);
    Float angle = Float(6.28318530717959) * turn_of(across, direction.z);
    Float scale = kannala_brandt_radius(k, angle) / max(across, Float(1e-30));
    return vec3(direction.x * scale, direction.y * scale, Float(1.0));
}
