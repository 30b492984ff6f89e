// SPDX-License-Identifier: Apache-2.0
#include "ipc/messages.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <tuple>

using namespace arhost;
using namespace arhost::ipc;
using namespace arhost::model;
using testing::HasSubstr;

namespace {

// Returns `message` after conversion to JSON and back, as if it had been sent through a channel.
template <class T> T sent(const T &message) {
    const Message received{Json::parse(encode(message).dump()), {}};
    EXPECT_TRUE(is<T>(received));
    return parse<T>(received);
}

template <class T> std::string violation(Json body) {
    body["type"] = T::type;
    try {
        parse<T>(Message{body, {}});
        return "none";
    } catch (const ProtocolViolation &error) {
        return error.what();
    }
}

arhost_intrinsics lens() {
    arhost_intrinsics intrinsics{};
    intrinsics.struct_size = sizeof intrinsics;
    intrinsics.width = 64;
    intrinsics.height = 48;
    intrinsics.fx = intrinsics.fy = 60;
    intrinsics.distortion = ARHOST_DISTORTION_NONE;
    return intrinsics;
}

arhost_frame_format format() {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
    format.width = 64;
    format.height = 48;
    arhost_frame_layout(&format);
    return format;
}

} // namespace

TEST(Messages, PreserveTheSetupOfEachKind) {
    const std::vector<OptionValue> options = {{"gain", ARHOST_OPTION_REAL, 0, 0.1, ""},
                                              {"name", ARHOST_OPTION_TEXT, 0, 0, "ä\"\n"}};
    const auto source = sent(messages::Create{options, messages::SourceSetup{7, 29.97, true, lens()}});
    EXPECT_EQ(source.options.at(0).real, 0.1);
    EXPECT_EQ(source.options.at(1).text, "ä\"\n");
    const auto &source_setup = std::get<messages::SourceSetup>(source.setup);
    EXPECT_EQ(source_setup.first_sequence, 7u);
    EXPECT_EQ(source_setup.fps, 29.97);
    EXPECT_TRUE(source_setup.paced);
    EXPECT_EQ(source_setup.intrinsics.value().fx, 60);
    const auto tracker = sent(messages::Create{{}, messages::TrackerSetup{format(), lens(), 7, true, false}});
    const auto &tracker_setup = std::get<messages::TrackerSetup>(tracker.setup);
    EXPECT_EQ(tracker_setup.format.byte_size, 64u * 48);
    EXPECT_EQ(tracker_setup.intrinsics.fx, 60);
    EXPECT_EQ(tracker_setup.full_search_every, 7u);
    EXPECT_TRUE(tracker_setup.smooth);
    EXPECT_FALSE(tracker_setup.confirm);
    const auto raytracer = sent(messages::Create{{}, messages::RaytracerSetup{64, 48, lens()}});
    EXPECT_EQ(std::get<messages::RaytracerSetup>(raytracer.setup).height, 48u);
    EXPECT_EQ(std::get<messages::RaytracerSetup>(raytracer.setup).form, ARHOST_IMAGE_FORM_STRAIGHT);
    EXPECT_EQ(std::get<messages::RaytracerSetup>(raytracer.setup).compositing, ARHOST_COMPOSITING_SRGB);
    EXPECT_EQ(std::get<messages::RaytracerSetup>(raytracer.setup).video_format, std::nullopt);
    const auto linear = sent(messages::Create{
        {}, messages::RaytracerSetup{64, 48, lens(), ARHOST_IMAGE_FORM_LINEAR, ARHOST_COMPOSITING_LINEAR, format()}});
    const auto &linear_setup = std::get<messages::RaytracerSetup>(linear.setup);
    EXPECT_EQ(linear_setup.form, ARHOST_IMAGE_FORM_LINEAR);
    EXPECT_EQ(linear_setup.compositing, ARHOST_COMPOSITING_LINEAR);
    EXPECT_EQ(linear_setup.video_format.value().byte_size, 64u * 48);
    EXPECT_EQ(linear_setup.video_format.value().pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
    const auto sink = sent(messages::Create{{}, messages::SinkSetup{format(), 25, 12, {}}});
    EXPECT_EQ(std::get<messages::SinkSetup>(sink.setup).first_sequence, 12u);
    EXPECT_EQ(std::get<messages::SinkSetup>(sink.setup).intrinsics, std::nullopt);
}

TEST(Messages, NameTheKindOfSetup) {
    EXPECT_EQ(encode(messages::Create{{}, messages::SourceSetup{}}).at("kind"), "source");
    EXPECT_EQ(encode(messages::Create{{}, messages::TrackerSetup{format(), lens()}}).at("kind"), "tracker");
    EXPECT_EQ(encode(messages::Create{{}, messages::RaytracerSetup{64, 48, lens()}}).at("kind"), "raytracer");
    EXPECT_EQ(encode(messages::Create{{}, messages::SinkSetup{}}).at("kind"), "sink");
}

TEST(Messages, PreserveThePolicyAndTheSlotLayout) {
    const Json policy = {{"allow", {"gpu"}}, {"memory_bytes", 1 << 20}};
    const auto open = sent(messages::Open{"plugin.so", policy});
    EXPECT_EQ(open.plugin, "plugin.so");
    EXPECT_EQ(open.sandbox, policy);
    const auto attach = sent(messages::Attach{true, 5, {1000, 4}});
    EXPECT_TRUE(attach.is_output);
    EXPECT_EQ(attach.generation, 5u);
    EXPECT_EQ(attach.layout.slot_size, 1000u);
    EXPECT_EQ(attach.layout.count, 4u);
}

TEST(Messages, PreserveWhatAWorkerReports) {
    messages::Hello hello;
    hello.descriptor.kind = ARHOST_KIND_TRACKER;
    hello.descriptor.id = "tracker_x";
    hello.descriptor.options = {{"a", ARHOST_OPTION_TEXT, "x", 0, 0, {"x", "y"}, "help"},
                                {"b", ARHOST_OPTION_INTEGER, std::nullopt, 1, 9, {}, ""}};
    hello.sandbox = "level";
    const auto received = sent(hello);
    EXPECT_EQ(received.descriptor.id, "tracker_x");
    EXPECT_EQ(received.descriptor.options.at(0).default_value, "x");
    EXPECT_EQ(received.descriptor.options.at(0).choices.size(), 2u);
    EXPECT_EQ(received.descriptor.options.at(1).default_value, std::nullopt);
    EXPECT_EQ(received.sandbox, "level");
    EXPECT_EQ(sent(messages::Ready{format(), 30, lens()}).format.value().width, 64u);
    EXPECT_EQ(sent(messages::Ready{}).format, std::nullopt);
    const std::string quotes(messages::Devices::max_part, '"');
    EXPECT_EQ(sent(messages::Devices{quotes, false}).part, quotes);
    EXPECT_EQ(sent(messages::Devices{"null", false}).is_last, false);
    EXPECT_EQ(sent(messages::Stopped{ARHOST_STATUS_ERROR_IO, "disk"}).status, ARHOST_STATUS_ERROR_IO);
    EXPECT_EQ(sent(messages::Failed{ARHOST_STATUS_ERROR_CONFIGURATION, "why"}).text, "why");
    EXPECT_EQ(sent(messages::Reads{"/a", "1:2"}).node, "1:2");
    EXPECT_EQ(sent(messages::AnchorOrigin{"scene.yaml:6:40: objects[0].on"}).text, "scene.yaml:6:40: objects[0].on");
    EXPECT_EQ(sent(messages::Listed{"animation", "Walk", 0.7}).number, 0.7);
    const Counters counters = {{"lost", 3}, {"superseded", 0}};
    EXPECT_EQ(sent(messages::CountersChanged{counters}).counters, counters);
}

TEST(Messages, CutLongTexts) {
    const messages::Failed failed{ARHOST_STATUS_ERROR_IO, std::string(1 << 20, 'x')};
    EXPECT_LT(encode(failed).dump().size(), Channel::max_message_size);
    EXPECT_EQ(sent(failed).text.size(), messages::max_text);
    Json foreign = encode(messages::Log{ARHOST_SEVERITY_ERROR, ""});
    foreign["text"] = failed.text;
    EXPECT_EQ(parse<messages::Log>(Message{foreign, {}}).text.size(), messages::max_text);
}

TEST(Messages, MissingOrMistypedFieldsViolateTheProtocol) {
    EXPECT_THAT(violation<messages::Log>({{"severity", 1}}), HasSubstr("malformed message 'log': "));
    EXPECT_THAT(violation<messages::Log>({{"severity", "high"}, {"text", ""}}), HasSubstr("malformed message 'log'"));
    EXPECT_THAT(violation<messages::Hello>({{"descriptor", 5}, {"sandbox", ""}}), HasSubstr("'hello'"));
    EXPECT_THAT(violation<messages::Ready>(Json::object()), HasSubstr("'ready'"));
    EXPECT_THAT(violation<messages::Attached>({{"is_output", "yes"}, {"generation", 1}}), HasSubstr("'attached'"));
    EXPECT_THAT(violation<messages::Stopped>({{"status", 1}}), HasSubstr("'stopped'"));
    EXPECT_THAT(violation<messages::Reads>({{"path", 7}, {"node", "1:2"}}), HasSubstr("'reads'"));
    Json create = encode(messages::Create{{}, messages::SinkSetup{}});
    create["kind"] = "camera";
    EXPECT_EQ(violation<messages::Create>(create), "unknown kind of setup 'camera'");
}

TEST(Messages, PreserveIntrinsicsExactly) {
    arhost_intrinsics lens{};
    lens.struct_size = sizeof lens;
    lens.width = 641;
    lens.height = 479;
    lens.fx = 607.178466796875;
    lens.fy = 1.0 / 3.0;
    lens.cx = -0.1;
    lens.cy = 1e300;
    lens.distortion = ARHOST_DISTORTION_BROWN;
    lens.coefficient_count = 5;
    for (int i = 0; i < 5; ++i)
        lens.coefficients[i] = 0.1 * i - 0.2;
    const arhost_intrinsics back = sent(messages::Ready{{}, 0, lens}).intrinsics.value();
    EXPECT_EQ(std::memcmp(&lens, &back, sizeof lens), 0);
}

TEST(Messages, RejectInvalidFormatsAndIntrinsics) {
    arhost_frame_format yuyv = format();
    yuyv.pixel_format = ARHOST_PIXEL_FORMAT_YUYV;
    yuyv.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
    yuyv.yuv_range = ARHOST_YUV_RANGE_LIMITED;
    yuyv.fps = 30;
    yuyv.has_depth = 1;
    yuyv.transfer = ARHOST_TRANSFER_LINEAR;
    const Json ready = encode(messages::Ready{yuyv, 0, lens()});
    const arhost_frame_format parsed = parse<messages::Ready>(Message{ready, {}}).format.value();
    EXPECT_EQ(parsed.stride[0], 128u);
    EXPECT_EQ(parsed.depth_stride, 128u);
    EXPECT_EQ(parsed.transfer, ARHOST_TRANSFER_LINEAR);
    EXPECT_EQ(parsed.byte_size, parsed.depth_offset + 128u * 48);
    const std::tuple<const char *, const char *, Json> cases[] = {
        {"format", "pixel_format", 99}, {"format", "width", 641},       {"format", "height", 0},
        {"format", "width", 1 << 20},   {"format", "yuv_matrix", 0},    {"format", "transfer", 2},
        {"format", "fps", -1},          {"format", "width", nullptr},   {"intrinsics", "width", "x"},
        {"intrinsics", "fx", 0},        {"intrinsics", "distortion", 9}};
    for (const auto &[member, key, value] : cases) {
        Json wrong = ready;
        wrong[member][key] = value;
        EXPECT_THROW(parse<messages::Ready>(Message{wrong, {}}), std::exception) << key;
    }
}
