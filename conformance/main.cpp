// SPDX-License-Identifier: Apache-2.0
//
// arhost-conform: tests whether a plugin meets the requirements of the ABI (docs/conformance.md).
#include "base/atomic_file.hpp"
#include "base/file_identity.hpp"
#include "base/listening_socket.hpp"
#include "base/program.hpp"
#include "base/temporary_folder.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "command_line/command_line.hpp"
#include "conformance/report.hpp"
#include "run_config/plugin_path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <fnmatch.h>
#include <poll.h>
#include <set>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <thread>

namespace {

using namespace arhost::conformance;
namespace base = arhost::base;
namespace sandbox = arhost::sandbox;
namespace fs = std::filesystem;

enum ExitStatus { usage_or_suite_failed = 2 };

template <class Number> bool parse_number(std::string_view text, Number &number) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size();
}

// Validators for arhost::command_line::Option::check: return an error message, or "".
std::string invalid_name(const std::string &text) {
    return text.empty() ? "the name is empty" : "";
}
std::string invalid_variable(const std::string &text) {
    return sandbox::is_variable_name(text)
               ? ""
               : "'" + text +
                     "' is not a variable name; give only the name, the value is that of arhost's environment";
}
std::string invalid_seed(const std::string &text) {
    std::uint64_t seed = 0;
    return parse_number(text, seed) ? "" : fmt::format("'{}' must be a whole number from 0 to {}", text, UINT64_MAX);
}
std::string invalid_timeout_factor(const std::string &text) {
    double factor = 0;
    const bool fits = parse_number(text, factor) && factor >= 0.001 && factor <= 1000; // no NaN
    return fits ? "" : "'" + text + "' must be a number from 0.001 to 1000";
}

Settings parse_settings(const std::vector<std::string> &texts) {
    Settings settings;
    for (const std::string &text : texts) {
        const std::size_t equals = text.find('=');
        if (equals == 0 || equals == std::string::npos)
            throw std::runtime_error("--set " + text + ": must be key=value, an option of the plugin");
        settings[text.substr(0, equals)] = text.substr(equals + 1);
    }
    return settings;
}

PrintFiles parse_prints(const std::vector<std::string> &texts) {
    PrintFiles prints;
    for (const std::string &text : texts) {
        const std::size_t equals = text.find('=');
        int id = 0;
        if (equals == std::string::npos || !parse_number(text.substr(0, equals), id) || equals + 1 == text.size())
            throw std::runtime_error("--print " + text + ": must be ID=FILE: a marker's id and its picture");
        prints[id] = fs::absolute(text.substr(equals + 1));
    }
    return prints;
}

// Returns the file of a plugin given as a path or as a name, which is searched for as in a configuration.
fs::path find_plugin(const std::string &text) {
    std::error_code ignored;
    if (fs::is_regular_file(text, ignored))
        return fs::absolute(text);
    if (text.find('/') != std::string::npos || text.ends_with(".so") || text.ends_with(".py"))
        throw std::runtime_error("there is no plugin '" + text + "'");
    return arhost::run_config::PluginPath({}, default_reference().parent_path()).find(text);
}

// Options with the names and meanings of the configuration's keys.
struct PolicyOptions {
    std::vector<std::string> allow, reads, environment;
    std::string sandbox{sandbox::modes.front()};

