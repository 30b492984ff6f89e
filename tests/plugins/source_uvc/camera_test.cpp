// SPDX-License-Identifier: Apache-2.0
//
// Captures from a USB camera in user space, through the kernel's USB stack. To be run in a virtual machine:
//   tools/vm/run-in-vm -m vhci_hcd -m uvcvideo …/source_uvc-camera-test
#include "../../support/process_state.hpp"
#include "../../support/usb_camera.hpp"
#include "../../support/waiting.hpp"
#include "../../system/arhost_run.hpp"
#include "../../system/listed_devices.hpp"
#include "../../system/suspend.hpp"
#include "../source_file/source_under_test.hpp"

#include <gmock/gmock.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <memory>

namespace fs = std::filesystem;
using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;

namespace {

// The number of camera interfaces that the kernel's driver uses. Each camera has two.
std::ptrdiff_t kernel_driven() {
    const fs::path driver = "/sys/bus/usb/drivers/uvcvideo";
    return !fs::exists(driver) ? 0 : std::count_if(fs::directory_iterator(driver), {}, [](const auto &entry) {
        return entry.path().filename().string().find(':') != std::string::npos;
    });
}

std::uint32_t number_of(const Octets &bytes) {
    return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | std::uint32_t{bytes[3]} << 24;
}

class Connected {
protected:
    void connect(const UsbCamera::Setup &setup) {
        camera_ = std::make_unique<UsbCamera>(setup);
        ASSERT_TRUE(eventually([] { return kernel_driven() >= 2; })) << "the kernel does not see the camera";
    }
    void unplug() {
        camera_.reset();
        ASSERT_TRUE(eventually([] { return kernel_driven() == 0; }));
    }
    // Captures small pictures, because the virtual machine is emulated and slow.
    arhost_status start(std::map<std::string, std::string> options = {}, bool live = true, double fps = 30) {
        options.try_emplace("usb", "1d6b:0104");
        return source_.start(options, source_setup(fps, live));
    }
    // Starts the source and reads frame 0; throws if that fails.
    void capture(const std::map<std::string, std::string> &options = {}, bool live = true) {
        if (start(options, live) != ARHOST_STATUS_OK)
            throw std::runtime_error(source_.log());
        source_.read_frame(0);
    }
    static std::string start_error(std::map<std::string, std::string> options,
                                   arhost_status expected = ARHOST_STATUS_ERROR_CONFIGURATION) {
        options.try_emplace("usb", "1d6b:0104");
        return SourceUnderTest::rejection("source_uvc", options, expected);
    }
    struct Setting {
        std::uint8_t unit, selector;
        Octets value;
    };
    void expect_controls(const std::vector<Setting> &settings) {
        for (const auto &[unit, selector, value] : settings)
            EXPECT_EQ(camera_->value(unit, selector), value) << "unit " << +unit << ", selector " << +selector;
    }

    std::unique_ptr<UsbCamera> camera_;
    SourceUnderTest source_{"source_uvc"};
    const Setting manual_exposure{UsbCamera::terminal, 0x02, {1}};
    const Setting exposure_of_10_ms{UsbCamera::terminal, 0x04, {100, 0, 0, 0}};
    const Setting gain_7{UsbCamera::processing, 0x04, {7, 0}};
    const Setting power_line_60_hz{UsbCamera::processing, 0x05, {2}};
    const Setting brightness_minus_5{UsbCamera::processing, 0x02, {0xfb, 0xff}};
};

class UvcCamera : public Connected, public testing::Test {
protected:
    void SetUp() override { connect({}); }
    void TearDown() override {
        source_.stop();
        unplug();
    }
};

class UvcReplug : public UvcCamera {};

struct Kind {
    const char *name;
    bool is_bulk;
    std::uint16_t version;
};

class UvcStream : public Connected, public testing::TestWithParam<Kind> {
protected:
    void SetUp() override { connect({.is_bulk = GetParam().is_bulk, .version = GetParam().version}); }
    void TearDown() override {
        source_.stop();
        unplug();
    }
};

} // namespace

