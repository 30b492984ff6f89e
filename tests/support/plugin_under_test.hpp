// SPDX-License-Identifier: Apache-2.0
//
// For unit tests of plugins: loads a plugin into the test process and calls it in the same way as arhost-worker does,
// but without child processes and shared memory. The tests in tests/system test the entire pipeline.
#pragma once

#include "base/temporary_folder.hpp"
#include "directories.hpp"
#include <arhost/arhost.h>

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::test {

// Returns a path in the folder of real photos and meshes, which are not in the repository. A test that needs them
// must begin with, for example, ARHOST_REQUIRE_SHARED_DATA("markers/julia").
inline std::filesystem::path shared_data(const std::string &relative) {
    return std::filesystem::path(arhost::test::shared_data_directory()) / relative;
}
#define ARHOST_REQUIRE_SHARED_DATA(relative)                                                                         \
    if (!std::filesystem::exists(::arhost::test::shared_data(relative)))                                             \
    GTEST_SKIP() << "needs " << ::arhost::test::shared_data(relative) << ", which is missing"

// Skips the test if CMake has not found ffmpeg. Sources that use it must be compiled with ARHOST_FFMPEG.
#define ARHOST_REQUIRE_FFMPEG()                                                                                      \
    if (std::string(ARHOST_FFMPEG).empty())                                                                          \
    GTEST_SKIP() << "needs the command ffmpeg (package ffmpeg), which was not found when the build was configured"

// Runs a shell command; returns what it writes to standard output.
inline std::string output_of(const std::string &command) {
    const std::unique_ptr<FILE, int (*)(FILE *)> pipe(::popen(command.c_str(), "r"), ::pclose);
    std::string text;
    for (char part[4096]; const std::size_t size = std::fread(part, 1, sizeof part, pipe.get());)
        text.append(part, size);
    return text;
}

struct ScratchFolder : base::TemporaryFolder {
    ScratchFolder() : TemporaryFolder("arhost-test") {}
};

// A frame or image buffer, 64-byte aligned, followed by guard bytes that detect overruns.
class GuardedBuffer {
public:
    explicit GuardedBuffer(std::size_t size)
        : size_(size), bytes_(static_cast<uint8_t *>(std::aligned_alloc(64, (size + guard + 63) / 64 * 64))) {
        std::memset(bytes_.get(), 0xa5, size + guard);
    }
    uint8_t *data() const { return bytes_.get(); }
    std::size_t size() const { return size_; }
    bool intact() const {
        for (std::size_t i = size_; i < size_ + guard; ++i)
            if (bytes_.get()[i] != 0xa5)
                return false;
        return true;
    }

private:
    static constexpr std::size_t guard = 256;
    struct Free {
        void operator()(uint8_t *p) const { std::free(p); }
    };
    std::size_t size_;
    std::unique_ptr<uint8_t, Free> bytes_;
};

class PluginUnderTest {
public:
    explicit PluginUnderTest(const std::string &id) {
        const std::string file = arhost::test::plugin_directory() + "/" + id + ".so";
        library_ = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
        if (!library_)
            throw std::runtime_error(dlerror());
        const auto *entry = static_cast<const arhost_entry_point *>(dlsym(library_, "arhost_entry"));
        if (!entry)
            throw std::runtime_error(file + " exports no arhost_entry");
        const arhost_offer offer{sizeof offer, ARHOST_ABI_VERSION, ARHOST_ABI_VERSION};
        arhost_answer answer{sizeof answer, 0, nullptr};
        if (entry->negotiate(&offer, &answer) != ARHOST_STATUS_OK)
            throw std::runtime_error("negotiate failed");
        plugin_ = answer.plugin;
        host_ = {sizeof host_, ARHOST_ABI_VERSION, "arhost-test", "0",          this,
                 &on_log,      &on_progress,       &on_cancelled, &on_extension};
    }
    ~PluginUnderTest() {
        destroy(); // does not call dlclose, because sanitizers need the plugin's symbols at exit
    }
    PluginUnderTest(const PluginUnderTest &) = delete;
    PluginUnderTest &operator=(const PluginUnderTest &) = delete;

    // Creates the plugin's instance. `overrides` has option values as text; all other options have their defaults.
    arhost_status create(const std::map<std::string, std::string> &overrides = {}) {
        const arhost_descriptor &descriptor = *plugin_->descriptor;
        std::vector<arhost_option> options;
        std::vector<std::string> texts(descriptor.option_count);
        std::size_t used = 0;
        for (uint32_t i = 0; i < descriptor.option_count; ++i) {
            const arhost_option_descriptor &declared = descriptor.options[i];
            const auto found = overrides.find(declared.key);
            used += found != overrides.end();
            if (found == overrides.end() && !declared.default_value)
                throw std::runtime_error(std::string("option '") + declared.key + "' must be given");
            texts[i] = found != overrides.end() ? found->second : declared.default_value;
            options.push_back(value_of(declared, texts[i]));
        }
        if (used != overrides.size())
            throw std::runtime_error("the test sets an option that the descriptor does not declare");
        return plugin_->create(&host_, options.data(), static_cast<uint32_t>(options.size()), &instance_);
    }
    void destroy() {
        if (instance_)
            plugin_->destroy(instance_);
        instance_ = nullptr;
    }

    template <class Functions> const Functions &functions() const {
        return *static_cast<const Functions *>(plugin_->functions);
    }
    const void *extension(const char *id) const { return plugin_->get_extension(id); }
    // Changes an option while the plugin runs (arhost/control.h). `text`: the new value, as in create().
    arhost_status set_text(const std::string &key, const std::string &text) {
        const auto *extension = static_cast<const arhost_set_option *>(this->extension(ARHOST_SET_OPTION_EXTENSION));
        if (!extension)
            throw std::runtime_error("the plugin accepts no changes");
        const std::span<const arhost_option_descriptor> declared(descriptor().options, descriptor().option_count);
        const arhost_option value = value_of(*std::ranges::find(declared, key, &arhost_option_descriptor::key), text);
        return extension->set(instance_, &value);
    }
    // Returns the values of arhost/counters.h.
    std::map<std::string, std::uint64_t> counters() const {
        std::map<std::string, std::uint64_t> values;
        const auto *extension = static_cast<const arhost_counters *>(this->extension(ARHOST_COUNTERS_EXTENSION));
        if (!extension)
            throw std::runtime_error("the plugin counts nothing");
        extension->list(
            instance_,
            [](void *context, const char *name, std::uint64_t value) {
                (*static_cast<std::map<std::string, std::uint64_t> *>(context))[name] = value;
            },
            &values);
        return values;
    }
    const arhost_host *host() const { return &host_; }
    const arhost_descriptor &descriptor() const { return *plugin_->descriptor; }
    arhost_instance *instance() const { return instance_; }
    // Makes the host's function `cancelled` return true after `after` more calls.
    void cancel(int after = 0) { cancelled_after_ = cancel_checks_ + after; }
    // The number of calls of `cancelled`.
    int cancel_checks() const { return cancel_checks_; }
    int progress_reports() const { return progress_reports_; }
    void reset_cancel() { cancelled_after_ = std::numeric_limits<int>::max(); }

    // Returns all log messages so far, one per line, in the format "severity text".
    std::string log() const {
        std::lock_guard lock(mutex_);
        return log_;
    }

private:
    static arhost_option value_of(const arhost_option_descriptor &declared, const std::string &text) {
        arhost_option value{sizeof value, declared.type, declared.key, 0, 0.0, text.c_str()};
        if (declared.type == ARHOST_OPTION_BOOL)
            value.integer = text == "true";
        else if (declared.type == ARHOST_OPTION_INTEGER)
            value.integer = std::stoll(text);
        else if (declared.type == ARHOST_OPTION_REAL)
            value.real = std::stod(text);
        else if (declared.type == ARHOST_OPTION_LISTEN) { // "DESCRIPTOR ADDRESS", or "" for no socket
            value.integer = text.empty() ? -1 : std::stoll(text);
            value.text += text.find(' ') + 1;
        }
        return value;
    }
    static PluginUnderTest &self(const arhost_host *host) { return *static_cast<PluginUnderTest *>(host->context); }
    static void on_log(const arhost_host *host, arhost_severity severity, const char *text) {
        std::lock_guard lock(self(host).mutex_);
        self(host).log_ += std::to_string(severity) + " " + text + "\n";
    }
    static void on_progress(const arhost_host *host, double, const char *) { ++self(host).progress_reports_; }
    static int32_t on_cancelled(const arhost_host *host) {
        return self(host).cancel_checks_++ >= self(host).cancelled_after_;
    }
    static const void *on_extension(const arhost_host *, const char *) { return nullptr; }

    void *library_ = nullptr;
    const arhost_plugin *plugin_ = nullptr;
    arhost_host host_{};
    arhost_instance *instance_ = nullptr;
    mutable std::mutex mutex_;
    std::string log_;
    std::atomic<int> progress_reports_{0}, cancel_checks_{0}, cancelled_after_{std::numeric_limits<int>::max()};
};

} // namespace arhost::test
