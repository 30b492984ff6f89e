// SPDX-License-Identifier: Apache-2.0
#include "usb_camera.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <turbojpeg.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace arhost::test {
namespace {

constexpr std::uint32_t clock_hz = 48'000'000;
constexpr std::size_t bulk_payload = 16384, packet = 1024;
enum Format : std::uint8_t { yuy2 = 1, nv12 = 2, mjpeg = 3 };

std::int64_t now_ns() {
    return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}
std::uint32_t ticks_at(std::int64_t ns) {
    return static_cast<std::uint32_t>(ns / 1000 * (clock_hz / 1'000'000));
}

Octets number(std::int64_t value, int size) {
    Octets bytes;
    put_number(bytes, static_cast<std::uint32_t>(value), size);
    return bytes;
}

CameraControl control(int size, std::int64_t current, std::int64_t minimum, std::int64_t maximum,
                      std::int64_t resolution = 1) {
    return {number(current, size), number(minimum, size), number(maximum, size), number(resolution, size)};
}

std::uint32_t interval_of(const UsbCamera::Setup &setup) { // in units of 100 ns
    return static_cast<std::uint32_t>(setup.interval_ns / 100);
}

Octets configuration_for(const UsbCamera::Setup &setup) {
    const std::vector<FrameRow> sizes = {{setup.frame_width, setup.frame_height, {interval_of(setup)}}};
    const AlternateRow alternate = {static_cast<std::uint16_t>(setup.is_bulk ? 512 : packet), setup.is_bulk};
    // The controls: exposure mode and time, focus, pan and tilt, automatic focus; brightness, white balance, gain,
    // power-line frequency, automatic white balance.
    FunctionRow function = {0, setup.version, clock_hz, 0x2082a, 0x1641, {UsbCamera::extension}, {}};
    function.streams = {{1, {{"YUY2", sizes}, {"NV12", sizes}, {"MJPEG", sizes}}, {alternate}}};
    if (setup.is_depth)
        function.streams.front().formats = {{"INVZ", sizes}};
    function.has_status_endpoint = false;
    return configuration_of({"", {function}});
}

Octets string_descriptor(const std::string &text) {
    Octets bytes = {static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
    for (const char c : text)
        put(bytes, {static_cast<std::uint8_t>(c), 0});
    return bytes;
}

Octets make_jpeg(const UsbCamera::Setup &setup, int luma) {
    const Octets pixels(std::size_t{setup.frame_width} * setup.frame_height * 3, static_cast<std::uint8_t>(luma));
    const tjhandle handle = tjInitCompress();
    unsigned char *data = nullptr;
    unsigned long size = 0;
    if (tjCompress2(handle, pixels.data(), setup.frame_width, 0, setup.frame_height, TJPF_BGR, &data, &size,
                    TJSAMP_422, 90, 0) != 0)
        throw std::runtime_error("tjCompress2");
    const Octets jpeg(data, data + size);
    tjFree(data);
    tjDestroy(handle);
    return jpeg;
}

void put_big(Octets &bytes, std::initializer_list<std::uint32_t> values) {
    for (const std::uint32_t value : values)
        for (int shift = 24; shift >= 0; shift -= 8)
            bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

} // namespace

UsbCamera::UsbCamera(const Setup &setup) : setup_(setup), configuration_(configuration_for(setup)) {
    for (std::uint32_t i = 0; i < 16; ++i)
        jpegs_.push_back(make_jpeg(setup, luma_of(i)));
    probe_.resize(setup.version >= 0x0150 ? 48 : setup.version >= 0x0110 ? 34 : 26);
    controls_[{terminal, 0x02}] = control(1, 8, 0, 0, 0x09); // manual or aperture priority
    controls_[{terminal, 0x04}] = control(4, 250, 3, 2047);
    controls_[{terminal, 0x06}] = control(2, 30, 0, 250, 5);
    controls_[{terminal, 0x08}] = control(1, 1, 0, 1);
    controls_[{terminal, 0x0d}] = {{0, 0, 0, 0, 0, 0, 0, 0},
                                   {0xf0, 0xff, 0xff, 0xff, 0xf0, 0xff, 0xff, 0xff},
                                   {16, 0, 0, 0, 16, 0, 0, 0},
                                   {1, 0, 0, 0, 1, 0, 0, 0}};
    controls_[{processing, 0x02}] = control(2, 0, -64, 64);
    controls_[{processing, 0x04}] = control(2, 0, 0, 100);
    controls_[{processing, 0x05}] = control(1, 1, 0, 2);
    controls_[{processing, 0x0a}] = control(2, 4600, 2800, 6500, 10);
    controls_[{processing, 0x0b}] = control(1, 1, 0, 1);
    controls_[{extension, 2}] = {{1, 2, 3}, {0, 0, 0}, {255, 255, 255}, {1, 1, 1}};

    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
        throw std::runtime_error("socketpair");
    socket_ = ends[0];
    kernel_end_ = ends[1];
    const int buffer = 1 << 20;
    for (const int end : ends)
        setsockopt(end, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
    attach(kernel_end_);
    server_ = std::thread([this] { serve(); });
    streamer_ = std::thread([this] { stream(); });
}

UsbCamera::~UsbCamera() {
    shutdown(socket_, SHUT_RDWR);
    server_.join();
    streamer_.join();
    close(socket_);
    close(kernel_end_);
}

void UsbCamera::attach(int socket) const {
    constexpr int high_speed = 3, ports = 8, device_number = 1;
    // The port of a camera that was unplugged is free only a little later.
    for (int i = 0; i < 100; ++i) {
        for (int port = 0; port < ports; ++port) {
            const int file = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY | O_CLOEXEC);
            if (file < 0)
                throw std::runtime_error(
                    "vhci_hcd is not loaded: run this program with tools/vm/run-in-vm -m vhci_hcd");
            const std::string text = std::to_string(port) + " " + std::to_string(socket) + " " +
                                     std::to_string(device_number) + " " + std::to_string(high_speed);
            const bool is_attached = write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
            close(file);
            if (is_attached)
                return;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    throw std::runtime_error("no port of vhci_hcd is free");
}

void UsbCamera::inject(Fault fault) {
    const std::lock_guard lock(mutex_);
    fault_ = fault;
}

Octets UsbCamera::value(std::uint8_t unit, std::uint8_t selector) {
    const std::lock_guard lock(mutex_);
    return controls_.at({unit, selector}).current;
}

void UsbCamera::change(std::uint8_t unit, std::uint8_t selector, const std::function<void(CameraControl &)> &change) {
    const std::lock_guard lock(mutex_);
    change(controls_.at({unit, selector}));
}

std::int64_t UsbCamera::sent_ns(std::uint32_t number) {
    const std::lock_guard lock(mutex_);
    return sent_ns_.at(number);
}

Octets UsbCamera::picture(std::uint32_t number, bool is_nv12, std::size_t pixels) {
    Octets bytes(is_nv12 ? pixels * 3 / 2 : 2 * pixels);
    for (std::size_t i = 4; i < bytes.size(); ++i)
        bytes[i] = static_cast<std::uint8_t>(number + i % 251);
    for (std::size_t i = 0; i < 4; ++i)
        bytes[i] = static_cast<std::uint8_t>(number >> (8 * i));
    return bytes;
}

bool UsbCamera::receive(void *to, std::size_t size) const {
    return size == 0 || recv(socket_, to, size, MSG_WAITALL) == static_cast<ssize_t>(size);
}

// Answers the kernel's requests. The messages are described in the kernel's documentation, "USB/IP protocol".
void UsbCamera::serve() {
    constexpr std::uint32_t submit = 1, unlink = 2, unlinked = 4;
    std::array<std::uint32_t, 10> header{};
    Octets setup(8);
    const auto word = [&](std::size_t i) { return ntohl(header[i]); };
    while (receive(header.data(), sizeof header) && receive(setup.data(), setup.size())) {
        const std::uint32_t sequence = word(1), endpoint = word(4);
        const bool is_input = word(3) == 1;
        if (word(0) == unlink) {
            std::unique_lock lock(mutex_);
            // A reply after that of the unlinking would confuse the kernel.
            changed_.wait(lock, [&] { return in_progress_ != word(5); });
            const std::size_t removed =
                std::erase_if(waiting_, [&](const Request &request) { return request.sequence == word(5); });
            lock.unlock();
            Octets message;
            put_big(message, {unlinked, sequence, 0, 0, 0, removed ? static_cast<std::uint32_t>(-ECONNRESET) : 0});
            message.resize(48);
            const std::lock_guard send_lock(send_mutex_);
            (void)!send(socket_, message.data(), message.size(), MSG_NOSIGNAL);
            continue;
        }
        if (word(0) != submit)
            break;
        const std::size_t length = word(6);
        Octets data(is_input ? 0 : length);
        if (!receive(data.data(), data.size()))
            break;
        Request request{sequence, length, word(7), {}};
        const std::uint32_t packets = endpoint == 0 || word(8) == ~0u ? 0 : word(8);
        for (std::uint32_t i = 0; i < packets; ++i) {
            std::array<std::uint32_t, 4> described{};
            if (!receive(described.data(), sizeof described))
                break;
            request.packets.emplace_back(ntohl(described[0]), ntohl(described[1]));
        }
        if (endpoint == 0) {
            serve_request(sequence, is_input, length, setup, data);
            continue;
        }
        const std::lock_guard lock(mutex_);
        waiting_.push_back(std::move(request));
        changed_.notify_all();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
}

void UsbCamera::reply(std::uint32_t sequence, int status, const Octets &data, std::size_t length,
                      const Request *request, const Octets &packets) {
    constexpr std::uint32_t submitted = 3;
    Octets message;
    put_big(message, {submitted, sequence, 0, 0, 0, static_cast<std::uint32_t>(status),
                      static_cast<std::uint32_t>(length), request ? request->start_frame : 0,
                      request ? static_cast<std::uint32_t>(request->packets.size()) : 0, 0});
    message.resize(48);
    message.insert(message.end(), data.begin(), data.end());
    message.insert(message.end(), packets.begin(), packets.end());
    const std::lock_guard lock(send_mutex_);
    for (std::size_t sent = 0; sent < message.size();) {
        const ssize_t size = send(socket_, message.data() + sent, message.size() - sent, MSG_NOSIGNAL);
        if (size <= 0)
            return;
        sent += static_cast<std::size_t>(size);
    }
}

void UsbCamera::serve_request(std::uint32_t sequence, bool is_input, std::size_t length, const Octets &setup,
                              const Octets &data) {
    std::optional<Octets> answered = answer(setup, data);
    if (!answered)
        return reply(sequence, -EPIPE, {}, 0);
    if (!is_input)
        return reply(sequence, 0, {}, length);
    answered->resize(std::min(answered->size(), length));
    reply(sequence, 0, *answered, answered->size());
}

std::optional<Octets> UsbCamera::answer(const Octets &setup, const Octets &data) {
    constexpr std::uint8_t get_status = 0, get_descriptor = 6, get_configuration = 8, get_interface = 10,
                           set_interface = 11;
    const std::uint8_t request = setup[1], value_low = setup[2], value_high = setup[3];
    if ((setup[0] & 0x60) == 0x20)
        return answer_class(setup, data);
    if (!(setup[0] & 0x80)) {
        const std::lock_guard lock(mutex_);
        restarts_frame_ = restarts_frame_ || request == set_interface;
        return Octets{};
    }
    if (request == get_status)
        return Octets{0, 0};
    if (request == get_configuration)
        return Octets{1};
    if (request == get_interface)
        return Octets{0};
    if (request != get_descriptor)
        return std::nullopt;
    if (value_high == 1) {
        Octets device = {18, 1, 0, 2, 0xef, 2, 1, 64};
        put_number(device, vendor, 2);
        put_number(device, product, 2);
        put(device, {0, 1, 1, 2, 3, 1});
        return device;
    }
    if (value_high == 2)
        return configuration_;
    const std::array<std::string, 4> strings = {"", "arhost", "arhost test camera", setup_.serial};
    if (value_high != 3 || value_low >= strings.size())
        return std::nullopt;
    return value_low == 0 ? Octets{4, 3, 9, 4} : string_descriptor(strings[value_low]);
}

std::optional<Octets> UsbCamera::answer_class(const Octets &setup, const Octets &data) {
    constexpr std::uint8_t set_current = 0x01, get_current = 0x81, get_minimum = 0x82, get_maximum = 0x83,
                           get_resolution = 0x84, get_length = 0x85, get_info = 0x86;
    constexpr std::uint8_t probe = 1, commit = 2, streaming_interface = 1;
    const std::uint8_t request = setup[1], selector = setup[3], interface = setup[4], unit = setup[5];
    const std::lock_guard lock(mutex_);
    if (unit == 0 && interface == streaming_interface && (selector == probe || selector == commit)) {
        if (request == get_length)
            return number(static_cast<std::int64_t>(probe_.size()), 2);
        if (request == get_info)
            return Octets{3};
        if (request != set_current)
            return probe_;
        std::copy_n(data.begin(), std::min(data.size(), probe_.size()), probe_.begin());
        const std::uint8_t format =
            setup_.is_depth ? std::uint8_t{yuy2} : std::clamp<std::uint8_t>(probe_[2], yuy2, mjpeg);
        const auto replace = [&](std::size_t at, std::int64_t value) {
            const Octets bytes = number(value, 4);
            std::copy(bytes.begin(), bytes.end(), probe_.begin() + static_cast<std::ptrdiff_t>(at));
        };
        probe_[2] = format;
        probe_[3] = 1;
        replace(4, interval_of(setup_));
        replace(18, std::int64_t{2} * setup_.frame_width * setup_.frame_height);
        replace(22, static_cast<std::int64_t>(setup_.is_bulk ? bulk_payload : packet));
        if (probe_.size() >= 30)
            replace(26, clock_hz);
        if (selector == commit) {
            format_ = format;
            restarts_frame_ = true;
        }
        return Octets{};
    }
    const auto found = controls_.find({unit, selector});
    if (found == controls_.end())
        return std::nullopt;
    CameraControl &control = found->second;
    switch (request) {
    case set_current:
        if (!(control.info & 2) || data.size() != control.current.size())
            return std::nullopt;
        control.current = data;
        return Octets{};
    case get_current:
        return control.current;
    case get_minimum:
        return control.minimum;
    case get_maximum:
        return control.maximum;
    case get_resolution:
        return control.resolution;
    case get_length:
        return number(static_cast<std::int64_t>(control.current.size()), 2);
    case get_info:
        return Octets{control.info};
    default: // GET_DEF
        return control.current;
    }
}

Octets UsbCamera::make_frame() {
    return format_ == mjpeg
               ? jpegs_[number_ % jpegs_.size()]
               : picture(number_, format_ == nv12, std::size_t{setup_.frame_width} * setup_.frame_height);
}

// Returns a payload of at most `limit` bytes; an empty one if no frame is due.
Octets UsbCamera::next_payload(std::size_t limit) {
    const std::int64_t now = now_ns();
    {
        const std::lock_guard lock(mutex_);
        if (std::exchange(restarts_frame_, false)) {
            offset_ = 0;
            frame_id_ = !frame_id_;
        }
        if (offset_ == 0) {
            if (now < due_ns_ || setup_.is_silent)
                return {};
            due_ns_ = std::max(due_ns_ + setup_.interval_ns, now - 3 * setup_.interval_ns);
            sent_ns_[number_] = now;
            frame_ = make_frame();
            frame_fault_ = std::exchange(fault_, Fault::none);
            if (frame_fault_ == Fault::shortened)
                frame_.resize(frame_.size() / 2);
        }
    }
    constexpr std::size_t header_size = 12;
    const std::size_t size = std::min(limit - header_size, frame_.size() - offset_);
    const bool is_last = offset_ + size == frame_.size();
    const unsigned error = frame_fault_ == Fault::marked ? 0x40 : 0;
    Octets payload = {header_size, static_cast<std::uint8_t>(0x8c | error | (is_last ? 2 : 0) | (frame_id_ ? 1 : 0))};
    put_number(payload, ticks_at(due_ns_ - setup_.interval_ns), 4);
    put_number(payload, ticks_at(now), 4);
    put_number(payload, 0, 2);
    if (frame_fault_ == Fault::malformed && offset_ > 0)
        payload[0] = 1;
    payload.insert(payload.end(), frame_.begin() + static_cast<std::ptrdiff_t>(offset_),
                   frame_.begin() + static_cast<std::ptrdiff_t>(offset_ + size));
    offset_ += size;
    if (is_last) {
        offset_ = 0;
        frame_id_ = !frame_id_;
        ++number_;
    }
    return payload;
}

void UsbCamera::stream() {
    for (;;) {
        Request request;
        {
            std::unique_lock lock(mutex_);
            in_progress_.reset();
            changed_.notify_all();
            changed_.wait(lock, [&] { return ended_ || !waiting_.empty(); });
            if (ended_)
                return;
            request = std::move(waiting_.front());
            waiting_.pop_front();
            in_progress_ = request.sequence;
        }
        if (setup_.is_bulk) {
            Octets payload;
            const auto is_cancelled = [&] {
                const std::lock_guard lock(mutex_);
                return ended_;
            };
            // A camera without frames keeps the request until it is unlinked; here it ends with no data.
            for (int i = 0; i < 100 && payload.empty() && !is_cancelled(); ++i) {
                payload = next_payload(std::min(bulk_payload, request.length));
                if (payload.empty())
                    std::this_thread::sleep_for(std::chrono::milliseconds(1));
            }
            reply(request.sequence, 0, payload, payload.size());
            continue;
        }
        Octets data, packets;
        for (const auto &[offset, length] : request.packets) {
            const Octets payload = next_payload(std::min<std::size_t>(length, packet));
            data.insert(data.end(), payload.begin(), payload.end());
            put_big(packets, {offset, length, static_cast<std::uint32_t>(payload.size()), 0});
        }
        if (data.empty())
            std::this_thread::sleep_for(std::chrono::milliseconds(4)); // as long as 32 microframes take
        reply(request.sequence, 0, data, data.size(), &request, packets);
    }
}

} // namespace arhost::test