TEST_P(UvcStream, DeliversUncompressedFramesUnchanged) {
    for (const bool is_nv12 : {false, true}) {
        SCOPED_TRACE(is_nv12 ? "NV12" : "YUY2");
        ASSERT_EQ(start({{"format", is_nv12 ? "nv12" : "yuyv"}}, false), ARHOST_STATUS_OK) << source_.log();
        EXPECT_EQ(source_.format().pixel_format, is_nv12 ? ARHOST_PIXEL_FORMAT_NV12 : ARHOST_PIXEL_FORMAT_YUYV);
        EXPECT_EQ(source_.format().width, UsbCamera::width);
        EXPECT_EQ(source_.format().height, UsbCamera::height);
        EXPECT_NEAR(source_.format().fps, 30, 0.01);
        EXPECT_EQ(source_.format().yuv_matrix, ARHOST_YUV_MATRIX_BT709);
        std::uint32_t last = 0;
        for (std::uint64_t n = 0; n < 20; ++n) {
            const SourceFrame frame = source_.read_frame(n);
            const std::uint32_t number = number_of(frame.bytes);
            ASSERT_TRUE(frame.bytes == UsbCamera::picture(number, is_nv12)) << "frame " << number;
            if (n > 0) {
                EXPECT_EQ(number, last + 1 + frame.info.skipped) << "the skipped frames are counted";
            }
            last = number;
        }
        EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
        source_.stop();
    }
}

TEST_P(UvcStream, DecodesMotionJpeg) {
    ASSERT_EQ(start({{"format", "mjpeg"}}), ARHOST_STATUS_OK) << source_.log();
    ASSERT_EQ(source_.format().pixel_format, ARHOST_PIXEL_FORMAT_BGR8);
    for (std::uint64_t n = 0; n < 10; ++n) {
        const SourceFrame frame = source_.read_frame(n);
        const int luma = frame.bytes[0], nearest = UsbCamera::luma_of(static_cast<std::uint32_t>((luma - 35) / 10));
        EXPECT_NEAR(luma, nearest, 2);
        EXPECT_TRUE(std::ranges::all_of(frame.bytes, [&](int value) { return std::abs(value - luma) <= 2; }));
    }
}

INSTANTIATE_TEST_SUITE_P(Kinds, UvcStream,
                         testing::Values(Kind{"isochronous_1_0", false, 0x0100},
                                         Kind{"isochronous_1_1", false, 0x0110},
                                         Kind{"isochronous_1_5", false, 0x0150}, Kind{"bulk_1_1", true, 0x0110}),
                         [](const auto &info) { return std::string(info.param.name); });

TEST_F(UvcCamera, StampsFramesWithTheMonotonicClock) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    std::int64_t last = 0;
    for (std::uint64_t n = 0; n < 30; ++n) {
        const SourceFrame frame = source_.read_frame(n);
        EXPECT_EQ(frame.info.clock, ARHOST_CLOCK_MONOTONIC);
        EXPECT_GE(frame.info.capture_ns, last); // equal where the camera's clock becomes known after late arrivals
        const std::int64_t age = monotonic_ns() - frame.info.capture_ns;
        EXPECT_GE(age, 0);
        EXPECT_LT(age, 1'000'000'000);
        last = frame.info.capture_ns;
    }
}

TEST_F(UvcCamera, DropsDamagedFramesAndCountsThemByCause) {
    capture({}, false);
    std::uint64_t n = 1, skipped = 0;
    for (const auto fault : {UsbCamera::Fault::marked, UsbCamera::Fault::shortened, UsbCamera::Fault::malformed}) {
        camera_->inject(fault);
        const std::uint64_t end = n + 8;
        for (; n < end; ++n) {
            const SourceFrame frame = source_.read_frame(n);
            EXPECT_TRUE(frame.bytes == UsbCamera::picture(number_of(frame.bytes), false));
            skipped += frame.info.skipped;
        }
    }
    EXPECT_GE(skipped, 3u);
    const auto counters = source_.plugin().counters();
    EXPECT_EQ(counters.at("marked_damaged"), 1u);
    EXPECT_EQ(counters.at("malformed"), 1u);
    EXPECT_EQ(counters.at("truncated"), 1u);
    EXPECT_EQ(counters.at("undecodable"), 0u);
}

TEST_F(UvcCamera, SetsControlsByName) {
    ASSERT_EQ(start({{"exposure", "100"},
                     {"focus", "40"},
                     {"gain", "7"},
                     {"white_balance", "5000"},
                     {"power_line_frequency", "60_hz"},
                     {"controls", "brightness=-5, tilt_absolute=-3, pan_absolute=7"},
                     {"extension", "4:2=0a0bff"}}),
              ARHOST_STATUS_OK)
        << source_.log();
    expect_controls({manual_exposure,
                     exposure_of_10_ms,
                     {UsbCamera::terminal, 0x08, {0}}, // no automatic focus
                     {UsbCamera::terminal, 0x06, {40, 0}},
                     {UsbCamera::terminal, 0x0d, {7, 0, 0, 0, 0xfd, 0xff, 0xff, 0xff}},
                     gain_7,
                     {UsbCamera::processing, 0x0b, {0}},
                     {UsbCamera::processing, 0x0a, {0x88, 0x13}},
                     power_line_60_hz,
                     brightness_minus_5,
                     {UsbCamera::extension, 2, {0x0a, 0x0b, 0xff}}});
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");

    ASSERT_EQ(start({{"exposure", "auto"},
                     {"focus", "auto"},
                     {"extension", "43424140-4544-4746-4849-4a4b4c4d4e4f:2=000000"}}),
              ARHOST_STATUS_OK)
        << source_.log();
    expect_controls({{UsbCamera::terminal, 0x02, {8}}, // aperture priority; it has no fully automatic mode
                     {UsbCamera::terminal, 0x08, {1}},
                     {UsbCamera::terminal, 0x06, {40, 0}}, // unchanged
                     {UsbCamera::extension, 2, {0, 0, 0}}});
}

