// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <directories.hpp>

#include <fstream>
#include <iterator>
#include <string>

namespace arhost::test {

// Returns the text of a file in docs/.
inline std::string read_document(const std::string &name) {
    std::ifstream file(source_directory() + "/docs/" + name);
    return {std::istreambuf_iterator<char>(file), {}};
}

} // namespace arhost::test
