// SPDX-License-Identifier: Apache-2.0
#include "base/file_identity.hpp"
#include "base/program.hpp"
#include "base/temporary_folder.hpp"
#include "base/text.hpp"
#include "cli/commands.hpp"
#include "cli/read_configuration.hpp"
#include "cli/run_command.hpp"
#include "host/outcome.hpp"
#include "host/run.hpp"
#include "run_config/access.hpp"
#include "scene/capabilities.hpp"
#include "supervise/probe.hpp"

#include <algorithm>
#include <cstdio>
#include <fcntl.h>
#include <list>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::cli {

using namespace host;

namespace {

namespace fs = std::filesystem;

// Checks the plugins, fallbacks included, and their options. Returns the ray tracers. `logs_notes`: warns of options
// that are ignored; otherwise the run warns of them.
std::vector<model::PluginDescription> check_plugins(const run_config::Configuration &configuration,
                                                    supervise::Context &context, bool logs_notes) {
    const auto check_component = [&](const run_config::ComponentConfiguration &component, arhost_kind kind,
                                     bool is_started_by_run = true) {
        std::vector<model::PluginDescription> plugins;
        for (std::size_t i = 0; i < component.plugins.size(); ++i) {
            const supervise::ProbeResult result = probe(context, component.plugins[i], component.policy);
            if (const auto *reason = std::get_if<std::string>(&result))
                component.node.require(i == 0 ? "plugin" : "fallback").fail(*reason);
            plugins.push_back(std::get<model::PluginDescription>(result));
            std::vector<std::string> notes;
            run_config::options_for(plugins.back(), kind, component, i, notes);
            for (const std::string &note : notes)
                if (logs_notes || !is_started_by_run)
                    context.log(ARHOST_SEVERITY_WARNING, plugins.back().short_name(), note);
        }
        return plugins;
    };
    if (configuration.source)
        check_component(*configuration.source, ARHOST_KIND_SOURCE);
    for (const run_config::TrackerConfiguration &tracker : configuration.trackers)
        check_component(tracker, ARHOST_KIND_TRACKER);
    std::vector<model::PluginDescription> raytracers;
    for (const run_config::RaytracerConfiguration &raytracer : configuration.raytracers)
        std::ranges::move(check_component(raytracer, ARHOST_KIND_RAYTRACER), std::back_inserter(raytracers));
    for (const auto *output : {&configuration.snapshot, &configuration.record})
        if (*output)
            check_component(**output, ARHOST_KIND_SINK, false);
    std::vector<run_config::OutputFile> files = configuration.report_files();
    for (const run_config::ComponentConfiguration &output : configuration.outputs) {
        const model::PluginDescription plugin = check_component(output, ARHOST_KIND_SINK).back();
        if (const auto path = run_config::path_of(output.node))
            files.push_back({*path, (plugin.capabilities & ARHOST_SINK_CAPABILITY_NUMBERED_FILES) != 0});
    }
    run_config::expect_distinct(files);
    return raytracers;
}

// Loads the scene. Warns of parts that one of the ray tracers lacks, according to its descriptor.
void check_scene(const run_config::Configuration &configuration, supervise::Context &context,
                 const std::vector<model::PluginDescription> &raytracers) {
    std::optional<std::string> outcome;
    std::uint64_t needed = 0;
    const SceneLoading loading(
        context, configuration.raytracer->scene, configuration.raytracer->policy, configuration.raytracer->limits,
        configuration.files,
        {[&](const ipc::SharedMemory &arena, const std::vector<Anchor> &anchors, const auto &) {
             needed = scene::needed_capabilities(arena.map(ipc::Access::read_only).as<const arhost_scene>());
             outcome = problem_with(anchors, configuration.tracker ? &*configuration.tracker : nullptr);
         },
         [&](const std::string &reason, const auto &) { outcome = reason; }});
    while (!outcome)
        context.reactor.run_once();
    if (!outcome->empty())
        throw yaml::Error(*outcome);
    for (const model::PluginDescription &plugin : raytracers)
        if (const std::string text =
                scene::missing_capabilities_text(plugin.short_name(), needed & ~plugin.capabilities);
            !text.empty())
            context.log(ARHOST_SEVERITY_WARNING, "raytracer", text);
}

using Folders = std::vector<std::pair<std::string, std::string>>; // temporary folder, the output's own folder

// Lets the outputs write only to folders in `scratch`.
Folders redirect_outputs(run_config::Configuration &configuration, const fs::path &scratch) {
    Folders folders;
    for (std::size_t i = 0; i < configuration.outputs.size(); ++i) {
        run_config::ComponentConfiguration &output = configuration.outputs[i];
        const auto path = run_config::path_of(output.node);
        if (!path || run_config::is_standard_output(*path))
            continue;
        const fs::path folder = Outputs::check_folder(scratch, i), own = path->output_path().parent_path();
        fs::create_directory(folder);
        folders.emplace_back(folder, own);
        if (fs::is_fifo(path->output_path()))
            ::mkfifo((folder / path->output_path().filename()).c_str(), 0600); // on failure, the output reports it
        std::erase_if(output.policy.writable, [&](const fs::path &writable) {
            return writable == own || writable == base::real_path(path->output_path()).parent_path();
        });
        output.policy.writable.push_back(folder);
    }
    return folders;
}

// Reads and discards what an output writes to a FIFO, which nobody else can open.
struct Drain {
    base::UniqueFd reader;
    ipc::Reactor::Registration watch;
};

std::list<Drain> drain_fifos(const Folders &folders, ipc::Reactor &reactor) {
    std::list<Drain> drains;
    for (const auto &[folder, own] : folders)
        for (const fs::directory_entry &entry : fs::directory_iterator(folder)) {
            if (!entry.is_fifo())
                continue;
            Drain &drain = drains.emplace_back();
            drain.reader = base::UniqueFd(::open(entry.path().c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
            if (drain.reader)
                drain.watch = reactor.watch(drain.reader.get(), [&drain] {
                    char discarded[65536];
                    if (::read(drain.reader.get(), discarded, sizeof discarded) == 0) // the writer has closed it
                        drain.watch.cancel();
                });
        }
    return drains;
}

std::string with_own_folders(std::string text, const Folders &folders) {
    for (const auto &[temporary, own] : folders)
        for (std::size_t at = 0; (at = text.find(temporary, at)) != std::string::npos; at += own.size())
            text.replace(at, temporary.size(), own);
    return text;
}

// Returns whether an output writes frames to standard output.
bool writes_to_standard_output(const run_config::Configuration &configuration) {
    return std::ranges::any_of(configuration.outputs, [](const run_config::ComponentConfiguration &output) {
        const auto path = run_config::path_of(output.node);
        return path && run_config::is_standard_output(*path);
    });
}

// Starts all components once, without restarts, and prints what they report. The outputs may write only to a
// temporary folder; messages name the configured folders instead. Returns the exit status.
int check_by_opening(run_config::Configuration configuration, const Arguments &arguments, supervise::Context context,
                     std::FILE *report) {
    const base::TemporaryFolder scratch("arhost-check");
    for_each_component(configuration, [](run_config::ComponentConfiguration &component) {
        component.limits.restart.quarantine_after = 1;
    });
    const Folders folders = redirect_outputs(configuration, scratch.path());
    const std::list<Drain> drains = drain_fifos(folders, context.reactor);
    context.log = [&folders, log = context.log](arhost_severity severity, const std::string &component,
                                                const std::string &text) {
        log(severity, component, with_own_folders(text, folders));
    };
    Run::Options options;
    options.check_scratch = scratch.path();
    options.checks_frames = arguments.frames.has_value();
    Run run(configuration, context, options);
    if (!run.run()) {
        const std::string reason = with_own_folders(run.failures().text(), folders);
        if (run.failures().is_configuration_error())
            throw yaml::Error(reason);
        throw std::runtime_error(reason);
    }
    for (const std::string &line : run.findings())
        std::fprintf(report, "%s\n", base::printable(line).c_str());
    const auto problem = problem_with_run(configuration, run.statistics(), run.targets());
    if (problem)
        context.log(ARHOST_SEVERITY_ERROR, problem->component, problem->text);
    if (const std::string misfits = misfitting_targets(run.statistics(), run.targets()); !misfits.empty())
        context.log(ARHOST_SEVERITY_WARNING, "tracker", misfits);
    return problem ? base::failed : base::success;
}

} // namespace

int check(const Arguments &arguments, bool open, supervise::Starter &launcher) {
    if (!open && arguments.frames)
        throw yaml::Error("--run and --no-open exclude each other; remove one of them");
    Console console(arguments.verbose);
    const run_config::Configuration configuration = read_configuration(arguments);
    show_warnings(configuration, console);
    ipc::Reactor reactor;
    supervise::Context context = make_context(reactor, launcher, console);
    const std::vector<model::PluginDescription> raytracers = check_plugins(configuration, context, !open);
    std::FILE *const report = arguments.frames && writes_to_standard_output(configuration) ? stderr : stdout;
    if (open) {
        if (const int status = check_by_opening(configuration, arguments, context, report); status != base::success)
            return status;
    } else if (configuration.raytracer) {
        check_scene(configuration, context, raytracers);
    }
    std::fprintf(report, "%s: OK\n", base::printable(arguments.file).c_str());
    return base::success;
}

} // namespace arhost::cli
