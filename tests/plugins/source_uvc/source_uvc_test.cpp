// SPDX-License-Identifier: Apache-2.0
//
// Error messages, without a camera. camera_test.cpp tests capturing.
#include "../source_file/source_under_test.hpp"

#include <gmock/gmock.h>

#include <algorithm>

using arhost::test::SourceUnderTest;
using testing::HasSubstr;

namespace {

std::string rejection(const std::map<std::string, std::string> &options, arhost_status expected) {
    SourceUnderTest source("source_uvc");
    EXPECT_EQ(source.start(options), expected) << source.log();
    const std::string errors = source.log(ARHOST_SEVERITY_ERROR);
    EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << "expected one error message, got:\n" << errors;
    return errors;
}

} // namespace

TEST(UvcRejection, DescribesTheFormOfAnIdentity) {
    for (const char *text : {"046d", "046d:", ":0825", "046d:0825x", "046g:0825", "12345:0825", "046d;0825"})
        EXPECT_THAT(rejection({{"usb", text}}, ARHOST_STATUS_ERROR_CONFIGURATION),
                    HasSubstr("is not of the form VENDOR:PRODUCT[:SERIAL], such as 046d:0825"))
            << text;
}

TEST(UvcRejection, NamesTheCameraThatIsMissing) {
    EXPECT_THAT(rejection({{"usb", "ffff:fffe:a:b"}}, ARHOST_STATUS_ERROR_DEVICE_LOST),
                HasSubstr("there is no camera ffff:fffe with the serial number 'a:b'"));
}

TEST(UvcRejection, RequiresBothSidesOfASizeOrNeither) {
    EXPECT_THAT(rejection({{"width", "640"}}, ARHOST_STATUS_ERROR_CONFIGURATION), HasSubstr("set both or neither"));
}

TEST(Uvc, DeclaresUsbNeedsAndLiveCapability) {
    SourceUnderTest source("source_uvc");
    const arhost_descriptor &descriptor = source.plugin().descriptor();
    EXPECT_STREQ(descriptor.id, "source_uvc");
    EXPECT_EQ(descriptor.capabilities, static_cast<std::uint32_t>(ARHOST_CAPABILITY_LIVE));
    ASSERT_NE(descriptor.needs, nullptr);
    EXPECT_STREQ(descriptor.needs[0], "usb");
    EXPECT_EQ(descriptor.needs[1], nullptr);
}
