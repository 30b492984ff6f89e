// SPDX-License-Identifier: Apache-2.0
//
// Measures the noise of rt_embree's path integrator for `tools/bench noise`:
//   render-noise SCENE [KEY=VALUE...]
// Renders frames like a run does, with the state of each frame passed to the next, over a grey video, and
// compares them with converged pictures. Prints, by kind of surface, the RMS difference in codes, and the temporal
// standard deviation if the camera stands still. Keys: width, height, samples, light_samples, photons, denoise,
// shading_px, threads, frames, orbit (degrees per frame), reference (frames of 64 samples), out (folder for the
// pictures), and for scenes with `motion`: stop (the frame from which on nothing moves), show, hide (the frames from
// which on the moving objects are visible, and no longer visible).
#include "bunny.hpp"
#include "pixels/linear.hpp"
#include "raytracer_common/scene_geometry.hpp"
#include "renderer.hpp"
#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"

#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace {

constexpr std::uint8_t video_code = 170; // of all pixels of the video
const double video_light = arhost::shading::srgb_decode(video_code / 255.0);

using Codes = std::vector<float>; // R, G, B of each pixel, not rounded

enum Kind { outside, catcher, diffuse, glossy, specular, kind_count };
constexpr std::array<const char *, kind_count> names{"outside", "catcher", "diffuse", "glossy", "mirror, glass"};

arhost_camera orbiting(const arhost_intrinsics &intrinsics, double degrees) {
    const double angle = degrees * M_PI / 180;
    return {sizeof(arhost_camera),
            0,
            {330 * std::sin(angle), -330 * std::cos(angle), 200},
            {0, 0, 25},
            {0, 0, 1},
            intrinsics,
            {}};
}

Codes blended(const std::vector<std::uint16_t> &pixels) {
    Codes codes;
    for (std::size_t i = 0; i < pixels.size(); i += 8)
        for (std::size_t c = 0; c < 3; ++c) {
            const double light =
                double{arhost::float_of(pixels[i + c])} + double{arhost::float_of(pixels[i + 4 + c])} * video_light;
            codes.push_back(static_cast<float>(255 * arhost::shading::srgb_encode(std::clamp(light, 0.0, 1.0))));
        }
    return codes;
}

// Returns the kind of the surface at the centre of each pixel.
std::vector<Kind> kinds(const rt_embree::EmbreeScene &scene, const arhost_camera &camera) {
    const auto &in = camera.intrinsics;
    const auto objects = arhost::raytracer_common::elements<arhost_object>(scene.arena(), scene.arena().objects);
    const auto materials =
        arhost::raytracer_common::elements<arhost_material>(scene.arena(), scene.arena().materials);
    const glm::dvec3 eye(camera.eye[0], camera.eye[1], camera.eye[2]),
        at(camera.look_at[0], camera.look_at[1], camera.look_at[2]);
    const glm::dvec3 forward = glm::normalize(at - eye),
                     right = glm::normalize(glm::cross(forward, glm::dvec3(0, 0, 1))),
                     down = glm::cross(forward, right);
    std::vector<Kind> result;
    for (std::uint32_t y = 0; y < in.height; ++y)
        for (std::uint32_t x = 0; x < in.width; ++x) {
            const glm::vec3 d(forward + right * ((x - in.cx) / in.fx) + down * ((y - in.cy) / in.fy));
            RTCRayHit ray{};
            ray.ray.org_x = static_cast<float>(eye.x), ray.ray.org_y = static_cast<float>(eye.y),
            ray.ray.org_z = static_cast<float>(eye.z);
            ray.ray.dir_x = d.x, ray.ray.dir_y = d.y, ray.ray.dir_z = d.z;
            ray.ray.tfar = INFINITY;
            ray.ray.mask = static_cast<unsigned>(-1);
            ray.hit.geomID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
            RTCIntersectContext context;
            rtcInitIntersectContext(&context);
            rtcIntersect1(scene.view().root, &context, &ray);
            if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
                result.push_back(outside);
                continue;
            }
            const bool is_moving = ray.hit.instID[0] != RTC_INVALID_GEOMETRY_ID &&
                                   static_cast<std::int32_t>(ray.hit.instID[0]) != scene.view().static_instance;
            const unsigned number = is_moving ? ray.hit.instID[0] : ray.hit.geomID;
            const arhost_object &object = objects[number];
            const auto model = materials[object.material].model;
            result.push_back(object.role != ARHOST_ROLE_VIRTUAL                                  ? catcher
                             : model == ARHOST_MATERIAL_DIFFUSE                                  ? diffuse
                             : model == ARHOST_MATERIAL_MIRROR || model == ARHOST_MATERIAL_GLASS ? specular
                                                                                                 : glossy);
        }
    return result;
}

