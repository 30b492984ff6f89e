// SPDX-License-Identifier: Apache-2.0
#include "ipc/messages.hpp"
#include "worker/services.hpp"

#include "pixels/formulas.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace arhost::worker {
namespace {

// The frame as a tracker sees it: its grey plane without padding, and whether that is plane 0.
struct Seen {
    std::vector<std::uint8_t> grey;
    bool is_plane_0 = false, is_aligned = false;
} seen;

constexpr arhost_tracker tracker_functions = {
    sizeof(arhost_tracker),
    [](arhost_instance *, const arhost_tracker_setup *) -> arhost_status { return ARHOST_STATUS_OK; },
    [](arhost_instance *, const arhost_track_request *request, arhost_tracker_result *) -> arhost_status {
        const arhost_frame *frame = request->frame;
        seen = {{}, frame->grey == frame->plane[0], reinterpret_cast<std::uintptr_t>(frame->grey) % 64 == 0};
        for (std::uint32_t y = 0; y < frame->format->height; ++y) {
            const std::uint8_t *row = frame->grey + std::size_t{frame->format->grey_stride} * y;
            seen.grey.insert(seen.grey.end(), row, row + frame->format->width);
        }
        return ARHOST_STATUS_OK;
    },
    [](arhost_instance *) {},
    nullptr,
    nullptr};

// Lets a tracker see a frame of 64×4 px whose luma counts from 0 to 255.
void track(arhost_pixel_format pixel_format, arhost_yuv_range range) {
    ipc::messages::TrackerSetup setup;
    setup.format.struct_size = sizeof setup.format;
    setup.format.pixel_format = pixel_format;
    setup.format.width = 64;
    setup.format.height = 4;
    setup.format.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
    setup.format.yuv_range = range;
    ASSERT_TRUE(arhost_frame_layout(&setup.format));

    const auto region = [](std::uint64_t slot_size) {
        const ipc::SlotLayout layout{slot_size, 1};
        return Memory::Region{layout,
                              ipc::SharedMemory::create("test", layout.byte_size()).map(ipc::Access::read_write)};
    };
    Memory memory;
    memory.inputs[0] = region(setup.format.byte_size);
    const std::span<std::byte> slot = memory.inputs[0].slot(0);
    auto *luma = reinterpret_cast<std::uint8_t *>(slot.data());
    std::iota(luma, luma + 256, std::uint8_t{0});
    const std::vector<std::byte> before(slot.begin(), slot.end());

    const Link link{ipc::Channel(), base::UniqueFd()};
    const arhost_host host{};
    arhost_descriptor descriptor{};
    descriptor.kind = ARHOST_KIND_TRACKER;
    arhost_plugin plugin{};
    plugin.descriptor = &descriptor;
    plugin.functions = &tracker_functions;
    const auto service = make_service(link, host, plugin, nullptr);
    ipc::messages::Ready ready;
    const std::vector<model::Target> targets = {{"cup", {{7, "tag36h11", {}}}, ""}};
    const ipc::SharedMemory targets_memory = ipc::to_memory(targets);
    std::vector<base::UniqueFd> fds;
    fds.emplace_back(::dup(targets_memory.fd()));
    ASSERT_EQ(service->start(setup, fds, ready), ARHOST_STATUS_OK);
    memory.output = region(ipc::TrackerSlot(targets.size()).byte_size(ready.state_size));
    ipc::Command command{};
    command.kind = ipc::CommandKind::track;
    ipc::Result result{};
    ASSERT_EQ(service->execute(command, memory, result), ARHOST_STATUS_OK);
    EXPECT_TRUE(std::ranges::equal(before, slot));
}

TEST(TrackerService, ExpandsALumaPlaneOfLimitedRangeForTheTracker) {
    for (const auto pixel_format : {ARHOST_PIXEL_FORMAT_NV12, ARHOST_PIXEL_FORMAT_I420}) {
        track(pixel_format, ARHOST_YUV_RANGE_LIMITED);
        EXPECT_TRUE(seen.is_aligned);
        ASSERT_EQ(seen.grey.size(), 256u);
        for (int y = 0; y < 256; ++y)
            EXPECT_EQ(seen.grey[static_cast<std::size_t>(y)], full_range(y)) << y;
    }
}

TEST(TrackerService, PassesALumaPlaneOfFullRangeWithoutACopy) {
    for (const auto pixel_format : {ARHOST_PIXEL_FORMAT_NV12, ARHOST_PIXEL_FORMAT_I420}) {
        track(pixel_format, ARHOST_YUV_RANGE_FULL);
        EXPECT_TRUE(seen.is_plane_0);
    }
    track(ARHOST_PIXEL_FORMAT_GREY8, ARHOST_YUV_RANGE_LIMITED); // the range is ignored
    EXPECT_TRUE(seen.is_plane_0);
}

} // namespace
} // namespace arhost::worker
