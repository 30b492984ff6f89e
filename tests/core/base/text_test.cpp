// SPDX-License-Identifier: Apache-2.0
#include "base/text.hpp"

#include <gtest/gtest.h>

using namespace arhost::base;

TEST(Printable, KeepsTextInAnyLanguage) {
    for (const std::string text : {"", "Embree", "640×480, p50 ½ ms", "Трассировщик", "光線追跡", "🎲"})
        EXPECT_EQ(printable(text), text);
}

TEST(Printable, IsOneLineThatCannotControlATerminal) {
    EXPECT_EQ(printable("a\nb\r\tc"), "a b  c");
    EXPECT_EQ(printable("\x1b[2Jgone\a\x7f"), " [2Jgone  ");
    EXPECT_EQ(printable("\u009b2J"), " 2J");                           // the control character CSI
    EXPECT_EQ(printable("a\u202efdp.exe\u2069\u2028"), "a fdp.exe  "); // would be displayed from right to left
    EXPECT_EQ(printable("1\u200e2\u200f3\u061c4"), "1 2 3 4");
    EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a b");
}

TEST(Printable, ContainsOnlyCharactersValidInXml) {
    EXPECT_EQ(printable("a\ufffe\uffff"), "a  ");
}

TEST(Printable, IsTruncatedBetweenCharacters) {
    EXPECT_EQ(printable("12345", 5), "12345");
    EXPECT_EQ(printable("123456", 5), "12345…");
    EXPECT_EQ(printable("123½6", 4), "123…");
    EXPECT_EQ(printable("\xe9\xe9", 4), "\ufffd…") << "the replacement character counts towards max_size";
}

TEST(Printable, ReplacesInvalidUtf8) {
    EXPECT_EQ(printable("Bas\xe9"), "Bas\ufffd");
    EXPECT_EQ(printable("\xed\xa0\x80").find('\xed'), std::string::npos); // a lone surrogate
    EXPECT_EQ(printable("\xc0\xaf").find('/'), std::string::npos);        // an overlong encoding
    EXPECT_EQ(valid_utf8("\xf0\x9f\x8e"), "\ufffd");                      // truncated
    EXPECT_EQ(valid_utf8("é\n"), "é\n");
    EXPECT_TRUE(is_utf8("é\n\ufffd"));
    EXPECT_FALSE(is_utf8("Bas\xe9"));
}
