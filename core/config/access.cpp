// SPDX-License-Identifier: Apache-2.0
#include "config/access.hpp"

#include <cstdlib>

namespace arhost::config {
namespace {

namespace fs = std::filesystem;

// Devices are for `allow` to give, everything or a whole home for `reads`.
bool may_be_given(const fs::path &path) {
    std::error_code ignored;
    const auto type = fs::status(path, ignored).type();
    const char *home = std::getenv("HOME");
    const fs::path real = real_path(path);
    return (type == fs::file_type::regular || type == fs::file_type::directory || type == fs::file_type::fifo) &&
           real != "/" && !(home && real == real_path(home));
}

// Outputs are written beside their place and then renamed, so their folder it is; a link's target's too.
void let_write(sandbox::Policy &policy, const fs::path &file) {
    policy.writable.push_back(fs::absolute(file).lexically_normal().parent_path());
    if (const fs::path folder = real_path(file).parent_path(); folder != policy.writable.back())
        policy.writable.push_back(folder);
}

} // namespace

fs::path real_path(const fs::path &file) {
    std::error_code error;
    const fs::path canonical = fs::weakly_canonical(fs::absolute(file), error);
    return error ? fs::absolute(file).lexically_normal() : canonical;
}

sandbox::Policy access_of(const yaml::Node &node, bool is_output) {
    sandbox::Policy policy;
    if (const auto allow = node.find("allow"))
        for (const yaml::Node &what : allow->items())
            policy.allow.insert(what.choice(sandbox::allowances));
    if (const auto reads = node.find("reads"))
        for (const yaml::Node &path : reads->items())
            policy.readable.push_back(fs::absolute(path.input_path()));
    if (const auto writes = node.find("writes"))
        for (const yaml::Node &folder : writes->items())
            policy.writable.push_back(fs::absolute(folder.text()).lexically_normal());
    const auto options = node.find("options");
    auto path = node.find("path");
    if (!path && options && options->is_map())
        path = options->find("path");
    if (path && is_output)
        let_write(policy, path->text());
    else if (path) {
        const fs::path file = fs::absolute(path->input_path()), folder = file.parent_path();
        if (may_be_given(file))
            policy.readable.push_back(file);
        else if (file.filename().string().find('%') != std::string::npos && may_be_given(folder)) // frame-%04d.png
            policy.readable.push_back(folder);
    }
    if (options && options->is_map())
        for (const auto &[key, value] : options->entries())
            if (value.is_scalar() && key != "path" && may_be_given(value.input_path()))
                policy.readable.push_back(fs::absolute(value.input_path()));
    return policy;
}

} // namespace arhost::config
