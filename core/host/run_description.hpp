// SPDX-License-Identifier: Apache-2.0
//
// The description of a run for the sinks that record it (docs/sessions.md).
#pragma once

#include "host/assembly.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace arhost::host {

// The member `version` of session.json. Logs of version 1 have markers instead of targets.
constexpr int session_version = 2;

// Returns session.json. `id`: of the sink. Throws std::runtime_error if the description is too long.
std::string run_description(const RunParts &parts, const Assembly &assembly, const std::string &id);

// Size and hash (64-bit FNV-1a, hexadecimal) of a regular file. The hash of larger files is "". Returns
// nullopt if the file cannot be read.
struct Fingerprint {
    std::uint64_t bytes;
    std::string hash;
    bool operator==(const Fingerprint &) const = default;
};
std::optional<Fingerprint> fingerprint_of(const std::filesystem::path &file, std::uint64_t max_hashed_bytes);

} // namespace arhost::host
