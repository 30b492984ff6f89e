// SPDX-License-Identifier: Apache-2.0
#include "cli/recorded_session.hpp"

#include "directories.hpp"
#include "errors.hpp"
#include "fake_worker.hpp"
#include "host/documents.hpp"
#include "ipc/messages.hpp"
#include "manual_clock.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <csignal>
#include <fstream>

namespace arhost::cli {
namespace {

using host::fingerprint_of;
using session::RecordedFrame;
using testing::HasSubstr;
using testing::StartsWith;

const std::string description =
    R"({"format": "arhost-session", "version": 2, "fps": 30, "folder": "/lab", "overridden": {"raytracer": "/cwd"}, )"
    R"("scene_files": []})";

std::string line(int frame, const std::string &more = R"("overlay": "none", "targets": [], "camera": null)") {
    return "{\"frame\": " + std::to_string(frame) + ", \"capture_ns\": " + std::to_string(frame * 1'000) +
           ", \"clock\": \"media\", " + more + ", \"video_end\": " + std::to_string(100 * (frame + 1)) + "}\n";
}
const std::string rendered =
    R"("overlay": "rendered", "overlay_scale": 0.84, "overlay_samples": 3, "overlay_shading_px": 2, "targets": [)"
    R"({"name": "cup", "state": "detected", "age_frames": 0, "mt": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 3, 2, 1], )"
    R"("covariance": [9, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 8], )"
    R"("reprojection_px": 0.25, "ambiguity": 0.5, "observations": [{"id": 7, "corners_px": [[1, 2], [3, 2], [3, 4], [1, 4]], )"
    R"("decision_margin": 60, "corner_sigma_px": 0.05, "hamming": 1}]}, )"
    R"({"name": "lid", "state": "lost", "age_frames": 5, "mt": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -9, 1]}], )"
    R"("search": {"everywhere": true, "observations": 3, "unlisted": 2, "expected": 4, "missed": 1, "candidates": 6}, )"
    R"("camera": {"eye": [1, 2, 3.5], "look_at": [1, 2, 2.5], )"
    R"("up": [0, 1, 0]}, "truth": {"target": "cup", "mt": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]})";
const std::string end = "{\"end\": true}\n";

class SessionFolder : public testing::Test {
protected:
    SessionFolder() {
        std::filesystem::create_directory(folder());
        write("session.json", description);
        write("configuration.yaml",
              "version: 1\nplugin_path: [plugins]\nraytracer: {plugin: rt_embree, scene: a.yaml}\n");
        write("frames.jsonl", line(0) + line(1, rendered) + end);
        write("video.mkv", std::string(200, 'v'));
    }
    std::filesystem::path folder() const { return scratch_.path() / "take"; }
    void write(const std::string &name, const std::string &text) const {
        std::ofstream(folder() / name, std::ios::binary | std::ios::trunc) << text;
    }
    // Reads the session with its log.
    Session read(supervise::Context &context) const {
        Session session = read_session(folder());
        read_log(session, context, sandbox::Mode::permissive, {});
        return session;
    }
    Session read() { return read(context_); }
    // Returns the error without the folder.
    std::string error() {
        return test::without_folder(test::error_of([&] { (void)read(); }), folder());
    }
    // Returns the error without the name of the file.
    std::string error_of_log(const std::string &log) {
        write("frames.jsonl", log);
        return test::after("frames.jsonl:", error());
    }

    test::ScratchFolder scratch_;
    ipc::Reactor reactor_;
    supervise::Launcher launcher_{test::build_directory() + "/bin/arhost-launcher"};
    supervise::Context context_{reactor_, launcher_, test::build_directory() + "/bin/arhost-worker",
                                [](arhost_severity, const std::string &, const std::string &) {}};
};

TEST_F(SessionFolder, HasTheFactsOfEachFrame) {
    const Session session = read();
    EXPECT_EQ(session.warning, "");
    ASSERT_EQ(session.recording.frames.size(), 2u);
    const RecordedFrame &plain = session.recording.frames[0], &full = session.recording.frames[1];
    EXPECT_EQ(plain.overlay, ARHOST_OVERLAY_NONE);
    EXPECT_TRUE(plain.targets.empty() && plain.observations.empty() && !plain.view && !plain.truth);
    EXPECT_EQ(full.number, 1u);
    EXPECT_EQ(full.capture_ns, 1000);
    EXPECT_EQ(full.clock, ARHOST_CLOCK_MEDIA);
    EXPECT_EQ(full.overlay, ARHOST_OVERLAY_RENDERED);
    EXPECT_EQ(plain.scale, 1);
    EXPECT_EQ(plain.samples, 0u);
    EXPECT_EQ(plain.shading_px, 1u);
    EXPECT_EQ(full.scale, 0.84);
    EXPECT_EQ(full.samples, 3u);
    EXPECT_EQ(full.shading_px, 2u);
    ASSERT_EQ(full.targets.size(), 2u);
    const arhost_target &cup = full.targets[0], &lid = full.targets[1];
    EXPECT_STREQ(cup.name, "cup");
    EXPECT_EQ(cup.state, ARHOST_TARGET_DETECTED);
    EXPECT_EQ(cup.mt[13], 3);
    EXPECT_EQ(cup.covariance[35], 8);
    EXPECT_EQ(cup.reprojection_px, 0.25);
    EXPECT_EQ(cup.ambiguity, 0.5);
    EXPECT_EQ(cup.observation_count, 1u);
    EXPECT_EQ(lid.state, ARHOST_TARGET_LOST);
    EXPECT_EQ(lid.age_frames, 5u);
    EXPECT_EQ(lid.mt[14], -9);
    EXPECT_EQ(lid.first_observation, 1u);
    ASSERT_EQ(full.observations.size(), 1u);
    EXPECT_EQ(full.observations[0].id, 7);
    EXPECT_EQ(full.observations[0].hamming, 1u);
    EXPECT_EQ(full.observations[0].decision_margin, 60);
    EXPECT_EQ(full.observations[0].corner_sigma_px, 0.05);
    EXPECT_EQ(full.observations[0].corners_px[2][1], 4);
    EXPECT_EQ(full.search.everywhere, 1);
    EXPECT_EQ(full.search.observation_count, 3u);
    EXPECT_EQ(full.search.unlisted_count, 2u);
    EXPECT_EQ(full.search.expected_count, 4u);
    EXPECT_EQ(full.search.missed_count, 1u);
    EXPECT_EQ(full.search.candidate_count, 6);
    EXPECT_EQ(plain.search.observation_count, 0u);
    ASSERT_TRUE(full.view && full.truth);
    EXPECT_EQ(full.view->eye_mm[2], 3.5);
    EXPECT_EQ(full.truth->first, "cup");
    EXPECT_EQ(full.truth->second[13], 6);
}

TEST_F(SessionFolder, ARecordingWithoutTheNoiseOfCornersIsAccepted) {
    std::string without = rendered;
    const std::string member = R"("corner_sigma_px": 0.05, )";
    without.erase(without.find(member), member.size());
    write("frames.jsonl", line(0) + line(1, without) + end);
    EXPECT_EQ(read().recording.frames[1].observations.at(0).corner_sigma_px, 0);
}

TEST_F(SessionFolder, PathsHaveTheMeaningOfTheRecordedRun) {
    const Session session = read();
    EXPECT_EQ(session.configuration.require("plugin_path").items()[0].input_path(), "/lab/plugins");
    EXPECT_EQ(session.configuration.require("raytracer").require("scene").input_path(), "/cwd/a.yaml");
}

TEST_F(SessionFolder, FramesThatTheVideoLacksAreLeftOut) {
    write("frames.jsonl", line(0) + line(1) + line(2) + line(3) + end);
    write("video.mkv", std::string(299, 'v'));
    const Session session = read();
    EXPECT_EQ(session.recording.frames.size(), 2u);
    EXPECT_THAT(session.warning,
                HasSubstr("video.mkv: ends after frame 1: the last 2 frames of frames.jsonl are missing"));
}

TEST_F(SessionFolder, AnInterruptedRecordingEndsAtItsLastCompleteLine) {
    for (const std::string cut : {"", "{\"frame\": 2, \"capture", "{\"frame\": 2}"}) {
        write("frames.jsonl", line(0) + line(1) + cut);
        const Session session = read();
        EXPECT_EQ(session.recording.frames.size(), 2u);
        EXPECT_THAT(session.warning, HasSubstr("take: the recording was interrupted; it ends after frame 1, and"));
    }
}

// 60 million brackets would take gigabytes.
TEST_F(SessionFolder, LongAndDeepLinesAreRejected) {
    EXPECT_THAT(error_of_log(line(0) + std::string(5 << 20, ' ') + line(1)),
                StartsWith("2:1: is longer than 4 MiB, which no frame needs"));
    EXPECT_THAT(error_of_log(line(0) + std::string(1 << 20, '[') + "\n"),
                StartsWith("2:1: is nested more deeply than the record of a frame"));
}

TEST_F(SessionFolder, DamagedLinesAreReportedWithTheirPosition) {
    const test::ErrorCase cases[] = {
        {line(0) + "{\"frame\": 1, ]\n" + line(2),
         StartsWith("2:14: is not valid JSON; to replay the frames before it, delete this line and all that follow")},
        {line(0) + line(1, R"("overlay": "none", "targets": [], "search": {"everywhere": 1}, "camera": null)"),
         StartsWith("2:1: is not the record of a frame: type must be boolean")},
        {line(0) + "[]\n", StartsWith("2:1: is not the record of a frame: ")},
        {line(0) + "\n", StartsWith("2:1: is not valid JSON")},
        {"{\"frame\": 0}\n", StartsWith("1:1: is not the record of a frame: key 'capture_ns' not found")},
        {line(0, R"("overlay": "none", "targets": 3, "camera": null)"),
         StartsWith("1:1: is not the record of a frame: ")},
        {line(0, R"("overlay": "none", "targets": [], "camera": null, "truth": {"mt": )"
                 "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}"),
         StartsWith("1:1: is not the record of a frame: key 'target' not found")},
        {line(1) + line(1), StartsWith("2:1: frame: must be greater than in the line before, 1")},
        {line(0, R"("overlay": "all", "targets": [], "camera": null)"),
         StartsWith("1:1: overlay: 'all' is not one of rendered, held, none")},
        {line(0, R"("overlay": "held", "targets": [], "camera": null)"),
         StartsWith("1:1: camera: is null, but the frame has an overlay")},
        {line(0, R"("overlay": "none", "targets": [], "camera": {"eye": [0, 0, 0], )"
                 R"("look_at": [0, 0, 0], "up": [0, 1, 0]})"),
         StartsWith("1:1: camera: look_at must differ from eye")},
        {line(0) + end + line(1), StartsWith("3:1: follows the line that ends the recording")},
    };
    expect_errors([&](const std::string &text) { return error_of_log(text); }, cases);
    for (const std::string &log : {end, std::string()}) {
        write("frames.jsonl", log);
        EXPECT_THAT(error(), HasSubstr("contains no complete frame; record the session again"));
    }
}

TEST_F(SessionFolder, MissingPartsAreReported) {
    for (const std::string name : {"session.json", "configuration.yaml", "frames.jsonl", "video.mkv"}) {
        std::filesystem::rename(folder() / name, folder() / "away");
        EXPECT_EQ(error(),
                  name + ": is missing; a session that sink_session has recorded contains it (docs/sessions.md)");
        std::filesystem::rename(folder() / "away", folder() / name);
    }
    EXPECT_EQ(error(), "no error");
    std::filesystem::remove_all(folder());
    EXPECT_THAT(error(), HasSubstr("take: does not exist; name the folder of a session"));
    std::ofstream(folder()) << "file";
    EXPECT_THAT(error(), HasSubstr("take: is not a folder"));
}

TEST_F(SessionFolder, AnotherVersionIsRejectedAtItsPosition) {
    write("session.json", R"({"format": "arhost-session", "version": 1})");
    EXPECT_EQ(error(), "session.json:1:41: version: must be 2, the only version that this arhost can replay; record "
                       "the session again, or replay it with the arhost that has recorded it");
    write("session.json", R"({"format": "other", "version": 2})");
    EXPECT_THAT(error(), HasSubstr("session.json:1:12: format: 'other' is not one of arhost-session"));
    write("session.json", "{\"format\": ");
    EXPECT_THAT(error(), HasSubstr("session.json:1:"));
}

TEST_F(SessionFolder, ChangedSceneFilesAreNamed) {
    const std::filesystem::path scene = folder() / "scene.yaml";
    write("scene.yaml", "foobar");
    write("session.json", description.substr(0, description.size() - 3) + R"([{"file": ")" + scene.string() +
                              R"(", "bytes": 6, "fnv1a": "85944171f73967e8"}]})");
    EXPECT_TRUE(read_session(folder()).changed_scene_files().empty()) << fingerprint_of(scene, 1 << 20)->hash;
    write("scene.yaml", "foobaz");
    ASSERT_EQ(read_session(folder()).changed_scene_files().size(), 1u);
    EXPECT_THAT(read_session(folder()).changed_scene_files()[0], HasSubstr("scene.yaml' has changed since"));
    std::filesystem::remove(scene);
    EXPECT_THAT(read_session(folder()).changed_scene_files()[0], HasSubstr("scene.yaml' of the recording cannot be"));
}

