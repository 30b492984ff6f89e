// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <atomic>
#include <chrono>

namespace arhost::web {

struct Jpeg {
    std::uint64_t number = 0;            // number of the frame
    std::chrono::nanoseconds received{}; // when the plugin received the frame, CLOCK_MONOTONIC
    std::vector<std::uint8_t> bytes;
};

// The newest frame. It is encoded on the first request for it, and only once.
class NewestFrame {
public:
    explicit NewestFrame(int quality);

    // Called by the plugin's thread, which never waits for the encoder.
    void put(const arhost_output &output);
    void set_quality(int quality) { quality_ = quality; }

    // Returns the number of frames so far; 0 if there is no frame.
    std::uint64_t number() const { return number_.load(); }
    std::uint64_t encoded() const { return encoded_.load(); }

    // Called by the server's thread. Returns the newest frame, or nullptr if there is none.
    std::shared_ptr<const Jpeg> newest();

    // Targets, poses and camera of a frame, as one line of JSON (plugins/sink_poses/README.md).
    struct Poses {
        std::uint64_t number = 0; // of the frame; 0: there is none
        std::string line{};
    };
    Poses newest_poses() const;

private:
    struct Picture {
        std::uint64_t number = 0;
        std::chrono::nanoseconds received{};
        std::uint32_t width = 0, height = 0;
        std::vector<std::uint8_t> bgr; // rows have no padding
    };
    struct Free {
        void operator()(void *compressor) const;
    };

    std::atomic<std::uint64_t> number_{0}, encoded_{0};
    std::atomic<int> quality_;
    Picture written_; // belongs to the plugin's thread
    mutable std::mutex mutex_;
    Picture newest_; // guarded by mutex_, as is `poses_`
    Poses poses_;
    Picture encoding_; // belongs to the server's thread, as do the following members
    std::unique_ptr<void, Free> compressor_;
    std::shared_ptr<const Jpeg> jpeg_;
};

} // namespace arhost::web
