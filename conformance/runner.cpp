// SPDX-License-Identifier: Apache-2.0
#include "conformance/runner.hpp"

#include "base/orphans.hpp"
#include "base/text.hpp"
#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"

#include <fmt/format.h>

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

std::string place(Call call, const Test &test) {
    constexpr const char *per_frame[] = {"its per-frame call", "read", "track", "render", "write"};
    return " " + ipc::to_text(call, per_frame[test.kind]);
}

// A folder of a test's own.
class ScratchFolder {
public:
    ScratchFolder() {
        std::error_code error;
        std::string pattern = std::filesystem::temp_directory_path(error) / "arhost-conform-XXXXXX";
        if (error)
            throw std::runtime_error("there is no folder for temporary files; set TMPDIR to one that is there");
        if (!::mkdtemp(pattern.data()))
            base::throw_errno("mkdtemp " + pattern);
        path_ = pattern;
    }
    ~ScratchFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    ScratchFolder(const ScratchFolder &) = delete;
    ScratchFolder &operator=(const ScratchFolder &) = delete;
    const std::filesystem::path &path() const { return path_; }

private:
    std::filesystem::path path_;
};

// What a plugin prints: no part of the report, and shown as lines that can't steer a terminal, as many as one reads.
class Printed {
public:
    explicit Printed(int signals) : signals_(signals) {}

    void finish(const std::string &test) {
        if (!line_.empty())
            show();
        if (left_out_ > 0)
            base::write_all(STDERR_FILENO, fmt::format("{}: and {} bytes more\n", test, left_out_), signals_);
    }
    void take(std::string_view bytes) {
        for (const char c : bytes.substr(0, room_))
            if (c == '\n')
                show();
            else
                line_ += c;
        left_out_ += bytes.size() - std::min(bytes.size(), room_);
        room_ -= std::min(bytes.size(), room_);
    }

private:
    void show() { base::write_all(STDERR_FILENO, base::printable(std::exchange(line_, {})) + '\n', signals_); }

    int signals_;
    std::string line_;
    std::size_t room_ = 64 << 10, left_out_ = 0;
};

