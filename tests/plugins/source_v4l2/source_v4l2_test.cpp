// SPDX-License-Identifier: Apache-2.0
//
// Tests that need no camera: error messages. vivid_test.cpp tests capturing.
#include "../source_file/source_under_test.hpp"

#include <gmock/gmock.h>

#include <unistd.h>

#include <algorithm>
#include <fstream>

namespace fs = std::filesystem;
using arhost::test::ScratchFolder;
using arhost::test::SourceUnderTest;
using testing::HasSubstr;

namespace {

std::string rejection(const std::string &device) {
    return SourceUnderTest::rejection("source_v4l2", {{"device", device}});
}

} // namespace

TEST(V4l2Rejection, NamesAMissingDeviceAndAlternatives) {
    const std::string text = rejection("/dev/video-none");
    EXPECT_THAT(text, HasSubstr("device: '/dev/video-none' does not exist"));
    if (fs::exists("/dev/video0")) {
        EXPECT_THAT(text, HasSubstr("/dev/video0"));
        EXPECT_THAT(text, HasSubstr("arhost devices"));
    } else {
        EXPECT_THAT(text, HasSubstr("no /dev/video* exists"));
        EXPECT_THAT(text, HasSubstr("source_synthetic"));
    }
}

TEST(V4l2Rejection, ReportsADeviceThatIsNotAVideoDevice) {
    EXPECT_THAT(rejection("/dev/null"), HasSubstr("'/dev/null' is not a video device"));
    ScratchFolder folder;
    std::ofstream(folder.path() / "file") << "text";
    EXPECT_THAT(rejection(folder.path() / "file"), HasSubstr("is not a video device"));
    EXPECT_THAT(rejection(folder.path()), HasSubstr("is a folder"));
}

TEST(V4l2Rejection, NamesTheGroupThatMayOpenACamera) {
    ScratchFolder folder;
    std::ofstream(folder.path() / "video0") << "";
    fs::permissions(folder.path() / "video0", fs::perms::none);
    fs::permissions(folder.path(), fs::perms::all);
    const bool root = geteuid() == 0;
    ASSERT_EQ(seteuid(root ? 65534 : geteuid()), 0); // permissions do not limit root
    const std::string text = rejection(folder.path() / "video0");
    ASSERT_EQ(seteuid(root ? 0 : geteuid()), 0);
    EXPECT_THAT(text, HasSubstr("group 'video'"));
}

TEST(V4l2Rejection, RequiresBothSidesOfASizeOrNeither) {
    EXPECT_THAT(SourceUnderTest::rejection("source_v4l2", {{"width", "640"}}), HasSubstr("set both or neither"));
}

TEST(V4l2, DeclaresVideoNeedsAndLiveCapability) {
    SourceUnderTest source("source_v4l2");
    const arhost_descriptor &descriptor = source.plugin().descriptor();
    EXPECT_STREQ(descriptor.id, "org.arhost.source_v4l2");
    EXPECT_EQ(descriptor.capabilities, ARHOST_SOURCE_CAPABILITY_LIVE);
    ASSERT_NE(descriptor.needs, nullptr);
    EXPECT_STREQ(descriptor.needs[0], "video");
    EXPECT_EQ(descriptor.needs[1], nullptr);
}
