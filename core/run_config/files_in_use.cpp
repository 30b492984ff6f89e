// SPDX-License-Identifier: Apache-2.0
#include "run_config/files_in_use.hpp"

#include "run_config/access.hpp"
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

std::optional<NumberedName> pattern_of(const OutputFile &output) {
    return output.is_numbered ? numbered_name(output.path.output_path().filename()) : std::nullopt;
}

// Returns whether two file names, or their patterns `p` and `q`, can produce the same name. Two patterns can do so if
// they differ only in digits, as f0%d and f%d do.
bool can_collide(const std::string &a, const std::optional<NumberedName> &p, const std::string &b,
                 const std::optional<NumberedName> &q) {
    if (!p || !q)
        return p ? p->number(b).has_value() : q ? q->number(a).has_value() : a == b;
    const auto by_size = [](auto &x, auto &y) { return x.size() < y.size(); };
    const auto [prefix, longer_prefix] = std::minmax(p->prefix(), q->prefix(), by_size);
    const auto [suffix, longer_suffix] = std::minmax(p->suffix(), q->suffix(), by_size);
    return longer_prefix.starts_with(prefix) && are_digits(std::string_view(longer_prefix).substr(prefix.size())) &&
           longer_suffix.ends_with(suffix) &&
           are_digits(std::string_view(longer_suffix).substr(0, longer_suffix.size() - suffix.size()));
}

// Returns the existing files that match the pattern; empty if there is no pattern.
std::vector<FileIdentity> files_of(const std::optional<NumberedName> &pattern, const fs::path &folder) {
    std::vector<FileIdentity> files;
    std::error_code ignored; // the component that uses an unreadable folder reports it
    if (pattern)
        for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored))
            if (pattern->number(entry->path().filename().string()))
                files.push_back(base::identity_of(entry->path()));
    return files;
}
std::vector<FileIdentity> files_of(const fs::path &pattern) {
    return files_of(numbered_name(pattern.filename()), pattern.parent_path());
}

// Returns the existing files that the output may overwrite.
std::vector<FileIdentity> files_of(const OutputFile &output) {
    const fs::path path = output.path.output_path();
    const auto pattern = pattern_of(output);
    return pattern ? files_of(pattern, path.parent_path()) : std::vector{base::identity_of(path)};
}

// Returns the file name or pattern that the output writes, with symbolic links resolved.
fs::path written_by(const OutputFile &output) {
    const fs::path path = output.path.output_path();
    return pattern_of(output) ? base::real_path(path.parent_path()) / path.filename() : base::real_path(path);
}

bool can_collide(const OutputFile &a, const OutputFile &b) {
    const fs::path one = written_by(a), other = written_by(b);
    if (one.parent_path() == other.parent_path() &&
        can_collide(one.filename(), pattern_of(a), other.filename(), pattern_of(b)))
        return true;
    const std::vector<FileIdentity> files = files_of(b);
    return std::ranges::any_of(files_of(a), [&](const FileIdentity &file) {
        return std::ranges::any_of(
            files, [&](const FileIdentity &same) { return file.path == same.path || file.node == same.node; });
    });
}

[[noreturn]] void refuse(const yaml::Node &output, const std::string &file,
                         const std::string &reason = "is a file that this run reads") {
    const bool same_name = base::real_path(output.output_path()) == file;
    output.fail("'" + output.text() + "' " + reason + (same_name ? "" : " (" + file + ")") + "; choose another path");
}

} // namespace

void FilesInUse::read(const fs::path &file) {
    const FileIdentity identity = base::identity_of(file);
    check_read(identity);
    add(identity, {});
}

void FilesInUse::read_numbered(const fs::path &file_or_pattern) {
    read(file_or_pattern);
    for (const FileIdentity &file : files_of(file_or_pattern)) {
        check_read(file);
        add(file, {});
    }
}

void FilesInUse::write(const yaml::Node &output) {
    const bool is_stdout = is_standard_output(output);
    const FileIdentity named = is_stdout ? FileIdentity{"-", "-"} : base::identity_of(output.output_path());
    const std::vector<FileIdentity> matching =
        is_stdout ? std::vector<FileIdentity>() : files_of(output.output_path());
    if (const Use *use = find(named); use && use->output && !use->by_pattern)
        output.fail("another output already writes '" + output.text() + "'; choose another path");
    else if (use && !use->output)
        refuse(output, use->path);
    for (const FileIdentity &file : matching)
        if (const Use *use = find(file); use && !use->output)
            refuse(output, use->path);
    add(named, output);
    for (const FileIdentity &file : matching)
        add(file, output, true);
}

void FilesInUse::check_read(const FileIdentity &file) const {
    if (const Use *use = find(file); use && use->output)
        refuse(*use->output, file.path);
}

void FilesInUse::protect(const FileIdentity &file) const {
    if (const Use *use = find(file); use && use->output)
        refuse(*use->output, file.path, "belongs to arhost");
}

const FilesInUse::Use *FilesInUse::find(const FileIdentity &file) const {
    for (const std::string &key : {file.path, file.node})
        if (const auto use = uses_.find(key); use != uses_.end())
            return &use->second;
    return nullptr;
}

void FilesInUse::add(const FileIdentity &file, const std::optional<yaml::Node> &output, bool by_pattern) {
    for (const std::string &key : {file.path, file.node})
        if (const auto [use, is_new] = uses_.try_emplace(key, Use{file.path, output, by_pattern});
            !is_new && use->second.by_pattern && !by_pattern)
            use->second = {file.path, output, false};
}

void expect_distinct(const std::vector<OutputFile> &outputs) {
    for (std::size_t i = 0; i < outputs.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            if ((outputs[i].is_numbered || outputs[j].is_numbered) && can_collide(outputs[i], outputs[j]))
                outputs[i].path.fail("another output, '" + outputs[j].path.text() +
                                     "', can write a file of the same name as '" + outputs[i].path.text() +
                                     "'; choose another path");
}

} // namespace arhost::run_config
