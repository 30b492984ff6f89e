// SPDX-License-Identifier: Apache-2.0
//
// Error messages, without a camera. camera_test.cpp tests capturing.
#include "../source_file/source_under_test.hpp"

#include <gmock/gmock.h>

#include <algorithm>

using arhost::test::SourceUnderTest;
using testing::HasSubstr;

TEST(UvcRejection, DescribesTheFormOfAnIdentity) {
    for (const char *text : {"046d", "046d:", ":0825", "046d:0825x", "046g:0825", "12345:0825", "046d;0825"})
        EXPECT_THAT(SourceUnderTest::rejection("source_uvc", {{"usb", text}}),
                    HasSubstr("is not of the form VENDOR:PRODUCT[:SERIAL], such as 046d:0825"))
            << text;
}

TEST(UvcRejection, NamesTheCameraThatIsMissing) {
    EXPECT_THAT(SourceUnderTest::rejection("source_uvc", {{"usb", "ffff:fffe:a:b"}}, ARHOST_STATUS_ERROR_DEVICE_LOST),
                HasSubstr("there is no camera ffff:fffe with the serial number 'a:b'"));
}

TEST(UvcRejection, RequiresBothSidesOfASizeOrNeither) {
    EXPECT_THAT(SourceUnderTest::rejection("source_uvc", {{"width", "640"}}), HasSubstr("set both or neither"));
}

TEST(Uvc, DeclaresUsbNeedsAndLiveCapability) {
    SourceUnderTest source("source_uvc");
    const arhost_descriptor &descriptor = source.plugin().descriptor();
    EXPECT_STREQ(descriptor.id, "org.arhost.source_uvc");
    EXPECT_EQ(descriptor.capabilities, ARHOST_SOURCE_CAPABILITY_LIVE);
    ASSERT_NE(descriptor.needs, nullptr);
    EXPECT_STREQ(descriptor.needs[0], "usb");
    EXPECT_EQ(descriptor.needs[1], nullptr);
}
