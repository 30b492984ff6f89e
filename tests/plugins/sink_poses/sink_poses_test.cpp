// SPDX-License-Identifier: Apache-2.0
#include "log_sink_test.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <cstdio>
#include <dlfcn.h>
#include <limits>
#include <netdb.h>
#include <numbers>
#include <sstream>
#include <sys/socket.h>
#include <unistd.h>

using namespace arhost::test;
using Json = nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

constexpr std::pair<std::string_view, int> unknown_names[] = {{"unreachable.example", EAI_AGAIN},
                                                              {"mistyped.example", EAI_NONAME}};

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

// Returns the record of a frame with two targets, a camera and the true pose. The first target has two markers, the
// second one an alternative pose; there is another marker. The numbers differ per frame and need many decimal digits,
// to test that the sink does not round them.
TrackedRecord full_record(std::uint64_t sequence) {
    TrackedRecord record{make_record(sequence), {}, {}};
    const double seed = 1.0 / (3.0 + static_cast<double>(sequence));
    record.fields.overlay = ARHOST_OVERLAY_RENDERED;
    record.fields.has_camera = record.fields.has_truth = 1;
    std::snprintf(record.fields.truth_target, sizeof record.fields.truth_target, "cup");
    const double corners[4][2] = {
        {100, 200}, {100 + seed, 200 - seed}, {100 + 2 * seed, 200 - 2 * seed}, {100 + 3 * seed, 200 - 3 * seed}};
    record.add_target("board", ARHOST_TARGET_DETECTED, {});
    record.add_observation(0, corners).decision_margin = 50 + seed;
    record.add_observation(-3, corners).hamming = 2;
    record.observations.back().corner_sigma_px = seed / 9;
    record.add_target("cup", ARHOST_TARGET_PREDICTED, {}).age_frames = 4;
    record.add_observation(7, corners);
    record.add_observation(99, corners, false);
    for (int i = 0; i < 16; ++i) {
        record.fields.true_mt[i] = seed * i;
        for (std::size_t t = 0; t < 2; ++t)
            record.targets[t].mt[i] = std::numbers::pi * seed * (i - 5) * (t ? 1e-17 : 1);
        record.targets[1].mt_alternative[i] = -seed - i;
    }
    for (int i = 0; i < 36; ++i)
        record.targets[0].covariance[i] = seed * (i - 17) / 1e4;
    for (arhost_target &target : record.targets) {
        target.reprojection_px = seed / 7;
        target.ambiguity = 0.25;
    }
    for (int i = 0; i < 3; ++i) {
        record.fields.camera.eye[i] = 1e3 * seed * i;
        record.fields.camera.look_at[i] = -seed;
        record.fields.camera.up[i] = i == 1;
    }
    return record;
}

std::vector<std::string> lines_of(const std::filesystem::path &file) {
    std::istringstream text(read_text(file));
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);)
        lines.push_back(line);
    return lines;
}

std::vector<std::string> keys_of(const Json &json) {
    std::vector<std::string> keys;
    for (const auto &item : json.items())
        keys.push_back(item.key());
    return keys;
}

// Converts a C array, which may be nested, to a JSON array.
template <class Array> Json array(const Array &values) {
    Json json = Json::array();
    for (const auto &value : values) {
        if constexpr (std::is_array_v<std::remove_cvref_t<decltype(value)>>)
            json.push_back(array(value));
        else
            json.push_back(value);
    }
    return json;
}

class SinkPoses : public testing::Test {
protected:
    std::filesystem::path log() const { return folder_.path() / "log.jsonl"; }
    SinkUnderTest sink() const { return SinkUnderTest("sink_poses", {{"path", log().string()}}); }
    // Returns the line that the sink writes for one record.
    std::string line_of(const arhost_record &record) const {
        SinkUnderTest s = sink();
        EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
        EXPECT_EQ(s.write(Picture(8, 8, 0), record), ARHOST_STATUS_OK);
        EXPECT_EQ(s.stop(), ARHOST_STATUS_OK);
        const auto lines = lines_of(log());
        EXPECT_EQ(lines.size(), 1u);
        return lines.at(0);
    }

    ScratchFolder folder_;
};

// Starts the sink with this receiver. Returns its log.
std::string log_of_start(const std::string &receiver, arhost_status expected) {
    SinkUnderTest s("sink_poses", {{"udp", receiver}});
    EXPECT_EQ(s.start(8, 8), expected) << receiver;
    return s.log();
}

INSTANTIATE_TEST_SUITE_P(SinkPoses, LogSink, testing::Values(LogSinkCase{"poses", "sink_poses", full_record}),
                         [](const auto &info) { return info.param.name; });

} // namespace