TEST_F(UvcCamera, SetsControlsWhileItCaptures) {
    capture();
    for (const auto &[key, text] : {std::pair{"exposure", "100"},
                                    {"gain", "7"},
                                    {"power_line_frequency", "60_hz"},
                                    {"controls", "brightness=-5"}})
        EXPECT_EQ(source_.plugin().set_text(key, text), ARHOST_STATUS_OK) << key << "\n" << source_.log();
    expect_controls({manual_exposure, exposure_of_10_ms, gain_7, power_line_60_hz, brightness_minus_5});
    EXPECT_EQ(source_.plugin().set_text("exposure", "2"), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("does not accept '2' for 'exposure_time_absolute'; "
                                                              "valid: 3 to 2047"));
    expect_controls({exposure_of_10_ms});
    EXPECT_EQ(source_.read(1).status, ARHOST_STATUS_OK);
}

TEST_F(UvcCamera, RejectsControlsAndValuesThatItDoesNotHave) {
    const struct {
        const char *option, *value, *error;
    } cases[] = {
        {"controls", "sharpnes=3", "has no control 'sharpnes'; it has: auto_exposure, exposure_time_absolute, "},
        {"controls", "hue=3", "has no control 'hue'"},
        {"controls", "gain", "'gain' is not of the form NAME=VALUE"},
        {"exposure", "2", "does not accept '2' for 'exposure_time_absolute'; valid: 3 to 2047"},
        {"focus", "12", "valid: 0 to 250 in steps of 5"},
        {"gain", "auto", "has no control 'auto gain'"},
        {"controls", "auto_exposure=auto_mode", "valid: 1 (manual_mode), 3 (aperture_priority_mode)"},
        {"power_line_frequency", "auto", "valid: 0 (disabled), 1 (50_hz), 2 (60_hz)"},
        {"extension", "5:2=00", "has no extension unit '5'; it has: 4 (43424140-4544-"},
        {"extension", "4:2=00", "expects 3 bytes for extension unit 4, selector 2, not 1"},
    };
    for (const auto &[option, value, error] : cases)
        EXPECT_THAT(start_error({{option, value}}), HasSubstr(error)) << option;
    for (const char *malformed : {"4=00", "4:2", "4:2=", "4:2=0", "4:2=0g", "4:0=00", ":2=00", "=00", "4:300=00"})
        EXPECT_THAT(start_error({{"extension", malformed}}), HasSubstr("extension: ")) << malformed;
    camera_->change(UsbCamera::processing, 0x04, [](CameraControl &gain) { gain.info = 1; });
    EXPECT_THAT(start_error({{"gain", "3"}}), HasSubstr("does not let programs set 'gain'"));
    camera_->change(UsbCamera::processing, 0x04, [](CameraControl &gain) { gain.info = 5; });
    EXPECT_THAT(start_error({{"gain", "3"}}), HasSubstr("controls 'gain' automatically"));
}

TEST_F(UvcCamera, NamesWhatItOffersIfASizeOrFormatIsMissing) {
    EXPECT_THAT(start_error({{"width", "640"}, {"height", "480"}}),
                HasSubstr("has no size 640×480; it offers YUY2 (320×180 30 fps), NV12 (320×180 30 fps), MJPEG"));
    EXPECT_THAT(start_error({{"camera", "1"}}), HasSubstr("has no camera number 1, only 1"));
    ASSERT_EQ(start({}, true, 10), ARHOST_STATUS_OK) << source_.log();
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_WARNING),
                HasSubstr("delivers 30 fps at YUY2 320×180, not the configured 10 fps"));
}

