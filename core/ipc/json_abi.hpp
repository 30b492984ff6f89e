// SPDX-License-Identifier: Apache-2.0
//
// ABI structs in control messages. Reading throws nlohmann::json::exception or std::runtime_error on malformed input,
// as workers are not trusted.
#pragma once

#include "ipc/channel.hpp"
#include "ipc/memory.hpp"

#include <arhost/arhost.h>

#include <string>
#include <vector>

namespace arhost::ipc {

// An arhost_descriptor with its options, owning all strings.
struct OptionDeclaration {
    std::string key;
    arhost_option_type type = 0;
    std::optional<std::string> default_value;
    double minimum = 0, maximum = 0;
    std::vector<std::string> choices;
    std::string help;
};
struct PluginDescription {
    arhost_kind kind = 0;
    std::string id, name, version, vendor, licence, description;
    std::uint32_t capabilities = 0;
    std::vector<OptionDeclaration> options;
    std::vector<std::string> needs; // from sandbox::allowances
};
struct OptionValue {
    std::string key;
    arhost_option_type type = 0;
    std::int64_t integer = 0;
    double real = 0;
    std::string text;
};

// The options of a descriptor. Their size is that of the plugin's headers, which may be newer than these.
std::vector<const arhost_option_descriptor *> options_of(const arhost_descriptor &descriptor);

PluginDescription describe(const arhost_descriptor &descriptor);

// Limits in bytes of a descriptor's texts and of the whole as JSON, which must fit a hello.
constexpr std::size_t max_text_size = 4096, max_descriptor_size = Channel::max_message_size - 1024;

Json to_json(const PluginDescription &description);
Json to_json(const arhost_descriptor &descriptor);
PluginDescription description_from_json(const Json &json);

// A plugin's answer through the extension arhost.devices/1, with printable texts.
struct DeviceDescription {
    std::uint32_t index = 0;
    arhost_device_kind kind = 0;
    bool is_default = false;
    std::string name, uuid, abilities; // may be empty
};
struct DeviceList {
    std::vector<DeviceDescription> devices;
    std::uint64_t left_out = 0; // devices beyond max_devices
};
constexpr std::size_t max_devices = 64, max_device_text_size = 256; // bytes, without the "…" of a cut text

DeviceDescription describe(const arhost_device &device);

Json to_json(const DeviceList &list);
DeviceList devices_from_json(const Json &json);

Json to_json(const arhost_intrinsics &intrinsics);
arhost_intrinsics intrinsics_from_json(const Json &json);

// Only the fields that a source sets; reading recomputes the layout.
Json to_json(const arhost_frame_format &format);
arhost_frame_format format_from_json(const Json &json);

Json to_json(const SlotLayout &layout);
SlotLayout layout_from_json(const Json &json);

const char *to_text(arhost_kind kind);
const char *device_kind_text(arhost_device_kind kind);
const char *status_text(arhost_status status);

} // namespace arhost::ipc
