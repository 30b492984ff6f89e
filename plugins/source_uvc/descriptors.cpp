// SPDX-License-Identifier: Apache-2.0
#include "descriptors.hpp"

#include <algorithm>
#include <cstdio>
#include <optional>

namespace arhost::uvc {
namespace {

// bDescriptorType
constexpr std::uint8_t type_configuration = 2, type_interface = 4, type_endpoint = 5, type_class_interface = 0x24,
                       type_superspeed_companion = 0x30;
constexpr std::uint8_t class_video = 0x0e, subclass_control = 1, subclass_streaming = 2;
// bDescriptorSubtype of the control interface
constexpr std::uint8_t control_header = 1, input_terminal = 2, processing_unit = 5, extension_unit = 6;
// bDescriptorSubtype of a streaming interface
constexpr std::uint8_t input_header = 1, output_header = 2, still_image_frame = 3, format_uncompressed = 4,
                       frame_uncompressed = 5, format_mjpeg = 6, frame_mjpeg = 7, format_mpeg2_ts = 0x0a,
                       format_dv = 0x0c, color_format = 0x0d, format_frame_based = 0x10, frame_frame_based = 0x11,
                       format_stream_based = 0x12, format_h264 = 0x13, frame_h264 = 0x14,
                       format_h264_simulcast = 0x15, format_vp8 = 0x16, frame_vp8 = 0x17, format_vp8_simulcast = 0x18;
constexpr std::uint16_t camera_terminal_type = 0x0201;

// The last 12 bytes of GUIDs that begin with a FourCC: "YUY2", "NV12", "H264", …
constexpr std::array<std::uint8_t, 12> fourcc_guid_end = {0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71};

// A descriptor. Bytes beyond its end read as 0, because cameras that use an older version of the class omit fields.
class Descriptor {
public:
    explicit Descriptor(Bytes bytes) : bytes_(bytes) {}
    std::size_t size() const { return bytes_.size(); }
    std::uint8_t type() const { return byte(1); }
    std::uint8_t subtype() const { return byte(2); }
    std::uint8_t byte(std::size_t at) const { return at < bytes_.size() ? bytes_[at] : std::uint8_t{0}; }
    std::uint16_t word(std::size_t at) const { return static_cast<std::uint16_t>(byte(at) | byte(at + 1) << 8); }
    std::uint32_t number(std::size_t at) const { return word(at) | std::uint32_t{word(at + 2)} << 16; }
    // Returns a bit field of `count` bytes, or its first 8 bytes if it is longer.
    std::uint64_t bits(std::size_t at, std::size_t count) const {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < std::min<std::size_t>(count, 8); ++i)
            value |= std::uint64_t{byte(at + i)} << (8 * i);
        return value;
    }
    Guid guid(std::size_t at) const {
        Guid guid{};
        for (std::size_t i = 0; i < guid.size(); ++i)
            guid[i] = byte(at + i);
        return guid;
    }

private:
    Bytes bytes_;
};

std::string name_of(const Guid &guid) {
    std::string fourcc(guid.begin(), guid.begin() + 4);
    fourcc.resize(fourcc.find_last_not_of(' ') + 1); // "L8  "
    const bool is_fourcc = !fourcc.empty() &&
                           std::equal(fourcc_guid_end.begin(), fourcc_guid_end.end(), guid.begin() + 4) &&
                           std::ranges::all_of(fourcc, [](char c) { return c > 32 && c < 127; });
    return is_fourcc ? fourcc : to_text(guid);
}

Encoding encoding_of(const std::string &name) {
    return name == "YUY2" ? Encoding::yuy2 : name == "NV12" ? Encoding::nv12 : Encoding::unsupported;
}

// Returns the name of a format without a GUID, or an empty string.
std::string name_of_format(std::uint8_t subtype) {
    switch (subtype) {
    case format_mjpeg:
        return "MJPEG";
    case format_mpeg2_ts:
        return "MPEG-2 TS";
    case format_dv:
        return "DV";
    case format_stream_based:
        return "stream";
    case format_h264:
        return "H.264";
    case format_h264_simulcast:
        return "H.264 simulcast";
    case format_vp8:
        return "VP8";
    case format_vp8_simulcast:
        return "VP8 simulcast";
    default:
        return "";
    }
}

class Parser {
public:
    Configuration parse(Bytes bytes) {
        const Descriptor first(bytes);
        if (bytes.size() < 9 || first.byte(0) < 9 || first.type() != type_configuration) {
            defect(0, "is not a configuration descriptor");
            return std::move(result_);
        }
        result_.value = first.byte(5);
        if (first.word(2) != bytes.size())
            defect(0, "states a total length of " + std::to_string(first.word(2)) + " bytes, but has " +
                          std::to_string(bytes.size()));
        for (std::size_t at = 0; at < bytes.size();) {
            const std::size_t length = bytes[at], rest = bytes.size() - at;
            if (length < 2 || length > rest) {
                defect(at, "has length " + std::to_string(length) + ", of " + std::to_string(rest) +
                               " bytes; the rest is ignored");
                break;
            }
            add(at, Descriptor(bytes.subspan(at, length)));
            at += length;
        }
        finish();
        return std::move(result_);
    }

private:
    enum class Place { elsewhere, control, streaming };

