// SPDX-License-Identifier: Apache-2.0
#include "negotiation.hpp"

#include <algorithm>

namespace arhost::uvc {

std::size_t probe_size(std::uint16_t version) {
    return version >= 0x0150 ? 48 : version >= 0x0110 ? 34 : 26;
}

std::vector<std::uint8_t> encode_probe(const ProbeControl &wanted, std::size_t size) {
    std::vector<std::uint8_t> bytes(size);
    const auto put = [&](std::size_t at, std::uint32_t value) {
        for (std::size_t i = 0; i < 4; ++i)
            bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
    };
    bytes[0] = 1; // bmHint: keep the frame interval
    bytes[2] = wanted.format;
    bytes[3] = wanted.frame;
    put(4, wanted.interval);
    return bytes;
}

std::optional<ProbeControl> decode_probe(Bytes bytes) {
    if (bytes.size() < 26)
        return std::nullopt;
    const auto number = [&](std::size_t at) {
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < 4; ++i)
            value |= std::uint32_t{bytes[at + i]} << (8 * i);
        return value;
    };
    ProbeControl probe{bytes[2], bytes[3], number(4), number(18), number(22), 0};
    if (bytes.size() >= 30)
        probe.clock_hz = number(26);
    if ((probe.max_payload_bytes & 0xffff0000) == 0xffff0000)
        probe.max_payload_bytes &= 0xffff; // some cameras sign-extend a 16-bit number
    return probe;
}

std::size_t exact_frame_bytes(Encoding encoding, std::uint32_t width, std::uint32_t height) {
    const std::size_t pixels = std::size_t{width} * height;
    return encoding == Encoding::yuy2 ? 2 * pixels : encoding == Encoding::nv12 ? pixels / 2 * 3 : 0;
}

std::size_t max_frame_bytes(const Format &format, const FrameSize &frame, std::uint32_t stated) {
    if (const std::size_t exact = exact_frame_bytes(format.encoding, frame.width, frame.height))
        return exact;
    const std::size_t pixels = std::size_t{frame.width} * frame.height;
    return std::clamp<std::size_t>(std::max(stated, frame.max_bytes), pixels / 2 + 65536, 3 * pixels + 65536);
}

const AlternateSetting *choose_alternate(const StreamingInterface &stream, std::uint32_t payload_bytes) {
    const AlternateSetting *best = nullptr;
    for (const AlternateSetting &alternate : stream.alternates)
        if ((alternate.is_bulk || alternate.payload_bytes >= payload_bytes) &&
            (!best || alternate.payload_bytes < best->payload_bytes))
            best = &alternate;
    return best;
}

} // namespace arhost::uvc