    void add_to(arhost::command_line::CommandLine &app) {
        const auto add = [&](const char *name, std::vector<std::string> &values, const char *help) {
            return app.option(name, values, help).one_value_each();
        };
        const std::vector<std::string> known(sandbox::allowances.begin(), sandbox::allowances.end());
        add("--allow", allow, "Allow the plugin a resource, like 'allow' in the configuration (repeatable)")
            .type_name("RESOURCE")
            .separator(',')
            .one_of(known);
        add("--reads", reads, "Allow the plugin to read a file or folder (repeatable)")
            .type_name("PATH")
            .existing_path()
            .check(sandbox::obstacle_to_grant);
        add("--environment", environment, "Pass an environment variable to the plugin (repeatable)")
            .type_name("NAME")
            .check(invalid_variable);
        // Not strict, because only arhost-launcher creates PID namespaces.
        app.option("--sandbox", sandbox, "Sandbox mode: standard, permissive or none")
            .type_name("MODE")
            .one_of({"standard", "permissive", "none"});
    }
    std::vector<std::string> texts() const {
        std::vector<std::string> all;
        for (const auto &[option, values] :
             {std::pair{"--allow", &allow}, {"--reads", &reads}, {"--environment", &environment}})
            for (const std::string &value : *values)
                all.insert(all.end(), {option, value});
        if (sandbox != sandbox::modes.front())
            all.insert(all.end(), {"--sandbox", sandbox});
        return all;
    }
    // Grants read access to files named by the suite's options and by the plugin's options.
    sandbox::Policy policy(const Subject &subject) const {
        sandbox::Policy policy;
        policy.mode = sandbox::mode_of(sandbox);
        policy.allow.insert(allow.begin(), allow.end());
        policy.environment.insert(environment.begin(), environment.end());
        for (const std::string &path : reads)
            policy.readable.push_back(fs::absolute(path));
        policy.readable.push_back(subject.reference.parent_path());
        for (const auto &[id, file] : subject.prints)
            policy.readable.push_back(file);
        for (const auto &[key, value] : subject.settings)
            if (key == "path" && !value.empty())
                sandbox::allow_read_files(policy, fs::absolute(value));
            else if (!value.empty())
                sandbox::allow_read(policy, fs::absolute(value));
        return policy;
    }
};

bool matches(const std::vector<std::string> &patterns, const char *test) {
    return std::any_of(patterns.begin(), patterns.end(),
                       [&](const std::string &pattern) { return ::fnmatch(pattern.c_str(), test, 0) == 0; });
}

std::string list(const std::vector<std::string> &patterns) {
    std::string text;
    for (const Test &test : all_tests())
        if (matches(patterns, test.name))
            text += fmt::format("{:<34} {}\n", test.name, test.requirement);
    return text;
}

// Describes a need of the plugin that the policy does not allow, so that the host would create no instance. Empty if
// all are allowed.
std::string missing_need(const Result &loaded, const sandbox::Policy &policy) {
    if (policy.mode != sandbox::Mode::none && loaded.facts)
        for (const std::string &need : loaded.facts->descriptor.needs)
            if (!policy.allows(need))
                return fmt::format("it needs '{0}', which the sandbox does not allow: give --allow {0}", need);
    return {};
}

bool creates_instances(std::span<const Test> tests, std::string_view name) {
    if (name == "abi.create")
        return true;
    const auto test = std::find_if(tests.begin(), tests.end(), [&](const Test &t) { return name == t.name; });
    return test != tests.end() && creates_instances(tests, test->needs);
}

// Describes why the reference cannot be used (an error of the suite, not of the plugin); empty if it can.
std::string reference_problem(std::span<const Test> tests, const RunSettings &settings) {
    const fs::path &file = settings.subject.reference;
    if (!fs::is_regular_file(file))
        return fmt::format("the reference '{}' does not exist; give --reference FILE", file.string());
    RunSettings reference_settings = settings;
    reference_settings.subject.plugin = file;
    reference_settings.subject.settings.clear();
    reference_settings.subject.addresses.clear();
    for (const Test &test : tests)
        if (test.name == std::string_view("abi.load") || test.name == std::string_view("raytracer.render")) {
            const Result result = run_alone(test, reference_settings);
            if (result.verdict != Verdict::pass)
                return fmt::format("the reference '{}' cannot be used: {} failed: {}", file.string(), test.name,
                                   result.message);
            if (const arhost_kind kind = result.facts ? result.facts->descriptor.kind : ARHOST_KIND_RAYTRACER;
                kind != ARHOST_KIND_RAYTRACER)
                return fmt::format("the reference '{}' is a {} but must be a ray tracer; give --reference FILE",
                                   file.string(), arhost::model::to_text(kind));
        }
    return {};
}

// Returns the family of the markers to test a tracker with: the first one that it knows. Empty if it only reports the
// poses of bodies.
std::string family_of(std::span<const Test> tests, RunSettings settings,
                      const arhost::model::PluginDescription &plugin) {
    const auto start = std::ranges::find(tests, std::string_view("tracker.start"), &Test::name);
    for (const char *family : drawn_families) {
        settings.subject.family = family;
        if (run_alone(*start, settings).verdict != Verdict::fail)
            return family;
    }
    return plugin.capabilities & ARHOST_TRACKER_CAPABILITY_REPORTS_POSES ? ""
                                                                         : drawn_families.front(); // tests report why
}

