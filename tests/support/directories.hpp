// SPDX-License-Identifier: Apache-2.0
//
// The folders that the tests use, as absolute paths. They are functions and not macros, so that the compiler cache
// serves the sources of the tests to every clone. Besides directories.cpp, only the folder of rt_vulkan's failing
// layer (failures_test.cpp) and the three files that sink_web and source_synthetic embed depend on the path of the
// clone.
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
