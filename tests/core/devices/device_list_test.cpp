// SPDX-License-Identifier: Apache-2.0
#include "devices/device_list.hpp"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <limits>

using namespace arhost::devices;
using Json = nlohmann::json;
using testing::HasSubstr;

namespace {

// A camera in the C structs of the ABI, and the structs that it refers to.
struct Camera {
    std::vector<double> rates = {30, 15};
    arhost_device_size size{sizeof(arhost_device_size), 640, 480, 2, 0, 0, rates.data()};
    arhost_device_format format{sizeof(arhost_device_format), 1, 0, 0, "yuyv", &size};
    arhost_device_control control{
        sizeof(arhost_device_control), ARHOST_DEVICE_CONTROL_INTEGER, 1, 0, "gain", 0, 9, 1, 4, 5};
    arhost_device device{sizeof(arhost_device),
                         0,
                         ARHOST_DEVICE_CAMERA,
                         ARHOST_DEVICE_STATE_USABLE,
                         0,
                         1,
                         1,
                         0,
                         0,
                         0,
                         0,
                         "Eye",
                         "/dev/video0",
                         nullptr,
                         nullptr,
                         nullptr,
                         &format,
                         &control};

    Camera() = default;
    Camera(const Camera &) = delete;
    Camera &operator=(const Camera &) = delete;
};

// Returns the reason why a camera that `change` has modified is rejected; "" if it is accepted.
std::string fault(const std::function<void(Camera &)> &change) {
    Camera camera;
    change(camera);
    try {
        describe(&camera.device);
        return "";
    } catch (const std::runtime_error &error) {
        return error.what();
    }
}

DeviceDescription round_trip(const DeviceDescription &device) {
    return devices_from_text(to_text(DeviceList{{device}, 0})).value().devices.at(0);
}

// Returns a list with the described camera, in which `change` has modified the JSON.
std::string changed(const std::function<void(Json &)> &change) {
    const Camera camera;
    Json list = Json::parse(to_text(DeviceList{{describe(&camera.device)}, 0}));
    change(list);
    return list.dump();
}

} // namespace

TEST(DeviceList, SurvivesTheConversionToText) {
    Camera camera;
    camera.size.is_rate_range = 1;
    camera.device.serial = "Größe \"5\"";
    const DeviceDescription device = describe(&camera.device);
    EXPECT_EQ(device.formats[0].sizes[0].rates, camera.rates);
    EXPECT_EQ(device.controls[0].value, 5);
    EXPECT_EQ(round_trip(device), device);
    EXPECT_EQ(devices_from_text(to_text(std::nullopt)), std::nullopt);
}

TEST(DeviceList, KeepsLimitsOfControls) {
    Camera camera;
    camera.control.minimum = camera.control.value = std::numeric_limits<std::int64_t>::min();
    camera.control.maximum = std::numeric_limits<std::int64_t>::max();
    const DeviceDescription device = describe(&camera.device);
    EXPECT_EQ(round_trip(device), device);
    camera.control.has_value = 0;
    EXPECT_EQ(describe(&camera.device).controls[0].value, std::nullopt);
}

// A newer plugin's structs may be longer.
TEST(DeviceList, StepsThroughArraysByTheSizeOfTheirElements) {
    struct Longer {
        arhost_device_control known;
        std::uint64_t unknown = 0xa5a5a5a5a5a5a5a5;
    } controls[2];
    Camera camera;
    for (Longer &longer : controls) {
        longer.known = camera.control;
        longer.known.struct_size = sizeof longer;
    }
    controls[1].known.name = "focus";
    camera.device.controls = &controls[0].known;
    camera.device.control_count = 2;
    const DeviceDescription device = describe(&camera.device);
    ASSERT_EQ(device.controls.size(), 2u);
    EXPECT_EQ(device.controls[1].name, "focus");
    EXPECT_EQ(device.controls[1].default_value, 4);
}

TEST(DeviceList, LimitsArraysAndTexts) {
    Camera camera;
    const std::vector<arhost_device_format> formats(1000, camera.format);
    const std::vector<arhost_device_size> sizes(1000, camera.size);
    const std::vector<arhost_device_control> controls(1000, camera.control);
    const std::vector<double> rates(1000, 25.0);
    const std::string text(1000, 'x');
    camera.device.formats = formats.data();
    camera.device.controls = controls.data();
    camera.device.format_count = camera.device.control_count = 1000;
    DeviceDescription device = describe(&camera.device);
    EXPECT_EQ(device.formats.size(), 128u);
    EXPECT_EQ(device.controls.size(), 256u);
    camera.device.formats = &camera.format;
    camera.device.format_count = 1;
    camera.format.sizes = sizes.data();
    camera.format.size_count = 1000;
    camera.format.pixel_format = text.c_str();
    device = describe(&camera.device);
    EXPECT_EQ(device.formats[0].sizes.size(), 64u);
    EXPECT_EQ(device.formats[0].pixel_format, text.substr(0, max_device_text_size) + "…");
    camera.format.sizes = &camera.size;
    camera.format.size_count = 1;
    camera.size.rates = rates.data();
    camera.size.rate_count = 1000;
    EXPECT_EQ(describe(&camera.device).formats[0].sizes[0].rates.size(), 64u);
}