// Replaces libc's function, so that the names' errors do not depend on the machine's name server.
extern "C" [[gnu::visibility("default")]] int getaddrinfo(const char *name, const char *service,
                                                          const addrinfo *hints, addrinfo **found) {
    for (const auto &[unknown, error] : unknown_names)
        if (name && name == unknown)
            return error;
    static const auto original = reinterpret_cast<decltype(&getaddrinfo)>(::dlsym(RTLD_NEXT, "getaddrinfo"));
    return original(name, service, hints, found);
}

TEST_F(SinkPoses, WritesAFrameWithoutTargetsAsDocumented) {
    EXPECT_EQ(
        line_of(make_record(3)),
        R"({"frame": 3, "capture_ns": 99999999, "clock": "media", "overlay": "none", "targets": [], "camera": null})");
}

TEST_F(SinkPoses, WritesTheDocumentedKeysInTheirOrder) {
    const Json line = Json::parse(line_of(full_record(0)));
    EXPECT_THAT(keys_of(line), ElementsAre("frame", "capture_ns", "clock", "overlay", "targets", "camera", "truth"));
    EXPECT_THAT(keys_of(line["targets"][0]), ElementsAre("name", "state", "age_frames", "mt", "covariance",
                                                         "reprojection_px", "ambiguity", "observations"));
    EXPECT_THAT(keys_of(line["targets"][1]), ElementsAre("name", "state", "age_frames", "mt", "mt_alternative",
                                                         "reprojection_px", "ambiguity", "observations"));
    EXPECT_THAT(keys_of(line["targets"][0]["observations"][0]),
                ElementsAre("id", "corners_px", "decision_margin", "corner_sigma_px", "hamming"));
    EXPECT_THAT(keys_of(line["camera"]), ElementsAre("eye", "look_at", "up"));
    EXPECT_THAT(keys_of(line["truth"]), ElementsAre("target", "mt"));
}

TEST_F(SinkPoses, EveryNumberReadsBackAsTheSameDouble) {
    const TrackedRecord tracked = full_record(4);
    const arhost_record record = tracked;
    const Json line = Json::parse(line_of(record));
    for (std::size_t t = 0; t < 2; ++t) {
        const arhost_target &target = record.targets[t];
        EXPECT_EQ(line["targets"][t]["name"], target.name);
        EXPECT_EQ(line["targets"][t]["age_frames"], target.age_frames);
        EXPECT_EQ(line["targets"][t]["mt"], array(target.mt));
        EXPECT_EQ(line["targets"][t]["reprojection_px"], target.reprojection_px);
        EXPECT_EQ(line["targets"][t]["ambiguity"], target.ambiguity);
        ASSERT_EQ(line["targets"][t]["observations"].size(), target.observation_count);
        for (std::size_t i = 0; i < target.observation_count; ++i) {
            const arhost_observation &observation = record.observations[target.first_observation + i];
            const Json &written = line["targets"][t]["observations"][i];
            EXPECT_EQ(written["id"], observation.id);
            EXPECT_EQ(written["corners_px"], array(observation.corners_px));
            EXPECT_EQ(written["decision_margin"], observation.decision_margin);
            EXPECT_EQ(written["corner_sigma_px"], observation.corner_sigma_px);
            EXPECT_EQ(written["hamming"], observation.hamming);
        }
    }
    EXPECT_EQ(line["targets"][0]["state"], "detected");
    EXPECT_EQ(line["targets"][1]["state"], "predicted");
    EXPECT_EQ(line["targets"][0]["covariance"], array(record.targets[0].covariance));
    EXPECT_EQ(line["targets"][1]["mt_alternative"], array(record.targets[1].mt_alternative));
    EXPECT_EQ(line["camera"]["eye"], array(record.camera.eye));
    EXPECT_EQ(line["camera"]["look_at"], array(record.camera.look_at));
    EXPECT_EQ(line["camera"]["up"], array(record.camera.up));
    EXPECT_EQ(line["truth"]["target"], "cup");
    EXPECT_EQ(line["truth"]["mt"], array(record.true_mt));
    EXPECT_EQ(line["overlay"], "rendered");
}

TEST_F(SinkPoses, WritesHowTheTrackerHasSearched) {
    TrackedRecord record = full_record(0);
    record.fields.search = {1, 5, 1, 6, 2, 9, {}};
    const Json line = Json::parse(line_of(record));
    EXPECT_THAT(keys_of(line),
                ElementsAre("frame", "capture_ns", "clock", "overlay", "targets", "search", "camera", "truth"));
    EXPECT_EQ(line["search"].dump(),
              R"({"everywhere":true,"observations":5,"unlisted":1,"expected":6,"missed":2,"candidates":9})");
    record.fields.search = {0, 0, 0, 3, 3, -1, {}};
    EXPECT_EQ(Json::parse(line_of(record))["search"].dump(),
              R"({"everywhere":false,"observations":0,"unlisted":0,"expected":3,"missed":3,"candidates":null})");
}

