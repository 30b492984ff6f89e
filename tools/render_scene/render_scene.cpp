// SPDX-License-Identifier: Apache-2.0
//
// A picture of a scene file from a given place, by any ray tracer's plugin: without a video, a tracker or a marker.
#include "base/file_identity.hpp"
#include "base/text.hpp"
#include "base/usage.hpp"
#include "base/whole_file.hpp"
#include "base/write_all.hpp"
#include "ray_tracer.hpp"
#include "scene/loader.hpp"

#include <CLI/CLI.hpp>
#include <glm/trigonometric.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

namespace {

namespace base = arhost::base;
using Vector = std::array<double, 3>;

enum ExitStatus { bad_usage = 2 };

struct View {
    Vector eye{0, -300, 200}, look_at{0, 0, 40}, up{};
    double field_of_view = 45;
    std::array<std::uint32_t, 2> size{800, 600};
};

arhost_camera camera_of(const View &view) {
    const double f = view.size[1] / 2.0 / std::tan(glm::radians(view.field_of_view / 2));
    arhost_camera camera{};
    camera.struct_size = sizeof camera;
    for (int i = 0; i < 3; ++i) {
        camera.eye[i] = view.eye[i];
        camera.look_at[i] = view.look_at[i];
        camera.up[i] = view.up[i];
    }
    camera.intrinsics.struct_size = sizeof camera.intrinsics;
    camera.intrinsics.width = view.size[0];
    camera.intrinsics.height = view.size[1];
    camera.intrinsics.distortion = ARHOST_DISTORTION_NONE;
    camera.intrinsics.fx = camera.intrinsics.fy = f;
    camera.intrinsics.cx = (view.size[0] - 1) / 2.0;
    camera.intrinsics.cy = (view.size[1] - 1) / 2.0;
    return camera;
}

// Straight alpha over a checkerboard of two greys, as painting programs show what is transparent.
cv::Mat over_checkerboard(const cv::Mat &rgba) {
    cv::Mat picture(rgba.size(), CV_8UC3);
    for (int y = 0; y < rgba.rows; ++y)
        for (int x = 0; x < rgba.cols; ++x) {
            const cv::Vec4b &above = rgba.at<cv::Vec4b>(y, x);
            const int below = (x / 20 + y / 20) % 2 ? 176 : 192;
            for (int i = 0; i < 3; ++i)
                picture.at<cv::Vec3b>(y, x)[i] =
                    static_cast<std::uint8_t>((above[2 - i] * above[3] + below * (255 - above[3]) + 127) / 255);
        }
    return picture;
}

cv::Mat render(const std::string &file, View view, double time_s, const RayTracer &ray_tracer,
               const std::string &output) {
    arhost::scene::LoadCallbacks callbacks;
    callbacks.warning = [](const std::string &text) { std::fprintf(stderr, "%s\n", base::printable(text).c_str()); };
    callbacks.reads = [&, of_output = base::identity_of(output)](const std::filesystem::path &read) {
        if (const auto [path, node] = base::identity_of(read); path == of_output.path || node == of_output.node)
            throw std::runtime_error(output + ": is a file that the scene reads; choose another");
    };
    callbacks.reads(file);
    const arhost::scene::Arena arena = arhost::scene::load_scene(std::filesystem::path(file), callbacks).build();
    if (const std::string wrong = arhost::scene::validate(arena.bytes()); !wrong.empty())
        throw std::runtime_error(file + ": " + wrong);
    if (view.up == Vector{})
        view.up[arena.scene().axes == ARHOST_AXES_Z_UP ? 2 : 1] = 1;
    return ray_tracer.render(arena.scene(), camera_of(view), time_s);
}

// The plugin's options: those that have a name of their own here, and above them what `--set` says.
arhost::yaml::Node options_of(const std::optional<int> &samples, const std::optional<int> &light_samples,
                              const std::vector<std::string> &settings) {
    arhost::yaml::Node options = arhost::yaml::Node::parse("{}", "render-scene");
    if (samples)
        options.override_value("samples", std::to_string(*samples), "--samples");
    if (light_samples)
        options.override_value("light_samples", std::to_string(*light_samples), "--light-samples");
    for (const std::string &setting : settings) {
        const std::size_t equals = setting.find('=');
        if (equals == 0 || equals == std::string::npos)
            throw std::runtime_error("--set " + setting + ": must be key=value, as in --set samples=4");
        options.override_value(setting.substr(0, equals), setting.substr(equals + 1));
    }
    return options;
}

} // namespace

