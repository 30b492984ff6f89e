// SPDX-License-Identifier: Apache-2.0
//
// Owns the memory of the denoiser (kernel/denoise.inl), and runs its steps. What it knows of earlier frames is in the
// state that the host keeps (arhost_render_request.state_before), so that an image does not depend on the life of the
// worker.
#pragma once

#include "kernel.hpp"
#include "raytracer_common/light_sources.hpp"
#include "thread_pool.hpp"

#include <arhost/raytracer.h>

#include <cstddef>
#include <span>
#include <vector>

namespace rt_embree {

// As in arhost_render_request.
struct StateSlots {
    const void *before = nullptr;
    void *after = nullptr;

    // Returns the parts of the states from `offset` bytes on.
    StateSlots from(std::uint64_t offset) const {
        return {before ? static_cast<const std::byte *>(before) + offset : nullptr,
                after ? static_cast<std::byte *>(after) + offset : nullptr};
    }
};

// Decides which planes the denoiser has.
struct DenoisedScene {
    bool has_sharp_shadows, has_gloss; // if neither, catchers have half the resolution
    bool has_specular;                 // virtual mirrors or glass
};

class Denoiser {
public:
    // `width`, `height`: the largest size of an image.
    Denoiser(std::uint32_t width, std::uint32_t height, std::size_t objects, const DenoisedScene &scene);

    std::uint64_t state_size() const { return state_size_; } // bytes

    // Prepares a frame. `state.after` must not be NULL. `deforms`: whether meshes have changed; `sequence`: number of
    // the frame; `samples`: per pixel; `flat_catcher`: index of a flat object, or −1; `shading_px`: as in
    // arhost_render_request.
    // Returns the input of the kernel, which is valid until the next call.
    const Denoising &begin(const StateSlots &state, const arhost_intrinsics &intrinsics, const Camera &camera,
                           std::span<const arhost::raytracer_common::PlacedObject> objects, bool deforms,
                           std::uint32_t sequence, std::uint32_t samples, std::int32_t flat_catcher,
                           std::uint32_t shading_px);
    // Makes a tile empty.
    void clear(const Tile &tile);
    // Runs the steps after all tiles have been rendered or cleared. Returns a rectangle of the pixels that virtual
    // objects affect.
    Rectangle run(const Frame &frame, const Kernel &kernel, std::span<const Tile> tiles, ThreadPool &threads);

private:
    void resize(std::uint32_t width, std::uint32_t height);
    std::vector<Layer *> layers();

    std::size_t objects_;
    bool has_gloss_, has_specular_;
    std::int32_t catcher_cell_px_;
    std::uint64_t state_size_;
    std::vector<float> planes_;
    std::vector<unsigned> taps_;
    std::vector<Change> changes_;
    std::vector<float> motion_; // Denoising::before_from_now
    Denoising denoising_{};
};

} // namespace rt_embree