TEST_F(UvcCamera, IsChosenBySerialNumber) {
    UsbCamera second({.serial = "0002:b"});
    ASSERT_TRUE(eventually([] { return kernel_driven() == 4; }));
    second.change(UsbCamera::processing, 0x04, [](CameraControl &gain) { gain.maximum = {3, 0}; });
    EXPECT_THAT(start_error({{"usb", "1d6b:0104:0002:b"}, {"gain", "50"}}), HasSubstr("valid: 0 to 3"));
    EXPECT_EQ(start({{"usb", "1d6b:0104:0001"}, {"gain", "50"}}), ARHOST_STATUS_OK) << source_.log();
    EXPECT_THAT(
        start_error({{"usb", "1d6b:0104:0003"}}, ARHOST_STATUS_ERROR_DEVICE_LOST),
        HasSubstr("there is no camera 1d6b:0104 with the serial number '0003'; visible: 1d6b:0104 (/dev/bus/usb/"));
}

TEST_F(UvcCamera, ReportsACameraInUse) {
    SourceUnderTest first("source_uvc");
    ASSERT_EQ(first.start({{"usb", "1d6b:0104"}}), ARHOST_STATUS_OK) << first.log();
    EXPECT_THAT(start_error({}, ARHOST_STATUS_ERROR_IO), HasSubstr("is in use by another program"));
    first.stop();
    EXPECT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
}

TEST_F(UvcCamera, ReturnsToTheKernelsDriver) {
    capture();
    EXPECT_EQ(kernel_driven(), 0);
    source_.stop();
    EXPECT_EQ(kernel_driven(), 2);
}

TEST_F(UvcCamera, ReportsAnUnplugAndReconnects) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    source_.stop();
    const std::size_t files = open_files();
    for (int round = 0; round < 3; ++round) {
        capture();
        camera_.reset();
        EXPECT_EQ(source_.read_all(1, 9).back().status, ARHOST_STATUS_ERROR_DEVICE_LOST);
        EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("has disappeared; was it unplugged?"));
        source_.stop();
        connect({});
        EXPECT_EQ(open_files(), files);
    }
}

// Takes a quarter of an hour.
TEST_F(UvcReplug, IsBackAThousandTimesWithoutLeaks) {
    std::size_t files = 0;
    [[maybe_unused]] std::size_t memory = 0;
    for (int round = 0; round < 1000; ++round) {
        ASSERT_EQ(start({{"format", "mjpeg"}}), ARHOST_STATUS_OK) << "round " << round << "\n" << source_.log();
        ASSERT_EQ(source_.read(0).status, ARHOST_STATUS_OK) << "round " << round << "\n" << source_.log();
        camera_.reset();
        ASSERT_EQ(source_.read_all(1, 9).back().status, ARHOST_STATUS_ERROR_DEVICE_LOST) << "round " << round << "\n"
                                                                                         << source_.log();
        source_.stop();
        connect({});
        if (round == 20) {
            files = open_files();
            memory = resident_kib();
        }
    }
    EXPECT_EQ(open_files(), files);
#ifndef __SANITIZE_ADDRESS__ // ASan delays freeing memory and has its own leak checker
    EXPECT_LT(resident_kib(), memory + 4096);
#endif
}

TEST_F(UvcCamera, StopsWaitingWhenCancelled) {
    unplug();
    connect({.is_silent = true});
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    source_.plugin().cancel(3);
    EXPECT_EQ(source_.read(0).status, ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_ERROR), "");
}

TEST_F(UvcCamera, ThatSendsNothingIsLost) {
    unplug();
    connect({.is_silent = true});
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << source_.log();
    EXPECT_EQ(source_.read(0).status, ARHOST_STATUS_ERROR_DEVICE_LOST);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("has delivered no intact picture for 5 s"));
}

// ---- arhost with its sandbox -----------------------------------------------------------------------

namespace {

class UvcRun : public UvcCamera {
protected:
    static std::string configuration(const std::string &access, const std::string &more = "") {
        return "version: 1\nmode: live\nsandbox: strict\nsource: {plugin: source_uvc, fps: 30, " + access +
               "}\ncamera: {width: 320, height: 180, fx: 300}\n"
               "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
               "outputs: [{plugin: sink_poses, path: out/poses.jsonl}]\nstats: stats.json\n" +
               more;
    }
    void start(const std::string &more = "") {
        run.write("run.yaml", configuration(usb, more));
        run.start({"run.yaml", "--allow-no-target"});
        ASSERT_TRUE(proceeds()) << run.output();
    }
    std::ptrdiff_t frames() const {
        const std::string text = run.exists("out/poses.jsonl") ? run.read("out/poses.jsonl") : "";
        return std::count(text.begin(), text.end(), '\n');
    }
    // Waits for further frames.
    bool proceeds(std::ptrdiff_t count = 15) const {
        const std::ptrdiff_t before = frames();
        return eventually([&] { return !run.running() || frames() >= before + count; }) && run.running();
    }
    void end() {
        send_signal(run.pid(), SIGINT);
        run.wait();
    }
    // The worker that uses the camera's node.
    static pid_t worker_of_camera() {
        std::error_code ignored;
        for (const auto &process : fs::directory_iterator("/proc", ignored)) {
            const std::string pid = process.path().filename();
            if (pid.find_first_not_of("0123456789") != std::string::npos || std::stoi(pid) == getpid())
                continue;
            for (const auto &fd : fs::directory_iterator(process.path() / "fd", ignored))
                if (fs::read_symlink(fd.path(), ignored).string().find("/bus/usb/") != std::string::npos)
                    return std::stoi(pid);
        }
        return -1;
    }
    const std::string usb = "usb: {vendor: 1d6b, product: 0104, serial: 0001}";
    ArhostRun run;
};

} // namespace

