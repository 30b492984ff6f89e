// SPDX-License-Identifier: Apache-2.0
#include "cli/console.hpp"

#include <gmock/gmock.h>

#include <fcntl.h>
#include <thread>
#include <unistd.h>

using namespace arhost::cli;
using testing::HasSubstr;

namespace {

// Redirects stderr of this process to a pipe.
class Stderr {
public:
    Stderr() : before_(::dup(STDERR_FILENO)) {
        if (::pipe2(ends_, O_CLOEXEC) != 0)
            std::abort();
        ::dup2(ends_[1], STDERR_FILENO);
    }
    ~Stderr() {
        restore();
        ::close(ends_[0]);
    }
    Stderr(const Stderr &) = delete;
    Stderr &operator=(const Stderr &) = delete;

    void restore() {
        if (before_ < 0)
            return;
        ::dup2(before_, STDERR_FILENO);
        ::close(before_);
        ::close(ends_[1]);
        before_ = -1;
    }
    // Returns everything that was written before restore().
    std::string read_all() {
        std::string text;
        char bytes[4096];
        for (ssize_t count; (count = ::read(ends_[0], bytes, sizeof bytes)) > 0;)
            text.append(bytes, static_cast<std::size_t>(count));
        return text;
    }

private:
    int before_, ends_[2] = {};
};

} // namespace

TEST(Console, PrintsEachMessageOnOneLine) {
    Stderr stream;
    {
        Console console(false);
        console.log(ARHOST_SEVERITY_WARNING, "tracker", "two\nlines\033[2J");
        console.log(ARHOST_SEVERITY_DEBUG, "tracker", "not shown");
        console.log(ARHOST_SEVERITY_HINT, "source", "a hint");
        console.log(ARHOST_SEVERITY_PLUGIN_MISBEHAVING, "source", "no frame");
    }
    stream.restore();
    EXPECT_EQ(
        stream.read_all(),
        "warning: tracker: two lines [2J\ninfo: source: a hint\nerror: source: the plugin misbehaves: no frame\n");
}

TEST(Console, DropsLinesInsteadOfBlockingAndReportsTheirNumber) {
    Stderr stream;
    std::string text;
    std::thread reader;
    {
        Console console(true);
        const std::string long_line(200, 'x');
        for (int i = 0; i < 5000; ++i) // much more than the 64 KiB that fit in a pipe
            console.log(ARHOST_SEVERITY_INFO, "tracker", long_line);
        reader = std::thread([&] { text = stream.read_all(); });
    }
    stream.restore();
    reader.join();
    EXPECT_THAT(text, HasSubstr(" lines were dropped because stderr was not read\n"));
}
