// SPDX-License-Identifier: Apache-2.0
#include "run_config/user_view.hpp"

#include "base/file_identity.hpp"
#include "base/text.hpp"
#include "run_config/access.hpp"

#include <arhost-cpp/numbered_name.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <set>
#include <unistd.h>

namespace arhost::run_config {
namespace {

namespace fs = std::filesystem;

std::set<std::string> names_in(const fs::path &folder, std::error_code &error) {
    std::set<std::string> names;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        names.insert(entry->path().filename().string());
    return names;
}

std::string hint(const fs::path &file, const std::set<std::string> &names, std::string_view extension = "") {
    if (file.filename().string().find('*') != std::string::npos)
        return "; write the number in the names of numbered files as %d, or as %04d if it has leading zeros: "
               "'frame_%04d.png'";
    const std::vector<std::string_view> candidates(names.begin(), names.end());
    std::string near = base::nearest(file.filename().string(), candidates);
    if (near.ends_with(extension))
        near.resize(near.size() - extension.size());
    return near.empty() ? "" : "; did you mean '" + near + "'?";
}

void expect_match(const fs::path &pattern_path, const std::set<std::string> &names, const yaml::Node &node,
                  const sandbox::Policy &policy) {
    std::optional<NumberedName> pattern;
    try {
        pattern.emplace(pattern_path.filename().string());
    } catch (const std::invalid_argument &error) {
        node.fail("there is no file '" + pattern_path.string() + "', and it is not a valid pattern: " + error.what());
    }
    const bool is_hidden =
        policy.mode != sandbox::Mode::none && std::ranges::none_of(policy.readable, [&](const fs::path &readable) {
            return sandbox::contains(readable, pattern_path.parent_path());
        });
    for (const std::string &name : names)
        if (pattern->number(name) && is_hidden)
            node.fail("the sandbox hides the folder '" + pattern_path.parent_path().string() +
                      "' from the plugin, because it contains your whole home; move the files to a folder of their "
                      "own");
        else if (pattern->number(name))
            return;
    node.fail("no file matches '" + pattern_path.string() + "'; its folder has " + std::to_string(names.size()) +
              " entries" + (names.empty() ? "" : ", such as '" + *names.begin() + "'"));
}

} // namespace

void expect_readable(const yaml::Node &node, const sandbox::Policy &policy) {
    const fs::path file = node.input_path();
    std::error_code error;
    const fs::file_status status = fs::status(file, error);
    if (fs::exists(status)) {
        if (::access(file.c_str(), R_OK) != 0)
            node.fail("'" + file.string() + "' cannot be read: " + std::strerror(errno));
        return;
    }
    if (error && status.type() != fs::file_type::not_found)
        node.fail("'" + file.string() + "' cannot be accessed: " + error.message());
    const fs::path folder = file.parent_path();
    if (!fs::is_directory(folder, error))
        node.fail("there is no file '" + file.string() + "', as there is no folder '" + folder.string() + "'");
    const std::set<std::string> names = names_in(folder, error);
    if (error)
        node.fail("the folder '" + folder.string() + "' cannot be listed: " + error.message());
    if (file.filename().string().find('%') != std::string::npos)
        return expect_match(file, names, node, policy);
    node.fail("there is no file '" + file.string() + "'" + hint(file, names));
}

void expect_writable(const yaml::Node &node) {
    const fs::path path = node.output_path();
    if (is_standard_output(node) || sandbox::contains("/dev", path) || sandbox::contains("/proc", path))
        return;
    const fs::path file = base::real_path(path);
    std::error_code error;
    if (fs::exists(file, error) && ::access(file.c_str(), W_OK) != 0)
        node.fail("'" + file.string() + "' cannot be written: " + std::strerror(errno) + "; choose another path");
    fs::path folder = file.parent_path();
    while (folder.has_relative_path() && !fs::exists(folder, error))
        folder = folder.parent_path();
    if (!fs::is_directory(folder, error))
        node.fail("'" + folder.string() + "' is a file, not a folder; choose another path");
    if (::access(folder.c_str(), W_OK | X_OK) != 0)
        node.fail("no file can be created in the folder '" + folder.string() + "': " + std::strerror(errno) +
                  "; choose another path");
}

void expect_folder_near_another(const yaml::Node &node) {
    if (is_standard_output(node))
        return;
    const fs::path folder = base::real_path(node.output_path()).parent_path(), relative = folder.relative_path();
    if (relative.empty())
        return;
    const fs::path first = folder.root_path() / *relative.begin();
    if (std::error_code ignored; !fs::exists(first, ignored))
        node.fail("there is no folder '" + first.string() + "'; create it, or choose another path");
}

std::string hint_at_similar_name(const fs::path &file, std::string_view extension) {
    std::error_code ignored;
    return hint(file, names_in(file.parent_path(), ignored), extension);
}

} // namespace arhost::run_config