TEST_F(UvcRun, CapturesInTheSandboxWithAccessToOneDevice) {
    ASSERT_NO_FATAL_FAILURE(start());
    EXPECT_EQ(kernel_driven(), 0);
    end();
    EXPECT_THAT(run.output(), HasSubstr("YUY2 320×180"));
    EXPECT_TRUE(eventually([] { return kernel_driven() == 2; }));
}

TEST_F(UvcRun, OtherDevicesDoNotExistInTheSandbox) {
    const struct {
        std::string access;
        const char *error; // empty: none
    } cases[] = {
        {"usb: {vendor: 1d6b, product: 0104, serial: 9}",
         "there is no camera 1d6b:0104 with the serial number '9'; no USB camera is visible"},
        {"allow: []", "or better 'usb: {vendor: …, product: …}'"},
        {usb + ", options: {usb: '1d6b:0104'}", "the device is also given by the key 'usb'"},
        {"allow: [usb]", ""},
    };
    for (const auto &[access, error] : cases) {
        run.write("run.yaml", configuration(access));
        EXPECT_EQ(run.run({"check", "run.yaml"}) != 0, *error != '\0') << access << run.output();
        EXPECT_THAT(run.output(), HasSubstr(error)) << access;
    }
}

TEST_F(UvcRun, SurvivesAnUnplug) {
    ASSERT_NO_FATAL_FAILURE(start());
    for (int round = 0; round < 2; ++round) {
        camera_.reset();
        camera_ = std::make_unique<UsbCamera>(UsbCamera::Setup{});
        EXPECT_TRUE(proceeds(30)) << run.output();
    }
    end();
    EXPECT_THAT(run.output(), HasSubstr("was it unplugged?"));
    EXPECT_GE(run.stats()["restarts"]["source"], 2);
    EXPECT_TRUE(eventually([] { return kernel_driven() == 2; }));
}

// The keys `restart` have their defaults, by which five failures in about four seconds disable a component.
TEST_F(UvcRun, SurvivesASuspend) {
    ASSERT_NO_FATAL_FAILURE(start());
    ASSERT_TRUE(suspend_processes());
    EXPECT_TRUE(proceeds(40)) << run.output();
    end();
    const nlohmann::json stats = run.stats();
    for (const auto &[component, restarts] : stats["restarts"].items())
        EXPECT_EQ(restarts, 0) << component << ":\n" << run.output();
}

TEST_F(UvcRun, WaitsUntilTheCameraIsPluggedInAgain) {
    ASSERT_NO_FATAL_FAILURE(start());
    unplug();
    std::this_thread::sleep_for(std::chrono::seconds(20));
    connect({});
    EXPECT_TRUE(proceeds()) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("is it connected?; waiting for its device"));
    EXPECT_THAT(run.output(), HasSubstr("its device is back"));
    unplug();
    EXPECT_TRUE(eventually([&] { return run.output().rfind("waiting for") > run.output().rfind("is back"); }));
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(), 130) << run.output();
    // Each unplug counts once, however many processes look for the camera meanwhile.
    EXPECT_EQ(run.stats()["restarts"]["source"], 2) << run.output();
    connect({});
}

TEST_F(UvcRun, TheKernelsDriverReturnsIfTheWorkerIsKilled) {
    // Without further attempts, nothing else returns the camera.
    ASSERT_NO_FATAL_FAILURE(start("restart: {proven_after_frames: 1000000, quarantine_after: 1}\n"));
    const pid_t worker = worker_of_camera();
    ASSERT_GT(worker, 0);
    send_signal(worker, SIGKILL);
    EXPECT_TRUE(eventually([] { return kernel_driven() == 2; })) << run.output();
    run.wait();
}

TEST_F(UvcRun, ContinuesIfTheWorkerIsKilled) {
    ASSERT_NO_FATAL_FAILURE(start());
    for (int round = 0; round < 3; ++round) {
        send_signal(worker_of_camera(), SIGKILL);
        EXPECT_TRUE(proceeds(30)) << run.output();
    }
    end();
    EXPECT_TRUE(eventually([] { return kernel_driven() == 2; }));
}

