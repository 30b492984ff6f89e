// SPDX-License-Identifier: Apache-2.0
#include "view/ray_tracer.hpp"

#include "base/text.hpp"
#include "ipc/protocol.hpp"
#include "scene/capabilities.hpp"
#include "worker/library.hpp"

#include <algorithm>
#include <cstdio>
#include <new>

namespace arhost::view {
namespace {

Plugin::Defaults defaults_for(Quality quality) {
    return [quality](yaml::Node &options, const model::PluginDescription &plugin) {
        const auto set = [&](const char *key, const std::string &value) {
            const auto declared = std::ranges::find(plugin.options, key, &model::OptionDeclaration::key);
            if (declared == plugin.options.end() || options.find(key))
                return false;
            const auto &choices = declared->choices;
            if (!choices.empty() && std::ranges::find(choices, value) == choices.end())
                return false;
            if (declared->type == ARHOST_OPTION_INTEGER && (declared->minimum != 0 || declared->maximum != 0) &&
                declared->maximum < 16)
                return false;
            options.override_value(key, value);
            return true;
        };
        switch (quality) {
        case Quality::still:
            set("samples", "16");
            set("quality", "reference");
            break;
        case Quality::film:
            set("quality", "balanced");
            break;
        case Quality::moving:
            set("quality", "realtime");
            break;
        case Quality::converging:
            set("samples", "1");
            set("quality", "reference");
            break;
        case Quality::normals:
            set("quality", "realtime");
            if (!set("show", "normals"))
                throw Unsupported(plugin.short_name() + " cannot show normals; rt_embree and rt_vulkan can");
        }
    };
}

} // namespace

PageMemory::PageMemory(std::size_t size) {
    constexpr std::size_t page = 4096;
    if (size > 0 &&
        !(bytes_.reset(static_cast<std::uint8_t *>(std::aligned_alloc(page, (size + page - 1) / page * page))),
          bytes_))
        throw std::bad_alloc();
}

RayTracer::RayTracer(const std::string &name, const OptionSettings &options, Quality quality,
                     const arhost_scene &scene, const arhost_intrinsics &intrinsics, bool is_straight)
    : plugin_(name, "--raytracer", ARHOST_KIND_RAYTRACER, options, defaults_for(quality)), scene_(scene),
      width_(intrinsics.width), height_(intrinsics.height) {
    const auto &functions = plugin_.functions<arhost_raytracer>();
    const std::uint64_t capabilities = scene::capabilities_of(plugin_.descriptor(), functions, plugin_.instance());
    if (const std::string missing = scene::missing_capabilities_text(
            plugin_.description().short_name(), scene::needed_capabilities(scene) & ~capabilities);
        !missing.empty() && (quality == Quality::still || quality == Quality::film || quality == Quality::moving))
        std::fprintf(stderr, "warning: %s\n", base::printable(missing).c_str());
    if (scene::is_moving(scene))
        motion_.emplace(scene);
    if (!is_straight && scene.integrator == ARHOST_INTEGRATOR_PATH &&
        (capabilities & ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES))
        image_.format.form = ARHOST_IMAGE_FORM_LINEAR;
    image_.stride = ipc::overlay_stride(width_, image_.format.form);
    pixels_ = PageMemory(image_.stride * height_);
    image_.pixels = pixels_.get();
    const arhost_raytracer_setup setup{
        sizeof setup, width_, height_, image_.format.form, &scene, &intrinsics, image_.format.compositing, 0,
        nullptr};
    plugin_.expect_ok("start", functions.start(plugin_.instance(), &setup));
    state_size_ = worker::state_size_of(functions, plugin_.instance());
    state_before_ = PageMemory(state_size_);
    state_after_ = PageMemory(state_size_);
}

RayTracer::~RayTracer() {
    plugin_.functions<arhost_raytracer>().stop(plugin_.instance());
}

const ImageView &RayTracer::render(const arhost_camera &camera, double time_s, bool is_coarse) {
    const bool is_linear = image_.format.is_linear();
    const arhost_image image{sizeof image,
                             static_cast<std::uint32_t>(image_.stride),
                             width_,
                             height_,
                             is_linear ? nullptr : pixels_.get(),
                             is_linear ? reinterpret_cast<std::uint16_t *>(pixels_.get()) : nullptr,
                             nullptr};
    arhost_render_request request{};
    request.struct_size = sizeof request;
    request.time_s = time_s;
    request.camera = camera;
    request.state_size = state_size_;
    request.state_before = sequence_ > 0 ? state_before_.get() : nullptr;
    request.state_after = state_after_.get();
    request.sequence = sequence_++;
    request.shading_px = is_coarse ? 2 : 0;
    arhost_motion motion;
    if (motion_) {
        motion = motion_->at(time_s);
        request.motion = &motion;
    }
    arhost_render_info info{};
    info.struct_size = sizeof info;
    plugin_.expect_ok("render",
                      plugin_.functions<arhost_raytracer>().render(plugin_.instance(), &request, &image, &info));
    std::swap(state_before_, state_after_);
    return image_;
}

} // namespace arhost::view
