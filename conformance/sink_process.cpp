// SPDX-License-Identifier: Apache-2.0
#include "conformance/sink_process.hpp"

#include "conformance/child.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <csignal>
#include <deque>
#include <fcntl.h>
#include <iostream>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace arhost::conformance {
namespace {

constexpr const char *helper = "sink.process";

// Runs in the process: reads the parameters from standard input and writes a byte per frame to result_fd. If it
// fails, the test's result follows.
void work(Context &context) {
    SinkProcess::Work work{};
    std::cin >> work.frames >> work.size.width >> work.size.height >> work.folder;
    SinkRun run(context, work.folder);
    run.start(0, work.size);
    std::deque<SealedOutput> frames; // created in advance, so that the next write follows the progress byte at once
    for (std::uint64_t n = 0; n < work.frames; ++n)
        frames.emplace_back(SealedOutput::Content{.sequence = n, .size = work.size});
    for (const SealedOutput &frame : frames) {
        run.write(frame);
        if (::write(result_fd, ".", 1) != 1)
            break;
    }
    while (std::cin.get() != EOF) { // waits to be killed; EOF: the suite has ended
    }
}

constexpr Test helpers[] = {{helper, "It writes frames until it is killed.", "", 60s, work}};

} // namespace

std::span<const Test> helper_tests() {
    return helpers;
}

SinkProcess::SinkProcess(Context &context, const Work &work) {
    PluginLibrary &library = context.library;
    std::vector<std::string> arguments = {"arhost-conform", library.file(),    "--run",     helper,
                                          "--scratch",      library.scratch(), "--sandbox", "none" /* inherited */};
    for (const auto &[key, value] : library.settings())
        arguments.insert(arguments.end(), {"--set", key + "=" + value});

    Pipe work_pipe, progress_pipe;
    const ipc::SharedMemory call_page = ipc::SharedMemory::create("arhost-conform-call", sizeof(ipc::Call));
    std::vector<int> descriptors = {work_pipe.read_end.get(), STDOUT_FILENO, STDERR_FILENO,
                                    progress_pipe.write_end.get(), call_page.fd()};
    pass_sockets(library.sockets(), arguments, descriptors);
    pid_ = start_process(std::move(arguments), descriptors);
    work_pipe_ = std::move(work_pipe.write_end);
    progress_pipe_ = std::move(progress_pipe.read_end);
    const std::string line =
        fmt::format("{} {} {} {}\n", work.frames, work.size.width, work.size.height, work.folder);
    if (::write(work_pipe_.get(), line.data(), line.size()) != static_cast<ssize_t>(line.size()))
        base::throw_errno("write to the sink's process");
}

void SinkProcess::wait_until_written(std::uint64_t frames) {
    std::string result; // follows the last frame's byte
    for (char byte = 0; count_ < frames && ::read(progress_pipe_.get(), &byte, 1) == 1;)
        if (byte == '.' && result.empty())
            ++count_;
        else
            result += byte;
    if (count_ == frames)
        return;
    const ipc::Json reported = ipc::Json::parse(result, nullptr, false);
    throw Failure(fmt::format("in a separate process it failed after {} frames: {}", count_,
                              reported.is_object() ? reported.value("message", "") : "the process ended"));
}

void SinkProcess::kill() {
    if (pid_ <= 0)
        return;
    ::kill(pid_, SIGTERM);
    int status = 0;
    pid_t reaped = 0;
    for (int i = 0; i < 500 && reaped == 0; ++i) { // the plugin may catch SIGTERM
        std::this_thread::sleep_for(2ms);
        reaped = ::waitpid(pid_, &status, WNOHANG);
    }
    if (reaped == 0) {
        ::kill(pid_, SIGKILL);
        ::waitpid(pid_, &status, 0);
    }
    pid_ = 0;
}

} // namespace arhost::conformance
