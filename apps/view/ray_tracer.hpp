// SPDX-License-Identifier: Apache-2.0
//
// Renders images of a scene with a ray tracer plugin in this process.
#pragma once

#include "base/program.hpp"
#include "compositor/compositor.hpp"
#include "scene/motion.hpp"
#include "view/plugin.hpp"

#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

namespace arhost::view {

// Memory that is page-aligned, as arhost/raytracer.h requires.
class PageMemory {
public:
    explicit PageMemory(std::size_t size = 0);
    std::uint8_t *get() const { return bytes_.get(); }

private:
    struct Free {
        void operator()(std::uint8_t *bytes) const { std::free(bytes); }
    };
    std::unique_ptr<std::uint8_t, Free> bytes_;
};

// How a plugin renders if its options do not say it. A plugin that lacks an option renders as it does by default.
enum class Quality {
    still,      // one picture: not denoised, 16 samples per pixel
    film,       // denoised
    moving,     // as moving pictures in the window: denoised, as fast as possible
    converging, // images to average: not denoised, one sample per pixel
    normals     // colours that show the normals
};

// The plugin has no option for a Quality.
struct Unsupported : base::InvalidInput {
    using InvalidInput::InvalidInput;
};

class RayTracer {
public:
    // `scene` must be valid and outlive the RayTracer. `is_straight`: always renders RGBA images. Throws
    // std::runtime_error, Unsupported, or base::Interrupted.
    RayTracer(const std::string &name, const OptionSettings &options, Quality quality, const arhost_scene &scene,
              const arhost_intrinsics &intrinsics, bool is_straight = false);
    ~RayTracer();
    RayTracer(const RayTracer &) = delete;
    RayTracer &operator=(const RayTracer &) = delete;

    // Renders the next image of a sequence: the plugin may use what it has kept of earlier ones. `is_coarse`: allows
    // it to shade fewer pixels. The image is valid until the next call. Throws as the constructor.
    const ImageView &render(const arhost_camera &camera, double time_s, bool is_coarse = false);

private:
    Plugin plugin_;
    const arhost_scene &scene_;
    std::uint32_t width_, height_;
    std::optional<scene::MotionEvaluator> motion_;
    ImageView image_;
    PageMemory pixels_, state_before_, state_after_;
    std::uint64_t state_size_ = 0, sequence_ = 0;
};

} // namespace arhost::view
