// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <span>
#include <sys/wait.h>
#include <utility>

namespace arhost::test {

// Runs a program in a folder of its own.
class ProgramTest : public testing::Test {
protected:
    ProgramTest() { std::filesystem::create_directory(folder()); }

    static std::string program(const std::string &name) { return build_directory() + "/bin/" + name + " "; }
    std::filesystem::path folder() const { return scratch_.path() / "work"; }
    // Runs a command without a display, and returns its exit status.
    int execute(const std::string &command) const {
        const std::string output = (scratch_.path() / "output.txt").string();
        const int status = std::system(
            ("cd " + folder().string() + " && unset DISPLAY WAYLAND_DISPLAY && " + command + " > " + output + " 2>&1")
                .c_str());
        return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
    // Returns the output of the last command.
    std::string printed() const { return read("../output.txt"); }
    testing::AssertionResult succeeds(const std::string &command) const {
        const int status = execute(command);
        return status == 0 ? testing::AssertionSuccess()
                           : testing::AssertionFailure() << "exit status " << status << ": " << printed();
    }
    // Expects that a program rejects each of the arguments with this message, and writes no file.
    void expect_rejected(const std::string &program,
                         std::span<const std::pair<std::string, const char *>> cases) const {
        const auto before = files();
        for (const auto &[arguments, message] : cases) {
            SCOPED_TRACE(arguments);
            EXPECT_EQ(execute(program + arguments), 2);
            EXPECT_THAT(printed(), testing::HasSubstr(message));
            EXPECT_EQ(files(), before);
        }
    }

    std::string read(const std::filesystem::path &file) const {
        std::ifstream stream(folder() / file, std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }
    void write(const std::filesystem::path &file, const std::string &text) const {
        std::ofstream(folder() / file) << text;
    }
    std::vector<std::string> files() const {
        std::vector<std::string> names;
        for (const auto &entry : std::filesystem::directory_iterator(folder()))
            names.push_back(entry.path().filename());
        std::ranges::sort(names);
        return names;
    }

private:
    ScratchFolder scratch_;
};

} // namespace arhost::test
