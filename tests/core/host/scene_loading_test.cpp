// SPDX-License-Identifier: Apache-2.0
//
// The tests send the messages that a compromised scene loader could send.
#include "host/scene_loading.hpp"

#include "fake_worker.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <fstream>

using namespace arhost;
using namespace arhost::ipc;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct SceneLoadingTest : testing::Test {
    const sandbox::Policy raytracer{.mode = sandbox::Mode::permissive};
    // Returns the failure that is reported after the loader has sent these messages and exited.
    std::string reason_after(const std::vector<Json> &messages) {
        base::Limits limits;
        limits.start = limits.start_total = std::chrono::hours(1);
        run_config::FilesInUse files;
        for (const char *name : {"a.mp4", "b.mp4"})
            files.write(yaml::Node::parse("{path: '" + (folder / name).string() + "'}", "run.yaml").require("path"));
        std::string failure;
        host::SceneLoading loading(context, folder / "scene.yaml", raytracer, limits, files,
                                   {[&](const SharedMemory &, const auto &, const auto &) { failure = "none"; },
                                    [&](const std::string &reason, const auto &) { failure = reason; }});
        for (const Json &message : messages)
            loader.channel.send(message);
        loader.die();
        while (failure.empty())
            reactor.run_once();
        return failure;
    }
    Json reads(const fs::path &file) const {
        const arhost::base::FileIdentity identity = arhost::base::identity_of(folder / file);
        return encode(messages::Reads{identity.path, identity.node});
    }
    arhost::test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path());
    Reactor reactor;
    arhost::test::FakeWorker loader;
    supervise::Context context{reactor, loader, "", [](arhost_severity, const std::string &, const std::string &) {}};
};

} // namespace

TEST_F(SceneLoadingTest, ReportsTheFirstFailure) {
    const Json failed = encode(messages::Failed{ARHOST_STATUS_ERROR_IO, "broken mesh"});
    EXPECT_THAT(reason_after({reads("a.mp4"), failed}), HasSubstr("a.mp4' is a file that this run reads"));
    EXPECT_THAT(reason_after({reads("a.mp4"), reads("b.mp4")}), HasSubstr("a.mp4' is a file that this run reads"));
    EXPECT_EQ(reason_after({failed, reads("a.mp4")}), "broken mesh");
}

TEST_F(SceneLoadingTest, DoesNotAccessFilesThatTheLoaderNames) {
    std::ofstream(folder / "a.mp4") << "x";
    fs::create_symlink("a.mp4", folder / "link.mp4");
    for (const char *name : {"link.mp4", "%d.mp4"})
        EXPECT_THAT(reason_after({encode(messages::Reads{folder / name, "0:0"})}), HasSubstr("exited"));
}

TEST_F(SceneLoadingTest, EndsALoaderThatReportsProgressForever) {
    base::Limits limits;
    limits.start = std::chrono::hours(1);
    limits.start_total = std::chrono::milliseconds(30);
    std::string failure;
    host::SceneLoading loading(context, folder / "scene.yaml", raytracer, limits, {},
                               {[&](const SharedMemory &, const auto &, const auto &) { failure = "none"; },
                                [&](const std::string &reason, const auto &) { failure = reason; }});
    const Json progress = encode(messages::Progress{0.5, "still busy"});
    Reactor::Registration next;
    const std::function<void()> report = [&] {
        if (!loader.channel.send(progress, {}, false)) // the host has ended the loader
            loader.die();
        next = reactor.at(Reactor::Clock::now() + std::chrono::milliseconds(1), report);
    };
    report();
    while (failure.empty())
        reactor.run_once();
    EXPECT_THAT(failure, HasSubstr("took longer than 30 ms, the limit in total"));
}

TEST_F(SceneLoadingTest, FailsIfTheLoaderViolatesTheProtocol) {
    EXPECT_THAT(reason_after({{{"type", "reads"}, {"path", 5}, {"node", "0:0"}}}),
                HasSubstr("protocol violation: malformed message 'reads'"));
    EXPECT_THAT(reason_after({{{"type", "log"}, {"text", "no severity"}}}),
                HasSubstr("protocol violation: malformed message 'log'"));
    EXPECT_THAT(reason_after({{{"kind", "untyped"}}}), HasSubstr("protocol violation: malformed message"));
}
