// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost in a scratch folder and gives access to its results.
#pragma once

#include "plugin_under_test.hpp"
#include "processes.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <waiting.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <set>
#include <source_location>
#include <sstream>
#include <sys/wait.h>
#include <unistd.h>

namespace arhost::test {

inline std::string read_file(const std::filesystem::path &file) {
    std::ifstream stream(file, std::ios::binary);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
}

class ArhostRun {
public:
    // Writes the configuration to run.yaml in the scratch folder, which is arhost's working directory.
    explicit ArhostRun(const std::string &yaml = "") {
        if (!yaml.empty())
            write("run.yaml", yaml);
    }
    ~ArhostRun() {
        if (pid_ > 0) {
            ::kill(pid_, SIGKILL);
            ::waitpid(pid_, nullptr, 0);
        }
    }

    std::filesystem::path path(const std::string &name) const { return folder_.path() / name; }
    void write(const std::string &name, const std::string &text) const {
        std::filesystem::create_directories(path(name).parent_path());
        std::ofstream(path(name), std::ios::binary) << text;
    }
    std::string read(const std::string &name) const { return read_file(path(name)); }
    bool exists(const std::string &name) const { return std::filesystem::exists(path(name)); }
    nlohmann::json stats() const { return nlohmann::json::parse(read("stats.json")); }

