// SPDX-License-Identifier: Apache-2.0
#include "output_device.hpp"

#include "camera_common/fourcc.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>

namespace arhost {
namespace {

constexpr std::uint32_t buffer_count = 3;

bool is_gone(int error) {
    return error == ENOENT || error == ENODEV || error == ENXIO || error == ESHUTDOWN;
}

} // namespace

void OutputDevice::Unmap::operator()(std::uint8_t *address) const {
    munmap(address, size);
}

OutputDevice::OutputDevice(const std::string &path)
    : path_(path), fd_(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    const std::string start = "device: '" + path + "' ";
    if (fd_ < 0) {
        if (is_gone(errno))
            throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST,
                          start + "does not exist; create a virtual camera with 'modprobe v4l2loopback', or set "
                                  "'device' to another output node ('v4l2-ctl --list-devices' lists them)");
        if (errno == EACCES || errno == EPERM)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          start + "cannot be opened by this user: video devices belong to the group 'video' ('sudo "
                                  "usermod -aG video $USER', then log in again)");
        fail("opening it", errno);
    }
    try {
        v4l2_capability capability{};
        if (control(VIDIOC_QUERYCAP, &capability) != 0)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, start + "is not a video device");
        card_ = reinterpret_cast<const char *>(capability.card);
        capabilities_ =
            capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps : capability.capabilities;
        if (!(capabilities_ & V4L2_CAP_VIDEO_OUTPUT))
            type_ = V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE;
        if (!(capabilities_ & (V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_VIDEO_OUTPUT_MPLANE)))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          start + "(" + card_ +
                              ") does not accept pictures; set 'device' to an output node, such as that of a "
                              "v4l2loopback device");
    } catch (...) {
        close(fd_);
        throw;
    }
}

OutputDevice::~OutputDevice() {
    buffers_.clear();
    close(fd_); // stops the stream and frees the driver's buffers
}

int OutputDevice::control(unsigned long request, void *argument) const {
    while (ioctl(fd_, request, argument) != 0)
        if (errno != EINTR)
            return errno;
    return 0;
}

void OutputDevice::fail(const std::string &what, int error) const {
    const std::string start = "the output device " + name() + " ";
    if (is_gone(error))
        throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, start + "has disappeared");
    if (error == EBUSY)
        throw Failure(ARHOST_STATUS_ERROR_IO, start + "is in use by another program ('fuser " + path_ +
                                                  "' shows which); close it, or set 'device' to another device");
    throw Failure(ARHOST_STATUS_ERROR_IO, start + "reported an error while " + what + ": " + std::strerror(error));
}

std::vector<std::uint32_t> OutputDevice::formats() const {
    std::vector<std::uint32_t> found;
    v4l2_fmtdesc description{};
    description.type = type_;
    for (; control(VIDIOC_ENUM_FMT, &description) == 0; ++description.index)
        found.push_back(description.pixelformat);
    return found;
}

bool OutputDevice::supports(Transfer transfer) const {
    return capabilities_ & (transfer == Transfer::write ? V4L2_CAP_READWRITE : V4L2_CAP_STREAMING);
}

OutputFormat OutputDevice::set_format(const OutputFormat &wanted) {
    v4l2_format format{};
    format.type = type_;
    const auto set = [&](auto &pixels) {
        pixels.width = wanted.width;
        pixels.height = wanted.height;
        pixels.pixelformat = wanted.fourcc;
        pixels.field = V4L2_FIELD_NONE;
        pixels.colorspace = wanted.colour_space;
        pixels.ycbcr_enc = wanted.ycbcr_encoding;
    };
    if (is_multiplanar()) {
        set(format.fmt.pix_mp);
        format.fmt.pix_mp.num_planes = 1;
    } else {
        set(format.fmt.pix);
    }
    if (const int error = control(VIDIOC_S_FMT, &format))
        fail("setting the format " + fourcc_text(wanted.fourcc), error);
    const auto chosen = [](const auto &pixels, std::uint32_t stride, std::uint32_t size) {
        return OutputFormat{pixels.pixelformat, pixels.width,    pixels.height, stride, size,
                            pixels.colorspace,  pixels.ycbcr_enc};
    };
    const v4l2_pix_format &single = format.fmt.pix;
    const v4l2_plane_pix_format &plane = format.fmt.pix_mp.plane_fmt[0];
    const OutputFormat set_to = is_multiplanar() ? chosen(format.fmt.pix_mp, plane.bytesperline, plane.sizeimage)
                                                 : chosen(single, single.bytesperline, single.sizeimage);
    image_size_ = set_to.image_size;
    return set_to;
}

