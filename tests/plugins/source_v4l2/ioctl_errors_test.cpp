// SPDX-License-Identifier: Apache-2.0
//
// Errors of drivers that no virtual camera produces. umockdev answers the ioctls of a camera that does not exist. To
// be run with umockdev-wrapper, which loads a library into the process; the sandbox of a worker does not permit this,
// so these tests call the plugin without it.
#include "../source_file/source_under_test.hpp"

#include <gmock/gmock.h>

#include <linux/videodev2.h>
#include <umockdev.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>

namespace fs = std::filesystem;
using arhost::test::SourceUnderTest;
using testing::HasSubstr;

namespace {

constexpr std::uint32_t width = 64, height = 48, picture_bytes = 2 * width * height, page_bytes = 8192;

struct Unref {
    void operator()(void *object) const { g_object_unref(object); }
};

// A camera that delivers YUYV at one size and rate. Errors can be set for each request.
class MockCamera {
public:
    MockCamera() : testbed_(umockdev_testbed_new()), handler_(umockdev_ioctl_base_new()) {
        umockdev_testbed_add_from_string(testbed_.get(),
                                         "P: /devices/virtual/video4linux/video0\nN: video0=00\n"
                                         "E: DEVNAME=/dev/video0\nE: SUBSYSTEM=video4linux\nA: name=Mock\n",
                                         nullptr);
        gchar *root = umockdev_testbed_get_root_dir(testbed_.get());
        fs::resize_file(fs::path(root) / "dev/video0", 4 * page_bytes); // what the source maps
        g_free(root);
        g_signal_connect(handler_.get(), "handle-ioctl", G_CALLBACK(&MockCamera::on_ioctl), this);
        umockdev_testbed_attach_ioctl(testbed_.get(), "/dev/video0", handler_.get(), nullptr);
    }
    ~MockCamera() { umockdev_testbed_detach_ioctl(testbed_.get(), "/dev/video0", nullptr); }

    std::map<gulong, int> errors; // errno by request; set them only while no source is started

private:
    static gboolean on_ioctl(UMockdevIoctlBase *, UMockdevIoctlClient *client, gpointer self) {
        const int error = static_cast<MockCamera *>(self)->answer(client);
        umockdev_ioctl_client_complete(client, error ? -1 : 0, error);
        return TRUE;
    }

    template <class T, class Fill> static int fill(UMockdevIoctlClient *client, Fill &&fill) {
        UMockdevIoctlData *const data =
            umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(T), nullptr);
        if (!data)
            return EFAULT;
        T argument;
        guint8 *bytes = nullptr;
        gint size = 0;
        umockdev_ioctl_data_retrieve(data, &bytes, &size);
        std::memcpy(&argument, bytes, sizeof argument);
        const int error = fill(argument);
        umockdev_ioctl_data_update(data, 0, reinterpret_cast<guint8 *>(&argument), sizeof argument);
        umockdev_ioctl_data_unref(data);
        return error;
    }
    int answer(UMockdevIoctlClient *client) const {
        const gulong request = umockdev_ioctl_client_get_request(client);
        if (const auto error = errors.find(request); error != errors.end())
            return error->second;
        switch (request) {
        case VIDIOC_QUERYCAP:
            return fill<v4l2_capability>(client, [](v4l2_capability &capability) {
                std::memcpy(capability.card, "Mock", 5);
                capability.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
                return 0;
            });
        case VIDIOC_ENUM_FMT:
            return fill<v4l2_fmtdesc>(client, [](v4l2_fmtdesc &format) {
                format.pixelformat = V4L2_PIX_FMT_YUYV;
                return format.index > 0 ? EINVAL : 0;
            });
        case VIDIOC_ENUM_FRAMESIZES:
            return fill<v4l2_frmsizeenum>(client, [](v4l2_frmsizeenum &size) {
                size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
                size.discrete = {width, height};
                return size.index > 0 ? EINVAL : 0;
            });
        case VIDIOC_G_FMT:
        case VIDIOC_S_FMT:
            return fill<v4l2_format>(client, [](v4l2_format &format) {
                format.fmt.pix.width = width;
                format.fmt.pix.height = height;
                format.fmt.pix.pixelformat = V4L2_PIX_FMT_YUYV;
                format.fmt.pix.bytesperline = 2 * width;
                format.fmt.pix.sizeimage = picture_bytes;
                return 0;
            });
        case VIDIOC_G_PARM:
        case VIDIOC_S_PARM:
            return fill<v4l2_streamparm>(client, [](v4l2_streamparm &parameters) {
                parameters.parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
                parameters.parm.capture.timeperframe = {1, 30};
                return 0;
            });
        case VIDIOC_QUERYBUF:
            return fill<v4l2_buffer>(client, [](v4l2_buffer &buffer) {
                buffer.length = picture_bytes;
                buffer.m.offset = buffer.index * page_bytes;
                return 0;
            });
        case VIDIOC_DQBUF:
            return fill<v4l2_buffer>(client, [](v4l2_buffer &buffer) {
                buffer.index = 0;
                buffer.bytesused = picture_bytes;
                return 0;
            });
        case VIDIOC_REQBUFS:
        case VIDIOC_QBUF:
        case VIDIOC_STREAMON:
        case VIDIOC_STREAMOFF:
            return 0;
        default:
            return ENOTTY;
        }
    }

