// SPDX-License-Identifier: Apache-2.0
//
// Owns the memory of the denoiser of the path integrator, and runs its steps (steps.inl). What it knows of earlier
// frames is in the state that the host keeps (arhost_render_request.state_before), so that an image does not depend
// on the life of the worker.
#pragma once

#include "raytracer_common/denoiser/steps.hpp"
#include "raytracer_common/light_sources.hpp"
#include "raytracer_common/thread_pool.hpp"

#include <arhost/raytracer.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace arhost::raytracer_common {

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

// Returns the states of a request; none if it has none, as images are then not denoised. `size`: that the ray tracer
// has declared. Throws Failure if the states of the request are smaller.
StateSlots state_of(const arhost_render_request &request, std::uint64_t size);

// Returns the value of the option `show`. Throws Failure if it needs a denoiser and there is none.
View view_of(const std::string &show, bool denoises);

// Decides which planes the denoiser has.
struct DenoisedScene {
    bool has_sharp_shadows, has_gloss; // if neither, catchers have half the resolution
    bool has_specular;                 // virtual mirrors or glass
};

// A frame to be denoised.
struct NewFrame {
    const arhost_intrinsics &intrinsics; // of the image
    Camera camera;
    Video video;
    Image image;
    View view;
    std::span<const PlacedObject> objects;
    bool deforms;              // whether meshes have changed
    std::uint32_t sequence;    // number of the frame
    std::uint32_t samples;     // per pixel
    std::int32_t flat_catcher; // index of a flat object, or −1
    bool takes_turns;          // whether pixels may be sampled in one of four frames
    std::uint32_t shading_px;  // as in arhost_render_request
};

class Denoiser {
public:
    // `width`, `height`: the largest size of an image.
    Denoiser(InstructionSet instructions, std::uint32_t width, std::uint32_t height, std::size_t objects,
             const DenoisedScene &scene);

    std::uint64_t state_size() const { return state_size_; } // bytes

    // Prepares a frame. `state.after` must not be NULL. Returns the memory of its guides and its light, which is
    // valid until the next call. The caller writes them, or calls clear(), and writes Denoising::taps.
    const Denoising &begin(const StateSlots &state, const NewFrame &frame);
    // Removes the surfaces of a part of the image.
    void clear(const Rectangle &pixels);
    // Runs the steps. Returns a rectangle of the pixels that virtual objects affect.
    Rectangle run(ThreadPool &threads);

private:
    void resize(std::uint32_t width, std::uint32_t height);
    std::vector<Layer *> layers();

    Steps steps_;
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

} // namespace arhost::raytracer_common
