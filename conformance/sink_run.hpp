// SPDX-License-Identifier: Apache-2.0
// Runs a sink in a folder: its input frames and output files.
#pragma once

#include "conformance/guarded_memory.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/test.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace arhost::conformance {

struct Size {
    std::uint32_t width = 64, height = 48;
};

// The format of the video frames under the overlays.
arhost_frame_format video_format(const Size &size);

// A frame in read-only memory, like the host's, with inaccessible memory after its last row. Its pixels are
// incompressible noise that differs for each frame.
class SealedOutput {
public:
    struct Content {
        std::uint64_t sequence;
        Size size{};
        std::uint32_t padding = 0;   // bytes per row in addition to the host's stride
        std::uint8_t in_padding = 0; // value of the bytes after a row's pixels
        bool other = false;          // a frame with other pixels than the usual one with this number
    };
    explicit SealedOutput(const Content &content);

    // Changes the record. Do not call while a sink reads it.
    template <class Change> void change(Change &&change) {
        record_.unseal();
        change(record());
        record_.seal();
    }
    // Replaces the targets and observations. The byte after the last element is inaccessible. Each element ends with
    // `extra` bytes that a sink does not know.
    void set_tracked(const std::vector<arhost_target> &targets, const std::vector<arhost_observation> &observations,
                     std::size_t extra = 0);
    const arhost_output &output() const { return output_; }

private:
    arhost_record &record() { return *reinterpret_cast<arhost_record *>(record_.data()); }

    std::uint32_t stride_;
    arhost_frame_format video_format_;
    GuardedMemory record_, pixels_, video_, overlay_;
    std::optional<GuardedMemory> targets_, observations_;
    arhost_output output_{};
};

// A target that owns the observations [first, first + count), and an observation of marker `id` of the family 0.
arhost_target detected_target(const std::string &name, double z_mm, std::uint32_t first, std::uint32_t count);
arhost_observation observation(int id);

// Contents of files by path within a folder.
using Files = std::map<std::string, std::string>;
Files files_in(const std::filesystem::path &folder);

// An instance is started once; a further start creates a new instance.
class SinkRun {
public:
    // Output goes to `folder` in the test's scratch folder.
    SinkRun(Context &context, const std::string &folder);
    ~SinkRun();
    SinkRun(const SinkRun &) = delete;
    SinkRun &operator=(const SinkRun &) = delete;

    arhost_status try_start(std::uint64_t first_sequence = 0, const Size &size = {});
    void start(std::uint64_t first_sequence = 0, const Size &size = {}); // throws Failure unless it succeeds
    arhost_status try_write(const SealedOutput &frame);
    void write(const SealedOutput &frame); // throws Failure unless it succeeds
    void write(std::uint64_t first, std::uint64_t end);
    Files run(std::uint64_t frames); // start, write and stop; returns the files
    arhost_status try_idle();
    arhost_status try_stop();
    void stop(); // throws Failure unless it succeeds

    bool has_idle() const { return functions_.idle != nullptr; }
    Files files() const { return files_in(library_.scratch() / folder_); }
    Instance &instance() { return *instance_; }

private:
    void create();

    PluginLibrary &library_;
    std::string folder_;
    std::optional<Instance> instance_;
    const arhost_sink &functions_;
    bool fresh_ = true, started_ = false;
    Size size_{};
};

} // namespace arhost::conformance
