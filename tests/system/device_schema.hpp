// SPDX-License-Identifier: Apache-2.0
//
// Validates the output of `arhost devices --json`.
#pragma once

#include "arhost_run.hpp"

#include <cstdlib>
#include <directories.hpp>
#include <fstream>
#include <string>

namespace arhost::test {

inline bool can_validate() {
    return std::system("python3 -c 'import jsonschema' >/dev/null 2>&1") == 0;
}

// Returns how `json` violates docs/devices.schema.json; "" if it does not.
inline std::string schema_violation(const nlohmann::json &json) {
    const ScratchFolder folder;
    std::ofstream(folder.path() / "devices.json") << json;
    const std::string violations = folder.path() / "violations.txt";
    const std::string program =
        "import json, sys, jsonschema\n"
        "schema = json.load(open(sys.argv[1]))\n"
        "jsonschema.Draft202012Validator.check_schema(schema)\n"
        "for error in jsonschema.Draft202012Validator(schema).iter_errors(json.load(open(sys.argv[2]))):\n"
        "    print(error.message)\n";
    std::ofstream(folder.path() / "validate.py") << program;
    const std::string command = "python3 '" + (folder.path() / "validate.py").string() + "' '" +
                                arhost::test::source_directory() + "/docs/devices.schema.json' '" +
                                (folder.path() / "devices.json").string() + "' >'" + violations + "' 2>&1";
    const int status = std::system(command.c_str());
    return read_file(violations) + (status == 0 ? "" : "the validation failed");
}

} // namespace arhost::test
