// SPDX-License-Identifier: Apache-2.0
#include "base/unique_fd.hpp"
#include "base/write_all.hpp"
#include "processes.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <fcntl.h>
#include <pty.h>
#include <sys/signalfd.h>
#include <thread>

using namespace arhost::base;

namespace {

struct WriteAll : testing::Test {
    WriteAll() {
        int ends[2];
        if (::pipe2(ends, O_CLOEXEC) != 0)
            throw_errno("pipe2");
        to_read.reset(ends[0]);
        to_write.reset(ends[1]);
        sigset_t taken;
        ::sigemptyset(&taken);
        ::sigaddset(&taken, SIGUSR1);
        ::pthread_sigmask(SIG_BLOCK, &taken, nullptr);
        signals = checked(::signalfd(-1, &taken, SFD_CLOEXEC), "signalfd");
    }
    // Writes until the descriptor accepts no more, then sends a signal.
    void expect_interrupted_while_blocked(int fd) const {
        std::atomic<pid_t> writer_id = 0;
        std::jthread writer([&] {
            writer_id = ::gettid();
            try {
                write_all(fd, std::string(1'000'000, 'x'), signals.get());
                ADD_FAILURE() << "more was written than the descriptor accepts";
            } catch (const Interrupted &interrupted) {
                EXPECT_EQ(interrupted.signal, SIGUSR1);
            }
        });
        while (writer_id == 0)
            std::this_thread::yield();
        arhost::test::wait_asleep(writer_id);
        ::kill(::getpid(), SIGUSR1);
    }
    UniqueFd to_read, to_write, signals;
};

} // namespace

TEST_F(WriteAll, WritesMoreThanAPipeHolds) {
    const std::string text(1'000'000, 'x');
    std::string taken;
    std::jthread reader([&] {
        char bytes[5000];
        for (ssize_t count; (count = ::read(to_read.get(), bytes, sizeof bytes)) > 0;)
            taken.append(bytes, static_cast<std::size_t>(count));
    });
    write_all(to_write.get(), text, signals.get());
    to_write.reset();
    reader.join();
    EXPECT_EQ(taken, text);
}

TEST_F(WriteAll, IsInterruptedByASignalWhileAPipeIsFull) {
    expect_interrupted_while_blocked(to_write.get());
}

TEST_F(WriteAll, IsInterruptedByASignalWhileATerminalIsStopped) {
    int main_end = -1, other_end = -1;
    ASSERT_EQ(::openpty(&main_end, &other_end, nullptr, nullptr, nullptr), 0);
    const UniqueFd reader(main_end), terminal(other_end);
    expect_interrupted_while_blocked(terminal.get());
}

TEST_F(WriteAll, ThrowsIfItCannotWrite) {
    const UniqueFd full(::open("/dev/full", O_WRONLY | O_CLOEXEC));
    EXPECT_THROW(write_all(full.get(), "x"), std::system_error);
    EXPECT_NO_THROW(write_all(full.get(), ""));
    EXPECT_EQ(take_signal(signals.get()), 0);
    EXPECT_EQ(take_signal(-1), 0);
}
