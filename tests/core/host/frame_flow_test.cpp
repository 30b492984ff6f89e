// SPDX-License-Identifier: Apache-2.0
//
// Tests which frame goes to which component, and when, in virtual time.
#include "host/frame_flow.hpp"

#include "host/cameras.hpp"

#include <directories.hpp>
#include <manual_clock.hpp>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <random>
#include <set>

using namespace arhost::host;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;
using Readiness = FrameFlow::Readiness;

namespace {

FrameFlow::Settings lockstep() {
    FrameFlow::Settings settings;
    settings.has_tracker = settings.has_raytracer = true;
    return settings;
}

FrameFlow::Settings live() {
    FrameFlow::Settings settings = lockstep();
    settings.live = true;
    return settings;
}

// A run whose components are played by the test. `go` executes all actions and returns them as "read 0", "track 0",
// "render 0", "show 0" or, with an overlay, "show 0+".
struct Bench {
    explicit Bench(const FrameFlow::Settings &settings)
        : cameras(settings.trajectory), flow(settings, clock, cameras, statistics) {
        cameras.set_targets({"desk", 90, held_frames}, false);
        arhost_intrinsics intrinsics{};
        intrinsics.width = 64;
        intrinsics.height = 48;
        intrinsics.fx = intrinsics.fy = 50;
        cameras.set_intrinsics(intrinsics);
    }

    std::vector<std::string> go() {
        std::vector<std::string> actions;
        while (auto action = flow.next(intakes()))
            actions.push_back(std::visit([this](auto &each) { return execute(each); }, *action));
        return actions;
    }
    std::string execute(FrameFlow::Read &read) {
        pending.push_back(read.sequence);
        return "read " + std::to_string(read.sequence);
    }
    std::string execute(FrameFlow::Track &track) {
        in_tracker.push_back(track.frame.record.sequence);
        return "track " + std::to_string(track.frame.record.sequence);
    }
    std::string execute(FrameFlow::Render &render) {
        in_raytracer.push_back(render.frame.record.sequence);
        return "render " + std::to_string(render.frame.record.sequence);
    }
    std::string execute(FrameFlow::Show &show) {
        flow.on_shown(*show.frame, clock.now());
        return "show " + std::to_string(show.frame->record.sequence) + (show.frame->has_overlay() ? "+" : "");
    }

    FrameFlow::Intakes intakes() {
        FrameFlow::Intakes intakes;
        const auto state = [](Readiness readiness, std::size_t in_flight, std::size_t limit) {
            return readiness == Readiness::ready && in_flight >= limit ? Readiness::busy : readiness;
        };
        intakes.source = {source, source_slots.get()};
        intakes.tracker = {state(tracker, in_tracker.size(), 1), stage_slots.get()};
        intakes.raytracer = {state(raytracer, in_raytracer.size(), raytracer_limit), overlay_slots.get(),
                             anchor_slots.get()};
        intakes.outputs_are_full = outputs_are_full;
        return intakes;
    }

    // The oldest frame that was read arrives, with this capture time.
    void arrive(std::int64_t capture_ns = 0, arhost_clock timestamps = ARHOST_CLOCK_MEDIA) {
        auto frame = std::make_unique<Frame>(pending.front());
        pending.erase(pending.begin());
        frame->pixels = flow.take_read();
        frame->record.clock = timestamps;
        frame->record.capture_ns = capture_ns;
        frame->captured = clock.now();
        frame->recorded = flow.recorded(frame->record.sequence);
        if (flow.repeats_decisions(*frame))
            cameras.set_from_recording(*frame);
        flow.on_arrived(std::move(frame));
    }
    // The tracker answers for its frame; `sees_target`: it has found the target 'desk'.
    void tracked(bool sees_target = true, std::chrono::nanoseconds busy = 1ms) {
        const std::uint64_t sequence = take(in_tracker);
        Frame *frame = flow.answered(sequence);
        if (!frame)
            return;
        if (sees_target) {
            arhost_target &target = frame->targets.emplace_back();
            std::string("desk").copy(target.name, sizeof target.name);
            target.state = ARHOST_TARGET_DETECTED;
            const glm::dmat4 pose = glm::translate(glm::dmat4(1), {0., 0., -500.});
            std::copy_n(glm::value_ptr(pose), 16, target.mt);
        }
        flow.on_tracked(*frame, busy);
    }
    void tracker_fails() {
        if (Frame *frame = flow.answered(take(in_tracker)))
            flow.on_failed(*frame, "tracker");
    }
    void rendered(std::chrono::nanoseconds busy = 1ms) {
        if (Frame *frame = flow.answered(take(in_raytracer)))
            flow.on_rendered(*frame, busy);
    }
    void tracker_dies() { flow.on_lost(Frame::Stage::to_track, std::exchange(in_tracker, {})); }
    void raytracer_dies() { flow.on_lost(Frame::Stage::to_render, std::exchange(in_raytracer, {})); }
    static std::uint64_t take(std::vector<std::uint64_t> &frames) {
        const std::uint64_t first = frames.front();
        frames.erase(frames.begin());
        return first;
    }

