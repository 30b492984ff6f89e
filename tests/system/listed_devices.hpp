// SPDX-License-Identifier: Apache-2.0
//
// Runs `arhost devices --json`.
#pragma once

#include "arhost_run.hpp"

#include <grp.h>

namespace arhost::test {

// Returns the output of `arhost devices --json PLUGIN`, run by the user with this id.
inline nlohmann::json listed_devices(const std::string &plugin, uid_t user = 0) {
    ArhostRun run;
    run.start({"devices", "--json", plugin}, [user] {
        if (user != 0 && (setgroups(0, nullptr) != 0 || setgid(user) != 0 || setuid(user) != 0))
            _exit(126);
    });
    EXPECT_EQ(run.wait(), 0) << run.output();
    const nlohmann::json json = nlohmann::json::parse(run.messages(), nullptr, false);
    EXPECT_TRUE(json.is_object()) << run.messages();
    return json.is_object() ? json : nlohmann::json::object();
}

// Returns the element of a list whose `key` has this value; null if there is none.
inline nlohmann::json element_with(const nlohmann::json &list, const char *key, const std::string &value) {
    for (const nlohmann::json &element : list)
        if (element[key] == value)
            return element;
    return {};
}

} // namespace arhost::test
