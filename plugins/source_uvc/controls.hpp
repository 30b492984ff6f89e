// SPDX-License-Identifier: Apache-2.0
//
// The controls of a camera terminal and a processing unit, under the names that the kernel's driver gives them, and
// extension units as raw bytes. Functions that fail throw Failure with a message for the user.
#pragma once

#include "usb.hpp"

#include "camera_common/control_values.hpp"

#include <string_view>

namespace arhost::uvc {

// A control as defined by the UVC class ("USB Device Class Definition for Video Devices" 1.5, section 4.2.2).
struct ControlDefinition {
    std::string_view name;
    UnitKind unit;
    std::uint8_t bit, selector; // bit: position in bmControls
    std::uint8_t size;          // size of the selector's data, bytes
    std::uint8_t offset, width; // position and size of the value in the data, bytes
    bool is_signed;
    ControlKind kind;
};

class Controls {
public:
    Controls(const UsbDevice &device, const VideoFunction &function);

    // Returns the control with this name, or nullptr if the camera lacks it.
    const ControlDefinition *find(std::string_view name) const;
    std::vector<ControlDefinition> all() const;
    ControlValues values_of(const ControlDefinition &control) const;
    // Returns the current value, or std::nullopt if it cannot be read.
    std::optional<std::int64_t> value_of(const ControlDefinition &control) const;

    // Sets a control to a value in text form. `key` names the option for messages. Returns a warning if the camera
    // sets another value, else an empty string.
    std::string set(const ControlDefinition &control, std::string_view text, const std::string &key) const;

    // Sets controls of extension units from a user's list of "UNIT:SELECTOR=BYTES", for example "4:9=01ff,
    // 28f03370-…:2=00". UNIT is the ID or GUID of the unit, and BYTES are hexadecimal. Returns the warnings.
    std::vector<std::string> set_extensions(std::string_view list, const std::string &key) const;

    [[noreturn]] void fail(const std::string &key, const std::string &what) const {
        device_.fail_configuration(key, what);
    }

private:
    std::uint16_t entity_of(const Unit &unit) const;
    const Unit *unit_of(const ControlDefinition &control) const;
    std::vector<std::uint8_t> read(std::uint8_t request, const ControlDefinition &control) const; // empty: rejected
    std::string set_extension(const ControlSetting &setting, const std::string &key) const;

    const UsbDevice &device_;
    const VideoFunction &function_;
};

} // namespace arhost::uvc
