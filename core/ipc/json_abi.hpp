// SPDX-License-Identifier: Apache-2.0
//
// ABI structs in control messages. Reading throws nlohmann::json::exception or std::runtime_error on
// anything malformed: what comes from a worker is not trusted.
#pragma once

#include "ipc/channel.hpp"
#include "ipc/memory.hpp"

#include <arhost/arhost.h>

#include <string>
#include <vector>

namespace arhost::ipc {

// A descriptor and its options with strings of its own, as it comes out of a worker's hello.
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
    std::vector<std::string> needs; // of sandbox::allowances
};
struct OptionValue {
    std::string key;
    arhost_option_type type = 0;
    std::int64_t integer = 0;
    double real = 0;
    std::string text;
};

// The options in a descriptor: elements are as long as the plugin's headers had them, which may be newer than these.
std::vector<const arhost_option_descriptor *> options_of(const arhost_descriptor &descriptor);

// What a host takes of a descriptor: in a text of it, and in all as JSON, which must fit a hello.
constexpr std::size_t max_text_size = 4096, max_descriptor_size = Channel::max_message_size - 1024;

Json to_json(const arhost_descriptor &descriptor);
PluginDescription description_from_json(const Json &json);

// What a plugin's extension arhost.devices/1 tells, as a worker passes it on: so many of them, their texts printable.
struct DeviceDescription {
    std::uint32_t index = 0;
    arhost_device_kind kind = 0;
    bool is_default = false;
    std::string name, uuid, abilities; // "": none
};
struct DeviceList {
    std::vector<DeviceDescription> devices;
    std::uint64_t left_out = 0; // behind them
};
constexpr std::size_t max_devices = 64, max_device_text_size = 256; // bytes, before the "…" of what is longer

Json to_json(const arhost_device &device);
DeviceList devices_from_json(const Json &message);

Json to_json(const std::vector<OptionValue> &options);
std::vector<OptionValue> options_from_json(const Json &json);

Json to_json(const arhost_intrinsics &intrinsics);
arhost_intrinsics intrinsics_from_json(const Json &json);

// Only the fields that a source sets; the layout is computed anew on reading.
Json to_json(const arhost_frame_format &format);
arhost_frame_format format_from_json(const Json &json);

Json to_json(const SlotLayout &layout);
SlotLayout layout_from_json(const Json &json);

const char *to_text(arhost_kind kind);
const char *device_kind_text(arhost_device_kind kind);
const char *status_text(arhost_status status);

} // namespace arhost::ipc
