// SPDX-License-Identifier: Apache-2.0
//
// sink_window: shows frames in a window, and sends commands to the host when the user presses keys.
#include "frame_texture.hpp"
#include "host_commands.hpp"
#include "overlay.hpp"
#include "sink_common/debug_view.hpp"
#include "window.hpp"

#include <arhost-cpp/plugin.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace arhost;
using namespace arhost::drawing;
using namespace sink_window;
using Clock = std::chrono::steady_clock;

// Measures the rate of events over the last two seconds.
class Rate {
public:
    void add(Clock::time_point now) {
        times_.push_back(now);
        while (now - times_.front() > std::chrono::seconds(2))
            times_.pop_front();
    }
    double per_second() const {
        const std::chrono::duration<double> span =
            times_.empty() ? Clock::duration{} : times_.back() - times_.front();
        return span.count() > 0 ? static_cast<double>(times_.size() - 1) / span.count() : 0;
    }

private:
    std::deque<Clock::time_point> times_;
};

class WindowSink {
public:
    static constexpr const char *changeable[] = {DebugView::key, nullptr};

    static std::vector<Device> devices() { return list_displays(); }

    WindowSink(const Host &host, const Options &options)
        : title_(options.text("title")), scale_(options.real("scale")), vsync_(options.boolean("vsync")),
          status_line_(options.boolean("status_line")), shows_overlay_(options.text("content") == "overlay"),
          debug_view_(options),
          commands_(host, [this](const std::string &text, bool is_error) { show(text, is_error); }) {}

    std::uint64_t capabilities() const {
        return ARHOST_SINK_CAPABILITY_REALTIME |
               (shows_overlay_ ? std::uint64_t{ARHOST_SINK_CAPABILITY_OVERLAY_INPUT} : 0);
    }

    void start(const arhost_sink_setup &setup) {
        width_ = static_cast<int>(setup.width);
        height_ = static_cast<int>(setup.height);
        debug_view_.start(setup);
        window_.emplace(width_, height_, scale_, vsync_, title_, [this](char key) { on_key(key); });
        picture_.emplace(width_, height_, shows_overlay_);
        draw();
    }

    arhost_status write(const arhost_output &output) {
        const Clock::time_point now = Clock::now();
        keep(*output.record);
        rate_.add(now);
        if (record_->clock == ARHOST_CLOCK_MONOTONIC)
            latency_ms_ = std::chrono::duration<double, std::milli>(
                              now - Clock::time_point(std::chrono::nanoseconds(record_->capture_ns)))
                              .count();
        picture_->upload(output);
        draw();
        return poll();
    }

    arhost_status idle() {
        const arhost_status status = poll();
        if (window_->stale() || stale_ || commands_.take_changed() || (message_ && Clock::now() > message_->end))
            draw();
        return status;
    }

    void set(const Options &changed) {
        debug_view_.is_on = changed.boolean(DebugView::key);
        stale_ = true;
    }

    void stop() { window_.reset(); }

private:
    struct Message {
        std::string text;
        Colour colour;
        Clock::time_point end;
    };

    // Copies the record and its arrays, which are valid only during `write`.
    void keep(const arhost_record &record) {
        const auto copy = []<class T>(std::vector<T> &to, const T *from, std::uint32_t count) {
            const auto range = elements(from, count);
            to.assign(range.begin(), range.end());
            for (T &element : to)
                element.struct_size = sizeof(T);
            return to.data();
        };
        record_ = record;
        record_->targets = copy(targets_, record.targets, record.target_count);
        record_->observations = copy(observations_, record.observations, record.observation_count);
        record_->expected = copy(expected_, record.expected, record.expected_count);
    }

    void show(const std::string &text, bool is_error) {
        message_ = {text, is_error ? red : white, Clock::now() + std::chrono::seconds(is_error ? 6 : 3)};
        stale_ = true;
    }

    void on_key(char key) {
        stale_ = true;
        switch (key) {
        case 'h':
            help_ = !help_;
            break;
        case 's':
            return commands_.snapshot();
        case ' ':
            return commands_.freeze();
        case 'r':
            return commands_.record();
        case 'l':
            problems_ = !problems_;
            break;
        case 'd':
            debug_view_.is_on = !debug_view_.is_on;
            break;
        case 'f':
            return window_->toggle_full_screen();
        case 'm':
            mirrored_ = !mirrored_;
            break;
        case 'q':
            return window_->close();
        default:
            if (key >= '1' && key <= '9')
                commands_.load_scene(static_cast<std::size_t>(key - '1'));
        }
    }

    arhost_status poll() {
        window_->process_events();
        if (record_) // before the first frame, the host accepts no commands
            commands_.poll(Clock::now());
        return window_->closed() ? ARHOST_STATUS_END : ARHOST_STATUS_OK;
    }

    void draw() {
        stale_ = false;
        const Rectangle size = window_->size();
        if (size.width < 1 || size.height < 1)
            return; // the window is minimised
        const View view{fit(width_, height_, size.width, size.height), width_, height_, mirrored_};
        glClear(GL_COLOR_BUFFER_BIT);
        picture_->draw(view, size);
        draw_overlay(Overlay(size, view));
        window_->present();
    }

