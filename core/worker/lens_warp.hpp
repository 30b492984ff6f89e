// SPDX-License-Identifier: Apache-2.0
//
// Supports ray tracers that cannot render lens distortion: such a ray tracer renders a pinhole image with a slightly
// larger field of view, and the worker warps this image to the real lens.
#pragma once

#include <arhost/camera.h>
#include <arhost/raytracer.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace arhost::worker {

// Sets the pointer to the pixels of an image of this form.
void set_pixels(arhost_image &image, arhost_image_form form, void *pixels);

class LensWarp {
public:
    // Computes a ray for each pixel, which takes half a microsecond per pixel; calls `progress` with the fraction (0
    // to 1) after each row.
    explicit LensWarp(const arhost_intrinsics &lens, arhost_image_form form = ARHOST_IMAGE_FORM_STRAIGHT,
                      const std::function<void(double)> &progress = {});

    // Returns the intrinsics of the pinhole image: same image size, no distortion, and a field of view that contains
    // everything that the lens sees within 76° of its optical axis.
    const arhost_intrinsics &pinhole() const { return pinhole_; }

    // Returns the pinhole image for the ray tracer to render. Its memory has the properties that arhost_image
    // promises.
    arhost_image pinhole_image();

    // Warps the pinhole image to `lens_image`, which has the same form, bilinearly: straight images with
    // premultiplied alpha, linear ones both quantities. Where the pinhole image has no data, alpha is 0, or the pixel
    // is one that virtual objects do not affect. `info` has the region of the pinhole image; the region of the lens
    // image is the whole image.
    void warp(const arhost_render_info &info, const arhost_image &lens_image);

private:
    struct Point { // px in the pinhole image; a position outside the image means that there is no data
        float x, y;
    };
    arhost_intrinsics pinhole_;
    arhost_image_form form_;
    std::vector<Point> sources_; // for each pixel of the lens image, the corresponding point of the pinhole image
    std::vector<std::uint8_t> pixels_;
};

} // namespace arhost::worker