// The plugins that run a class of a Python script, and the kinds of `arhost new-plugin`.
struct Adapter {
    const char *plugin, *kind;
};
constexpr Adapter adapters[] = {
    {"source_python", "source"}, {"tracker_python", "tracker"}, {"rt_python", "raytracer"}, {"sink_python", "sink"}};
// The tests that a new tracker fails because it lacks a detector (sdk/templates/tracker/ABOUT.md).
constexpr std::string_view detector_tests[] = {
    "tracker.unknown-id", "tracker.unknown-family", "tracker.unusable-lens", "tracker.corner-order",
    "tracker.mirrored",   "tracker.no-marker",      "tracker.sizes"};

// Returns a script for an adapter that has none: a new plugin of its kind, which this function creates in `folder`.
Settings default_script(const Subject &subject, const fs::path &folder) {
    const auto adapter = std::ranges::find(adapters, subject.plugin.stem().string(), &Adapter::plugin);
    if (adapter == std::end(adapters) || subject.settings.contains("script"))
        return {};
    const std::string program = base::own_folder() / "arhost-new-plugin";
    const char *const arguments[] = {program.c_str(), adapter->kind, "new_plugin",   "--language",
                                     "python",        "--into",      folder.c_str(), nullptr};
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    pid_t child = -1;
    int status = -1;
    const int error =
        ::posix_spawn(&child, program.c_str(), &actions, nullptr, const_cast<char *const *>(arguments), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error != 0 || ::waitpid(child, &status, 0) != child || status != 0)
        throw std::runtime_error(fmt::format("{} has created no plugin to test {} with; give --set script=FILE",
                                             program, adapter->plugin));
    return {{"script", folder / "new_plugin/new_plugin.py"}};
}

// Returns a value for a path that has neither a value nor a default that the plugin accepts: the first that it does.
// Inputs are pictures, which this function writes to `folder`. Each test has its own folder for outputs.
Settings default_paths(std::span<const Test> tests, RunSettings settings,
                       const arhost::model::PluginDescription &plugin, const fs::path &folder) {
    constexpr int picture_count = 12;
    const bool is_source = plugin.kind == ARHOST_KIND_SOURCE;
    const auto start =
        std::ranges::find(tests, std::string_view(is_source ? "source.start" : "sink.start"), &Test::name);
    std::vector<std::string> values;
    if (is_source) {
        for (int i = 0; i < picture_count; ++i)
            write_picture(picture_of(i), folder / fmt::format("{:02}.png", i));
        values = {folder / "%02d.png", folder / "00.png"};
    } else if (plugin.kind == ARHOST_KIND_SINK) {
        values = {"out", "out.mp4", "out.jsonl", standard_output};
        if (plugin.capabilities & ARHOST_SINK_CAPABILITY_NUMBERED_FILES)
            values.insert(values.begin(), "%03d.png");
    }
    const arhost_option_type type = is_source ? ARHOST_OPTION_INPUT_PATH : ARHOST_OPTION_OUTPUT_PATH;
    const auto is_accepted = [&] {
        const Verdict verdict = run_alone(*start, settings).verdict;
        return verdict == Verdict::pass || verdict == Verdict::skip;
    };
    for (const arhost::model::OptionDeclaration &option : plugin.options) {
        if (option.type != type || settings.subject.settings.contains(option.key) ||
            !option.default_value.value_or("").empty() || (option.default_value && is_accepted()))
            continue;
        for (const std::string &value : values) {
            settings.subject.settings[option.key] = value;
            if (is_accepted())
                return {{option.key, value}};
        }
    }
    return {}; // tests report that the option has no value, or why it is rejected
}

// Returns the values of the options of type ARHOST_OPTION_LISTEN: as set, else their defaults. Skips invalid
// addresses, which tests report.
Settings addresses_of(const arhost::model::PluginDescription &plugin, const Settings &settings) {
    Settings addresses;
    for (const arhost::model::OptionDeclaration &option : plugin.options) {
        const auto set = settings.find(option.key);
        const std::string address = set != settings.end() ? set->second : option.default_value.value_or("");
        if (option.type == ARHOST_OPTION_LISTEN && base::problem_with_address(address).empty())
            addresses[option.key] = address;
    }
    if (addresses.size() > max_sockets)
        throw std::runtime_error(
            fmt::format("the plugin has {} sockets, but the suite supports only {}", addresses.size(), max_sockets));
    return addresses;
}

