// SPDX-License-Identifier: Apache-2.0
//
// Parses the configuration descriptor of a USB video camera: USB 2.0 and 3.2 chapter 9.6, and "USB Device Class
// Definition for Video Devices" 1.0 to 1.5, chapter 3. The bytes come from the device and are not trusted. The parser
// accepts any bytes, ignores unusable parts and describes each mistake in Configuration::defects.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace arhost::uvc {

using Bytes = std::span<const std::uint8_t>;
using Guid = std::array<std::uint8_t, 16>;

// Limits of the data that is stored per device. Real cameras have less than a quarter of these numbers.
constexpr std::size_t max_functions = 16, max_units = 64, max_streams = 16, max_formats = 64, max_frames = 128,
                      max_intervals = 64, max_alternates = 64, max_defects = 32;

constexpr std::uint32_t intervals_per_second = 10'000'000; // frame intervals have units of 100 ns

enum class Encoding { yuy2, nv12, mjpeg, unsupported };
struct NamedEncoding {
    Encoding encoding;
    const char *name; // value of the option `format`
};
constexpr NamedEncoding encodings[] = { // in the order of preference
    {Encoding::yuy2, "yuyv"},
    {Encoding::nv12, "nv12"},
    {Encoding::mjpeg, "mjpeg"}};

// A frame size. `intervals` lists the permitted frame intervals. If it is empty, the permitted intervals form a
// range; if longest_interval is 0, the camera states no intervals.
struct FrameSize {
    std::uint8_t index = 0; // bFrameIndex
    std::uint32_t width = 0, height = 0;
    std::uint32_t max_bytes = 0; // maximum size of a frame that the camera states; 0: not stated
    std::uint32_t default_interval = 0;
    std::vector<std::uint32_t> intervals; // ascending, none is 0
    std::uint32_t shortest_interval = 0, longest_interval = 0, interval_step = 0;

    // Returns the permitted interval nearest to `wanted`, or the default interval if the camera lists none.
    std::uint32_t nearest_interval(std::uint32_t wanted) const;
    double max_fps() const; // 0: unknown
};

struct Format {
    std::uint8_t index = 0; // bFormatIndex
    Encoding encoding = Encoding::unsupported;
    std::string name; // "YUY2", "NV12", "MJPEG", "H.264", or the GUID
    std::uint8_t default_frame = 0;
    std::uint8_t matrix = 0; // bMatrixCoefficients of the colour matching descriptor: 1 BT.709, 4 BT.601; 0: none
    std::vector<FrameSize> frames;
};

// A setting of a streaming interface with an endpoint for video.
struct AlternateSetting {
    std::uint8_t number = 0;
    std::uint8_t endpoint = 0; // address; always an IN endpoint
    bool is_bulk = false;
    std::uint32_t packet_bytes = 0;  // size of a packet on the bus
    std::uint32_t payload_bytes = 0; // isochronous: maximum per (micro)frame, at most 48 KiB; bulk: like packet_bytes
};

struct StreamingInterface {
    std::uint8_t number = 0;
    std::uint8_t terminal = 0; // bTerminalLink: ID of the output terminal
    std::vector<Format> formats;
    std::vector<AlternateSetting> alternates;
};

enum class UnitKind { camera_terminal, processing_unit, extension_unit };

struct Unit {
    UnitKind kind = UnitKind::camera_terminal;
    std::uint8_t id = 0;
    std::uint64_t controls = 0; // bmControls
    Guid guid{};                // GUID of an extension unit
};

// A camera. A device may contain several.
struct VideoFunction {
    std::uint8_t control_interface = 0;
    std::uint16_t version = 0; // bcdUVC: 0x0110 is 1.1
    std::uint32_t clock_hz = 0;
    std::vector<Unit> units;
    std::vector<StreamingInterface> streams;
};

struct Configuration {
    std::uint8_t value = 0; // bConfigurationValue
    std::vector<VideoFunction> functions;
    std::vector<std::string> defects;
};

// Parses a configuration descriptor with all descriptors that follow it.
Configuration parse_configuration(Bytes bytes);

std::string to_text(const Guid &guid); // "32595559-0000-0010-8000-00aa00389b71"

} // namespace arhost::uvc
