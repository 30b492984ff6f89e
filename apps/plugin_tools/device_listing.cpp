// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/device_listing.hpp"

#include "supervise/probe.hpp"

namespace arhost::plugin_tools {

DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs, std::chrono::seconds timeout) {
    using namespace ipc::messages;
    for (const std::string &need : needs)
        if (need == "video" || need == "usb" || need == "gpu" || need == "display")
            policy.allow.insert(need);
    std::string text;
    std::optional<devices::DeviceList> list;
    const std::string reason = supervise::query(context, plugin, policy, timeout,
                                                [&](supervise::Process &process, const ipc::Message &message) {
                                                    if (ipc::is<Hello>(message))
                                                        process.send(ListDevices{});
                                                    if (!ipc::is<Devices>(message))
                                                        return false;
                                                    const auto answer = ipc::parse<Devices>(message);
                                                    text += answer.part;
                                                    if (text.size() > devices::max_device_list_size)
                                                        throw std::runtime_error("its list of devices is too long");
                                                    if (answer.is_last)
                                                        list = devices::devices_from_text(text);
                                                    return answer.is_last;
                                                });
    if (!reason.empty())
        return reason;
    return list;
}

} // namespace arhost::plugin_tools
