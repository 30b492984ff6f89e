// SPDX-License-Identifier: Apache-2.0
#include "ray_tracer.hpp"

#include "base/text.hpp"
#include "ipc/protocol.hpp"
#include "run_config/options.hpp"
#include "run_config/plugin_path.hpp"
#include "scene/motion.hpp"
#include "worker/library.hpp"

#include <nlohmann/json.hpp>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <vector>

using namespace arhost;

namespace {

// Returns the folder of the built-in plugins. Its path relative to this program is the same in a build folder and in
// an installation.
std::filesystem::path built_in_plugins() {
    return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path() / "lib/arhost/plugins";
}

constexpr arhost_host host = {sizeof(arhost_host),
                              ARHOST_ABI_VERSION,
                              "render-scene",
                              ARHOST_VERSION,
                              nullptr,
                              [](const arhost_host *, arhost_severity severity, const char *text) {
                                  if (severity >= ARHOST_SEVERITY_WARNING)
                                      std::fprintf(stderr, "%s\n", base::printable(text ? text : "").c_str());
                              },
                              [](const arhost_host *, double, const char *) {},
                              [](const arhost_host *) { return 0; },
                              [](const arhost_host *, const char *) -> const void * { return nullptr; }};

// Sets the options `samples` to 16 and `quality` to reference if they are not set and the plugin supports these
// values. Plugins default to the frame rate, but here quality matters more than speed.
void prefer_quality(yaml::Node &options, const model::PluginDescription &plugin) {
    for (const model::OptionDeclaration &o : plugin.options) {
        if (options.find(o.key))
            continue;
        if (o.key == "samples" && o.type == ARHOST_OPTION_INTEGER &&
            ((o.minimum == 0 && o.maximum == 0) || (o.minimum <= 16 && o.maximum >= 16)))
            options.override_value("samples", "16");
        if (o.key == "quality" && std::ranges::find(o.choices, "reference") != o.choices.end())
            options.override_value("quality", "reference");
    }
}

// Image memory that is page-aligned, as arhost/raytracer.h requires.
class ImageMemory {
public:
    explicit ImageMemory(std::size_t size)
        : bytes_(static_cast<std::uint8_t *>(std::aligned_alloc(page, round_up(size)))) {
        if (!bytes_)
            throw std::bad_alloc();
    }
    std::uint8_t *get() const { return bytes_.get(); }

private:
    static constexpr std::size_t page = 4096;
    static std::size_t round_up(std::size_t size) { return (size + page - 1) / page * page; }
    struct Free {
        void operator()(std::uint8_t *bytes) const { std::free(bytes); }
    };
    std::unique_ptr<std::uint8_t, Free> bytes_;
};

} // namespace

RayTracer::RayTracer(const std::string &name, yaml::Node options) {
    const yaml::Node requested = yaml::Node::scalar(name, "--raytracer");
    const std::filesystem::path file = run_config::PluginPath({}, built_in_plugins()).resolve(requested);
    plugin_ = &worker::negotiate(file, worker::open_library(file));
    const model::PluginDescription plugin = model::describe(*plugin_->descriptor);
    model::check(plugin);
    if (plugin.kind != ARHOST_KIND_RAYTRACER)
        requested.fail("'" + plugin.short_name() + "' is a " + model::to_text(plugin.kind) + ", not a ray tracer");
    prefer_quality(options, plugin);
    std::vector<std::string> notes;
    const std::vector<model::OptionValue> values =
        run_config::resolve_options(plugin, options, std::nullopt, requested, notes);
    for (const std::string &note : notes)
        std::fprintf(stderr, "render-scene: %s\n", note.c_str());
    std::vector<arhost_option> passed;
    passed.reserve(values.size());
    for (const model::OptionValue &v : values)
        passed.push_back({sizeof(arhost_option), v.type, v.key.c_str(), v.integer, v.real, v.text.c_str()});
    expect_ok("create", plugin_->create(&host, passed.data(), static_cast<std::uint32_t>(passed.size()), &instance_));
    if (!instance_)
        throw std::runtime_error(plugin.short_name() +
                                 ": the function create returned ARHOST_STATUS_OK, but no instance");
}

void RayTracer::expect_ok(const char *call, arhost_status status) const {
    if (status != ARHOST_STATUS_OK) // the plugin has logged the reason
        throw std::runtime_error(model::describe(*plugin_->descriptor).short_name() + ": " + call + ": " +
                                 model::status_text(status));
}

cv::Mat RayTracer::render(const arhost_scene &scene, const arhost_camera &camera, double time_s) const {
    const auto &functions = *static_cast<const arhost_raytracer *>(plugin_->functions);
    const std::uint32_t width = camera.intrinsics.width, height = camera.intrinsics.height;
    const std::uint32_t stride = ipc::overlay_stride(width);
    const ImageMemory memory(std::size_t{stride} * height);
    const arhost_image image{sizeof image, stride, width, height, memory.get(), nullptr, nullptr};
    arhost_render_request request{sizeof request, 0,       0, time_s,  camera, nullptr, nullptr,
                                  nullptr,        nullptr, 0, nullptr, 0,      0};
    arhost_motion motion;
    std::optional<arhost::scene::MotionEvaluator> evaluator; // owns the memory of `motion`
    if (scene.duration_s > 0) {
        motion = evaluator.emplace(scene).at(time_s);
        request.motion = &motion;
    }
    arhost_render_info info{};
    info.struct_size = sizeof info;

    const arhost_raytracer_setup setup{sizeof setup,
                                       width,
                                       height,
                                       ARHOST_IMAGE_FORM_STRAIGHT,
                                       &scene,
                                       &camera.intrinsics,
                                       ARHOST_COMPOSITING_SRGB,
                                       0,
                                       nullptr};
    expect_ok("start", functions.start(instance_, &setup));
    request.state_size = worker::state_size_of(functions, instance_);
    const ImageMemory state(request.state_size);
    request.state_after = request.state_size > 0 ? state.get() : nullptr;
    const arhost_status status = functions.render(instance_, &request, &image, &info);
    functions.stop(instance_);
    expect_ok("render", status);
    return cv::Mat(static_cast<int>(height), static_cast<int>(width), CV_8UC4, memory.get(), stride).clone();
}
