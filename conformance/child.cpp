// SPDX-License-Identifier: Apache-2.0
#include "conformance/child.hpp"

#include "base/exec.hpp"
#include "conformance/test.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <sys/mman.h>
#include <system_error>
#include <unistd.h>

namespace arhost::conformance {
namespace {

CallPage map_call_page() {
    void *address = ::mmap(nullptr, sizeof(ipc::Call), PROT_READ | PROT_WRITE, MAP_SHARED, call_page_fd, 0);
    if (address == MAP_FAILED)
        base::throw_errno("mmap of the call page");
    ::close(call_page_fd);
    return CallPage(ipc::Mapping(static_cast<std::byte *>(address), sizeof(ipc::Call)));
}

// Enters the sandbox as arhost-worker does before it opens a plugin. The scratch folder is writable.
sandbox::Level enter_sandbox(const Test &test, const Subject &subject) {
    sandbox::Policy policy = subject.policy;
    policy.writable.push_back(subject.scratch);
    if (test.forks) {
        policy.allow.insert("processes");
        policy.readable.push_back(std::filesystem::read_symlink("/proc/self/exe")); // to execute this program again
    }
    return sandbox::enter_for(subject.plugin, policy);
}

// Discards what a sink with the option `path: "-"` writes to standard output, where it would mix with the report.
void discard_standard_output(const Settings &settings) {
    const auto path = settings.find("path");
    if (path == settings.end() || path->second != standard_output)
        return;
    const base::UniqueFd null = base::checked(::open("/dev/null", O_WRONLY | O_CLOEXEC), "open /dev/null");
    ::dup2(null.get(), STDOUT_FILENO);
}

constexpr off_t min_space_mib = 16;

// Returns 0 if min_space_mib are free on the folder's file system, otherwise an errno.
int check_space(const std::filesystem::path &folder) {
    const std::filesystem::path file = folder / "space";
    const base::UniqueFd fd(::open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600));
    const int error = fd ? ::posix_fallocate(fd.get(), 0, min_space_mib << 20) : errno;
    std::error_code ignored;
    std::filesystem::remove(file, ignored);
    return error;
}
std::runtime_error no_space(const std::filesystem::path &folder, int error) {
    return std::runtime_error(
        fmt::format("the test's folder {} has no space for {} MiB: {}; free some, or set TMPDIR to another folder",
                    folder.string(), min_space_mib, std::strerror(error)));
}

void run_in_sandbox(const Test &test, Context &context) {
    if (test.kind() != ARHOST_KIND_SINK)
        return test.run(context);
    const std::filesystem::path &folder = context.library.scratch();
    if (const int error = check_space(folder); error != 0)
        throw no_space(folder, error);
    try {
        test.run(context);
    } catch (const Failure &) {
        // Another program may have filled the disk; other errors may be the sink's fault.
        if (const int error = check_space(folder); error == ENOSPC || error == EDQUOT)
            throw no_space(folder, error);
        throw;
    }
}

} // namespace

Result run_here(const Test &test, const Subject &subject, const CallPage &calls) {
    PluginLibrary library(subject.plugin, subject.settings, calls, subject.scratch, subject.sockets);
    Context context{library, subject.reference, std::mt19937_64(subject.seed)};
    context.prints = subject.prints;
    context.family = subject.family;
    context.body = subject.body;
    context.timeout_factor = subject.timeout_factor;
    Result result;
    result.test = test.name;
    try {
        const sandbox::Level level = enter_sandbox(test, subject);
        run_in_sandbox(test, context);
        if (context.facts)
            context.facts->sandbox = sandbox::to_text(level);
        result.verdict = Verdict::pass;
        result.message = context.note;
    } catch (const Failure &failure) {
        result.verdict = Verdict::fail;
        result.message = failure.what();
        result.wrong_pixel = failure.wrong_pixel;
        for (const auto &[label, picture] : failure.pictures)
            result.images.push_back({label, picture.png_base64(), picture.width(), picture.height()});
    } catch (const Skip &skip) {
        result.verdict = Verdict::skip;
        result.message = skip.what();
    } catch (const Warning &warning) {
        result.verdict = Verdict::warn;
        result.message = warning.what();
    } catch (const std::exception &error) {
        const auto *system = dynamic_cast<const std::system_error *>(&error);
        // Attributed to the plugin, because the suite opens only a few descriptors.
        const bool out_of_descriptors = system && system->code() == std::errc::too_many_files_open;
        result.verdict = out_of_descriptors ? Verdict::fail : Verdict::error;
        result.message =
            out_of_descriptors ? "it leaks descriptors until the limit of open files is reached" : error.what();
    }
    result.facts = context.facts;
    return result;
}