int main(int argc, char **argv) {
    std::signal(SIGPIPE, SIG_IGN); // a full disk, and who reads no more, are errors
    std::signal(SIGXFSZ, SIG_IGN);
    CLI::App app("Renders a scene file over a checkerboard into a PNG, JPEG or PPM file. Lengths are in mm.");
    std::string scene, output, label, ray_tracer = "rt_embree";
    View view;
    std::optional<int> samples, light_samples;
    std::vector<std::string> settings;
    double time_s = 0;
    bool transparent = false;
    app.add_option("scene", scene, "The scene file")->required();
    app.add_option("--eye", view.eye, "Where the camera is")
        ->delimiter(',')
        ->type_name("X,Y,Z")
        ->capture_default_str();
    app.add_option("--look-at", view.look_at, "What is in the picture's middle")
        ->delimiter(',')
        ->type_name("X,Y,Z")
        ->capture_default_str();
    app.add_option("--up", view.up, "What is up in the picture; without it, what is up in the scene")
        ->delimiter(',')
        ->type_name("X,Y,Z");
    app.add_option("--fov", view.field_of_view, "From the picture's top to its bottom, degrees")
        ->check(CLI::Range(1.0, 170.0))
        ->capture_default_str();
    app.add_option("--size", view.size, "Of the picture, px")
        ->delimiter('x')
        ->type_name("WIDTHxHEIGHT")
        ->check(CLI::Range(1, 16384))
        ->default_str(std::to_string(view.size[0]) + "x" + std::to_string(view.size[1]));
    app.add_option("--time", time_s, "When, in s; a scene that moves begins again when it is over")
        ->check([](const std::string &text) {
            const double seconds = std::strtod(text.c_str(), nullptr);
            return seconds >= 0 && seconds <= 1e6 ? std::string() : "must be 0 to 1e6, is " + text; // no NaN
        })
        ->capture_default_str();
    app.add_option("--raytracer", ray_tracer, "The plugin that traces, as a configuration names it")
        ->type_name("NAME|PATH")
        ->capture_default_str();
    app.add_option("--set", settings, "One of the plugin's options (again for more): arhost plugins --options")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--samples", samples, "The plugin's option 'samples', a pixel; without it 16, if it has that")
        ->check(CLI::Range(1, 256));
    app.add_option("--light-samples", light_samples, "Its option 'light_samples': shadow rays from each of them")
        ->check(CLI::Range(1, 256));
    app.add_option("--label", label, "A line of text to write into the picture");
    app.add_flag("--transparent", transparent, "Keep alpha (PNG) in place of the checkerboard");
    app.add_option("--output,-o", output, "The file to write")->required();
    app.failure_message(base::usage_failure);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        return app.exit(error) == 0 && base::stdout_is_written() ? EXIT_SUCCESS : bad_usage;
    }
    try {
        const std::string kind = std::filesystem::path(output).extension();
        if (kind != ".png" && kind != ".jpg" && kind != ".jpeg" && kind != ".ppm")
            throw std::runtime_error(output + ": its name must end in .png, .jpg or .ppm");
        base::WholeFile file(output);
        const cv::Mat rgba =
            render(scene, view, time_s, RayTracer(ray_tracer, options_of(samples, light_samples, settings)), output);
        cv::Mat picture;
        if (transparent)
            cv::cvtColor(rgba, picture, cv::COLOR_RGBA2BGRA);
        else
            picture = over_checkerboard(rgba);
        for (const auto &[colour, width] :
             {std::pair(cv::Scalar(255, 255, 255, 255), 7), {cv::Scalar(0, 0, 0, 255), 2}})
            if (!label.empty())
                cv::putText(picture, label, {14, picture.rows / 14}, cv::FONT_HERSHEY_SIMPLEX, picture.rows / 550.0,
                            colour, width, cv::LINE_AA);
        std::vector<unsigned char> bytes;
        if (!cv::imencode(kind, picture, bytes))
            throw std::runtime_error(output + ": the picture can't be encoded");
        file.write({bytes.begin(), bytes.end()});
    } catch (const std::exception &error) {
        std::fprintf(stderr, "render-scene: %s\n", base::printable(error.what()).c_str());
        return EXIT_FAILURE;
    }
}
