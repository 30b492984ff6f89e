// SPDX-License-Identifier: Apache-2.0
#include "config/access.hpp"

#include <cstdlib>

namespace arhost::config {
namespace {

namespace fs = std::filesystem;

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
    if (const auto environment = node.find("environment"))
        for (const yaml::Node &variable : environment->items()) {
            policy.environment.insert(variable.text());
            if (variable.text().find('=') != std::string::npos)
                variable.fail("must be a variable's name alone; its value is the one that arhost is started with");
        }
    const auto options = node.find("options");
    auto path = node.find("path");
    if (!path && options && options->is_map())
        path = options->find("path");
    if (path && is_output)
        let_write(policy, path->text());
    else if (path)
        sandbox::let_read_files(policy, fs::absolute(path->input_path()));
    if (options && options->is_map())
        for (const auto &[key, value] : options->entries())
            if (value.is_scalar() && key != "path")
                sandbox::let_read(policy, fs::absolute(value.input_path()));
    return policy;
}

std::string warning_of_output(const yaml::Node &path, const std::string &plugin) {
    const fs::path file = path.text(), folder = real_path(file).parent_path();
    const char *home = std::getenv("HOME");
    for (const fs::path &precious : {real_path(home ? home : "/"), real_path(".")})
        if (sandbox::holds(folder, precious))
            return path.where() + ": " + path.path() + ": '" + plugin + "' can write all of '" + folder.string() +
                   "' and what is below; give it a folder of its own, as in 'path: output/" +
                   file.filename().string() + "'";
    return "";
}

} // namespace arhost::config