std::filesystem::path default_reference() {
    const std::filesystem::path folder = std::filesystem::read_symlink("/proc/self/exe").parent_path();
    return (folder / "../lib/arhost/plugins/rt_embree.so").lexically_normal();
}

Pipe::Pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        base::throw_errno("pipe2");
    read_end.reset(ends[0]);
    write_end.reset(ends[1]);
}

void pass_sockets(const Sockets &sockets, std::vector<std::string> &arguments, std::vector<int> &descriptors) {
    for (const auto &[key, socket] : sockets) {
        arguments.insert(arguments.end(), {"--socket", key + "=" + socket.address});
        descriptors.push_back(socket.fd);
    }
}

Sockets passed_sockets(const std::vector<std::string> &texts) {
    Sockets sockets;
    int fd = first_socket_fd;
    for (const std::string &text : texts)
        sockets[text.substr(0, text.find('='))] = {fd++, text.substr(text.find('=') + 1)};
    return sockets;
}

pid_t start_process(std::vector<std::string> arguments, const std::vector<int> &descriptors, bool new_group) {
    std::vector<char *> argv;
    argv.reserve(arguments.size() + 1);
    for (std::string &argument : arguments)
        argv.push_back(argument.data());
    argv.push_back(nullptr);
    const pid_t parent = ::getpid();
    const pid_t pid = ::fork();
    if (pid < 0)
        base::throw_errno("fork");
    if (pid > 0)
        return pid;
    // A plugin may have started threads: only async-signal-safe calls until exec.
    if (new_group)
        ::setpgid(0, 0);
    base::exec_child("/proc/self/exe", argv.data(), descriptors, parent);
    ::_exit(127);
}

int run_child(const std::string &name, const Subject &subject) {
    const CallPage calls = map_call_page();
    std::vector<Test> tests = all_tests();
    tests.insert(tests.end(), helper_tests().begin(), helper_tests().end());
    for (const Test &test : tests) {
        if (name != test.name)
            continue;
        discard_standard_output(subject.settings);
        const std::string line =
            to_json(run_here(test, subject, calls)).dump(-1, ' ', false, ipc::Json::error_handler_t::replace) + "\n";
        std::FILE *pipe = ::fdopen(result_fd, "w");
        std::fwrite(line.data(), 1, line.size(), pipe);
        std::fclose(pipe);
        return EXIT_SUCCESS; // the test includes the plugin's static destructors
    }
    return EXIT_FAILURE;
}

ipc::Json to_json(const std::optional<Facts> &facts) {
    if (!facts)
        return ipc::Json::object();
    ipc::Json json = facts->descriptor;
    json["sandbox"] = facts->sandbox;
    return json;
}

ipc::Json to_json(const Result &result) {
    ipc::Json json = {
        {"test", result.test},       {"verdict", to_text(result.verdict)}, {"message", result.message},
        {"seconds", result.seconds}, {"facts", to_json(result.facts)},     {"images", ipc::Json::array()}};
    for (const ReportImage &image : result.images)
        json["images"].push_back(
            {{"label", image.label}, {"width", image.width}, {"height", image.height}, {"png", image.png}});
    if (result.wrong_pixel)
        json["wrong_pixel"] = *result.wrong_pixel;
    return json;
}

Result result_from_json(const ipc::Json &json) {
    Result result;
    result.test = json.at("test").get<std::string>();
    const auto verdict =
        std::find(verdict_texts.begin() + 1, verdict_texts.end(), json.at("verdict").get<std::string>());
    if (verdict == verdict_texts.end())
        throw std::runtime_error("unknown verdict");
    result.verdict = static_cast<Verdict>(verdict - verdict_texts.begin());
    result.message = json.at("message").get<std::string>();
    if (const ipc::Json &facts = json.at("facts"); facts != ipc::Json::object())
        result.facts = {facts.get<model::PluginDescription>(), facts.at("sandbox").get<std::string>()};
    for (const ipc::Json &image : json.at("images"))
        result.images.push_back({image.at("label").get<std::string>(), image.at("png").get<std::string>(),
                                 image.at("width").get<unsigned>(), image.at("height").get<unsigned>()});
    if (json.contains("wrong_pixel"))
        result.wrong_pixel = json["wrong_pixel"].get<std::array<unsigned, 2>>();
    return result;
}

} // namespace arhost::conformance
