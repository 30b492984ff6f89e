// SPDX-License-Identifier: Apache-2.0
//
// The plugin in the process of a test: opened as arhost-worker opens it, instances made of it, and the host
// that they speak with.
#pragma once

#include "ipc/json_abi.hpp"
#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"

#include <arhost/arhost.h>

#include <atomic>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace arhost::conformance {

// The call that the plugin is in, in memory that the parent reads once this process is dead.
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

// Calls a function of the plugin under its name.
template <class Function> auto in_call(const CallPage &calls, ipc::Call call, Function &&function) {
    struct Mark {
        const CallPage &calls;
        ~Mark() { calls.mark(ipc::Call::none); }
    };
    calls.mark(call);
    const Mark end{calls};
    return function();
}

using Settings = std::map<std::string, std::string>; // option values as they would stand in the YAML

class PluginLibrary {
public:
    // `settings`: the user's, in place of defaults. `scratch`: the folder that outputs go to. Opens nothing yet.
    PluginLibrary(std::filesystem::path file, Settings settings, const CallPage &calls,
                  std::filesystem::path scratch = {})
        : file_(std::move(file)), settings_(std::move(settings)), calls_(calls), scratch_(std::move(scratch)) {}

    // Opened at the first call; throws std::runtime_error where arhost-worker would refuse it.
    const arhost_entry_point &entry();
    const arhost_plugin &plugin();
    const arhost_descriptor &descriptor() { return *plugin().descriptor; }
    const arhost_option_descriptor *option(const std::string &key); // nullptr: not declared

    const std::filesystem::path &file() const { return file_; }
    const Settings &settings() const { return settings_; }
    const CallPage &calls() const { return calls_; }
    const std::filesystem::path &scratch() const { return scratch_; }

private:
    std::filesystem::path file_;
    Settings settings_;
    const CallPage &calls_;
    std::filesystem::path scratch_;
    const arhost_entry_point *entry_ = nullptr;
    const arhost_plugin *plugin_ = nullptr;
};

using ipc::options_of;

// The value that a text is for an option, or why it is none.
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
    std::string last_error() const; // "": there was none

private:
    static Host &self(const arhost_host *host) { return *static_cast<Host *>(host->context); }
    arhost_host host_;
    mutable std::mutex mutex_; // plugins log on threads of their own
    std::vector<std::string> log_;
    std::string last_error_;
    std::atomic<bool> cancelled_{false};
};

// From create to destroy.
class Instance {
public:
    // `overrides` stand above the user's settings. An output path keeps its name and lies in `folder` of the
    // scratch folder.
    explicit Instance(PluginLibrary &library, Settings overrides = {}, std::filesystem::path folder = {});
    ~Instance() { destroy(); }
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    // What the host of a newer ABI passes besides.
    struct Newer {
        std::size_t bytes = 0; // behind each option; garbage here
        bool option = false;   // behind the declared ones
    };
    void create_or_fail(Newer newer);  // throws Failure
    arhost_status create(Newer newer); // as it comes
    void create_or_fail() { create_or_fail({}); }
    arhost_status create() { return create({}); }
    void destroy();

    arhost_instance *get() const { return instance_; }
    Host &host() { return host_; }
    PluginLibrary &library() const { return library_; }

    // Throws Failure unless `status` is ARHOST_STATUS_OK, with what the plugin said.
    void expect_ok(const char *call, arhost_status status) const;

private:
    PluginLibrary &library_;
    Settings settings_;
    std::filesystem::path folder_;
    Host host_;
    arhost_instance *instance_ = nullptr;
};

// "OK", "INVALID_ARGUMENT", …; "0, which is no status".
std::string status_name(arhost_status status);

// What a plugin's function returned: "read returned IO: the camera is gone".
std::string told(const char *call, arhost_status status, const Host &host);

} // namespace arhost::conformance
