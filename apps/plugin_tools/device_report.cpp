// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/device_report.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <fstream>
#include <functional>
#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::plugin_tools {
namespace {

namespace fs = std::filesystem;
using devices::DeviceControl;
using devices::DeviceDescription;
using devices::DeviceFormat;
using devices::DeviceSize;
using Json = nlohmann::ordered_json;

enum class Section { cameras, gpus, displays };

// Ray tracers may list CPUs and other devices, too.
Section section_of(const DeviceDescription &device) {
    if (device.kind == ARHOST_DEVICE_CAMERA)
        return Section::cameras;
    return device.kind == ARHOST_DEVICE_DISPLAY ? Section::displays : Section::gpus;
}

// Returns the status of the device node, or nullopt. Ignores paths outside of /dev, because plugins are not trusted
// and another path may be on a file system that blocks.
std::optional<struct stat> status_of(const fs::path &node) {
    struct stat status {};
    if (!node.native().starts_with("/dev/") || ::stat(node.c_str(), &status) != 0 || !S_ISCHR(status.st_mode))
        return std::nullopt;
    return status;
}

bool is_in_group(gid_t group) {
    std::vector<gid_t> groups(static_cast<std::size_t>(std::max(0, ::getgroups(0, nullptr))));
    groups.resize(static_cast<std::size_t>(std::max(0, ::getgroups(static_cast<int>(groups.size()), groups.data()))));
    return group == ::getegid() || std::ranges::find(groups, group) != groups.end();
}

std::string name_of_group(gid_t group) {
    const ::group *entry = ::getgrgid(group);
    return entry ? entry->gr_name : std::to_string(group);
}

std::string name_of_user(uid_t user) {
    const ::passwd *entry = ::getpwuid(user);
    return entry ? entry->pw_name : std::to_string(user);
}

std::string why_forbidden(const fs::path &node) {
    const auto status = status_of(node);
    if (!status)
        return "this user may not open it";
    constexpr mode_t group_access = S_IRGRP | S_IWGRP;
    if ((status->st_mode & group_access) != group_access)
        return "only the user '" + name_of_user(status->st_uid) + "' may open it";
    const std::string group = name_of_group(status->st_gid);
    if (is_in_group(status->st_gid))
        return "this user may not open it, although it is in the group '" + group +
               "'; does a container or a security policy forbid it?";
    return "only the group '" + group + "' may open it: run 'sudo usermod -aG " + group +
           " $USER', then log in again";
}

std::string why_busy(const fs::path &node) {
    const std::vector<std::string> holders = holders_of(node);
    if (holders.empty())
        return "in use by a program of another user; 'sudo fuser -v " + node.string() + "' shows it";
    return fmt::format("in use by {}", fmt::join(holders, ", "));
}

std::string problem_of(const PluginDevices &p) {
    return p.list.left_out > 0 ? fmt::format("lists {} more devices", p.list.left_out) : p.problem;
}

Json text_or_null(const std::string &text) {
    return text.empty() ? Json() : Json(text);
}

Json json_of(const DeviceFormat &format) {
    Json sizes = Json::array();
    for (const DeviceSize &size : format.sizes)
        sizes.push_back({{"width", size.width},
                         {"height", size.height},
                         {"rates", size.rates},
                         {"is_rate_range", size.is_rate_range}});
    return {
        {"pixel_format", format.pixel_format}, {"sizes", std::move(sizes)}, {"is_size_range", format.is_size_range}};
}

Json json_of(const DeviceControl &c) {
    return {{"name", c.name},
            {"type", devices::control_type_text(c.type)},
            {"minimum", c.minimum},
            {"maximum", c.maximum},
            {"step", c.step},
            {"default", c.default_value},
            {"value", c.value ? Json(*c.value) : Json()}};
}

Json json_of(const DeviceDescription &d, const std::string &plugin) {
    Json json = {{"plugin", plugin}};
    const Json problem = text_or_null(problem_with(d));
    switch (section_of(d)) {
    case Section::cameras: {
        Json formats = Json::array(), controls = Json::array();
        for (const DeviceFormat &format : d.formats)
            formats.push_back(json_of(format));
        for (const DeviceControl &control : d.controls)
            controls.push_back(json_of(control));
        json.update({{"path", text_or_null(d.path)},
                     {"name", d.name},
                     {"serial", text_or_null(d.serial)},
                     {"formats", std::move(formats)},
                     {"controls", std::move(controls)}});
        break;
    }
    case Section::gpus:
        json.update({{"index", d.index},
                     {"name", d.name},
                     {"kind", devices::device_kind_text(d.kind)},
                     {"uuid", text_or_null(d.serial)},
                     {"abilities", text_or_null(d.abilities)},
                     {"is_default", d.is_default}});
        break;
    case Section::displays:
        json.update({{"name", d.name},
                     {"width", d.width > 0 ? Json(d.width) : Json()},
                     {"height", d.height > 0 ? Json(d.height) : Json()},
                     {"rate", d.rate > 0 ? Json(d.rate) : Json()}});
        break;
    }
    json["problem"] = problem;
    return json;
}

// ---- text ----

// "1–30 fps"; "" if the rates are unknown.
std::string text_of_rates(const std::vector<double> &rates) {
    if (rates.empty())
        return "";
    if (rates.size() == 1)
        return fmt::format(" {:.4g} fps", rates[0]);
    return fmt::format(" {:.4g}–{:.4g} fps", rates.back(), rates.front());
}

std::string text_of(const DeviceFormat &format) {
    std::vector<std::string> sizes;
    for (const DeviceSize &size : format.sizes)
        sizes.push_back(fmt::format("{}×{}{}", size.width, size.height, text_of_rates(size.rates)));
    if (sizes.empty())
        return "    " + format.pixel_format;
    return fmt::format("    {:<7} {}", format.pixel_format, fmt::join(sizes, format.is_size_range ? " to " : ", "));
}

std::string text_of(const DeviceControl &control) {
    std::string text = fmt::format("    {:<31} {}", control.name, devices::control_type_text(control.type));
    if (control.type == ARHOST_DEVICE_CONTROL_BUTTON)
        return text;
    text += fmt::format(" {} to {}", control.minimum, control.maximum);
    if (control.step > 1)
        text += fmt::format(" in steps of {}", control.step);
    text += fmt::format(", default {}", control.default_value);
    return control.value ? text + fmt::format(", now {}", *control.value) : text;
}

// Returns the line that introduces a device.
std::string headline(const DeviceDescription &d, const std::string &plugin) {
    switch (section_of(d)) {
    case Section::cameras:
        return fmt::format("camera{}{}: {}{}{} [{}]", d.path.empty() ? "" : " ", d.path, d.name,
                           d.serial.empty() ? "" : ", serial number ", d.serial, plugin);
    case Section::displays: {
        std::string text = "display: " + d.name;
        if (d.width > 0)
            text += fmt::format(", {}×{}", d.width, d.height);
        if (d.rate > 0)
            text += fmt::format(", {:.4g} Hz", d.rate);
        return text + " [" + plugin + "]";
    }
    default:
        return fmt::format("GPU {}: {} ({}{}{}){} [{}]", d.index, d.name, devices::device_kind_text(d.kind),
                           d.serial.empty() ? "" : ", ", d.serial, d.is_default ? ", the default" : "", plugin);
    }
}

struct SectionText {
    Section section;
    arhost_kind kind; // kind of the plugins that list these devices
    const char *nothing;
};
constexpr SectionText sections[] = {
    {Section::cameras, ARHOST_KIND_SOURCE, "no camera: connect one, or use source_synthetic or source_file instead"},
    {Section::gpus, ARHOST_KIND_RAYTRACER, "no GPU: use rt_embree, which runs on the CPU"},
    {Section::displays, ARHOST_KIND_SINK, "no display: use sink_video or sink_images instead"},
};

} // namespace

