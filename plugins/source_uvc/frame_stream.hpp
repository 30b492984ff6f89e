// SPDX-License-Identifier: Apache-2.0
//
// The stream of frames of a USB camera: a thread that keeps transfers in flight and assembles frames.
#pragma once

#include "clock.hpp"
#include "negotiation.hpp"
#include "payload.hpp"
#include "usb.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

namespace arhost::uvc {

struct CapturedFrame {
    std::vector<std::uint8_t> bytes;
    std::int64_t capture_ns = 0;
    std::uint32_t lost_before = 0; // frames that were damaged or discarded since the previous frame
};

class FrameStream {
public:
    struct Setup {
        std::uint8_t interface = 0;
        AlternateSetting alternate;
        std::uint32_t payload_bytes = 0; // negotiated maximum
        std::size_t max_frame_bytes = 0, exact_frame_bytes = 0;
        std::uint32_t clock_hz = 0;
        std::size_t queue_length = 4; // maximum number of frames that wait to be read
        bool keeps_newest = false;    // if the queue is full, discards the oldest frame instead of the new one
    };

    // Selects the alternate setting and starts the stream. The device must outlive the stream, and its interface must
    // be claimed.
    FrameStream(const UsbDevice &device, const Setup &setup);
    ~FrameStream();
    FrameStream(const FrameStream &) = delete;
    FrameStream &operator=(const FrameStream &) = delete;

    // Returns the oldest frame. Waits for a frame; returns std::nullopt on timeout. Throws Failure if the camera is
    // lost.
    std::optional<CapturedFrame> next(std::chrono::milliseconds timeout);
    bool has_more() const;               // whether another frame can be read
    void recycle(CapturedFrame &&frame); // reuses the memory of the frame

    Losses losses() const;

private:
    struct FreeTransfer {
        void operator()(libusb_transfer *transfer) const { libusb_free_transfer(transfer); }
    };
    struct Transfer {
        std::vector<std::uint8_t> buffer;
        std::unique_ptr<libusb_transfer, FreeTransfer> transfer;
    };
    void allocate();
    void start();
    void stop();
    void run() noexcept;
    void on_completion(libusb_transfer *transfer) noexcept;
    void add_isochronous(libusb_transfer *transfer, std::int64_t arrival_ns);
    void add_bulk(libusb_transfer *transfer, std::int64_t arrival_ns);
    void take(AssembledFrame &frame);

    const UsbDevice &device_;
    const Setup setup_;
    std::vector<Transfer> transfers_;
    std::atomic<int> in_flight_{0};
    std::atomic<bool> stopping_{false};
    std::thread thread_;

    // Only the thread uses these members.
    FrameAssembler assembler_;
    CaptureTimes times_;
    std::size_t bulk_payload_bytes_ = 0; // size of the current payload so far
    int failed_in_a_row_ = 0;

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<CapturedFrame> frames_;
    std::vector<std::vector<std::uint8_t>> unused_; // buffers for frames
    Losses losses_;
    std::uint32_t lost_ = 0; // frames lost since the last frame in the queue
    int error_ = 0;          // libusb's error that has ended the stream
};

} // namespace arhost::uvc
