// SPDX-License-Identifier: Apache-2.0
#include "../../support/usb_camera_layouts.hpp"
#include "descriptors.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>

using namespace arhost::uvc;
using namespace arhost::test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

namespace {

const std::vector<std::uint32_t> at_30 = {333333}, usual = {333333, 400000, 500000, 666666, 1000000, 2000000};
const std::vector<FrameRow> usual_sizes = {
    {640, 480, usual}, {160, 120, usual}, {320, 240, usual}, {1280, 720, {1000000, 2000000}}};
const std::vector<FrameRow> full_hd = {{1920, 1080, at_30}, {1280, 720, at_30}};
// 192, 384, … bytes, then two and three transactions per microframe
const std::vector<AlternateRow> usual_alternates = {{192}, {384}, {512}, {640}, {800}, {944}, {0x0b00}, {0x13fc}};

FunctionRow usual_function(std::vector<FormatRow> formats, std::vector<AlternateRow> alternates = usual_alternates) {
    return {0, 0x0100, 48'000'000, 0x0a2e, 0x177f, {4}, {{1, std::move(formats), std::move(alternates)}}};
}

// A change of the first descriptor of a type and subtype: its byte `at` becomes `value`.
std::function<void(Octets &)> change(std::uint8_t subtype, std::size_t at, std::uint8_t value) {
    return [=](Octets &bytes) {
        for (std::size_t i = 0; i + 2 < bytes.size() && bytes[i] > 0; i += bytes[i])
            if (bytes[i + 1] == 0x24 && bytes[i + 2] == subtype) {
                bytes.at(i + at) = value;
                return;
            }
    };
}

// A layout and the streams that the parser must find in it: "INTERFACE: NAME*FRAMES…; BYTES…".
struct Expected {
    Layout layout;
    std::vector<std::string> streams; // of all functions
    std::string defect;               // a part of it; empty: none

