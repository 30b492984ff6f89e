// SPDX-License-Identifier: Apache-2.0
#include "ipc/reactor.hpp"

#include <gtest/gtest.h>

#include <ctime>
#include <manual_clock.hpp>
#include <optional>
#include <thread>

using namespace arhost::ipc;
using arhost::test::ManualClock;
using namespace std::chrono_literals;

namespace {

struct Pipe {
    Pipe() {
        int ends[2];
        if (::pipe(ends) != 0)
            arhost::base::throw_errno("pipe");
        read.reset(ends[0]);
        write.reset(ends[1]);
    }
    void put() const { EXPECT_EQ(::write(write.get(), "x", 1), 1); }
    arhost::base::UniqueFd read, write;
};

} // namespace

TEST(Reactor, CallsBackWhileADescriptorIsReadable) {
    Reactor reactor;
    const Pipe pipe;
    int calls = 0;
    auto watch = reactor.watch(pipe.read.get(), [&] { ++calls; });
    pipe.put();
    reactor.run_once();
    reactor.run_once();
    EXPECT_EQ(calls, 2);
}

TEST(Reactor, CallsDeadlinesOnceAndInOrder) {
    Reactor reactor;
    std::string order;
    const auto now = Reactor::Clock::now();
    auto second = reactor.at(now + 2ms, [&] { order += "2"; });
    auto first = reactor.at(now + 1ms, [&] { order += "1"; });
    auto never = reactor.at(now + 1ms, [&] { order += "x"; });
    never.cancel();
    while (order.size() < 2)
        reactor.run_once();
    EXPECT_EQ(order, "12");
}

TEST(Reactor, LetsACallbackCancelItsOwnWatchAndAnother) {
    Reactor reactor;
    const Pipe one, two;
    int calls = 0;
    std::optional<Reactor::Registration> first, second;
    first = reactor.watch(one.read.get(), [&] { ++calls, first.reset(), second.reset(); });
    second = reactor.watch(two.read.get(), [&] { ++calls, first.reset(), second.reset(); });
    one.put();
    two.put();
    reactor.run_once();
    EXPECT_EQ(calls, 1) << "a cancelled watch was called";
}

TEST(Reactor, HandlesEventsBeforeExpiredDeadlines) {
    ManualClock clock;
    Reactor reactor(clock);
    const Pipe pipe;
    bool missed = false;
    auto deadline = reactor.at(clock.now() + 5ms, [&] { missed = true; });
    Reactor::Registration watch, delay;
    watch = reactor.watch(pipe.read.get(), [&] { deadline.cancel(), watch.cancel(); });
    const Pipe busy;
    delay = reactor.watch(busy.read.get(), [&] {
        clock.advance(10ms); // the event arrives while this process is busy
        pipe.put();
        delay.cancel();
    });
    busy.put();
    while (watch.active())
        reactor.run_once();
    EXPECT_FALSE(missed);
}

TEST(Reactor, ExtendsDeadlinesByTimeInWhichTheProcessDidNotRun) {
    ManualClock clock;
    Reactor reactor(clock);
    const Pipe pipe;
    bool missed = false;
    auto deadline = reactor.at(clock.now() + 50ms, [&] { missed = true; });
    Reactor::Registration watch;
    watch = reactor.watch(pipe.read.get(), [&] {
        std::this_thread::sleep_for(100ms); // a longer time has the same result
        clock.advance(100ms);
        watch.cancel();
    });
    pipe.put();
    reactor.run_once();
    EXPECT_FALSE(missed);
    while (!missed) {
        clock.advance(1s);
        reactor.run_once();
    }
}

TEST(Reactor, CallsDeadlinesAlthoughTheThreadIsBusy) {
    Reactor reactor;
    const Pipe pipe;
    const auto begin = Reactor::Clock::now();
    bool called = false;
    auto deadline = reactor.at(begin + 500ms, [&] { called = true; });
    auto watch = reactor.watch(pipe.read.get(), [] {});
    pipe.put();
    while (!called && Reactor::Clock::now() < begin + 10s) {
        reactor.run_once();
        const std::clock_t end = std::clock() + CLOCKS_PER_SEC / 5; // CPU time
        while (std::clock() < end) {
        }
    }
    EXPECT_TRUE(called);
}

TEST(Reactor, LetsADeadlineSetAnother) {
    Reactor reactor;
    int calls = 0;
    Reactor::Registration next;
    auto first =
        reactor.at(Reactor::Clock::now(), [&] { next = reactor.at(Reactor::Clock::now(), [&] { ++calls; }); });
    while (calls == 0)
        reactor.run_once();
    EXPECT_EQ(calls, 1);
}
