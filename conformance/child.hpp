// SPDX-License-Identifier: Apache-2.0
// The process of one test: runner.cpp executes this program again.
#pragma once

#include "base/unique_fd.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/test.hpp"
#include "ipc/messages.hpp"
#include "sandbox/sandbox.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <sys/types.h>
#include <vector>

namespace arhost::conformance {

// The plugin under test and its settings, passed to every test.
struct Subject {
    std::filesystem::path plugin, reference;
    Settings settings;
    std::uint64_t seed = 1;
    double timeout_factor = 1;       // multiplies each deadline
    std::filesystem::path scratch{}; // of one test; deleted after it
    PrintFiles prints{};
    std::string family{};     // of the markers; empty: the first of drawn_families that the tracker knows
    std::string body{};       // of a tracker that reports poses
    sandbox::Policy policy{}; // without the scratch folder
    std::vector<std::string> policy_options{}; // the policy's command line options
    Settings addresses{};                      // of the options of type ARHOST_OPTION_LISTEN
    Sockets sockets{};                         // of one test
};

// The ray tracer that images are compared with by default.
std::filesystem::path default_reference();

// Descriptors of a test's process.
inline constexpr int result_fd = 3, call_page_fd = 4, first_socket_fd = 5;
inline constexpr std::size_t max_sockets = 3; // limited by base::exec_child

// Adds the sockets to the arguments and descriptors of a test's process.
void pass_sockets(const Sockets &sockets, std::vector<std::string> &arguments, std::vector<int> &descriptors);

// Returns the sockets for the texts KEY=ADDRESS of the argument --socket.
Sockets passed_sockets(const std::vector<std::string> &texts);

struct Pipe {
    Pipe();
    base::UniqueFd read_end, write_end; // close-on-exec
};

// Executes this program in a child process, with `descriptors` as 0, 1, 2, … The kernel kills the child when this
// process ends. `new_group`: the child leads a new process group.
pid_t start_process(std::vector<std::string> arguments, const std::vector<int> &descriptors, bool new_group = false);

// Runs a test in this process, which permanently enters the sandbox of subject.policy.
Result run_here(const Test &test, const Subject &subject, const CallPage &calls);

// Runs one test and writes its result to `result_fd` as a line of JSON. Returns the exit status.
int run_child(const std::string &test, const Subject &subject);

ipc::Json to_json(const std::optional<Facts> &facts); // the descriptor and "sandbox"; an empty object without facts
ipc::Json to_json(const Result &result);
Result result_from_json(const ipc::Json &json);

} // namespace arhost::conformance