    // A streaming interface, the formats that its header announces, and the function to which it belongs.
    struct Stream {
        StreamingInterface interface;
        std::optional<unsigned> announced_formats;
        std::size_t function = 0; // index of the last function before the interface
    };

    void defect(std::size_t at, const std::string &what) {
        if (result_.defects.size() < max_defects)
            result_.defects.push_back("the descriptor at byte " + std::to_string(at) + " " + what);
    }

    // Appends an element unless the list is full.
    template <class T> T *append(std::vector<T> &list, std::size_t limit, std::size_t at, T element) {
        if (list.size() >= limit) {
            defect(at, "is ignored: the device has more than " + std::to_string(limit) + " of its kind");
            return nullptr;
        }
        return &list.emplace_back(std::move(element));
    }

    // Returns whether the descriptor has at least `size` bytes.
    bool has(std::size_t at, const Descriptor &descriptor, std::size_t size) {
        if (descriptor.size() >= size)
            return true;
        defect(at, "is ignored: it has " + std::to_string(descriptor.size()) + " bytes instead of " +
                       std::to_string(size));
        return false;
    }

    void add(std::size_t at, const Descriptor &descriptor) {
        if (descriptor.type() != type_superspeed_companion)
            last_endpoint_ = nullptr;
        switch (descriptor.type()) {
        case type_interface:
            return add_interface(at, descriptor);
        case type_endpoint:
            return add_endpoint(at, descriptor);
        case type_superspeed_companion:
            return add_companion(descriptor);
        case type_class_interface:
            if (place_ == Place::control)
                add_control(at, descriptor);
            else if (place_ == Place::streaming)
                add_streaming(at, descriptor);
            return;
        default:
            return; // descriptors of other classes and unused ones, such as interface associations
        }
    }

    void add_interface(std::size_t at, const Descriptor &descriptor) {
        place_ = Place::elsewhere;
        in_format_ = false;
        if (!has(at, descriptor, 9) || descriptor.byte(5) != class_video)
            return;
        const std::uint8_t number = descriptor.byte(2);
        alternate_ = descriptor.byte(3);
        if (descriptor.byte(6) == subclass_control) {
            VideoFunction function;
            function.control_interface = number;
            if (append(result_.functions, max_functions, at, std::move(function))) {
                listed_.emplace_back();
                place_ = Place::control;
            }
        } else if (descriptor.byte(6) == subclass_streaming && !result_.functions.empty()) {
            const auto found = std::ranges::find_if(
                streams_, [&](const Stream &stream) { return stream.interface.number == number; });
            Stream stream;
            stream.interface.number = number;
            stream.function = result_.functions.size() - 1;
            if (found != streams_.end())
                stream_ = static_cast<std::size_t>(found - streams_.begin());
            else if (append(streams_, max_streams, at, std::move(stream)))
                stream_ = streams_.size() - 1;
            else
                return;
            place_ = Place::streaming;
        } else if (result_.functions.empty()) {
            defect(at, "is ignored: a streaming interface without a control interface before it");
        }
    }

    void add_endpoint(std::size_t at, const Descriptor &descriptor) {
        constexpr std::uint8_t is_input = 0x80, isochronous = 1, bulk = 2;
        if (place_ != Place::streaming || !has(at, descriptor, 7))
            return;
        const std::uint8_t address = descriptor.byte(2), kind = descriptor.byte(3) & 3;
        std::vector<AlternateSetting> &alternates = streams_[stream_].interface.alternates;
        if (!(address & is_input) || (kind != isochronous && kind != bulk) ||
            std::ranges::count(alternates, alternate_, &AlternateSetting::number))
            return; // endpoints of still images
        // Bits 11 and 12: additional transactions of a high-bandwidth endpoint per microframe.
        const std::uint32_t size = descriptor.word(4), packet = size & 0x7ff, transactions = 1 + (size >> 11 & 3);
        if (packet == 0)
            return defect(at, "is ignored: its packets have no bytes");
        last_endpoint_ = append(alternates, max_alternates, at,
                                {alternate_, address, kind == bulk, packet,
                                 kind == bulk ? packet : packet * std::min<std::uint32_t>(transactions, 3)});
    }

