// SPDX-License-Identifier: Apache-2.0
#include "ipc/memory.hpp"

#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/mman.h>

using namespace arhost::ipc;

TEST(SharedMemory, CanNotBeResized) {
    const SharedMemory memory = SharedMemory::create("test", 8192);
    EXPECT_NE(::ftruncate(memory.fd(), 4096), 0);
    EXPECT_NE(::ftruncate(memory.fd(), 16384), 0);
    EXPECT_EQ(memory.size(), 8192u);
}

TEST(SharedMemory, AllowsOnlyTheExistingWriterAfterTheSeal) {
    const SharedMemory memory = SharedMemory::create("test", 4096);
    const Mapping writer = memory.map(Access::read_write);
    memory.seal_future_writes();
    EXPECT_THROW(memory.map(Access::read_write), std::system_error);
    const char byte = 1;
    EXPECT_EQ(::write(memory.fd(), &byte, 1), -1);

    const Mapping reader = memory.map(Access::read_only);
    writer.bytes()[7] = std::byte(42);
    EXPECT_EQ(reader.bytes()[7], std::byte(42));
    EXPECT_NE(::mprotect(reader.bytes().data(), 4096, PROT_READ | PROT_WRITE), 0)
        << "a reader made its mapping writable";
    EXPECT_NE(::fcntl(memory.fd(), F_ADD_SEALS, F_SEAL_WRITE), 0)
        << "a peer could seal the memory against its writer";
}

TEST(SharedMemory, RejectsMemoryThatThePeerCouldResize) {
    arhost::base::UniqueFd resizable(::memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    ASSERT_EQ(::ftruncate(resizable.get(), 4096), 0);
    EXPECT_THROW(SharedMemory::adopt(std::move(resizable)), std::runtime_error);
    EXPECT_THROW(SharedMemory::adopt(arhost::base::UniqueFd(::open("/dev/null", O_RDWR))), std::system_error);
}

TEST(SharedMemory, FreezesOnlyWithoutWritableMappings) {
    const SharedMemory memory = SharedMemory::create("test", 4096);
    {
        const Mapping writer = memory.map(Access::read_write);
        EXPECT_THROW(SharedMemory::adopt_and_freeze(arhost::base::UniqueFd(::dup(memory.fd()))), std::system_error);
    }
    const SharedMemory frozen = SharedMemory::adopt_and_freeze(arhost::base::UniqueFd(::dup(memory.fd())));
    EXPECT_EQ(frozen.size(), 4096u);
    EXPECT_THROW(frozen.map(Access::read_write), std::system_error);
}

TEST(SlotLayout, AlignsSlotsAndLimitsThemToTheirSize) {
    const SlotLayout layout{100'000, 3};
    EXPECT_EQ(layout.stride(), 131'072u);
    const SharedMemory memory = SharedMemory::create("test", layout.byte_size());
    const Mapping mapping = memory.map(Access::read_write);
    EXPECT_EQ(layout.slot(mapping, 2).data() - mapping.bytes().data(), 2 * 131'072);
    EXPECT_EQ(layout.slot(mapping, 2).size(), 100'000u);
}
