// SPDX-License-Identifier: Apache-2.0
#include "cli/run_command.hpp"

#include "base/atomic_file.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "cli/output_locks.hpp"
#include "cli/read_configuration.hpp"
#include "host/outcome.hpp"
#include "host/run.hpp"

#include <nlohmann/json.hpp>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <set>
#include <sys/resource.h>
#include <sys/signalfd.h>

namespace arhost::cli {

using namespace host;

namespace {

double cpu_seconds_of_host() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return supervise::cpu_seconds(usage);
}

// The files of the statistics and of the timeline. Must be opened before workers run, because a worker could create a
// link or a pipe with the file's name.
class Reports {
public:
    explicit Reports(const run_config::Configuration &configuration)
        : stats_(open(configuration.stats)), timeline_(open(configuration.timeline)) {}

    // Writes the configured files. Returns false if one cannot be written.
    bool write(const run_config::Configuration &configuration, const Statistics &statistics,
               const ComponentTotals &components, Console &console) {
        if (statistics.frames_in == 0)
            return true;
        bool written = true;
        if (configuration.stats)
            written = write(stats_, "stats", console,
                            report(statistics, components, cpu_seconds_of_host())
                                    .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
                                "\n");
        if (configuration.timeline)
            written &= write(timeline_, "timeline", console, timeline_csv(statistics));
        return written;
    }

private:
    static base::AtomicFile open(const std::optional<std::filesystem::path> &file) {
        std::error_code ignored; // AtomicFile reports the error
        if (file)
            std::filesystem::create_directories(file->parent_path(), ignored);
        return base::AtomicFile(file.value_or(""));
    }
    static bool write(base::AtomicFile &file, const char *key, Console &console, const std::string &text) {
        try {
            file.write(text);
            return true;
        } catch (const std::runtime_error &error) {
            console.log(ARHOST_SEVERITY_ERROR, key, error.what());
            return false;
        }
    }

    base::AtomicFile stats_, timeline_;
};

// The folders that a run creates.
class NewFolders {
public:
    explicit NewFolders(const run_config::Configuration &configuration) {
        run_config::for_each_component(configuration, [this](const run_config::ComponentConfiguration &component) {
            std::ranges::for_each(component.policy.writable, [this](const auto &folder) { add(folder); });
        });
        for (const auto &file : {configuration.stats, configuration.timeline})
            if (file)
                add(file->parent_path());
    }
    ~NewFolders() {
        if (!removes_empty_)
            return;
        std::error_code not_empty;
        std::for_each(missing_.rbegin(), missing_.rend(),
                      [&](const std::filesystem::path &folder) { std::filesystem::remove(folder, not_empty); });
    }
    NewFolders(const NewFolders &) = delete;
    NewFolders &operator=(const NewFolders &) = delete;
    void remove_empty() { removes_empty_ = true; } // in the destructor, when there are no temporary files any more

private:
    void add(std::filesystem::path folder) {
        std::error_code ignored;
        for (; folder.has_relative_path() && !std::filesystem::exists(folder, ignored); folder = folder.parent_path())
            missing_.insert(folder);
    }

    bool removes_empty_ = false;
    std::set<std::filesystem::path> missing_; // parents come before their subfolders
};

// The signals that end a run. A descriptor receives them instead of the process.
class EndingSignals {
public:
    EndingSignals() {
        ::sigemptyset(&signals_);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP})
            ::sigaddset(&signals_, signal);
        ::sigprocmask(SIG_BLOCK, &signals_, nullptr);
        fd_ = base::checked(::signalfd(-1, &signals_, SFD_CLOEXEC | SFD_NONBLOCK), "signalfd");
    }

    // Calls `interrupt` at each signal, except within a second of the first one: timeout(1) sends two signals.
    ipc::Reactor::Registration watch(ipc::Reactor &reactor, Console &console,
                                     const std::function<void()> &interrupt) {
        return reactor.watch(fd_.get(), [this, &console, interrupt] {
            while (base::take_signal(fd_.get()) > 0) {
                const auto now = std::chrono::steady_clock::now();
                if (first_ && now - *first_ < std::chrono::seconds(1))
                    continue;
                if (!first_) {
                    first_ = now;
                    console.log(ARHOST_SEVERITY_INFO, "arhost",
                                "stopping after the current frames and files are finished; a second signal ends "
                                "the run at once");
                }
                interrupt();
            }
        });
    }
    bool arrived() const { return first_.has_value(); }

    // After this call, signals end the process immediately.
    void release() {
        while (base::take_signal(fd_.get()) > 0) {
        }
        ::sigprocmask(SIG_UNBLOCK, &signals_, nullptr);
    }

private:
    sigset_t signals_{};
    base::UniqueFd fd_;
    std::optional<std::chrono::steady_clock::time_point> first_;
};

void log_contract_checks(const contracts::ContractChecks &checks, Console &console) {
    std::size_t passed = 0;
    for (const auto &[name, check] : checks.all()) {
        passed += check.violations == 0;
        if (check.violations > 0)
            console.log(ARHOST_SEVERITY_WARNING, "conform",
                        name + ": contract violated in " + std::to_string(check.violations) + " of " +
                            base::count_of(check.checked, "frame"));
    }
    if (!checks.all().empty())
        console.log(ARHOST_SEVERITY_INFO, "conform",
                    std::to_string(passed) + " of " + std::to_string(checks.all().size()) +
                        " contract checks passed");
}

