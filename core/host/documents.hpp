// SPDX-License-Identifier: Apache-2.0
//
// The JSON documents that describe a run.
#pragma once

#include "host/assembly.hpp"

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace arhost::host {

class Outputs;

// Returns the status document (docs/control.md).
nlohmann::ordered_json status_json(const RunParts &parts, const Assembly &assembly, const Outputs &outputs);

// The member `version` of session.json. Logs of version 1 have markers instead of targets.
constexpr int session_version = 2;

// Returns session.json, for the sinks that record the run (docs/sessions.md). `id`: identifies the sink. Throws
// std::runtime_error if the description is too long.
std::string run_description(const RunParts &parts, const Assembly &assembly, const std::string &id);

// Size and hash (64-bit FNV-1a, hexadecimal) of a regular file. For large files, the hash is "". The function returns
// nullopt if the file cannot be read.
struct Fingerprint {
    std::uint64_t bytes;
    std::string hash;
    bool operator==(const Fingerprint &) const = default;
};
std::optional<Fingerprint> fingerprint_of(const std::filesystem::path &file, std::uint64_t max_hashed_bytes);

} // namespace arhost::host
