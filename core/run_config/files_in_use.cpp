// SPDX-License-Identifier: Apache-2.0
#include "run_config/files_in_use.hpp"

#include <algorithm>
#include <charconv>
#include <string_view>

namespace arhost::run_config {
namespace {

namespace fs = std::filesystem;
using base::FileIdentity;

bool are_digits(std::string_view text) {
    return text.find_first_not_of("0123456789") == std::string_view::npos;
}

// A file name with one number: frame-%04d.png.
struct Pattern {
    std::string before, after;
    std::size_t digits = 0; // minimum; 0: no number yet

    bool matches(std::string_view file) const {
        if (file.size() < before.size() + digits + after.size() || !file.starts_with(before) ||
            !file.ends_with(after))
            return false;
        const std::string_view number = file.substr(before.size(), file.size() - before.size() - after.size());
        return are_digits(number) && (number.size() == digits || number[0] != '0');
    }
};

// Nothing unless there is exactly one number and every other '%' is a '%%', as plugins require.
std::optional<Pattern> pattern_of(const std::string &name) {
    constexpr std::size_t max_width_digits = 4;
    Pattern pattern;
    for (std::size_t i = 0; i < name.size(); ++i) {
        std::string &part = pattern.digits ? pattern.after : pattern.before;
        if (name[i] != '%') {
            part += name[i];
            continue;
        }
        const std::size_t width = i + 1;
        i = name.find_first_not_of("0123456789", width);
        if (i == width && name[i] == '%') {
            part += '%';
            continue;
        }
        if (i == std::string::npos || name[i] != 'd' || pattern.digits || i - width > max_width_digits ||
            (i > width && name[width] != '0'))
            return std::nullopt;
        std::from_chars(name.data() + width, name.data() + i, pattern.digits);
        pattern.digits = std::max<std::size_t>(pattern.digits, 1);
    }
    return pattern.digits ? std::optional(pattern) : std::nullopt;
}

// Whether two names or patterns can produce the same file name. Conservative: true for f0%d and f%d.
bool can_collide(const std::string &a, const std::string &b) {
    const auto p = pattern_of(a), q = pattern_of(b);
    if (!p || !q)
        return p ? p->matches(b) : q ? q->matches(a) : a == b;
    const auto [begin, longer_begin] =
        std::minmax(p->before, q->before, [](auto &x, auto &y) { return x.size() < y.size(); });
    const auto [end, longer_end] =
        std::minmax(p->after, q->after, [](auto &x, auto &y) { return x.size() < y.size(); });
    return longer_begin.starts_with(begin) && are_digits(std::string_view(longer_begin).substr(begin.size())) &&
           longer_end.ends_with(end) &&
           are_digits(std::string_view(longer_end).substr(0, longer_end.size() - end.size()));
}

std::vector<FileIdentity> files_of(const fs::path &file_or_pattern) {
    std::vector<FileIdentity> files{base::identity_of(file_or_pattern)};
    if (const auto pattern = pattern_of(file_or_pattern.filename())) {
        std::error_code ignored; // an unreadable folder is reported by its user
        for (fs::directory_iterator entry(file_or_pattern.parent_path(), ignored), end; entry != end;
             entry.increment(ignored))
            if (pattern->matches(entry->path().filename().string()))
                files.push_back(base::identity_of(entry->path()));
    }
    return files;
}

// Name or pattern, with links resolved.
fs::path written_by(const yaml::Node &output) {
    const fs::path path = output.output_path();
    return pattern_of(path.filename()) ? base::real_path(path.parent_path()) / path.filename()
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
            output.fail("another output writes '" + output.text() + "' already; choose another path");
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
