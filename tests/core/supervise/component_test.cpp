// SPDX-License-Identifier: Apache-2.0
//
// Tests start, commands, death and stop of a component without a run. Deadlines and back-off are in virtual time.
#include "supervise/component.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>
#include <manual_clock.hpp>

#include <algorithm>
#include <csignal>
#include <utility>

using namespace arhost::supervise;
using namespace arhost::ipc;
using namespace arhost::model;
using namespace std::chrono_literals;

namespace {

struct Bench {
    explicit Bench(const arhost::base::Clock *real = nullptr) : reactor(real ? *real : clock) {}

    arhost::test::ManualClock clock;
    Reactor reactor;
    Launcher launcher{arhost::test::build_directory() + "/bin/arhost-launcher"};
    std::string log;
    Context context{reactor, launcher, arhost::test::build_directory() + "/bin/arhost-worker",
                    [this](arhost_severity, const std::string &component, const std::string &text) {
                        log += component + ": " + text + "\n";
                    }};
    std::vector<std::string> events;
    std::unique_ptr<Component> component;

    void make(const std::string &plugin, arhost::base::Limits limits = {}, Json options = Json::object()) {
        Component::Callbacks callbacks;
        callbacks.hello = [this, options](const PluginDescription &description, std::size_t) {
            events.push_back("hello " + description.short_name());
            std::vector<OptionValue> values;
            for (const OptionDeclaration &o : description.options)
                values.push_back(
                    {o.key, o.type,
                     o.type == ARHOST_OPTION_TEXT
                         ? 0
                         : options.value(o.key, o.default_value ? std::atoi(o.default_value->c_str()) : 0),
                     0.0, o.type == ARHOST_OPTION_TEXT ? options.value(o.key, "") : ""});
            for (OptionValue &value : values)
                if (value.key == "width" || value.key == "height")
                    value.integer = 8;
            return Component::Create{{std::move(values), messages::SourceSetup{}}, {}};
        };
        callbacks.ready = [this](const messages::Ready &ready) {
            events.push_back("ready");
            return SlotLayout{ready.format.value().byte_size, 4};
        };
        callbacks.running = [this] { events.push_back("running"); };
        callbacks.result = [this](const Command &command, const Result &result) {
            events.push_back("result " + std::to_string(command.sequence) +
                             (result.status == ARHOST_STATUS_OK ? "" : " failed"));
        };
        callbacks.lost = [this](const std::vector<Command> &unanswered) {
            events.push_back("lost " + std::to_string(unanswered.size()));
        };
        callbacks.disabled = [this](const std::string &reason, bool is_configuration_error) {
            log += reason;
            events.push_back(is_configuration_error ? "misconfigured" : "disabled");
        };
        callbacks.stopped = [this](arhost_status, const std::string &) { events.push_back("stopped"); };
        component = std::make_unique<Component>(
            context, "source",
            std::vector<std::filesystem::path>{arhost::test::test_plugin_directory() + "/" + plugin + ".so"}, limits,
            arhost::sandbox::Policy{}, std::move(callbacks));
        component->start();
    }
    // Runs the reactor until `event` has occurred `times` times. Returns false after 20 s. Meanwhile, virtual time
    // passes so slowly that only back-off ends, but no deadline.
    bool until(const std::string &event, std::size_t times = 1) {
        const auto limit = std::chrono::steady_clock::now() + 20s;
        const auto never = reactor.at(reactor.now() + 24h, [] {}); // without a deadline, the reactor waits forever
        while (std::cmp_less(std::ranges::count(events, event), times)) {
            if (std::chrono::steady_clock::now() > limit)
                return false;
            reactor.run_once();
            clock.advance(1ms);
        }
        return true;
    }
    // Lets virtual time pass, and then the deadlines that end.
    void advance(std::chrono::milliseconds time) {
        clock.advance(time);
        reactor.run_once();
    }
    void read(std::uint64_t sequence) {
        Command command{};
        command.kind = CommandKind::read;
        command.slot = static_cast<std::uint32_t>(sequence % 4);
        command.sequence = sequence;
        component->submit(command);
    }
};

} // namespace

TEST(Component, StartsServesAndStops) {
    Bench bench;
    bench.make("source_counter", {}, {{"frames", 100}, {"crash_at", -1}});
    ASSERT_TRUE(bench.until("running")) << bench.log;
    bench.read(0);
    bench.read(1);
    ASSERT_TRUE(bench.until("result 1")) << bench.log;
    const RegionPointer &output = bench.component->output();
    EXPECT_EQ(output->layout.slot(output->mapping, 1)[0], std::byte(1)) << "the first pixel of a frame is its number";
    bench.component->stop();
    ASSERT_TRUE(bench.until("stopped"));
    EXPECT_EQ(bench.events, (std::vector<std::string>{"hello source_counter", "ready", "running", "result 0",
                                                      "result 1", "stopped"}));
    EXPECT_EQ(bench.component->restarts(), 0u);
}

TEST(Component, ReportsLostCommandsAndGetsNewMemoryAfterADeath) {
    Bench bench;
    bench.make("source_counter", {.restart = {.first_delay = 1ms}}, {{"frames", 100}, {"crash_at", 2}});
    ASSERT_TRUE(bench.until("running"));
    const RegionPointer first = bench.component->output();
    for (std::uint64_t i = 0; i < 4; ++i)
        bench.read(i);
    ASSERT_TRUE(bench.until("lost 2")) << "the commands 0 and 1 were answered, the last two were not";
    ASSERT_TRUE(bench.until("running", 2));
    EXPECT_NE(bench.component->output(), first);
    ASSERT_EQ(bench.component->crashes().size(), 1u);
    EXPECT_EQ(bench.component->crashes()[0].frame, 2u);
}

