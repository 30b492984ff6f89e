// SPDX-License-Identifier: Apache-2.0
#include "device.hpp"

#include <fcntl.h>
#include <glob.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace arhost {

namespace {

// Lists the existing devices for a message: "/dev/video0 (Integrated Camera), /dev/video2".
std::string existing_devices() {
    std::string list;
    glob_t found{};
    if (glob("/dev/video*", 0, nullptr, &found) == 0)
        for (std::size_t i = 0; i < found.gl_pathc; ++i) {
            const std::filesystem::path node = found.gl_pathv[i];
            std::string card;
            std::getline(std::ifstream("/sys/class/video4linux" / node.filename() / "name"), card);
            list += (list.empty() ? "" : ", ") + node.string();
            if (!card.empty())
                list += " (" + card + ")";
        }
    globfree(&found);
    return list;
}

std::string other_devices() {
    const std::string existing = existing_devices();
    if (existing.empty())
        return "no /dev/video* exists; connect a camera, or use 'source_synthetic' or "
               "'source_file' instead";
    return "available: " + existing + "; set 'device' to one of them (list them with 'v4l2-ctl --list-devices')";
}

double rate(const v4l2_fract &interval) {
    return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

std::string size_text(std::uint32_t width, std::uint32_t height) {
    return std::to_string(width) + "×" + std::to_string(height);
}

std::string size_text(const CaptureSize &size) {
    std::string text = size_text(size.width, size.height);
    if (size.max_fps > 0) {
        char fps[32];
        std::snprintf(fps, sizeof fps, " %.4g fps", size.max_fps);
        text += fps;
    }
    return text;
}

int retried_ioctl(int fd, unsigned long request, void *argument) {
    while (ioctl(fd, request, argument) != 0)
        if (errno != EINTR)
            return errno;
    return 0;
}

double fastest(int fd, std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) {
    double fps = 0;
    v4l2_frmivalenum interval{};
    interval.pixel_format = fourcc;
    interval.width = width;
    interval.height = height;
    for (; retried_ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, &interval) == 0; ++interval.index) {
        if (interval.type != V4L2_FRMIVAL_TYPE_DISCRETE)
            return rate(interval.stepwise.min);
        fps = std::max(fps, rate(interval.discrete));
    }
    return fps;
}

std::vector<CaptureFormat> list_formats(int fd) {
    std::vector<CaptureFormat> formats;
    v4l2_fmtdesc description{};
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    for (; retried_ioctl(fd, VIDIOC_ENUM_FMT, &description) == 0; ++description.index) {
        CaptureFormat format;
        format.fourcc = description.pixelformat;
        const auto add = [&](std::uint32_t width, std::uint32_t height) {
            format.sizes.push_back({width, height, fastest(fd, format.fourcc, width, height)});
        };
        v4l2_frmsizeenum size{};
        size.pixel_format = format.fourcc;
        for (; retried_ioctl(fd, VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
            if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
                add(size.discrete.width, size.discrete.height);
                continue;
            }
            format.any_size = true;
            add(size.stepwise.min_width, size.stepwise.min_height);
            add(size.stepwise.max_width, size.stepwise.max_height);
            break;
        }
        formats.push_back(std::move(format));
    }
    return formats;
}

} // namespace

FileDescriptor::~FileDescriptor() {
    if (fd_ >= 0)
        close(fd_);
}

std::string fourcc_text(std::uint32_t fourcc) {
    std::string text;
    for (int i = 0; i < 4; ++i)
        text += static_cast<char>(fourcc >> (8 * i) & 0x7f);
    return text;
}

