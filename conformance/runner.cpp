// SPDX-License-Identifier: Apache-2.0
#include "conformance/runner.hpp"

#include "base/listening_socket.hpp"
#include "base/orphans.hpp"
#include "base/temporary_folder.hpp"
#include "base/text.hpp"
#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <list>
#include <poll.h>
#include <set>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

namespace arhost::conformance {
namespace {

using Clock = std::chrono::steady_clock;
using base::UniqueFd;
using ipc::Call;

std::string call_text(Call call, const Test &test) {
    constexpr const char *per_frame[] = {"its per-frame call", "read", "track", "render", "write"};
    return " " + ipc::to_text(call, per_frame[test.kind()]);
}

// Returns a socket of the same kind that neither other tests nor other programs use: at a free port, or in `folder`.
base::ListeningSocket listen_like(const std::string &address, const std::string &key,
                                  const std::filesystem::path &folder) {
    const std::size_t colon = address.starts_with('/') ? std::string::npos : address.rfind(':');
    return base::ListeningSocket(colon == std::string::npos ? (folder / (key + ".sock")).string()
                                                            : address.substr(0, colon) + ":0");
}

// Copies what a plugin prints to standard error, up to 64 KiB, as lines without control characters. It is not part of
// the report.
class PrintedText {
public:
    explicit PrintedText(int signals) : signals_(signals) {}

    void finish(const std::string &test) {
        if (!line_.empty())
            print_line();
        if (omitted_ > 0)
            base::write_all(STDERR_FILENO, fmt::format("{}: {} more bytes omitted\n", test, omitted_), signals_);
    }
    void append(std::string_view bytes) {
        for (const char c : bytes.substr(0, remaining_))
            if (c == '\n')
                print_line();
            else
                line_ += c;
        omitted_ += bytes.size() - std::min(bytes.size(), remaining_);
        remaining_ -= std::min(bytes.size(), remaining_);
    }

private:
    void print_line() { base::write_all(STDERR_FILENO, base::printable(std::exchange(line_, {})) + '\n', signals_); }

    int signals_;
    std::string line_;
    std::size_t remaining_ = 64 << 10, omitted_ = 0;
};

class Child {
public:
    // `alive`: the processes of all running tests. When a test ends, all other children of this process are killed.
    Child(const Test &test, const RunSettings &settings, std::set<pid_t> &alive)
        : test_(test), alive_(alive), begin_(Clock::now()),
          deadline_(begin_ +
                    std::chrono::duration_cast<Clock::duration>(test.deadline * settings.subject.timeout_factor)),
          memory_(ipc::SharedMemory::create("arhost-conform-call", sizeof(Call))),
          calls_(memory_.map(ipc::Access::read_only)), printed_(settings.signals) {
        const Subject &subject = settings.subject;
        std::vector<std::string> arguments = {"arhost-conform",
                                              subject.plugin,
                                              "--run",
                                              test.name,
                                              "--seed",
                                              std::to_string(subject.seed),
                                              "--timeout-factor",
                                              std::to_string(subject.timeout_factor),
                                              "--reference",
                                              subject.reference,
                                              "--scratch",
                                              scratch_.path()};
        for (const auto &[key, value] : subject.settings)
            arguments.insert(arguments.end(), {"--set", key + "=" + value});
        for (const auto &[id, file] : subject.prints)
            arguments.insert(arguments.end(), {"--print", std::to_string(id) + "=" + file.string()});
        for (const auto &[option, value] : {std::pair{"--family", &subject.family}, {"--body", &subject.body}})
            if (!value->empty())
                arguments.insert(arguments.end(), {option, *value});
        arguments.insert(arguments.end(), subject.policy_options.begin(), subject.policy_options.end());
        ::fcntl(result_.read_end.get(), F_SETFL, O_NONBLOCK);
        ::fcntl(output_.read_end.get(), F_SETFL, O_NONBLOCK);
        const UniqueFd no_input = base::checked(::open("/dev/null", O_RDONLY | O_CLOEXEC), "open /dev/null");
        const int output = output_.write_end.get();
        std::vector<int> descriptors = {no_input.get(), output, output, result_.write_end.get(), memory_.fd()};
        Sockets sockets;
        for (const auto &[key, address] : subject.addresses) {
            const base::ListeningSocket &socket = listening_.emplace_back(listen_like(address, key, scratch_.path()));
            sockets[key] = {socket.fd(), socket.address()};
        }
        pass_sockets(sockets, arguments, descriptors);
        pid_ = start_process(std::move(arguments), descriptors, true);
        result_.write_end.reset();
        output_.write_end.reset();
        ::setpgid(pid_, pid_); // also here, to avoid a race with the child
        alive_.insert(pid_);
    }
    ~Child() {
        if (pid_ > 0)
            end();
    }
    Child(const Child &) = delete;
    Child &operator=(const Child &) = delete;

    // Descriptors to poll; -1 (closed) is ignored by poll.
    std::array<int, 2> fds() const { return {result_.read_end.get(), output_.read_end.get()}; }
    Clock::time_point deadline() const { return deadline_; }

    // Reads available output. True once the process has ended, timed out, or exceeded the size limit of a result.
    bool poll() {
        const bool ended = ended_ || ::waitpid(pid_, &status_, WNOHANG) == pid_;
        read_output(); // after waitpid, so that the process's last output is available
        ended_ = ended;
        return ended_ || Clock::now() >= deadline_ || has_flooded();
    }

