// SPDX-License-Identifier: Apache-2.0
//
// A bare capture loop with the same copies as a worker with source_uvc: payloads are assembled to a frame, which is
// copied or decoded once, and a grey plane is made of YUYV and BGR. Prints its CPU time per frame in ms:
//   bench-usb-capture yuyv|nv12|mjpeg WIDTH HEIGHT FPS FRAMES
// Captures from bench-usb-camera, so that it does not read descriptors.
#include "bare_loop.hpp"

#include <libusb.h>
#include <turbojpeg.h>

#include <algorithm>
#include <memory>
#include <string>

namespace {

constexpr std::uint16_t vendor = 0x1d6b, product = 0x0104;
constexpr std::uint8_t stream_interface = 1, endpoint = 0x81;
constexpr int transfers = 5, packets = 32, packet_bytes = 1024; // as source_uvc uses

void require(bool condition, const char *what) {
    if (condition)
        return;
    std::fprintf(stderr, "bench-usb-capture: %s failed\n", what);
    std::exit(1);
}

struct Loop {
    arhost::bench::Slots slots;
    arhost::bench::Measurement measurement;
    bool is_jpeg;
    std::vector<std::uint8_t> frame; // as long as the largest frame
    tjhandle decoder = tjInitDecompress();
    std::size_t size = 0;
    bool is_running = true;

    void add_payload(const std::uint8_t *payload, std::size_t bytes) {
        constexpr unsigned end_of_frame = 2;
        const std::size_t header = payload[0], data = std::min(bytes - header, frame.size() - size);
        std::memcpy(frame.data() + size, payload + header, data);
        size += data;
        if (payload[1] & end_of_frame)
            finish_frame();
    }
    void finish_frame() {
        const arhost_frame_format &format = slots.format();
        const auto width = static_cast<int>(format.width), height = static_cast<int>(format.height);
        const std::size_t pixels = std::size_t{format.width} * format.height;
        if (is_jpeg) {
            require(tjDecompress2(decoder, frame.data(), size, slots.plane(0), width,
                                  static_cast<int>(format.stride[0]), height, TJPF_BGR, 0) == 0,
                    "decoding");
        } else if (format.pixel_format == ARHOST_PIXEL_FORMAT_YUYV) {
            slots.copy_rows(0, frame.data(), 2 * std::size_t{format.width}, format.height);
        } else {
            slots.copy_rows(0, frame.data(), format.width, format.height);
            slots.copy_rows(1, frame.data() + pixels, format.width, format.height / 2);
        }
        slots.finish();
        size = 0;
        is_running = is_running && measurement.count_frame();
    }
};

void on_completion(libusb_transfer *transfer) {
    auto &loop = *static_cast<Loop *>(transfer->user_data);
    for (int i = 0; i < transfer->num_iso_packets; ++i)
        if (const libusb_iso_packet_descriptor &packet = transfer->iso_packet_desc[i]; packet.actual_length > 0)
            loop.add_payload(libusb_get_iso_packet_buffer_simple(transfer, static_cast<unsigned>(i)),
                             packet.actual_length);
    require(libusb_submit_transfer(transfer) == 0, "submitting a transfer");
}

void negotiate(libusb_device_handle *camera, std::uint8_t format, double fps) {
    constexpr std::uint16_t probe = 0x100, commit = 0x200;
    constexpr std::uint8_t set = 0x01, get = 0x81;
    std::vector<std::uint8_t> data(34);
    data[2] = format;
    data[3] = 1; // frame size
    const auto interval = static_cast<std::uint32_t>(10'000'000 / fps);
    for (std::size_t i = 0; i < 4; ++i)
        data[4 + i] = static_cast<std::uint8_t>(interval >> (8 * i));
    const auto transfer = [&](std::uint8_t type, std::uint8_t request, std::uint16_t selector) {
        require(libusb_control_transfer(camera, type, request, selector, stream_interface, data.data(),
                                        static_cast<std::uint16_t>(data.size()), 2000) > 0,
                "negotiating the format");
    };
    transfer(0x21, set, probe);
    transfer(0xa1, get, probe);
    transfer(0x21, set, commit);
}

} // namespace

int main(int count, char **arguments) {
    if (count != 6) {
        std::fprintf(stderr, "usage: bench-usb-capture yuyv|nv12|mjpeg WIDTH HEIGHT FPS FRAMES\n");
        return 2;
    }
    const std::string name = arguments[1];
    const auto width = static_cast<std::uint32_t>(std::atoi(arguments[2]));
    const auto height = static_cast<std::uint32_t>(std::atoi(arguments[3]));
    const std::uint8_t format = name == "yuyv" ? 1 : name == "nv12" ? 2 : 3;
    const arhost_pixel_format pixel_formats[] = {ARHOST_PIXEL_FORMAT_YUYV, ARHOST_PIXEL_FORMAT_NV12,
                                                 ARHOST_PIXEL_FORMAT_BGR8};
    require(libusb_init(nullptr) == 0, "libusb_init");
    libusb_device_handle *camera = libusb_open_device_with_vid_pid(nullptr, vendor, product);
    require(camera, "opening the camera");
    for (const int interface : {0, 1})
        require(libusb_claim_interface(camera, interface) == 0, "claiming an interface");
    negotiate(camera, format, std::atof(arguments[4]));
    require(libusb_set_interface_alt_setting(camera, stream_interface, 1) == 0, "selecting the alternate setting");
    Loop loop{{pixel_formats[format - 1], width, height},
              arhost::bench::Measurement(std::atoi(arguments[5])),
              format == 3,
              std::vector<std::uint8_t>(2 * std::size_t{width} * height)};
    std::vector<std::uint8_t> memory(std::size_t{transfers} * packets * packet_bytes);
    for (int i = 0; i < transfers; ++i) {
        libusb_transfer *transfer = libusb_alloc_transfer(packets);
        libusb_fill_iso_transfer(transfer, camera, endpoint, memory.data() + i * packets * packet_bytes,
                                 packets * packet_bytes, packets, on_completion, &loop, 0);
        libusb_set_iso_packet_lengths(transfer, packet_bytes);
        require(libusb_submit_transfer(transfer) == 0, "submitting a transfer");
    }
    while (loop.is_running)
        require(libusb_handle_events(nullptr) == 0, "libusb_handle_events");
    return 0;
}
