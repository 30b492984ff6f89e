// SPDX-License-Identifier: Apache-2.0
//
// The symbols of a shared object, read from its file: nothing of it runs.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::conformance {

// Those that other libraries could bind to. Throws std::runtime_error where the file is no 64-bit ELF.
std::vector<std::string> exported_symbols(const std::filesystem::path &file);

} // namespace arhost::conformance