    // Starts `arhost ARGUMENTS`. `prepare` is called in the child process before exec.
    void start(
        std::vector<std::string> arguments = {"--config", "run.yaml"}, const std::function<void()> &prepare = [] {}) {
        pid_ = ::fork();
        if (pid_ == 0) {
            if (::chdir(folder_.path().c_str()) != 0)
                ::_exit(126);
            const int out = ::open("output.txt", O_CREAT | O_WRONLY | O_TRUNC | O_APPEND, 0644);
            ::dup2(out, STDOUT_FILENO);
            ::dup2(out, STDERR_FILENO);
            prepare();
            ::setenv("ARHOST_PLUGIN_PATH", arhost::test::test_plugin_directory().c_str(), 1);
            arguments.insert(arguments.begin(), arhost::test::build_directory() + "/bin/arhost");
            std::vector<char *> argv;
            for (std::string &argument : arguments)
                argv.push_back(argument.data());
            argv.push_back(nullptr);
            ::execv(argv[0], argv.data());
            ::_exit(127);
        }
    }
    // Waits for arhost to exit. Returns its exit status, 128 + the number of the signal that killed it, or -1 if it
    // is still running after `limit`.
    int wait(std::chrono::seconds limit = std::chrono::seconds(100)) {
        int status = 0;
        if (!arhost::test::eventually([&] { return ::waitpid(pid_, &status, WNOHANG) == pid_; }, limit))
            return -1;
        pid_ = 0;
        return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
    int run(std::vector<std::string> arguments = {"--config", "run.yaml"}) {
        start(std::move(arguments));
        return wait();
    }
    // Runs `arhost ARGUMENTS` and expects its exit status, and that its output contains all texts.
    void expect(const std::vector<std::string> &arguments, int status, const std::vector<std::string> &texts,
                const std::source_location &caller = std::source_location::current()) {
        const testing::ScopedTrace trace(caller.file_name(), static_cast<int>(caller.line()), "called from here");
        EXPECT_EQ(run(arguments), status) << output();
        for (const std::string &text : texts)
            EXPECT_THAT(output(), testing::HasSubstr(text));
    }
    void expect(int status, const std::vector<std::string> &texts,
                const std::source_location &caller = std::source_location::current()) {
        expect({"--config", "run.yaml"}, status, texts, caller);
    }
    bool running() const {
        siginfo_t info{};
        return pid_ > 0 && ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
               info.si_pid == 0;
    }
    // Waits for a condition. Returns false if the run ends before.
    template <class Condition> bool eventually(const Condition &condition) const {
        bool is_met = false;
        (void)arhost::test::eventually([&] { return (is_met = condition()) || !running(); });
        return is_met || condition();
    }
    // Waits until a file has so many lines; sink_counter writes one for each frame. Returns false if the run ends
    // before.
    bool wait_for_lines(std::size_t count, const std::string &file = "counted.txt") const {
        return eventually([&] { return lines(file) >= count; });
    }
    bool wait_for_output(const std::string &text) const {
        return eventually([&] { return output().find(text) != std::string::npos; });
    }
    // Returns the pid of a plugin's worker once it has started, and 0 if the run ends before.
    pid_t wait_for_worker(const std::string &plugin) const {
        pid_t pid = 0;
        (void)eventually([&] { return (pid = worker(plugin)) != 0; });
        return pid;
    }
    std::size_t lines(const std::string &file = "counted.txt") const {
        return static_cast<std::size_t>(std::ranges::count(read(file), '\n'));
    }

    std::string output() const { return read("output.txt"); }
    // The output without lines about layers of the sandbox that this machine lacks.
    std::string messages() const {
        std::istringstream lines(output());
        std::string kept;
        for (std::string line; std::getline(lines, line);)
            if (line.find(": sandbox: ") == std::string::npos)
                kept += line + "\n";
        return kept;
    }
    pid_t pid() const { return pid_; }
    pid_t launcher() const {
        const std::vector<pid_t> found = children(pid_);
        return found.empty() ? 0 : found.front();
    }

    // Returns the pid of a plugin's current worker, whose process name is the plugin's id; 0 if there is none.
    pid_t worker(const std::string &plugin) const {
        for (const pid_t launcher : children(pid_))
            for (const pid_t candidate : children(launcher))
                if (name_of(candidate) == plugin.substr(0, 15))
                    return candidate;
        return 0;
    }
    std::vector<pid_t> workers() const {
        std::vector<pid_t> all;
        for (const pid_t launcher : children(pid_))
            for (const pid_t child : children(launcher))
                if (name_of(child) != "arhost-init") // the first process of a worker's PID namespace
                    all.push_back(child);
        return all;
    }

private:
    static std::vector<pid_t> children(pid_t pid) {
        std::ifstream list("/proc/" + std::to_string(pid) + "/task/" + std::to_string(pid) + "/children");
        std::vector<pid_t> found;
        for (pid_t child; list >> child;)
            found.push_back(child);
        return found;
    }
    static std::string name_of(pid_t pid) {
        std::string name = read_file("/proc/" + std::to_string(pid) + "/comm");
        if (!name.empty())
            name.pop_back();
        return name;
    }

    ScratchFolder folder_;
    pid_t pid_ = 0;
};

// Like kill(2), but throws if pid is 0, because kill(0, …) signals the entire process group.
inline void send_signal(pid_t pid, int signal) {
    if (pid <= 0)
        throw std::runtime_error("no process to signal");
    ::kill(pid, signal);
}

// Kills the worker of each plugin, 60 frames after the previous one.
inline void kill_in_turn(const ArhostRun &run, std::initializer_list<const char *> plugins) {
    std::size_t at = 0;
    for (const char *plugin : plugins) {
        run.wait_for_lines(at += 60);
        const pid_t worker = run.worker(plugin);
        ASSERT_NE(worker, 0) << plugin << "\n" << run.output();
        send_signal(worker, SIGKILL);
    }
}

inline const char *const small_scene = "version: 1\naxes: z-up\nmaterials: {m: {model: diffuse, diffuse: 0.5}}\n"
                                       "objects: [{sphere: {centre: [0, 0, 10], radius: 10}, material: m}]\n";

// The options of the plugins *_counter, and more lines of their configuration.
struct Counting {
    std::string mode = "lockstep";
    std::string source{}, tracker{}, raytracer{}, more{};
    // Only a plugin that hangs on purpose exceeds it, also on a busy machine.
    std::chrono::milliseconds deadline = std::chrono::minutes(1);
};
// Returns a configuration with the plugins *_counter. The run writes one line per frame to counted.txt.
inline std::string counting(const Counting &options) {
    const std::string deadline_ms = "deadline_ms: " + std::to_string(options.deadline.count());
    return "version: 1\nmode: " + options.mode + "\nsource: {plugin: source_counter, options: {" + options.source +
           "}}\ntracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}], options: "
           "{" +
           options.tracker + "}, " + deadline_ms +
           "}\nraytracer: {plugin: rt_counter, scene: scene.yaml, options: {" + options.raytracer + "}, " +
           deadline_ms + "}\noutputs: [{plugin: sink_counter, path: counted.txt}]\nstats: stats.json\n" +
           options.more;
}
class CountingRun : public ArhostRun {
public:
    explicit CountingRun(const Counting &options) : ArhostRun(counting(options)) { write("scene.yaml", small_scene); }
};

struct CountedLine {
    std::uint64_t sequence, video;
    std::string overlay;
    int kind;
};
inline std::vector<CountedLine> counted(const ArhostRun &run, const std::string &file = "counted.txt") {
    std::istringstream text(run.read(file));
    std::vector<CountedLine> lines;
    for (CountedLine line; text >> line.sequence >> line.video >> line.overlay >> line.kind;)
        lines.push_back(line);
    return lines;
}

// Expects frames in order, and with each frame no overlay but its own. Returns the numbers of the frames without one.
inline std::set<std::uint64_t> expect_own_overlays(const std::vector<CountedLine> &lines) {
    std::set<std::uint64_t> plain;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        const CountedLine &line = lines[i];
        EXPECT_EQ(line.video, line.sequence);
        EXPECT_TRUE(i == 0 || line.sequence > lines[i - 1].sequence) << line.sequence;
        if (line.overlay == "none")
            plain.insert(line.sequence);
        else
            EXPECT_EQ(line.overlay, std::to_string(line.sequence)) << "the overlay belongs to another frame";
    }
    return plain;
}
// Also expects that no frame is missing.
inline std::set<std::uint64_t> expect_all_frames(const ArhostRun &run, std::uint64_t frames,
                                                 const std::string &file = "counted.txt") {
    const auto lines = counted(run, file);
    EXPECT_EQ(lines.size(), frames) << run.output();
    EXPECT_TRUE(lines.empty() || lines.back().sequence + 1 == lines.size()) << "a frame is missing";
    return expect_own_overlays(lines);
}

// The column shown_s of a timeline: the times since the first frame arrived. Differences between them would depend on
// how long the composition of the earlier frame took.
inline std::vector<double> shown_seconds(const std::string &csv) {
    std::istringstream text(csv);
    std::vector<double> seconds;
    std::string line;
    std::getline(text, line); // the names of the columns
    while (std::getline(text, line))
        seconds.push_back(std::stod(line.substr(line.find(',') + 1)));
    return seconds;
}

} // namespace arhost::test
