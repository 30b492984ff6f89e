// SPDX-License-Identifier: Apache-2.0
//
// Formats paths and the contents of folders for messages.
#pragma once

#include <filesystem>
#include <string>

namespace arhost {

std::string quoted(const std::filesystem::path &path); // the path in single quotes

// Returns, for example: "the folder '/x/frames' has 3 entries: a.png, b.png, c.png".
std::string describe_folder(const std::filesystem::path &folder);

} // namespace arhost
