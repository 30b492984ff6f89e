// SPDX-License-Identifier: Apache-2.0
#include "cli/read_configuration.hpp"

#include "base/file_identity.hpp"
#include "base/program.hpp"
#include "camera/coordinates.hpp"

#include <cstdlib>

namespace arhost::cli {
namespace {

namespace fs = std::filesystem;

// Returns the coordinates set with the options of the dissertation's figure 7, which override `coordinates:` in the
// configuration; nullopt if none of these options is given.
std::optional<camera::Coordinates> coordinates_of(const Arguments &arguments) {
    const auto is_set = [](const double(&a)[3]) { return a[0] != 0 || a[1] != 0 || a[2] != 0; };
    if (!arguments.ar && !arguments.rt && !arguments.g1 && !arguments.g2 && !is_set(arguments.axis1) &&
        !is_set(arguments.axis2))
        return std::nullopt;
    camera::Coordinates coordinates;
    coordinates.ar = arguments.ar.value_or(coordinates.ar);
    coordinates.rt = arguments.rt.value_or(coordinates.rt);
    const auto axis = [](const double(&a)[3]) { return glm::dvec3(a[0], a[1], a[2]); };
    if (arguments.g1)
        coordinates.rotations.push_back({*arguments.g1, axis(arguments.axis1)});
    if (arguments.g2)
        coordinates.rotations.push_back({*arguments.g2, axis(arguments.axis2)});
    if (!arguments.g1 && is_set(arguments.axis1))
        throw yaml::Error("--x1, --y1 and --z1 need --g1, the angle in degrees");
    if (!arguments.g2 && is_set(arguments.axis2))
        throw yaml::Error("--x2, --y2 and --z2 need --g2, the angle in degrees");
    if (arguments.g2 && !arguments.g1)
        throw yaml::Error("--g2 sets the second rotation and needs --g1, the first rotation");
    if (const std::string problem = camera::problem_with(coordinates); !problem.empty())
        throw yaml::Error("--ar … --z2: " + problem);
    return coordinates;
}

void lift_deadlines(run_config::Configuration &configuration) {
    for_each_component(configuration, [](run_config::ComponentConfiguration &component) {
        base::Limits &limits = component.limits;
        limits.start = limits.frame = limits.stop = std::chrono::hours(1000);
        limits.start_total = limits.frame_total = limits.stop_total = std::chrono::hours(1000);
    });
}

// Throws if an output would overwrite one of arhost's own programs, libraries and plugins.
void protect_programs(const run_config::FilesInUse &files) {
    std::error_code ignored;
    for (fs::directory_iterator entry(base::own_folder(), ignored), end; !ignored && entry != end;
         entry.increment(ignored))
        if (const std::string name = entry->path().filename(); name.starts_with("arhost"))
            files.protect(base::identity_of(entry->path()));
    for (fs::recursive_directory_iterator entry(base::own_prefix() / "lib/arhost", ignored), end;
         !ignored && entry != end; entry.increment(ignored))
        if (entry->is_regular_file(ignored))
            files.protect(base::identity_of(entry->path()));
}

// Whether a program that may write to `folder` can change `file`, or replace a symbolic link on the way to it.
bool may_redirect(const fs::path &folder, const fs::path &file, int links = 40) {
    if (sandbox::contains(folder, base::real_path(file)))
        return true;
    for (fs::path at = file; at.has_relative_path(); at = at.parent_path()) {
        const fs::path parent = base::real_path(at.parent_path());
        std::error_code not_a_link;
        const fs::path target = fs::read_symlink(at, not_a_link);
        if (sandbox::contains(folder, parent) ||
            (!not_a_link && links > 0 && may_redirect(folder, parent / target, links - 1)))
            return true;
    }
    return false;
}

// Throws if a plugin may change the configuration, a map or a scene: with `--watch`, it could grant itself
// permissions.
void expect_watchable(const run_config::Configuration &configuration) {
    std::vector<fs::path> files{fs::absolute(configuration.node.file())};
    for (const run_config::Scene &scene : configuration.scenes)
        files.push_back(scene.file);
    if (configuration.tracker)
        files.insert(files.end(), configuration.tracker->map_files.begin(), configuration.tracker->map_files.end());
    for_each_component(configuration, [&](const run_config::ComponentConfiguration &component) {
        if (component.policy.mode == sandbox::Mode::none)
            return;
        for (const fs::path &folder : component.policy.writable)
            for (const fs::path &file : files)
                if (may_redirect(base::real_path(folder), file))
                    component.node.fail("may write to the folder of '" + file.string() +
                                        "', so with '--watch' it could change what runs; let it write to another "
                                        "folder, or remove '--watch'");
    });
}

} // namespace

void override_settings(yaml::Node &root, const Arguments &arguments) {
    if (const char *home = std::getenv("HOME"))
        root.expand_home(home);
    for (const std::string &setting : arguments.settings) {
        const std::size_t equals = setting.find('=');
        if (equals == 0 || equals == std::string::npos)
            throw yaml::Error("--set " + setting + ": must be key.path=value, as in --set source.fps=30");
        root.override_value(setting.substr(0, equals), setting.substr(equals + 1));
    }
    if (arguments.frames)
        root.override_value("frames", std::to_string(*arguments.frames), "--frames");
    if (arguments.in_process)
        root.override_value("sandbox", "none");
}

run_config::Configuration parse_configuration(const yaml::Node &root, const Arguments &arguments) {
    run_config::Configuration configuration = run_config::parse(root, base::own_prefix() / "lib/arhost/plugins");
    if (const auto coordinates = coordinates_of(arguments))
        configuration.coordinates = coordinates;
    for (run_config::ComponentConfiguration &output : configuration.outputs)
        output.debug_view = arguments.debug_view;
    if (arguments.in_process)
        lift_deadlines(configuration);
    protect_programs(configuration.files);
    if (arguments.watch)
        expect_watchable(configuration);
    return configuration;
}

run_config::Configuration read_configuration(const Arguments &arguments) {
    yaml::Node root = yaml::Node::load(arguments.file);
    override_settings(root, arguments);
    return parse_configuration(root, arguments);
}

} // namespace arhost::cli