TEST(DeviceList, RejectsAListThatIsTooLong) {
    const Camera camera;
    DeviceDescription device = describe(&camera.device);
    device.formats.assign(128, {"yuyv", false, {64, {640, 480, false, std::vector<double>(64, 29.97)}}});
    EXPECT_THROW(to_text(DeviceList{{device, device}, 0}), std::runtime_error);
    EXPECT_THROW(devices_from_text(std::string(max_device_list_size + 1, ' ')), std::runtime_error);
}

TEST(DeviceList, RejectsViolationsOfTheContract) {
    constexpr double infinite = std::numeric_limits<double>::infinity();
    EXPECT_EQ(fault([](Camera &) {}), "");
    EXPECT_THROW(describe(nullptr), std::runtime_error);
    const std::pair<const char *, std::function<void(Camera &)>> cases[] = {
        {"a device whose struct_size is too small", [](Camera &c) { c.device.struct_size -= 8; }},
        {"a device without a name", [](Camera &c) { c.device.name = nullptr; }},
        {"'Eye' with an invalid state", [](Camera &c) { c.device.state = 0; }},
        {"'Eye' with an invalid state", [](Camera &c) { c.device.state = 5; }},
        {"'Eye' as unusable without its problem", [](Camera &c) { c.device.state = ARHOST_DEVICE_STATE_UNUSABLE; }},
        {"'Eye' with a problem but usable", [](Camera &c) { c.device.problem = "dust"; }},
        {"as busy or forbidden without its path",
         [](Camera &c) {
             c.device.state = ARHOST_DEVICE_STATE_BUSY;
             c.device.path = nullptr;
         }},
        {"although it is no camera", [](Camera &c) { c.device.kind = ARHOST_DEVICE_DISPLAY; }},
        {"a refresh rate that is not finite", [](Camera &c) { c.device.rate = infinite; }},
        {"an array of formats that is NULL", [](Camera &c) { c.device.formats = nullptr; }},
        {"an array of formats whose struct_size", [](Camera &c) { c.format.struct_size = 0; }},
        {"a pixel format without a name", [](Camera &c) { c.format.pixel_format = ""; }},
        {"a range of sizes without", [](Camera &c) { c.format.is_size_range = 1; }},
        {"an array of sizes that is NULL", [](Camera &c) { c.format.sizes = nullptr; }},
        {"a size of 0×480 px", [](Camera &c) { c.size.width = 0; }},
        {"an array of rates that is NULL", [](Camera &c) { c.size.rates = nullptr; }},
        {"a frame rate that is not finite", [](Camera &c) { c.rates[0] = infinite; }},
        {"a frame rate that is not finite", [](Camera &c) { c.rates[1] = 0; }},
        {"frame rates that do not begin with the highest", [](Camera &c) { c.rates[0] = 1; }},
        {"a range of frame rates without two ends",
         [](Camera &c) {
             c.size.is_rate_range = 1;
             c.size.rate_count = 1;
         }},
        {"an array of controls that is NULL", [](Camera &c) { c.device.controls = nullptr; }},
        {"a control without a name", [](Camera &c) { c.control.name = nullptr; }},
        {"'gain' with an invalid type", [](Camera &c) { c.control.type = 0; }},
        {"'gain' with an invalid range", [](Camera &c) { c.control.minimum = 10; }},
        {"'gain' with an invalid range", [](Camera &c) { c.control.step = -1; }},
    };
    for (const auto &[what, change] : cases)
        EXPECT_THAT(fault(change), HasSubstr(what));
}

// Workers are not trusted.
TEST(DeviceList, RejectsMalformedText) {
    EXPECT_TRUE(devices_from_text(changed([](Json &) {})));
    const std::function<void(Json &)> cases[] = {
        [](Json &list) { list = 5; },
        [](Json &list) { list["devices"] = 5; },
        [](Json &list) { list["devices"] = Json::array_t(65, list["devices"][0]); },
        [](Json &list) { list.erase("left_out"); },
        [](Json &list) { list["devices"][0]["name"] = std::string(1000, 'x'); },
        [](Json &list) { list["devices"][0]["serial"] = nullptr; },
        [](Json &list) { list["devices"][0]["index"] = "first"; },
        [](Json &list) { list["devices"][0]["is_default"] = 2; },
        [](Json &list) { list["devices"][0]["state"] = 0; },
        [](Json &list) { list["devices"][0]["rate"] = nullptr; },
        [](Json &list) { list["devices"][0]["formats"][0].erase("sizes"); },
        [](Json &list) {
            list["devices"][0]["formats"][0]["sizes"][0]["rates"] = {1, 2};
        },
        [](Json &list) { list["devices"][0]["formats"][0]["sizes"][0]["rates"] = std::vector<double>(65, 1.0); },
        [](Json &list) { list["devices"][0]["controls"][0]["value"] = "much"; },
        [](Json &list) { list["devices"][0]["controls"][0]["minimum"] = 10; },
    };
    for (const auto &change : cases)
        EXPECT_THROW(devices_from_text(changed(change)), std::exception) << changed(change);
    EXPECT_THROW(devices_from_text("{"), std::exception);
}
