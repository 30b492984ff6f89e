// SPDX-License-Identifier: Apache-2.0
//
// Targets for files written by users or other programs. For errors in them, only exceptions of type Error are
// allowed.
#include "../core/session/log_samples.hpp"
#include "input.hpp"
#include "targets.hpp"

#include "camera/calibration.hpp"
#include "camera/trajectory.hpp"
#include "cli/session_grants.hpp"
#include "run_config/configuration.hpp"
#include "session/log_reader.hpp"
#include "tracker_pattern/pattern.hpp"

#include <arhost-cpp/numbered_name.hpp>
#include <arhost-cpp/plugin.hpp>

namespace arhost::fuzz {
namespace {

std::string text_of(Bytes bytes) {
    return {bytes.begin(), bytes.end()};
}
Bytes bytes_of(std::string_view text) {
    return {reinterpret_cast<const std::uint8_t *>(text.data()), text.size()};
}

// One option of every type.
model::PluginDescription plugin_of(arhost_kind kind) {
    model::PluginDescription plugin;
    plugin.kind = kind;
    plugin.id = "plugin";
    plugin.options = {{"on", ARHOST_OPTION_BOOL, "false", 0, 0, {}, ""},
                      {"count", ARHOST_OPTION_INTEGER, "3", 1, 10, {}, ""},
                      {"factor", ARHOST_OPTION_REAL, "0.5", 0, 1, {}, ""},
                      {"name", ARHOST_OPTION_TEXT, "a", 0, 0, {"a", "b"}, ""},
                      {"path", ARHOST_OPTION_OUTPUT_PATH, "", 0, 0, {}, ""}};
    return plugin;
}

std::vector<std::byte> packed(const session::Log &log) {
    std::vector<std::byte> memory(packed_size(log));
    pack(log, memory);
    return memory;
}

// Creates the files that configurations refer to.
void make_folder() {
    for (const char *plugin : {"source.so", "tracker.so", "rt.so", "sink.so"})
        write_scratch(std::filesystem::path("plugins") / plugin, {});
    write_scratch("scene.yaml", bytes_of("version: 1\naxes: z-up\nobjects: []\n"));
    write_scratch("camera.yaml",
                  bytes_of("image_width: 64\nimage_height: 48\ncamera_matrix: {rows: 3, cols: 3, data: "
                           "[60, 0, 31.5, 0, 60, 23.5, 0, 0, 1]}\ndistortion_coefficients: [0, 0, 0, 0]\n"));
    write_scratch("cameras.txt", bytes_of("0 0 10 0 0 0 0 1 0\n"));
    write_scratch("board.map.yaml",
                  bytes_of("version: 1\nfamily: tag16h5\nmarkers:\n- {id: 0, side_mm: 8, position_mm: [0, 0, 0]}\n"
                           "- {id: 1, corners_mm: [[9, 8, 0], [17, 8, 0], [17, 0, 0], [9, 0, 0]]}\n"));
}

} // namespace

void run_configuration(Bytes bytes) {
    [[maybe_unused]] static const bool made = (make_folder(), true);
    try {
        const auto root = yaml::Node::parse(text_of(bytes), (scratch() / "run.yaml").string());
        const run_config::Configuration configuration = run_config::parse(root, scratch() / "plugins");
        std::vector<std::string> notes;
        if (configuration.source)
            run_config::options_for(plugin_of(ARHOST_KIND_SOURCE), ARHOST_KIND_SOURCE, *configuration.source, 0,
                                    notes);
        for (const auto &output : configuration.outputs)
            run_config::options_for(plugin_of(ARHOST_KIND_SINK), ARHOST_KIND_SINK, output, 0, notes);
    } catch (const yaml::Error &) {
    }
}

void run_map(Bytes bytes) {
    [[maybe_unused]] static const bool made = (make_folder(), true);
    write_scratch("fuzzed.map.yaml", bytes);
    try {
        const auto root = yaml::Node::parse("version: 1\nsource: {plugin: source}\n"
                                            "tracker: {plugin: tracker, targets: [{map: fuzzed.map.yaml}]}\n"
                                            "outputs: [{plugin: sink}]\n",
                                            (scratch() / "run.yaml").string());
        run_config::parse(root, scratch() / "plugins");
    } catch (const yaml::Error &) {
    }
}

void run_session(Bytes bytes) {
    std::string rest = text_of(bytes);
    for (const char *file : {"session.json", "configuration.yaml", "frames.jsonl"}) {
        const std::string part = rest.substr(0, rest.find('\0'));
        rest.erase(0, part.size() + 1);
        write_scratch(std::filesystem::path("session") / file, bytes_of(part));
    }
    write_scratch("session/video.mkv", bytes_of(std::string(200, 'v')));
    try {
        const cli::Session session = cli::read_session(scratch() / "session");
        cli::expect_granted(session.configuration, session, {}, true);
    } catch (const yaml::Error &) {
    }
    std::optional<session::Log> log;
    try {
        log = session::read_log(scratch() / "session/frames.jsonl", 200, [] {});
    } catch (const yaml::Error &) {
    }
    if (log) { // the host accepts every log that the worker accepts
        const std::uint64_t bytes = std::filesystem::file_size(scratch() / "session/frames.jsonl");
        if (packed_size(*log) > session::max_expansion * bytes)
            throw std::logic_error("the packed log is larger than the host accepts");
        session::unpack(packed(*log), bytes / session::min_line_bytes);
    }
}

void run_session_log(Bytes bytes) {
    Input input(bytes);
    std::vector<std::byte> memory = packed(session::test::full_log());
    input.corrupt(memory);
    const std::size_t cut = input.number<std::uint16_t>() % memory.size();
    try {
        const session::Log log = session::unpack(std::span(memory).first(memory.size() - cut));
        if (const auto again = packed(log); again != packed(session::unpack(again)))
            throw std::logic_error("a packed log changes when it is packed again");
        for (const session::RecordedFrame &frame : log.frames)
            for (const arhost_target &target : frame.targets)
                if (target.first_observation + std::uint64_t{target.observation_count} > frame.observations.size())
                    throw std::logic_error("observations are out of range");
    } catch (const std::runtime_error &) {
    }
}

void run_patt(Bytes bytes) {
    try {
        const tracker_pattern::Pattern pattern(write_scratch("fuzzed.patt", bytes).string());
        pattern.match(tracker_pattern::Samples::ones(pattern.side(), pattern.side()));
    } catch (const Failure &failure) {
        if (failure.status() != ARHOST_STATUS_ERROR_CONFIGURATION)
            throw;
    }
}

void run_calibration(Bytes bytes) {
    try {
        camera::read_calibration(write_scratch("calibration.yaml", bytes));
    } catch (const yaml::Error &) {
    }
}

void run_trajectory(Bytes bytes) {
    try {
        const camera::Trajectory trajectory = camera::read_trajectory(write_scratch("trajectory", bytes));
        trajectory.at_or_after(trajectory.end() / 2);
    } catch (const yaml::Error &) {
    }
}

void run_pattern(Bytes bytes) {
    const std::string text = text_of(bytes), name = text.substr(0, text.find('\0'));
    try {
        const NumberedName pattern(name);
        pattern.number(text.substr(std::min(name.size() + 1, text.size())));
        for (const std::uint64_t number : {std::uint64_t(0), std::uint64_t(12345), ~std::uint64_t(0)})
            if (pattern.number(pattern.name(number)) != number)
                throw std::logic_error("a numbered file name does not read back " + pattern.name(number));
    } catch (const std::invalid_argument &) {
    }
}

} // namespace arhost::fuzz