    static constexpr std::uint64_t held_frames = 1;
    arhost::test::ManualClock clock;
    Statistics statistics;
    Cameras cameras;
    FrameFlow flow;
    std::shared_ptr<SlotPool> source_slots = std::make_shared<SlotPool>(std::size_t{8}),
                              stage_slots = std::make_shared<SlotPool>(std::size_t{4}),
                              overlay_slots = std::make_shared<SlotPool>(std::size_t{4}), anchor_slots;
    Readiness source = Readiness::ready, tracker = Readiness::ready, raytracer = Readiness::ready;
    std::size_t raytracer_limit = 2;
    bool outputs_are_full = false;
    std::vector<std::uint64_t> pending, in_tracker, in_raytracer; // frames without an answer
};

// The next `count` frames arrive, one after the other.
void arrive(Bench &bench, int count, std::chrono::nanoseconds interval = 0ns) {
    for (int i = 0; i < count; ++i) {
        bench.go();
        bench.clock.advance(interval);
        bench.arrive();
    }
}

} // namespace

// ---- mode lockstep --------------------------------------------------------------------------------------

TEST(FrameFlow, TakesAFrameFromTheSourceToTheOutputs) {
    Bench bench(lockstep());
    EXPECT_THAT(bench.go(), ElementsAre("read 0", "read 1"));
    bench.arrive();
    EXPECT_THAT(bench.go(), ElementsAre("read 2", "track 0"));
    bench.tracked();
    EXPECT_THAT(bench.go(), ElementsAre("render 0"));
    bench.rendered();
    EXPECT_THAT(bench.go(), ElementsAre("show 0+"));
    EXPECT_EQ(bench.statistics.composited, 1u);
    EXPECT_EQ(bench.statistics.augmented, 1u);
}

TEST(FrameFlow, ShowsAFrameWithoutATargetAsItIs) {
    Bench bench(lockstep());
    arrive(bench, 1);
    bench.go();
    bench.tracked(false);
    EXPECT_THAT(bench.go(), ElementsAre("show 0"));
    EXPECT_TRUE(bench.statistics.skipped.empty()) << "nothing has failed";
}

TEST(FrameFlow, HoldsTheCameraForAFewFrames) {
    Bench bench(lockstep());
    std::vector<std::string> shown;
    for (int i = 0; i < 3; ++i) {
        arrive(bench, 1);
        bench.go();
        bench.tracked(i == 0);
        bench.go();
        if (!bench.in_raytracer.empty())
            bench.rendered();
        const auto actions = bench.go();
        std::ranges::copy_if(actions, std::back_inserter(shown), [](const auto &action) { return action[0] == 's'; });
    }
    EXPECT_THAT(shown, ElementsAre("show 0+", "show 1+")) << "the third frame was shown when its camera was missing";
}

TEST(FrameFlow, ShowsFramesInOrder) {
    Bench bench(lockstep());
    arrive(bench, 2);
    bench.go();
    bench.tracked();
    EXPECT_THAT(bench.go(), ElementsAre("track 1", "render 0"));
    bench.tracker_fails(); // frame 1 is done before frame 0
    EXPECT_THAT(bench.go(), IsEmpty());
    bench.rendered();
    EXPECT_THAT(bench.go(), ElementsAre("show 0+", "show 1"));
}

