// SPDX-License-Identifier: Apache-2.0
//
// Reads pages and slots in the same way as the host reads those that a worker writes. Each one has its own
// allocation, so AddressSanitizer detects every out-of-bounds read.
#include "input.hpp"
#include "targets.hpp"

#include "compositor/compositor.hpp"
#include "host/frame_validation.hpp"
#include "ipc/protocol.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

namespace arhost::fuzz {
namespace {

using namespace ipc;

void require(bool condition, const char *message) {
    if (!condition)
        throw std::logic_error(message);
}

void take_result(Input &input) {
    const std::vector<model::Target> configured(2, {"target", {{7, "D", {}}}, ""});
    const ipc::TrackerSlot layout(configured.size());
    std::vector<std::byte> slot(layout.byte_size(0));
    *reinterpret_cast<ipc::TrackerSlot::Header *>(slot.data()) = {2, 2, 1, 0, 9};
    auto *targets = reinterpret_cast<arhost_target *>(slot.data() + ipc::TrackerSlot::targets_offset);
    for (std::uint32_t i = 0; i < 2; ++i) {
        targets[i].state = ARHOST_TARGET_DETECTED;
        targets[i].first_observation = i;
        targets[i].observation_count = 1;
        for (const int diagonal : {0, 5, 10, 15})
            targets[i].mt[diagonal] = 1;
        targets[i].mt[14] = -500;
    }
    input.corrupt(std::span(slot).first(layout.observations_offset + 2 * sizeof(arhost_observation)));
    host::Frame frame(0);
    if (host::accept_tracker_result(slot, configured, 1, frame))
        return;
    for (const arhost_target &target : frame.targets) {
        require(target.first_observation + std::uint64_t{target.observation_count} <= frame.observations.size(),
                "observations are out of range");
        for (const double number : target.mt)
            require(std::isfinite(number), "a pose is not finite");
    }
    require(frame.record.search.missed_count <= frame.expected.size(), "more markers are missed than expected");
    for (const arhost_expected_marker &expected : frame.expected) {
        require(expected.marker < configured.size(), "the index of an expected marker is out of range");
        require(std::isfinite(expected.margin_px), "a margin is not finite");
    }
}

void overlay(const arhost_render_info &info) {
    arhost_frame_format format{};
    format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
    format.width = 21;
    format.height = 5;
    arhost_frame_layout(&format);
    const std::vector<std::uint8_t> video(format.byte_size), image(std::size_t(84) * 5);
    std::vector<std::uint8_t> out(std::size_t(63) * 5);
    const std::uint8_t *const planes[ARHOST_MAX_PLANES] = {video.data(), nullptr, nullptr};
    composite(format, planes, {image.data(), 84}, region_of(info, 21, 5), {out.data(), 63});
}

} // namespace

void run_ring(Bytes bytes) {
    Input input(bytes);
    const auto host = std::make_unique<HostPage>();
    const auto worker = std::make_unique<WorkerPage>();
    CommandProducer commands(host->commands, worker->commands);
    ResultConsumer results(worker->results, host->results);
    CommandConsumer taken(host->commands, worker->commands);
    ResultProducer answers(worker->results, host->results);
    arhost_record record{};
    while (!input.empty()) {
        Command command{};
        Result result{};
        switch (input.number() % 6) {
        case 0:
            input.corrupt(std::as_writable_bytes(std::span(worker.get(), 1)));
            break;
        case 1:
            commands.push(command);
            break;
        case 2:
            taken.pop(command);
            break;
        case 3:
            result = input.number<Result>();
            answers.push(result);
            break;
        case 4:
            // The peer does not write during this loop, so the number of pops is limited by the capacity of the ring.
            for (std::uint32_t popped = 0; results.pop(result) == RingResult::done; ++popped) {
                require(popped < ring_capacity, "more entries than the ring's capacity");
                host::accept_frame_info(result.frame, record.capture_ns, 0, record);
                overlay(result.render);
                const std::chrono::nanoseconds busy(result.busy_ns), device = host::device_time(result.render, busy);
                require(device.count() == 0 || device <= busy, "the device time exceeds the image's time");
            }
            break;
        case 5:
            take_result(input);
            break;
        }
    }
}

} // namespace arhost::fuzz