    void add_companion(const Descriptor &descriptor) {
        if (last_endpoint_ && !last_endpoint_->is_bulk && descriptor.size() >= 6 && descriptor.word(4) > 0)
            last_endpoint_->payload_bytes = std::min<std::uint32_t>(descriptor.word(4), 48 << 10);
        last_endpoint_ = nullptr;
    }

    void add_control(std::size_t at, const Descriptor &descriptor) {
        VideoFunction &function = result_.functions.back();
        Unit unit;
        unit.id = descriptor.byte(3);
        switch (descriptor.subtype()) {
        case control_header:
            if (!has(at, descriptor, 12))
                return;
            function.version = descriptor.word(3);
            function.clock_hz = descriptor.number(7);
            for (std::size_t i = 12; i < std::min<std::size_t>(descriptor.size(), 12u + descriptor.byte(11)); ++i)
                listed_.back().push_back(descriptor.byte(i));
            return;
        case input_terminal:
            if (descriptor.word(4) != camera_terminal_type || !has(at, descriptor, 15))
                return;
            unit.kind = UnitKind::camera_terminal;
            unit.controls = descriptor.bits(15, descriptor.byte(14));
            break;
        case processing_unit:
            if (!has(at, descriptor, 8))
                return;
            unit.kind = UnitKind::processing_unit;
            unit.controls = descriptor.bits(8, descriptor.byte(7));
            break;
        case extension_unit: {
            if (!has(at, descriptor, 22))
                return;
            const std::size_t control_size = 22u + descriptor.byte(21);
            unit.kind = UnitKind::extension_unit;
            unit.guid = descriptor.guid(4);
            unit.controls = descriptor.bits(control_size + 1, descriptor.byte(control_size));
            break;
        }
        default:
            return; // other terminals and units have no controls that the plugin uses
        }
        if (unit.id == 0 || std::ranges::count(function.units, unit.id, &Unit::id))
            return defect(at, "is ignored: its unit ID " + std::to_string(unit.id) + " is 0 or not unique");
        append(function.units, max_units, at, unit);
    }

    void add_streaming(std::size_t at, const Descriptor &descriptor) {
        Stream &stream = streams_[stream_];
        std::vector<Format> &formats = stream.interface.formats;
        Format format;
        format.index = descriptor.byte(3);
        switch (const std::uint8_t subtype = descriptor.subtype()) {
        case input_header:
            stream.announced_formats = descriptor.byte(3);
            stream.interface.terminal = descriptor.byte(8);
            return;
        case format_uncompressed:
        case format_frame_based:
            if (!has(at, descriptor, 21))
                return;
            format.name = name_of(descriptor.guid(5));
            if (subtype == format_uncompressed)
                format.encoding = encoding_of(format.name);
            format.default_frame = descriptor.byte(22);
            break;
        case format_mjpeg:
            format.encoding = Encoding::mjpeg;
            format.default_frame = descriptor.byte(6);
            [[fallthrough]];
        case format_mpeg2_ts:
        case format_dv:
        case format_stream_based:
        case format_h264:
        case format_h264_simulcast:
        case format_vp8:
        case format_vp8_simulcast:
            format.name = name_of_format(subtype);
            break;
        case frame_uncompressed:
        case frame_mjpeg:
        case frame_frame_based:
            if (!in_format_)
                defect(at, "is ignored: a frame without a format before it");
            else if (has(at, descriptor, 26))
                add_frame(at, descriptor, formats.back());
            return;
        case color_format:
            if (in_format_)
                formats.back().matrix = descriptor.byte(5);
            return;
        case frame_h264: // their sizes have other offsets, and no supported format uses them
        case frame_vp8:
        case still_image_frame:
        case output_header:
        default:
            return;
        }
        in_format_ = false; // if this format is ignored, its frames are ignored too
        if (format.index == 0 || std::ranges::count(formats, format.index, &Format::index))
            return defect(at, "is ignored: its format index " + std::to_string(format.index) + " is 0 or not unique");
        in_format_ = append(formats, max_formats, at, std::move(format)) != nullptr;
    }

