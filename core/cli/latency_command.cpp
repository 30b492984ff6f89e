// SPDX-License-Identifier: Apache-2.0
#include "cli/commands.hpp"
#include "cli/read_configuration.hpp"
#include "cli/run_command.hpp"
#include "latency/time_codes.hpp"

#include <spdlog/fmt/fmt.h>

namespace arhost::cli {
namespace {

// Returns the configuration without tracker and ray tracer, with a tracker of time codes.
run_config::Configuration latency_configuration(const Arguments &arguments) {
    yaml::Node root = yaml::Node::load(arguments.file);
    root.override_value("mode", "live", "arhost latency");
    root.override_value("tracker",
                        fmt::format("{{plugin: tracker_apriltag, targets: [{{ids: 0-{}, family: tag36h11, side_mm: "
                                    "100}}], options: {{closer_look: false}}}}",
                                    latency::TimeCodes::count - 1),
                        "arhost latency");
    override_settings(root, arguments);
    run_config::Configuration configuration = parse_configuration(root, arguments);
    if (!configuration.source || configuration.outputs.empty())
        throw yaml::Error(arguments.file + ": to measure latency, it needs the camera as 'source' and an output that "
                                           "shows the picture, as in 'outputs: [{plugin: sink_window, allow: "
                                           "[display]}]'");
    configuration.time_codes = true;
    configuration.raytracer.reset();
    configuration.trajectory.reset();
    for (run_config::ComponentConfiguration &output : configuration.outputs)
        std::erase_if(output.control,
                      [](const std::string &command) { return command != "quit" && command != "status"; });
    return configuration;
}

} // namespace

int latency(Arguments arguments, supervise::Starter &launcher) {
    if (!arguments.frames)
        arguments.frames = 600;
    return run(latency_configuration(arguments), arguments, launcher);
}

} // namespace arhost::cli