TEST_F(SinkPoses, NamesClockAndOverlay) {
    TrackedRecord record = full_record(0);
    record.fields.clock = ARHOST_CLOCK_MONOTONIC;
    record.fields.overlay = ARHOST_OVERLAY_HELD;
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(line["clock"], "monotonic");
    EXPECT_EQ(line["overlay"], "held");
}

TEST_F(SinkPoses, ALostTargetHasOnlyItsLastPoseAndItsAge) {
    TrackedRecord record = full_record(0);
    record.targets[1].state = ARHOST_TARGET_LOST;
    const Json lost = Json::parse(line_of(record))["targets"][1];
    EXPECT_THAT(keys_of(lost), ElementsAre("name", "state", "age_frames", "mt"));
    EXPECT_EQ(lost["state"], "lost");
    EXPECT_EQ(lost["age_frames"], 4);
    EXPECT_EQ(lost["mt"], array(record.targets[1].mt));
}

TEST_F(SinkPoses, NonFiniteNumbersAreNull) {
    TrackedRecord record = full_record(0);
    record.targets[0].mt[3] = nan_value;
    record.targets[0].reprojection_px = infinity;
    record.targets[0].covariance[35] = nan_value;
    record.observations[0].corners_px[2][1] = -infinity;
    record.fields.camera.up[0] = nan_value;
    record.fields.true_mt[0] = nan_value;
    const std::string text = line_of(record);
    EXPECT_THAT(text, Not(HasSubstr("nan")));
    EXPECT_THAT(text, Not(HasSubstr("inf")));
    const Json line = Json::parse(text);
    EXPECT_TRUE(line["targets"][0]["mt"][3].is_null());
    EXPECT_TRUE(line["targets"][0]["reprojection_px"].is_null());
    EXPECT_TRUE(line["targets"][0]["covariance"][35].is_null());
    EXPECT_TRUE(line["targets"][0]["observations"][0]["corners_px"][2][1].is_null());
    EXPECT_TRUE(line["camera"]["up"][0].is_null());
    EXPECT_TRUE(line["truth"]["mt"][0].is_null());
}

TEST_F(SinkPoses, AnInvalidNameDoesNotCorruptTheLine) {
    TrackedRecord record = full_record(0);
    char(&name)[ARHOST_MAX_NAME] = record.targets[0].name;
    std::memset(name, 'x', sizeof name); // without a terminating NUL
    std::memcpy(name, "a\"\\\n\xff", 5);
    std::memcpy(record.fields.truth_target, name, sizeof name);
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(line["targets"][0]["name"], "a\"\\??" + std::string(sizeof name - 5, 'x'));
    EXPECT_EQ(line["truth"]["target"], line["targets"][0]["name"]);
}

TEST_F(SinkPoses, ObservationsThatTheRecordLacksAreLeftOut) {
    TrackedRecord record = full_record(0);
    record.targets[0].first_observation = 3;
    record.targets[0].observation_count = 0xffffffff;
    record.targets[1].first_observation = 1000;
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(line["targets"][0]["observations"].size(), 1u);
    EXPECT_EQ(line["targets"][1]["observations"].size(), 0u);
}

TEST_F(SinkPoses, TheMaximumNumberOfTargetsAndMarkersIsWritten) {
    TrackedRecord record = full_record(0);
    record.targets.resize(ARHOST_MAX_TARGETS, record.targets[0]);
    record.observations.resize(ARHOST_MAX_OBSERVATIONS, record.observations[0]);
    record.targets.back().observation_count = ARHOST_MAX_OBSERVATIONS;
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(line["targets"].size(), std::size_t{ARHOST_MAX_TARGETS});
    EXPECT_EQ(line["targets"].back()["observations"].size(), std::size_t{ARHOST_MAX_OBSERVATIONS});
}

