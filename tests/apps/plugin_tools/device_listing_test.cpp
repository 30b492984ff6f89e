// SPDX-License-Identifier: Apache-2.0
//
// Tests that query real plugins in real workers.
#include "plugin_tools/device_listing.hpp"

#include "plugin_under_test.hpp"
#include "supervise/probe.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

using namespace arhost;
using namespace arhost::devices;
using testing::HasSubstr;
using testing::StartsWith;

namespace {

struct Probe : testing::Test {
    // Sets the folder in which GPU drivers keep their shader caches.
    void SetUp() override { ::setenv("XDG_CACHE_HOME", scratch.path().c_str(), 1); }

    plugin_tools::DevicesResult devices(const std::string &plugin, const std::vector<std::string> &needs = {},
                                        std::chrono::seconds timeout = std::chrono::seconds(60)) {
        return plugin_tools::list_devices(context(), file(plugin), {}, needs, timeout);
    }
    DeviceList list(const std::string &plugin, const std::vector<std::string> &needs = {}) {
        const plugin_tools::DevicesResult result = devices(plugin, needs);
        if (const auto *reason = std::get_if<std::string>(&result))
            throw std::runtime_error(*reason);
        return std::get<std::optional<DeviceList>>(result).value();
    }
    std::string reason(const std::string &plugin, std::chrono::seconds timeout = std::chrono::seconds(60)) {
        return std::get<std::string>(devices(plugin, {}, timeout));
    }
    static std::filesystem::path file(const std::string &plugin) {
        return arhost::test::test_plugin_directory() + "/" + plugin + ".so";
    }
    supervise::Context &context() {
        if (!context_)
            context_.emplace(supervise::Context{
                reactor_, launcher_.emplace(arhost::test::build_directory() + "/bin/arhost-launcher"),
                arhost::test::build_directory() + "/bin/arhost-worker",
                [](arhost_severity, const std::string &, const std::string &) {}});
        return *context_;
    }

    test::ScratchFolder scratch;

private:
    ipc::Reactor reactor_;
    std::optional<supervise::Launcher>
        launcher_; // created in SetUp, because it inherits the environment that is set there
    std::optional<supervise::Context> context_;
};

} // namespace

TEST_F(Probe, DescribesAPluginOrWhyItIsUnusable) {
    std::string level;
    const supervise::ProbeResult good = supervise::probe(context(), file("source_counter"), {}, &level);
    EXPECT_EQ(std::get<model::PluginDescription>(good).id, "org.arhost.test.source_counter");
    EXPECT_NE(level, "");
    EXPECT_THAT(std::get<std::string>(supervise::probe(context(), file("no_plugin"), {})),
                HasSubstr("is not an arhost plugin"));
    EXPECT_THAT(std::get<std::string>(supervise::probe(context(), file("broken_constructor"), {})),
                HasSubstr("while its library was loaded"));
    EXPECT_THAT(std::get<std::string>(supervise::probe(context(), file("broken_name"), {})),
                HasSubstr("its id is 'org.arhost.rt_embree'; rename the file to match"));
}

TEST_F(Probe, ListsDevices) {
    const DeviceList listed = list("source_counter");
    ASSERT_EQ(listed.devices.size(), 2u);
    EXPECT_EQ(listed.left_out, 0u);
    const DeviceDescription &first = listed.devices[0], &second = listed.devices[1];
    EXPECT_EQ(first.index, 0u);
    EXPECT_EQ(first.kind, ARHOST_DEVICE_DISCRETE_GPU);
    EXPECT_FALSE(first.is_default);
    EXPECT_EQ(first.name, "Abacus  [2J3000") << "control characters must be replaced";
    EXPECT_EQ(first.serial, "0d15c0de-0000");
    EXPECT_EQ(first.abilities, "counts: up, down");
    EXPECT_EQ(second.index, 1u);
    EXPECT_TRUE(second.is_default);
    EXPECT_EQ(second.serial, "");
    EXPECT_EQ(list("lister_none").devices.size(), 0u);
}

TEST_F(Probe, ReportsAPluginWithoutTheDevicesExtension) {
    EXPECT_EQ(std::get<std::optional<DeviceList>>(devices("tracker_counter")), std::nullopt);
}

TEST_F(Probe, ListsFormatsAndControls) {
    const DeviceList listed = list("lister_cameras");
    ASSERT_EQ(listed.devices.size(), 5u);
    const DeviceDescription &camera = listed.devices[0];
    EXPECT_EQ(camera.path, "/dev/video-eye");
    ASSERT_EQ(camera.formats.size(), 3u);
    EXPECT_EQ(camera.formats[0],
              (DeviceFormat{"yuyv", false, {{640, 480, false, {30, 30000. / 1001, 7.5}}, {1280, 720, false, {30}}}}));
    EXPECT_EQ(camera.formats[1], (DeviceFormat{"grey", true, {{32, 24, true, {60, 1}}, {4096, 3072, false, {}}}}));
    ASSERT_EQ(camera.controls.size(), 3u);
    EXPECT_EQ(camera.controls[0], (DeviceControl{"gain", ARHOST_DEVICE_CONTROL_INTEGER, -16, 16, 4, 0, 8}));
    EXPECT_EQ(camera.controls[1], (DeviceControl{"mute", ARHOST_DEVICE_CONTROL_BOOLEAN, 0, 1, 1, 1, {}}));
    EXPECT_EQ(listed.devices[4].rate, 59.94);
}

TEST_F(Probe, LimitsTheNumberAndTheTextsOfDevices) {
    const DeviceList listed = list("lister_many");
    EXPECT_EQ(listed.devices.size(), std::size_t{ARHOST_MAX_DEVICES});
    EXPECT_EQ(listed.left_out, 10'000u - ARHOST_MAX_DEVICES);
    EXPECT_EQ(listed.devices.back().name, std::string(max_device_text_size, '"') + "…");
}

TEST_F(Probe, ReportsWhyDevicesCantBeListed) {
    EXPECT_EQ(reason("lister_fail"), "the driver is too old");
    EXPECT_EQ(reason("lister_broken"), "it reported a device without a name");
    EXPECT_THAT(reason("lister_crash"), testing::ContainsRegex("killed by signal 11 .* while it listed its devices"));
    EXPECT_THAT(reason("lister_hang", std::chrono::seconds(1)),
                StartsWith("did not respond within 1 s; ended by arhost "));
    EXPECT_THAT(reason("no_plugin"), HasSubstr("is not an arhost plugin"));
}

TEST_F(Probe, GrantsDevicesButNoNetwork) {
    std::string level;
    supervise::probe(context(), file("lister_gpu"), {}, &level);
    if (level.substr(0, level.find("MISSING")).find("seccomp") == std::string::npos)
        GTEST_SKIP() << "this machine's sandbox is: " << level;
    const DeviceList with = list("lister_gpu", {"gpu", "network"}), without = list("lister_gpu");
    EXPECT_EQ(with.devices.at(0).name, "with its shaders");
    EXPECT_EQ(with.devices.at(0).abilities, "no network");
    EXPECT_EQ(without.devices.at(0).name, "without its shaders");
}