    void draw_overlay(const Overlay &overlay) {
        double top = 0;
        if (debug_view_.is_on && record_)
            top = debug_view_.draw(overlay, *record_, commands_.numbers() ? commands_.numbers()->timings : Timings());
        std::vector<Row> states;
        if (commands_.recording())
            states.push_back({"", "REC", red});
        if (commands_.frozen())
            states.push_back({"", "FROZEN", blue});
        if (!states.empty())
            overlay.box(states, 1, 0, top);
        double bottom = status_line_ && record_ ? overlay.bar(status(), "h: help") : 0;
        if (message_ && Clock::now() > message_->end)
            message_.reset();
        if (!commands_.missing_target().empty())
            bottom += overlay.box(overlay.wrap(commands_.missing_target(), yellow), 0.5, 1, 0, bottom);
        if (message_)
            bottom += overlay.box(overlay.wrap(message_->text, message_->colour), 0.5, 1, 0, bottom);
        if (problems_)
            overlay.box(problems(overlay), 0.5, 0.5, 0, bottom);
        if (help_)
            overlay.box(help(), 0.5, 0.5, 0, bottom);
    }

    std::vector<Row> problems(const Overlay &overlay) const {
        std::vector<Row> rows;
        for (const HostCommands::Problem &problem : commands_.problems())
            std::ranges::copy(overlay.wrap(problem.text, problem.is_error ? red : yellow), std::back_inserter(rows));
        return rows.empty() ? std::vector<Row>{{"", "no warning and no error", white}} : rows;
    }

    std::string status() const {
        const auto &numbers = commands_.numbers();
        std::string text = fmt::format("{:.1f} fps", numbers ? numbers->fps : rate_.per_second());
        if (const std::optional<double> latency_ms = numbers ? numbers->latency_ms : latency_ms_)
            text += fmt::format("   latency {:.0f} ms", *latency_ms);
        const auto is_visible = [](const arhost_target &target) { return target.state != ARHOST_TARGET_LOST; };
        text += "   " + count_of(numbers ? numbers->targets
                                         : std::ranges::count_if(elements(record_->targets, record_->target_count),
                                                                 is_visible),
                                 "target");
        if (numbers && numbers->restarts > 0)
            text += "   " + count_of(numbers->restarts, "restart");
        return text;
    }

    // Lists only what the keys do in this run.
    std::vector<Row> help() const {
        std::vector<Row> rows = {{"h", "close this help"}};
        const auto add = [&](const char *command, Row row) {
            if (commands_.grants(command))
                rows.push_back(std::move(row));
        };
        add("snapshot", {"s", "snapshot"});
        add("freeze", {"space", commands_.frozen() ? "continue" : "freeze"});
        add("record", {"r", commands_.recording() ? "end the recording" : "record"});
        add("status", {"l", "warnings and errors"});
        rows.insert(rows.end(), {{"d", "debug view"}, {"f", "full screen"}, {"m", "mirror"}});
        const std::vector<std::string> &scenes = commands_.scenes();
        for (std::size_t i = 0; i < std::min<std::size_t>(scenes.size(), 9); ++i)
            add("load_scene",
                {std::to_string(i + 1), "scene " + scenes[i], scenes[i] == commands_.scene() ? green : white});
        rows.push_back({"q", commands_.grants("quit") ? "end the run" : "close the window"});
        return rows;
    }

    std::string title_;
    double scale_;
    bool vsync_, status_line_, shows_overlay_;
    int width_ = 0, height_ = 0; // frame size in px
    DebugView debug_view_;
    HostCommands commands_;
    std::optional<Window> window_;
    std::optional<FrameTexture> picture_;
    std::optional<arhost_record> record_; // record of the frame in the window
    std::vector<arhost_target> targets_;  // targets of the record
    std::vector<arhost_observation> observations_;
    std::vector<arhost_expected_marker> expected_;
    Rate rate_;
    std::optional<double> latency_ms_; // time from the capture of a frame to its arrival in this plugin
    bool help_ = false, problems_ = false, mirrored_ = false, stale_ = false;
    std::optional<Message> message_;
};

constexpr const char *contents[] = {"frame", "overlay", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "title", "arhost", "Window title."),
    option(ARHOST_OPTION_REAL, "scale", "1", "Initial window size as a multiple of the frame size.", 0.05, 16),
    option(ARHOST_OPTION_BOOL, "vsync", "true", "Synchronize with the display, which avoids tearing."),
    option(ARHOST_OPTION_TEXT, "content", "frame",
           "frame, or the overlay alone over black, for see-through displays.", 0, 0, contents),
    option(ARHOST_OPTION_BOOL, "status_line", "true", "Show frame rate, latency, targets and restarts."),
    DebugView::option,
};

constexpr const char *needs[] = {"display", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_window",
    .name = "Window",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Shows frames in a window.",
    .capabilities = ARHOST_SINK_CAPABILITY_REALTIME | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SINK(WindowSink, descriptor)
