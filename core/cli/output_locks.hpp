// SPDX-License-Identifier: Apache-2.0
//
// Two runs must not write the same file: the second one would delete the parts that the first has written.
#pragma once

#include "base/unique_fd.hpp"
#include "run_config/configuration.hpp"

#include <filesystem>
#include <vector>

namespace arhost::cli {

// Locks the files of the outputs, of the statistics and of the timeline while it exists, for this user's runs on this
// machine. The locks are files in base::runtime_folder(); the kernel releases them when the process ends. Throws
// yaml::Error at the output whose file another run has locked; its message names that run. Outputs to standard
// output, FIFOs and devices are not locked, nor is anything if the folder cannot be used.
class OutputLocks {
public:
    explicit OutputLocks(const run_config::Configuration &configuration);
    ~OutputLocks();
    OutputLocks(const OutputLocks &) = delete;
    OutputLocks &operator=(const OutputLocks &) = delete;

private:
    struct Lock {
        std::filesystem::path name;
        base::UniqueFd fd;
    };
    std::vector<Lock> locks_;
};

} // namespace arhost::cli