CaptureDevice::CaptureDevice(const std::string &path)
    : path_(path), fd_(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    if (fd_.get() < 0) {
        const int error = errno;
        const std::string start = "device: '" + path + "' ";
        if (error == ENOENT || error == ENODEV || error == ENXIO || error == ENOTDIR)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, start + "does not exist; " + other_devices());
        if (error == EACCES || error == EPERM)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          start + "cannot be opened by this user: cameras belong to the group 'video' ('sudo usermod "
                                  "-aG video $USER', then log in again)");
        if (error == EISDIR)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, start + "is a folder, not a camera; " + other_devices());
        fail("opening it", error);
    }
    v4l2_capability capability{};
    if (const int error = control(VIDIOC_QUERYCAP, &capability); error == ENODEV)
        fail("querying its capabilities", error);
    else if (error != 0)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "device: '" + path + "' is not a video device; " + other_devices());
    card_ = reinterpret_cast<const char *>(capability.card);
    const std::uint32_t able =
        capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps : capability.capabilities;
    if (!(able & V4L2_CAP_VIDEO_CAPTURE) || !(able & V4L2_CAP_STREAMING))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "device: '" + path + "' (" + card_ + ") does not capture pictures" +
                          (able & V4L2_CAP_META_CAPTURE ? " (it delivers metadata; the camera itself is "
                                                          "usually the node with the next lower number)"
                           : able & V4L2_CAP_VIDEO_CAPTURE_MPLANE
                               ? " in single-plane formats; multi-planar ones are unsupported"
                               : "") +
                          "; " + other_devices());
    formats_ = list_formats(fd_.get());
}

int CaptureDevice::control(unsigned long request, void *argument) const {
    return retried_ioctl(fd_.get(), request, argument);
}

void CaptureDevice::fail(const std::string &what, int error) const {
    const std::string start = "the camera '" + path_ + "'" + (card_.empty() ? "" : " (" + card_ + ")") + " ";
    if (error == ENODEV || error == ENXIO || error == ESHUTDOWN)
        throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, start + "has disappeared; was it unplugged?");
    if (error == EBUSY)
        throw Failure(ARHOST_STATUS_ERROR_IO, start + "is in use by another program ('fuser " + path_ +
                                                  "' shows which); close it, or set 'device' to another camera");
    if (error == ENOSPC)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      start + "gets too little bandwidth on its USB bus; choose a smaller size, 'format: mjpeg', or "
                              "another port");
    throw Failure(ARHOST_STATUS_ERROR_IO, start + "reported an error while " + what + ": " + std::strerror(error));
}

const CaptureFormat *CaptureDevice::find(std::uint32_t fourcc) const {
    const auto found = std::find_if(formats_.begin(), formats_.end(),
                                    [&](const CaptureFormat &format) { return format.fourcc == fourcc; });
    return found == formats_.end() ? nullptr : &*found;
}

