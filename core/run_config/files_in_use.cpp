// SPDX-License-Identifier: Apache-2.0
#include "run_config/files_in_use.hpp"

#include <arhost-cpp/numbered_name.hpp>

#include <algorithm>
#include <string_view>

namespace arhost::run_config {
namespace {

namespace fs = std::filesystem;
using base::FileIdentity;

bool are_digits(std::string_view text) {
    return text.find_first_not_of("0123456789") == std::string_view::npos;
}

// Parses a numbered file name; returns nullopt if sinks would not accept `name` as one.
std::optional<NumberedName> numbered_name(const std::string &name) try {
    return NumberedName(name);
} catch (const std::invalid_argument &) {
    return std::nullopt;
}

// Returns whether two file names or patterns can produce the same name. Two patterns can if they differ only in
// digits, as f0%d and f%d do.
bool can_collide(const std::string &a, const std::string &b) {
    const auto p = numbered_name(a), q = numbered_name(b);
    if (!p || !q)
        return p ? p->number(b).has_value() : q ? q->number(a).has_value() : a == b;
    const auto by_size = [](auto &x, auto &y) { return x.size() < y.size(); };
    const auto [prefix, longer_prefix] = std::minmax(p->prefix(), q->prefix(), by_size);
    const auto [suffix, longer_suffix] = std::minmax(p->suffix(), q->suffix(), by_size);
    return longer_prefix.starts_with(prefix) && are_digits(std::string_view(longer_prefix).substr(prefix.size())) &&
           longer_suffix.ends_with(suffix) &&
           are_digits(std::string_view(longer_suffix).substr(0, longer_suffix.size() - suffix.size()));
}

std::vector<FileIdentity> files_of(const fs::path &file_or_pattern) {
    std::vector<FileIdentity> files{base::identity_of(file_or_pattern)};
    if (const auto pattern = numbered_name(file_or_pattern.filename())) {
        std::error_code ignored; // the component that uses an unreadable folder reports it
        for (fs::directory_iterator entry(file_or_pattern.parent_path(), ignored), end; entry != end;
             entry.increment(ignored))
            if (pattern->number(entry->path().filename().string()))
                files.push_back(base::identity_of(entry->path()));
    }
    return files;
}

// Returns the file name or pattern that the output writes, with symbolic links resolved.
fs::path written_by(const yaml::Node &output) {
    const fs::path path = output.output_path();
    return numbered_name(path.filename()) ? base::real_path(path.parent_path()) / path.filename()
                                          : base::real_path(path);
}

[[noreturn]] void refuse(const yaml::Node &output, const std::string &file_read) {
    const bool same_name = base::real_path(output.output_path()) == file_read;
    output.fail("'" + output.text() + "' is a file that this run reads" + (same_name ? "" : " (" + file_read + ")") +
                "; choose another path");
}

} // namespace

void FilesInUse::read(const fs::path &file) {
    const FileIdentity identity = base::identity_of(file);
    check_read(identity);
    add(identity, {});
}

void FilesInUse::read_numbered(const fs::path &file_or_pattern) {
    for (const FileIdentity &file : files_of(file_or_pattern)) {
        check_read(file);
        add(file, {});
    }
}

void FilesInUse::write(const yaml::Node &output) {
    const std::vector<FileIdentity> files = files_of(output.output_path());
    for (const FileIdentity &file : files)
        if (const Use *use = find(file); use && use->output)
            output.fail("another output already writes '" + output.text() + "'; choose another path");
        else if (use)
            refuse(output, use->path);
    const fs::path path = written_by(output);
    for (const yaml::Node &other : outputs_)
        if (const fs::path theirs = written_by(other);
            path.parent_path() == theirs.parent_path() && can_collide(path.filename(), theirs.filename()))
            output.fail("another output, '" + other.text() + "', can write a file of the same name as '" +
                        output.text() + "'; choose another path");
    for (const FileIdentity &file : files)
        add(file, output);
    outputs_.push_back(output);
}

void FilesInUse::check_read(const FileIdentity &file) const {
    if (const Use *use = find(file); use && use->output)
        refuse(*use->output, file.path);
}

const FilesInUse::Use *FilesInUse::find(const FileIdentity &file) const {
    for (const std::string &key : {file.path, file.node})
        if (const auto use = uses_.find(key); use != uses_.end())
            return &use->second;
    return nullptr;
}

void FilesInUse::add(const FileIdentity &file, const std::optional<yaml::Node> &output) {
    for (const std::string &key : {file.path, file.node})
        uses_.try_emplace(key, Use{file.path, output});
}

} // namespace arhost::run_config
