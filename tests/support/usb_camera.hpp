// SPDX-License-Identifier: Apache-2.0
//
// A USB camera in user space, attached through the kernel's module vhci_hcd (USB/IP), for tests in a virtual machine
// (tools/vm/run-in-vm -m vhci_hcd). The kernel and its drivers see a high-speed device.
#pragma once

#include "usb_camera_layouts.hpp"

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace arhost::test {

// A control of a unit or terminal: its values as the camera sends them.
struct CameraControl {
    Octets current, minimum, maximum, resolution;
    std::uint8_t info = 3; // GET_INFO: can be read and set
};

class UsbCamera {
public:
    static constexpr std::uint16_t vendor = 0x1d6b, product = 0x0104;
    static constexpr std::uint16_t width = 320, height = 180;
    static constexpr std::uint8_t terminal = 1, processing = 2, extension = 4; // IDs

    struct Setup {
        bool is_bulk = false;
        std::uint16_t frame_width = width, frame_height = height; // even
        std::string serial = "0001";
        std::uint16_t version = 0x0110; // of the video class
        bool is_silent = false;         // sends no frames
        bool is_depth = false;          // delivers depth only
        std::int64_t interval_ns = 33'333'300;
    };
    enum class Fault { none, marked, shortened, malformed };

    // Connects the camera. Throws std::runtime_error.
    explicit UsbCamera(const Setup &setup);
    ~UsbCamera(); // unplugs it
    UsbCamera(const UsbCamera &) = delete;
    UsbCamera &operator=(const UsbCamera &) = delete;

    // The next frame has this fault.
    void inject(Fault fault);
    Octets value(std::uint8_t unit, std::uint8_t selector);
    void change(std::uint8_t unit, std::uint8_t selector, const std::function<void(CameraControl &)> &change);

    // The picture of a frame in YUY2 or NV12. Its first four bytes have the number of the frame.
    static Octets picture(std::uint32_t number, bool is_nv12, std::size_t pixels = std::size_t{width} * height);
    // When the camera began to send a frame, in ns of CLOCK_MONOTONIC.
    std::int64_t sent_ns(std::uint32_t number);
    // Mean luma of the picture of a frame in MJPEG.
    static int luma_of(std::uint32_t number) { return 40 + 10 * static_cast<int>(number % 16); }

private:
    using Key = std::pair<std::uint8_t, std::uint8_t>; // unit or interface, and selector
    struct Request {
        std::uint32_t sequence;
        std::size_t length;
        std::uint32_t start_frame;
        std::vector<std::pair<std::uint32_t, std::uint32_t>> packets; // offset and length, isochronous only
    };
    void attach(int socket) const;
    void serve();
    void serve_request(std::uint32_t sequence, bool is_input, std::size_t length, const Octets &setup,
                       const Octets &data);
    std::optional<Octets> answer(const Octets &setup, const Octets &data);
    std::optional<Octets> answer_class(const Octets &setup, const Octets &data);
    void stream();
    Octets next_payload(std::size_t limit);
    Octets make_frame();
    void reply(std::uint32_t sequence, int status, const Octets &data, std::size_t length,
               const Request *request = nullptr, const Octets &packets = {});
    bool receive(void *to, std::size_t size) const;

    const Setup setup_;
    Octets configuration_, probe_;
    std::vector<Octets> jpegs_;
    int socket_ = -1, kernel_end_ = -1;
    std::thread server_, streamer_;

    std::mutex send_mutex_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Request> waiting_;
    std::optional<std::uint32_t> in_progress_; // of the requests of the stream
    bool ended_ = false;
    bool restarts_frame_ = false;
    std::uint8_t format_ = 1;
    Fault fault_ = Fault::none;
    std::map<Key, CameraControl> controls_;
    std::map<std::uint32_t, std::int64_t> sent_ns_; // by number of the frame

    // used by the stream's thread only
    Octets frame_;
    std::size_t offset_ = 0;
    std::uint32_t number_ = 0;
    bool frame_id_ = false;
    Fault frame_fault_ = Fault::none;
    std::int64_t due_ns_ = 0;
};

} // namespace arhost::test