double CaptureDevice::max_fps(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const {
    return fastest(fd_.get(), fourcc, width, height);
}

std::string CaptureDevice::describe_formats() const {
    std::string text;
    for (const CaptureFormat &format : formats_) {
        text += (text.empty() ? "" : ", ") + fourcc_text(format.fourcc);
        std::string sizes;
        for (const CaptureSize &size : format.sizes)
            sizes += (sizes.empty() ? "" : format.any_size ? " to " : ", ") + size_text(size);
        if (!sizes.empty())
            text += " (" + sizes + ")";
    }
    return text.empty() ? "nothing" : text;
}

std::string CaptureDevice::describe_sizes_near(const CaptureFormat &format, std::uint32_t width,
                                               std::uint32_t height) const {
    std::vector<CaptureSize> sizes = format.sizes;
    if (!format.any_size) {
        const auto distance = [&](const CaptureSize &size) {
            return std::hypot(static_cast<double>(size.width) - width, static_cast<double>(size.height) - height);
        };
        std::sort(sizes.begin(), sizes.end(),
                  [&](const CaptureSize &a, const CaptureSize &b) { return distance(a) < distance(b); });
        sizes.resize(std::min<std::size_t>(sizes.size(), 3));
    }
    std::string text;
    for (const CaptureSize &size : sizes)
        text += (text.empty() ? "" : format.any_size ? " to " : ", ") + size_text(size);
    return text;
}

v4l2_format CaptureDevice::current_format() const {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (const int error = control(VIDIOC_G_FMT, &format))
        fail("querying its format", error);
    return format;
}

v4l2_format CaptureDevice::set_format(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) {
    v4l2_format format = current_format();
    format.fmt.pix.width = width;
    format.fmt.pix.height = height;
    format.fmt.pix.pixelformat = fourcc;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    format.fmt.pix.bytesperline = 0; // the driver chooses it
    format.fmt.pix.sizeimage = 0;
    if (const int error = control(VIDIOC_S_FMT, &format))
        fail("setting the format " + fourcc_text(fourcc) + " " + size_text(width, height), error);
    return format;
}

double CaptureDevice::set_fps(double fps) {
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (control(VIDIOC_G_PARM, &parameters) != 0)
        return 0;
    v4l2_fract &interval = parameters.parm.capture.timeperframe;
    if (fps > 0 && parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) {
        interval = {1000, static_cast<std::uint32_t>(std::lround(fps * 1000))};
        if (const int error = control(VIDIOC_S_PARM, &parameters))
            fail("setting the frame rate", error);
    }
    return rate(interval);
}

CaptureStream::CaptureStream(const CaptureDevice &device, std::uint32_t buffer_count) : device_(device) {
    v4l2_requestbuffers request{};
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    request.count = buffer_count;
    if (const int error = device_.control(VIDIOC_REQBUFS, &request))
        device_.fail("reserving " + std::to_string(buffer_count) + " buffers", error);
    for (std::uint32_t i = 0; i < request.count; ++i) {
        v4l2_buffer buffer{};
        buffer.type = request.type;
        buffer.memory = request.memory;
        buffer.index = i;
        if (const int error = device_.control(VIDIOC_QUERYBUF, &buffer))
            device_.fail("querying a buffer", error);
        void *address =
            mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, device_.fd(), buffer.m.offset);
        if (address == MAP_FAILED)
            device_.fail("mapping a buffer", errno);
        mappings_.emplace_back(address, buffer.length);
    }
    for (std::uint32_t i = 0; i < mappings_.size(); ++i)
        queue(i);
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (const int error = device_.control(VIDIOC_STREAMON, &type))
        device_.fail("starting the stream", error);
}

CaptureStream::~CaptureStream() {
    // Both calls may fail after the camera was unplugged. In that case, closing the device frees the buffers.
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    device_.control(VIDIOC_STREAMOFF, &type);
    mappings_.clear(); // must happen before freeing the buffers
    v4l2_requestbuffers none{};
    none.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    none.memory = V4L2_MEMORY_MMAP;
    device_.control(VIDIOC_REQBUFS, &none);
}

CaptureStream::Mapping::~Mapping() {
    if (address)
        munmap(address, size);
}

void CaptureStream::queue(std::uint32_t index) const {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    if (const int error = device_.control(VIDIOC_QBUF, &buffer))
        device_.fail("queueing a buffer", error);
}

std::span<const std::uint8_t> CaptureStream::bytes(const v4l2_buffer &buffer) const {
    const Mapping &mapping = mappings_[buffer.index];
    return {static_cast<const std::uint8_t *>(mapping.address),
            std::min<std::size_t>(buffer.bytesused, mapping.size)};
}

std::optional<v4l2_buffer> CaptureStream::dequeue() const {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    const int error = device_.control(VIDIOC_DQBUF, &buffer);
    if (error == EAGAIN)
        return std::nullopt;
    if (error == EIO)
        fail_stopped();
    if (error != 0)
        device_.fail("capturing", error);
    if (buffer.index >= mappings_.size())
        device_.fail("capturing (the driver returned an invalid buffer index)", EPROTO);
    return buffer;
}

void CaptureStream::fail_stopped() const {
    throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, "the driver of the camera '" + device_.path() + "' (" +
                                                       device_.card() + ") has stopped streaming after an error");
}

bool CaptureStream::wait(int timeout_ms) const {
    pollfd ready{device_.fd(), POLLIN, 0};
    const int count = poll(&ready, 1, timeout_ms);
    if (count < 0 && errno != EINTR)
        device_.fail("waiting for a frame", errno);
    if (count <= 0)
        return false;
    if (ready.revents & (POLLERR | POLLHUP)) {
        v4l2_capability capability{};
        if (const int error = device_.control(VIDIOC_QUERYCAP, &capability))
            device_.fail("waiting for a frame", error);
        fail_stopped();
    }
    return true;
}

} // namespace arhost
