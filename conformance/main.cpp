// SPDX-License-Identifier: Apache-2.0
//
// arhost-conform: tries whether a plugin keeps the ABI's promises (docs/conformance.md).
#include "base/atomic_file.hpp"
#include "base/command_line.hpp"
#include "base/file_identity.hpp"
#include "base/text.hpp"
#include "conformance/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fnmatch.h>
#include <poll.h>
#include <set>
#include <sys/resource.h>
#include <sys/signalfd.h>
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

// For base::Option::check: what is wrong with a text, or "".
std::string wrong_with_name(const std::string &text) {
    return text.empty() ? "the name is empty" : "";
}
std::string wrong_with_variable(const std::string &text) {
    return sandbox::is_variable_name(text)
               ? ""
               : "'" + text + "' must be a variable's name alone; its value is the one that arhost is started with";
}
std::string wrong_with_seed(const std::string &text) {
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
            throw std::runtime_error("--print " + text + ": must be ID=FILE, a marker's id and its picture");
        prints[id] = fs::absolute(text.substr(equals + 1));
    }
    return prints;
}

// What the configuration's keys of the same names would say.
struct PolicyOptions {
    std::vector<std::string> allow, reads, environment;
    std::string sandbox{sandbox::modes.front()};

    void add_to(base::CommandLine &app) {
        const auto add = [&](const char *name, std::vector<std::string> &values, const char *what) {
            return app.option(name, values, what).one_value_each();
        };
        const std::vector<std::string> known(sandbox::allowances.begin(), sandbox::allowances.end());
        add("--allow", allow, "What the sandbox gives it, as a configuration's 'allow' (docs/security.md)")
            .type_name("WHAT")
            .separator(',')
            .one_of(known);
        add("--reads", reads, "A further file or folder that it may read (again for more)")
            .type_name("PATH")
            .existing_path();
        add("--environment", environment, "A further variable that it gets (again for more)")
            .type_name("NAME")
            .check(wrong_with_variable);
        app.option("--sandbox", sandbox, "permissive, strict or none, as the configuration's 'sandbox'")
            .type_name("MODE")
            .one_of(std::vector<std::string>(sandbox::modes.begin(), sandbox::modes.end()));
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
    // With the files that the suite itself, or the plugin by its options, is told to read.
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
            text += fmt::format("{:<34} {}\n", test.name, test.promise);
    return text;
}

// What the plugin needs and is not given: without it the host would make no instance.
std::string lacking(const Result &loaded, const sandbox::Policy &policy) {
    if (policy.mode != sandbox::Mode::none)
        for (const std::string &need : loaded.facts.value("needs", std::vector<std::string>()))
            if (!policy.allows(need))
                return fmt::format("it needs '{0}', which the sandbox keeps from it: give --allow {0}", need);
    return {};
}

bool makes_instances(std::span<const Test> tests, std::string_view name) {
    if (name == "abi.create")
        return true;
    const auto test = std::find_if(tests.begin(), tests.end(), [&](const Test &t) { return name == t.name; });
    return test != tests.end() && makes_instances(tests, test->needs);
}

// Why nothing can be compared with the reference: that is no plugin's fault. "": it can.
std::string wrong_with_reference(std::span<const Test> tests, const RunSettings &settings) {
    const fs::path &file = settings.subject.reference;
    if (!fs::is_regular_file(file))
        return fmt::format("the reference '{}' is not there; give --reference FILE", file.string());
    RunSettings of_reference = settings;
    of_reference.subject.plugin = file;
    of_reference.subject.settings.clear();
    for (const Test &test : tests)
        if (test.name == std::string_view("abi.load") || test.name == std::string_view("raytracer.render")) {
            const Result result = run_alone(test, of_reference);
            if (result.verdict != Verdict::pass)
                return fmt::format("the reference '{}' can't be used, by {}: {}", file.string(), test.name,
                                   result.message);
            if (const arhost_kind kind = result.facts.value("kind", arhost_kind{ARHOST_KIND_RAYTRACER});
                kind != ARHOST_KIND_RAYTRACER)
                return fmt::format("the reference '{}' is a {} and must be a ray tracer; give --reference FILE",
                                   file.string(), arhost::ipc::to_text(kind));
        }
    return {};
}

// At once, for whoever reads along. A full disk, and a reader who has gone, end the run.
void print(const std::string &text, int signals = -1) {
    try {
        base::write_all(STDOUT_FILENO, text, signals);
    } catch (const std::system_error &error) {
        throw std::runtime_error("standard output can't be written: " + error.code().message());
    }
}

Report run(const RunSettings &settings, const std::vector<std::string> &patterns, bool quiet) {
    Report report{settings, all_tests(), {}, {}};
    const auto wanted = [&](const char *test) { return matches(patterns, test); };
    const auto is_fine = [](const Result &result) {
        return result.verdict == Verdict::pass || result.verdict == Verdict::skip;
    };
    const auto tell = [&](const Result &result) {
        if (!is_fine(result) || (wanted(result.test.c_str()) && !quiet))
            print(as_line(report, result), settings.signals);
    };
    const auto give = [&](const Test &test, Verdict verdict, const std::string &why) {
        report.results.push_back({test.name, verdict, why});
        tell(report.results.back());
    };
    // Always first: it tells the plugin's kind.
    run_all({report.tests.data(), 1}, settings, report.results, tell);
    report.plugin = report.results.front().facts;
    const arhost_kind kind = report.plugin.value("kind", 0);
    std::vector<Test> selected;
    std::set<std::string_view> needed;
    std::for_each(report.tests.rbegin(), report.tests.rend(), [&](const Test &test) {
        if ((wanted(test.name) && (test.kind == 0 || test.kind == kind)) || needed.contains(test.name)) {
            selected.insert(selected.begin(), test);
            needed.insert(test.needs);
        }
    });
    const std::string lacks = lacking(report.results.front(), settings.subject.policy);
    for (const Test &test : selected)
        if (!lacks.empty() && makes_instances(report.tests, test.name))
            give(test, Verdict::skip, lacks);
        else if (test.name == std::string_view("raytracer.reference"))
            if (const std::string wrong = wrong_with_reference(report.tests, settings); !wrong.empty())
                give(test, Verdict::error, wrong);
    run_all(selected, settings, report.results, tell);
    // What others need and nobody has asked for goes without saying.
    std::erase_if(report.results,
                  [&](const Result &result) { return is_fine(result) && !wanted(result.test.c_str()); });
    std::sort(report.results.begin(), report.results.end(),
              [&](const Result &a, const Result &b) { return &report.test_of(a) < &report.test_of(b); });
    return report;
}

// Where there are fewer, a plugin would be blamed for it.
void expect_descriptors(unsigned jobs) {
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    const rlim_t needed = 64 + 4 * jobs;
    if (limit.rlim_cur < needed && limit.rlim_max >= needed) {
        limit.rlim_cur = needed;
        ::setrlimit(RLIMIT_NOFILE, &limit);
    }
    if (limit.rlim_cur < needed)
        throw std::runtime_error(
            fmt::format("{} files may be open at once, and {} are needed; raise it: ulimit -n {}", limit.rlim_cur,
                        needed, needed));
}

// Plugins get paths as UTF-8: those that their options have, and of the folder for what they write.
void expect_utf8(const std::vector<std::string> &settings) {
    std::error_code none; // is told where it is missed
    std::vector<std::string> texts = settings;
    texts.push_back(fs::temp_directory_path(none));
    for (const std::string &text : texts)
        if (!base::is_utf8(text))
            throw std::runtime_error("'" + text + "' is no UTF-8, as what a plugin is given must be; rename it");
}

// A report replaces what is there, unless that is a pipe or a device.
void expect_files_of_their_own(const std::vector<std::string> &reports, const Subject &subject) {
    using base::identity_of;
    std::set<std::string> read, written; // paths, and nodes: a file may have several names
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
            throw std::runtime_error("can't write " + report + ": it is a file that this run reads; choose another");
        if (written.contains(path) || written.contains(node))
            throw std::runtime_error("can't write " + report + ": another report is written there");
        add(written, report);
    }
}

