// SPDX-License-Identifier: Apache-2.0
#include "ipc/messages.hpp"
#include "worker/services.hpp"

#include "pixels/formulas.hpp"
#include "scene/arena_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
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
    0,
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

// ---- Ray tracers -----------------------------------------------------------------------------------

// The states that a ray tracer got.
struct SeenStates {
    const void *before = nullptr;
    void *after = nullptr;
    std::uint64_t size = 0;
} seen_states;
std::uint64_t declared_size = 0;

constexpr arhost_raytracer raytracer_functions = {
    sizeof(arhost_raytracer),
    0,
    [](arhost_instance *, const arhost_raytracer_setup *) -> arhost_status { return ARHOST_STATUS_OK; },
    [](arhost_instance *, const arhost_render_request *request, const arhost_image *,
       arhost_render_info *) -> arhost_status {
        seen_states = {request->state_before, request->state_after, request->state_size};
        return ARHOST_STATUS_OK;
    },
    [](arhost_instance *) {},
    nullptr,
    [](arhost_instance *) { return declared_size; }};

// A ray tracer for images of 5×3 px, with slots for its images and for the states of a predecessor.
class RaytracerServiceTest : public testing::Test {
protected:
    // `is_older`: the function table has no state_size.
    void start(std::uint64_t state_size, bool is_older = false) {
        declared_size = state_size;
        functions_.struct_size =
            is_older ? offsetof(arhost_raytracer, state_size) : std::uint32_t{sizeof(arhost_raytracer)};
        descriptor_.kind = ARHOST_KIND_RAYTRACER;
        descriptor_.id = "rt_test";
        plugin_.descriptor = &descriptor_;
        plugin_.functions = &functions_;
        service_ = make_service(link_, host_, plugin_, nullptr);
        const scene::Arena arena = scene::ArenaBuilder().build();
        const auto memory = ipc::SharedMemory::create("test", arena.bytes().size());
        std::ranges::copy(arena.bytes(), memory.map(ipc::Access::read_write).bytes().begin());
        std::vector<base::UniqueFd> fds;
        fds.emplace_back(::dup(memory.fd()));
        ipc::messages::Ready ready;
        ASSERT_EQ(service_->start(setup_, fds, ready), ARHOST_STATUS_OK);
        EXPECT_EQ(ready.state_size, is_older ? 0 : state_size);
        const auto region = [&] {
            const ipc::SlotLayout layout{slot_.byte_size(ready.state_size), 2};
            return Memory::Region{layout,
                                  ipc::SharedMemory::create("test", layout.byte_size()).map(ipc::Access::read_write)};
        };
        memory_.output = region();
        memory_.inputs[7] = region();
    }
    // `state_generation`: 0: without a state
    void render(std::uint32_t state_generation) {
        ipc::Command command{};
        command.kind = ipc::CommandKind::render;
        command.slot = 0;
        command.state_generation = state_generation;
        command.state_slot = 1;
        ipc::Result result{};
        ASSERT_EQ(service_->execute(command, memory_, result), ARHOST_STATUS_OK);
    }

    const ipc::messages::RaytracerSetup setup_{.width = 5, .height = 3, .intrinsics = pinhole()};
    const ipc::RaytracerSlot slot_{5, 3, ARHOST_IMAGE_FORM_STRAIGHT};
    Memory memory_;

private:
    static arhost_intrinsics pinhole() {
        arhost_intrinsics intrinsics{};
        intrinsics.distortion = ARHOST_DISTORTION_NONE;
        return intrinsics;
    }
    const Link link_{ipc::Channel(), base::UniqueFd()};
    const arhost_host host_{};
    arhost_descriptor descriptor_{};
    arhost_raytracer functions_ = raytracer_functions;
    arhost_plugin plugin_{};
    std::unique_ptr<Service> service_;
};

TEST_F(RaytracerServiceTest, TheStateIsBehindTheImageInThePagesOfTheSameSlot) {
    start(100);
    EXPECT_EQ(slot_.state_offset, 4096u);
    render(0);
    EXPECT_EQ(seen_states.before, nullptr);
    EXPECT_EQ(seen_states.after, memory_.output.slot(0).data() + slot_.state_offset);
    EXPECT_EQ(seen_states.size, 100u);
    render(7);
    EXPECT_EQ(seen_states.before, memory_.inputs[7].slot(1).data() + slot_.state_offset);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(seen_states.before) % 4096, 0u);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(seen_states.after) % 4096, 0u);
}

TEST_F(RaytracerServiceTest, ARaytracerWithoutStateGetsNone) {
    for (const bool is_older : {false, true}) {
        start(is_older ? 100 : 0, is_older);
        render(0);
        EXPECT_EQ(seen_states.before, nullptr);
        EXPECT_EQ(seen_states.after, nullptr);
        EXPECT_EQ(seen_states.size, 0u);
    }
}

TEST_F(RaytracerServiceTest, AStateInASlotOfAnotherSizeIsAViolation) {
    start(100);
    memory_.inputs[7].layout.slot_size -= 1;
    EXPECT_THROW(render(7), ipc::ProtocolViolation);
}

} // namespace
} // namespace arhost::worker
