// SPDX-License-Identifier: Apache-2.0
//
// Tests a worker process with a plugin; the test takes the role of the host.
#include "devices/device_list.hpp"
#include "supervise/process.hpp"

#include "plugin_under_test.hpp"
#include "sandbox/sandbox.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>

using namespace arhost;
using namespace arhost::ipc;
using namespace arhost::model;

namespace {

struct Conversation {
    Reactor reactor;
    supervise::Launcher launcher{arhost::test::build_directory() + "/bin/arhost-launcher"};
    supervise::Context context{reactor, launcher, arhost::test::build_directory() + "/bin/arhost-worker",
                               [](arhost_severity, const std::string &, const std::string &) {}};
    std::vector<Json> received;
    std::string death;
    supervise::WorkerBudget budget;
    supervise::Process process;

    explicit Conversation(const std::string &plugin)
        : budget(context.log, plugin),
          process(context, budget,
                  {[this](Message &message) { received.push_back(message.body); }, [](const Result &) {},
                   [this](const supervise::Death &how) { death = how.how; }},
                  messages::Open{arhost::test::test_plugin_directory() + "/" + plugin + ".so"}, sandbox::Policy{}) {}

    // Returns the next message of the worker, which must be a T, or nullopt if the worker has died.
    template <class T> std::optional<T> next() {
        while (received.empty() && death.empty())
            reactor.run_once();
        if (received.empty())
            return std::nullopt;
        const Message message{received.front(), {}};
        received.erase(received.begin());
        if (!is<T>(message))
            throw std::runtime_error("unexpected " + message.body.dump());
        return parse<T>(message);
    }
};

// Returns the default values of the options of source_counter, all of which are integers.
std::vector<OptionValue> default_options(const messages::Hello &hello) {
    std::vector<OptionValue> values;
    for (const OptionDeclaration &o : hello.descriptor.options)
        values.push_back({o.key, o.type, std::atoi(o.default_value->c_str()), 0.0, ""});
    return values;
}

} // namespace

TEST(Worker, ListsDevicesRepeatedlyBeforeCreate) {
    Conversation worker("source_counter");
    const auto hello = worker.next<messages::Hello>();
    ASSERT_TRUE(hello);
    for (int i = 0; i < 2; ++i) {
        worker.process.send(messages::ListDevices{});
        const auto answer = worker.next<messages::Devices>().value();
        EXPECT_TRUE(answer.is_last);
        EXPECT_EQ(devices::devices_from_text(answer.part).value().devices.size(), 2u);
    }
    worker.process.send(messages::Create{default_options(*hello), messages::SourceSetup{}});
    EXPECT_TRUE(worker.next<messages::Ready>().value().format);
}

TEST(Worker, ContinuesAfterAFailureToListDevices) {
    Conversation worker("lister_fail");
    ASSERT_TRUE(worker.next<messages::Hello>());
    for (int i = 0; i < 2; ++i) {
        worker.process.send(messages::ListDevices{});
        const auto failed = worker.next<messages::Failed>();
        ASSERT_TRUE(failed);
        EXPECT_EQ(failed->status, ARHOST_STATUS_ERROR_UNSUPPORTED);
        EXPECT_EQ(failed->text, "the driver is too old");
    }
}

TEST(Worker, ReportsACrashWhileListingDevices) {
    Conversation worker("lister_crash");
    ASSERT_TRUE(worker.next<messages::Hello>());
    worker.process.send(messages::ListDevices{});
    ASSERT_FALSE(worker.next<messages::Devices>());
    EXPECT_TRUE(worker.death.ends_with(" while it listed its devices")) << worker.death;
}

TEST(Worker, ExitsIfTheSetupIsForAnotherKind) {
    Conversation worker("source_counter");
    const auto hello = worker.next<messages::Hello>();
    ASSERT_TRUE(hello);
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
    format.width = format.height = 16;
    ASSERT_TRUE(arhost_frame_layout(&format));
    worker.process.send(messages::Create{default_options(*hello), messages::SinkSetup{format, 25, 0, {}}});
    const auto failed = worker.next<messages::Failed>();
    ASSERT_TRUE(failed);
    EXPECT_EQ(failed->status, ARHOST_STATUS_ERROR_INTERNAL);
    EXPECT_EQ(failed->text, "protocol violation: the setup is for another kind of plugin");
    EXPECT_FALSE(worker.next<messages::Ready>());
}

TEST(Worker, ReportsViolationsOfTheProtocol) {
    Conversation worker("source_counter");
    ASSERT_TRUE(worker.next<messages::Hello>());
    worker.process.send(messages::Stop{});
    const auto failed = worker.next<messages::Failed>();
    ASSERT_TRUE(failed);
    EXPECT_EQ(failed->text, "protocol violation: the host's message after 'hello' is not 'create'");
}
