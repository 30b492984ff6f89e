// SPDX-License-Identifier: Apache-2.0
//
// Measures the parts of a run without arhost: calls source_file, the grey conversion, tracker_aruco, rt_embree and
// the compositor directly, one after the other, in this process. Prints the CPU time of each in ms per frame, as
// JSON.
//
//   plugins-alone SCENE TRAJECTORY PICTURE FRAMES
#include "camera/trajectory.hpp"
#include "compositor/compositor.hpp"
#include "pixels/grey.hpp"
#include "scene/scene_loader.hpp"

#include <fiducial/tracker_support.hpp>

#include <sys/resource.h>

#include <cstdio>
#include <exception>

namespace {

using namespace arhost::test;

double cpu_ms() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    const auto ms = [](const timeval &t) {
        return 1e3 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_usec);
    };
    return ms(usage.ru_utime) + ms(usage.ru_stime);
}

// Returns the mean CPU time of a call, summed over all threads. Ten warm-up calls are not counted; ten frames are the
// period of tables.py's trajectories.
template <class Call> double cpu_ms_of(int calls, Call &&call) {
    constexpr int warm_up = 10;
    for (int i = 0; i < warm_up; ++i)
        call(i);
    const double before = cpu_ms();
    for (int i = 0; i < calls; ++i)
        call(i);
    return (cpu_ms() - before) / calls;
}

void require(arhost_status status, const PluginUnderTest &plugin) {
    if (status != ARHOST_STATUS_OK)
        throw std::runtime_error(plugin.log());
}

double source_alone(const std::string &picture, int frames) {
    PluginUnderTest plugin("source_file");
    require(plugin.create({{"path", picture}}), plugin);
    const auto &source = plugin.functions<arhost_source>();
    const arhost_source_setup setup{sizeof setup, 0, 0, 0, 0, 0, nullptr};
    arhost_source_properties properties{};
    properties.struct_size = sizeof properties;
    properties.format.struct_size = sizeof properties.format;
    properties.intrinsics.struct_size = sizeof properties.intrinsics;
    require(source.start(plugin.instance(), &setup, &properties), plugin);
    const GuardedBuffer slot(properties.format.byte_size);
    const double ms = cpu_ms_of(frames, [&](int) {
        arhost_frame_buffer buffer{sizeof buffer, 0, &properties.format, {}, nullptr, nullptr, 0};
        for (std::uint32_t plane = 0; plane < properties.format.plane_count; ++plane)
            buffer.plane[plane] = slot.data() + properties.format.offset[plane];
        buffer.grey = slot.data() + properties.format.grey_offset;
        arhost_frame_info info{};
        info.struct_size = sizeof info;
        require(source.read(plugin.instance(), &buffer, &info), plugin);
    });
    source.stop(plugin.instance());
    return ms;
}

double tracker_alone(const std::string &picture, const arhost_intrinsics &camera, int frames) {
    Tracker tracker("tracker_aruco");
    if (tracker.created() != ARHOST_STATUS_OK || tracker.start(camera, {{0, 80}}) != ARHOST_STATUS_OK)
        throw std::runtime_error(tracker.log());
    const GreyFrame frame(read_grey(picture), ARHOST_TRANSFER_SRGB);
    return cpu_ms_of(frames, [&](int) { tracker.track(frame); });
}

// A BGR8 frame that is read from an image file.
struct VideoFrame {
    explicit VideoFrame(const std::string &picture) : slot(layout(picture)) {
        for (int y = 0; y < bgr.rows; ++y)
            std::memcpy(slot.data() + std::size_t{format.stride[0]} * static_cast<std::size_t>(y), bgr.ptr(y),
                        static_cast<std::size_t>(bgr.cols) * 3);
    }
    std::size_t layout(const std::string &picture) {
        bgr = cv::imread(picture);
        format.struct_size = sizeof format;
        format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
        format.width = static_cast<std::uint32_t>(bgr.cols);
        format.height = static_cast<std::uint32_t>(bgr.rows);
        if (!arhost_frame_layout(&format))
            throw std::runtime_error("cannot read " + picture);
        return format.byte_size;
    }
    cv::Mat bgr;
    arhost_frame_format format{};
    GuardedBuffer slot;
};