// A worker that reads the log of the session and is compromised.
class CompromisedReader : public SessionFolder {
protected:
    // Returns the error after the worker has done `action` and exited.
    std::string error_after(const std::function<void()> &action) {
        worker_.on_spawn = [this, action] {
            action();
            worker_.die();
        };
        return test::without_folder(test::error_of([&] { (void)read(compromised_); }), folder());
    }
    void send_memory(std::string_view content) {
        const auto memory = ipc::SharedMemory::create("log", content.size());
        std::ranges::copy(std::as_bytes(std::span(content)), memory.map(ipc::Access::read_write).bytes().begin());
        worker_.channel.send(ipc::encode(ipc::messages::Loaded{}), {memory.fd()});
    }
    ipc::Message received() const {
        ipc::Message message;
        EXPECT_EQ(worker_.channel.receive(message, 0), ipc::ReceiveState::message);
        return message;
    }

    test::ManualClock clock_;
    ipc::Reactor clocked_{clock_};
    test::FakeWorker worker_;
    supervise::Context compromised_{clocked_, worker_, "",
                                    [](arhost_severity, const std::string &, const std::string &) {}};
};

TEST_F(CompromisedReader, MayReadOnlyTheLog) {
    EXPECT_THAT(error_after([] {}), StartsWith("frames.jsonl: the reader of the log failed: exited with status 0"));
    const auto policy = sandbox::policy_from_json(ipc::parse<ipc::messages::ReadLog>(received()).sandbox);
    EXPECT_THAT(policy.readable, testing::ElementsAre(folder() / "frames.jsonl"));
    EXPECT_TRUE(policy.writable.empty() && policy.allow.empty() && policy.environment.empty());
    EXPECT_EQ(policy.memory_bytes, 0u) << "has the default limit";
}

