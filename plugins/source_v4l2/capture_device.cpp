// SPDX-License-Identifier: Apache-2.0
#include "capture_device.hpp"

#include "camera_common/fourcc.hpp"

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
    for (const std::string &node : video_nodes()) {
        const std::string card = card_of(node);
        list += (list.empty() ? "" : ", ") + node + (card.empty() ? "" : " (" + card + ")");
    }
    return list;
}

std::string other_devices(const std::string &option) {
    const std::string existing = existing_devices();
    if (existing.empty())
        return "no /dev/video* exists; connect a camera, or use 'source_synthetic' or "
               "'source_file' instead";
    return "available: " + existing + "; set '" + option + "' to one of them (list them with 'arhost devices')";
}

double rate(const v4l2_fract &interval) {
    return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

std::string size_text(std::uint32_t width, std::uint32_t height) {
    return std::to_string(width) + "×" + std::to_string(height);
}

std::string size_text(const CaptureSize &size) {
    std::string text = size_text(size.width, size.height);
    if (size.max_fps() > 0) {
        char fps[32];
        std::snprintf(fps, sizeof fps, " %.4g fps", size.max_fps());
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

CaptureSize capture_size(int fd, std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) {
    CaptureSize size{width, height, {}, false};
    v4l2_frmivalenum interval{};
    interval.pixel_format = fourcc;
    interval.width = width;
    interval.height = height;
    for (; !size.any_rate && retried_ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, &interval) == 0; ++interval.index) {
        if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
            size.rates.push_back(rate(interval.discrete));
        } else {
            size.any_rate = true;
            size.rates = {rate(interval.stepwise.min), rate(interval.stepwise.max)};
        }
    }
    std::erase_if(size.rates, [](double fps) { return fps <= 0; });
    size.any_rate = size.any_rate && size.rates.size() == 2;
    std::sort(size.rates.begin(), size.rates.end(), std::greater<>());
    return size;
}

std::vector<CaptureFormat> list_formats(int fd, v4l2_buf_type buffer_type) {
    std::vector<CaptureFormat> formats;
    v4l2_fmtdesc description{};
    description.type = buffer_type;
    for (; retried_ioctl(fd, VIDIOC_ENUM_FMT, &description) == 0; ++description.index) {
        CaptureFormat format;
        format.fourcc = description.pixelformat;
        const auto add = [&](std::uint32_t width, std::uint32_t height) {
            format.sizes.push_back(capture_size(fd, format.fourcc, width, height));
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

PictureFormat picture_format(const v4l2_format &format) {
    const auto copy = [](const auto &pixels) {
        return PictureFormat{pixels.pixelformat, pixels.width,        pixels.height,    pixels.colorspace,
                             pixels.ycbcr_enc,   pixels.quantization, pixels.xfer_func, {}};
    };
    if (format.type == V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        PictureFormat picture = copy(format.fmt.pix);
        picture.strides = {format.fmt.pix.bytesperline};
        return picture;
    }
    PictureFormat picture = copy(format.fmt.pix_mp);
    for (std::size_t p = 0; p < std::min<std::size_t>(format.fmt.pix_mp.num_planes, VIDEO_MAX_PLANES); ++p)
        picture.strides.push_back(format.fmt.pix_mp.plane_fmt[p].bytesperline);
    return picture;
}

// A v4l2_buffer and, for the multi-planar API, the planes that it refers to.
struct Buffer {
    Buffer(const CaptureDevice &device, std::uint32_t index) {
        info.type = device.buffer_type();
        info.memory = V4L2_MEMORY_MMAP;
        info.index = index;
        if (device.is_multiplanar()) {
            info.m.planes = planes;
            info.length = VIDEO_MAX_PLANES;
        }
    }
    Buffer(const Buffer &) = delete;
    Buffer &operator=(const Buffer &) = delete;

    v4l2_buffer info{};
    v4l2_plane planes[VIDEO_MAX_PLANES] = {};
};

} // namespace

std::vector<std::string> video_nodes() {
    std::vector<std::string> nodes;
    glob_t found{};
    if (glob("/dev/video*", 0, nullptr, &found) == 0)
        nodes.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    globfree(&found);
    std::stable_sort(nodes.begin(), nodes.end(), [](const std::string &a, const std::string &b) {
        return a.size() < b.size(); // /dev/video10 follows /dev/video9
    });
    return nodes;
}

std::string card_of(const std::string &node) {
    std::string card;
    std::getline(std::ifstream("/sys/class/video4linux" / std::filesystem::path(node).filename() / "name"), card);
    return card;
}

CaptureDevice::CaptureDevice(const std::string &path, const std::string &option)
    : path_(path), option_(option), fd_(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    if (fd_.get() < 0) {
        const int error = errno;
        const std::string start = option + ": '" + path + "' ";
        if (error == ENOENT || error == ENODEV || error == ENXIO || error == ENOTDIR)
            throw CannotOpen(ARHOST_STATUS_ERROR_CONFIGURATION, start + "does not exist; " + other_devices(option),
                             error);
        if (error == EACCES || error == EPERM)
            throw CannotOpen(ARHOST_STATUS_ERROR_CONFIGURATION,
                             start + "cannot be opened by this user: cameras belong to the group 'video' ('sudo "
                                     "usermod -aG video $USER', then log in again)",
                             error);
        if (error == EISDIR)
            throw CannotOpen(ARHOST_STATUS_ERROR_CONFIGURATION,
                             start + "is a folder, not a camera; " + other_devices(option), error);
        const Failure failure = failure_of("opening it", error);
        throw CannotOpen(failure.status(), failure.what(), error);
    }
    v4l2_capability capability{};
    if (const int error = control(VIDIOC_QUERYCAP, &capability); error == ENODEV)
        fail("querying its capabilities", error);
    else if (error != 0)
        throw NotACamera(ARHOST_STATUS_ERROR_CONFIGURATION,
                         option + ": '" + path + "' is not a video device; " + other_devices(option));
    card_ = reinterpret_cast<const char *>(capability.card);
    const std::uint32_t able =
        capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps : capability.capabilities;
    if (!(able & V4L2_CAP_VIDEO_CAPTURE))
        buffer_type_ = V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
    if (!(able & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) || !(able & V4L2_CAP_STREAMING))
        throw NotACamera(ARHOST_STATUS_ERROR_CONFIGURATION,
                         option + ": '" + path + "' (" + card_ + ") does not capture pictures" +
                             (able & V4L2_CAP_META_CAPTURE ? " (it delivers metadata; the camera itself is "
                                                             "usually the node with the next lower number)"
                                                           : "") +
                             "; " + other_devices(option));
    formats_ = list_formats(fd_.get(), buffer_type_);
}

int CaptureDevice::control(unsigned long request, void *argument) const {
    return retried_ioctl(fd_.get(), request, argument);
}

void CaptureDevice::fail(const std::string &what, int error) const {
    throw failure_of(what, error);
}

Failure CaptureDevice::failure_of(const std::string &what, int error) const {
    const std::string start = "the camera '" + path_ + "'" + (card_.empty() ? "" : " (" + card_ + ")") + " ";
    if (error == ENODEV || error == ENXIO || error == ESHUTDOWN)
        return Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, start + "has disappeared; was it unplugged?");
    if (error == EBUSY)
        return Failure(ARHOST_STATUS_ERROR_IO, start + "is in use by another program ('fuser " + path_ +
                                                   "' shows which); close it, or set '" + option_ +
                                                   "' to another camera");
    if (error == ENOSPC)
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                       start + "gets too little bandwidth on its USB bus; choose a smaller size, 'format: mjpeg', or "
                               "another port");
    return Failure(ARHOST_STATUS_ERROR_IO, start + "reported an error while " + what + ": " + std::strerror(error));
}

const CaptureFormat *CaptureDevice::find(std::uint32_t fourcc) const {
    const auto found = std::find_if(formats_.begin(), formats_.end(),
                                    [&](const CaptureFormat &format) { return format.fourcc == fourcc; });
    return found == formats_.end() ? nullptr : &*found;
}

double CaptureDevice::max_fps(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const {
    return capture_size(fd_.get(), fourcc, width, height).max_fps();
}

bool CaptureDevice::is_busy() const {
    // Frees the buffers of this descriptor, which has none. This fails only if another descriptor has buffers.
    v4l2_requestbuffers none{};
    none.type = buffer_type_;
    none.memory = V4L2_MEMORY_MMAP;
    return control(VIDIOC_REQBUFS, &none) == EBUSY;
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

v4l2_format CaptureDevice::query_format() const {
    v4l2_format format{};
    format.type = buffer_type_;
    if (const int error = control(VIDIOC_G_FMT, &format))
        fail("querying its format", error);
    return format;
}

PictureFormat CaptureDevice::current_format() const {
    return picture_format(query_format());
}

PictureFormat CaptureDevice::set_format(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) {
    v4l2_format format = query_format();
    const auto set = [&](auto &pixels) {
        pixels.width = width;
        pixels.height = height;
        pixels.pixelformat = fourcc;
        pixels.field = V4L2_FIELD_NONE;
    };
    if (is_multiplanar()) {
        set(format.fmt.pix_mp);
        std::fill(std::begin(format.fmt.pix_mp.plane_fmt), std::end(format.fmt.pix_mp.plane_fmt),
                  v4l2_plane_pix_format{}); // the driver chooses strides and sizes
    } else {
        set(format.fmt.pix);
        format.fmt.pix.bytesperline = format.fmt.pix.sizeimage = 0;
    }
    if (const int error = control(VIDIOC_S_FMT, &format))
        fail("setting the format " + fourcc_text(fourcc) + " " + size_text(width, height), error);
    return picture_format(format);
}

double CaptureDevice::set_fps(double fps) {
    v4l2_streamparm parameters{};
    parameters.type = buffer_type_;
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
    request.type = device_.buffer_type();
    request.memory = V4L2_MEMORY_MMAP;
    request.count = buffer_count;
    if (const int error = device_.control(VIDIOC_REQBUFS, &request))
        device_.fail("reserving " + std::to_string(buffer_count) + " buffers", error);
    for (std::uint32_t i = 0; i < request.count; ++i) {
        Buffer buffer(device_, i);
        if (const int error = device_.control(VIDIOC_QUERYBUF, &buffer.info))
            device_.fail("querying a buffer", error);
        std::vector<Mapping> &planes = mappings_.emplace_back();
        const auto map = [&](std::size_t size, std::uint32_t offset) {
            void *address = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, device_.fd(), offset);
            if (address == MAP_FAILED)
                device_.fail("mapping a buffer", errno);
            planes.emplace_back(address, size);
        };
        if (!device_.is_multiplanar())
            map(buffer.info.length, buffer.info.m.offset);
        else
            for (std::uint32_t p = 0; p < std::min<std::uint32_t>(buffer.info.length, VIDEO_MAX_PLANES); ++p)
                map(buffer.planes[p].length, buffer.planes[p].m.mem_offset);
    }
    for (std::uint32_t i = 0; i < mappings_.size(); ++i)
        queue(i);
    int type = device_.buffer_type();
    if (const int error = device_.control(VIDIOC_STREAMON, &type))
        device_.fail("starting the stream", error);
}

CaptureStream::~CaptureStream() {
    // Both calls may fail if the camera has been unplugged. In that case, closing the device frees the buffers.
    int type = device_.buffer_type();
    device_.control(VIDIOC_STREAMOFF, &type);
    mappings_.clear(); // must happen before freeing the buffers
    v4l2_requestbuffers none{};
    none.type = device_.buffer_type();
    none.memory = V4L2_MEMORY_MMAP;
    device_.control(VIDIOC_REQBUFS, &none);
}

CaptureStream::Mapping::~Mapping() {
    if (address)
        munmap(address, size);
}

void CaptureStream::queue(std::uint32_t index) const {
    Buffer buffer(device_, index);
    if (device_.is_multiplanar())
        buffer.info.length = static_cast<std::uint32_t>(mappings_[index].size());
    if (const int error = device_.control(VIDIOC_QBUF, &buffer.info))
        device_.fail("queueing a buffer", error);
}

std::optional<Capture> CaptureStream::dequeue() const {
    Buffer buffer(device_, 0);
    const int error = device_.control(VIDIOC_DQBUF, &buffer.info);
    if (error == EAGAIN)
        return std::nullopt;
    if (error == EIO)
        fail_stopped();
    if (error != 0)
        device_.fail("capturing", error);
    const v4l2_buffer &info = buffer.info;
    if (info.index >= mappings_.size())
        device_.fail("capturing (the driver returned an invalid buffer index)", EPROTO);
    Capture capture{info.index, info.flags, info.sequence, info.timestamp, {}};
    const std::vector<Mapping> &planes = mappings_[info.index];
    for (std::size_t p = 0; p < planes.size(); ++p) {
        // In the multi-planar API, the number of used bytes includes the data before the offset.
        const std::size_t end = std::min<std::size_t>(
            device_.is_multiplanar() ? buffer.planes[p].bytesused : info.bytesused, planes[p].size);
        const std::size_t begin =
            std::min<std::size_t>(device_.is_multiplanar() ? buffer.planes[p].data_offset : 0, end);
        capture.planes.emplace_back(static_cast<const std::uint8_t *>(planes[p].address) + begin, end - begin);
    }
    return capture;
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