    Result finish() {
        const bool in_time = ended_, has_result = text_.ends_with('\n');
        printed_.finish(test_.name);
        const std::string where = has_result ? " when the process ended" : call_text(calls_.read(), test_);
        end();
        Result result;
        if (has_flooded()) {
            result.verdict = Verdict::fail;
            result.message = fmt::format("more than {1} MiB were written to the suite's result pipe, descriptor {0}",
                                         result_fd, max_result_size >> 20);
        } else if (in_time && WIFEXITED(status_) && WEXITSTATUS(status_) == EXIT_SUCCESS && has_result) {
            result = parsed_result();
        } else if (!in_time) {
            result.verdict = Verdict::timeout;
            result.message = fmt::format("timed out after {:.3g} s{}",
                                         std::chrono::duration<double>(deadline_ - begin_).count(), where);
        } else {
            result.verdict = Verdict::crashed;
            result.message = WIFSIGNALED(status_)
                                 ? fmt::format("SIG{}{}", ::sigabbrev_np(WTERMSIG(status_)), where)
                                 : fmt::format("the process exited with status {}{}", WEXITSTATUS(status_), where);
        }
        result.test = test_.name;
        result.seconds = std::chrono::duration<double>(Clock::now() - begin_).count();
        return result;
    }

private:
    static constexpr std::size_t max_result_size = 32 << 20; // images take several MB
    bool has_flooded() const { return text_.size() > max_result_size; }

    // The plugin may have written to the result pipe.
    Result parsed_result() const {
        try {
            return result_from_json(ipc::Json::parse(text_, [](int depth, auto, auto &) {
                if (depth > 16)
                    throw std::runtime_error("nested too deeply");
                return true;
            }));
        } catch (const std::exception &) {
            Result result;
            result.verdict = Verdict::fail;
            result.message = fmt::format("the suite's result pipe, descriptor {}, has an invalid result: '{}'",
                                         result_fd, base::printable(text_.substr(0, 60)));
            return result;
        }
    }
    // Reads a limited amount, so that endless output does not delay other tests and deadlines.
    void read_output() {
        read_output(result_.read_end, [&](std::string_view bytes) { text_ += bytes; });
        read_output(output_.read_end, [&](std::string_view bytes) { printed_.append(bytes); });
    }
    static void read_output(UniqueFd &from, const std::function<void(std::string_view)> &to) {
        char buffer[1 << 16];
        for (int i = 0; i < 16 && from; ++i) {
            const ssize_t count = ::read(from.get(), buffer, sizeof buffer);
            if (count > 0)
                to({buffer, static_cast<std::size_t>(count)});
            else if (count < 0 && errno == EAGAIN)
                break; // the test's children may keep it open
            else
                from.reset();
        }
    }
    void end() {
        ::kill(-pid_, SIGKILL); // and the processes that the plugin started
        if (!ended_)
            ::waitpid(pid_, &status_, 0);
        alive_.erase(pid_);
        pid_ = 0;
        base::end_orphans(alive_);
    }

    const Test &test_;
    std::set<pid_t> &alive_;
    Clock::time_point begin_, deadline_;
    base::TemporaryFolder scratch_{"arhost-conform"}; // removed after the process has ended
    std::list<base::ListeningSocket> listening_;
    ipc::SharedMemory memory_;
    CallPage calls_;
    Pipe result_, output_;
    PrintedText printed_;
    pid_t pid_ = 0;
    std::string text_;
    bool ended_ = false;
    int status_ = 0;
};

const Result *find(const std::vector<Result> &results, const std::string &test) {
    const auto found = std::find_if(results.begin(), results.end(), [&](const Result &r) { return r.test == test; });
    return found == results.end() ? nullptr : &*found;
}

// Returns a signal that has arrived, or 0.
int wait(const std::list<Child> &running, int signals) {
    std::vector<pollfd> fds = {{signals, POLLIN, 0}};
    for (const Child &child : running)
        for (const int fd : child.fds())
            fds.push_back({fd, POLLIN, 0});
    ::poll(fds.data(), fds.size(), 2); // a timeout, because a process's children may keep its pipes open
    return base::take_signal(signals);
}

} // namespace

Result run_alone(const Test &test, const RunSettings &settings) {
    std::vector<Result> results;
    run_all({&test, 1}, settings, results, [](const Result &) {});
    return results.front();
}

void run_all(std::span<const Test> tests, const RunSettings &settings, std::vector<Result> &results,
             const std::function<void(const Result &)> &on_result) {
    const auto is_pending = [&](const std::string &name) {
        return !find(results, name) &&
               std::any_of(tests.begin(), tests.end(), [&](const Test &test) { return name == test.name; });
    };
    const auto add = [&](Result result) {
        on_result(result);
        results.push_back(std::move(result));
    };
    std::list<const Test *> waiting;
    for (const Test &test : tests)
        if (!find(results, test.name))
            waiting.push_back(&test);
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);       // orphans of tests are reparented to this process
    std::set<pid_t> alive = base::children(); // children from before exec
    std::list<Child> running;
    while (!waiting.empty() || !running.empty()) {
        for (auto it = waiting.begin(); it != waiting.end() && running.size() < settings.jobs;) {
            const Test &test = **it;
            if (is_pending(test.needs)) {
                ++it;
                continue;
            }
            it = waiting.erase(it);
            const Result *need = find(results, test.needs);
            if (need && need->verdict != Verdict::pass)
                add({test.name, Verdict::skip, fmt::format("needs {}, which has not passed", test.needs)});
            else
                running.emplace_back(test, settings, alive);
        }
        if (const int signal = wait(running, settings.signals))
            throw base::Interrupted(signal, fmt::format("interrupted after {} of {} tests", results.size(),
                                                        results.size() + running.size() + waiting.size()));
        for (auto it = running.begin(); it != running.end();) {
            if (it->poll()) {
                add(it->finish());
                it = running.erase(it);
            } else {
                ++it;
            }
        }
    }
}

} // namespace arhost::conformance
