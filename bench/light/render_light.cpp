// SPDX-License-Identifier: Apache-2.0
//
// Renders a scene with rt_embree's path integrator for `tools/bench light`:
//   render-light SCENE OUT WIDTH HEIGHT FOCAL_PX EYE_X EYE_Y EYE_Z AT_X AT_Y AT_Z UP_X UP_Y UP_Z SAMPLES FRAMES
//   [KEY=VALUE...]
// renders FRAMES images of SAMPLES samples with successive frame numbers, writes their mean to OUT as six floats per
// pixel (added light and transmittance), and prints the CPU time of all images as JSON. Keys: light_samples,
// max_radiance (0: no bound), photons, threads, video (a file of R, G, B bytes: the picture under the overlay).
#include "bunny.hpp"
#include "pixels/linear.hpp"
#include "renderer.hpp"
#include "scene/scene_loader.hpp"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

namespace {

void run(int argc, char **argv) {
    if (argc < 17)
        throw std::runtime_error(
            "usage: render-light SCENE OUT WIDTH HEIGHT FOCAL EYE AT UP SAMPLES FRAMES [KEY=VALUE...]");
    const auto number = [&](int i) { return std::strtod(argv[i], nullptr); };
    const auto width = static_cast<std::uint32_t>(number(3)), height = static_cast<std::uint32_t>(number(4));
    const arhost_intrinsics intrinsics = arhost::bench::centred_pinhole(width, height, number(5));
    const arhost_camera camera{sizeof(arhost_camera),
                               0,
                               {number(6), number(7), number(8)},
                               {number(9), number(10), number(11)},
                               {number(12), number(13), number(14)},
                               intrinsics,
                               {}};
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
    format.width = width;
    format.height = height;
    format.stride[0] = 3 * width;
    std::vector<std::uint8_t> video(std::size_t{3} * width * height);
    bool has_video = false;
    rt_embree::Settings settings;
    settings.samples = static_cast<std::uint32_t>(number(15));
    const auto frames = static_cast<int>(number(16));
    for (int i = 17; i < argc; ++i) {
        const std::string argument = argv[i];
        const std::size_t equals = argument.find('=');
        const std::string key = argument.substr(0, equals);
        if (key == "video") {
            std::ifstream in(argument.substr(equals + 1), std::ios::binary);
            in.read(reinterpret_cast<char *>(video.data()), static_cast<std::streamsize>(video.size()));
            if (!in)
                throw std::runtime_error("cannot read " + argument);
            has_video = true;
            continue;
        }
        const double value = std::strtod(argument.c_str() + equals + 1, nullptr);
        if (key == "light_samples")
            settings.light_samples = static_cast<std::int32_t>(value);
        else if (key == "max_radiance")
            settings.max_radiance = value > 0 ? static_cast<float>(value) : std::numeric_limits<float>::infinity();
        else if (key == "photons")
            settings.photons = static_cast<std::uint32_t>(value);
        else if (key == "threads")
            settings.threads = static_cast<unsigned>(value);
        else
            throw std::runtime_error("unknown key " + key);
    }
    const arhost::scene::Arena arena = arhost::scene::load_scene(argv[1]).build();
    const arhost_host host = arhost::bench::printing_host("render-light");
    const arhost_raytracer_setup setup = arhost::bench::linear_setup(arena.scene(), intrinsics);
    rt_embree::Renderer renderer(setup, settings, arhost::Host(&host));
    std::vector<std::uint16_t> pixels(std::size_t{8} * width * height);
    const arhost_image image{sizeof(arhost_image), 16 * width, width, height, nullptr, pixels.data(), nullptr};
    arhost_frame frame_of_video{};
    frame_of_video.struct_size = sizeof frame_of_video;
    frame_of_video.format = &format;
    frame_of_video.plane[0] = video.data();
    std::vector<double> sums(std::size_t{6} * width * height);
    const std::clock_t start = std::clock();
    for (int frame = 0; frame < frames; ++frame) {
        renderer.render(camera, image, nullptr, has_video ? &frame_of_video : nullptr,
                        static_cast<std::uint64_t>(frame));
        for (std::size_t i = 0; i < std::size_t{width} * height; ++i)
            for (std::size_t c = 0; c < 6; ++c)
                sums[6 * i + c] += arhost::float_of(pixels[8 * i + c + (c >= 3)]);
    }
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    std::vector<float> means(sums.size());
    for (std::size_t i = 0; i < sums.size(); ++i)
        means[i] = static_cast<float>(sums[i] / frames);
    std::ofstream out(argv[2], std::ios::binary);
    out.write(reinterpret_cast<const char *>(means.data()),
              static_cast<std::streamsize>(means.size() * sizeof(float)));
    if (!out.flush())
        throw std::runtime_error(std::string("cannot write ") + argv[2]);
    std::printf(R"({"cpu_s": %.6f, "kernel": "%s"})"
                "\n",
                seconds, renderer.kernel_name());
}

} // namespace

int main(int argc, char **argv) {
    try {
        run(argc, argv);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "render-light: %s\n", error.what());
        return 1;
    }
}