TEST(FrameFlow, WaitsForTheOutputsAndThenTheSourceHasToWait) {
    Bench bench(lockstep());
    bench.outputs_are_full = true;
    for (int i = 0; i < 8; ++i) {
        bench.go();
        if (!bench.pending.empty())
            bench.arrive();
        bench.go();
        if (!bench.in_tracker.empty())
            bench.tracked(false);
    }
    EXPECT_THAT(bench.go(), IsEmpty());
    EXPECT_TRUE(bench.pending.empty()) << "all slots of the source are in use";
    bench.outputs_are_full = false;
    EXPECT_THAT(bench.go(), testing::IsSupersetOf(
                                {"show 0", "show 1", "show 2", "show 3", "show 4", "show 5", "show 6", "show 7"}));
    EXPECT_TRUE(bench.statistics.dropped.empty());
}

TEST(FrameFlow, ProcessesTheFramesOfADeadWorkerAgain) {
    Bench bench(lockstep());
    arrive(bench, 1);
    bench.go();
    bench.tracker = Readiness::down;
    bench.tracker_dies();
    EXPECT_THAT(bench.go(), IsEmpty()) << "waits for the restart";
    bench.tracker = Readiness::ready;
    EXPECT_THAT(bench.go(), ElementsAre("track 0"));
}

TEST(FrameFlow, SkipsAFrameThatKillsAWorkerTwice) {
    Bench bench(lockstep());
    arrive(bench, 1);
    for (int i = 0; i < 2; ++i) {
        bench.go();
        bench.tracker_dies();
    }
    EXPECT_THAT(bench.go(), ElementsAre("show 0"));
    EXPECT_EQ(bench.statistics.skipped["tracker"], 1u);
}

TEST(FrameFlow, DoesNotBlameAFrameThatTheDeadWorkerHadNotBegun) {
    Bench bench(lockstep());
    arrive(bench, 2);
    bench.go();
    bench.tracked();
    bench.go();
    bench.tracked();
    EXPECT_THAT(bench.go(), ElementsAre("render 1")) << "the ray tracer has both frames";
    for (int i = 0; i < 2; ++i) {
        bench.raytracer_dies();
        bench.go();
    }
    EXPECT_THAT(bench.in_raytracer, ElementsAre(1u)) << "frame 0 was skipped, frame 1 was not";
}

TEST(FrameFlow, SkipsADisabledComponent) {
    Bench bench(lockstep());
    bench.tracker = Readiness::disabled;
    arrive(bench, 1);
    EXPECT_THAT(bench.go(), testing::Contains("show 0"));
}

TEST(FrameFlow, ReadsAgainWhatTheDeadSourceHasNotDelivered) {
    Bench bench(lockstep());
    bench.go();
    bench.flow.on_source_lost(std::exchange(bench.pending, {}));
    EXPECT_THAT(bench.go(), ElementsAre("read 0", "read 1"));
}

TEST(FrameFlow, IgnoresAReadAfterOneThatFailed) {
    Bench bench(lockstep());
    bench.go();
    bench.flow.take_read();
    bench.flow.read_again(0);
    EXPECT_FALSE(bench.flow.expects(1));
    bench.flow.take_read();
    EXPECT_THAT(bench.go(), ElementsAre("read 0", "read 1"));
}

TEST(FrameFlow, EndsAtTheLimitOfFrames) {
    FrameFlow::Settings settings = lockstep();
    settings.max_frames = 1;
    Bench bench(settings);
    EXPECT_THAT(bench.go(), ElementsAre("read 0"));
    EXPECT_TRUE(bench.flow.expects_more_frames()) << "the answer is missing";
    bench.arrive();
    EXPECT_FALSE(bench.flow.expects_more_frames());
    EXPECT_FALSE(bench.flow.is_empty());
}

TEST(FrameFlow, ReadsNothingWhileTheVideoIsFrozen) {
    Bench bench(lockstep());
    bench.flow.set_frozen(true);
    EXPECT_THAT(bench.go(), IsEmpty());
    bench.flow.set_frozen(false);
    EXPECT_THAT(bench.go(), ElementsAre("read 0", "read 1"));
}

TEST(FrameFlow, FinishesTheFramesInProgressWhileTheVideoIsFrozen) {
    Bench bench(lockstep());
    arrive(bench, 1);
    EXPECT_THAT(bench.go(), ElementsAre("read 2", "track 0"));
    bench.flow.set_frozen(true);
    bench.tracked();
    EXPECT_THAT(bench.go(), ElementsAre("render 0"));
    bench.rendered();
    EXPECT_THAT(bench.go(), ElementsAre("show 0+"));
    EXPECT_TRUE(bench.flow.is_empty());
}

