// SPDX-License-Identifier: Apache-2.0
//
// arhost-conform: tries whether a plugin keeps the ABI's promises (docs/conformance.md).
#include "conform/report.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fnmatch.h>
#include <fstream>
#include <thread>

namespace {

using namespace arhost::conform;
namespace sandbox = arhost::sandbox;
namespace fs = std::filesystem;

enum ExitStatus { usage_or_suite_failed = 2 };

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
        const auto [end, error] = std::from_chars(text.data(), text.data() + std::min(equals, text.size()), id);
        if (equals == std::string::npos || error != std::errc() || end != text.data() + equals)
            throw std::runtime_error("--print " + text + ": must be ID=FILE, a marker's id and its picture");
        prints[id] = fs::absolute(text.substr(equals + 1));
    }
    return prints;
}

// What the configuration's keys of the same names would say.
struct PolicyOptions {
    std::vector<std::string> allow, reads, environment;
    std::string sandbox{sandbox::modes.front()};

    void add_to(CLI::App &app) {
        const auto add = [&](const char *name, std::vector<std::string> &values, const char *what) {
            return app.add_option(name, values, what)->allow_extra_args(false);
        };
        const std::vector<std::string> known(sandbox::allowances.begin(), sandbox::allowances.end());
        add("--allow", allow, "What the sandbox gives it, as a configuration's 'allow' (docs/security.md)")
            ->type_name("WHAT")
            ->delimiter(',')
            ->check(CLI::IsMember(known));
        add("--reads", reads, "A further file or folder that it may read (again for more)")->type_name("PATH");
        add("--environment", environment, "A further variable that it gets (again for more)")->type_name("NAME");
        app.add_option("--sandbox", sandbox, "permissive, strict or none, as the configuration's 'sandbox'")
            ->type_name("MODE")
            ->check(CLI::IsMember(std::vector<std::string>(sandbox::modes.begin(), sandbox::modes.end())));
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
                sandbox::let_read_files(policy, fs::absolute(value));
            else if (!value.empty())
                sandbox::let_read(policy, fs::absolute(value));
        return policy;
    }
};

void write(const std::string &file, const std::string &text) {
    if (file.empty())
        return;
    std::ofstream stream(file, std::ios::binary);
    stream << text << std::flush;
    if (!stream)
        throw std::runtime_error("can't write " + file);
}

void list(const std::string &pattern) {
    for (const Test &test : all_tests())
        if (::fnmatch(pattern.c_str(), test.name, 0) == 0)
            fmt::print("{:<34} {}\n", test.name, test.promise);
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

Report run(const RunSettings &settings, const std::string &pattern, bool quiet) {
    Report report{settings, all_tests(), {}, {}};
    const auto tell = [&](const Result &result) {
        if (!quiet || (result.verdict != Verdict::pass && result.verdict != Verdict::skip))
            fmt::print("{}", as_line(report, result));
        std::fflush(stdout);
    };
    const auto wanted = [&](const Test &test) { return ::fnmatch(pattern.c_str(), test.name, 0) == 0; };
    // Always first: it tells the plugin's kind.
    const Test &load = report.tests.front();
    Result loaded = run_alone(load, settings);
    report.plugin = loaded.facts;
    const arhost_kind kind = loaded.facts.value("kind", 0);
    const bool passed = loaded.verdict == Verdict::pass;
    const std::string lacks = lacking(loaded, settings.subject.policy);
    if (!passed || wanted(load)) {
        tell(loaded);
        report.results.push_back(std::move(loaded));
    }
    std::vector<Test> selected;
    for (const Test &test : report.tests) {
        if (&test == &load || !wanted(test) || (test.kind != 0 && test.kind != kind))
            continue;
        selected.push_back(test);
        if (!lacks.empty() && makes_instances(report.tests, test.name)) {
            report.results.push_back({test.name, Verdict::skip, lacks});
            tell(report.results.back());
        }
    }
    run_all(selected, settings, report.results, tell);
    std::sort(report.results.begin(), report.results.end(),
              [&](const Result &a, const Result &b) { return &report.test_of(a) < &report.test_of(b); });
    return report;
}

} // namespace

int main(int argc, char **argv) {
    CLI::App app("Tries whether a plugin keeps the promises of arhost's ABI (docs/conformance.md).\n"
                 "Exit status: 0 all well; 1 a test failed, crashed or timed out; 2 the suite could not tell.",
                 "arhost conform");
    app.get_formatter()->column_width(34);
    RunSettings settings;
    std::vector<std::string> option_texts, print_texts;
    std::string plugin, pattern = "*", json, junit, html, child_test;
    const fs::path own_folder = fs::read_symlink("/proc/self/exe").parent_path();
    std::string reference = (own_folder / "../lib/arhost/plugins/rt_embree.so").lexically_normal();
    bool only_list = false, quiet = false;
    settings.jobs = std::max(1u, std::thread::hardware_concurrency() / 2);
    app.add_option("PLUGIN", plugin, "The plugin's shared object");
    app.add_flag("--list", only_list, "Print the tests' names and what each promises");
    app.add_option("--only", pattern, "Only tests whose name matches, as 'raytracer.*'")->type_name("PATTERN");
    app.add_option("--set", option_texts, "An option of the plugin (again for more)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--print", print_texts,
                   "The PNG of a marker that the tracker finds (again for more), instead of tag36h11's")
        ->type_name("ID=FILE")
        ->allow_extra_args(false);
    PolicyOptions policy_options;
    policy_options.add_to(app);
    app.add_option("--seed", settings.subject.seed, "Of whatever is chosen at random (1)")->type_name("N");
    app.add_option("--jobs", settings.jobs, "Tests at a time")->type_name("N")->check(CLI::Range(1, 256));
    app.add_option("--patience", settings.patience, "Times each deadline, on slow machines (1)")
        ->type_name("FACTOR")
        ->check(CLI::PositiveNumber);
    app.add_option("--reference", reference, "The ray tracer that images are compared with")->type_name("FILE");
    app.add_flag("-q,--quiet", quiet, "Print neither what passes nor what is skipped");
    app.add_option("--json", json, "Write the results as JSON")->type_name("FILE");
    app.add_option("--junit", junit, "Write them as JUnit XML")->type_name("FILE");
    app.add_option("--html", html, "Write them as one page, with images")->type_name("FILE");
    app.add_option("--run", child_test, "")->group(""); // for this program itself: be the process of that test
    app.add_option("--scratch", settings.subject.scratch, "")->group("");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        return app.exit(error) == 0 ? 0 : usage_or_suite_failed;
    }
    try {
        if (only_list) {
            list(pattern);
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
        const Report report = run(settings, pattern, quiet);
        fmt::print("{}", as_summary(report));
        if (report.results.empty())
            throw std::runtime_error("--only " + pattern + ": no test of this kind of plugin has such a name");
        write(json, as_json(report));
        write(junit, as_junit(report));
        write(html, as_html(report));
        return report.exit_status();
    } catch (const std::exception &error) {
        fmt::print(stderr, "error: {}\n", error.what());
        return usage_or_suite_failed;
    }
}
