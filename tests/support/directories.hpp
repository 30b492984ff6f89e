// SPDX-License-Identifier: Apache-2.0
//
// The folders that the tests use, as absolute paths. They are functions and not macros, so that only directories.cpp
// depends on the place of the clone: the compiler cache serves all other files to every clone.
#pragma once

#include <string>

namespace arhost::test {

std::string source_directory();
std::string build_directory();
std::string plugin_directory();
std::string test_plugin_directory();  // plugins that only the tests use
std::string wrong_plugin_directory(); // plugins with one defect each, for the conformance suite
std::string shared_data_directory();  // pictures and meshes that are not part of the project; may be absent

} // namespace arhost::test
