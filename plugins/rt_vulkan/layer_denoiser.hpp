// SPDX-License-Identifier: Apache-2.0
//
// Denoises images on the CPU, with the denoiser of both ray tracers. The device writes its input, planes of words,
// one per pixel (shaders/layers.glsl).
#pragma once

#include "raytracer_common/denoiser/denoiser.hpp"
#include "raytracer_common/video.hpp"

#include <cstdint>
#include <span>

namespace rt_vulkan {

class LayerDenoiser {
public:
    using StateSlots = arhost::raytracer_common::StateSlots;
    using Denoising = arhost::raytracer_common::Denoising;

    // `threads`: 0: one per processor.
    LayerDenoiser(const arhost_intrinsics &intrinsics, std::size_t objects, bool has_catchers, bool has_gloss,
                  bool has_specular, arhost::raytracer_common::View view, unsigned threads);

    // Number of planes that the device writes. The first ones are those of GuideRow.
    static std::uint32_t plane_count(bool has_gloss) { return has_gloss ? gloss_plane + 3 : gloss_plane; }
    std::uint64_t state_size() const { return denoiser_.state_size(); } // bytes

    struct NewFrame {
        const arhost::raytracer_common::Camera &camera;
        const arhost::raytracer_common::VideoImage *video; // NULL if it is unknown
        const arhost_image &image;
        bool blends_codes; // of straight images: see raytracer_common::Image
        std::span<const arhost::raytracer_common::PlacedObject> objects;
        bool deforms;           // whether meshes have changed
        std::uint32_t sequence; // number of the frame
        std::uint32_t samples;  // per pixel
    };
    // Prepares a frame. Call it before the device traces it. `state.after` must not be NULL.
    const Denoising &begin(const StateSlots &state, const NewFrame &frame);
    // Writes the image. Returns a rectangle of the pixels that virtual objects affect.
    arhost::raytracer_common::Rectangle run(const std::uint32_t *planes);

private:
    static constexpr std::uint32_t light_plane = arhost::raytracer_common::guide_rows, taps_plane = light_plane + 3,
                                   gloss_plane = taps_plane + 1;
    void read(const std::uint32_t *planes, std::size_t row) const;

    const arhost_intrinsics intrinsics_;
    const bool has_catchers_;
    const arhost::raytracer_common::View view_;
    const arhost::raytracer_common::ColourTables colour_tables_;
    const arhost::raytracer_common::Video lens_; // without an image
    arhost::raytracer_common::ThreadPool threads_;
    arhost::raytracer_common::Denoiser denoiser_;
    const Denoising *denoising_ = nullptr; // of the frame
};

} // namespace rt_vulkan
