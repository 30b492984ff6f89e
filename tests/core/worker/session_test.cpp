// SPDX-License-Identifier: Apache-2.0
//
// A real worker with a real plugin, spoken to by hand.
#include "supervise/process.hpp"

#include "ipc/json_abi.hpp"
#include "plugin_under_test.hpp"
#include "sandbox/sandbox.hpp"

#include <gtest/gtest.h>

using namespace arhost;
using namespace arhost::ipc;

namespace {

struct Conversation {
    Reactor reactor;
    supervise::Launcher launcher{ARHOST_BINARY_DIRECTORY "/bin/arhost-launcher"};
    supervise::Context context{reactor, launcher, ARHOST_BINARY_DIRECTORY "/bin/arhost-worker",
                               [](arhost_severity, const std::string &, const std::string &) {}};
    std::vector<Json> heard;
    std::string death;
    supervise::Process process;

    explicit Conversation(const std::string &plugin)
        : process(context, plugin,
                  {[this](Message &message) { heard.push_back(message.body); }, [](const Result &) {},
                   [this](const supervise::Death &how) { death = how.how; }},
                  {{"type", "open"},
                   {"plugin", ARHOST_TEST_PLUGIN_DIRECTORY "/" + plugin + ".so"},
                   {"sandbox", sandbox::to_json(sandbox::Policy{})}}) {}

    // Its next message that is not yet taken; of type "died" where it is dead.
    Json next() {
        while (heard.empty() && death.empty())
            reactor.run_once();
        if (heard.empty())
            return {{"type", "died"}, {"how", death}};
        const Json message = heard.front();
        heard.erase(heard.begin());
        return message;
    }
};

} // namespace

TEST(Worker, ListsDevicesAsOftenAsItIsAskedAndCreatesAfterwards) {
    Conversation worker("source_counter");
    const Json hello = worker.next();
    ASSERT_EQ(hello["type"], "hello");
    for (int i = 0; i < 2; ++i) {
        worker.process.send({{"type", "devices"}});
        const Json devices = worker.next();
        ASSERT_EQ(devices["type"], "devices");
        EXPECT_EQ(devices["devices"].size(), 2u);
    }
    std::vector<OptionValue> values;
    for (const OptionDeclaration &o : description_from_json(hello["descriptor"]).options)
        values.push_back({o.key, o.type, std::atoi(o.default_value->c_str()), 0.0, ""});
    worker.process.send({{"type", "create"},
                         {"options", to_json(values)},
                         {"setup", {{"first_sequence", 0}, {"fps", 0.0}, {"paced", false}}}});
    EXPECT_EQ(worker.next()["type"], "ready");
}

TEST(Worker, GoesOnAfterDevicesThatCantBeListed) {
    Conversation worker("lister_fail");
    ASSERT_EQ(worker.next()["type"], "hello");
    for (int i = 0; i < 2; ++i) {
        worker.process.send({{"type", "devices"}});
        const Json failed = worker.next();
        EXPECT_EQ(failed["type"], "failed");
        EXPECT_EQ(failed["status"], ARHOST_STATUS_ERROR_UNSUPPORTED);
        EXPECT_EQ(failed["text"], "the driver is too old");
    }
}

TEST(Worker, SaysThatItListedDevicesWhereItDiesThere) {
    Conversation worker("lister_crash");
    ASSERT_EQ(worker.next()["type"], "hello");
    worker.process.send({{"type", "devices"}});
    const Json died = worker.next();
    ASSERT_EQ(died["type"], "died");
    EXPECT_TRUE(died["how"].get<std::string>().ends_with(" while it listed its devices")) << died;
}
