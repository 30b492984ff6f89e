// SPDX-License-Identifier: Apache-2.0
#include "file_bytes.hpp"

#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

namespace rt_vulkan {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(FileBytes, AreThoseOfAWholeFileThatIsNotTooLarge) {
    const arhost::test::ScratchFolder folder;
    const auto file = folder.path() / "file";
    EXPECT_THAT(file_bytes(file, 4), IsEmpty()) << "there is none";
    EXPECT_THAT(file_bytes(folder.path(), 1 << 20), IsEmpty()) << "a folder";
    std::ofstream(file) << "abcd";
    EXPECT_THAT(file_bytes(file, 4), ElementsAre('a', 'b', 'c', 'd'));
    EXPECT_THAT(file_bytes(file, 3), IsEmpty());
}

} // namespace rt_vulkan
