// SPDX-License-Identifier: Apache-2.0
//
// Builds configuration descriptors of video cameras from small tables. The layouts follow the structure of public
// `lsusb -v` dumps: which descriptors occur, in which order, with which sizes.
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

namespace arhost::test {

using Octets = std::vector<std::uint8_t>;

struct FrameRow {
    std::uint16_t width, height;
    std::vector<std::uint32_t> intervals; // empty: a range from 1/60 s to 1/5 s in steps of 1/60 s
};
struct FormatRow {
    std::string name; // a FourCC, "MJPEG", "H.264" or "frame:" and a FourCC for frame-based
    std::vector<FrameRow> frames;
};
struct AlternateRow {
    std::uint16_t packet; // wMaxPacketSize, with the additional transactions in bits 11 and 12
    bool is_bulk = false;
    std::uint16_t companion = 0; // wBytesPerInterval of a SuperSpeed companion; 0: no companion
};
struct StreamRow {
    std::uint8_t interface;
    std::vector<FormatRow> formats;
    std::vector<AlternateRow> alternates;   // of isochronous streams from setting 1 on; bulk ones from 0 on
    std::uint8_t still_images = 0;          // number of their sizes; 0: no such descriptor
    std::uint8_t matrix = 1;                // of the colour matching descriptor; 0: no such descriptor
    std::function<void(Octets &)> damage{}; // applied to the descriptors of setting 0
};
struct FunctionRow {
    std::uint8_t control_interface;
    std::uint16_t version;
    std::uint32_t clock_hz;
    std::uint32_t camera_controls, processing_controls;
    std::vector<std::uint8_t> extension_ids;
    std::vector<StreamRow> streams;
    bool lists_streams = true; // in baInterfaceNr
    bool has_status_endpoint = true;
};
struct Layout {
    std::string name;
    std::vector<FunctionRow> functions;
    bool has_audio = false;                 // two interfaces of a microphone between the cameras
    std::function<void(Octets &)> damage{}; // applied to the entire descriptor
};

inline void put(Octets &bytes, std::initializer_list<std::uint32_t> values) {
    for (const std::uint32_t value : values)
        bytes.push_back(static_cast<std::uint8_t>(value));
}
inline void put_number(Octets &bytes, std::uint32_t value, int size) {
    for (int i = 0; i < size; ++i)
        bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}
// Appends a descriptor and sets its length.
inline void put_descriptor(Octets &bytes, Octets body) {
    bytes.push_back(static_cast<std::uint8_t>(body.size() + 1));
    bytes.insert(bytes.end(), body.begin(), body.end());
}
inline void put_fourcc_guid(Octets &bytes, const std::string &fourcc) {
    bytes.insert(bytes.end(), fourcc.begin(), fourcc.begin() + 4);
    if (fourcc == "INVZ") { // depth with 16 bits
        put(bytes, {0x90, 0x2d, 0x58, 0x4a, 0x92, 0x0b, 0x77, 0x3f, 0x1f, 0x2c, 0x55, 0x6b});
        return;
    }
    put(bytes, {0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71});
}

inline Octets frame_descriptor(const FrameRow &frame, std::uint8_t index, std::uint8_t subtype) {
    const std::uint32_t size = 2u * frame.width * frame.height;
    const bool is_frame_based = subtype == 0x11;
    Octets body;
    put(body, {0x24, subtype, index, 0});
    put_number(body, frame.width, 2);
    put_number(body, frame.height, 2);
    put_number(body, size * 8 * 5, 4);
    put_number(body, size * 8 * 30, 4);
    if (!is_frame_based)
        put_number(body, size, 4);
    put_number(body, frame.intervals.empty() ? 333333 : frame.intervals.front(), 4);
    put(body, {static_cast<std::uint32_t>(frame.intervals.size())});
    if (is_frame_based)
        put_number(body, 0, 4);
    for (const std::uint32_t interval : frame.intervals)
        put_number(body, interval, 4);
    if (frame.intervals.empty())
        for (const std::uint32_t value : {166666u, 2000000u, 166666u})
            put_number(body, value, 4);
    return body;
}

inline void put_format(Octets &bytes, const FormatRow &format, std::uint8_t index, std::uint8_t matrix) {
    Octets body;
    const auto frames = static_cast<std::uint32_t>(format.frames.size());
    const bool is_frame_based = format.name.starts_with("frame:");
    std::uint8_t frame_subtype = 5;
    if (format.name == "MJPEG") {
        put(body, {0x24, 6, index, frames, 1, 1, 0, 0, 0, 0});
        frame_subtype = 7;
    } else if (format.name == "H.264") { // of UVC 1.5, here without frames
        put(body, {0x24, 0x13, index, frames, 1, 0x10});
        body.resize(51);
    } else {
        put(body, {0x24, is_frame_based ? 0x10u : 4u, index, frames});
        put_fourcc_guid(body, format.name.substr(is_frame_based ? 6 : 0));
        put(body, {16, 1, 0, 0, 0, 0});
        if (is_frame_based)
            put(body, {1});
        frame_subtype = is_frame_based ? 0x11 : 5;
    }
    put_descriptor(bytes, body);
    for (std::uint8_t i = 0; i < frames; ++i)
        put_descriptor(bytes, frame_descriptor(format.frames[i], static_cast<std::uint8_t>(i + 1), frame_subtype));
    if (matrix)
        put_descriptor(bytes, {0x24, 0x0d, 1, 1, matrix});
}

inline void put_interface(Octets &bytes, std::uint8_t number, std::uint8_t alternate, std::uint8_t endpoints,
                          std::uint8_t subclass, std::uint8_t interface_class = 14) {
    put_descriptor(bytes, {4, number, alternate, endpoints, interface_class, subclass, 0, 0});
}

inline void put_endpoint(Octets &bytes, const AlternateRow &row, std::uint8_t address) {
    put_descriptor(bytes,
                   {5, address, static_cast<std::uint8_t>(row.is_bulk ? 2 : 5), static_cast<std::uint8_t>(row.packet),
                    static_cast<std::uint8_t>(row.packet >> 8), static_cast<std::uint8_t>(row.is_bulk ? 0 : 1)});
    if (row.companion)
        put_descriptor(bytes, {0x30, 0, 0, static_cast<std::uint8_t>(row.companion),
                               static_cast<std::uint8_t>(row.companion >> 8)});
}

inline void put_stream(Octets &bytes, const StreamRow &stream) {
    const auto address = static_cast<std::uint8_t>(0x80 | stream.interface);
    const bool is_bulk = !stream.alternates.empty() && stream.alternates.front().is_bulk;
    put_interface(bytes, stream.interface, 0, is_bulk ? 1 : 0, 2);
    Octets formats;
    for (std::uint8_t i = 0; i < stream.formats.size(); ++i)
        put_format(formats, stream.formats[i], static_cast<std::uint8_t>(i + 1), stream.matrix);
    if (stream.still_images) {
        Octets still = {0x24, 3, 0, stream.still_images};
        for (std::uint8_t i = 0; i < stream.still_images; ++i)
            put(still, {0x80, 2, 0xe0, 1});
        put(still, {0});
        put_descriptor(formats, still);
    }
    Octets header = {0x24, 1, static_cast<std::uint8_t>(stream.formats.size())};
    put_number(header, static_cast<std::uint32_t>(13 + stream.formats.size() + formats.size()), 2);
    put(header, {address, 0, 3, static_cast<std::uint32_t>(stream.still_images ? 2 : 0), 0, 0, 1});
    header.resize(header.size() + stream.formats.size()); // bmaControls
    Octets setting;
    put_descriptor(setting, header);
    setting.insert(setting.end(), formats.begin(), formats.end());
    if (stream.damage)
        stream.damage(setting);
    bytes.insert(bytes.end(), setting.begin(), setting.end());
    for (std::uint8_t i = 0; i < stream.alternates.size(); ++i) {
        const auto number = static_cast<std::uint8_t>(is_bulk ? i : i + 1);
        if (number > 0)
            put_interface(bytes, stream.interface, number, 1, 2);
        put_endpoint(bytes, stream.alternates[i], address);
    }
}

inline void put_function(Octets &bytes, const FunctionRow &function) {
    const auto streams = static_cast<std::uint8_t>(function.streams.size());
    put_descriptor(bytes, {0x0b, function.control_interface, static_cast<std::uint8_t>(1 + streams), 14, 3, 0, 0});
    put_interface(bytes, function.control_interface, 0, function.has_status_endpoint, 1);
    Octets units;
    Octets terminal = {0x24, 2, 1, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 3};
    put_number(terminal, function.camera_controls, 3);
    put_descriptor(units, terminal);
    Octets processing = {0x24, 5, 2, 1, 0, 0};
    const bool has_video_standards = function.version >= 0x0110;
    const int control_size = has_video_standards ? 3 : 2;
    put(processing, {static_cast<std::uint32_t>(control_size)});
    put_number(processing, function.processing_controls, control_size);
    put(processing, {0});
    if (has_video_standards)
        put(processing, {0});
    put_descriptor(units, processing);
    for (const std::uint8_t id : function.extension_ids) {
        Octets extension = {0x24, 6, id};
        for (std::uint8_t i = 0; i < 16; ++i)
            extension.push_back(static_cast<std::uint8_t>(id * 16 + i));
        put(extension, {3, 1, 2, 1, 7, 0});
        put_descriptor(units, extension);
    }
    put_descriptor(units, {0x24, 3, 3, 1, 1, 0, 2, 0});
    Octets header = {0x24, 1};
    put_number(header, function.version, 2);
    const std::uint8_t listed = function.lists_streams ? streams : std::uint8_t{0};
    put_number(header, static_cast<std::uint32_t>(12 + listed + units.size()), 2);
    put_number(header, function.clock_hz, 4);
    put(header, {listed});
    for (std::uint8_t i = 0; i < listed; ++i)
        put(header, {function.streams[i].interface});
    put_descriptor(bytes, header);
    bytes.insert(bytes.end(), units.begin(), units.end());
    if (function.has_status_endpoint) {
        put_descriptor(bytes, {5, static_cast<std::uint8_t>(0x80 | (function.control_interface + 8)), 3, 16, 0, 6});
        put_descriptor(bytes, {0x25, 3, 16, 0});
    }
    for (const StreamRow &stream : function.streams)
        put_stream(bytes, stream);
}

inline Octets configuration_of(const Layout &layout) {
    Octets bytes;
    std::uint8_t interfaces = 0;
    for (const FunctionRow &function : layout.functions) {
        put_function(bytes, function);
        interfaces = static_cast<std::uint8_t>(interfaces + 1 + function.streams.size());
        if (layout.has_audio && &function == &layout.functions.front()) {
            put_interface(bytes, 10, 0, 0, 1, 1);
            put_descriptor(bytes, {0x24, 1, 0, 1, 0x26, 0, 1, 11}); // of audio, with the type of a class interface
            put_interface(bytes, 11, 1, 1, 2, 1);
            put_endpoint(bytes, {100}, 0x86);
        }
    }
    Octets all = {9, 2};
    put_number(all, static_cast<std::uint32_t>(9 + bytes.size()), 2);
    put(all, {interfaces, 1, 0, 0x80, 250});
    all.insert(all.end(), bytes.begin(), bytes.end());
    if (layout.damage)
        layout.damage(all);
    return all;
}

} // namespace arhost::test