// Logs the counters of the plugins: "lost_by_driver 3, superseded 12".
void log_counters(const ComponentTotals &totals, Console &console) {
    for (const auto &[component, counters] : totals.counters) {
        std::vector<std::string> texts;
        for (const auto &[name, value] : counters)
            if (value > 0)
                texts.push_back(fmt::format("{} {}", name, value));
        if (!texts.empty())
            console.log(ARHOST_SEVERITY_INFO, component, fmt::format("counted: {}", fmt::join(texts, ", ")));
    }
}

void log_latencies(const run_config::Configuration &configuration, const Statistics &statistics, Console &console) {
    if (configuration.mode == run_config::Mode::live && statistics.composited > 0)
        console.log(ARHOST_SEVERITY_INFO, "arhost",
                    fmt::format("{}, {:.1f} fps, latency from {}, {}", base::count_of(statistics.composited, "frame"),
                                statistics.fps(), statistics.latency_from_capture ? "capture" : "arrival",
                                percentiles_text(statistics.stages.all(), statistics.latencies.all())));
    if (const auto &stages = statistics.stages.all(); stages.contains("glass_to_glass")) {
        const Timing &timing = stages.at("glass_to_glass");
        std::printf("glass to glass: p50 %.1f ms, p95 %.1f ms, p99 %.1f ms, maximum %.1f ms, in %llu measurements\n",
                    timing.percentile_ms(0.50), timing.percentile_ms(0.95), timing.percentile_ms(0.99),
                    timing.max_ms(), static_cast<unsigned long long>(timing.count()));
    }
}

// Logs problems with the results of a run that `completed` or was `stopped` by a signal. Returns false if the run
// must not count as a success.
bool log_problems(const run_config::Configuration &configuration, const Arguments &arguments,
                  const Statistics &statistics, const std::vector<model::Target> &targets, bool completed,
                  bool stopped, Console &console) {
    const auto problem = completed ? problem_with_run(configuration, statistics, targets) : std::nullopt;
    const bool lacks_target = problem && problem->is_missing_target;
    const bool is_accepted = lacks_target && arguments.allow_no_target;
    if (problem)
        console.log(is_accepted || stopped ? ARHOST_SEVERITY_WARNING : ARHOST_SEVERITY_ERROR, problem->component,
                    problem->text + (lacks_target ? " (--allow-no-target accepts this)" : ""));
    if (const std::string unseen = unseen_targets(configuration, statistics, targets);
        completed && !unseen.empty() && !lacks_target)
        console.log(ARHOST_SEVERITY_WARNING, "tracker", unseen);
    if (const std::string misfits = misfitting_targets(statistics, targets); !misfits.empty())
        console.log(ARHOST_SEVERITY_WARNING, "tracker", misfits);
    return !problem || is_accepted;
}

} // namespace

supervise::Context make_context(ipc::Reactor &reactor, supervise::Starter &launcher, Console &console) {
    return {reactor, launcher, base::own_folder() / "arhost-worker",
            [&console](arhost_severity severity, const std::string &component, const std::string &text) {
                console.log(severity, component, text);
            }};
}

void show_warnings(const run_config::Configuration &configuration, Console &console) {
    for (const std::string &warning : configuration.warnings)
        console.log(ARHOST_SEVERITY_WARNING, "arhost", warning);
    if (configuration.trajectory && !configuration.trajectory->warning.empty())
        console.log(ARHOST_SEVERITY_WARNING, "trajectory", configuration.trajectory->warning);
}

int run(const run_config::Configuration &configuration, const Arguments &arguments, supervise::Starter &launcher) {
    const OutputLocks locks(configuration);
    NewFolders new_folders(configuration);
    EndingSignals signals; // before the console's thread starts, because that thread must not receive these signals
    Reports reports(configuration);
    Console console(arguments.verbose);
    show_warnings(configuration, console);
    ipc::Reactor reactor;
    Run *running = nullptr;
    Run::Options options;
    options.on_progress = [&](const Progress &progress) { console.show(progress, running->statistics()); };
    if (arguments.watch)
        options.read_configuration = [&arguments] { return read_configuration(arguments); };
    Run run(configuration, make_context(reactor, launcher, console), options);
    running = &run;
    const auto watch = signals.watch(reactor, console, [&] { run.interrupt(); });

    const bool completed = run.run();
    if (!completed && !run.failures().was_logged())
        console.log(ARHOST_SEVERITY_ERROR, "arhost", run.failures().text());
    const Statistics &statistics = run.statistics();
    const bool is_good =
        log_problems(configuration, arguments, statistics, run.targets(), completed, signals.arrived(), console);
    log_latencies(configuration, statistics, console);
    const ComponentTotals totals = run.component_totals();
    log_counters(totals, console);
    log_contract_checks(statistics.contract_checks, console);
    const bool written = reports.write(configuration, statistics, totals, console);
    signals.release(); // a stopped terminal may block the last log lines
    if (!written)
        return base::failed;
    if (!completed && run.failures().is_configuration_error()) {
        new_folders.remove_empty();
        return base::invalid_input;
    }
    if (!completed)
        return base::failed;
    if (signals.arrived())
        return base::interrupted;
    return is_good ? base::success : base::failed;
}

int run(const Arguments &arguments, supervise::Starter &launcher) {
    return run(read_configuration(arguments), arguments, launcher);
}

} // namespace arhost::cli