    friend void PrintTo(const Expected &expected, std::ostream *out) { *out << expected.layout.name; }
};

StreamRow stream_of(std::uint8_t interface, std::vector<FormatRow> formats, std::vector<AlternateRow> alternates) {
    return {interface, std::move(formats), std::move(alternates)};
}

std::vector<Expected> make_layouts() {
    std::vector<Expected> all;
    const auto add = [&](const std::string &name, std::vector<FunctionRow> functions,
                         std::vector<std::string> streams, const std::string &defect = "",
                         std::function<void(Octets &)> damage = {}, bool has_audio = false) {
        all.push_back({{name, std::move(functions), has_audio, std::move(damage)}, std::move(streams), defect});
    };
    const FormatRow yuy2 = {"YUY2", usual_sizes}, mjpeg = {"MJPEG", usual_sizes};
    const std::string usual_stream = "1: YUY2*4 MJPEG*4; 192 384 512 640 800 944 1536 3060";

    add("webcam_with_eight_settings", {usual_function({yuy2, mjpeg})}, {usual_stream});
    add("webcam_with_microphone", {usual_function({yuy2, mjpeg})}, {usual_stream}, "", {}, true);
    FunctionRow still = usual_function({yuy2, mjpeg});
    still.streams[0].still_images = 5;
    add("still_image_descriptors", {still}, {usual_stream});
    add("h264_as_frame_based", {usual_function({yuy2, {"frame:H264", full_hd}, mjpeg})},
        {"1: YUY2*4 (H264)*2 MJPEG*4; 192 384 512 640 800 944 1536 3060"});
    FunctionRow version_1_5 = usual_function({{"NV12", full_hd}, {"H.264", {}}, {"MJPEG", full_hd}}, {{0x1400}});
    version_1_5.version = 0x0150;
    add("uvc_1_5_with_h264", {version_1_5}, {"1: NV12*2 (H.264)*0 MJPEG*2; 3072"});
    FunctionRow two_streams = version_1_5;
    two_streams.streams.push_back(stream_of(2, {{"H.264", {}}}, {{0x1400}}));
    add("uvc_1_5_with_two_streams", {two_streams}, {"1: NV12*2 (H.264)*0 MJPEG*2; 3072", "2: (H.264)*0; 3072"});
    add("bulk_only", {usual_function({{"YUY2", {{320, 180, at_30}}}}, {{512, true}})}, {"1: YUY2*1; 512b"});
    add("capture_card_on_superspeed_bulk", {usual_function({{"NV12", full_hd}, {"YUY2", full_hd}}, {{1024, true}})},
        {"1: NV12*2 YUY2*2; 1024b"});
    add("superspeed_isochronous",
        {usual_function({{"YUY2", full_hd}}, {{1024, false, 1024}, {1024, false, 16384}, {1024, false, 49152}})},
        {"1: YUY2*2; 1024 16384 49152"});
    FunctionRow infrared = {
        2, 0x0100, 15'000'000, 0, 0, {}, {stream_of(3, {{"L8  ", {{640, 360, at_30}}}}, {{0x1400}})}};
    add("colour_and_infrared_cameras", {usual_function({yuy2, mjpeg}), infrared}, {usual_stream, "3: (L8)*1; 3072"},
        "", {}, true);
    FunctionRow depth = {0, 0x0110, 15'000'000, 0x000a, 0, {3}, {}};
    depth.streams = {stream_of(1, {{"Z16 ", {{640, 480, at_30}}}}, {{1024, true}}),
                     stream_of(2, {{"Y8  ", {{640, 480, at_30}}}, {"UYVY", {{640, 480, at_30}}}}, {{1024, true}})};
    FunctionRow colour = usual_function({{"YUY2", full_hd}}, {{1024, true}});
    colour.control_interface = 3;
    colour.streams[0].interface = 4;
    add("depth_camera", {depth, colour}, {"1: (Z16)*1; 1024b", "2: (Y8)*1 (UYVY)*1; 1024b", "4: YUY2*2; 1024b"});
    add("continuous_intervals", {usual_function({{"YUY2", {{640, 480, {}}}}})},
        {"1: YUY2*1; 192 384 512 640 800 944 1536 3060"});
    add("only_mjpeg", {usual_function({{"MJPEG", full_hd}}, {{0x0400}})}, {"1: MJPEG*2; 1024"});
    FunctionRow many = usual_function({yuy2});
    many.extension_ids = {4, 5, 6, 7, 8, 9, 10, 11};
    add("eight_extension_units", {many}, {"1: YUY2*4; 192 384 512 640 800 944 1536 3060"});
    FunctionRow unlisted = usual_function({yuy2, mjpeg});
    unlisted.lists_streams = false;
    add("header_lists_no_stream", {unlisted}, {usual_stream});
    FunctionRow bare = usual_function({{"YUY2", {{640, 480, at_30}}}}, {{0x0400}});
    bare.has_status_endpoint = false;
    bare.streams[0].matrix = 0;
    add("no_status_endpoint_and_no_colour_matching", {bare}, {"1: YUY2*1; 1024"});

    // mistakes of vendors
    add("total_length_too_large", {usual_function({yuy2, mjpeg})}, {usual_stream}, "states a total length of",
        [](Octets &bytes) { bytes[3] = static_cast<std::uint8_t>(bytes[3] + 1); });
    add("total_length_too_small", {usual_function({yuy2, mjpeg})}, {usual_stream}, "states a total length of 9 bytes",
        [](Octets &bytes) { bytes[2] = 9, bytes[3] = 0; });
    FunctionRow formats = usual_function({yuy2, mjpeg});
    formats.streams[0].damage = change(1, 3, 1);
    add("too_few_formats_stated", {formats}, {usual_stream}, "states 1 formats, but has 2");
    formats.streams[0].damage = change(6, 3, 1);
    add("format_index_not_unique", {formats}, {"1: YUY2*4; 192 384 512 640 800 944 1536 3060"},
        "format index 1 is 0 or not unique");
    FunctionRow empty = usual_function({{"YUY2", {{160, 120, at_30}, {640, 480, at_30}}}}, {{0x1400}});
    empty.streams[0].damage = change(5, 5, 0); // width
    add("frame_of_width_0", {empty}, {"1: YUY2*1; 3072"}, "its size is 0");
    FunctionRow zero = usual_function({{"YUY2", {{640, 480, {0, 333333}}, {320, 240, {0}}}}}, {{0x1400}});
    add("frame_intervals_of_0", {zero}, {"1: YUY2*2; 3072"}, "lists a frame interval of 0");
    FunctionRow short_list = usual_function({{"YUY2", {{640, 480, at_30}}}}, {{0x1400}});
    short_list.streams[0].damage = change(5, 25, 200);
    add("more_intervals_stated_than_sent", {short_list}, {"1: YUY2*1; 3072"}, "fewer frame intervals than it states");
    add("empty_packets", {usual_function({yuy2}, {{0}, {512}})}, {"1: YUY2*4; 512"}, "its packets have no bytes");
    add("ends_in_the_middle", {usual_function({yuy2, mjpeg})}, {"1: YUY2*4 MJPEG*4; 192 384 512 640 800 944 1536"},
        "the rest is ignored", [](Octets &bytes) { bytes.resize(bytes.size() - 3); });
    return all;
}

std::string text_of(const StreamingInterface &stream) {
    std::string text = std::to_string(stream.number) + ":";
    for (const Format &format : stream.formats)
        text += " " + (format.encoding == Encoding::unsupported ? "(" + format.name + ")" : format.name) + "*" +
                std::to_string(format.frames.size());
    text += ";";
    for (const AlternateSetting &alternate : stream.alternates)
        text += " " + std::to_string(alternate.payload_bytes) + (alternate.is_bulk ? "b" : "");
    return text;
}

std::vector<std::string> texts_of(const Configuration &configuration) {
    std::vector<std::string> texts;
    for (const VideoFunction &function : configuration.functions)
        for (const StreamingInterface &stream : function.streams)
            texts.push_back(text_of(stream));
    return texts;
}

Configuration parse(const Layout &layout) {
    return parse_configuration(configuration_of(layout));
}

} // namespace