TEST(Component, CountsTheMemoryOfDeadProcessesThatIsInUse) {
    Bench bench;
    bench.make("source_counter", {.restart = {.proven_after_frames = 1}}, {{"frames", 100}, {"crash_at", 1}});
    std::vector<RegionPointer> used;
    for (std::size_t starts = 1; starts <= 3; ++starts) {
        ASSERT_TRUE(bench.until("running", starts)) << bench.log;
        EXPECT_EQ(bench.component->earlier_outputs(), starts - 1);
        used.push_back(bench.component->output());
        bench.read(0);
        bench.read(1);
    }
    used.erase(used.begin());
    EXPECT_EQ(bench.component->earlier_outputs(), 1u);
    used.clear();
    EXPECT_EQ(bench.component->earlier_outputs(), 0u);
}

TEST(Component, IsRestartedIfItsProcessIsStoppedBeyondTheDeadline) {
    Bench bench;
    bench.make("source_counter", {.frame = 200ms, .restart = {.first_delay = 1ms}},
               {{"frames", 100}, {"crash_at", -1}});
    ASSERT_TRUE(bench.until("running"));
    ::kill(bench.component->pid(), SIGSTOP);
    bench.read(0);
    bench.advance(199ms);
    EXPECT_TRUE(bench.component->running());
    bench.advance(1ms);
    EXPECT_FALSE(bench.component->running());
    bench.advance(100ms); // a stopped process only reacts to SIGKILL
    ASSERT_TRUE(bench.until("lost 1"));
    EXPECT_NE(bench.component->crashes()[0].how.find("hung: neither an answer nor progress within 200 ms"),
              std::string::npos);
    ASSERT_TRUE(bench.until("running", 2));
}

// In real time, because each report of progress restarts the deadline.
TEST(Component, ASourceThatReportsProgressMayExceedTheDeadlineOfAFrame) {
    for (const char *plugin : {"source_waiting_live", "source_waiting"}) {
        Bench bench(&arhost::base::steady_clock());
        bench.make(plugin, {.frame = 300ms, .restart = {}});
        ASSERT_TRUE(bench.until("running")) << bench.log;
        bench.read(0);
        ASSERT_TRUE(bench.until("result 0")) << bench.log;
        EXPECT_EQ(bench.component->restarts(), 0u);
    }
}

// The deadlines of start and stop restart with each progress report, which must not keep a worker alive forever.
TEST(Component, EndsAStartThatReportsProgressForever) {
    Bench bench;
    bench.make("hostile_source", {.start_total = 300ms, .restart = {.quarantine_after = 1}},
               {{"attack", "endless_start"}});
    ASSERT_TRUE(bench.until("hello hostile_source")) << bench.log;
    bench.advance(300ms);
    ASSERT_TRUE(bench.until("disabled")) << bench.log;
    ASSERT_EQ(bench.component->crashes().size(), 1u);
    EXPECT_NE(bench.component->crashes()[0].how.find("did not start within 300 ms in total, although it reported "
                                                     "progress"),
              std::string::npos);
}

TEST(Component, EndsAStopThatReportsProgressForever) {
    Bench bench;
    bench.make("hostile_source", {.stop_total = 300ms, .restart = {}}, {{"attack", "endless_stop"}});
    ASSERT_TRUE(bench.until("running")) << bench.log;
    bench.component->stop();
    bench.advance(299ms);
    EXPECT_TRUE(bench.component->running());
    bench.advance(1ms);
    ASSERT_TRUE(bench.until("stopped")) << bench.log;
    ASSERT_EQ(bench.component->crashes().size(), 1u);
    EXPECT_NE(bench.component->crashes()[0].how.find("did not stop within 300 ms in total, although it reported "
                                                     "progress"),
              std::string::npos);
}

// The error must not be mistaken for one of the configuration, which is not retried.
TEST(Component, RetriesAStartThatFailsWithALongError) {
    Bench bench;
    bench.make("hostile_source", {.restart = {.quarantine_after = 2, .first_delay = 1ms}},
               {{"attack", "long_error"}});
    ASSERT_TRUE(bench.until("disabled")) << bench.log.substr(0, 1000);
    EXPECT_EQ(bench.component->restarts(), 1u);
    EXPECT_LT(bench.log.size(), 10'000u);
}

TEST(Component, IsDisabledIfItsLibraryIsUnusable) {
    for (const char *plugin : {"broken_constructor", "none"}) {
        Bench bench;
        bench.make(plugin);
        ASSERT_TRUE(bench.until("misconfigured")) << bench.log;
        EXPECT_EQ(bench.component->state(), Component::State::disabled);
        EXPECT_EQ(bench.component->restarts(), 0u);
    }
}

TEST(Component, IsDisabledIfItsWorkerReportsAnotherPlugin) {
    for (const auto &[plugin, problem] :
         {std::pair{"broken_id", "broken_id.so: its id is 'broken_id'; it must begin with a domain"},
          {"broken_name", "broken_name.so: its id is 'org.arhost.rt_embree'; rename the file to match"}}) {
        Bench bench;
        bench.make(plugin);
        ASSERT_TRUE(bench.until("misconfigured")) << bench.log;
        EXPECT_NE(bench.log.find(problem), std::string::npos) << bench.log;
        EXPECT_EQ(std::ranges::count(bench.events, "running"), 0);
    }
}