TEST(FrameFlow, MeasuresTheLatencyOfEachShownFrame) {
    FrameFlow::Settings settings = lockstep();
    settings.has_timeline = true;
    Bench bench(settings);
    for (const auto latency : {20ms, 70ms}) {
        arrive(bench, 1, 100ms);
        bench.go();
        bench.clock.advance(latency);
        bench.tracked(false);
        bench.go();
    }
    ASSERT_EQ(bench.statistics.timeline.size(), 2u);
    EXPECT_EQ(bench.statistics.timeline[0].latency, 20ms);
    EXPECT_EQ(bench.statistics.timeline[1].latency, 70ms);
    EXPECT_EQ(bench.statistics.timeline[1].frame, 1u);
    EXPECT_EQ(bench.statistics.timeline[1].shown, bench.clock.now());
    EXPECT_EQ(bench.statistics.last_frame, bench.clock.now());
}

// The held camera has the axes of the previous scene, in which its frame is being rendered.
TEST(FrameFlow, ShowsAFrameWithAHeldCameraWithoutAnOverlayInAReplacedScene) {
    Bench bench(lockstep());
    bench.raytracer_limit = 1;
    for (const bool sees_target : {true, false}) {
        arrive(bench, 1);
        bench.go();
        bench.tracked(sees_target);
        bench.go();
    }
    EXPECT_THAT(bench.in_raytracer, ElementsAre(0u));
    bench.cameras.set_coordinates({1, 2, {{90, {1, 0, 0}}}});
    bench.flow.on_coordinates_changed();
    bench.rendered();
    EXPECT_THAT(bench.go(), ElementsAre("show 0+", "show 1"));
}

TEST(FrameFlow, GivesAFrameInAReplacedSceneTheCameraOfTheNewAxes) {
    Bench bench(lockstep());
    bench.raytracer = Readiness::busy;
    arrive(bench, 1);
    bench.go();
    bench.tracked();
    bench.go();
    bench.cameras.set_coordinates({1, 2, {{90, {1, 0, 0}}}});
    bench.flow.on_coordinates_changed();
    bench.raytracer = Readiness::ready;
    EXPECT_THAT(bench.go(), ElementsAre("render 0"));
    EXPECT_NEAR(bench.flow.find(0)->record.camera.eye[1], 500, 1e-9) << "z up has become y up";
}

TEST(FrameFlow, KeepsNoSlotOfAnOverlayIfNoneForAnchorsIsFree) {
    Bench bench(lockstep());
    bench.anchor_slots = std::make_shared<SlotPool>(std::size_t{1});
    arrive(bench, 2);
    bench.go();
    bench.tracked();
    EXPECT_THAT(bench.go(), ElementsAre("track 1", "render 0"));
    bench.tracked();
    EXPECT_THAT(bench.go(), IsEmpty());
    bench.rendered();
    EXPECT_THAT(bench.go(), testing::IsSupersetOf({"render 1", "show 0+"}));
    std::vector<Lease> free;
    while (auto slot = bench.overlay_slots->acquire())
        free.push_back(std::move(*slot));
    EXPECT_EQ(free.size(), 3u) << "frame 1 has the fourth";
}

TEST(FrameFlow, CountsTheDeathsOfEachWorkerApart) {
    Bench bench(lockstep());
    arrive(bench, 1);
    bench.go();
    bench.tracker_dies();
    bench.go();
    bench.tracked();
    bench.go();
    bench.raytracer_dies();
    EXPECT_THAT(bench.go(), ElementsAre("render 0"));
}

// ---- recordings -----------------------------------------------------------------------------------------

TEST(FrameFlow, TakesItsFramesFromATrajectoryIfThereIsNoSource) {
    arhost::camera::Trajectory trajectory;
    for (const std::uint64_t frame : {0, 3, 4})
        trajectory.frames.push_back(
            {frame, std::int64_t(frame) * 10, arhost::camera::View{{0, 0, 500}, {}, {0, 1, 0}}});
    FrameFlow::Settings settings;
    settings.has_source = false;
    settings.has_raytracer = true;
    settings.trajectory = &trajectory;
    settings.max_frames = 4;
    Bench bench(settings);
    EXPECT_THAT(bench.go(), ElementsAre("render 0", "render 3")) << "the recorded run has dropped frames 1 and 2";
    EXPECT_EQ(bench.flow.find(3)->record.capture_ns, 30);
    EXPECT_FALSE(bench.flow.expects_more_frames()) << "frame 4 is beyond the limit";
    bench.rendered();
    bench.rendered();
    EXPECT_THAT(bench.go(), ElementsAre("show 0+", "show 3+"));
    EXPECT_TRUE(bench.flow.is_empty());
}

