// SPDX-License-Identifier: Apache-2.0
#include "cli/console.hpp"

#include "base/text.hpp"
#include "host/run.hpp"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/stdout_sinks.h>

#include <cstdlib>
#include <string_view>
#include <sys/ioctl.h>
#include <unistd.h>

namespace arhost::cli {
namespace {

constexpr std::size_t max_queued_lines = 1024;

template <class Sink>
std::shared_ptr<spdlog::logger> make_logger(const std::shared_ptr<spdlog::details::thread_pool> &thread) {
    return std::make_shared<spdlog::async_logger>("arhost", std::make_shared<Sink>(), thread,
                                                  spdlog::async_overflow_policy::overrun_oldest);
}

// The conventions of https://no-color.org and https://bixense.com/clicolors.
spdlog::color_mode color_mode() {
    const auto value_of = [](const char *name) -> std::string_view {
        const char *const value = std::getenv(name);
        return value ? value : "";
    };
    const std::string_view forced = value_of("CLICOLOR_FORCE");
    if (!value_of("NO_COLOR").empty())
        return spdlog::color_mode::never;
    if (!forced.empty() && forced != "0")
        return spdlog::color_mode::always;
    return value_of("CLICOLOR") == "0" ? spdlog::color_mode::never : spdlog::color_mode::automatic;
}

} // namespace

Console::Console(bool verbose)
    : terminal_(::isatty(STDERR_FILENO) != 0),
      thread_(std::make_shared<spdlog::details::thread_pool>(max_queued_lines, 1)),
      log_(make_logger<spdlog::sinks::stderr_color_sink_st>(thread_)),
      line_(make_logger<spdlog::sinks::stderr_sink_st>(thread_)) {
    log_->set_pattern("%^%l%$: %v");
    static_cast<spdlog::sinks::ansicolor_stderr_sink_st *>(log_->sinks().front().get())->set_color_mode(color_mode());
    log_->set_level(verbose ? spdlog::level::debug : spdlog::level::info);
    line_->set_formatter(
        std::make_unique<spdlog::pattern_formatter>("%v", spdlog::pattern_time_type::local, std::string()));
}

Console::~Console() {
    clear_line();
    if (const std::size_t lost = thread_->overrun_counter())
        log_->warn("{} lines were dropped because stderr was not read", lost);
    thread_.reset(); // flushes and joins the thread, which uses the loggers
}

void Console::clear_line() {
    if (line_shown_)
        line_->info("\r\033[K");
    line_shown_ = false;
}

void Console::log(arhost_severity severity, const std::string &component, const std::string &text) {
    const auto level = severity >= ARHOST_SEVERITY_ERROR     ? spdlog::level::err
                       : severity == ARHOST_SEVERITY_WARNING ? spdlog::level::warn
                       : severity >= ARHOST_SEVERITY_INFO    ? spdlog::level::info
                                                             : spdlog::level::debug;
    if (!log_->should_log(level))
        return;
    clear_line();
    const char *blame = severity == ARHOST_SEVERITY_PLUGIN_MISBEHAVING ? "the plugin misbehaves: "
                        : severity == ARHOST_SEVERITY_HOST_MISBEHAVING ? "the host misbehaves: "
                                                                       : "";
    log_->log(level, "{}: {}{}", component, blame, base::printable(text));
}

void Console::show(const host::Progress &progress, const host::Statistics &statistics) {
    const auto now = std::chrono::steady_clock::now();
    const auto interval = terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(5000);
    if (last_shown_ == std::chrono::steady_clock::time_point{})
        last_shown_ = now;
    if (now - last_shown_ < interval && !progress.finishing)
        return;
    const double seconds = std::chrono::duration<double>(now - last_shown_).count();
    const double fps = seconds > 0 ? static_cast<double>(progress.frame - last_frame_) / seconds : 0;
    const std::string total = progress.frame_count ? "/" + std::to_string(progress.frame_count) : "";
    std::string line = fmt::format("frame {}{}", progress.frame, total);
    if (progress.finishing)
        line += fmt::format("  {:.1f} fps  finishing the outputs", statistics.fps());
    else
        line += fmt::format("  {:.1f} fps", fps);
    line += "  " + (progress.finishing
                        ? host::percentiles_text(statistics.stages.all(), statistics.latencies.all())
                        : host::percentiles_text(statistics.stages.recent(), statistics.latencies.recent()));
    if (terminal_) {
        winsize size{};
        if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 && line.size() >= size.ws_col)
            line.resize(size.ws_col - 1u); // a line that wraps cannot be redrawn
        line_->info("\r\033[K{}", line);
        line_shown_ = true;
    } else {
        line_->info("{}\n", line);
    }
    last_shown_ = now;
    last_frame_ = progress.frame;
}

} // namespace arhost::cli
