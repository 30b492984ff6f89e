// SPDX-License-Identifier: Apache-2.0
//
// Tests the adapters of arhost-cpp/plugin.hpp.
#include <arhost-cpp/plugin.hpp>

#include <gtest/gtest.h>

#include <sstream>
#include <utility>

namespace {

class Thrower {
public:
    Thrower(const arhost::Host &, const arhost::Options &options) {
        if (options.boolean("reject"))
            throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "rejected");
    }
    void start(const arhost_tracker_setup &) { throw std::runtime_error("no luck"); }
    void track(const arhost_track_request &, arhost_tracker_result &) { throw std::bad_alloc(); }
    static std::vector<arhost::Device> devices() {
        if (no_devices)
            throw arhost::Failure(ARHOST_STATUS_ERROR_IO, "no driver");
        return {{.index = 3,
                 .kind = ARHOST_DEVICE_VIRTUAL_GPU,
                 .is_default = true,
                 .name = "Thrower's",
                 .serial = "a-b",
                 .abilities = "throws"},
                {.index = 4,
                 .kind = ARHOST_DEVICE_CAMERA,
                 .state = ARHOST_DEVICE_STATE_UNUSABLE,
                 .name = "Else",
                 .path = "/dev/else",
                 .problem = "broken",
                 .formats = {{"grey", {{4, 3, {30, 5}, true}}, false}, {"yuyv", {}, true}},
                 .controls = {{"gain", ARHOST_DEVICE_CONTROL_INTEGER, -1, 9, 2, 3, 5},
                              {"reset", ARHOST_DEVICE_CONTROL_BUTTON}}},
                {.index = 5, .kind = ARHOST_DEVICE_DISPLAY, .name = "Screen", .width = 8, .height = 6, .rate = 60}};
    }
    static inline bool no_devices = false;
};
constexpr arhost_option_descriptor options[] = {arhost::option(ARHOST_OPTION_BOOL, "reject", "false", "Fails")};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_TRACKER,
                                          "org.arhost.test.thrower",
                                          "Thrower",
                                          "0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Throws.",
                                          0,
                                          1,
                                          options,
                                          nullptr};

std::string logged;
const arhost_host host = {sizeof host,
                          ARHOST_ABI_VERSION,
                          "test",
                          "0",
                          nullptr,
                          [](const arhost_host *, arhost_severity, const char *text) { logged = text; },
                          [](const arhost_host *, double, const char *) {},
                          [](const arhost_host *) { return 0; },
                          [](const arhost_host *, const char *) -> const void * { return nullptr; }};

} // namespace

ARHOST_TRACKER(Thrower, descriptor)

