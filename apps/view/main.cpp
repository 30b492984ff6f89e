// SPDX-License-Identifier: Apache-2.0
//
// arhost-view shows a model or a scene in a window, or renders a picture or a film of it. `arhost view` runs it.
#include "base/atomic_file.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "command_line/command_line.hpp"
#include "view/film.hpp"
#include "view/interruption.hpp"
#include "view/picture.hpp"
#include "view/report.hpp"
#include "view/window.hpp"

#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>

namespace {

namespace base = arhost::base;
namespace fs = std::filesystem;
using namespace arhost::view;
using Vector = std::array<double, 3>;

struct Arguments {
    std::string file, environment, output, label, ray_tracer = "rt_embree", animation, variant, backdrop = "grey";
    std::optional<Vector> eye, look_at, up;
    double field_of_view = 45, time_s = 0, seconds = 6, fps = 25;
    std::array<std::uint32_t, 2> size{800, 600};
    std::optional<int> samples, light_samples;
    std::vector<std::string> settings;
    bool transparent = false, info = false;

    Lens lens() const { return {field_of_view, size[0], size[1]}; }
    OptionSettings options() const {
        OptionSettings options{{}, settings};
        if (samples)
            options.numbers.emplace_back("samples", *samples);
        if (light_samples)
            options.numbers.emplace_back("light_samples", *light_samples);
        return options;
    }
};

void define(arhost::command_line::CommandLine &app, Arguments &arguments) {
    const auto point = [&](const char *name, std::optional<Vector> &value, const char *description) {
        app.option(name, value, description).separator(',').type_name("X,Y,Z");
    };
    app.option("FILE", arguments.file, "A model (glTF, OBJ, PLY or STL) or a scene (YAML)").required();
    app.option("--output,-o", arguments.output,
               "Write a picture (.png, .jpg, .ppm) or a film of one turn (.mp4, .mkv, .mov); default: a window")
        .type_name("FILE");
    app.flag("--info", arguments.info, "Only print what the file contains");
    app.option("--animation", arguments.animation, "Of a glTF file (default: the first)").type_name("NAME|all|none");
    app.option("--variant", arguments.variant, "Variant of a glTF file").type_name("NAME");
    app.option("--environment", arguments.environment, "Picture in all directions that lights a model (.hdr, .exr)")
        .type_name("FILE");
    point("--eye", arguments.eye, "Position of the camera in mm (default: shows the whole model)");
    point("--look-at", arguments.look_at, "Point at the centre of the picture (default: the middle of the model)");
    point("--up", arguments.up, "Up direction (default: the scene's; of OBJ and PLY y, of STL z)");
    app.option("--fov", arguments.field_of_view, "Vertical field of view, in degrees")
        .range(1.0, 170.0)
        .show_default();
    app.option("--size", arguments.size, "Size of the picture or the window, in px")
        .separator('x')
        .type_name("WIDTHxHEIGHT")
        .range(1, 16384)
        .default_text("800x600");
    app.option("--time", arguments.time_s, "Time of the animation in s; animations repeat")
        .check([](const std::string &text) {
            const double seconds = std::strtod(text.c_str(), nullptr);
            return seconds >= 0 && seconds <= 1e6 ? std::string()
                                                  : "must be 0 to 1e6, is " + text; // also rejects NaN
        })
        .show_default();
    app.option("--seconds", arguments.seconds, "Length of a film").range(0.1, 3600).show_default();
    app.option("--fps", arguments.fps, "Frames per second of a film").range(1, 240).show_default();
    app.option("--raytracer", arguments.ray_tracer, "Ray tracer plugin, as in a configuration")
        .type_name("NAME|PATH")
        .show_default();
    app.option("--set", arguments.settings, "Plugin option (repeatable); arhost plugins --options lists them")
        .type_name("KEY=VALUE")
        .one_value_each();
    app.option("--samples", arguments.samples,
               "Plugin option 'samples' per pixel (default of pictures: 16, if supported)")
        .range(1, 256);
    app.option("--light-samples", arguments.light_samples, "Plugin option 'light_samples': shadow rays per sample")
        .range(1, 256);
    app.option("--label", arguments.label, "Text to draw into the picture");
    app.option("--backdrop", arguments.backdrop, "What is behind").one_of({"grey", "checkerboard"}).show_default();
    app.flag("--transparent", arguments.transparent, "Keep alpha (PNG) instead of the backdrop");
}

enum class Output { window, picture, film };

Output kind_of(const std::string &output) {
    if (output.empty())
        return Output::window;
    const std::string extension = fs::path(output).extension();
    for (const char *known : {".png", ".jpg", ".jpeg", ".ppm"})
        if (extension == known)
            return Output::picture;
    for (const char *known : {".mp4", ".mkv", ".mov"})
        if (extension == known)
            return Output::film;
    throw base::InvalidInput(output +
                             ": the file's name must end in .png, .jpg, .jpeg or .ppm, or in .mp4, .mkv or .mov");
}

glm::dvec3 point_of(const Vector &v) {
    return {v[0], v[1], v[2]};
}

// The view that the options describe; what they leave open fits the model.
Orbit orbit_of(const Arguments &arguments, const Stage &stage, bool from_all_sides) {
    const glm::dvec3 up = arguments.up ? point_of(*arguments.up) : stage.up();
    if (!(glm::length(up) > 0))
        throw base::InvalidInput("--up: must not be 0,0,0");
    const Orbit fitted(stage.box, up, arguments.lens(), from_all_sides);
    if (!arguments.eye && !arguments.look_at)
        return fitted;
    const glm::dvec3 eye = arguments.eye ? point_of(*arguments.eye) : fitted.eye(),
                     target = arguments.look_at ? point_of(*arguments.look_at) : fitted.target();
    return {eye, target, up};
}

cv::Mat finished(const Arguments &arguments, const arhost::ImageView &image, const cv::Mat &below) {
    cv::Mat picture = arguments.transparent ? with_alpha(image, below.cols, below.rows) : composited(image, below);
    if (!arguments.label.empty())
        draw_text(picture, arguments.label, picture.rows / 25.0, 0);
    return picture;
}

void write(const Arguments &arguments, const Stage &stage, Output kind) {
    base::AtomicFile file(kind == Output::picture ? arguments.output : "");
    Orbit orbit = orbit_of(arguments, stage, kind == Output::film);
    const arhost_camera camera = orbit.camera(arguments.lens());
    const cv::Mat below = backdrop(arguments.backdrop == "grey" ? Backdrop::grey : Backdrop::checkerboard,
                                   static_cast<int>(arguments.size[0]), static_cast<int>(arguments.size[1]));
    RayTracer ray_tracer(arguments.ray_tracer, arguments.options(),
                         kind == Output::film ? Quality::film : Quality::still, stage.scene(), camera.intrinsics,
                         arguments.transparent);
    if (kind == Output::picture) {
        const cv::Mat picture = finished(arguments, ray_tracer.render(camera, arguments.time_s), below);
        return file.write(encoded(picture, fs::path(arguments.output).extension()));
    }
    const int frames = std::max(1, static_cast<int>(std::lround(arguments.seconds * arguments.fps)));
    const bool is_terminal = ::isatty(STDERR_FILENO) == 1;
    write_film(arguments.output, frames, arguments.fps, [&](int i) {
        throw_if_interrupted();
        if (is_terminal)
            std::fprintf(stderr, "\rframe %d of %d%s", i + 1, frames, i + 1 < frames ? "" : "\n");
        const arhost::ImageView &image =
            ray_tracer.render(orbit.camera(arguments.lens()), arguments.time_s + i / arguments.fps);
        orbit.turn(360.0 / frames, 0);
        return finished(arguments, image, below);
    });
}

void view(const Arguments &arguments) {
    const Output kind = arguments.info ? Output::window : kind_of(arguments.output);
    if (arguments.transparent && (kind != Output::picture || fs::path(arguments.output).extension() != ".png"))
        throw base::InvalidInput("--transparent: only PNG pictures have alpha; add --output FILE.png");
    std::optional<Display> display;
    if (kind == Output::window && !arguments.info)
        display.emplace();
    Loader loader(
        {arguments.file, arguments.environment, arguments.output,
         arguments.up ? std::optional(std::abs((*arguments.up)[2]) > std::abs((*arguments.up)[1])) : std::nullopt});
    Selection selection{"", arguments.variant};
    Content content = loader.load(selection);
    if (arguments.animation.empty())
        selection.animation = loader.is_gltf() && !content.contents.animations.empty() ? "0" : "";
    else if (arguments.animation != "none")
        selection.animation = arguments.animation;
    Report report{
        arguments.file,  fs::file_size(arguments.file), box_at_start(content.scene()), {}, selection.animation,
        content.messages};
    if (!selection.animation.empty())
        content = loader.load(selection);
    Stage stage = stage_of(std::move(content), loader.is_model());
    if (stage.content.scene().duration_s > 0)
        report.over_animation = stage.box;
    const arhost::scene::Contents &contents = stage.content.contents;
    std::fputs(to_text(report, stage.content.scene(), contents).c_str(), stdout);
    std::fflush(stdout);
    if (arguments.info)
        return;
    if (kind != Output::window)
        return write(arguments, stage, kind);
    const WindowSettings settings{arguments.file, arguments.ray_tracer, arguments.options(), true, contents};
    const Wanted first{orbit_of(arguments, stage, false), arguments.lens(), arguments.time_s, selection};
    show_window(*display, settings, loader, std::move(stage), first);
}

} // namespace

int main(int argc, char **argv) {
    base::prepare_process();
    arhost::command_line::CommandLine app(
        "Shows a model or a scene in a window, or writes a picture or a film of it, and "
        "prints what it contains\n(docs/scenes.md)",
        "arhost view");
    Arguments arguments;
    define(app, arguments);
    struct sigaction on_signal {};
    on_signal.sa_handler = [](int signal) { interruption = signal; };
    on_signal.sa_flags = static_cast<int>(SA_RESETHAND); // a second signal ends the process at once
    for (const int signal : {SIGINT, SIGTERM, SIGHUP})
        ::sigaction(signal, &on_signal, nullptr);
    return base::exit_status_of([&]() -> int {
        if (const auto status = app.parse(argc, argv))
            return *status;
        try {
            view(arguments);
        } catch (const base::Interrupted &interrupted) {
            base::end_by_signal(interrupted.signal);
        }
        return base::success;
    });
}