class DescriptorLayouts : public testing::TestWithParam<Expected> {};

TEST_P(DescriptorLayouts, AreParsed) {
    const auto &[layout, streams, defect] = GetParam();
    const Configuration found = parse(layout);
    EXPECT_EQ(texts_of(found), streams);
    ASSERT_EQ(found.functions.size(), layout.functions.size());
    for (std::size_t i = 0; i < found.functions.size(); ++i) {
        EXPECT_EQ(found.functions[i].control_interface, layout.functions[i].control_interface);
        EXPECT_EQ(found.functions[i].version, layout.functions[i].version);
        EXPECT_EQ(found.functions[i].clock_hz, layout.functions[i].clock_hz);
        EXPECT_EQ(found.functions[i].streams.size(), layout.functions[i].streams.size());
        EXPECT_EQ(found.functions[i].units.size(), 2 + layout.functions[i].extension_ids.size());
    }
    if (defect.empty()) {
        EXPECT_THAT(found.defects, IsEmpty());
    } else {
        EXPECT_THAT(found.defects, testing::Contains(HasSubstr(defect)));
    }
}

// Whatever is cut off, the parser returns a part of what the entire descriptor has.
TEST_P(DescriptorLayouts, AreParsedInPartIfTruncatedAnywhere) {
    const Octets bytes = configuration_of(GetParam().layout);
    const std::size_t functions = parse_configuration(bytes).functions.size();
    for (std::size_t size = 0; size < bytes.size(); ++size) {
        const Octets part(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
        const Configuration found = parse_configuration(part);
        EXPECT_LE(found.functions.size(), functions);
        EXPECT_TRUE(!found.defects.empty() || size == bytes[2] + 256u * bytes[3]);
    }
}

INSTANTIATE_TEST_SUITE_P(Uvc, DescriptorLayouts, testing::ValuesIn(make_layouts()),
                         [](const auto &info) { return info.param.layout.name; });

TEST(Descriptors, UnitsHaveTheirControlsAndGuids) {
    const Configuration found = parse(make_layouts().front().layout);
    const std::vector<Unit> &units = found.functions.at(0).units;
    ASSERT_EQ(units.size(), 3u);
    EXPECT_EQ(units[0].kind, UnitKind::camera_terminal);
    EXPECT_EQ(units[0].id, 1);
    EXPECT_EQ(units[0].controls, 0x0a2eu);
    EXPECT_EQ(units[1].kind, UnitKind::processing_unit);
    EXPECT_EQ(units[1].id, 2);
    EXPECT_EQ(units[1].controls, 0x177fu);
    EXPECT_EQ(units[2].kind, UnitKind::extension_unit);
    EXPECT_EQ(units[2].id, 4);
    EXPECT_EQ(units[2].controls, 7u);
    EXPECT_EQ(to_text(units[2].guid), "43424140-4544-4746-4849-4a4b4c4d4e4f");
}

TEST(Descriptors, FramesHaveSizesAndIntervals) {
    const Configuration found = parse(make_layouts().front().layout);
    const Format &format = found.functions.at(0).streams.at(0).formats.at(0);
    EXPECT_EQ(format.index, 1);
    EXPECT_EQ(format.matrix, 1);
    const FrameSize &frame = format.frames.at(0);
    EXPECT_EQ(frame.width, 640u);
    EXPECT_EQ(frame.height, 480u);
    EXPECT_EQ(frame.max_bytes, 614400u);
    EXPECT_EQ(frame.default_interval, 333333u);
    EXPECT_EQ(frame.intervals, usual);
    EXPECT_NEAR(frame.max_fps(), 30, 0.001);
    EXPECT_EQ(frame.nearest_interval(333333), 333333u);
    EXPECT_EQ(frame.nearest_interval(660000), 666666u);
    EXPECT_EQ(frame.nearest_interval(1), 333333u);
}

TEST(Descriptors, ContinuousIntervalsAreRounded) {
    FrameSize frame;
    frame.shortest_interval = 100;
    frame.longest_interval = 450;
    frame.interval_step = 100;
    EXPECT_EQ(frame.nearest_interval(1), 100u);
    EXPECT_EQ(frame.nearest_interval(240), 200u);
    EXPECT_EQ(frame.nearest_interval(260), 300u);
    EXPECT_EQ(frame.nearest_interval(1000), 400u) << "450 is not a multiple of the step";
    frame.interval_step = 0;
    EXPECT_EQ(frame.nearest_interval(240), 240u);
    frame.shortest_interval = 0;
    frame.longest_interval = 0xffffffff;
    frame.interval_step = 0xffffffff;
    EXPECT_GT(frame.nearest_interval(0), 0u);
    EXPECT_GT(frame.nearest_interval(0xffffffff), 0u);
    EXPECT_EQ(FrameSize{}.nearest_interval(5), 0u);
}

TEST(Descriptors, LimitsBoundWhatIsKept) {
    Octets bytes = {9, 2, 0, 0, 1, 1, 0, 0x80, 250};
    for (int i = 0; i < 100; ++i)
        put_interface(bytes, static_cast<std::uint8_t>(i), 0, 0, 1);
    for (int unit = 1; unit < 200; ++unit) {
        Octets extension = {0x24, 5, static_cast<std::uint8_t>(unit), 1, 0, 0, 2, 0, 0};
        put_descriptor(bytes, extension);
    }
    for (int i = 0; i < 100; ++i) {
        put_interface(bytes, static_cast<std::uint8_t>(100 + i), 0, 0, 2);
        if (i == 0)
            for (int format = 1; format < 256; ++format)
                put_format(bytes, {"MJPEG", std::vector<FrameRow>(200, {640, 480, {333333}})},
                           static_cast<std::uint8_t>(format), 0);
    }
    const Configuration found = parse_configuration(bytes);
    EXPECT_EQ(found.functions.size(), max_functions);
    EXPECT_EQ(found.defects.size(), max_defects);
    std::size_t streams = 0;
    for (const VideoFunction &function : found.functions) {
        EXPECT_LE(function.units.size(), max_units);
        streams += function.streams.size();
        for (const StreamingInterface &stream : function.streams) {
            EXPECT_LE(stream.formats.size(), max_formats);
            for (const Format &format : stream.formats)
                EXPECT_LE(format.frames.size(), max_frames);
        }
    }
    EXPECT_EQ(streams, max_streams);
}

TEST(Descriptors, OfOtherClassesAreNoCamera) {
    Octets bytes = {9, 2, 18, 0, 1, 1, 0, 0x80, 250};
    put_interface(bytes, 0, 0, 1, 0, 3); // a keyboard
    EXPECT_THAT(parse_configuration(bytes).functions, IsEmpty());
    EXPECT_THAT(parse_configuration({}).defects, ElementsAre(HasSubstr("is not a configuration descriptor")));
    EXPECT_THAT(parse_configuration(Octets{9, 1, 18, 0, 1, 1, 0, 0x80, 250}).defects,
                ElementsAre(HasSubstr("is not a configuration descriptor")));
    Octets stream = {9, 2, 18, 0, 1, 1, 0, 0x80, 250};
    put_interface(stream, 1, 0, 0, 2);
    EXPECT_THAT(parse_configuration(stream).defects, ElementsAre(HasSubstr("without a control interface")));
}

TEST(Descriptors, OfLengthZeroEndTheParser) {
    Octets bytes = configuration_of(make_layouts().front().layout);
    bytes[9] = 0;
    const Configuration found = parse_configuration(bytes);
    EXPECT_THAT(found.functions, IsEmpty());
    EXPECT_THAT(found.defects, ElementsAre(HasSubstr("byte 9 has length 0")));
}