TEST(CppHelper, ConvertsExceptionsToStatusesAndMessages) {
    const arhost_offer offer{sizeof offer, ARHOST_ABI_VERSION, ARHOST_ABI_VERSION};
    arhost_answer answer{sizeof answer, 99, nullptr};
    ASSERT_EQ(arhost_entry.negotiate(&offer, &answer), ARHOST_STATUS_OK);
    EXPECT_EQ(answer.abi_version, ARHOST_ABI_VERSION);
    const auto &tracker = *static_cast<const arhost_tracker *>(answer.plugin->functions);

    arhost_option reject{sizeof reject, ARHOST_OPTION_BOOL, "reject", 1, 0, ""};
    arhost_instance *instance = nullptr;
    EXPECT_EQ(answer.plugin->create(&host, &reject, 1, &instance), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_EQ(logged, "rejected");
    EXPECT_EQ(instance, nullptr);

    reject.integer = 0;
    ASSERT_EQ(answer.plugin->create(&host, &reject, 1, &instance), ARHOST_STATUS_OK);
    const arhost_tracker_setup setup{};
    EXPECT_EQ(tracker.start(instance, &setup), ARHOST_STATUS_ERROR_INTERNAL);
    EXPECT_EQ(logged, "no luck");
    const arhost_track_request request{};
    arhost_tracker_result result{};
    EXPECT_EQ(tracker.state_size, nullptr);
    EXPECT_EQ(tracker.track(instance, &request, &result), ARHOST_STATUS_ERROR_OUT_OF_MEMORY);
    tracker.stop(instance);
    answer.plugin->destroy(instance);

    EXPECT_EQ(answer.plugin->create(&host, nullptr, 0, &instance), ARHOST_STATUS_ERROR_INVALID_ARGUMENT)
        << "a missing option";
}

TEST(CppHelper, AddsTheDevicesExtensionToAClassWithDevices) {
    EXPECT_EQ(arhost_plugin_object.get_extension("arhost.devices/1"), nullptr);
    const void *extension = arhost_plugin_object.get_extension("arhost.devices/2");
    ASSERT_NE(extension, nullptr);
    const auto &devices = *static_cast<const arhost_devices *>(extension);
    EXPECT_EQ(devices.struct_size, sizeof(arhost_devices));

    std::vector<std::string> listed;
    const arhost_take_device take = [](void *context, const arhost_device *device) {
        EXPECT_EQ(device->struct_size, sizeof(arhost_device));
        const auto text = [](const char *t) { return t ? std::string(t) : "none"; };
        std::ostringstream line;
        line << device->index << " " << device->kind << " " << device->state
             << (device->is_default ? " default " : " ") << device->name << " " << text(device->path) << " "
             << text(device->serial) << " " << text(device->abilities) << " " << text(device->problem) << " "
             << device->width << "x" << device->height << "@" << device->rate;
        for (std::uint32_t f = 0; f < device->format_count; ++f) {
            const arhost_device_format &format = device->formats[f];
            EXPECT_EQ(format.struct_size, sizeof format);
            line << " " << format.pixel_format << format.is_size_range;
            for (std::uint32_t s = 0; s < format.size_count; ++s) {
                const arhost_device_size &size = format.sizes[s];
                EXPECT_EQ(size.struct_size, sizeof size);
                line << ":" << size.width << "x" << size.height << "@" << size.is_rate_range;
                for (std::uint32_t r = 0; r < size.rate_count; ++r)
                    line << "," << size.rates[r];
            }
        }
        for (std::uint32_t c = 0; c < device->control_count; ++c) {
            const arhost_device_control &control = device->controls[c];
            EXPECT_EQ(control.struct_size, sizeof control);
            line << " " << control.name << control.type << ":" << control.minimum << ".." << control.maximum << "/"
                 << control.step << " " << control.default_value << " " << control.has_value << control.value;
        }
        static_cast<std::vector<std::string> *>(context)->push_back(line.str());
    };
    ASSERT_EQ(devices.list(&host, take, &listed), ARHOST_STATUS_OK);
    EXPECT_EQ(listed, (std::vector<std::string>{"3 3 1 default Thrower's none a-b throws none 0x0@0",
                                                "4 6 4 Else /dev/else none none broken 0x0@0 grey0:4x3@1,30,5 yuyv1 "
                                                "gain1:-1..9/2 3 15 reset5:0..0/0 0 00",
                                                "5 7 1 Screen none none none none 8x6@60"}));

    Thrower::no_devices = true;
    EXPECT_EQ(devices.list(&host, take, &listed), ARHOST_STATUS_ERROR_IO);
    EXPECT_EQ(logged, "no driver");
    EXPECT_EQ(listed.size(), 3u);
    Thrower::no_devices = false;
}

namespace {

struct Deviceless {};
struct WithAnExtension {
    static const void *get_extension(const char *id) { return id; }
};
struct WithBoth : WithAnExtension {
    static std::vector<arhost::Device> devices() { return {}; }
};
struct WithAHost {
    static std::vector<arhost::Device> devices(const arhost::Host &h) {
        h.warn("looking");
        return {};
    }
};
struct WithOtherDevices {
    static int devices() { return 2; } // does not return a list of devices, so it is not the extension's function
};

} // namespace

TEST(CppHelper, PassesTheHostToDevicesIfItTakesOne) {
    const auto *devices =
        static_cast<const arhost_devices *>(arhost::detail::get_extension<WithAHost>(ARHOST_DEVICES_EXTENSION));
    ASSERT_NE(devices, nullptr);
    EXPECT_EQ(devices->list(
                  &host, [](void *, const arhost_device *) {}, nullptr),
              ARHOST_STATUS_OK);
    EXPECT_EQ(logged, "looking");
}

TEST(CppHelper, DelegatesOtherExtensionsToTheClass) {
    EXPECT_EQ(arhost::detail::get_extension<Deviceless>(ARHOST_DEVICES_EXTENSION), nullptr);
    EXPECT_EQ(arhost::detail::get_extension<WithOtherDevices>(ARHOST_DEVICES_EXTENSION), nullptr);
    const char *other = "somebody.something/1";
    EXPECT_EQ(arhost::detail::get_extension<WithAnExtension>(other), other);
    EXPECT_EQ(arhost::detail::get_extension<WithBoth>(other), other);
    EXPECT_EQ(arhost::detail::get_extension<WithBoth>(ARHOST_DEVICES_EXTENSION),
              &arhost::detail::devices_functions<WithBoth>);
}

TEST(CppHelper, RejectsAnOfferWithoutItsVersion) {
    const arhost_offer offer{sizeof offer, ARHOST_ABI_VERSION + 1, ARHOST_ABI_VERSION + 9};
    arhost_answer answer{sizeof answer, 99, nullptr};
    EXPECT_EQ(arhost_entry.negotiate(&offer, &answer), ARHOST_STATUS_ERROR_UNSUPPORTED);
    EXPECT_EQ(answer.plugin, nullptr);
}

namespace {

// An ABI struct to which a newer host has appended fields.
template <class T> struct Longer {
    T known;
    std::uint64_t unknown[2] = {0xa5a5a5a5a5a5a5a5, 0xa5a5a5a5a5a5a5a5};
};

} // namespace

TEST(CppHelper, StepsThroughExtendedOptions) {
    const auto option = [](const char *key, int value) {
        return Longer<arhost_option>{
            {sizeof(Longer<arhost_option>), ARHOST_OPTION_INTEGER, key, value, 0.5 * value, key}};
    };
    const Longer<arhost_option> passed[] = {option("one", 1), option("two", 2), option("three", 3)};
    const arhost::Options options(&passed[0].known, 3);
    EXPECT_EQ(options.integer("one"), 1);
    EXPECT_TRUE(options.boolean("two"));
    EXPECT_EQ(options.real("three"), 1.5);
    EXPECT_EQ(options.text("three"), "three");
    EXPECT_THROW(options.integer("four"), arhost::Failure);
    EXPECT_EQ(arhost_find_option(&passed[0].known, 3, "two"), &passed[1].known);
    EXPECT_EQ(arhost_find_option(&passed[0].known, 2, "three"), nullptr);
}

TEST(CppHelper, StepsThroughExtendedElements) {
    constexpr auto size = static_cast<std::uint32_t>(sizeof(Longer<arhost_marker_config>));
    Longer<arhost_marker_config> listed[] = {{{size, 4, 0, 0, {}, nullptr, 0}}, {{size, 7, 0, 1, {}, nullptr, 0}}};
    std::vector<std::int32_t> ids;
    for (const arhost_marker_config &marker : arhost::elements(&std::as_const(listed[0].known), 2))
        ids.push_back(marker.id);
    EXPECT_EQ(ids, (std::vector<std::int32_t>{4, 7}));
    EXPECT_EQ(arhost::elements(&listed[0].known, 2)[1].target, 1u);
    arhost::elements(&listed[0].known, 2)[1].id = 9;
    EXPECT_EQ(listed[1].known.id, 9);
    EXPECT_TRUE(arhost::elements<const arhost_target>(nullptr, 0).empty());
}

namespace {

struct Detector {
    Detector(const arhost::Host &, const arhost::Options &) {}
    void start(const arhost_tracker_setup &) {}
    void track(const arhost_track_request &, arhost::Observations &observations) {
        accepted = 0;
        for (arhost_observation seen{}; seen.id < to_report; ++seen.id)
            accepted += observations.add(seen);
    }
    static inline int to_report = 0, accepted = 0;
};

} // namespace

TEST(CppHelper, IgnoresObservationsBeyondTheCapacity) {
    constexpr auto size = static_cast<std::uint32_t>(sizeof(Longer<arhost_observation>));
    constexpr int capacity = ARHOST_MAX_OBSERVATIONS;
    std::vector<Longer<arhost_observation>> buffer(capacity + 1, {{size, -1, 0, 0, {}, 0, 0, 0, {}}});
    const arhost_tracker &tracker = arhost::detail::tracker_functions<Detector>;
    arhost::detail::Instance<Detector> object(&host, arhost::Options(nullptr, 0));
    for (const int reported : {0, 2, capacity, capacity + 3}) {
        Detector::to_report = reported;
        const int expected = std::min(reported, capacity);
        const arhost_track_request request{};
        arhost_tracker_result result{sizeof result, 0, &buffer[0].known, nullptr, 0, -1};
        EXPECT_EQ(tracker.track(reinterpret_cast<arhost_instance *>(&object), &request, &result), ARHOST_STATUS_OK);
        EXPECT_EQ(Detector::accepted, expected);
        EXPECT_EQ(result.observation_count, static_cast<std::uint32_t>(expected));
        EXPECT_EQ(result.candidate_count, -1);
        arhost::Observations(result).set_candidate_count(std::size_t{1} << 40);
        EXPECT_EQ(result.candidate_count, INT32_MAX);
    }
    for (int i = 0; i <= capacity; ++i) {
        EXPECT_EQ(buffer[i].known.struct_size, size);
        EXPECT_EQ(buffer[i].known.id, i < capacity ? i : -1);
        EXPECT_EQ(buffer[i].unknown[0], Longer<arhost_observation>{}.unknown[0]);
    }
}