// Returns the plugin that runs the class of the Python script in the option `script`: the only one that finds a class
// of its kind in it.
fs::path adapter_of(const RunSettings &settings) {
    const std::vector<Test> tests = all_tests();
    const auto create = std::ranges::find(tests, std::string_view("abi.create"), &Test::name);
    const std::string script = settings.subject.settings.at("script");
    std::vector<std::string> found;
    std::set<std::string> reasons;
    RunSettings candidate = settings;
    for (const Adapter &adapter : adapters) {
        candidate.subject.plugin = find_plugin(adapter.plugin);
        const Result result = run_alone(*create, candidate);
        if (result.verdict == Verdict::pass)
            found.emplace_back(adapter.plugin);
        else
            reasons.insert(result.message);
    }
    if (found.empty())
        throw std::runtime_error(
            fmt::format("'{}' cannot be used as a plugin: {}", script, fmt::join(reasons, "; ")));
    if (found.size() > 1)
        throw std::runtime_error(fmt::format("'{0}' contains several plugins; name one: arhost conform {1} --set "
                                             "script={0}",
                                             script, fmt::join(found, "|")));
    return find_plugin(found.front());
}

// Writes to stdout without buffering. A write error ends the run.
void print(const std::string &text, int signals = -1) {
    try {
        base::write_all(STDOUT_FILENO, text, signals);
    } catch (const std::system_error &error) {
        throw std::runtime_error("cannot write to standard output: " + error.code().message());
    }
}

Report run(RunSettings settings, const std::vector<std::string> &patterns, bool quiet) {
    Report report{settings, all_tests(), {}, {}};
    const auto is_selected = [&](const char *test) { return matches(patterns, test); };
    const auto is_fine = [](const Result &result) {
        return result.verdict == Verdict::pass || result.verdict == Verdict::skip;
    };
    const auto print_result = [&](const Result &result) {
        if (!is_fine(result) || (is_selected(result.test.c_str()) && !quiet))
            print(as_line(report, result), settings.signals);
    };
    const auto set_result = [&](const Test &test, Verdict verdict, const std::string &why) {
        report.results.push_back({test.name, verdict, why});
        print_result(report.results.back());
    };
    // Always first: abi.load reports the plugin's kind.
    run_all({report.tests.data(), 1}, settings, report.results, print_result);
    report.plugin = report.results.front().facts;
    if (report.plugin)
        settings.subject.addresses = addresses_of(report.plugin->descriptor, settings.subject.settings);
    const arhost_kind kind = report.plugin ? report.plugin->descriptor.kind : 0;
    std::vector<Test> selected;
    std::set<std::string_view> needed;
    std::for_each(report.tests.rbegin(), report.tests.rend(), [&](const Test &test) {
        if ((is_selected(test.name) && (test.kind() == 0 || test.kind() == kind)) || needed.contains(test.name)) {
            selected.insert(selected.begin(), test);
            needed.insert(test.needs);
        }
    });
    const std::string missing = missing_need(report.results.front(), settings.subject.policy);
    const base::TemporaryFolder inputs("arhost-conform-inputs");
    bool is_new_script = false;
    if (missing.empty() && report.plugin &&
        std::ranges::any_of(selected, [&](const Test &test) { return creates_instances(report.tests, test.name); })) {
        Settings script = default_script(settings.subject, inputs.path());
        is_new_script = !script.empty();
        settings.subject.settings.merge(script);
        settings.subject.settings.merge(
            default_paths(report.tests, settings, report.plugin->descriptor, inputs.path()));
    }
    const auto is_of_tracker = [](const Test &test) { return test.kind() == ARHOST_KIND_TRACKER; };
    if (settings.subject.family.empty() && missing.empty() && std::ranges::any_of(selected, is_of_tracker))
        settings.subject.family = family_of(report.tests, settings, report.plugin->descriptor);
    for (const Test &test : selected)
        if (!missing.empty() && creates_instances(report.tests, test.name))
            set_result(test, Verdict::skip, missing);
        else if (is_new_script && std::ranges::count(detector_tests, test.name))
            set_result(test, Verdict::skip, "the new plugin has no detector; give --set script=FILE");
        else if (test.name == std::string_view("raytracer.reference"))
            if (const std::string problem = reference_problem(report.tests, settings); !problem.empty())
                set_result(test, Verdict::error, problem);
    run_all(selected, settings, report.results, print_result);
    // Prerequisites that were not selected are reported only if they fail.
    std::erase_if(report.results,
                  [&](const Result &result) { return is_fine(result) && !is_selected(result.test.c_str()); });
    std::sort(report.results.begin(), report.results.end(),
              [&](const Result &a, const Result &b) { return &report.test_of(a) < &report.test_of(b); });
    return report;
}