// Those that end a program, but for what whoever started this one wants ignored (nohup): taken from here on by who
// reads the descriptor.
base::UniqueFd take_signals() {
    sigset_t taken;
    ::sigemptyset(&taken);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction now {};
        if (::sigaction(signal, nullptr, &now) == 0 && now.sa_handler != SIG_IGN)
            ::sigaddset(&taken, signal);
    }
    ::sigprocmask(SIG_BLOCK, &taken, nullptr);
    return base::checked(::signalfd(-1, &taken, SFD_CLOEXEC), "signalfd");
}

// The last line; whoever does not read it ends this by another signal.
void say(const std::string &line, int signals) noexcept {
    try {
        base::write_all(STDERR_FILENO, line + "\n", signals);
    } catch (const std::exception &) { // nobody is told
    }
}
bool is_read(int fd) {
    pollfd ready{fd, POLLOUT, 0};
    return ::poll(&ready, 1, 0) > 0;
}

} // namespace

int main(int argc, char **argv) {
    std::signal(SIGPIPE, SIG_IGN); // as where a plugin runs: a full disk, and who reads no more, are errors
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGCHLD, SIG_DFL); // whoever started this may ignore it, and then no child can be waited for
    base::CommandLine app(
        "Tries whether a plugin keeps the promises of arhost's ABI (docs/conformance.md).\n"
        "Exit status: 0 all well; 1 a test failed, crashed or timed out; 2 the suite could not tell;\n"
        "128 and a signal's number: interrupted.",
        "arhost conform");
    RunSettings settings;
    std::vector<std::string> option_texts, print_texts, patterns = {"*"};
    std::string plugin, json, junit, html, child_test;
    std::string reference = default_reference();
    bool only_list = false, quiet = false;
    settings.jobs = std::max(1u, std::thread::hardware_concurrency() / 2);
    app.option("PLUGIN", plugin, "The plugin's shared object");
    app.flag("--list", only_list, "Print the tests' names and what each promises");
    app.option("--only", patterns, "Only tests whose name matches, as 'raytracer.*' (again for more)")
        .type_name("PATTERN")
        .separator(',')
        .one_value_each();
    app.option("--set", option_texts, "An option of the plugin (again for more)")
        .type_name("KEY=VALUE")
        .one_value_each();
    app.option("--print", print_texts,
               "The PNG of a marker that the tracker finds (again for more), instead of tag36h11's")
        .type_name("ID=FILE")
        .one_value_each();
    PolicyOptions policy_options;
    policy_options.add_to(app);
    app.option("--seed", settings.subject.seed, "Of whatever is chosen at random (1)")
        .type_name("N")
        .check(wrong_with_seed);
    app.option("--jobs", settings.jobs, "Tests at a time").type_name("N").range(1, 256);
    app.option("--timeout-factor", settings.subject.timeout_factor, "Times each deadline, on slow machines (1)")
        .type_name("FACTOR")
        .check(invalid_timeout_factor);
    app.option("--reference", reference, "The ray tracer that images are compared with")
        .type_name("FILE")
        .check(wrong_with_name);
    app.flag("-q,--quiet", quiet, "Print neither what passes nor what is skipped");
    const auto add_file = [&](const char *name, std::string &file, const char *what) {
        app.option(name, file, what).type_name("FILE").check(wrong_with_name);
    };
    add_file("--json", json, "Write the results as JSON");
    add_file("--junit", junit, "Write them as JUnit XML");
    add_file("--html", html, "Write them as one page, with images");
    app.option("--run", child_test, "").hidden(); // for this program itself: be the process of that test
    app.option("--scratch", settings.subject.scratch, "").hidden();
    if (const auto status = app.parse(argc, argv))
        return base::flush_stdout() ? *status : usage_or_suite_failed;
    base::UniqueFd signals;
    try {
        if (only_list) {
            print(list(patterns));
            return 0;
        }
        if (!fs::is_regular_file(plugin))
            throw std::runtime_error(plugin.empty() ? "which plugin? arhost conform PLUGIN.so"
                                                    : "there is no plugin '" + plugin + "'");
        settings.subject.plugin = fs::absolute(plugin);
        settings.subject.reference = fs::absolute(reference);
        settings.subject.settings = parse_settings(option_texts);
        settings.subject.prints = parse_prints(print_texts);
        settings.subject.policy = policy_options.policy(settings.subject);
        settings.subject.policy_options = policy_options.texts();
        if (!child_test.empty())
            return run_child(child_test, settings.subject);
        expect_utf8(option_texts);
        expect_descriptors(settings.jobs);
        expect_files_of_their_own({json, junit, html}, settings.subject);
        signals = take_signals(); // not where a test is run, which is ended as any program
        settings.signals = signals.get();
        base::AtomicFile json_file(json, settings.signals), junit_file(junit, settings.signals),
            html_file(html, settings.signals);
        const Report report = run(settings, patterns, quiet);
        print(as_summary(report), settings.signals);
        if (report.results.empty())
            throw std::runtime_error(
                fmt::format("--only {}: no test of this kind of plugin has such a name", fmt::join(patterns, ",")));
        json_file.write(as_json(report));
        junit_file.write(as_junit(report));
        html_file.write(as_html(report));
        return report.exit_status();
    } catch (const base::Interrupted &interrupted) {
        if (is_read(STDERR_FILENO))
            say(interrupted.what(), settings.signals);
        return 128 + interrupted.signal;
    } catch (const std::exception &error) {
        say("error: " + base::printable(error.what()), settings.signals);
        return usage_or_suite_failed;
    }
}
