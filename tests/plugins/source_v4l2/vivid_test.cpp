// SPDX-License-Identifier: Apache-2.0
//
// Captures from vivid, the kernel's virtual camera, and makes vivid inject faults. To be run in a virtual machine:
//   tools/vm/run-in-vm -m "vivid n_devs=1 node_types=0x1" …/source_v4l2-vivid-test
#include "../../support/process_state.hpp"
#include "../../support/waiting.hpp"
#include "../../system/arhost_run.hpp"
#include "../../system/device_schema.hpp"
#include "../../system/listed_devices.hpp"
#include "../../system/suspend.hpp"
#include "../source_file/source_under_test.hpp"
#include "frame_colours.hpp"

#include <gmock/gmock.h>

#include <fcntl.h>

#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <fstream>
#include <regex>
#include <thread>

namespace fs = std::filesystem;
using namespace arhost::test;
using testing::HasSubstr;

namespace {

const char *const device = "/dev/video0";

// The ids of vivid's controls. The kernel header that defines them is not installed.
enum : std::uint32_t {
    test_pattern = 0x00f0f000,     // 1 selects 100 % colour bars
    osd_text_mode = 0x00f0f001,    // 2 disables the text over the picture
    timestamp_source = 0x00f0f018, // 0 is the end of the frame, 1 the start of exposure
    colorspace = 0x00f0f019,       // 1 is Rec. 709, 2 is sRGB
    quantization = 0x00f0f01c,     // 1 is full range
    percentage_of_dropped_buffers = 0x00f0f040,
    disconnect = 0x00f0f041,
    inject_buffer_error = 0x00f0f042,
    inject_reqbufs_error = 0x00f0f043,
    inject_qbuf_error = 0x00f0f044,
    inject_streamon_error = 0x00f0f045,
    inject_fatal_streaming_error = 0x00f0f046,
    wrap_sequence_number = 0x00f0f026,
    wrap_timestamp = 0x00f0f027
};

class Vivid : public testing::Test {
protected:
    void SetUp() override {
        fd_ = open(device, O_RDWR | O_CLOEXEC);
        v4l2_capability capability{};
        ASSERT_TRUE(fd_ >= 0 && ioctl(fd_, VIDIOC_QUERYCAP, &capability) == 0 &&
                    std::string(reinterpret_cast<const char *>(capability.driver)) == "vivid")
            << device << " is not vivid; run this program with tools/vm/run-in-vm";
        set(test_pattern, 1);
        set(osd_text_mode, 2);
        // The time stamps must be those of the start of exposure: vivid's time stamps for the end of a frame are
        // about 30 ms later than the delivery of the frame.
        set(timestamp_source, 1);
        set(colorspace, 2);
        set(quantization, 0);
        set(percentage_of_dropped_buffers, 0);
    }
    void TearDown() override {
        source_.stop();
        close(fd_);
    }
    void set(std::uint32_t id, int value) const {
        v4l2_ext_control control{};
        control.id = id;
        control.value = value;
        v4l2_ext_controls controls{};
        controls.which = V4L2_CTRL_WHICH_CUR_VAL;
        controls.count = 1;
        controls.controls = &control;
        ASSERT_EQ(ioctl(fd_, VIDIOC_S_EXT_CTRLS, &controls), 0) << "control " << std::hex << id;
    }
    // The names of the controls with which vivid injects faults.
    std::vector<std::string> faults() const {
        std::vector<std::string> names;
        v4l2_query_ext_ctrl query{};
        for (query.id = V4L2_CTRL_FLAG_NEXT_CTRL; ioctl(fd_, VIDIOC_QUERY_EXT_CTRL, &query) == 0;
             query.id |= V4L2_CTRL_FLAG_NEXT_CTRL)
            if (std::regex_search(query.name, std::regex("Inject|Wrap|Disconnect|Drop|Error")))
                names.emplace_back(query.name);
        return names;
    }
    int get(std::uint32_t id) const {
        v4l2_control control{id, 0};
        EXPECT_EQ(ioctl(fd_, VIDIOC_G_CTRL, &control), 0) << "control " << std::hex << id;
        return control.value;
    }
    // Captures small pictures by default, because the virtual machine is emulated and slow.
    arhost_status start(double fps = 60, std::map<std::string, std::string> options = {}, bool live = true) {
        options.try_emplace("device", device);
        if (!options.contains("width")) {
            options["width"] = "320";
            options["height"] = "180";
        }
        return source_.start(options, source_setup(fps, live));
    }
    // Starts the source and reads frame 0; throws if that fails.
    void capture(double fps = 60, const std::map<std::string, std::string> &options = {}, bool live = true) {
        if (start(fps, options, live) != ARHOST_STATUS_OK)
            throw std::runtime_error(source_.log());
        source_.read_frame(0);
    }
    // Checks that a start with these options fails with messages that contain `words`.
    void expect_rejection(const std::map<std::string, std::string> &options, const std::vector<const char *> &words,
                          arhost_status status = ARHOST_STATUS_ERROR_CONFIGURATION) {
        EXPECT_EQ(start(30, options), status) << source_.log();
        for (const char *word : words)
            EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr(word));
    }
    // Checks that a frame was stamped by CLOCK_MONOTONIC within the last second, and not before `last_ns`.
    static void expect_recent(const SourceFrame &frame, std::int64_t last_ns) {
        EXPECT_EQ(frame.info.clock, ARHOST_CLOCK_MONOTONIC);
        EXPECT_GE(frame.info.capture_ns, last_ns);
        const std::int64_t age = monotonic_ns() - frame.info.capture_ns;
        EXPECT_GE(age, 0);
        EXPECT_LT(age, 1'000'000'000);
    }
    // Returns the number of frames that were skipped before the frames [first, end).
    std::uint64_t skipped_in(std::uint64_t first, std::uint64_t end) {
        std::uint64_t skipped = 0;
        for (std::uint64_t n = first; n < end; ++n) {
            last_ = source_.read_frame(n);
            skipped += last_.info.skipped;
        }
        return skipped;
    }

    SourceUnderTest source_{"source_v4l2"};
    SourceFrame last_; // of skipped_in()
    int fd_ = -1;
};

std::size_t device_mappings() {
    std::ifstream maps("/proc/self/maps");
    std::size_t count = 0;
    for (std::string line; std::getline(maps, line);)
        count += line.find("/dev/video") != std::string::npos;
    return count;
}

// vivid's eight colour bars over 320 px: white, yellow, cyan, green, magenta, red, blue and black.
constexpr std::array<std::array<int, 3>, 8> bars = {
    {{255, 255, 255}, {255, 255, 0}, {0, 255, 255}, {0, 255, 0}, {255, 0, 255}, {255, 0, 0}, {0, 0, 255}, {0, 0, 0}}};

} // namespace

