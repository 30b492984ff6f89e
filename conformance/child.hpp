// SPDX-License-Identifier: Apache-2.0
//
// The process of one test: this program, executed anew by runner.cpp.
#pragma once

#include "base/unique_fd.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/prints.hpp"
#include "conformance/verdict.hpp"
#include "sandbox/sandbox.hpp"

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <sys/types.h>
#include <vector>

namespace arhost::conformance {

// What every test of a run is told.
struct Subject {
    std::filesystem::path plugin, reference;
    Settings settings;
    std::uint64_t seed = 1;
    double timeout_factor = 1;       // times each deadline
    std::filesystem::path scratch{}; // of one test; gone after it
    PrintFiles prints{};
    sandbox::Policy policy{};                  // but for the scratch folder
    std::vector<std::string> policy_options{}; // which it came of, as on the command line
};

// The ray tracer that is compared with unless another is named.
std::filesystem::path default_reference();

// The descriptors that a child finds.
inline constexpr int result_fd = 3, call_page_fd = 4;

struct Pipe {
    Pipe();
    base::UniqueFd read_end, write_end; // close-on-exec
};

// Forks and executes this program with `arguments` and with `descriptors` as 0, 1, 2, … The process dies with this
// one. `own_group`: it leads its own process group.
pid_t start_process(std::vector<std::string> arguments, std::initializer_list<int> descriptors,
                    bool own_group = false);

// Runs one test and writes its result to `result_fd` as a line of JSON. Returns the exit status.
int run_child(const std::string &test, const Subject &subject);

ipc::Json to_json(const Result &result);
Result result_from_json(const ipc::Json &json);

} // namespace arhost::conformance
