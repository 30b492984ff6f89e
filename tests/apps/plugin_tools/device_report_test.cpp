// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/device_report.hpp"

#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <cerrno>
#include <fcntl.h>
#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

using namespace arhost;
using plugin_tools::holders_of;
using plugin_tools::problem_with;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

namespace {

devices::DeviceDescription device_in(arhost_device_state state, const std::string &path) {
    devices::DeviceDescription device;
    device.kind = ARHOST_DEVICE_CAMERA;
    device.state = state;
    device.name = "Eye";
    device.path = path;
    return device;
}

} // namespace

TEST(DeviceReport, NamesTheProcessesThatHaveOpenedANode) {
    const std::string self =
        std::string(program_invocation_short_name).substr(0, 15) + " (process " + std::to_string(::getpid()) + ")";
    EXPECT_THAT(holders_of("/dev/full"), Not(Contains(self)));
    const int fd = ::open("/dev/full", O_RDONLY | O_CLOEXEC);
    ASSERT_GE(fd, 0);
    EXPECT_THAT(holders_of("/dev/full"), Contains(self));
    EXPECT_THAT(holders_of("/dev/zero"), Not(Contains(self)));
    EXPECT_THAT(problem_with(device_in(ARHOST_DEVICE_STATE_BUSY, "/dev/full")), HasSubstr(self));
    ::close(fd);
    EXPECT_THAT(holders_of("/dev/full"), Not(Contains(self)));
}

TEST(DeviceReport, FindsNoProcessForOtherFiles) {
    const test::ScratchFolder folder;
    const std::string file = folder.path() / "full";
    const int fd = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
    EXPECT_TRUE(holders_of(file).empty());
    EXPECT_TRUE(holders_of("/dev/arhost-none").empty());
    ::close(fd);
    EXPECT_EQ(problem_with(device_in(ARHOST_DEVICE_STATE_BUSY, "/dev/arhost-none")),
              "in use by a program of another user; 'sudo fuser -v /dev/arhost-none' shows it");
}

// The group is tested with a real camera in a virtual machine (tests/plugins/source_v4l2/vivid_test.cpp).
TEST(DeviceReport, NamesTheUserWhoMayOpenANode) {
    struct stat status {};
    const char *const node = "/dev/console";
    if (::stat(node, &status) != 0 || !S_ISCHR(status.st_mode) || (status.st_mode & S_IRGRP))
        GTEST_SKIP() << "needs a /dev/console that its group may not read";
    const passwd *user = ::getpwuid(status.st_uid);
    EXPECT_EQ(problem_with(device_in(ARHOST_DEVICE_STATE_FORBIDDEN, node)),
              "only the user '" + (user ? std::string(user->pw_name) : std::to_string(status.st_uid)) +
                  "' may open it");
}

TEST(DeviceReport, DoesNotLookAtPathsOutsideOfDev) {
    EXPECT_EQ(problem_with(device_in(ARHOST_DEVICE_STATE_FORBIDDEN, "/etc/shadow")), "this user may not open it");
}

TEST(DeviceReport, PassesOnTheProblemOfThePlugin) {
    devices::DeviceDescription device = device_in(ARHOST_DEVICE_STATE_UNUSABLE, "");
    device.problem = "no lens";
    EXPECT_EQ(problem_with(device), "no lens");
    EXPECT_EQ(problem_with(device_in(ARHOST_DEVICE_STATE_USABLE, "/dev/full")), "");
}