TEST_F(Vivid, DeliversYuyvAtTheConfiguredSizeAndRate) {
    ASSERT_EQ(start(30), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(source_.format().pixel_format, ARHOST_PIXEL_FORMAT_YUYV);
    EXPECT_EQ(source_.format().width, 320u);
    EXPECT_EQ(source_.format().height, 180u);
    EXPECT_EQ(source_.format().fps, 30.0);
    EXPECT_EQ(source_.properties().frame_count, 0u);
    EXPECT_EQ(source_.read(0).status, ARHOST_STATUS_OK);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
}

TEST_F(Vivid, ColourBarsHaveTheCorrectColours) {
    struct Case {
        int colorspace, quantization;
        arhost_yuv_matrix matrix;
        arhost_yuv_range range;
        double kr, kb;
    };
    for (const Case &c : {Case{2, 0, ARHOST_YUV_MATRIX_BT601, ARHOST_YUV_RANGE_LIMITED, 0.299, 0.114},
                          Case{1, 0, ARHOST_YUV_MATRIX_BT709, ARHOST_YUV_RANGE_LIMITED, 0.2126, 0.0722},
                          Case{2, 1, ARHOST_YUV_MATRIX_BT601, ARHOST_YUV_RANGE_FULL, 0.299, 0.114}}) {
        SCOPED_TRACE("colorspace " + std::to_string(c.colorspace) + ", quantization " +
                     std::to_string(c.quantization));
        set(colorspace, c.colorspace);
        set(quantization, c.quantization);
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
        EXPECT_EQ(source_.format().yuv_matrix, c.matrix);
        EXPECT_EQ(source_.format().yuv_range, c.range);
        const SourceFrame frame = source_.read_frame(0);
        for (const std::size_t y : {5u, 90u, 174u})
            for (std::size_t bar = 0; bar < 8; ++bar) {
                const std::uint8_t *pair = &frame.bytes[y * 640 + 2 * (bar * 40 + 20)];
                const auto rgb = rgb_of(pair[0], pair[1], pair[3], c.kr, c.kb, c.range == ARHOST_YUV_RANGE_FULL);
                for (std::size_t i = 0; i < 3; ++i)
                    EXPECT_NEAR(rgb[i], bars[bar][i], 4) << "bar " << bar << ", row " << y << ", channel " << i;
            }
        source_.stop();
    }
}

TEST_F(Vivid, DeliversEachFormatOfTheOption) {
    const std::vector<std::pair<std::string, arhost_pixel_format>> formats = {
        {"yuyv", ARHOST_PIXEL_FORMAT_YUYV},  {"uyvy", ARHOST_PIXEL_FORMAT_YUYV},
        {"nv12", ARHOST_PIXEL_FORMAT_NV12},  {"yuv420", ARHOST_PIXEL_FORMAT_I420},
        {"rgb24", ARHOST_PIXEL_FORMAT_RGB8}, {"bgr24", ARHOST_PIXEL_FORMAT_BGR8},
        {"grey", ARHOST_PIXEL_FORMAT_GREY8}, {"y10", ARHOST_PIXEL_FORMAT_GREY8},
        {"y12", ARHOST_PIXEL_FORMAT_GREY8},  {"y16", ARHOST_PIXEL_FORMAT_GREY8}};
    for (const auto &[name, delivered] : formats) {
        SCOPED_TRACE(name);
        ASSERT_EQ(start(60, {{"format", name}}), ARHOST_STATUS_OK) << source_.log();
        EXPECT_EQ(source_.format().pixel_format, delivered);
        const SourceFrame frame = source_.read_frame(0);
        const auto colour = [&](std::size_t bar, std::size_t y) {
            return colour_at(source_.format(), frame.bytes, bar * 40 + 20, y);
        };
        for (const std::size_t y : {5u, 90u, 174u})
            for (std::size_t bar = 0; bar < 8; ++bar) {
                if (delivered != ARHOST_PIXEL_FORMAT_GREY8) {
                    for (std::size_t i = 0; i < 3; ++i)
                        EXPECT_NEAR(colour(bar, y)[i], bars[bar][i], 4) << "bar " << bar << ", row " << y;
                    continue;
                }
                const double luma = 0.2126 * bars[bar][0] + 0.7152 * bars[bar][1] + 0.0722 * bars[bar][2];
                EXPECT_NEAR(colour(bar, y)[0], luma, 3) << "bar " << bar << ", row " << y;
            }
        EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
        source_.stop();
    }
}

TEST_F(Vivid, StampsFramesWithTheMonotonicClock) {
    ASSERT_EQ(start(30), ARHOST_STATUS_OK) << source_.log();
    std::int64_t last = 0;
    for (std::uint64_t n = 0; n < 15; ++n) {
        const SourceFrame frame = source_.read_frame(n);
        expect_recent(frame, last + 1);
        if (n > 0 && frame.info.skipped == 0) {
            EXPECT_NEAR(static_cast<double>(frame.info.capture_ns - last), 33.3e6, 20e6);
        }
        last = frame.info.capture_ns;
    }
}

TEST_F(Vivid, LiveModeDeliversTheNewestFrameAndCountsTheOthers) {
    capture(50);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const std::int64_t asked = monotonic_ns();
    const SourceFrame frame = source_.read_frame(1);
    EXPECT_GE(frame.info.skipped, 2u) << "the driver filled its four buffers in the meantime";
    // The driver then had no free buffer. Reading frame 1 has queued the buffers again.
    EXPECT_GE(source_.read(2).info.capture_ns, asked - 100'000'000) << "an old frame was delivered";
}

TEST_F(Vivid, LockstepDeliversEveryFrameInOrder) {
    capture(50, {}, false);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const std::int64_t asked = monotonic_ns();
    for (std::uint64_t n = 1; n < 4; ++n)
        EXPECT_LT(source_.read(n).info.capture_ns, asked - 200'000'000)
            << "expected the oldest frame in the driver's queue";
}

TEST_F(Vivid, CountsFramesDroppedByTheDriver) {
    set(percentage_of_dropped_buffers, 50);
    ASSERT_EQ(start(50), ARHOST_STATUS_OK) << source_.log();
    const std::int64_t first_ns = source_.read(0).info.capture_ns;
    const std::uint64_t skipped = skipped_in(1, 30);
    EXPECT_GT(skipped, 5u);
    // At 50 fps, a frame takes 20 ms. The delivered and the skipped frames together must match the elapsed time.
    EXPECT_NEAR(static_cast<double>(last_.info.capture_ns - first_ns) / 20e6, static_cast<double>(29 + skipped), 3);
    EXPECT_GT(source_.plugin().counters().at("lost_by_driver"), 5u);
}

TEST_F(Vivid, DropsFramesMarkedAsDamaged) {
    capture(30);
    set(inject_buffer_error, 1);
    EXPECT_GE(skipped_in(1, 6), 1u);
    EXPECT_EQ(source_.plugin().counters().at("marked_damaged"), 1u);
}

TEST_F(Vivid, DeliversThreeHundredFramesWithoutLeaks) {
    capture();
    source_.stop();
    const std::size_t files = open_files();
    [[maybe_unused]] const std::size_t memory = resident_kib();
    for (int round = 0; round < 3; ++round) {
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
        EXPECT_EQ(device_mappings(), 4u);
        for (std::uint64_t n = 0; n < 100; ++n)
            ASSERT_EQ(source_.read(n).status, ARHOST_STATUS_OK) << source_.log();
        source_.stop();
        EXPECT_EQ(device_mappings(), 0u);
        EXPECT_EQ(open_files(), files);
    }
#ifndef __SANITIZE_ADDRESS__ // ASan delays freeing memory and has its own leak checker
    EXPECT_LT(resident_kib(), memory + 2048);
#endif
}

TEST_F(Vivid, UsesTheConfiguredNumberOfBuffers) {
    ASSERT_EQ(start(60, {{"buffers", "8"}}), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(device_mappings(), 8u);
    EXPECT_EQ(source_.read(0).status, ARHOST_STATUS_OK);
}

TEST_F(Vivid, UsesTheDriversSizeByDefault) {
    capture(25, {{"width", "0"}, {"height", "0"}});
    EXPECT_EQ(source_.format().width * 9, source_.format().height * 16);
}

TEST_F(Vivid, UsesTheSizeOfTheCalibration) {
    const arhost_intrinsics camera = intrinsics_of_size(640, 480);
    arhost_source_setup setup{};
    setup.intrinsics = &camera;
    ASSERT_EQ(source_.start({{"device", device}}, setup), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(source_.format().width, 640u);
    EXPECT_EQ(source_.format().height, 480u);
    EXPECT_EQ(source_.start({{"device", device}, {"width", "320"}, {"height", "180"}}, setup),
              ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR),
                HasSubstr("320×180 is configured, but the camera calibration is for 640×480"));
}

TEST_F(Vivid, RejectsAnUnsupportedSizeAndNamesTheNearest) {
    expect_rejection({{"width", "650"}, {"height", "470"}},
                     {"has no size 650×470 in YUYV", "the nearest are 640×480"});
}

TEST_F(Vivid, RejectsAnUnsupportedFormatAndListsTheSupportedOnes) {
    expect_rejection({{"format", "mjpeg"}}, {"offers no mjpeg", "YUYV (320×180 60 fps, 640×360 40 fps"});
}

TEST_F(Vivid, WarnsAboutAnUnreachableRate) {
    ASSERT_EQ(start(120), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(source_.format().fps, 60.0);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_WARNING), HasSubstr("not the configured"));
}

TEST_F(Vivid, SetsControlsByName) {
    ASSERT_EQ(
        start(30, {{"gain", "77"},
                   {"controls", "brightness=200, contrast = 90,boolean=true, menu=menu_item_3, test_pattern=1"}}),
        ARHOST_STATUS_OK)
        << source_.log();
    EXPECT_EQ(get(V4L2_CID_AUTOGAIN), 0);
    EXPECT_EQ(get(V4L2_CID_GAIN), 77);
    EXPECT_EQ(get(V4L2_CID_BRIGHTNESS), 200);
    EXPECT_EQ(get(V4L2_CID_CONTRAST), 90);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
    ASSERT_EQ(start(30, {{"gain", "auto"}, {"controls", "brightness=128, contrast=128"}}), ARHOST_STATUS_OK)
        << source_.log();
    EXPECT_EQ(get(V4L2_CID_AUTOGAIN), 1);
}

TEST_F(Vivid, SetsControlsWhileItCaptures) {
    capture();
    EXPECT_EQ(source_.plugin().set_text("gain", "77"), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(get(V4L2_CID_AUTOGAIN), 0);
    EXPECT_EQ(get(V4L2_CID_GAIN), 77);
    EXPECT_EQ(source_.plugin().set_text("controls", "brightness=200, contrast=90"), ARHOST_STATUS_OK);
    EXPECT_EQ(get(V4L2_CID_BRIGHTNESS), 200);
    EXPECT_EQ(get(V4L2_CID_CONTRAST), 90);
    EXPECT_EQ(source_.plugin().set_text("gain", "300"), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("does not accept '300' for 'gain'; valid: 0 to 255"));
    EXPECT_EQ(get(V4L2_CID_GAIN), 77) << "unchanged";
    EXPECT_EQ(source_.read(1).status, ARHOST_STATUS_OK);
    EXPECT_EQ(source_.plugin().set_text("controls", "brightness=128, contrast=128"), ARHOST_STATUS_OK);
}

TEST_F(Vivid, RejectsControlsThatItDoesNotHave) {
    expect_rejection({{"controls", "brightnes=3"}},
                     {"controls: the camera '/dev/video0' (vivid) has no control 'brightnes'; it has: brightness, "
                      "contrast, "});
    expect_rejection({{"focus", "auto"}}, {"focus: the camera"});
}

TEST_F(Vivid, RejectsValuesOutsideTheRangeOfAControl) {
    expect_rejection({{"gain", "300"}}, {"does not accept '300' for 'gain'; valid: 0 to 255"});
    expect_rejection({{"controls", "menu=9"}}, {"does not accept '9' for 'menu'; valid: 1 (menu_item_1), "});
    expect_rejection({{"controls", "boolean=maybe"}}, {"valid: true or false"});
    expect_rejection({{"controls", "brightness"}}, {"'brightness' is not of the form NAME=VALUE"});
    expect_rejection({{"controls", "bitmask=4, brightness=7x"}}, {});
}

TEST_F(Vivid, ReportsACameraInUse) {
    SourceUnderTest first("source_v4l2");
    ASSERT_EQ(first.start({{"device", device}}), ARHOST_STATUS_OK) << first.log();
    expect_rejection({}, {"in use by another program"}, ARHOST_STATUS_ERROR_IO);
    first.stop();
    EXPECT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
}

TEST_F(Vivid, ListsCamerasIfTheConfiguredOneIsMissing) {
    expect_rejection({{"device", "/dev/video9"}}, {"/dev/video0 (vivid-000-vid-cap)"});
}

// ---- arhost devices ----------------------------------------------------------------------------------

namespace {

nlohmann::json listed_camera(const char *node, uid_t user = 0) {
    const nlohmann::json list = listed_devices("source_v4l2", user);
    const nlohmann::json camera = element_with(list.value("cameras", nlohmann::json::array()), "path", node);
    EXPECT_TRUE(camera.is_object()) << node << " is missing: " << list;
    return camera;
}

} // namespace

TEST_F(Vivid, IsListedWithFormatsSizesRatesAndControls) {
    constexpr std::uint32_t bitmask = 0x0098f906; // its range exceeds 31 bits
    set(bitmask, static_cast<int>(0x80000010));
    const nlohmann::json camera = listed_camera(device);
    EXPECT_EQ(camera["plugin"], "source_v4l2");
    EXPECT_EQ(camera["name"], "vivid");
    EXPECT_EQ(camera["serial"], nullptr) << "it is no USB device";
    EXPECT_EQ(camera["problem"], nullptr);
    for (const char *format : {"yuyv", "uyvy", "nv12", "yuv420", "rgb24", "bgr24", "grey", "y10", "y12", "y16"}) {
        const nlohmann::json sizes = element_with(camera["formats"], "pixel_format", format)["sizes"];
        ASSERT_EQ(sizes.size(), 6u) << format;
        EXPECT_EQ(sizes[0]["width"], 320);
        EXPECT_EQ(sizes[0]["height"], 180);
        EXPECT_EQ(sizes[0]["rates"],
                  nlohmann::json({60.0, 50.0, 40.0, 30.0, 25.0, 15.0, 12.5, 10.0, 5.0, 4.0, 2.0, 1.0}));
        EXPECT_EQ(sizes[5]["width"], 3840);
        EXPECT_EQ(sizes[5]["rates"], nlohmann::json({2.0, 1.0}));
    }
    set(V4L2_CID_BRIGHTNESS, 200);
    const auto control = [](const nlohmann::json &listed, const char *name) {
        return element_with(listed["controls"], "name", name);
    };
    EXPECT_EQ(control(listed_camera(device), "brightness"),
              nlohmann::json::parse(R"({"name": "brightness", "type": "integer", "minimum": 0, "maximum": 255,
                                        "step": 1, "default": 128, "value": 200})"));
    EXPECT_EQ(control(camera, "bitmask")["value"], 0x80000010u);
    EXPECT_EQ(control(camera, "horizontal_flip")["type"], "boolean");
    EXPECT_EQ(control(camera, "test_pattern")["value"], 1) << "as SetUp has set it";
    EXPECT_EQ(control(camera, "disconnect")["type"], "button");
    EXPECT_EQ(control(camera, "disconnect")["value"], nullptr);
}

TEST_F(Vivid, IsListedRepeatedlyWithoutLeaks) {
    ArhostRun run;
    EXPECT_EQ(run.run({"conform", "source_v4l2", "--allow", "video", "--only", "abi.create,abi.devices"}), 0)
        << run.output();
    EXPECT_THAT(run.output(), testing::ContainsRegex("pass     abi.devices\\s+vivid"));
}

TEST_F(Vivid, IsDescribedAsTheSchemaDemands) {
    if (!can_validate())
        GTEST_SKIP() << "Debian's package python3-jsonschema is not installed";
    EXPECT_EQ(schema_violation(listed_devices("source_v4l2")), "");
}

TEST_F(Vivid, ABusyCameraNamesTheProcessAndKeepsCapturing) {
    capture();
    const std::string self =
        std::string(program_invocation_short_name).substr(0, 15) + " (process " + std::to_string(getpid()) + ")";
    const nlohmann::json camera = listed_camera(device);
    EXPECT_EQ(camera["problem"], "in use by " + self);
    EXPECT_GE(camera["formats"].size(), 10u) << "a camera in use can still be described";
    EXPECT_EQ(source_.read(1).status, ARHOST_STATUS_OK);
    source_.stop();
    EXPECT_EQ(listed_camera(device)["problem"], nullptr) << "open, but not capturing";
}

// vivid's nodes belong to root. udev would change the group to `video` and the mode to 0660.
TEST_F(Vivid, AForbiddenCameraNamesTheGroup) {
    const group *video = getgrnam("video");
    ASSERT_TRUE(video);
    ASSERT_EQ(chown(device, 0, video->gr_gid), 0);
    ASSERT_EQ(chmod(device, 0660), 0);
    const nlohmann::json camera = listed_camera(device, 1000);
    EXPECT_EQ(camera["problem"],
              "only the group 'video' may open it: run 'sudo usermod -aG video $USER', then log in again");
    EXPECT_EQ(camera["name"], "vivid-000-vid-cap") << "the name is known without opening it";
    EXPECT_EQ(camera["formats"].size(), 0u);
    ASSERT_EQ(chmod(device, 0600), 0);
    EXPECT_EQ(listed_camera(device, 1000)["problem"], "only the user 'root' may open it");
    EXPECT_EQ(listed_camera(device)["problem"], nullptr) << "root may open it";
}

// An ordinary user cannot see the files of other users' processes.
TEST_F(Vivid, ABusyCameraOfAnotherUserSaysHowToFindTheProcess) {
    ASSERT_EQ(chmod(device, 0666), 0);
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(listed_camera(device, 1000)["problem"],
              "in use by a program of another user; 'sudo fuser -v /dev/video0' shows it");
    ASSERT_EQ(chmod(device, 0600), 0);
}

// As udev creates them; they name the camera even if its node gets another number.
TEST_F(Vivid, IsFoundByALinkInTheSandbox) {
    fs::create_directories("/dev/v4l/by-id");
    fs::create_symlink("../../video0", "/dev/v4l/by-id/usb-vivid-index0");
    ArhostRun run("version: 1\nsource: {plugin: source_v4l2, allow: [video], options: {device: "
                  "/dev/v4l/by-id/usb-vivid-index0, width: 320, height: 180}}\n"
                  "outputs: [{plugin: sink_null}]\n");
    EXPECT_EQ(run.run({"check", "run.yaml"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("320×180"));
    fs::remove_all("/dev/v4l");
}

namespace {

// A run that captures by a link, as udev creates it, which names the camera even if its node gets another number.
class VividRun : public Vivid {
protected:
    void SetUp() override {
        Vivid::SetUp();
        fs::create_directories(link.parent_path());
        fs::create_symlink("../../video0", link);
        run.start({"run.yaml", "--allow-no-target"});
        ASSERT_TRUE(wait_for(20)) << run.output();
    }
    void TearDown() override {
        fs::remove_all("/dev/v4l");
        Vivid::TearDown();
    }
    std::ptrdiff_t frames() const {
        const std::string text = run.exists("out/poses.jsonl") ? run.read("out/poses.jsonl") : "";
        return std::count(text.begin(), text.end(), '\n');
    }
    // Waits until the run has output this number of frames.
    bool wait_for(std::ptrdiff_t count) {
        return eventually([&] { return !run.running() || frames() >= count; }) && frames() >= count;
    }
    void end() {
        send_signal(run.pid(), SIGINT);
        EXPECT_EQ(run.wait(), 130) << run.output();
    }

    const fs::path link = "/dev/v4l/by-id/usb-vivid-index0";
    ArhostRun run{"version: 1\nmode: live\n"
                  "source: {plugin: source_v4l2, allow: [video], fps: 30, options: {device: " +
                  link.string() +
                  ", width: 320, height: 180}}\ncamera: {width: 320, height: 180, fx: 300}\n"
                  "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                  "outputs: [{plugin: sink_poses, path: out/poses.jsonl}]\nstats: stats.json\n"};
};

} // namespace

// A camera that is unplugged comes back as another node.
TEST_F(VividRun, ComesBackUnderAnotherNumber) {
    if (!fs::exists("/dev/video1"))
        GTEST_SKIP() << "needs two cameras: -m \"vivid n_devs=2 node_types=0x1,0x1\"";
    fs::remove(link);
    fs::create_symlink("../../video1", link);
    set(disconnect, 1);
    EXPECT_TRUE(wait_for(frames() + 60)) << run.output();
    end();
    EXPECT_THAT(run.output(), HasSubstr("was it unplugged?"));
    EXPECT_GE(run.stats()["restarts"]["source"], 1);
}

// A fault in a run: the source goes on, and the statistics count the lost frames.
TEST_F(VividRun, GoesOnAfterFaultsAndCountsTheLostFrames) {
    set(inject_buffer_error, 1);
    ASSERT_TRUE(wait_for(frames() + 10)) << run.output();
    set(inject_fatal_streaming_error, 1);
    ASSERT_TRUE(wait_for(frames() + 40)) << run.output();
    set(percentage_of_dropped_buffers, 50);
    ASSERT_TRUE(wait_for(frames() + 40)) << run.output();
    set(percentage_of_dropped_buffers, 0);
    end();
    const auto counters = run.stats()["counters"]["source"];
    EXPECT_EQ(counters["marked_damaged"], 1) << counters;
    EXPECT_GT(counters["lost_by_driver"], 5) << counters;
    EXPECT_THAT(run.output(), HasSubstr("marked_damaged 1"));
    EXPECT_THAT(run.output(), HasSubstr("has stopped streaming after an error"));
    EXPECT_EQ(run.stats()["restarts"]["source"], 1);
}

// The keys `restart` have their defaults, by which five failures in about four seconds disable a component.
TEST_F(VividRun, WaitsUntilTheCameraIsPluggedInAgain) {
    fs::remove(link);
    set(disconnect, 1);
    close(fd_); // vivid reconnects when all programs have closed the device
    std::this_thread::sleep_for(std::chrono::seconds(20));
    EXPECT_TRUE(run.running()) << run.output();
    fd_ = open(device, O_RDWR | O_CLOEXEC);
    fs::create_symlink("../../video0", link);
    EXPECT_TRUE(wait_for(frames() + 20)) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("does not exist; "));
    EXPECT_THAT(run.output(), HasSubstr("waiting for its device"));
    EXPECT_THAT(run.output(), HasSubstr("its device is back"));
    fs::remove(link);
    set(disconnect, 1);
    EXPECT_TRUE(eventually([&] { return run.output().rfind("waiting for") > run.output().rfind("is back"); }));
    end();
    // Each unplug counts once, however many processes look for the camera meanwhile.
    EXPECT_EQ(run.stats()["restarts"]["source"], 2) << run.output();
}

TEST_F(VividRun, SurvivesASuspend) {
    // The source waits for a frame when it is suspended and when it continues.
    set(percentage_of_dropped_buffers, 100);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    ASSERT_TRUE(suspend_processes());
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    set(percentage_of_dropped_buffers, 0);
    EXPECT_TRUE(wait_for(frames() + 40)) << run.output();
    end();
    const nlohmann::json stats = run.stats();
    for (const auto &[component, restarts] : stats["restarts"].items())
        EXPECT_EQ(restarts, 0) << component << ":\n" << run.output();
}

TEST_F(Vivid, StopsWaitingWhenCancelled) {
    ASSERT_EQ(start(1), ARHOST_STATUS_OK) << source_.log(); // one frame per second
    ASSERT_EQ(source_.read(0).status, ARHOST_STATUS_OK);
    source_.plugin().cancel(1); // while it waits
    EXPECT_EQ(source_.read(1).status, ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_ERROR), "");
}

TEST_F(Vivid, ReportsAnUnplugAndReconnects) {
    capture();
    set(disconnect, 1);
    EXPECT_EQ(source_.read_all(1, 9).back().status, ARHOST_STATUS_ERROR_DEVICE_LOST);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("has disappeared; was it unplugged?"));
    source_.stop();
    EXPECT_EQ(device_mappings(), 0u);
    // vivid reconnects when all programs have closed the device.
    close(fd_);
    fd_ = open(device, O_RDWR | O_CLOEXEC);
    capture();
}

TEST_F(Vivid, ReportsAFatalDriverError) {
    capture();
    set(inject_fatal_streaming_error, 1);
    EXPECT_EQ(source_.read_all(1, 9).back().status, ARHOST_STATUS_ERROR_DEVICE_LOST);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("has stopped streaming"));
}

TEST_F(Vivid, SequenceNumbersMayWrap) {
    set(wrap_sequence_number, 1); // they start 128 below their maximum
    ASSERT_EQ(start(60, {}, false), ARHOST_STATUS_OK) << source_.log();
    std::uint64_t skipped = 0;
    for (std::uint64_t n = 0; n < 200; ++n) {
        const SourceFrame frame = source_.read_frame(n);
        ASSERT_LT(frame.info.skipped, 1000u);
        skipped += frame.info.skipped;
    }
    EXPECT_EQ(source_.plugin().counters().at("lost_by_driver"), skipped);
    set(wrap_sequence_number, 0);
}

// With this control, vivid's time stamps are not those of CLOCK_MONOTONIC.
TEST_F(Vivid, WrongTimeStampsAreReplacedByTheArrival) {
    for (const int wrap : {1, 2}) {
        set(wrap_timestamp, wrap);
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
        std::int64_t last = 0;
        for (std::uint64_t n = 0; n < 20; ++n) {
            const SourceFrame frame = source_.read_frame(n);
            expect_recent(frame, last);
            last = frame.info.capture_ns;
        }
        EXPECT_THAT(source_.log(ARHOST_SEVERITY_WARNING), HasSubstr("arrival times are used instead"));
        source_.stop();
    }
    set(wrap_timestamp, 0);
}

// A fault that a later kernel adds needs a test here. The last one applies only to requests of the media API, which
// the source does not use.
TEST_F(Vivid, TheTestsInjectEachFaultThatItsControlsOffer) {
    EXPECT_THAT(faults(),
                testing::UnorderedElementsAre(
                    "Wrap Sequence Number", "Wrap Timestamp", "Percentage of Dropped Buffers", "Disconnect",
                    "Inject V4L2_BUF_FLAG_ERROR", "Inject VIDIOC_REQBUFS Error", "Inject VIDIOC_QBUF Error",
                    "Inject VIDIOC_STREAMON Error", "Inject Fatal Streaming Error", "Inject req_validate() Error"));
}

TEST_F(Vivid, ReportsDriverErrorsAtStart) {
    for (const auto &[control, message] : {std::pair{inject_reqbufs_error, "while reserving 4 buffers"},
                                           {inject_qbuf_error, "while queueing a buffer"},
                                           {inject_streamon_error, "while starting the stream"}}) {
        set(control, 1);
        expect_rejection({}, {"reported an error", message}, ARHOST_STATUS_ERROR_IO);
    }
    EXPECT_EQ(device_mappings(), 0u);
    capture();
}
