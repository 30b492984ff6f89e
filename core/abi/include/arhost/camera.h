/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/camera.h: the lens, and the camera as ray tracers are given it.
 *
 * A point (x, y, z) in the camera's OpenCV axes (x right, y down, z forward) is seen at the pixel
 *   u = fx·x'' + cx,  v = fy·y'' + cy,  (x'', y'') = distort(x/z, y/z)
 * with pixel centres at integers (arhost/frame.h), so the default principal point is
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
    /* Brown–Conrady as in OpenCV's calib3d: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]]; the count is
     * 4, 5, 8 or 12. */
    ARHOST_DISTORTION_BROWN = 2,
    /* Kannala–Brandt as in OpenCV's fisheye: k1 k2 k3 k4. */
    ARHOST_DISTORTION_FISHEYE = 3
};

enum { ARHOST_MAX_DISTORTION = 12 };

typedef struct arhost_intrinsics {
    uint32_t struct_size;
    uint32_t width, height; /* px, of the image that the numbers below belong to */
    arhost_distortion distortion;
    double fx, fy; /* focal lengths in px, > 0 */
    double cx, cy; /* principal point in px */
    uint32_t coefficient_count;
    uint32_t reserved; /* 0 */
    double coefficients[ARHOST_MAX_DISTORTION];
} arhost_intrinsics;

/* A camera in the scene's world: right-handed, millimetres. `look_at` − `eye` has length 1 where it comes
 * from a marker, and `up` is perpendicular to it with length 1; a trajectory's are what its file says. A
 * ray tracer copes with any that are not parallel, by w = eye − look_at, u = up × w, v = w × u. */
typedef struct arhost_camera {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    double eye[3], look_at[3], up[3];
    arhost_intrinsics intrinsics;
} arhost_camera;

#ifdef __cplusplus
}
#endif
#endif
