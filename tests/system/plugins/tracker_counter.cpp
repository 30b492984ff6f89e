// SPDX-License-Identifier: Apache-2.0
//
// A tracker that reads the frame number from the pixels and fails if it is wrong. Reports the corners of the first
// marker (or all markers) as seen from a distance of 500 mm plus 1 mm times the frame number, facing the camera. If
// it has state, it counts the frames that it has tracked in the first 8 bytes, and reports the markers 1 mm to the
// right times this number.
#include "faults.hpp"

#include <arhost/shading/lens.hpp>

#include <cstring>
#include <fcntl.h>
#include <limits>
#include <optional>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <vector>

namespace {

using namespace arhost;

class Counter {
public:
    Counter(const Host &host, const Options &options)
        : host_(host), faults_(options), seal_(options.text("seal")), all_(options.boolean("all")),
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
        lens_.emplace(*setup.intrinsics);
        for (const arhost_marker_config &marker : elements(setup.markers, setup.marker_count))
            listed_.push_back(marker);
        if (listed_.empty())
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "targets: there is no marker");
        if (!all_)
            listed_.resize(1);
        if (seal_ != "no" && ::mkdir("sealed", 0700) == 0) // the folder exists after a restart
            seal_output();
    }

    void track(const arhost_track_request &request, Observations &observations) {
        const arhost_frame &frame = *request.frame;
        const std::uint64_t number = frame.plane[0][0] + 256u * frame.plane[0][1];
        if (number != (frame.sequence & 0xffff)) // the pixels encode only two bytes
            throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "the pixels contain the number of another frame");
        faults_.at(number);
        const auto signed_number = static_cast<std::int64_t>(number);
        if (signed_number >= lost_from_ && signed_number < lost_to_)
            return;
        const double x_mm = state_size_ > 0 ? static_cast<double>(count(request)) : 0;
        for (const arhost_marker_config &listed : listed_) {
            arhost_observation seen = observed(listed, x_mm, 500.0 + static_cast<double>(number));
            if (signed_number == nan_at_)
                seen.corners_px[0][0] = std::numeric_limits<double>::quiet_NaN();
            observations.add(seen);
        }
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

    // The marker when its target is at (x, 0, −distance) in GL eye space, not rotated.
    arhost_observation observed(const arhost_marker_config &listed, double x_mm, double distance_mm) const {
        arhost_observation seen{};
        seen.id = listed.id;
        seen.family = listed.family;
        for (int i = 0; i < 4; ++i) {
            const double *corner = listed.corners_mm[i], depth_mm = distance_mm - corner[2];
            const auto pixel = lens_->project({corner[0] + x_mm, -corner[1], depth_mm});
            if (!pixel)
                throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "a corner is not visible");
            seen.corners_px[i][0] = pixel->x;
            seen.corners_px[i][1] = pixel->y;
        }
        return seen;
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
    bool all_, crash_in_destroy_;
    std::int64_t lost_from_, lost_to_, nan_at_, start_steps_;
    double start_step_ms_;
    std::uint64_t state_size_;
    std::optional<shading::Lens> lens_;
    std::vector<arhost_marker_config> listed_;
};

constexpr const char *seals[] = {"no", "seal", "write", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "seal", "no", "Seal to add to the plugin's shared memory", 0, 0, seals),
    option(ARHOST_OPTION_BOOL, "all", "false", "Reports all markers instead of the first one"),
    option(ARHOST_OPTION_INTEGER, "lost_from", "0", "First frame for which no marker is reported"),
    option(ARHOST_OPTION_INTEGER, "lost_to", "0", "End of that range of frames, exclusive"),
    option(ARHOST_OPTION_BOOL, "crash_in_destroy", "false", "Crashes in destroy"),
    option(ARHOST_OPTION_INTEGER, "nan_at", "-1", "Reports a NaN as a corner in this frame; -1: never"),
    option(ARHOST_OPTION_INTEGER, "start_steps", "0", "Number of steps in start, each reported as progress"),
    option(ARHOST_OPTION_REAL, "start_step_ms", "0", "Duration of each step, in ms", 0, 60000),
    option(ARHOST_OPTION_INTEGER, "state_size", "0", "Bytes of state: 0, or at least 8"),
    ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_TRACKER,
                                          "org.arhost.test.tracker_counter",
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
