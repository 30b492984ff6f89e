/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/camera.h: lens intrinsics, and the camera that a render request specifies.
 *
 * A point (x, y, z) in camera coordinates (OpenCV: x right, y down, z forward) projects to the pixel
 *   u = fx·x'' + cx,  v = fy·y'' + cy,  (x'', y'') = distort(x/z, y/z).
 * Pixel centres are at integer coordinates (arhost/frame.h), so the default principal point is
 * ((width−1)/2, (height−1)/2).
 */
#ifndef ARHOST_CAMERA_H
#define ARHOST_CAMERA_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef int32_t arhost_distortion;
enum {
    ARHOST_DISTORTION_NONE = 1,
    /* Brown–Conrady, as in OpenCV's calib3d: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [τx τy]]]]; 4, 5, 8, 12 or 14
     * coefficients. This version supports no tilt of the sensor: hosts pass at most 12 coefficients, and reject
     * sources with τx or τy other than 0. */
    ARHOST_DISTORTION_BROWN = 2,
    /* Kannala–Brandt, as in OpenCV's fisheye: k1 k2 k3 k4. */
    ARHOST_DISTORTION_FISHEYE = 3
};

enum { ARHOST_MAX_DISTORTION = 14 };

typedef struct arhost_intrinsics {
    uint32_t struct_size;
    uint32_t width, height; /* size in px of the image to which the following values apply */
    arhost_distortion distortion;
    double fx, fy; /* focal lengths, px, > 0 */
    double cx, cy; /* principal point, px */
    uint32_t coefficient_count;
    uint32_t reserved; /* 0 */
    double coefficients[ARHOST_MAX_DISTORTION];
    uint64_t reserved_for_growth[8]; /* 0: other structs contain this one by value */
} arhost_intrinsics;

/* Returns the intrinsics of an image with the same view in another size. The edges of both images coincide, so the
 * pixel (x, y) becomes ((x + 0.5)·width/in.width − 0.5, (y + 0.5)·height/in.height − 0.5). */
static inline arhost_intrinsics arhost_scaled_intrinsics(arhost_intrinsics in, uint32_t width, uint32_t height) {
    const double x = (double)width / in.width, y = (double)height / in.height;
    in.width = width;
    in.height = height;
    in.fx *= x;
    in.fy *= y;
    in.cx = (in.cx + 0.5) * x - 0.5;
    in.cy = (in.cy + 0.5) * y - 0.5;
    return in;
}

/* A camera in world coordinates: right-handed, millimetres. The camera axes are
 *   w = eye − look_at (backward),  u = up × w (right),  v = w × u (up), each normalised.
 * A camera derived from a marker has |look_at − eye| = 1 and a unit vector `up` perpendicular to w; a camera from a
 * trajectory file may have any `up` that is not parallel to w. */
typedef struct arhost_camera {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    double eye[3], look_at[3], up[3];
    arhost_intrinsics intrinsics;
    uint64_t reserved_for_growth[8]; /* 0: other structs contain this one by value */
} arhost_camera;

#ifdef __cplusplus
}
#endif
#endif
