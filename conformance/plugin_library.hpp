// SPDX-License-Identifier: Apache-2.0
// The plugin in a test's process, opened as arhost-worker opens it, with its instances and their host.
#pragma once

#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"
#include "model/plugin_description.hpp"

#include <arhost/arhost.h>
#include <arhost/control.h>

#include <atomic>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace arhost::conformance {

// The plugin's current call, in memory that the parent reads after this process has ended.
class CallPage {
public:
    explicit CallPage(ipc::Mapping mapping) : mapping_(std::move(mapping)) {}
    // Relaxed: the parent reads it after this process has ended.
    void mark(ipc::Call call) const { word().store(static_cast<std::uint32_t>(call), std::memory_order_relaxed); }
    ipc::Call read() const { return static_cast<ipc::Call>(word().load(std::memory_order_relaxed)); }

private:
    std::atomic<std::uint32_t> &word() const { return mapping_.as<std::atomic<std::uint32_t>>(); }
    ipc::Mapping mapping_;
};

// Calls a function of the plugin and marks the call on the page.
template <class Function> auto in_call(const CallPage &calls, ipc::Call call, Function &&function) {
    struct Mark {
        const CallPage &calls;
        ~Mark() { calls.mark(ipc::Call::none); }
    };
    calls.mark(call);
    const Mark end{calls};
    return function();
}

using Settings = std::map<std::string, std::string>; // option values as text, as in the YAML

// Value of an output path; see ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT.
constexpr const char *standard_output = "-";

// A listening socket for an option of the type ARHOST_OPTION_LISTEN.
struct Socket {
    int fd;
    std::string address;
};
using Sockets = std::map<std::string, Socket>; // by the option's key

class PluginLibrary {
public:
    // `settings`: the user's option values. `scratch`: the folder for outputs. Does not open the plugin yet.
    PluginLibrary(std::filesystem::path file, Settings settings, const CallPage &calls,
                  std::filesystem::path scratch = {}, Sockets sockets = {})
        : file_(std::move(file)), settings_(std::move(settings)), calls_(calls), scratch_(std::move(scratch)),
          sockets_(std::move(sockets)) {}

    // The first call opens the plugin; throws std::runtime_error if arhost-worker would reject it.
    const arhost_entry_point &entry();
    const arhost_plugin &plugin();
    const arhost_descriptor &descriptor() { return *plugin().descriptor; }
    const arhost_option_descriptor *option(const std::string &key); // nullptr if not declared

    const std::filesystem::path &file() const { return file_; }
    const Settings &settings() const { return settings_; }
    const CallPage &calls() const { return calls_; }
    const std::filesystem::path &scratch() const { return scratch_; }
    const Sockets &sockets() const { return sockets_; }

private:
    std::filesystem::path file_;
    Settings settings_;
    const CallPage &calls_;
    std::filesystem::path scratch_;
    Sockets sockets_;
    const arhost_entry_point *entry_ = nullptr;
    const arhost_plugin *plugin_ = nullptr;
};

using model::options_of;

// Parses an option's value. Throws std::runtime_error if it is invalid.
arhost_option parse_option(const arhost_option_descriptor &option, const std::string &text);

class Host {
public:
    Host();
    Host(const Host &) = delete;
    Host &operator=(const Host &) = delete;

    const arhost_host *get() const { return &host_; }
    void cancel() { cancelled_ = true; }
    bool is_cancelled() const { return cancelled_; }
    std::vector<std::string> log() const;
    std::string last_error() const; // empty if there is none

    // For sinks: offers ARHOST_CONTROL_EXTENSION.
    void offer_control() { offers_control_ = true; }
    // While the sink is started. Commands without an answer are dropped at the end.
    void accept_commands(bool accept);
    // Answers each command with an error. Call between two calls of the sink's functions.
    void answer_commands();

private:
    static Host &self(const arhost_host *host) { return *static_cast<Host *>(host->context); }
    arhost_status send(const char *command, arhost_take_answer take, void *context);

    arhost_host host_;
    bool offers_control_ = false;
    mutable std::mutex mutex_; // plugins may log from any thread
    std::vector<std::string> log_;
    std::string last_error_;
    bool accepts_commands_ = false;
    std::vector<std::pair<arhost_take_answer, void *>> commands_; // without an answer
    std::atomic<bool> cancelled_{false};
};

// An instance of the plugin; the destructor calls destroy.
class Instance {
public:
    // `overrides` take precedence over the user's settings. An output path keeps its file name but is placed in
    // `folder` of the scratch folder, unless it is `standard_output`. A socket replaces the value of an option that
    // has one.
    explicit Instance(PluginLibrary &library, Settings overrides = {}, std::filesystem::path folder = {});
    ~Instance() { destroy(); }
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    // Additions that a host with a newer ABI may pass.
    struct Newer {
        std::size_t bytes = 0; // garbage after each option
        bool option = false;   // an unknown option after the declared ones
    };
    void create_or_fail(Newer newer); // throws Failure unless it succeeds
    arhost_status create(Newer newer);
    void create_or_fail() { create_or_fail({}); }
    arhost_status create() { return create({}); }
    void destroy();

    arhost_instance *get() const { return instance_; }
    Host &host() { return host_; }
    PluginLibrary &library() const { return library_; }

    // Throws Failure with the plugin's last error unless `status` is ARHOST_STATUS_OK.
    void expect_ok(const char *call, arhost_status status) const;

private:
    PluginLibrary &library_;
    Settings settings_;
    std::filesystem::path folder_;
    Host host_;
    arhost_instance *instance_ = nullptr;
};

// Returns the name of a status, such as "INVALID_ARGUMENT", or for example "0, which is not a valid status".
std::string status_name(arhost_status status);

// For example "read returned IO: the camera was unplugged".
std::string call_result(const char *call, arhost_status status, const Host &host);

} // namespace arhost::conformance
