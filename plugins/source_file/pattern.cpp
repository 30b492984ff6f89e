// SPDX-License-Identifier: Apache-2.0
#include "pattern.hpp"

#include <arhost-cpp/plugin.hpp>

#include <charconv>
#include <set>

namespace arhost {

namespace fs = std::filesystem;

std::optional<Pattern> Pattern::parse(const fs::path &path) {
    const std::string text = path.string();
    if (text.find('%') == std::string::npos)
        return std::nullopt;
    const auto refuse = [&](const std::string &why) {
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                       "path: '" + text + "': " + why +
                           "; a pattern has one %d (or %04d for four digits, and so on) in its file's name, and %% "
                           "for a percent sign");
    };

    Pattern pattern;
    pattern.folder_ = path.parent_path();
    const std::string name = path.filename().string();
    bool found = false;
    for (std::size_t i = 0; i < name.size();) {
        std::string &part = found ? pattern.suffix_ : pattern.prefix_;
        if (name[i] != '%') {
            part += name[i++];
            continue;
        }
        if (name.compare(i, 2, "%%") == 0) {
            part += '%';
            i += 2;
            continue;
        }
        const std::size_t end = name.find_first_not_of("0123456789", i + 1);
        const std::string width = name.substr(i + 1, end == std::string::npos ? end : end - i - 1);
        const std::string conversion = name.substr(i, end == std::string::npos ? end : end - i + 1);
        const bool padded = width.size() == 2 && width[0] == '0' && width[1] != '0';
        if (!conversion.ends_with('d') || !(width.empty() || padded))
            throw refuse("'" + conversion + "' is not allowed");
        if (found)
            throw refuse("it has a second '" + conversion + "'");
        found = true;
        pattern.digits_ = padded ? static_cast<std::size_t>(width[1] - '0') : 1;
        i = end + 1;
    }
    if (!found)
        throw refuse("there is no such file, and no %d in its name");
    return pattern;
}

fs::path Pattern::file(std::int64_t number) const {
    std::string digits = std::to_string(number);
    if (digits.size() < digits_)
        digits.insert(0, digits_ - digits.size(), '0');
    return folder_ / (prefix_ + digits + suffix_);
}

std::optional<std::int64_t> Pattern::number(const std::string &file_name) const {
    if (file_name.size() <= prefix_.size() + suffix_.size() || !file_name.starts_with(prefix_) ||
        !file_name.ends_with(suffix_))
        return std::nullopt;
    const char *begin = file_name.data() + prefix_.size();
    const char *end = file_name.data() + file_name.size() - suffix_.size();
    std::int64_t number = 0;
    const auto [stop, error] = std::from_chars(begin, end, number);
    // The comparison sorts out signs and other counts of zeros.
    if (error != std::errc() || stop != end || number < 0 || file(number).filename() != file_name)
        return std::nullopt;
    return number;
}

std::map<std::int64_t, fs::path> Pattern::scan() const {
    std::map<std::int64_t, fs::path> files;
    std::error_code ignored; // a folder that can't be listed has no files; describe_folder says why
    for (const auto &entry : fs::directory_iterator(folder_, ignored))
        if (const auto n = number(entry.path().filename().string()))
            files.emplace(*n, entry.path());
    return files;
}

std::string quoted(const fs::path &path) {
    std::string text(1, '\'');
    return text.append(path.string()).append(1, '\'');
}

std::string describe_folder(const fs::path &folder) {
    std::error_code error;
    std::set<std::string> names;
    for (const auto &entry : fs::directory_iterator(folder, error))
        names.insert(entry.path().filename().string());
    if (error)
        return "the folder " + quoted(folder) + " can't be listed: " + error.message();
    if (names.empty())
        return "the folder " + quoted(folder) + " is empty";
    std::string text = "the folder " + quoted(folder) + " has " + std::to_string(names.size()) +
                       (names.size() == 1 ? " entry:" : " entries:");
    constexpr std::size_t shown = 4;
    std::size_t i = 0;
    for (const std::string &name : names) {
        if (i == shown)
            return text + " …";
        text += (i++ ? ", " : " ") + name;
    }
    return text;
}

} // namespace arhost
