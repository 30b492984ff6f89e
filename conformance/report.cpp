// SPDX-License-Identifier: Apache-2.0
#include "conformance/report.hpp"

#include "base/text.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <sys/utsname.h>
#include <thread>

namespace arhost::conformance {
namespace {

std::string quoted(const std::string &word) {
    if (word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./=:,+%@") ==
            std::string::npos &&
        !word.empty())
        return word;
    if (base::printable(word) != word) { // unprintable bytes: bash's $'…' quoting
        std::string text = "$'";
        for (const char c : word)
            text += c == '\'' || c == '\\' ? fmt::format("\\{}", c)
                    : c >= ' ' && c <= '~' ? std::string(1, c)
                                           : fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
        return text + "'";
    }
    std::string text = "'";
    for (const char c : word)
        text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return text + "'";
}

bool is_bad(Verdict verdict) {
    return verdict == Verdict::fail || verdict == Verdict::crashed || verdict == Verdict::timeout;
}

} // namespace

std::size_t Report::count(Verdict verdict) const {
    return static_cast<std::size_t>(
        std::count_if(results.begin(), results.end(), [&](const Result &r) { return r.verdict == verdict; }));
}

int Report::exit_status() const {
    if (count(Verdict::error) > 0 || count(Verdict::skip) == results.size())
        return 2;
    return std::any_of(results.begin(), results.end(), [](const Result &r) { return is_bad(r.verdict); });
}

const Test &Report::test_of(const Result &result) const {
    return *std::find_if(tests.begin(), tests.end(), [&](const Test &test) { return test.name == result.test; });
}

std::string Report::command(const Result &result) const {
    const Subject &subject = settings.subject;
    std::string text =
        fmt::format("arhost conform {} --only {} --seed {}", quoted(subject.plugin), result.test, subject.seed);
    for (const auto &[key, value] : subject.settings)
        text += " --set " + quoted(key + "=" + value);
    for (const auto &[id, file] : subject.prints)
        text += fmt::format(" --print {}={}", id, quoted(file.string()));
    if (!subject.family.empty())
        text += " --family " + quoted(subject.family);
    if (!subject.body.empty())
        text += " --body " + quoted(subject.body);
    for (const std::string &option : subject.policy_options)
        text += " " + quoted(option);
    if (subject.reference != default_reference())
        text += " --reference " + quoted(subject.reference);
    if (subject.timeout_factor != 1)
        text += fmt::format(" --timeout-factor {}", subject.timeout_factor);
    return text;
}

std::string as_line(const Report &report, const Result &result) {
    std::string text = fmt::format("{:<8} {}", to_text(result.verdict), result.test);
    if (!result.message.empty())
        text += fmt::format("\n         {}", base::printable(result.message));
    if (is_bad(result.verdict))
        text += fmt::format("\n         requirement: {}\n         to repeat: {}", report.test_of(result).requirement,
                            report.command(result));
    return text + "\n";
}

std::string as_summary(const Report &report) {
    std::string text;
    for (std::size_t i = 1; i < verdict_texts.size(); ++i)
        if (const std::size_t count = report.count(static_cast<Verdict>(i)))
            text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, verdict_texts[i]);
    return fmt::format("{}: {}\n", base::printable(report.settings.subject.plugin.string()),
                       text.empty() ? "no test ran" : text);
}

std::string as_json(const Report &report) {
    utsname system{};
    ::uname(&system);
    ipc::Json json = {{"plugin", to_json(report.plugin)},
                      {"file", report.settings.subject.plugin.string()},
                      {"settings", report.settings.subject.settings},
                      {"seed", report.settings.subject.seed},
                      {"environment",
                       {{"arhost", ARHOST_VERSION},
                        {"abi_version", ARHOST_ABI_VERSION},
                        {"system", fmt::format("{} {} {}", system.sysname, system.release, system.machine)},
                        {"processors", std::thread::hardware_concurrency()}}},
                      {"exit_status", report.exit_status()},
                      {"results", ipc::Json::array()}};
    for (const Result &result : report.results) {
        ipc::Json one = to_json(result);
        one.erase("facts");
        one["requirement"] = report.test_of(result).requirement;
        one["command"] = report.command(result);
        json["results"].push_back(std::move(one));
    }
    return json.dump(1, ' ', false, ipc::Json::error_handler_t::replace) + "\n";
}

std::string as_junit(const Report &report) {
    const std::size_t failed =
        report.count(Verdict::fail) + report.count(Verdict::crashed) + report.count(Verdict::timeout);
    std::string text = fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"{}\" tests=\"{}\" "
                                   "failures=\"{}\" errors=\"{}\" skipped=\"{}\">\n",
                                   escaped(report.settings.subject.plugin.filename().string()), report.results.size(),
                                   failed, report.count(Verdict::error), report.count(Verdict::skip));
    for (const Result &result : report.results) {
        const std::size_t dot = result.test.find('.');
        text += fmt::format("  <testcase classname=\"{}\" name=\"{}\" time=\"{:.3f}\">", result.test.substr(0, dot),
                            result.test.substr(dot + 1), result.seconds);
        const std::string message = escaped(result.message);
        if (is_bad(result.verdict))
            text += fmt::format("<failure type=\"{}\" message=\"{}\">{}</failure>", to_text(result.verdict), message,
                                escaped(report.command(result)));
        else if (result.verdict == Verdict::error)
            text += fmt::format("<error message=\"{}\"/>", message);
        else if (result.verdict == Verdict::skip)
            text += fmt::format("<skipped message=\"{}\"/>", message);
        else if (!message.empty())
            text += fmt::format("<system-out>{}</system-out>", message);
        text += "</testcase>\n";
    }
    return text + "</testsuite>\n";
}

std::string escaped(const std::string &text) {
    std::string result;
    for (const char c : base::printable(text)) {
        switch (c) {
        case '&':
            result += "&amp;";
            break;
        case '<':
            result += "&lt;";
            break;
        case '>':
            result += "&gt;";
            break;
        case '"':
            result += "&quot;";
            break;
        default:
            result += c;
        }
    }
    return result;
}

} // namespace arhost::conformance
