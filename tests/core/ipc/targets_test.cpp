// SPDX-License-Identifier: Apache-2.0
#include "ipc/messages.hpp"

#include <arhost/tracker.h>

#include <gtest/gtest.h>

#include <cstring>

namespace arhost::ipc {

using namespace model;

namespace {

TEST(Targets, ArePassedInSharedMemoryInAnyNumber) {
    std::vector<Target> targets;
    for (std::int32_t id = 0; id < ARHOST_MAX_TARGETS; ++id) {
        Target &target = targets.emplace_back(Target{"name-" + std::to_string(id), {{id, "tag36h11", {}}}, ""});
        for (std::size_t i = 0; i < 12; ++i)
            target.markers[0].corners_mm[i / 3][i % 3] = 1.0 / (1 + id + static_cast<int>(i));
    }
    targets[7] = {"head", {}, "skull"};
    const std::vector<Target> received = targets_from(to_memory(targets).map(Access::read_only));
    ASSERT_EQ(received.size(), targets.size());
    for (std::size_t i = 0; i < targets.size(); ++i) {
        EXPECT_EQ(received[i].name, targets[i].name);
        EXPECT_EQ(received[i].body, targets[i].body);
        ASSERT_EQ(received[i].markers.size(), targets[i].markers.size());
        if (i != 7) {
            EXPECT_EQ(received[i].markers[0].id, targets[i].markers[0].id);
            EXPECT_EQ(received[i].markers[0].family, "tag36h11");
            EXPECT_EQ(received[i].markers[0].corners_mm, targets[i].markers[0].corners_mm) << "not one bit is lost";
        }
    }
}

TEST(Targets, CannotBeChangedByTheReceiver) {
    const SharedMemory memory = to_memory({{"cup", {}, ""}});
    EXPECT_THROW(memory.map(Access::read_write), std::runtime_error);
}

TEST(Targets, MalformedOnesAreAViolationOfTheProtocol) {
    for (const char *text : {"", "{", "{}", "[{}]", R"([{"name": 1, "markers": [], "body": ""}])"}) {
        const SharedMemory memory = SharedMemory::create("test", std::max<std::size_t>(std::strlen(text), 1));
        std::memcpy(memory.map(Access::read_write).bytes().data(), text, std::strlen(text));
        EXPECT_THROW(targets_from(memory.map(Access::read_only)), ProtocolViolation) << text;
    }
}

} // namespace
} // namespace arhost::ipc