TEST(FrameFlow, RepeatsTheDecisionsOfARecordedRun) {
    arhost::run_config::Recording recording;
    for (const arhost_overlay overlay : {ARHOST_OVERLAY_RENDERED, ARHOST_OVERLAY_NONE})
        recording.frames.push_back({.number = recording.frames.size(),
                                    .capture_ns = 0,
                                    .clock = ARHOST_CLOCK_MEDIA,
                                    .overlay = overlay,
                                    .scale = 1,
                                    .samples = 0,
                                    .shading_px = 1,
                                    .targets = {},
                                    .observations = {},
                                    .view = arhost::camera::View{{0, 0, 500}, {}, {0, 1, 0}},
                                    .truth = {}});
    for (const bool repeats : {true, false}) {
        recording.repeats_decisions = repeats;
        FrameFlow::Settings settings = lockstep();
        settings.recording = &recording;
        Bench bench(settings);
        bench.go();
        bench.arrive();
        bench.arrive();
        if (repeats)
            EXPECT_THAT(bench.go(), ElementsAre("read 2", "read 3", "render 0")) << "frame 1 had no overlay";
        else
            EXPECT_THAT(bench.go(), ElementsAre("read 2", "read 3", "track 0"));
    }
}

// ---- paced ----------------------------------------------------------------------------------------------

TEST(FrameFlow, ShowsAFilmAtItsOwnRate) {
    FrameFlow::Settings settings;
    Bench bench(settings);
    bench.flow.set_paced(true);
    bench.go();
    bench.arrive(0);
    bench.arrive(40'000'000);
    EXPECT_THAT(bench.go(), testing::Contains("show 0"));
    ASSERT_TRUE(bench.flow.due());
    EXPECT_EQ(*bench.flow.due() - bench.clock.now(), 40ms);
    bench.clock.advance(39ms);
    EXPECT_THAT(bench.go(), IsEmpty());
    bench.clock.advance(1ms);
    EXPECT_THAT(bench.go(), ElementsAre("show 1"));
}

// Its frames have the time stamps of a camera.
TEST(FrameFlow, ShowsARecordingAtItsOwnRate) {
    arhost::run_config::Recording recording;
    recording.repeats_decisions = false;
    for (const std::int64_t capture_ns : {0, 40'000'000})
        recording.frames.push_back({.number = recording.frames.size(),
                                    .capture_ns = capture_ns,
                                    .clock = ARHOST_CLOCK_MONOTONIC,
                                    .overlay = ARHOST_OVERLAY_NONE,
                                    .scale = 1,
                                    .samples = 0,
                                    .shading_px = 1,
                                    .targets = {},
                                    .observations = {},
                                    .view = {},
                                    .truth = {}});
    for (const bool is_recording : {true, false}) {
        FrameFlow::Settings settings;
        settings.max_frames = 2;
        settings.recording = is_recording ? &recording : nullptr;
        Bench bench(settings);
        bench.flow.set_paced(true);
        bench.go();
        bench.arrive(0, ARHOST_CLOCK_MONOTONIC);
        bench.arrive(40'000'000, ARHOST_CLOCK_MONOTONIC);
        if (!is_recording) {
            EXPECT_THAT(bench.go(), ElementsAre("show 0", "show 1")) << "a camera sets the rate itself";
            continue;
        }
        EXPECT_THAT(bench.go(), ElementsAre("show 0"));
        bench.clock.advance(40ms);
        EXPECT_THAT(bench.go(), ElementsAre("show 1"));
    }
}

TEST(FrameFlow, DoesNotCatchUpMoreThanAMomentOfAFilm) {
    Bench bench{FrameFlow::Settings()};
    bench.flow.set_paced(true);
    bench.go();
    bench.arrive(0);
    bench.go();
    bench.clock.advance(10s); // the run was stopped for a while
    bench.arrive(40'000'000);
    EXPECT_THAT(bench.go(), testing::Contains("show 1"));
    bench.arrive(80'000'000);
    EXPECT_THAT(bench.go(), testing::Not(testing::Contains("show 2")));
    ASSERT_TRUE(bench.flow.due());
    EXPECT_EQ(*bench.flow.due() - bench.clock.now(), 40ms);
}