TEST_F(UvcRun, TheKernelsDriverReturnsIfArhostIsKilled) {
    ASSERT_NO_FATAL_FAILURE(start());
    send_signal(run.pid(), SIGKILL);
    EXPECT_TRUE(eventually([] { return kernel_driven() == 2; }));
}

// ---- arhost devices ----------------------------------------------------------------------------------

namespace {

nlohmann::json listed_cameras(uid_t user = 0, const char *plugin = "source_uvc") {
    const nlohmann::json json = listed_devices(plugin, user);
    EXPECT_TRUE(json["problems"].empty()) << json;
    return json["cameras"];
}

} // namespace

TEST_F(UvcCamera, IsListedWithFormatsSizesRatesAndControls) {
    const nlohmann::json cameras = listed_cameras();
    ASSERT_EQ(cameras.size(), 1u) << cameras;
    EXPECT_EQ(cameras[0]["plugin"], "source_uvc");
    EXPECT_THAT(cameras[0]["name"], HasSubstr("(usb 1d6b:0104)"));
    EXPECT_THAT(cameras[0]["path"], testing::StartsWith("/dev/bus/usb/"));
    EXPECT_EQ(cameras[0]["serial"], "0001");
    EXPECT_EQ(cameras[0]["problem"], nullptr);
    ASSERT_EQ(cameras[0]["formats"].size(), 3u);
    EXPECT_EQ(cameras[0]["formats"][0]["pixel_format"], "yuyv");
    EXPECT_EQ(cameras[0]["formats"][0]["sizes"][0]["width"], UsbCamera::width);
    EXPECT_NEAR(cameras[0]["formats"][0]["sizes"][0]["rates"][0].get<double>(), 30, 0.01);
    EXPECT_TRUE(cameras[0]["controls"].empty()) << "they cannot be read while the kernel's driver has the camera";
    EXPECT_EQ(kernel_driven(), 2) << "a listing does not take the camera from the kernel's driver";
}

TEST_F(UvcCamera, IsListedWithControlsIfNoDriverUsesIt) {
    const fs::path driver = "/sys/bus/usb/drivers/uvcvideo";
    for (const fs::path &entry : std::vector<fs::path>(fs::directory_iterator(driver), {}))
        if (entry.filename().string().find(':') != std::string::npos)
            std::ofstream(driver / "unbind") << entry.filename().string();
    ASSERT_EQ(kernel_driven(), 0);
    const nlohmann::json controls = listed_cameras().at(0)["controls"];
    const nlohmann::json focus = element_with(controls, "name", "focus_absolute");
    EXPECT_EQ(focus["minimum"], 0) << controls;
    EXPECT_EQ(focus["maximum"], 250);
    EXPECT_EQ(focus["step"], 5);
}

TEST_F(UvcCamera, IsListedWithTheReasonWhyItCannotBeOpened) {
    for (const auto &node : fs::recursive_directory_iterator("/dev/bus/usb"))
        if (node.is_character_file())
            fs::permissions(node, fs::perms(0664)); // as udev sets them
    const nlohmann::json cameras = listed_cameras(1000);
    ASSERT_EQ(cameras.size(), 1u) << cameras;
    EXPECT_THAT(cameras[0]["problem"],
                HasSubstr("it cannot be opened: Permission denied; a udev rule can permit it: SUBSYSTEM==\"usb\", "
                          "ATTR{idVendor}==\"1d6b\""));
    EXPECT_EQ(cameras[0]["formats"].size(), 3u) << "everyone may read the descriptors";
}

TEST_F(UvcCamera, IsListedWhileItCaptures) {
    capture();
    const nlohmann::json cameras = listed_cameras();
    ASSERT_EQ(cameras.size(), 1u) << cameras;
    EXPECT_THAT(cameras[0]["problem"], HasSubstr("in use by "));
    EXPECT_EQ(source_.read(1).status, ARHOST_STATUS_OK);
}

// ---- The kernel's driver with the same camera ------------------------------------------------------

