// SPDX-License-Identifier: Apache-2.0
//
// The devices that a plugin lists through the extension of arhost/devices.h: copies of the ABI's structs that own
// their data, and their conversion to and from the JSON in which a worker sends them.
#pragma once

#include <arhost/arhost.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::devices {

// The fields have the same meanings as in arhost/devices.h. The texts are printable.
struct DeviceSize {
    std::uint32_t width = 0, height = 0;
    bool is_rate_range = false;
    std::vector<double> rates;
    bool operator==(const DeviceSize &) const = default;
};
struct DeviceFormat {
    std::string pixel_format;
    bool is_size_range = false;
    std::vector<DeviceSize> sizes;
    bool operator==(const DeviceFormat &) const = default;
};
struct DeviceControl {
    std::string name;
    arhost_device_control_type type = 0;
    std::int64_t minimum = 0, maximum = 0, step = 0, default_value = 0;
    std::optional<std::int64_t> value;
    bool operator==(const DeviceControl &) const = default;
};
struct DeviceDescription {
    std::uint32_t index = 0;
    arhost_device_kind kind = 0;
    arhost_device_state state = 0;
    bool is_default = false;
    std::string name, path, serial, abilities, problem; // "" for NULL
    std::vector<DeviceFormat> formats;
    std::vector<DeviceControl> controls;
    std::uint32_t width = 0, height = 0;
    double rate = 0;
    bool operator==(const DeviceDescription &) const = default;
};
struct DeviceList {
    std::vector<DeviceDescription> devices;
    std::uint64_t left_out = 0; // devices beyond ARHOST_MAX_DEVICES
};

constexpr std::size_t max_device_text_size = 256;             // bytes, not counting the "…" of a truncated text
constexpr std::size_t max_device_list_size = 4 * 1024 * 1024; // bytes of JSON

// Copies a device and limits the sizes of its texts and arrays. Throws std::runtime_error if it violates the contract
// of arhost/devices.h; the message continues a sentence: "it reported …".
DeviceDescription describe(const arhost_device *device);

// The list as JSON in ASCII; nullopt: the plugin does not support the extension. to_text throws std::runtime_error if
// the list is too long. devices_from_text throws std::runtime_error or nlohmann::json::exception if the list is
// malformed, too long, or violates the contract.
std::string to_text(const std::optional<DeviceList> &list);
std::optional<DeviceList> devices_from_text(std::string_view text);

const char *device_kind_text(arhost_device_kind kind);
const char *control_type_text(arhost_device_control_type type);

} // namespace arhost::devices
