// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <algorithm>
#include <sys/prctl.h>

namespace arhost::sandbox {
namespace {

Layer give_up_new_privileges() {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
        return {"no_new_privs", "", error_text("prctl")};
    return {"no_new_privs", "yes", ""};
}

} // namespace

bool whole(const Level &level) {
    return std::all_of(level.begin(), level.end(), [](const Layer &layer) { return layer.lacks.empty(); });
}

std::string to_text(const Level &level) {
    std::string has, lacks;
    for (const Layer &layer : level) {
        if (!layer.reached.empty())
            has += (has.empty() ? "" : "; ") + layer.name + ": " + layer.reached;
        if (!layer.lacks.empty())
            lacks += (lacks.empty() ? "" : "; ") + layer.name + ": " + layer.lacks;
    }
    if (level.empty())
        return "none";
    return has + (lacks.empty() ? "" : "; LACKING " + lacks);
}

Level enter(const Policy &policy) {
    Level level;
    if (policy.mode == Mode::none)
        return level;
    for (const std::filesystem::path &folder : policy.writable) {
        std::error_code ignored; // who wants to write there says what is wrong with it
        std::filesystem::create_directories(folder, ignored);
    }
    level.push_back(go_first_out_of_memory());
    level.push_back(enter_namespaces(policy));
    level.push_back(set_limits(policy));
    level.push_back(drop_capabilities());
    level.push_back(give_up_new_privileges());
    level.push_back(enter_landlock(policy));
    level.push_back(filter_system_calls(policy));
    return level;
}

} // namespace arhost::sandbox
