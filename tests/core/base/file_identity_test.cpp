// SPDX-License-Identifier: Apache-2.0
#include "base/file_identity.hpp"
#include "plugin_under_test.hpp"

#include <gtest/gtest.h>

#include <fstream>

using namespace arhost::base;
namespace fs = std::filesystem;

TEST(FileIdentity, IsTheSameForAllLinksToAFile) {
    const arhost::test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path()), file = folder / "file";
    std::ofstream(file) << "x";
    fs::create_symlink("file", folder / "link");
    fs::create_hard_link(file, folder / "hard");
    fs::create_directory_symlink(".", folder / "here");
    const FileIdentity identity = identity_of(file);
    EXPECT_EQ(identity.path, file);
    EXPECT_EQ(identity_of(folder / "link").path, file);
    EXPECT_EQ(identity_of(folder / "here/./link").path, file);
    EXPECT_NE(identity_of(folder / "hard").path, file);
    EXPECT_EQ(identity_of(folder / "hard").node, identity.node);
}

TEST(FileIdentity, IsThePathIfTheFileDoesNotExist) {
    const arhost::test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path());
    fs::create_directory_symlink(".", folder / "here");
    const FileIdentity identity = identity_of(folder / "here/none");
    EXPECT_EQ(identity.path, folder / "none");
    EXPECT_EQ(identity.node, folder / "none");
    fs::create_symlink("here/none", folder / "to_none");
    fs::create_symlink("loop", folder / "loop");
    EXPECT_EQ(real_path(folder / "to_none"), folder / "none");
    EXPECT_EQ(real_path(folder / "loop"), folder / "loop");
    EXPECT_EQ(real_path(folder / "here/../none"), folder.parent_path() / "none");
}