// A newer host may use larger structs.
TEST_F(SinkPoses, ReadsTheElementsOfLongerArrays) {
    const TrackedRecord tracked = full_record(0);
    struct LongTarget {
        arhost_target target;
        std::uint64_t more = 0xffffffffffffffff;
    };
    struct LongObservation {
        arhost_observation observation;
        std::uint64_t more = 0xffffffffffffffff;
    };
    std::vector<LongTarget> targets;
    for (const arhost_target &target : tracked.targets)
        targets.push_back({target});
    std::vector<LongObservation> observations;
    for (const arhost_observation &observation : tracked.observations)
        observations.push_back({observation});
    for (LongTarget &each : targets)
        each.target.struct_size = sizeof each;
    for (LongObservation &each : observations)
        each.observation.struct_size = sizeof each;
    arhost_record record = tracked;
    record.targets = &targets[0].target;
    record.observations = &observations[0].observation;
    EXPECT_EQ(line_of(record), line_of(tracked));
}

TEST_F(SinkPoses, FramesDroppedInLiveModeStayDroppedAfterARestart) {
    const Picture picture(8, 8, 0);
    {
        SinkUnderTest killed = sink();
        ASSERT_EQ(killed.start(8, 8), ARHOST_STATUS_OK);
        for (const std::uint64_t i : {3, 8, 20})
            ASSERT_EQ(killed.write(picture, full_record(i)), ARHOST_STATUS_OK);
    }
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8, 15), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(picture, full_record(15)), ARHOST_STATUS_OK);
    const auto lines = lines_of(log());
    ASSERT_EQ(lines.size(), 3u);
    EXPECT_EQ(Json::parse(lines[0])["frame"], 3);
    EXPECT_EQ(Json::parse(lines[1])["frame"], 8);
    EXPECT_EQ(Json::parse(lines[2])["frame"], 15);
}

TEST_F(SinkPoses, AFolderAsPathIsRejected) {
    SinkUnderTest s("sink_poses", {{"path", folder_.path().string()}});
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("add a file name"));
}

TEST_F(SinkPoses, AReceiverNeedsAPort) {
    for (const std::string port : {"", "0", "65536", "-1", "9000x", "http"})
        EXPECT_THAT(log_of_start("127.0.0.1:" + port, ARHOST_STATUS_ERROR_CONFIGURATION),
                    HasSubstr("the port '" + port + "' must be a number from 1 to 65535"));
    EXPECT_THAT(log_of_start("127.0.0.1", ARHOST_STATUS_ERROR_CONFIGURATION), HasSubstr("must be HOST:PORT"));
}

TEST_F(SinkPoses, ANameThatCannotBeResolvedNowIsTriedAgainByTheHost) {
    for (const auto &[name, status] : {std::pair{"unreachable.example", ARHOST_STATUS_ERROR_IO},
                                       {"mistyped.example", ARHOST_STATUS_ERROR_CONFIGURATION}})
        EXPECT_THAT(log_of_start(name + std::string(":9000"), status),
                    AllOf(HasSubstr(name), Not(HasSubstr("network"))));
}

TEST_F(SinkPoses, AReceiverThatDoesNotListenGivesOneWarningWithItsAddress) {
    const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0); // bound: no other program listens there
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr *>(&address), size), 0);
    ASSERT_EQ(::getsockname(socket, reinterpret_cast<sockaddr *>(&address), &size), 0);
    // Connected to itself, it receives no datagrams of others, which are thus refused.
    ASSERT_EQ(::connect(socket, reinterpret_cast<const sockaddr *>(&address), size), 0);
    const std::string receiver = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    SinkUnderTest s("sink_poses", {{"udp", receiver}});
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(0, 10), ARHOST_STATUS_OK);
    const std::string log = s.log(), warning = "4 no program receives datagrams at " + receiver;
    EXPECT_THAT(log, HasSubstr(warning));
    EXPECT_EQ(log.find(warning), log.rfind(warning));
    ::close(socket);
}

TEST_F(SinkPoses, TheReadmeExampleHasTheSameKeys) {
    const std::string readme =
        read_text(std::filesystem::path(arhost::test::source_directory()) / "plugins/sink_poses/README.md");
    const std::size_t begin = readme.find("```json\n") + 8;
    const Json example = Json::parse(readme.substr(begin, readme.find("```", begin) - begin));
    TrackedRecord record = full_record(0);
    record.fields.has_truth = 0;
    record.fields.search = {0, 1, 0, 1, 0, 0, {}};
    std::ranges::copy(record.targets[1].mt_alternative, record.targets[0].mt_alternative);
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(keys_of(example), keys_of(line));
    EXPECT_EQ(keys_of(example["targets"][0]), keys_of(line["targets"][0]));
    EXPECT_EQ(keys_of(example["targets"][0]["observations"][0]), keys_of(line["targets"][0]["observations"][0]));
    EXPECT_EQ(example["targets"][0]["covariance"].size(), 36u);
    EXPECT_EQ(keys_of(example["search"]), keys_of(line["search"]));
    EXPECT_EQ(keys_of(example["camera"]), keys_of(line["camera"]));
}
