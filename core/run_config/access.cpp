// SPDX-License-Identifier: Apache-2.0
#include "run_config/access.hpp"

#include "base/file_identity.hpp"
#include "run_config/schema.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace arhost::run_config {
namespace {

namespace fs = std::filesystem;
using base::real_path;

void expect_grantable(const sandbox::Policy &policy, const yaml::Node &node, const fs::path &path) {
    if (policy.mode == sandbox::Mode::none)
        return;
    if (const std::string obstacle = sandbox::obstacle_to_grant(path); !obstacle.empty())
        node.fail(obstacle);
}

// Grants write access to the folder of the output file, because an output is written to a temporary file in that
// folder and then renamed. If the output file is a symbolic link, also grants access to the folder of the link's
// target.
void allow_write(sandbox::Policy &policy, const yaml::Node &path) {
    if (is_standard_output(path)) {
        policy.standard_output = true;
        return;
    }
    const fs::path file = path.output_path();
    if (policy.mode != sandbox::Mode::none && !sandbox::obstacle_to_grant(file.parent_path()).empty())
        path.fail("the sandbox cannot let an output write to the folder '" + file.parent_path().string() +
                  "'; choose another folder");
    policy.writable.push_back(file.parent_path());
    if (const fs::path folder = real_path(file).parent_path(); folder != policy.writable.back())
        policy.writable.push_back(folder);
}

void add_reads(sandbox::Policy &policy, const yaml::Node &paths) {
    std::error_code ignored;
    for (const yaml::Node &path : paths.items()) {
        policy.readable.push_back(path.input_path());
        if (!fs::exists(policy.readable.back(), ignored))
            path.fail("there is no file or folder '" + policy.readable.back().string() +
                      "', or it cannot be accessed; correct the path or remove it");
        expect_grantable(policy, path, policy.readable.back());
    }
}

void add_writes(sandbox::Policy &policy, const yaml::Node &folders) {
    std::error_code ignored;
    for (const yaml::Node &folder : folders.items()) {
        policy.writable.push_back(folder.output_path());
        if (!fs::is_directory(policy.writable.back(), ignored))
            folder.fail("there is no folder '" + policy.writable.back().string() +
                        "', or it cannot be accessed; name an existing folder (mkdir -p creates one)");
        expect_grantable(policy, folder, policy.writable.back());
    }
}

void add_environment(sandbox::Policy &policy, const yaml::Node &variables) {
    for (const yaml::Node &variable : variables.items()) {
        const std::string name = variable.text();
        if (!sandbox::is_variable_name(name))
            variable.fail("must be the name of a variable, without '=' and value; the value is taken from arhost's "
                          "environment");
        policy.environment.insert(name);
    }
}

std::string usb_id(const yaml::Node &node) {
    std::string id = node.text();
    std::ranges::transform(id, id.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (id.size() != 4 || id.find_first_not_of("0123456789abcdef") != std::string::npos)
        node.fail("must have four hexadecimal digits, such as 046d; 'lsusb' lists VENDOR:PRODUCT of each device");
    return id;
}

base::UsbIdentity usb_identity(const yaml::Node &usb) {
    usb.allow_keys(keys_of("source.usb"));
    base::UsbIdentity identity = usb_id(usb.require("vendor")) + ":" + usb_id(usb.require("product"));
    if (const auto serial = usb.find("serial"))
        identity += ":" + serial->text();
    if (identity.size() > base::max_usb_identity)
        usb.fail("the serial number is too long");
    return identity;
}

} // namespace

std::optional<yaml::Node> path_of(const yaml::Node &component) {
    const auto path = component.find("path"), options = component.find("options");
    return path || !options || !options->is_map() ? path : options->find("path");
}

bool is_standard_output(const yaml::Node &path) {
    return path.text() == "-" || path.text() == "/dev/stdout";
}

sandbox::Policy access_of(const yaml::Node &node, bool is_output, sandbox::Mode mode) {
    sandbox::Policy policy;
    policy.mode = mode;
    if (const auto allow = node.find("allow"))
        for (const yaml::Node &what : allow->items())
            policy.allow.insert(what.choice(sandbox::allowances));
    if (const auto usb = node.find("usb"))
        policy.usb_device = usb_identity(*usb);
    if (const auto reads = node.find("reads"))
        add_reads(policy, *reads);
    if (const auto writes = node.find("writes"))
        add_writes(policy, *writes);
    if (const auto environment = node.find("environment"))
        add_environment(policy, *environment);
    if (const auto path = path_of(node); path && is_output)
        allow_write(policy, *path);
    else if (path)
        sandbox::allow_read_files(policy, path->input_path());
    if (const auto options = node.find("options"); options && options->is_map())
        for (const auto &[key, value] : options->entries())
            if (value.is_scalar() && key != "path")
                sandbox::allow_read(policy, value.input_path());
    return policy;
}

std::string warning_of_output(const yaml::Node &path, const std::string &plugin) {
    if (is_standard_output(path))
        return "";
    const fs::path file = path.output_path(), folder = real_path(file).parent_path();
    const char *home = std::getenv("HOME");
    for (const fs::path &wide : {real_path(home ? home : "/"), real_path(".")})
        if (sandbox::contains(folder, wide))
            return warning_at(path, "'" + plugin + "' may write to everything in and below '" + folder.string() +
                                        "'; give this output its own folder, as in 'path: output/" +
                                        file.filename().string() + "'");
    return "";
}

std::string warning_at(const yaml::Node &node, const std::string &message) {
    return node.where() + ": " + node.path() + ": " + message;
}

} // namespace arhost::run_config