    std::unique_ptr<UMockdevTestbed, Unref> testbed_;
    std::unique_ptr<UMockdevIoctlBase, Unref> handler_;
};

struct Case {
    const char *name;
    gulong request;
    int error;
    arhost_status status;
    const char *message;
};

class IoctlError : public testing::TestWithParam<Case> {
protected:
    MockCamera camera_;
    SourceUnderTest source_{"source_v4l2"};
    arhost_status start(std::uint64_t first_sequence = 0) {
        arhost_source_setup setup = arhost::test::source_setup(30, false);
        setup.first_sequence = first_sequence;
        return source_.start({{"device", "/dev/video0"}}, setup);
    }
};

class IoctlErrorAtStart : public IoctlError {};
class IoctlErrorInRead : public IoctlError {};

} // namespace

TEST_F(IoctlError, TheMockDeliversFrames) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(source_.read(0).status, ARHOST_STATUS_OK) << source_.log();
}

TEST_P(IoctlErrorAtStart, IsReported) {
    camera_.errors[GetParam().request] = GetParam().error;
    EXPECT_EQ(start(), GetParam().status);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr(GetParam().message));
    EXPECT_EQ(start(10), ARHOST_STATUS_ERROR_DEVICE_LOST) << "after a restart, the host waits for the camera";
    camera_.errors.clear();
    EXPECT_EQ(start(10), ARHOST_STATUS_OK) << source_.log();
}
INSTANTIATE_TEST_SUITE_P(
    Requests, IoctlErrorAtStart,
    testing::Values(
        Case{"unplugged", VIDIOC_QUERYCAP, ENODEV, ARHOST_STATUS_ERROR_DEVICE_LOST, "has disappeared"},
        Case{"format_busy", VIDIOC_S_FMT, EBUSY, ARHOST_STATUS_ERROR_IO,
             "is in use by another program ('fuser /dev/video0' shows which)"},
        Case{"format_io", VIDIOC_S_FMT, EIO, ARHOST_STATUS_ERROR_IO, "while setting the format YUYV 64×48"},
        Case{"rate_io", VIDIOC_S_PARM, EIO, ARHOST_STATUS_ERROR_IO, "while setting the frame rate"},
        Case{"buffers_memory", VIDIOC_REQBUFS, ENOMEM, ARHOST_STATUS_ERROR_IO, "while reserving 4 buffers"},
        Case{"query_io", VIDIOC_QUERYBUF, EIO, ARHOST_STATUS_ERROR_IO, "while querying a buffer"},
        Case{"bandwidth", VIDIOC_STREAMON, ENOSPC, ARHOST_STATUS_ERROR_CONFIGURATION,
             "gets too little bandwidth on its USB bus; choose a smaller size"},
        Case{"stream_protocol", VIDIOC_STREAMON, EPROTO, ARHOST_STATUS_ERROR_IO, "while starting the stream"}),
    [](const auto &info) { return std::string(info.param.name); });

TEST_P(IoctlErrorInRead, IsReported) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    ASSERT_EQ(source_.read(0).status, ARHOST_STATUS_OK);
    camera_.errors[GetParam().request] = GetParam().error;
    EXPECT_EQ(source_.read(1).status, GetParam().status);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr(GetParam().message));
}
INSTANTIATE_TEST_SUITE_P(
    Requests, IoctlErrorInRead,
    testing::Values(Case{"stopped", VIDIOC_DQBUF, EIO, ARHOST_STATUS_ERROR_DEVICE_LOST,
                         "has stopped streaming after an error"},
                    Case{"unplugged", VIDIOC_DQBUF, ENODEV, ARHOST_STATUS_ERROR_DEVICE_LOST, "has disappeared"},
                    Case{"protocol", VIDIOC_DQBUF, EPROTO, ARHOST_STATUS_ERROR_IO, "while capturing"},
                    Case{"queue", VIDIOC_QBUF, EIO, ARHOST_STATUS_ERROR_IO, "while queueing a buffer"}),
    [](const auto &info) { return std::string(info.param.name); });
