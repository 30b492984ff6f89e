// SPDX-License-Identifier: Apache-2.0
//
// The video under the overlay.
#pragma once
#include "raytracer_common/packets/texture.inl"

// The point of the picture that shows a direction: px, texel centres at halves.
struct PixelOf {
    Float x, y;
    Bool in_front; // of the camera, where its lens model is valid
};
// `to_point`: from the camera's eye, in world axes.
ARHOST_INLINE PixelOf pixel_towards(const Video &video, const Camera &camera, Vec3 to_point) {
    const float *m = camera.world_from_camera;
    const Vec3 p{dot(splat(m), to_point), dot(splat(m + 3), to_point), dot(splat(m + 6), to_point)};
    const Float depth = max(p.z, Float(1e-6f));
    Vec3 at = vec3(p.x / depth, p.y / depth, Float(1.0f));
    const float *k = video.coefficients;
    const Bool in_front = (p.z > Float(1e-6f)) & (at.x * at.x + at.y * at.y < Float(video.max_radius_squared));
    if (video.distortion == ARHOST_DISTORTION_BROWN)
        at = brown_conrady({k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8], k[9], k[10], k[11]}, at);
    else if (video.distortion == ARHOST_DISTORTION_FISHEYE)
        at = kannala_brandt({k[0], k[1], k[2], k[3]}, at);
    return {at.x * Float(video.fx) + Float(video.cx + 0.5f), at.y * Float(video.fy) + Float(video.cy + 0.5f),
            in_front};
}

// Returns the light of the video. `column`, `row`: px, pixel centres at halves.
ARHOST_INLINE Vec3 video_at(const Video &video, Float column, Float row) {
    return sample_texture(video.linear_of_srgb8, video.image, column * Float(video.pixel_width),
                          row * Float(video.pixel_height))
        .colour;
}