class Child {
public:
    // `alive`: all of its kind; what has been orphaned meanwhile ends with each of them.
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
        arguments.insert(arguments.end(), subject.policy_options.begin(), subject.policy_options.end());
        ::fcntl(result_.read_end.get(), F_SETFL, O_NONBLOCK);
        ::fcntl(output_.read_end.get(), F_SETFL, O_NONBLOCK);
        const UniqueFd no_input = base::checked(::open("/dev/null", O_RDONLY | O_CLOEXEC), "open /dev/null");
        const int output = output_.write_end.get();
        pid_ = start_process(std::move(arguments),
                             {no_input.get(), output, output, result_.write_end.get(), memory_.fd()}, true);
        result_.write_end.reset();
        output_.write_end.reset();
        ::setpgid(pid_, pid_); // here too: who comes first is open
        alive_.insert(pid_);
    }
    ~Child() {
        if (pid_ > 0)
            end();
    }
    Child(const Child &) = delete;
    Child &operator=(const Child &) = delete;

    // To be waited for; -1: closed, which poll passes over.
    std::array<int, 2> fds() const { return {result_.read_end.get(), output_.read_end.get()}; }
    Clock::time_point deadline() const { return deadline_; }

    // Takes what has come. True once the test is over: it ended, or its time is up, or it tells more than a test can.
    bool poll() {
        const bool ended = ended_ || ::waitpid(pid_, &status_, WNOHANG) == pid_;
        take(); // afterwards: what it wrote at the end is there now
        ended_ = ended;
        return ended_ || Clock::now() >= deadline_ || has_flooded();
    }

    Result finish() {
        const bool in_time = ended_, told = text_.ends_with('\n');
        printed_.finish(test_.name);
        const std::string where = told ? " when the process ended" : place(calls_.read(), test_);
        end();
        Result result;
        if (has_flooded()) {
            result.verdict = Verdict::fail;
            result.message =
                fmt::format("what came on its result pipe, descriptor {}, is no result: more than {} MiB", result_fd,
                            max_told >> 20);
        } else if (in_time && WIFEXITED(status_) && WEXITSTATUS(status_) == EXIT_SUCCESS && told) {
            result = told_result();
        } else if (!in_time) {
            result.verdict = Verdict::timeout;
            result.message = fmt::format("no end after {:.3g} s{}",
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
    static constexpr std::size_t max_told = 32 << 20; // a result has images of some MB
    bool has_flooded() const { return text_.size() > max_told; }

    // The plugin could write there too.
    Result told_result() const {
        try {
            return result_from_json(ipc::Json::parse(text_, [](int depth, auto, auto &) {
                if (depth > 16)
                    throw std::runtime_error("nested too deep");
                return true;
            }));
        } catch (const std::exception &) {
            Result result;
            result.verdict = Verdict::fail;
            result.message = fmt::format("what came on its result pipe, descriptor {}, is no result: '{}'", result_fd,
                                         base::printable(text_.substr(0, 60)));
            return result;
        }
    }
    // Not all, of who writes without end: others are waited for, and time goes by.
    void take() {
        take(result_.read_end, [&](std::string_view bytes) { text_ += bytes; });
        take(output_.read_end, [&](std::string_view bytes) { printed_.take(bytes); });
    }
    static void take(UniqueFd &from, const std::function<void(std::string_view)> &to) {
        char buffer[1 << 16];
        for (int i = 0; i < 16 && from; ++i) {
            const ssize_t count = ::read(from.get(), buffer, sizeof buffer);
            if (count > 0)
                to({buffer, static_cast<std::size_t>(count)});
            else if (count < 0 && errno == EAGAIN)
                break; // its children may keep it open
            else
                from.reset();
        }
    }
    void end() {
        ::kill(-pid_, SIGKILL); // and what the plugin has started
        if (!ended_)
            ::waitpid(pid_, &status_, 0);
        alive_.erase(pid_);
        pid_ = 0;
        base::end_orphans(alive_);
    }

    const Test &test_;
    std::set<pid_t> &alive_;
    Clock::time_point begin_, deadline_;
    ScratchFolder scratch_; // goes once the process is gone
    ipc::SharedMemory memory_;
    CallPage calls_;
    Pipe result_, output_;
    Printed printed_;
    pid_t pid_ = 0;
    std::string text_;
    bool ended_ = false;
    int status_ = 0;
};

const Result *find(const std::vector<Result> &results, const std::string &test) {
    const auto found = std::find_if(results.begin(), results.end(), [&](const Result &r) { return r.test == test; });
    return found == results.end() ? nullptr : &*found;
}

// Returns the signal that has come meanwhile; 0: none.
int wait(const std::list<Child> &running, int signals) {
    std::vector<pollfd> fds = {{signals, POLLIN, 0}};
    for (const Child &child : running)
        for (const int fd : child.fds())
            fds.push_back({fd, POLLIN, 0});
    ::poll(fds.data(), fds.size(), 2); // an end of a process closes no pipe that its children hold
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
    const auto is_waited_for = [&](const std::string &name) {
        return !find(results, name) &&
               std::any_of(tests.begin(), tests.end(), [&](const Test &test) { return name == test.name; });
    };
    const auto take = [&](Result result) {
        on_result(result);
        results.push_back(std::move(result));
    };
    std::list<const Test *> waiting;
    for (const Test &test : tests)
        if (!find(results, test.name))
            waiting.push_back(&test);
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);       // what a test leaves behind comes here
    std::set<pid_t> alive = base::children(); // of who became this program by exec
    std::list<Child> running;
    while (!waiting.empty() || !running.empty()) {
        for (auto it = waiting.begin(); it != waiting.end() && running.size() < settings.jobs;) {
            const Test &test = **it;
            if (is_waited_for(test.needs)) {
                ++it;
                continue;
            }
            it = waiting.erase(it);
            const Result *need = find(results, test.needs);
            if (need && need->verdict != Verdict::pass)
                take({test.name, Verdict::skip, fmt::format("needs {}, which has not passed", test.needs)});
            else
                running.emplace_back(test, settings, alive);
        }
        if (const int signal = wait(running, settings.signals))
            throw base::Interrupted(signal, fmt::format("interrupted after {} of {} tests", results.size(),
                                                        results.size() + running.size() + waiting.size()));
        for (auto it = running.begin(); it != running.end();) {
            if (it->poll()) {
                take(it->finish());
                it = running.erase(it);
            } else {
                ++it;
            }
        }
    }
}

} // namespace arhost::conformance
