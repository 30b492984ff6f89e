// SPDX-License-Identifier: Apache-2.0
//
// A session is content: it may come from someone else, and plugins write it. Its configuration grants nothing by
// itself.
#pragma once

#include "cli/recorded_session.hpp"

#include <string>
#include <vector>

namespace arhost::cli {

// Error messages name this in place of a line for values that a replay has taken from the session.
constexpr const char *replayed = "arhost replay";

// Checks what the configuration of a session asks for: permissions, files outside the session's folder, and scripts.
// The user grants it with `allowed` (--allow): elements of sandbox::allowances, and files and folders, relative to
// the working directory. Values that the command line has set are the user's and need no grant; the scenes that come
// with arhost need none either. `with_tracker`: the recorded tracker runs. Throws yaml::Error with all that is
// missing and the options that grant it, or if an element of `allowed` is neither a permission nor an existing path.
void expect_granted(const yaml::Node &root, const Session &session, const std::vector<std::string> &allowed,
                    bool with_tracker);

} // namespace arhost::cli
