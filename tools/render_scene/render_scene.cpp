// SPDX-License-Identifier: Apache-2.0
//
// render-scene renders a scene file with any ray tracer plugin. The user chooses the viewpoint; the program needs no
// video, tracker or marker.
#include "base/atomic_file.hpp"
#include "base/file_identity.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "command_line/command_line.hpp"
#include "ray_tracer.hpp"
#include "scene/scene_loader.hpp"

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

// Composites an RGBA image with straight alpha over a grey checkerboard.
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
    callbacks.info = callbacks.warning = [](const std::string &text) {
        std::fprintf(stderr, "%s\n", base::printable(text).c_str());
    };
    callbacks.reads = [&, of_output = base::identity_of(output)](const std::filesystem::path &read) {
        if (const auto [path, node] = base::identity_of(read); path == of_output.path || node == of_output.node)
            throw std::runtime_error(output + ": the scene reads this file; choose another output file");
    };
    callbacks.reads(file);
    arhost::scene::ArenaBuilder builder = arhost::scene::load_scene(std::filesystem::path(file), callbacks);
    const arhost::scene::Origins origins = builder.origins();
    const arhost::scene::Arena arena = std::move(builder).build();
    if (const auto fault = arhost::scene::find_fault(arena.bytes()))
        throw std::runtime_error(origins.message(*fault));
    if (view.up == Vector{})
        view.up[arena.scene().axes == ARHOST_AXES_Z_UP ? 2 : 1] = 1;
    return ray_tracer.render(arena.scene(), camera_of(view), time_s);
}

// Collects the plugin options: first those that have a command-line option of their own, then those of `--set`.
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
            throw std::runtime_error("--set " + setting + ": the argument must be key=value, as in --set samples=4");
        options.override_value(setting.substr(0, equals), setting.substr(equals + 1));
    }
    return options;
}

} // namespace

int main(int argc, char **argv) {
    std::signal(SIGPIPE, SIG_IGN); // writing to a closed pipe then fails with an error instead of a signal
    std::signal(SIGXFSZ, SIG_IGN);
    arhost::command_line::CommandLine app(
        "Renders a scene file over a checkerboard into a PNG, JPEG or PPM file. Lengths are in mm.");
    std::string scene, output, label, ray_tracer = "rt_embree";
    View view;
    std::optional<int> samples, light_samples;
    std::vector<std::string> settings;
    double time_s = 0;
    bool transparent = false;
    app.option("scene", scene, "The scene file").required();
    app.option("--eye", view.eye, "Position of the camera").separator(',').type_name("X,Y,Z").show_default();
    app.option("--look-at", view.look_at, "Point at the centre of the image")
        .separator(',')
        .type_name("X,Y,Z")
        .show_default();
    app.option("--up", view.up, "Up direction (default: the scene's)").separator(',').type_name("X,Y,Z");
    app.option("--fov", view.field_of_view, "Vertical field of view, in degrees").range(1.0, 170.0).show_default();
    app.option("--size", view.size, "Image size, in px")
        .separator('x')
        .type_name("WIDTHxHEIGHT")
        .range(1, 16384)
        .default_text(std::to_string(view.size[0]) + "x" + std::to_string(view.size[1]));
    app.option("--time", time_s, "Time of the animation in s; animations repeat")
        .check([](const std::string &text) {
            const double seconds = std::strtod(text.c_str(), nullptr);
            return seconds >= 0 && seconds <= 1e6 ? std::string()
                                                  : "must be 0 to 1e6, is " + text; // also rejects NaN
        })
        .show_default();
    app.option("--raytracer", ray_tracer, "Ray tracer plugin, as in a configuration")
        .type_name("NAME|PATH")
        .show_default();
    app.option("--set", settings, "Plugin option (repeatable); arhost plugins --options lists them")
        .type_name("KEY=VALUE")
        .one_value_each();
    app.option("--samples", samples, "Plugin option 'samples' per pixel (default 16, if supported)").range(1, 256);
    app.option("--light-samples", light_samples, "Plugin option 'light_samples': shadow rays per sample")
        .range(1, 256);
    app.option("--label", label, "Text to draw into the image");
    app.flag("--transparent", transparent, "Keep alpha (PNG) instead of the checkerboard");
    app.option("--output,-o", output, "The file to write").required();
    if (const auto status = app.parse(argc, argv))
        return base::flush_stdout() ? *status : bad_usage;
    try {
        const std::string kind = std::filesystem::path(output).extension();
        if (kind != ".png" && kind != ".jpg" && kind != ".jpeg" && kind != ".ppm")
            throw std::runtime_error(output + ": the file's name must end in .png, .jpg, .jpeg or .ppm");
        base::AtomicFile file(output);
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
            throw std::runtime_error(output + ": cannot encode the picture");
        file.write({bytes.begin(), bytes.end()});
    } catch (const std::exception &error) {
        std::fprintf(stderr, "render-scene: %s\n", base::printable(error.what()).c_str());
        return EXIT_FAILURE;
    }
}
