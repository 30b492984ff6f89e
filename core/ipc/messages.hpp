// SPDX-License-Identifier: Apache-2.0
//
// The control messages between host and worker, in the order of a worker's life. Either side sends a struct with
// `encode` and reads it with `parse`; messages.cpp has the JSON of each.
//
// Once a worker is ready, the host announces each message with a `control` command in the ring, which fixes the order
// of messages and frames.
#pragma once

#include "ipc/json_abi.hpp"
#include "sandbox/sandbox.hpp"

#include <stdexcept>
#include <variant>

namespace arhost::ipc {

// The peer sent a message with a missing field or one of the wrong type.
class ProtocolViolation : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

namespace messages {

// ---- host → worker ---------------------------------------------------------------------------------

// The first message to the worker of a plugin; with the host's page and the worker's page.
struct Open {
    static constexpr const char *type = "open";
    std::string plugin; // the shared object
    sandbox::Policy sandbox;
};

// The first message to a scene loader.
struct Load {
    static constexpr const char *type = "load";
    std::string scene; // its file
    sandbox::Policy sandbox;
};

// After Hello, any number of times; the answer is Devices or Failed.
struct ListDevices {
    static constexpr const char *type = "list-devices";
};

struct SourceSetup {
    std::uint64_t first_sequence = 0;
    double fps = 0;
    bool paced = false;
    std::optional<arhost_intrinsics> intrinsics;
};
struct TrackerSetup {
    arhost_frame_format format{};
    arhost_intrinsics intrinsics{};
    std::vector<arhost_marker_config> markers;
};
struct RaytracerSetup {
    std::uint32_t width = 0, height = 0;
    arhost_intrinsics intrinsics{};
};
struct SinkSetup {
    std::uint32_t width = 0, height = 0;
    double fps = 0;
    std::uint64_t first_sequence = 0;
    std::optional<arhost_intrinsics> intrinsics;
};
using Setup = std::variant<SourceSetup, TrackerSetup, RaytracerSetup, SinkSetup>;

// Create and start the plugin's instance; a ray tracer's comes with the scene's arena.
struct Create {
    static constexpr const char *type = "create";
    std::vector<OptionValue> options;
    Setup setup;
};

// Map the memory that comes along: the worker's output slots, or input slots.
struct Attach {
    static constexpr const char *type = "attach";
    bool is_output = false;
    std::uint32_t generation = 0;
    SlotLayout layout;
};

// Unmap input slots.
struct Detach {
    static constexpr const char *type = "detach";
    std::uint32_t generation = 0;
};

struct Stop {
    static constexpr const char *type = "stop";
};

// ---- worker → host ---------------------------------------------------------------------------------

// The plugin is open.
struct Hello {
    static constexpr const char *type = "hello";
    PluginDescription descriptor;
    std::string sandbox; // the level reached
};

struct Devices {
    static constexpr const char *type = "devices";
    std::optional<DeviceList> list; // none: the plugin lacks the extension
};

// The plugin has started.
struct Ready {
    static constexpr const char *type = "ready";
    std::optional<arhost_frame_format> format; // a source's
    std::uint64_t frame_count = 0;             // a source's; 0: unknown
    std::optional<arhost_intrinsics> intrinsics;
};

struct Attached {
    static constexpr const char *type = "attached";
    bool is_output = false;
    std::uint32_t generation = 0;
};

struct Detached {
    static constexpr const char *type = "detached";
    std::uint32_t generation = 0;
};

struct Stopped {
    static constexpr const char *type = "stopped";
    arhost_status status = ARHOST_STATUS_OK;
    std::string text; // the last error, unless `status` is OK
};

// At any time.
struct Log {
    static constexpr const char *type = "log";
    arhost_severity severity = ARHOST_SEVERITY_DEBUG;
    std::string text;
};

// During a long call; restarts its deadline.
struct Progress {
    static constexpr const char *type = "progress";
    double fraction = 0;
    std::string what;
};

struct Failed {
    static constexpr const char *type = "failed";
    arhost_status status = ARHOST_STATUS_ERROR_INTERNAL;
    std::string text;
};

// A sink ends the run: its window was closed.
struct End {
    static constexpr const char *type = "end";
};

// The scene loader opens a file.
struct Reads {
    static constexpr const char *type = "reads";
    std::string path, node; // of base::FileIdentity
};

// The scene loader is done; with the arena.
struct Loaded {
    static constexpr const char *type = "loaded";
};

} // namespace messages

template <class T> bool is(const Message &message) {
    return message.body.at("type") == T::type;
}

// For each type above.
template <class T> Json encode(const T &message);
// Throws ProtocolViolation, or std::runtime_error if a value is out of range. The type must be T's.
template <class T> T parse(const Message &message);

} // namespace arhost::ipc