TEST_F(UvcCamera, IsCapturedByTheV4l2SourceToo) {
    ASSERT_TRUE(eventually([] { return fs::exists("/dev/video0"); }));
    const arhost_source_setup setup = source_setup(30, false);
    SourceUnderTest v4l2("source_v4l2",
                         {{"device", "/dev/video0"},
                          {"format", "yuyv"},
                          {"exposure", "100"},
                          {"focus", "40"},
                          {"white_balance", "5000"},
                          {"power_line_frequency", "60_hz"},
                          {"controls", "gain=7, tilt_absolute=-3"}},
                         setup);
    for (std::uint64_t n = 0; n < 10; ++n) {
        const SourceFrame frame = v4l2.read_frame(n);
        EXPECT_TRUE(frame.bytes == UsbCamera::picture(number_of(frame.bytes), false));
    }
    expect_controls({manual_exposure,
                     exposure_of_10_ms,
                     {UsbCamera::terminal, 0x08, {0}},
                     {UsbCamera::terminal, 0x06, {40, 0}},
                     {UsbCamera::processing, 0x0a, {0x88, 0x13}},
                     power_line_60_hz,
                     gain_7});
    v4l2.stop();
    ASSERT_EQ(
        v4l2.start({{"device", "/dev/video0"}, {"format", "mjpeg"}, {"exposure", "auto"}, {"focus", "auto"}}, setup),
        ARHOST_STATUS_OK)
        << v4l2.log();
    EXPECT_EQ(v4l2.read(0).status, ARHOST_STATUS_OK);
    expect_controls({{UsbCamera::terminal, 0x02, {8}}, {UsbCamera::terminal, 0x08, {1}}});
}

// ---- A depth camera beside a colour camera ---------------------------------------------------------

// Two cameras with the kernel's driver: colour at 10 fps, depth at 6.7 fps. The latency of the emulated machine is
// small beside such frame times.
class DepthBesideColour : public UvcCamera {
protected:
    static constexpr std::int64_t colour_interval_ns = 100'000'000;
    static constexpr std::int64_t depth_interval_ns = 150'000'000;

    void SetUp() override {
        connect({.interval_ns = colour_interval_ns});
        connect_depth();
        ASSERT_TRUE(eventually([] { return !node_of("0001").empty() && !node_of("0002").empty(); }));
    }
    void TearDown() override {
        depth_.reset();
        unplug();
    }
    void connect_depth() {
        depth_ = std::make_unique<UsbCamera>(
            UsbCamera::Setup{.serial = "0002", .is_depth = true, .interval_ns = depth_interval_ns});
        ASSERT_TRUE(eventually([] { return kernel_driven() >= 4; }));
    }
    // The node that captures from the camera with this serial number; empty if there is none.
    static std::string node_of(const std::string &serial) {
        const fs::path nodes = "/sys/class/video4linux";
        if (!fs::exists(nodes))
            return "";
        for (const auto &node : fs::directory_iterator(nodes)) {
            std::string found, index;
            std::error_code ignored;
            std::ifstream(fs::canonical(node.path() / "device", ignored).parent_path() / "serial") >> found;
            std::ifstream(node.path() / "index") >> index;
            if (found == serial && index == "0")
                return "/dev/" + node.path().filename().string();
        }
        return "";
    }
    std::map<std::string, std::string> options() const {
        return {{"device", node_of("0001")}, {"format", "yuyv"}, {"depth_device", node_of("0002")}};
    }
    static std::vector<std::uint16_t> depth_picture(std::uint32_t number) {
        const Octets bytes = UsbCamera::picture(number, false);
        std::vector<std::uint16_t> depths(bytes.size() / 2);
        std::memcpy(depths.data(), bytes.data(), bytes.size());
        return depths;
    }
    std::int64_t difference_ns(std::uint32_t colour_number, std::uint32_t depth_number) {
        return std::abs(camera_->sent_ns(colour_number) - depth_->sent_ns(depth_number));
    }

    std::unique_ptr<UsbCamera> depth_;
    SourceUnderTest v4l2_{"source_v4l2"};
};

TEST_F(DepthBesideColour, EachFrameHasTheDepthThatWasCapturedNearest) {
    for (const bool is_live : {false, true}) {
        SCOPED_TRACE(is_live);
        ASSERT_EQ(v4l2_.start(options(), source_setup(10, is_live)), ARHOST_STATUS_OK) << v4l2_.log();
        ASSERT_TRUE(v4l2_.format().has_depth);
        int without_depth = 0, far = 0;
        for (std::uint64_t n = 0; n < 40; ++n) {
            const SourceFrame frame = v4l2_.read_frame(n);
            const std::uint32_t colour = number_of(frame.bytes);
            if (std::ranges::count(frame.depth_mm, 0) == std::ssize(frame.depth_mm)) {
                ++without_depth;
                continue;
            }
            const std::uint32_t depth = frame.depth_mm[0] | std::uint32_t{frame.depth_mm[1]} << 16;
            EXPECT_TRUE(frame.depth_mm == depth_picture(depth)) << "frame " << colour;
            // The kernel stamps a frame when it arrives: the latency of this machine after the camera sent it.
            constexpr std::int64_t latency_ns = 25'000'000;
            constexpr std::uint64_t first_on_time = 5; // the cameras send their first frames at once
            far += n >= first_on_time && difference_ns(colour, depth) > depth_interval_ns / 2 + latency_ns;
        }
        EXPECT_LE(far, 8) << "only when this machine delays a camera";
        EXPECT_LE(without_depth, 8) << "only before the first depth frame, or if one was late";
        v4l2_.stop();
    }
}