// With too few file descriptors, correct plugins would fail tests.
void expect_descriptors(unsigned jobs) {
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    const rlim_t needed = 64 + (4 + max_sockets) * jobs;
    if (limit.rlim_cur < needed && limit.rlim_max >= needed) {
        limit.rlim_cur = needed;
        ::setrlimit(RLIMIT_NOFILE, &limit);
    }
    if (limit.rlim_cur < needed)
        throw std::runtime_error(
            fmt::format("the limit of open files is {}, but {} are needed; raise it: ulimit -n {}", limit.rlim_cur,
                        needed, needed));
}

// Plugins get paths as UTF-8: those of their options and of the scratch folder.
void expect_utf8(const std::vector<std::string> &settings) {
    std::error_code none; // reported when a scratch folder is created
    std::vector<std::string> texts = settings;
    texts.push_back(fs::temp_directory_path(none));
    for (const std::string &text : texts)
        if (!base::is_utf8(text))
            throw std::runtime_error("'" + text + "' is not UTF-8, but text passed to plugins must be: rename it");
}

// Reports must not replace files that the run reads, nor each other. Pipes and devices are exempt.
void check_report_files(const std::vector<std::string> &reports, const Subject &subject) {
    using base::identity_of;
    std::set<std::string> read, written; // paths and inodes: a file may have several names
    const auto add = [](std::set<std::string> &files, const fs::path &file) {
        const auto [path, node] = identity_of(file);
        files.insert({path, node});
    };
    add(read, subject.plugin);
    add(read, subject.reference);
    for (const auto &[id, file] : subject.prints)
        add(read, file);
    for (const fs::path &path : subject.policy.readable)
        add(read, path);
    for (const std::string &report : reports) {
        std::error_code ignored;
        const fs::file_status status = fs::status(report, ignored);
        if (report.empty() || (fs::exists(status) && !fs::is_regular_file(status)))
            continue;
        const auto [path, node] = identity_of(report);
        if (read.contains(path) || read.contains(node))
            throw std::runtime_error("cannot write " + report + ": this run reads that file; choose another");
        if (written.contains(path) || written.contains(node))
            throw std::runtime_error("cannot write " + report + ": another report is written there");
        add(written, report);
    }
}

// Prints the last line. If this blocks because nobody reads standard error, a further signal ends the program.
void print_last_line(const std::string &line, int signals) noexcept {
    try {
        base::write_all(STDERR_FILENO, line + "\n", signals);
    } catch (const std::exception &) { // cannot be reported
    }
}
bool is_writable(int fd) {
    pollfd ready{fd, POLLOUT, 0};
    return ::poll(&ready, 1, 0) > 0;
}

} // namespace

