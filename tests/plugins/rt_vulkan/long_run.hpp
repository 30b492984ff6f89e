// SPDX-License-Identifier: Apache-2.0
//
// Renders many images of alternating scenes with rt_vulkan, and measures memory and file descriptors to detect leaks.
#pragma once

#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"
#include "tracer.hpp"

#include <malloc.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>

namespace arhost::test {

struct LongRun {
    struct State {
        double memory_mib;    // resident memory of this process
        std::ptrdiff_t files; // number of open file descriptors
    };
    std::vector<State> states; // measured each time the plugin has been stopped
    std::string log;

    std::size_t validation_messages() const {
        std::size_t count = 0;
        for (std::size_t at = 0; (at = log.find("Vulkan validation: ", at)) != std::string::npos; ++at)
            ++count;
        return count;
    }
};

// Measures the current state. First returns freed memory to the operating system, so that memory which malloc keeps
// is not mistaken for a leak.
inline LongRun::State current_state() {
    ::malloc_trim(0);
    std::size_t pages = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> pages >> resident;
    return {
        static_cast<double>(resident) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20),
        std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator())};
}

// Starts the plugin, renders `images` small images and stops the plugin; repeats this `changes` times, each time with
// the next of `scenes`. The camera moves near the position of the dissertation's marker. If a call fails, throws
// std::runtime_error with the plugin's log.
inline LongRun long_run(const std::vector<std::filesystem::path> &scenes, int changes, int images,
                        const Options &options) {
    PluginUnderTest plugin("rt_vulkan");
    const auto require = [&](arhost_status status) {
        if (status != ARHOST_STATUS_OK)
            throw std::runtime_error(plugin.log());
    };
    require(plugin.create(options));
    std::vector<scene::Arena> arenas;
    for (const std::filesystem::path &file : scenes)
        arenas.push_back(scene::load_scene(file).build());
    const auto &functions = plugin.functions<arhost_raytracer>();
    const arhost_intrinsics intrinsics = pinhole(48, 36, 48);
    constexpr std::size_t slots = 3, page = 4096;
    // The image slots are page-aligned like those of the host, so that the device can write to them directly.
    const std::size_t size = 2 * page;
    const std::unique_ptr<std::uint8_t, decltype(&std::free)> memory(
        static_cast<std::uint8_t *>(std::aligned_alloc(page, slots * size)), &std::free);
    LongRun run;
    for (int change = 0; change < changes; ++change) {
        const arhost_scene &scene = arenas[static_cast<std::size_t>(change) % arenas.size()].scene();
        const arhost_raytracer_setup setup{
            sizeof setup, intrinsics.width, intrinsics.height,       ARHOST_IMAGE_FORM_STRAIGHT,
            &scene,       &intrinsics,      ARHOST_COMPOSITING_SRGB, 0,
            nullptr};
        require(functions.start(plugin.instance(), &setup));
        scene::MotionEvaluator evaluator(scene);
        for (int i = 0; i < images; ++i) {
            const double side = 30.0 * i / images;
            const arhost_camera view = scene.axes == ARHOST_AXES_Z_UP
                                           ? camera({side, -330, 150}, {0, 0, 50}, {0, 0, 1}, intrinsics)
                                           : camera({side, 150, 330}, {0, 50, 0}, {0, 1, 0}, intrinsics);
            const arhost_motion motion = evaluator.at(0.04 * i);
            const arhost_render_request request{sizeof request,
                                                0,
                                                static_cast<std::uint64_t>(i),
                                                0,
                                                view,
                                                scene.duration_s > 0 ? &motion : nullptr,
                                                nullptr,
                                                nullptr,
                                                nullptr,
                                                0,
                                                nullptr,
                                                0,
                                                0};
            const arhost_image image{sizeof image,
                                     4 * intrinsics.width,
                                     intrinsics.width,
                                     intrinsics.height,
                                     memory.get() + static_cast<std::size_t>(i) % slots * size,
                                     nullptr,
                                     nullptr};
            arhost_render_info info{};
            info.struct_size = sizeof info;
            require(functions.render(plugin.instance(), &request, &image, &info));
        }
        functions.stop(plugin.instance());
        run.states.push_back(current_state());
    }
    run.log = plugin.log();
    return run;
}

} // namespace arhost::test
