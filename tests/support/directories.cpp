// SPDX-License-Identifier: Apache-2.0
#include "directories.hpp"

namespace arhost::test {

std::string source_directory() {
    return ARHOST_SOURCE_DIRECTORY;
}
std::string build_directory() {
    return ARHOST_BINARY_DIRECTORY;
}
std::string plugin_directory() {
    return ARHOST_PLUGIN_DIRECTORY;
}
std::string test_plugin_directory() {
    return build_directory() + "/tests/plugins";
}
std::string wrong_plugin_directory() {
    return build_directory() + "/tests/wrong";
}
std::string shared_data_directory() {
    return ARHOST_SHARED_DATA;
}

} // namespace arhost::test
