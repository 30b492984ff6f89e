// SPDX-License-Identifier: Apache-2.0
#include "ipc/channel.hpp"
#include "ipc/message.hpp"

#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/socket.h>

using namespace arhost::ipc;

TEST(Channel, CarriesMessagesAndDescriptors) {
    auto [host, worker] = Channel::make_pair();
    int pipe_ends[2];
    ASSERT_EQ(::pipe(pipe_ends), 0);
    const arhost::base::UniqueFd read_end(pipe_ends[0]), write_end(pipe_ends[1]);
    ASSERT_TRUE(host.send({{"type", "attach"}, {"generation", 7}}, {write_end.get()}));
    Message message;
    ASSERT_EQ(worker.receive(message, 1000), ReceiveState::message);
    EXPECT_EQ(message.body["generation"], 7);
    ASSERT_EQ(message.fds.size(), 1u);
    ASSERT_EQ(::write(message.fds[0].get(), "x", 1), 1);
    char byte = 0;
    EXPECT_EQ(::read(read_end.get(), &byte, 1), 1);
}

TEST(Channel, RejectsMalformedMessages) {
    auto [host, worker] = Channel::make_pair();
    Message message;
    for (const std::string text : {"{", "[1]", "{\"kind\": 1}", "{\"type\": 3}", "\xff\xfe"}) {
        ASSERT_GT(::send(worker.fd(), text.data(), text.size(), 0), 0);
        EXPECT_EQ(host.receive(message, 1000), ReceiveState::malformed) << text;
    }
    const std::string deep(100'000, '[');
    ASSERT_GT(::send(worker.fd(), deep.data(), deep.size(), 0), 0);
    EXPECT_EQ(host.receive(message, 1000), ReceiveState::malformed);
}

TEST(Channel, RejectsAMessageWithTooManyDescriptors) {
    auto [host, worker] = Channel::make_pair();
    std::vector<int> fds(8, STDERR_FILENO);
    char text[] = "{\"type\": \"log\"}";
    iovec part{text, sizeof text - 1};
    alignas(cmsghdr) char ancillary[CMSG_SPACE(8 * sizeof(int))] = {};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = ancillary;
    header.msg_controllen = sizeof ancillary;
    cmsghdr *control = CMSG_FIRSTHDR(&header);
    control->cmsg_level = SOL_SOCKET;
    control->cmsg_type = SCM_RIGHTS;
    control->cmsg_len = CMSG_LEN(8 * sizeof(int));
    std::copy(fds.begin(), fds.end(), reinterpret_cast<int *>(CMSG_DATA(control)));
    ASSERT_GT(::sendmsg(worker.fd(), &header, 0), 0);
    Message message;
    EXPECT_EQ(host.receive(message, 1000), ReceiveState::malformed);
}

TEST(Channel, DoesNotBlockIfThePeerDoesNotReceive) {
    auto [host, worker] = Channel::make_pair();
    const Json body = {{"type", "log"}, {"text", std::string(10'000, 'x')}};
    int sent = 0;
    while (host.send(body, {}, false))
        ++sent;
    EXPECT_GT(sent, 0);
    EXPECT_EQ(errno, EAGAIN);
}

TEST(Channel, ReportsAClosedPeer) {
    auto [host, worker] = Channel::make_pair();
    worker.close();
    Message message;
    EXPECT_EQ(host.receive(message, 1000), ReceiveState::closed);
    EXPECT_FALSE(host.send({{"type", "stop"}}));
}
