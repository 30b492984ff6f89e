// SPDX-License-Identifier: Apache-2.0
#include "base/listening_socket.hpp"

#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>

using namespace arhost::base;
using arhost::test::ScratchFolder;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::ThrowsMessage;

namespace {

bool accepts(const ListeningSocket &socket) {
    const UniqueFd client(::accept4(socket.fd(), nullptr, nullptr, SOCK_CLOEXEC));
    return static_cast<bool>(client);
}

} // namespace

TEST(ListeningSocket, ChecksAddresses) {
    for (const char *valid : {"arhost", "lab-2_b", "/run/a.sock", "127.0.0.1:8080", "localhost:0", "[::1]:65535"})
        EXPECT_EQ(problem_with_address(valid), "") << valid;
    for (const char *invalid : {"", "a b", "a/b", "8080", "example.org:80", "127.0.0.1:", "127.0.0.1:65536", "::1:80",
                                "127.0.0.1:-1", "[::1]", "127.0.0.1:80x"})
        EXPECT_THAT(problem_with_address(invalid), HasSubstr("ADDRESS:PORT with a port from 0 to 65535")) << invalid;
}

TEST(ListeningSocket, AcceptsConnectionsAtAPath) {
    const ScratchFolder folder;
    const std::string path = folder.path() / "a.sock";
    {
        const ListeningSocket socket(path);
        EXPECT_FALSE(accepts(socket)) << "must not block";
        const UniqueFd client = connect_to(path);
        EXPECT_TRUE(accepts(socket));
        struct stat status {};
        ASSERT_EQ(::stat(path.c_str(), &status), 0);
        EXPECT_EQ(status.st_mode & 0777, 0600u);
    }
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_THROW(connect_to(path), std::system_error);
}

TEST(ListeningSocket, AMovedSocketKeepsItsFile) {
    const ScratchFolder folder;
    const std::string path = folder.path() / "a.sock";
    ListeningSocket first(path);
    const ListeningSocket second(std::move(first));
    const UniqueFd client = connect_to(path);
    EXPECT_TRUE(accepts(second));
}

TEST(ListeningSocket, RejectsAnAddressInUse) {
    const ScratchFolder folder;
    const ListeningSocket socket(folder.path() / "a.sock");
    EXPECT_THAT([&] { ListeningSocket(folder.path() / "a.sock"); },
                ThrowsMessage<std::runtime_error>(HasSubstr("another run uses it")));
    const ListeningSocket port("127.0.0.1:0");
    EXPECT_THAT(port.address(), MatchesRegex("127.0.0.1:[1-9][0-9]*"));
    EXPECT_THAT([&] { ListeningSocket{port.address()}; },
                ThrowsMessage<std::runtime_error>(HasSubstr("another program uses it")));
}

TEST(ListeningSocket, NeverReplacesAFileThatIsNotASocket) {
    const ScratchFolder folder;
    const std::string path = folder.path() / "a.sock";
    std::ofstream(path) << "kept";
    EXPECT_THROW(ListeningSocket{path}, std::runtime_error);
    EXPECT_TRUE(std::filesystem::is_regular_file(path));
}

TEST(ListeningSocket, RejectsAPathThatIsTooLong) {
    EXPECT_THAT([] { ListeningSocket("/tmp/" + std::string(200, 'a')); },
                ThrowsMessage<std::runtime_error>(HasSubstr("longer than 107 bytes")));
}
