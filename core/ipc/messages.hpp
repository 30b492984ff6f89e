// SPDX-License-Identifier: Apache-2.0
//
// The control messages between host and worker, in the order in which a worker usually receives and sends them. The
// sender converts a message struct to JSON with `encode`; the receiver converts it back with `parse`.
//
// Once a worker is ready, the host announces each message with a `control` command in the command ring. This
// defines the order of messages relative to frames.
#pragma once

#include "ipc/channel.hpp"
#include "ipc/memory.hpp"
#include "ipc/message.hpp"
#include "model/plugin_description.hpp"
#include "model/target.hpp"

#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace arhost::model {

// from_json throws nlohmann::json::exception, or std::runtime_error if check() fails.
void to_json(nlohmann::json &json, const PluginDescription &description);
void from_json(const nlohmann::json &json, PluginDescription &description);

} // namespace arhost::model

namespace arhost::ipc {

// Maximum size in bytes of a plugin's description as JSON, which must fit into a Hello message.
constexpr std::size_t max_descriptor_size = Channel::max_message_size - 1024;

// Thrown if the peer sent a message in which a field is missing or has the wrong type.
class ProtocolViolation : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

namespace messages {

// Maximum size in bytes of the field `text` of a message. Sender and receiver cut longer texts.
constexpr std::size_t max_text = 4000;

// ---- host → worker ---------------------------------------------------------------------------------

// The first message to a worker that runs a plugin. The descriptors of the host page and the worker page
// (protocol.hpp) accompany it.
struct Open {
    static constexpr const char *type = "open";
    std::string plugin; // path of the shared object
    Json sandbox{};     // sandbox::Policy
};

// The first message to a worker that loads a scene.
struct Load {
    static constexpr const char *type = "load";
    std::string scene;                   // path of the scene file
    std::vector<std::string> readable{}; // files and folders that glTF files outside of them may refer to
    Json sandbox{};                      // sandbox::Policy
    std::string content{};               // of the scene file, which is then not read; "": none
    bool lists_contents = false;         // the worker sends Listed
};

// The first message to a worker that reads the log of a session.
struct ReadLog {
    static constexpr const char *type = "read-log";
    std::string file;
    std::uint64_t video_bytes = 0; // size of the video; later frames are omitted
    Json sandbox{};                // sandbox::Policy
};

// May be sent after Hello and before Create, any number of times. The worker answers with Devices, in
// one or more parts, or with Failed.
struct ListDevices {
    static constexpr const char *type = "list-devices";
};

// `kind` names the setup in Create's JSON.
struct SourceSetup {
    static constexpr const char *kind = "source";
    std::uint64_t first_sequence = 0;
    double fps = 0;
    bool paced = false;
    std::optional<arhost_intrinsics> intrinsics;
};
struct TrackerSetup {
    static constexpr const char *kind = "tracker";
    arhost_frame_format format{};
    arhost_intrinsics intrinsics{};
    std::uint32_t full_search_every = 1;
    bool smooth = false, confirm = true;
};
struct RaytracerSetup {
    static constexpr const char *kind = "raytracer";
    std::uint32_t width = 0, height = 0;
    arhost_intrinsics intrinsics{};
    arhost_image_form form = ARHOST_IMAGE_FORM_STRAIGHT;
    arhost_compositing compositing = ARHOST_COMPOSITING_SRGB;
    std::optional<arhost_frame_format> video_format{}; // set: each command names a frame of this format
};
struct SinkSetup {
    static constexpr const char *kind = "sink";
    arhost_frame_format video_format{};
    double fps = 0;
    std::uint64_t first_sequence = 0;
    std::optional<arhost_intrinsics> intrinsics;
    std::string run_description{}; // "": none
};
// Maximum size of SinkSetup::run_description as a JSON string, so that the message fits into the channel.
constexpr std::size_t max_run_description = Channel::max_message_size - 32 * 1024;
using Setup = std::variant<SourceSetup, TrackerSetup, RaytracerSetup, SinkSetup>;

// Requests the worker to create and start the plugin's instance. The descriptor of the scene's arena accompanies it
// for a ray tracer, that of the targets (to_memory) for a tracker. The sockets of options of type LISTEN follow;
// the option's `integer` is its position among the descriptors.
struct Create {
    static constexpr const char *type = "create";
    std::vector<model::OptionValue> options;
    Setup setup;
};

// Requests the worker to map the shared memory whose descriptor accompanies this message. It contains either the
// worker's output slots or input slots.
struct Attach {
    static constexpr const char *type = "attach";
    bool is_output = false;
    std::uint32_t generation = 0;
    SlotLayout layout;
};

// Requests the worker to unmap the input slots with this generation.
struct Detach {
    static constexpr const char *type = "detach";
    std::uint32_t generation = 0;
};

// Requests the worker to change an option of the running plugin. The worker answers with OptionSet.
struct SetOption {
    static constexpr const char *type = "set-option";
    model::OptionValue option;
};

// Answers the Request with this id.
struct Answer {
    static constexpr const char *type = "answer";
    std::uint64_t id = 0;
    std::string answer; // a JSON object
};

struct Stop {
    static constexpr const char *type = "stop";
};

// ---- worker → host ---------------------------------------------------------------------------------

// The worker has loaded the plugin and negotiated the ABI version.
struct Hello {
    static constexpr const char *type = "hello";
    model::PluginDescription descriptor;
    std::string sandbox; // active and missing layers, from sandbox::to_text
};

// A part of the answer to ListDevices, which may be longer than a message. The parts together are the text of
// to_text(optional<DeviceList>).
struct Devices {
    static constexpr const char *type = "devices";
    static constexpr std::size_t max_part = 32 * 1024; // fits even if JSON escapes each byte
    std::string part;
    bool is_last = true;
};

// The plugin has started.
struct Ready {
    static constexpr const char *type = "ready";
    std::optional<arhost_frame_format> format;   // set only by a source
    std::uint64_t frame_count = 0;               // set only by a source; 0: unknown
    std::optional<arhost_intrinsics> intrinsics; // set only by a source that knows its camera
    std::uint64_t capabilities = 0;              // of the instance; set only by a ray tracer or a sink
    std::uint64_t state_size = 0;                // of a tracker (the worker's and the plugin's) or a ray tracer
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

// May be sent at any time.
struct Log {
    static constexpr const char *type = "log";
    arhost_severity severity = ARHOST_SEVERITY_DEBUG;
    std::string text;
};

// Sent during a long call; restarts the deadline of the call.
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

// A sink sends a command (arhost/control.h).
struct Request {
    static constexpr const char *type = "request";
    std::uint64_t id = 0;
    std::string command; // a JSON object
};

// The plugin has accepted a new value of an option, or `text` says why it has not.
struct OptionSet {
    static constexpr const char *type = "option-set";
    arhost_status status = ARHOST_STATUS_OK;
    std::string text;
};

// Sent when the plugin's counters have changed.
struct CountersChanged {
    static constexpr const char *type = "counters";
    model::Counters counters; // all of them
};

// A sink requests the end of the run, because the user closed its window.
struct End {
    static constexpr const char *type = "end";
};

// Reports a file that the scene loader is about to open.
struct Reads {
    static constexpr const char *type = "reads";
    std::string path, node; // as in base::FileIdentity
};

// Where the scene file has the first object of an anchor, as "scene.yaml:6:40: objects[0].on". Sent for each anchor
// of the scene, in their order, before Loaded.
struct AnchorOrigin {
    static constexpr const char *type = "anchor-origin";
    std::string text;
};

// One of scene::Contents: an "animation" with its duration in s, a "variant", a "material", or the number of "nodes".
// Sent before Loaded.
struct Listed {
    static constexpr const char *type = "listed";
    std::string kind, text;
    double number = 0;
};

// The scene is loaded, or the log is read. The descriptor of the memory that contains the arena or the packed log
// (session/log.hpp) accompanies this message.
struct Loaded {
    static constexpr const char *type = "loaded";
};

} // namespace messages

template <class T> bool is(const Message &message) {
    return message.body.at("type") == T::type;
}

// Both functions are instantiated for each message type above.
template <class T> Json encode(const T &message);
// Requires is<T>(message). Throws ProtocolViolation if a field is missing or has the wrong type, and
// std::runtime_error if a value is out of range.
template <class T> T parse(const Message &message);

// Too many targets for a message are passed in shared memory, which accompanies the message.
SharedMemory to_memory(const std::vector<model::Target> &targets);
std::vector<model::Target> targets_from(const Mapping &memory); // throws ProtocolViolation

} // namespace arhost::ipc