    void add_frame(std::size_t at, const Descriptor &descriptor, Format &format) {
        FrameSize frame;
        frame.index = descriptor.byte(3);
        frame.width = descriptor.word(5);
        frame.height = descriptor.word(7);
        const bool is_frame_based = descriptor.subtype() == frame_frame_based;
        frame.max_bytes = is_frame_based ? 0 : descriptor.number(17);
        frame.default_interval = descriptor.number(is_frame_based ? 17 : 21);
        if (frame.index == 0 || frame.width == 0 || frame.height == 0 ||
            std::ranges::count(format.frames, frame.index, &FrameSize::index))
            return defect(at, "is ignored: its frame index or its size is 0, or the index is not unique");
        const std::size_t listed = descriptor.byte(is_frame_based ? 21 : 25);
        if (listed == 0) {
            frame.shortest_interval = descriptor.number(26);
            frame.longest_interval = descriptor.number(30);
            frame.interval_step = descriptor.number(34);
            if (frame.shortest_interval > frame.longest_interval)
                std::swap(frame.shortest_interval, frame.longest_interval);
            if (frame.shortest_interval == 0)
                defect(at, "permits a frame interval of 0");
        } else if (descriptor.size() < 26 + 4 * listed) {
            defect(at, "has fewer frame intervals than it states");
        }
        for (std::size_t i = 0; i < std::min(listed, max_intervals) && descriptor.size() >= 30 + 4 * i; ++i)
            if (const std::uint32_t interval = descriptor.number(26 + 4 * i); interval > 0)
                frame.intervals.push_back(interval);
            else
                defect(at, "lists a frame interval of 0");
        std::ranges::sort(frame.intervals);
        append(format.frames, max_frames, at, std::move(frame));
    }

    // Assigns each streaming interface to the function whose header lists it. If no header lists it, assigns it to
    // the last function before it.
    void finish() {
        for (Stream &stream : streams_) {
            StreamingInterface &interface = stream.interface;
            if (stream.announced_formats && *stream.announced_formats != interface.formats.size())
                defect(0, "is wrong: interface " + std::to_string(interface.number) + " states " +
                              std::to_string(*stream.announced_formats) + " formats, but has " +
                              std::to_string(interface.formats.size()));
            for (std::size_t i = 0; i < listed_.size(); ++i)
                if (std::ranges::count(listed_[i], interface.number)) {
                    stream.function = i;
                    break;
                }
            result_.functions[stream.function].streams.push_back(std::move(interface));
        }
    }

    Configuration result_;
    std::vector<std::vector<std::uint8_t>> listed_; // baInterfaceNr of each function
    std::vector<Stream> streams_;
    Place place_ = Place::elsewhere;
    std::size_t stream_ = 0; // index in streams_
    bool in_format_ = false; // whether frames belong to the last format
    std::uint8_t alternate_ = 0;
    AlternateSetting *last_endpoint_ = nullptr; // the endpoint to which a companion descriptor belongs
};

} // namespace

std::uint32_t FrameSize::nearest_interval(std::uint32_t wanted) const {
    const auto distance = [&](std::uint32_t interval) {
        return interval > wanted ? interval - wanted : wanted - interval;
    };
    if (!intervals.empty())
        return *std::ranges::min_element(intervals, {}, distance);
    if (longest_interval == 0)
        return default_interval;
    const std::uint32_t shortest = std::max<std::uint32_t>(shortest_interval, 1);
    const std::uint32_t clamped = std::clamp(wanted, shortest, longest_interval);
    if (interval_step == 0)
        return clamped;
    const std::uint32_t below = shortest + (clamped - shortest) / interval_step * interval_step;
    const bool has_above = longest_interval - below >= interval_step;
    return has_above && distance(below + interval_step) < distance(below) ? below + interval_step : below;
}

double FrameSize::max_fps() const {
    const std::uint32_t shortest = !intervals.empty()      ? intervals.front()
                                   : shortest_interval > 0 ? shortest_interval
                                                           : default_interval;
    return shortest > 0 ? static_cast<double>(intervals_per_second) / shortest : 0;
}

Configuration parse_configuration(Bytes bytes) {
    return Parser().parse(bytes);
}

// In the descriptor, the first three groups of a GUID are little-endian.
std::string to_text(const Guid &guid) {
    constexpr std::array<int, 16> order = {3, 2, 1, 0, 5, 4, 7, 6, 8, 9, 10, 11, 12, 13, 14, 15};
    std::string text;
    for (std::size_t i = 0; i < order.size(); ++i) {
        char hex[3];
        std::snprintf(hex, sizeof hex, "%02x", guid[static_cast<std::size_t>(order[i])]);
        text += (i == 4 || i == 6 || i == 8 || i == 10 ? "-" : "") + std::string(hex);
    }
    return text;
}

} // namespace arhost::uvc
