// SPDX-License-Identifier: Apache-2.0
//
// A tracker that reads the frame number from the pixels and fails if it is wrong. Reports the first marker (or all
// markers) at a distance of 500 mm plus 1 mm times the frame number. If it has state, it counts the frames that it
// has tracked in the first 8 bytes, and reports the marker 1 mm to the right times this number.
#include "faults.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <limits>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <vector>

namespace {

using namespace arhost;

class Counter {
public:
    Counter(const Host &host, const Options &options)
        : host_(host), faults_(options), seal_(options.text("seal")), reversed_(options.boolean("reversed")),
          crash_in_destroy_(options.boolean("crash_in_destroy")), lost_from_(options.integer("lost_from")),
          lost_to_(options.integer("lost_to")), nan_at_(options.integer("nan_at")),
          start_steps_(options.integer("start_steps")), start_step_ms_(options.real("start_step_ms")),
          state_size_(static_cast<std::uint64_t>(options.integer("state_size"))) {}

    ~Counter() {
        if (crash_in_destroy_) {
            std::signal(SIGSEGV, SIG_DFL);
            std::raise(SIGSEGV);
        }
    }
    Counter(const Counter &) = delete;
    Counter &operator=(const Counter &) = delete;

    // Sends more messages than the host reads at a time.
    void stop() {
        for (int i = 0; i < 100; ++i)
            host_.log(ARHOST_SEVERITY_DEBUG, "last words");
    }

    void start(const arhost_tracker_setup &setup) {
        for (std::int64_t step = 0; step < start_steps_; ++step) {
            host_.progress(static_cast<float>(step) / static_cast<float>(start_steps_), "starting");
            std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(start_step_ms_));
        }
        lens_ = *setup.intrinsics;
        for (std::uint32_t i = 0; i < setup.marker_count; ++i)
            listed_.push_back(listed_marker(setup, i));
        if (reversed_)
            std::reverse(listed_.begin(), listed_.end());
        else
            listed_.resize(1);
        if (seal_ != "no" && ::mkdir("sealed", 0700) == 0) // the folder exists after a restart
            seal_output();
    }

    void track(const arhost_track_request &request, arhost_tracker_result &result) {
        const arhost_frame &frame = *request.frame;
        const std::uint64_t number = frame.plane[0][0] + 256u * frame.plane[0][1];
        if (number != (frame.sequence & 0xffff)) // the pixels encode only two bytes
            throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "the pixels contain the number of another frame");
        faults_.at(number);
        const auto signed_number = static_cast<std::int64_t>(number);
        if (signed_number >= lost_from_ && signed_number < lost_to_)
            return;
        for (const arhost_marker_config &listed : listed_)
            report(listed, 500.0 + static_cast<double>(number), result.markers[result.marker_count++]);
        if (state_size_ > 0)
            result.markers[0].mt[12] = static_cast<double>(count(request));
        if (signed_number == nan_at_)
            result.markers[0].mt[12] = std::numeric_limits<double>::quiet_NaN();
    }

    std::uint64_t state_size() const { return state_size_; }

private:
    // Returns the number of frames tracked before this one.
    std::uint64_t count(const arhost_track_request &request) const {
        std::uint64_t tracked = 0;
        if (request.state_before)
            std::memcpy(&tracked, request.state_before, sizeof tracked);
        std::memset(request.state_after, 0xa5, state_size_);
        const std::uint64_t after = tracked + 1;
        std::memcpy(request.state_after, &after, sizeof after);
        return tracked;
    }

    void report(const arhost_marker_config &listed, double distance_mm, arhost_marker &marker) const {
        marker.struct_size = sizeof marker;
        marker.id = listed.id;
        std::strcpy(marker.family, "counter");
        marker.state = ARHOST_MARKER_DETECTED;
        for (int i : {0, 5, 10, 15})
            marker.mt[i] = 1;
        marker.mt[14] = -distance_mm;
        const double x_px = lens_.fx * listed.side_mm / 2 / distance_mm, y_px = x_px * lens_.fy / lens_.fx;
        for (int i = 0; i < 4; ++i) {
            marker.corners_px[i][0] = lens_.cx + (i == 1 || i == 2 ? x_px : -x_px);
            marker.corners_px[i][1] = lens_.cy + (i >= 2 ? y_px : -y_px);
        }
    }

    // Implements the worker's protocol until the plugin receives the memory for its results, and then seals this
    // memory before the host does.
    void seal_output() const {
        constexpr int control = 3;
        const auto say = [](const std::string &text) { ::send(control, text.data(), text.size(), 0); };
        say(R"({"type": "ready", "format": null, "frame_count": 0, "intrinsics": null, "capabilities": 0, "state_size": 0})");
        char text[4096];
        iovec part{text, sizeof text};
        alignas(cmsghdr) char ancillary[CMSG_SPACE(sizeof(int))];
        msghdr message{};
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = ancillary;
        message.msg_controllen = sizeof ancillary;
        int memory = -1;
        if (::recvmsg(control, &message, 0) > 0 && CMSG_FIRSTHDR(&message))
            std::memcpy(&memory, CMSG_DATA(CMSG_FIRSTHDR(&message)), sizeof memory);
        if (::fcntl(memory, F_ADD_SEALS, seal_ == "seal" ? F_SEAL_SEAL : F_SEAL_WRITE) != 0)
            std::abort();
        say(R"({"type": "attached", "is_output": true, "generation": 1})");
    }

    Host host_;
    test::Faults faults_;
    std::string seal_;
    bool reversed_, crash_in_destroy_;
    std::int64_t lost_from_, lost_to_, nan_at_, start_steps_;
    double start_step_ms_;
    std::uint64_t state_size_;
    arhost_intrinsics lens_{};
    std::vector<arhost_marker_config> listed_;
};

constexpr const char *seals[] = {"no", "seal", "write", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "seal", "no", "Seal to add to the plugin's shared memory", 0, 0, seals),
    option(ARHOST_OPTION_BOOL, "reversed", "false", "Reports all markers, in the reverse order of the list"),
    option(ARHOST_OPTION_INTEGER, "lost_from", "0", "First frame for which no marker is reported"),
    option(ARHOST_OPTION_INTEGER, "lost_to", "0", "End of that range of frames, exclusive"),
    option(ARHOST_OPTION_BOOL, "crash_in_destroy", "false", "Crashes in destroy"),
    option(ARHOST_OPTION_INTEGER, "nan_at", "-1", "Reports a NaN for this frame; -1: never"),
    option(ARHOST_OPTION_INTEGER, "start_steps", "0", "Number of steps in start, each reported as progress"),
    option(ARHOST_OPTION_REAL, "start_step_ms", "0", "Duration of each step, in ms", 0, 60000),
    option(ARHOST_OPTION_INTEGER, "state_size", "0", "Bytes of state: 0, or at least 8"),
    ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_TRACKER,
                                          "tracker_counter",
                                          "Counter",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Tracks numbered frames, for tests.",
                                          0,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_TRACKER(Counter, descriptor)
