// SPDX-License-Identifier: Apache-2.0
#include "frame_stream.hpp"

#include <algorithm>
#include <ctime>

namespace arhost::uvc {
namespace {

constexpr std::size_t transfer_count = 5;
constexpr std::size_t max_bulk_transfer = std::size_t{256} << 10;
// The packets of an isochronous transfer are delivered together, so a small number keeps the latency low: 4 ms at
// high speed.
constexpr int max_packets = 32;
constexpr int max_failed_in_a_row = 200;

std::int64_t now_ns() {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * std::int64_t{1'000'000'000} + time.tv_nsec;
}

} // namespace

FrameStream::FrameStream(const UsbDevice &device, const Setup &setup)
    : device_(device), setup_(setup),
      assembler_(setup.max_frame_bytes, setup.exact_frame_bytes, [this](AssembledFrame &frame) { take(frame); }),
      times_(setup.clock_hz) {
    allocate();
    try {
        start();
    } catch (...) {
        stop();
        throw;
    }
}

FrameStream::~FrameStream() {
    stop();
}

void FrameStream::allocate() {
    const AlternateSetting &alternate = setup_.alternate;
    int packets = 0;
    std::size_t size = 0;
    if (alternate.is_bulk) {
        const std::size_t payload = std::max<std::size_t>(setup_.payload_bytes, alternate.packet_bytes);
        size = std::min((payload + alternate.packet_bytes - 1) / alternate.packet_bytes * alternate.packet_bytes,
                        max_bulk_transfer / alternate.packet_bytes * alternate.packet_bytes);
    } else {
        packets = static_cast<int>(
            std::clamp<std::size_t>(setup_.max_frame_bytes / alternate.payload_bytes, 1, std::size_t{max_packets}));
        size = static_cast<std::size_t>(packets) * alternate.payload_bytes;
    }
    for (std::size_t i = 0; i < transfer_count; ++i) {
        Transfer &added = transfers_.emplace_back();
        added.buffer.resize(size);
        added.transfer.reset(libusb_alloc_transfer(packets));
        if (!added.transfer)
            throw std::bad_alloc();
        const auto completed = [](libusb_transfer *transfer) {
            static_cast<FrameStream *>(transfer->user_data)->on_completion(transfer);
        };
        if (alternate.is_bulk) {
            libusb_fill_bulk_transfer(added.transfer.get(), device_.handle(), alternate.endpoint, added.buffer.data(),
                                      static_cast<int>(size), completed, this, 0);
        } else {
            libusb_fill_iso_transfer(added.transfer.get(), device_.handle(), alternate.endpoint, added.buffer.data(),
                                     static_cast<int>(size), packets, completed, this, 0);
            libusb_set_iso_packet_lengths(added.transfer.get(), alternate.payload_bytes);
        }
    }
}

void FrameStream::start() {
    if (!setup_.alternate.is_bulk || setup_.alternate.number != 0)
        device_.set_alternate(setup_.interface, setup_.alternate.number);
    for (const Transfer &transfer : transfers_) {
        if (const int error = libusb_submit_transfer(transfer.transfer.get()))
            device_.fail("starting the stream", error);
        ++in_flight_;
    }
    thread_ = std::thread([this] { run(); });
}

void FrameStream::stop() {
    stopping_ = true;
    if (thread_.joinable())
        thread_.join();
    else
        run();
    // Both calls fail if the camera is lost.
    if (!setup_.alternate.is_bulk)
        libusb_set_interface_alt_setting(device_.handle(), setup_.interface, 0);
    else
        libusb_clear_halt(device_.handle(), setup_.alternate.endpoint);
}

// Handles events until the stream is stopped and no transfer is in flight, because the kernel must not write to the
// buffers after they are freed.
void FrameStream::run() noexcept {
    bool is_cancelled = false;
    while (!stopping_ || in_flight_ > 0) {
        if (stopping_ && !is_cancelled) {
            for (const Transfer &transfer : transfers_)
                libusb_cancel_transfer(transfer.transfer.get()); // fails for transfers that are not in flight
            is_cancelled = true;
        }
        timeval timeout{0, 50'000};
        if (const int error = libusb_handle_events_timeout_completed(device_.context(), &timeout, nullptr);
            error && error != LIBUSB_ERROR_INTERRUPTED) {
            const std::lock_guard lock(mutex_);
            error_ = error_ ? error_ : error;
            changed_.notify_one();
        }
    }
}

void FrameStream::on_completion(libusb_transfer *transfer) noexcept {
    --in_flight_;
    if (stopping_)
        return;
    int error = 0;
    try {
        const std::int64_t arrival_ns = now_ns();
        if (transfer->status == LIBUSB_TRANSFER_COMPLETED) {
            failed_in_a_row_ = 0;
            if (setup_.alternate.is_bulk)
                add_bulk(transfer, arrival_ns);
            else
                add_isochronous(transfer, arrival_ns);
        } else if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) {
            error = LIBUSB_ERROR_NO_DEVICE;
        } else {
            assembler_.lose_packet();
            if (++failed_in_a_row_ > max_failed_in_a_row)
                error = transfer->status == LIBUSB_TRANSFER_STALL ? LIBUSB_ERROR_PIPE : LIBUSB_ERROR_IO;
        }
        if (!error && !(error = libusb_submit_transfer(transfer)))
            ++in_flight_;
    } catch (const std::exception &) {
        error = LIBUSB_ERROR_NO_MEM;
    }
    if (error) {
        const std::lock_guard lock(mutex_);
        error_ = error_ ? error_ : error;
        changed_.notify_one();
    }
}

void FrameStream::add_isochronous(libusb_transfer *transfer, std::int64_t arrival_ns) {
    for (int i = 0; i < transfer->num_iso_packets; ++i) {
        const libusb_iso_packet_descriptor &packet = transfer->iso_packet_desc[i];
        if (packet.status != LIBUSB_TRANSFER_COMPLETED)
            assembler_.lose_packet();
        else if (packet.actual_length > 0)
            assembler_.add_payload({libusb_get_iso_packet_buffer_simple(transfer, static_cast<unsigned>(i)),
                                    std::min(packet.actual_length, packet.length)},
                                   arrival_ns);
    }
}

// Adds bytes of a payload. A payload ends with a transfer that is not full, or when it reaches its maximum size.
void FrameStream::add_bulk(libusb_transfer *transfer, std::int64_t arrival_ns) {
    const auto size = static_cast<std::size_t>(std::clamp(transfer->actual_length, 0, transfer->length));
    bulk_payload_bytes_ += size;
    const bool ends =
        size < static_cast<std::size_t>(transfer->length) || bulk_payload_bytes_ >= setup_.payload_bytes;
    if (ends)
        bulk_payload_bytes_ = 0;
    assembler_.add_bulk({transfer->buffer, size}, ends, arrival_ns);
}

void FrameStream::take(AssembledFrame &frame) {
    if (frame.clock_ticks)
        times_.add_clock(*frame.clock_ticks, frame.clock_arrival_ns);
    const std::int64_t capture_ns = times_.time_of(frame.presentation_ticks, frame.arrival_ns);
    const std::lock_guard lock(mutex_);
    if (frame.damage != Damage::none) {
        losses_.count(frame.damage);
        ++lost_;
        return;
    }
    if (frames_.size() >= setup_.queue_length) {
        ++losses_.superseded;
        if (!setup_.keeps_newest) {
            ++lost_;
            return;
        }
        const std::uint32_t lost = frames_.front().lost_before + 1;
        unused_.push_back(std::move(frames_.front().bytes));
        frames_.pop_front();
        (frames_.empty() ? lost_ : frames_.front().lost_before) += lost;
    }
    CapturedFrame &added = frames_.emplace_back();
    added.capture_ns = capture_ns;
    added.lost_before = std::exchange(lost_, 0);
    std::swap(added.bytes, frame.bytes);
    if (!unused_.empty()) {
        frame.bytes = std::move(unused_.back());
        unused_.pop_back();
    }
    frame.bytes.reserve(setup_.max_frame_bytes);
    changed_.notify_one();
}

std::optional<CapturedFrame> FrameStream::next(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [&] { return !frames_.empty() || error_; });
    if (frames_.empty() && error_ == LIBUSB_ERROR_NO_DEVICE)
        device_.fail("capturing", error_);
    if (frames_.empty() && error_)
        throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST,
                      device_.name() + " has stopped streaming: " + libusb_strerror(error_));
    if (frames_.empty())
        return std::nullopt;
    CapturedFrame frame = std::move(frames_.front());
    frames_.pop_front();
    return frame;
}

bool FrameStream::has_more() const {
    const std::lock_guard lock(mutex_);
    return !frames_.empty();
}

void FrameStream::recycle(CapturedFrame &&frame) {
    const std::lock_guard lock(mutex_);
    unused_.push_back(std::move(frame.bytes));
}

Losses FrameStream::losses() const {
    const std::lock_guard lock(mutex_);
    return losses_;
}

} // namespace arhost::uvc