void write_ppm(const std::string &file, const Codes &codes, std::uint32_t width, std::uint32_t height) {
    std::ofstream out(file, std::ios::binary);
    out << "P6\n" << width << " " << height << "\n255\n";
    for (const float code : codes)
        out.put(static_cast<char>(std::lround(code)));
}

class GreyVideo {
public:
    GreyVideo(std::uint32_t width, std::uint32_t height) : pixels_(std::size_t{3} * width * height, video_code) {
        format_.struct_size = sizeof format_;
        format_.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
        format_.width = width;
        format_.height = height;
        format_.stride[0] = 3 * width;
        frame_.struct_size = sizeof frame_;
        frame_.format = &format_;
        frame_.plane[0] = pixels_.data();
    }
    GreyVideo(const GreyVideo &) = delete;
    GreyVideo &operator=(const GreyVideo &) = delete;
    const arhost_frame &frame() const { return frame_; }

private:
    std::vector<std::uint8_t> pixels_;
    arhost_frame_format format_{};
    arhost_frame frame_{};
};

// Renders frames as a run does.
class Run {
public:
    Run(const arhost_raytracer_setup &setup, const rt_embree::Settings &settings, const arhost::Host &host,
        const GreyVideo &video, std::uint32_t shading_px = 1)
        : renderer_(setup, settings, host), video_(video), shading_px_(shading_px),
          pixels_(std::size_t{8} * setup.width * setup.height) {
        for (auto &state : states_)
            state.resize(renderer_.state_size() / sizeof(Aligned) + 1);
    }
    Codes frame(const arhost_camera &camera, std::uint64_t sequence, const arhost_motion *motion) {
        const arhost_image image{sizeof(arhost_image),
                                 16 * camera.intrinsics.width,
                                 camera.intrinsics.width,
                                 camera.intrinsics.height,
                                 nullptr,
                                 pixels_.data(),
                                 nullptr};
        rt_embree::StateSlots state;
        if (renderer_.state_size() > 0)
            state = {count_ > 0 ? states_[(count_ + 1) % 2].data() : nullptr, states_[count_ % 2].data()};
        const auto begin = std::chrono::steady_clock::now();
        const std::clock_t cpu = std::clock();
        renderer_.render(camera, image, motion, &video_.frame(), sequence, state, shading_px_);
        wall_ms.push_back(
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
        cpu_ms.push_back(1000.0 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC);
        ++count_;
        return blended(pixels_);
    }
    const rt_embree::EmbreeScene &scene() const { return renderer_.scene(); }
    std::vector<double> wall_ms, cpu_ms;

private:
    struct alignas(64) Aligned {
        std::byte bytes[64];
    };
    rt_embree::Renderer renderer_;
    const GreyVideo &video_;
    std::uint32_t shading_px_;
    std::vector<std::uint16_t> pixels_;
    std::array<std::vector<Aligned>, 2> states_;
    std::size_t count_ = 0;
};

// The moving objects of a scene.
class MovingObjects {
public:
    explicit MovingObjects(const arhost_scene &scene) {
        const auto objects = arhost::raytracer_common::elements<arhost_object>(scene, scene.objects);
        if (std::ranges::any_of(objects, [](const arhost_object &object) { return object.moves != 0; }))
            motion_.emplace(scene);
    }
    // Returns NULL if nothing moves. The result is valid until the next call.
    const arhost_motion *at(double time_s, bool are_visible) {
        if (!motion_)
            return nullptr;
        now_ = motion_->at(time_s);
        moved_.assign(now_.moved, now_.moved + now_.moved_count);
        for (arhost_moved_object &object : moved_)
            object.is_visible = are_visible;
        now_.moved = moved_.data();
        return &now_;
    }

private:
    std::optional<arhost::scene::MotionEvaluator> motion_;
    arhost_motion now_{};
    std::vector<arhost_moved_object> moved_;
};

double median(std::vector<double> values) {
    std::ranges::sort(values);
    return values[values.size() / 2];
}

void run(int argc, char **argv) {
    std::map<std::string, double> value{{"width", 640}, {"height", 480},  {"samples", 1},       {"light_samples", 4},
                                        {"denoise", 1}, {"threads", 0},   {"photons", 1 << 14}, {"frames", 16},
                                        {"orbit", 0},   {"reference", 8}, {"stop", 1e9},        {"show", 0},
                                        {"hide", 1e9},  {"shading_px", 1}};
    std::string out;
    for (int i = 2; i < argc; ++i) {
        const std::string argument = argv[i], key = argument.substr(0, argument.find('='));
        if (key == "out")
            out = argument.substr(4);
        else if (value.contains(key))
            value[key] = std::strtod(argument.c_str() + key.size() + 1, nullptr);
        else
            throw std::runtime_error("unknown key " + key);
    }
    const auto width = static_cast<std::uint32_t>(value["width"]),
               height = static_cast<std::uint32_t>(value["height"]);
    const arhost_intrinsics intrinsics = arhost::bench::centred_pinhole(width, height, 1.15 * width);
    const arhost::scene::Arena arena = arhost::scene::load_scene(argv[1]).build();
    const arhost_host host = arhost::bench::printing_host("render-noise");
    const GreyVideo video(width, height);
    arhost_raytracer_setup setup = arhost::bench::linear_setup(arena.scene(), intrinsics);
    setup.video_format = video.frame().format;
    rt_embree::Settings settings;
    settings.threads = static_cast<unsigned>(value["threads"]);
    settings.light_samples = static_cast<std::int32_t>(value["light_samples"]);
    rt_embree::Settings converged = settings;
    settings.samples = static_cast<std::uint32_t>(value["samples"]);
    settings.photons = static_cast<std::uint32_t>(value["photons"]);
    settings.denoise = value["denoise"] != 0;
    converged.samples = 64;
    Run noisy(setup, settings, arhost::Host(&host), video, static_cast<std::uint32_t>(value["shading_px"]));
    Run reference(setup, converged, arhost::Host(&host), video);
    const int frames = static_cast<int>(value["frames"]), references = static_cast<int>(value["reference"]);
    MovingObjects objects(arena.scene());
    const auto motion_at = [&](int frame) {
        constexpr double frame_rate_hz = 30;
        return objects.at(std::min<double>(frame, value["stop"]) / frame_rate_hz,
                          frame >= value["show"] && frame < value["hide"]);
    };
    std::vector<Codes> last; // the pictures of the last frames
    for (int i = 0; i < frames; ++i) {
        Codes codes =
            noisy.frame(orbiting(intrinsics, 25 + i * value["orbit"]), static_cast<std::uint64_t>(i), motion_at(i));
        if (!out.empty())
            write_ppm(out + "/frame-" + std::to_string(i) + ".ppm", codes, width, height);
        last.push_back(std::move(codes));
    }
    const arhost_camera camera = orbiting(intrinsics, 25 + (frames - 1) * value["orbit"]);
    Codes mean;
    for (int i = 0; i < references; ++i) {
        const Codes codes = reference.frame(camera, static_cast<std::uint64_t>(i), motion_at(frames - 1));
        if (mean.empty())
            mean.resize(codes.size());
        for (std::size_t k = 0; k < codes.size(); ++k)
            mean[k] += codes[k] / static_cast<float>(references);
    }
    if (!out.empty())
        write_ppm(out + "/reference.ppm", mean, width, height);
    const std::vector<Kind> kind_of = kinds(noisy.scene(), camera);
    std::array<double, kind_count> squares{}, variances{};
    std::array<std::size_t, kind_count> counts{};
    const std::size_t still = std::min<std::size_t>(last.size(), 8);
    for (std::size_t k = 0; k < mean.size(); ++k) {
        const Kind kind = kind_of[k / 3];
        const double difference = double{last.back()[k]} - double{mean[k]};
        squares[kind] += difference * difference;
        double first = 0, second = 0;
        for (std::size_t i = last.size() - still; i < last.size(); ++i) {
            first += double{last[i][k]};
            second += double{last[i][k]} * double{last[i][k]};
        }
        variances[kind] += second / static_cast<double>(still) - first * first / static_cast<double>(still * still);
        ++counts[kind];
    }
    std::printf("%-14s %10s %10s %10s\n", "surface", "pixels", "RMS", "flicker");
    for (int kind = outside; kind < kind_count; ++kind)
        if (counts[kind] > 0)
            std::printf("%-14s %10zu %10.2f %10.2f\n", names[kind], counts[kind] / 3,
                        std::sqrt(squares[kind] / counts[kind]),
                        std::sqrt(std::max(variances[kind], 0.0) / counts[kind]));
    std::printf("wall time %.1f ms, CPU time %.1f ms a frame\n", median(noisy.wall_ms), median(noisy.cpu_ms));
}

} // namespace

int main(int argc, char **argv) {
    try {
        if (argc < 2)
            throw std::runtime_error("usage: render-noise SCENE [KEY=VALUE...]");
        run(argc, argv);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "render-noise: %s\n", error.what());
        return 1;
    }
}