TEST_F(CompromisedReader, ItsDeathIsReportedWithTheLog) {
    worker_.wait_status = SIGSEGV;
    EXPECT_THAT(error_after([] {}), StartsWith("frames.jsonl: the reader of the log failed: killed by signal 11"));
}

TEST_F(CompromisedReader, ItsHangIsReportedWithTheLog) {
    ipc::Reactor::Registration hang_up, time_passes;
    worker_.on_spawn = [&] {
        hang_up = clocked_.watch(worker_.channel.fd(), [&] {
            ipc::Message message;
            if (worker_.channel.receive(message, 0) == ipc::ReceiveState::closed) // the host has ended the worker
                worker_.die();
        });
        time_passes = clocked_.at(clocked_.now(), [&] { clock_.advance(std::chrono::seconds(10)); });
    };
    EXPECT_THAT(test::without_folder(test::error_of([&] { (void)read(compromised_); }), folder()),
                StartsWith("frames.jsonl: the reader of the log failed: made no progress for 10000 ms; "));
}

TEST_F(CompromisedReader, ItsResultIsValidated) {
    const std::string what = "frames.jsonl: the reader of the log has returned an invalid result: ";
    EXPECT_EQ(error_after([&] { send_memory("x"); }), what + "it ends in the middle of a frame");
    EXPECT_EQ(error_after([&] { send_memory(std::string(200, '\0')); }),
              what + "its frame 0 is invalid: clock: is out of range");
    EXPECT_EQ(error_after([&] { send_memory(std::string(1 << 20, '\0')); }), what + "it is too large for this file");
    EXPECT_THAT(error_after([&] {
                    const base::UniqueFd pipe(::eventfd(0, EFD_CLOEXEC));
                    worker_.channel.send(ipc::encode(ipc::messages::Loaded{}), {pipe.get()});
                }),
                StartsWith("frames.jsonl: the reader of the log has returned memory that cannot be used: "));
}

TEST(Fingerprint, IsThatOfRegularFilesOnly) {
    EXPECT_EQ(fingerprint_of("/dev/zero", 1 << 20), std::nullopt);
    EXPECT_EQ(fingerprint_of("/", 1 << 20), std::nullopt);
    EXPECT_EQ(fingerprint_of("/missing", 1 << 20), std::nullopt);
}

} // namespace
} // namespace arhost::cli
