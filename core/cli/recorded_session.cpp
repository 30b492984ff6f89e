// SPDX-License-Identifier: Apache-2.0
#include "cli/recorded_session.hpp"

#include "host/documents.hpp"
#include "session/log.hpp"
#include "supervise/loading.hpp"

#include <limits>
#include <optional>
#include <span>

namespace arhost::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char *description_file = "session.json", *configuration_file = "configuration.yaml";
constexpr const char *log_file = "frames.jsonl";

void expect_file(const fs::path &file, const char *advice) {
    std::error_code error;
    if (!fs::is_regular_file(file, error))
        throw yaml::Error(file.string() + ": " + (fs::exists(file, error) ? "is not a file" : "is missing") + "; " +
                          advice);
}

} // namespace

Session read_session(const fs::path &path) {
    const fs::path folder = fs::absolute(path).lexically_normal();
    std::error_code error;
    if (!fs::is_directory(folder, error))
        throw yaml::Error(path.string() + ": " + (fs::exists(folder, error) ? "is not a folder" : "does not exist") +
                          "; name the folder of a session that sink_session has recorded");
    constexpr const char *advice = "a session that sink_session has recorded contains it (docs/sessions.md)";
    const fs::path description = folder / description_file, configuration = folder / configuration_file;
    for (const fs::path &file : {description, configuration, folder / log_file, folder / "video.mkv"})
        expect_file(file, advice);
    yaml::Node root = yaml::Node::load(description);
    root.require("format").choice({"arhost-session"});
    if (const yaml::Node version = root.require("version"); version.integer() != host::session_version)
        version.fail("must be " + std::to_string(host::session_version) +
                     ", the only version that this arhost can replay; record the session again, or replay it with "
                     "the arhost that has recorded it");
    yaml::Node::Origin origin{root.require("folder").text(), {}};
    const yaml::Node overridden = root.require("overridden");
    for (const auto &[path, relative_to] : overridden.entries())
        origin.overridden[path] = relative_to.text();
    return {folder, root, yaml::Node::load_copy(configuration, origin), {}, ""};
}

void read_log(Session &session, supervise::Context &context, sandbox::Mode mode, const base::Limits &limits) {
    const fs::path file = session.folder / log_file;
    std::error_code error;
    const std::uint64_t video_bytes = fs::file_size(session.video(), error);
    if (error)
        throw yaml::Error(session.video().string() + ": cannot be read: " + error.message());
    std::optional<session::Log> log;
    std::string failure;
    const supervise::Loading loading(
        context, {file, "session", "reader of the log", limits}, ipc::messages::ReadLog{file, video_bytes},
        {.mode = mode, .readable = {file}, .makes_shared_memory = true},
        {[](const ipc::Message &) {},
         [&](const ipc::SharedMemory &, std::span<const std::byte> bytes) {
             try {
                 const std::uint64_t log_bytes = fs::file_size(file);
                 if (bytes.size() > session::max_expansion * log_bytes)
                     throw std::runtime_error("it is too large for this file");
                 log = session::unpack(bytes, log_bytes / session::min_line_bytes);
             } catch (const std::exception &invalid) {
                 failure =
                     file.string() + ": the reader of the log has returned an invalid result: " + invalid.what();
             }
         },
         [&](const std::string &reason) { failure = reason; }});
    while (!log && failure.empty())
        context.reactor.run_once();
    if (!failure.empty())
        throw yaml::Error(failure);
    const std::string last = std::to_string(log->frames.back().number);
    if (log->lacking > 0)
        session.warning = session.video().string() + ": ends after frame " + last + ": the last " +
                          std::to_string(log->lacking) + " frames of " + log_file + " are missing";
    else if (!log->is_complete)
        session.warning = session.folder.string() + ": the recording was interrupted; it ends after frame " + last +
                          ", and frames that were not written then are missing";
    session.recording.frames = std::move(log->frames);
}

std::vector<std::string> Session::changed_scene_files() const {
    std::vector<std::string> changes;
    const yaml::Node files = description.require("scene_files");
    for (const yaml::Node &entry : files.items()) {
        const fs::path file = entry.require("file").text();
        const auto hash = entry.find("fnv1a");
        const auto found = host::fingerprint_of(file, hash ? std::numeric_limits<std::uint64_t>::max() : 0);
        const host::Fingerprint recorded{static_cast<std::uint64_t>(entry.require("bytes").integer(0)),
                                         hash ? hash->text() : ""};
        if (found != recorded)
            changes.push_back("the scene file '" + file.string() + "' " +
                              (found ? "has changed since the recording" : "of the recording cannot be read") +
                              "; the images will differ from the recorded ones");
    }
    return changes;
}

} // namespace arhost::cli
