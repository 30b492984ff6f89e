// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"

#include <gtest/gtest.h>

using namespace arhost::web;

TEST(WebChecks, AcceptsAddressesLocalhostAndConfiguredNamesAsHost) {
    for (const char *host : {"127.0.0.1", "127.0.0.1:8080", "[::1]:8080", "[::1]", "192.168.1.7:80", "localhost:8080",
                             "LocalHost", "lab:8080", "Rig.example:1"})
        EXPECT_TRUE(is_own_host(host, "lab, rig.example")) << host;
    for (const char *host :
         {"", "evil.example", "evil.example:8080", "127.0.0.1.evil.example", "localhost.evil.example",
          "127.0.0.1:", "127.0.0.1:x", "[::1", "::1", "[::1]x:1", "[127.0.0.1]", "lab,", "localhost:1:2"})
        EXPECT_FALSE(is_own_host(host, "lab, rig.example")) << host;
    EXPECT_FALSE(is_own_host("", ""));
}

TEST(WebChecks, AcceptsOnlyTheServersOwnOrigin) {
    EXPECT_TRUE(is_own_origin("http://127.0.0.1:8080", "127.0.0.1:8080"));
    EXPECT_TRUE(is_own_origin("https://Lab", "lab"));
    for (const char *origin : {"null", "", "http://127.0.0.1:8081", "http://127.0.0.1", "file://127.0.0.1:8080",
                               "http://127.0.0.1:8080.evil.example", "http://evil.example"})
        EXPECT_FALSE(is_own_origin(origin, "127.0.0.1:8080")) << origin;
}

TEST(WebChecks, AcceptsOnlyTheWholeToken) {
    EXPECT_TRUE(has_token("Bearer abcdefgh12345678", "abcdefgh12345678"));
    EXPECT_TRUE(has_token("bearer abcdefgh12345678", "abcdefgh12345678"));
    for (const char *header : {"", "Bearer", "Bearer ", "abcdefgh12345678", "Basic abcdefgh12345678",
                               "Bearer abcdefgh1234567", "Bearer abcdefgh123456789", "Bearer abcdefgh12345679"})
        EXPECT_FALSE(has_token(header, "abcdefgh12345678")) << header;
}

TEST(WebChecks, TheUrlThatIsShownCanBeOpened) {
    EXPECT_EQ(url_of("127.0.0.1:8080", ""), "http://127.0.0.1:8080/");
    EXPECT_EQ(url_of("192.168.1.7:80", "lab"), "http://192.168.1.7:80/");
    EXPECT_EQ(url_of("0.0.0.0:8080", ""), "http://localhost:8080/");
    EXPECT_EQ(url_of("[::]:8080", " , "), "http://localhost:8080/");
    EXPECT_EQ(url_of("0.0.0.0:8080", " lab, rig.example"), "http://lab:8080/");
}