double OutputDevice::set_fps(double fps) {
    v4l2_streamparm parameters{};
    parameters.type = type_;
    if (control(VIDIOC_G_PARM, &parameters) != 0)
        return 0;
    v4l2_fract &interval = parameters.parm.output.timeperframe;
    if (fps > 0 && parameters.parm.output.capability & V4L2_CAP_TIMEPERFRAME) {
        const v4l2_fract before = interval;
        interval = {1000, static_cast<std::uint32_t>(std::lround(fps * 1000))};
        if (control(VIDIOC_S_PARM, &parameters) != 0) // some drivers have a fixed rate in spite of the capability
            interval = before;
    }
    return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

void OutputDevice::prepare(Buffer &buffer, std::uint32_t index) const {
    buffer.info.type = type_;
    buffer.info.memory = V4L2_MEMORY_MMAP;
    buffer.info.field = V4L2_FIELD_NONE;
    buffer.info.index = index;
    if (!is_multiplanar())
        return;
    buffer.info.m.planes = &buffer.plane;
    buffer.info.length = 1;
}

void OutputDevice::map_buffers() {
    v4l2_requestbuffers request{};
    request.type = type_;
    request.memory = V4L2_MEMORY_MMAP;
    request.count = buffer_count;
    if (const int error = control(VIDIOC_REQBUFS, &request))
        fail("reserving buffers", error);
    for (std::uint32_t i = 0; i < request.count; ++i) {
        Buffer buffer;
        prepare(buffer, i);
        if (const int error = control(VIDIOC_QUERYBUF, &buffer.info))
            fail("querying a buffer", error);
        const std::size_t size = is_multiplanar() ? buffer.plane.length : buffer.info.length;
        if (size < image_size_)
            fail("reserving buffers, which are too small", EINVAL);
        const std::uint32_t offset = is_multiplanar() ? buffer.plane.m.mem_offset : buffer.info.m.offset;
        void *address = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, offset);
        if (address == MAP_FAILED)
            fail("mapping a buffer", errno);
        buffers_.push_back(Mapping(static_cast<std::uint8_t *>(address), Unmap{size}));
    }
}

bool OutputDevice::wait_until_writable(const Host &host) const {
    using Clock = std::chrono::steady_clock;
    constexpr auto limit = std::chrono::seconds(3); // shorter than the default of deadline_ms
    constexpr int timeout_ms = 50;
    for (const auto give_up = Clock::now() + limit; Clock::now() < give_up;) {
        if (host.cancelled())
            return false;
        pollfd ready{fd_, POLLOUT, 0};
        if (poll(&ready, 1, timeout_ms) <= 0)
            continue;
        if (ready.revents & POLLOUT)
            return true;
        std::uint32_t input = 0; // any request shows whether the device still exists
        if (const int error = control(VIDIOC_G_OUTPUT, &input); is_gone(error))
            fail("waiting", error);
        host.wait_until(Clock::now() + std::chrono::milliseconds(timeout_ms)); // poll(2) returns immediately
    }
    throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, "the output device " + name() + " has taken no picture for " +
                                                       std::to_string(limit.count()) + " s");
}

void OutputDevice::reserve(Transfer transfer) {
    transfer_ = transfer;
    if (transfer == Transfer::write)
        image_.resize(image_size_);
    else
        map_buffers();
}

std::span<std::uint8_t> OutputDevice::begin_image(const Host &host) {
    if (transfer_ == Transfer::write)
        return image_;
    if (queued_ < buffers_.size()) {
        current_ = queued_;
    } else {
        Buffer buffer;
        prepare(buffer, 0);
        for (int error = EAGAIN; error != 0;) {
            if (!wait_until_writable(host))
                return {};
            error = control(VIDIOC_DQBUF, &buffer.info);
            if (error != 0 && error != EAGAIN)
                fail("waiting for a buffer", error);
        }
        current_ = buffer.info.index;
    }
    return {buffers_[current_].get(), image_size_};
}

void OutputDevice::end_image(const Host &host) {
    if (transfer_ == Transfer::write) {
        for (;;) {
            const ssize_t written = ::write(fd_, image_.data(), image_.size());
            if (written == static_cast<ssize_t>(image_.size()))
                return;
            if (written >= 0)
                fail("writing a picture, of which it took only a part", EIO);
            if (errno != EAGAIN && errno != EINTR)
                fail("writing a picture", errno);
            if (!wait_until_writable(host))
                throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "writing to " + name() + " was cancelled");
        }
    }
    Buffer buffer;
    prepare(buffer, current_);
    (is_multiplanar() ? buffer.plane.bytesused : buffer.info.bytesused) = image_size_;
    if (const int error = control(VIDIOC_QBUF, &buffer.info))
        fail("queueing a buffer", error);
    if (queued_ < buffers_.size() && ++queued_ == 1) {
        int type = type_;
        if (const int error = control(VIDIOC_STREAMON, &type))
            fail("starting the stream", error);
    }
}

} // namespace arhost