TEST(FrameFlow, DoesNotWaitForAGapInAFilmNorAfterAnInterruption) {
    Bench bench{FrameFlow::Settings()};
    bench.flow.set_paced(true);
    bench.go();
    bench.arrive(0);
    bench.arrive(11'000'000'000);
    EXPECT_THAT(bench.go(), testing::IsSupersetOf({"show 0", "show 1"}));
    bench.arrive(12'000'000'000);
    EXPECT_THAT(bench.go(), testing::Not(testing::Contains("show 2")));
    bench.flow.on_interrupted();
    EXPECT_THAT(bench.go(), ElementsAre("show 2"));
}

TEST(FrameFlow, OmitsTheUnfinishedFramesOfAnInterruptedRun) {
    Bench bench(lockstep());
    arrive(bench, 3);
    bench.go();
    for (int i = 0; i < 2; ++i) {
        bench.tracked();
        bench.go();
    }
    ASSERT_THAT(bench.in_raytracer, ElementsAre(0u, 1u));
    ASSERT_THAT(bench.in_tracker, ElementsAre(2u));
    bench.flow.on_input_ended();
    bench.flow.on_interrupted();
    bench.rendered();
    bench.flow.omit_unfinished();
    EXPECT_THAT(bench.go(), ElementsAre("show 0+")) << "this frame is finished";
    EXPECT_TRUE(bench.flow.has_only_overtaken());
    EXPECT_TRUE(bench.flow.discards_arrivals()) << "a read that ignores the cancellation may still end";
    bench.rendered();
    bench.tracked();
    EXPECT_TRUE(bench.flow.is_empty());
    EXPECT_TRUE(bench.statistics.skipped.empty()) << "no frame was shown without its overlay";
}

// ---- mode live ------------------------------------------------------------------------------------------

TEST(FrameFlow, ReplacesAWaitingFrameByANewerOne) {
    Bench bench(live());
    arrive(bench, 4);
    EXPECT_THAT(bench.in_tracker, ElementsAre(0u));
    bench.tracked(false);
    EXPECT_THAT(bench.go(), testing::Contains("track 3"));
    EXPECT_EQ(bench.statistics.dropped["tracker"], 2u);
}

TEST(FrameFlow, LetsFramesWaitForAWorkerThatCatchesUp) {
    Bench bench(live());
    bench.flow.set_rate(30);
    for (int i = 0; i < 30; ++i) {
        arrive(bench, 1);
        bench.go();
        bench.tracked(false, 5ms);
    }
    arrive(bench, 4);
    EXPECT_TRUE(bench.statistics.dropped.empty()) << "one in the tracker, three waiting";
    arrive(bench, 1);
    EXPECT_EQ(bench.statistics.dropped["tracker"], 1u);
}

TEST(FrameFlow, DropsFramesForAWorkerThatIsAlwaysSlowOrAtAnUnknownRate) {
    for (const double fps : {30., 0.}) {
        Bench bench(live());
        bench.flow.set_rate(fps);
        arrive(bench, 1);
        bench.go();
        bench.tracked(false, 40ms);
        arrive(bench, 3);
        EXPECT_EQ(bench.statistics.dropped["tracker"], 1u) << fps;
    }
}

TEST(FrameFlow, ForgetsThePaceOfAReplacedTracker) {
    Bench bench(live());
    bench.flow.set_rate(30);
    arrive(bench, 1);
    bench.go();
    bench.tracked(false, 40ms);
    bench.flow.on_tracker_replaced();
    arrive(bench, 3);
    EXPECT_TRUE(bench.statistics.dropped.empty());
}

TEST(FrameFlow, ForgetsThePaceOfAReplacedRayTracer) {
    for (const bool is_replaced : {false, true}) {
        Bench bench(live());
        bench.raytracer_limit = 1;
        bench.flow.set_rate(30);
        for (int frame = 0; frame < 4; ++frame) {
            arrive(bench, 1);
            bench.go();
            bench.tracked();
            bench.go();
            if (frame > 0)
                continue; // the others wait
            bench.rendered(40ms);
            if (is_replaced)
                bench.flow.on_raytracer_replaced();
        }
        EXPECT_EQ(bench.statistics.dropped["raytracer"], is_replaced ? 0u : 1u);
    }
}

TEST(FrameFlow, DiscardsOnlyTheArrivalsAfterAnInterruptedCameraHasEnded) {
    for (const bool is_live : {false, true}) {
        Bench bench(is_live ? live() : lockstep());
        EXPECT_FALSE(bench.flow.discards_arrivals());
        bench.flow.on_input_ended();
        EXPECT_FALSE(bench.flow.discards_arrivals()) << "a source without an interruption has ended";
        bench.flow.on_interrupted();
        EXPECT_EQ(bench.flow.discards_arrivals(), is_live);
    }
}

TEST(FrameFlow, PassesFramesWhileAWorkerRestarts) {
    Bench bench(live());
    arrive(bench, 1);
    bench.go();
    bench.tracker = Readiness::down;
    bench.tracker_dies();
    EXPECT_THAT(bench.go(), ElementsAre("show 0"));
    bench.arrive();
    EXPECT_THAT(bench.go(), testing::Contains("show 1"));
    EXPECT_EQ(bench.statistics.skipped["tracker"], 2u);
}

TEST(FrameFlow, LetsFramesWaitWhileAComponentIsReplaced) {
    Bench bench(live());
    bench.tracker = Readiness::busy;
    arrive(bench, 1);
    EXPECT_THAT(bench.go(), testing::Not(testing::Contains("show 0")));
    bench.tracker = Readiness::ready;
    EXPECT_THAT(bench.go(), ElementsAre("track 0"));
}

TEST(FrameFlow, PassesFramesWhileOneIsInAWorkerForTooLong) {
    Bench bench(live());
    arrive(bench, 1);
    bench.go();
    bench.clock.advance(501ms);
    bench.arrive();
    EXPECT_THAT(bench.go(), testing::Contains("show 1"));
    EXPECT_EQ(bench.statistics.skipped["latency"], 1u);
}

TEST(FrameFlow, DropsAFrameThatANewerOneHasOvertaken) {
    Bench bench(live());
    arrive(bench, 1);
    bench.go();
    bench.clock.advance(501ms);
    bench.arrive();
    bench.go();
    bench.flow.on_input_ended();
    EXPECT_TRUE(bench.flow.has_only_overtaken());
    bench.tracked();
    EXPECT_TRUE(bench.flow.is_empty());
    EXPECT_EQ(bench.statistics.dropped["late"], 1u);
}

TEST(FrameFlow, DropsAFrameIfAllOutputsAreFull) {
    Bench bench(live());
    bench.outputs_are_full = true;
    arrive(bench, 1);
    bench.go();
    bench.tracked(false);
    bench.go();
    EXPECT_TRUE(bench.flow.is_empty());
    EXPECT_EQ(bench.statistics.dropped["output"], 1u);
    EXPECT_EQ(bench.statistics.composited, 0u);
}

TEST(FrameFlow, CountsATargetOnlyInFramesThatAreShown) {
    Bench bench(live());
    for (const bool is_shown : {false, true}) {
        bench.outputs_are_full = !is_shown;
        arrive(bench, 1);
        bench.go();
        bench.tracked();
        bench.go();
        bench.rendered();
        bench.go();
        EXPECT_EQ(bench.statistics.composited, is_shown);
        EXPECT_EQ(bench.statistics.tracked, is_shown);
    }
}

TEST(FrameFlow, ReadsAgainOnceADroppedFrameHasFreedItsSlot) {
    Bench bench(live());
    bench.source_slots = std::make_shared<SlotPool>(std::size_t{1});
    bench.outputs_are_full = true;
    arrive(bench, 1);
    bench.go();
    bench.tracked(false);
    EXPECT_THAT(bench.go(), ElementsAre("read 1"));
}

TEST(FrameFlow, DropsTheFramesOfAFrozenCamera) {
    Bench bench(live());
    bench.go();
    bench.flow.set_frozen(true);
    bench.arrive();
    EXPECT_THAT(bench.go(), ElementsAre("read 2")) << "the camera is still read, so that its frames stay current";
    EXPECT_EQ(bench.statistics.dropped["freeze"], 1u);
}

// ---- the picture of the states --------------------------------------------------------------------------

namespace {

// Records the transitions of Frame::Stage, as "to_track -> tracking", from "start" to "end".
class Transitions {
public:
    void look(const FrameFlow &flow, std::uint64_t arrived) {
        for (std::uint64_t i = 0; i < arrived; ++i) {
            const Frame *frame = flow.find(i);
            enter(i, frame ? names.at(static_cast<std::size_t>(frame->stage)) : "end");
        }
    }
    void enter(std::uint64_t frame, const std::string &stage) {
        std::string &previous = before_.try_emplace(frame, "start").first->second;
        if (previous != stage && previous != "end")
            seen.insert(previous + " -> " + stage);
        previous = stage;
    }
    void forget_frames() { before_.clear(); }

    std::set<std::string> seen;

private:
    const std::vector<std::string> names{"to_track", "tracking", "to_render", "rendering", "done"};
    std::map<std::uint64_t, std::string> before_;
};

// Ends the run: all frames are answered and shown.
void expect_that_all_slots_become_free(Bench &bench) {
    bench.flow.on_input_ended();
    bench.tracker = bench.raytracer = Readiness::ready;
    while (!bench.pending.empty())
        bench.arrive();
    for (int i = 0; i < 100 && !bench.flow.is_empty(); ++i) {
        bench.go();
        if (!bench.in_tracker.empty())
            bench.tracked();
        if (!bench.in_raytracer.empty())
            bench.rendered();
    }
    EXPECT_TRUE(bench.flow.is_empty());
    for (const auto &[slots, count] :
         {std::pair{bench.source_slots, 8}, {bench.stage_slots, 4}, {bench.overlay_slots, 4}}) {
        std::vector<Lease> free;
        while (auto slot = slots->acquire())
            free.push_back(std::move(*slot));
        EXPECT_EQ(free.size(), static_cast<std::size_t>(count));
    }
}

// Lets random events happen.
void run_at_random(const FrameFlow::Settings &settings, unsigned seed, Transitions &transitions) {
    Bench bench(settings);
    std::minstd_rand random(seed);
    std::uint64_t arrived = 0;
    for (int step = 0; step < 300; ++step) {
        switch (random() % 8) {
        case 0:
        case 1:
            if (!bench.pending.empty())
                arrived = bench.pending.front() + 1, bench.arrive();
            break;
        case 2:
            if (!bench.in_tracker.empty())
                bench.tracked(random() % 3 > 0);
            break;
        case 3:
            if (!bench.in_raytracer.empty())
                bench.rendered();
            break;
        case 4:
            bench.tracker = static_cast<Readiness>(random() % 3);
            bench.raytracer = static_cast<Readiness>(random() % 3);
            break;
        case 5:
            if (random() % 4 == 0)
                bench.tracker_dies();
            break;
        case 6:
            if (random() % 4 == 0)
                bench.raytracer_dies();
            break;
        default:
            bench.clock.advance(std::chrono::milliseconds(random() % 300));
        }
        transitions.look(bench.flow, arrived);
        // One action at a time, so that no transition is missed.
        if (auto action = bench.flow.next(bench.intakes())) {
            if (const auto *show = std::get_if<FrameFlow::Show>(&*action))
                transitions.enter(show->frame->record.sequence, "done"); // perhaps skipped and shown at once
            std::visit([&](auto &each) { bench.execute(each); }, *action);
            transitions.look(bench.flow, arrived);
        }
    }
    transitions.forget_frames();
    expect_that_all_slots_become_free(bench);
}

} // namespace

TEST(FrameFlow, ThePictureShowsTheTransitionsOfAFrame) {
    arhost::camera::Trajectory trajectory;
    for (std::uint64_t i = 0; i < 100; ++i)
        trajectory.frames.push_back({i, 0, arhost::camera::View{{0, 0, 500}, {0, 0, 0}, {0, 1, 0}}});
    Transitions transitions;
    for (unsigned run = 0; run < 64; ++run) {
        FrameFlow::Settings settings;
        settings.live = run % 2;
        settings.has_tracker = run / 2 % 2;
        settings.has_raytracer = run / 4 % 2;
        settings.trajectory = run / 8 % 2 ? &trajectory : nullptr;
        run_at_random(settings, run, transitions);
    }
    std::ifstream file(arhost::test::source_directory() + "/docs/images/frame-states.svg");
    const std::string picture(std::istreambuf_iterator<char>(file), {});
    std::set<std::string> drawn;
    constexpr std::string_view attribute = "data-transition=\"";
    for (std::size_t at = 0; (at = picture.find(attribute, at)) != std::string::npos;) {
        at += attribute.size();
        drawn.insert(picture.substr(at, picture.find('"', at) - at));
    }
    EXPECT_EQ(transitions.seen, drawn);
}