double grey_alone(const VideoFrame &video, int frames) {
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {video.slot.data()};
    return cpu_ms_of(
        frames, [&](int) { arhost::fill_grey(video.format, planes, video.slot.data() + video.format.grey_offset); });
}

struct Traced {
    double raytracer_ms, composite_ms;
};

Traced raytracer_and_composite(const VideoFrame &video, const std::string &scene,
                               const arhost::camera::Trajectory &trajectory, int frames) {
    const arhost::scene::Arena arena = arhost::scene::load_scene(std::filesystem::path(scene)).build();
    PluginUnderTest plugin("rt_embree");
    require(plugin.create(), plugin);
    const auto &raytracer = plugin.functions<arhost_raytracer>();
    const arhost_intrinsics &camera = *trajectory.intrinsics;
    const arhost_raytracer_setup setup{
        sizeof setup,   camera.width, camera.height,           ARHOST_IMAGE_FORM_STRAIGHT,
        &arena.scene(), &camera,      ARHOST_COMPOSITING_SRGB, 0,
        nullptr};
    require(raytracer.start(plugin.instance(), &setup), plugin);
    const GuardedBuffer slot(std::size_t{4} * camera.width * camera.height);
    arhost_render_info info{};
    const double ms = cpu_ms_of(frames, [&](int i) {
        const auto &frame = trajectory.frames[static_cast<std::size_t>(i) % trajectory.frames.size()];
        const arhost_render_request request{sizeof request,
                                            0,
                                            frame.frame,
                                            0,
                                            arhost::camera::camera_of(frame.view.value(), camera),
                                            nullptr,
                                            nullptr,
                                            nullptr,
                                            nullptr,
                                            0,
                                            nullptr,
                                            0,
                                            0};
        const arhost_image image{sizeof image, 4 * camera.width, camera.width, camera.height,
                                 slot.data(),  nullptr,          nullptr};
        info = {};
        info.struct_size = sizeof info;
        require(raytracer.render(plugin.instance(), &request, &image, &info), plugin);
    });
    raytracer.stop(plugin.instance());
    std::vector<std::uint8_t> output(std::size_t{3} * camera.width * camera.height);
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {video.slot.data()};
    const double composite_ms = cpu_ms_of(frames, [&](int) {
        arhost::composite(video.format, planes, {slot.data(), 4 * camera.width},
                          {info.region_x, info.region_y, info.region_width, info.region_height},
                          {output.data(), 3 * camera.width});
    });
    return {ms, composite_ms};
}

} // namespace

int main(int argc, char **argv) try {
    if (argc != 5) {
        std::fprintf(stderr, "usage: plugins-alone SCENE TRAJECTORY PICTURE FRAMES\n");
        return 2;
    }
    const int frames = std::max(1, std::atoi(argv[4]));
    const arhost::camera::Trajectory trajectory = arhost::camera::read_trajectory(argv[2]);
    if (!trajectory.intrinsics)
        throw std::runtime_error("the trajectory must contain intrinsics");
    const VideoFrame video(argv[3]);
    const double source = source_alone(argv[3], frames), grey = grey_alone(video, frames);
    const double tracker = tracker_alone(argv[3], *trajectory.intrinsics, frames);
    const Traced traced = raytracer_and_composite(video, argv[1], trajectory, frames);
    std::printf("{\"source\": %.4f, \"grey\": %.4f, \"tracker\": %.4f, \"raytracer\": %.4f, \"composite\": %.4f}\n",
                source, grey, tracker, traced.raytracer_ms, traced.composite_ms);
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "plugins-alone: %s\n", error.what());
    return 1;
}