TEST_F(DepthBesideColour, DepthIsConvertedToMillimetres) {
    auto converting = options();
    converting["depth_unit_mm"] = "0.125";
    ASSERT_EQ(v4l2_.start(converting), ARHOST_STATUS_OK) << v4l2_.log();
    for (std::uint64_t n = 0; n < 10; ++n) {
        const SourceFrame frame = v4l2_.read_frame(n);
        if (frame.depth_mm.back() == 0)
            continue;
        // Frames 0 to 99 differ in their last value.
        std::uint32_t number = 0;
        const auto last = [](std::uint32_t of) { return std::lround(depth_picture(of).back() * 0.125); };
        while (number < 100 && last(number) != frame.depth_mm.back())
            ++number;
        const std::vector<std::uint16_t> expected = depth_picture(number);
        for (std::size_t i = 2; i < expected.size(); ++i)
            ASSERT_EQ(frame.depth_mm[i], std::lround(expected[i] * 0.125)) << i;
    }
}

TEST_F(DepthBesideColour, ALostDepthCameraIsALostDevice) {
    ASSERT_EQ(v4l2_.start(options(), source_setup(0, true)), ARHOST_STATUS_OK) << v4l2_.log();
    ASSERT_EQ(v4l2_.read(0).status, ARHOST_STATUS_OK);
    depth_.reset();
    EXPECT_EQ(v4l2_.read_all(1, 199).back().status, ARHOST_STATUS_ERROR_DEVICE_LOST) << v4l2_.log();
}

TEST_F(DepthBesideColour, ASilentDepthCameraLeavesTheVideoRunning) {
    depth_.reset();
    ASSERT_TRUE(eventually([] { return kernel_driven() == 2; }));
    depth_ = std::make_unique<UsbCamera>(
        UsbCamera::Setup{.serial = "0002", .is_silent = true, .is_depth = true, .interval_ns = depth_interval_ns});
    ASSERT_TRUE(eventually([] { return kernel_driven() >= 4 && !node_of("0002").empty(); }));
    ASSERT_EQ(v4l2_.start(options()), ARHOST_STATUS_OK) << v4l2_.log();
    for (std::uint64_t n = 0; n < 20; ++n) {
        const SourceFrame frame = v4l2_.read_frame(n);
        EXPECT_EQ(std::ranges::count(frame.depth_mm, 0), std::ssize(frame.depth_mm)) << "unknown";
    }
}

TEST_F(DepthBesideColour, UnsuitableDepthDevicesAreRejected) {
    const auto error_of = [&](const std::string &depth_device) {
        auto wrong = options();
        wrong["depth_device"] = depth_device;
        EXPECT_EQ(v4l2_.start(wrong), ARHOST_STATUS_ERROR_CONFIGURATION);
        const std::string text = v4l2_.log(ARHOST_SEVERITY_ERROR);
        v4l2_.stop();
        return text;
    };
    EXPECT_THAT(error_of("/dev/video99"), HasSubstr("depth_device: '/dev/video99' does not exist; available: "));
    EXPECT_THAT(error_of(node_of("0001")), HasSubstr("offers no depth (Z16), only YUYV"));
}

TEST_F(DepthBesideColour, TheDepthCameraIsListed) {
    const nlohmann::json cameras = listed_cameras(0, "source_v4l2");
    EXPECT_EQ(element_with(cameras, "serial", "0002")["formats"][0]["pixel_format"], "z16") << cameras;
}

TEST_F(DepthBesideColour, ARunWritesDepthFromTheSandbox) {
    ArhostRun run("version: 1\nmode: live\nsandbox: strict\nframes: 20\n"
                  "source: {plugin: source_v4l2, allow: [video], fps: 10, options: {device: " +
                  node_of("0001") + ", format: yuyv, depth_device: " + node_of("0002") +
                  "}}\noutputs: [{plugin: sink_images, path: out/depth_%d.png, options: {content: depth}}]\n"
                  "stats: stats.json\n");
    EXPECT_EQ(run.run({"run.yaml"}), 0) << run.output();
    EXPECT_TRUE(run.stats()["counters"]["source"].contains("without_depth")) << run.stats()["counters"];
    const auto files = std::distance(fs::directory_iterator(run.path("out")), {});
    EXPECT_GE(files, 10);
}