std::vector<std::string> holders_of(const fs::path &node) {
    std::vector<std::string> holders;
    const auto device = status_of(node);
    if (!device)
        return holders;
    const fs::path name = fs::weakly_canonical(node).filename();
    const auto is_node = [&](const fs::path &descriptor) {
        // stat() on any descriptor may block, for example on a network file system; readlink() does not.
        std::error_code error;
        struct stat status {};
        return fs::read_symlink(descriptor, error).filename() == name && ::stat(descriptor.c_str(), &status) == 0 &&
               S_ISCHR(status.st_mode) && status.st_rdev == device->st_rdev;
    };
    std::error_code ignored; // a process may end at any time, and those of other users are not readable
    for (fs::directory_iterator process("/proc", ignored), end; process != end; process.increment(ignored)) {
        const std::string pid = process->path().filename().string();
        if (pid.find_first_not_of("0123456789") != std::string::npos)
            continue;
        std::error_code unreadable;
        for (fs::directory_iterator fd(process->path() / "fd", unreadable); fd != end; fd.increment(unreadable))
            if (is_node(fd->path())) {
                std::string command;
                std::getline(std::ifstream(process->path() / "comm"), command);
                holders.push_back(command + " (process " + pid + ")");
                break;
            }
    }
    return holders;
}

std::string problem_with(const DeviceDescription &device) {
    switch (device.state) {
    case ARHOST_DEVICE_STATE_BUSY:
        return why_busy(device.path);
    case ARHOST_DEVICE_STATE_FORBIDDEN:
        return why_forbidden(device.path);
    default:
        return device.problem;
    }
}

Json devices_as_json(const std::vector<PluginDevices> &plugins) {
    Json cameras = Json::array(), gpus = Json::array(), displays = Json::array(), problems = Json::array();
    for (const PluginDevices &p : plugins) {
        for (const DeviceDescription &device : p.list.devices) {
            const Section section = section_of(device);
            Json &list = section == Section::cameras ? cameras : section == Section::gpus ? gpus : displays;
            list.push_back(json_of(device, p.plugin));
        }
        if (const std::string problem = problem_of(p); !problem.empty())
            problems.push_back({{"plugin", p.plugin}, {"problem", problem}});
    }
    return {{"cameras", std::move(cameras)},
            {"gpus", std::move(gpus)},
            {"displays", std::move(displays)},
            {"problems", std::move(problems)}};
}

std::vector<std::string> devices_as_text(const std::vector<PluginDevices> &plugins) {
    std::vector<std::string> lines;
    for (const auto &[section, kind, nothing] : sections) {
        bool found = false, asked = false;
        for (const PluginDevices &p : plugins) {
            asked = asked || p.kind == kind;
            for (const DeviceDescription &device : p.list.devices) {
                if (section_of(device) != section)
                    continue;
                found = true;
                lines.push_back(headline(device, p.plugin));
                if (const std::string problem = problem_with(device); !problem.empty())
                    lines.push_back("    cannot be used: " + problem);
                if (!device.abilities.empty())
                    lines.push_back("    " + device.abilities);
                for (const DeviceFormat &format : device.formats)
                    lines.push_back(text_of(format));
                for (const DeviceControl &control : device.controls)
                    lines.push_back(text_of(control));
            }
        }
        if (asked && !found)
            lines.emplace_back(nothing);
    }
    for (const PluginDevices &p : plugins)
        if (const std::string problem = problem_of(p); !problem.empty())
            lines.push_back(p.plugin + ": " + problem);
    return lines;
}

} // namespace arhost::plugin_tools