int main(int argc, char **argv) {
    std::signal(SIGPIPE, SIG_IGN); // as in arhost-worker: a closed pipe or a full disk is an error, not a signal
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGCHLD, SIG_DFL); // if the parent process ignores it, waitpid fails
    arhost::command_line::CommandLine app(
        "Tests whether a plugin meets the requirements of arhost's ABI (docs/conformance.md).\n"
        "Exit status: 0 success; 1 a test failed, crashed or timed out; 2 the suite itself failed;\n"
        "128 plus a signal's number: interrupted.",
        "arhost conform");
    RunSettings settings;
    std::vector<std::string> option_texts, print_texts, socket_texts, patterns = {"*"};
    std::string plugin, json, junit, html, child_test;
    std::string reference = default_reference();
    bool only_list = false, quiet = false;
    settings.jobs = std::max(1u, std::thread::hardware_concurrency() / 2);
    app.option("PLUGIN", plugin,
               "The plugin: a shared object, a Python script, or a name that 'arhost plugins' lists");
    app.flag("--list", only_list, "Print the tests' names and requirements");
    app.option("--only", patterns, "Run only tests whose name matches, such as 'raytracer.*' (repeatable)")
        .type_name("PATTERN")
        .separator(',')
        .one_value_each();
    app.option("--set", option_texts, "Set an option of the plugin (repeatable)")
        .type_name("KEY=VALUE")
        .one_value_each();
    app.option("--family", settings.subject.family,
               fmt::format("Family or dictionary of the markers (the first that the tracker knows of {})",
                           fmt::join(drawn_families, ", ")))
        .type_name("NAME");
    app.option("--print", print_texts, "Draw marker ID from this PNG (repeatable)")
        .type_name("ID=FILE")
        .one_value_each();
    app.option("--body", settings.subject.body, "A body that a tracker knows which reports poses").type_name("NAME");
    PolicyOptions policy_options;
    policy_options.add_to(app);
    app.option("--seed", settings.subject.seed, "Random seed (1)").type_name("N").check(invalid_seed);
    app.option("--jobs", settings.jobs, "Number of tests that run in parallel").type_name("N").range(1, 256);
    app.option("--timeout-factor", settings.subject.timeout_factor, "Multiply each deadline, for slow machines (1)")
        .type_name("FACTOR")
        .check(invalid_timeout_factor);
    app.option("--reference", reference, "Compare images with this ray tracer").type_name("FILE").check(invalid_name);
    app.flag("-q,--quiet", quiet, "Do not print passed and skipped tests");
    const auto add_file = [&](const char *name, std::string &file, const char *help) {
        app.option(name, file, help).type_name("FILE").check(invalid_name);
    };
    add_file("--json", json, "Write the results as JSON");
    add_file("--junit", junit, "Write the results as JUnit XML");
    add_file("--html", html, "Write the results as an HTML page with images");
    app.option("--run", child_test, "").hidden(); // internal: run that test in this process
    app.option("--scratch", settings.subject.scratch, "").hidden();
    app.option("--socket", socket_texts, "").one_value_each().hidden();
    if (const auto status = app.parse(argc, argv))
        return base::flush_stdout() ? *status : usage_or_suite_failed;
    base::UniqueFd signals;
    try {
        if (only_list) {
            print(list(patterns));
            return 0;
        }
        if (plugin.empty())
            throw std::runtime_error("the plugin is missing: arhost conform PLUGIN");
        settings.subject.plugin = find_plugin(plugin);
        settings.subject.reference = fs::absolute(reference);
        const bool is_script = settings.subject.plugin.extension() == ".py";
        if (is_script)
            option_texts.push_back("script=" + settings.subject.plugin.string());
        settings.subject.settings = parse_settings(option_texts);
        settings.subject.prints = parse_prints(print_texts);
        if (const std::string &family = settings.subject.family;
            !family.empty() && settings.subject.prints.empty() && !std::ranges::count(drawn_families, family))
            throw std::runtime_error(
                fmt::format("--family {}: the suite draws only {}; give pictures of the markers: "
                            "--print ID=FILE",
                            family, fmt::join(drawn_families, ", ")));
        settings.subject.policy = policy_options.policy(settings.subject);
        settings.subject.policy_options = policy_options.texts();
        settings.subject.sockets = passed_sockets(socket_texts);
        if (!child_test.empty())
            return run_child(child_test, settings.subject);
        expect_utf8(option_texts);
        expect_descriptors(settings.jobs);
        check_report_files({json, junit, html}, settings.subject);
        signals = base::watch_signals(); // not in the process of a test, which signals shall terminate
        settings.signals = signals.get();
        if (is_script)
            settings.subject.plugin = adapter_of(settings);
        base::AtomicFile json_file(json, settings.signals), junit_file(junit, settings.signals),
            html_file(html, settings.signals);
        const Report report = run(settings, patterns, quiet);
        print(as_summary(report), settings.signals);
        if (report.results.empty())
            throw std::runtime_error(
                fmt::format("--only {}: no test for this kind of plugin matches", fmt::join(patterns, ",")));
        json_file.write(as_json(report));
        junit_file.write(as_junit(report));
        html_file.write(as_html(report));
        return report.exit_status();
    } catch (const base::Interrupted &interrupted) {
        if (is_writable(STDERR_FILENO))
            print_last_line(interrupted.what(), settings.signals);
        return 128 + interrupted.signal;
    } catch (const std::exception &error) {
        print_last_line("error: " + base::printable(error.what()), settings.signals);
        return usage_or_suite_failed;
    }
}
