// SPDX-License-Identifier: Apache-2.0
#include "payload.hpp"

#include <gmock/gmock.h>

#include <random>

using namespace arhost::uvc;
using testing::ElementsAre;
using Octets = std::vector<std::uint8_t>;

namespace {

constexpr std::uint8_t id_0 = 0x80, id_1 = 0x81, end_of_frame = 2, still = 0x20, error = 0x40;

Octets payload(unsigned info, const Octets &data) {
    Octets bytes = {2, static_cast<std::uint8_t>(info)};
    bytes.insert(bytes.end(), data.begin(), data.end());
    return bytes;
}

struct Seen {
    Octets bytes;
    Damage damage;
    bool operator==(const Seen &) const = default;
};

class Assembly : public testing::Test {
protected:
    void add(unsigned info, const Octets &data, std::int64_t arrival_ns = 0) {
        assembler_.add_payload(payload(info, data), arrival_ns);
    }
    std::vector<Seen> frames_;
    std::vector<AssembledFrame> all_;
    FrameAssembler assembler_{4, 4, [this](AssembledFrame &frame) {
                                  frames_.push_back({frame.bytes, frame.damage});
                                  all_.push_back(frame);
                              }};
};

} // namespace

TEST(PayloadHeader, HasPresentationTimeAndClock) {
    const Octets bytes = {12, 0x8f, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0xff};
    const auto header = parse_payload_header(bytes);
    ASSERT_TRUE(header);
    EXPECT_EQ(header->size, 12u);
    EXPECT_TRUE(header->frame_id);
    EXPECT_TRUE(header->ends_frame);
    EXPECT_FALSE(header->has_error);
    EXPECT_EQ(header->presentation_ticks, 0x04030201u);
    EXPECT_EQ(header->clock_ticks, 0x08070605u);
}

TEST(PayloadHeader, TheClockFollowsDirectlyWithoutPresentationTime) {
    EXPECT_EQ(parse_payload_header(Octets{8, 0x88, 5, 6, 7, 8, 9, 10})->clock_ticks, 0x08070605u);
}

TEST(PayloadHeader, FieldsBeyondItsEndAreIgnored) {
    const auto header = parse_payload_header(Octets{2, 0x8c, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
    ASSERT_TRUE(header);
    EXPECT_FALSE(header->presentation_ticks);
    EXPECT_FALSE(header->clock_ticks);
    EXPECT_TRUE(parse_payload_header(Octets{6, 0x8c, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10})->presentation_ticks);
}

TEST(PayloadHeader, IsInvalidIfItsLengthIs) {
    EXPECT_FALSE(parse_payload_header({}));
    EXPECT_FALSE(parse_payload_header(Octets{2}));
    EXPECT_FALSE(parse_payload_header(Octets{0, 0x80, 0}));
    EXPECT_FALSE(parse_payload_header(Octets{1, 0x80, 0}));
    EXPECT_FALSE(parse_payload_header(Octets{4, 0x80, 0}));
    EXPECT_TRUE(parse_payload_header(Octets{3, 0x80, 0}));
}

TEST_F(Assembly, JoinsPayloadsUpToTheEndOfTheFrame) {
    add(id_0, {1, 2});
    EXPECT_TRUE(frames_.empty());
    add(id_0 | end_of_frame, {3, 4});
    add(id_1 | end_of_frame, {5, 6, 7, 8});
    EXPECT_THAT(frames_, ElementsAre(Seen{{1, 2, 3, 4}, Damage::none}, Seen{{5, 6, 7, 8}, Damage::none}));
}

TEST_F(Assembly, AChangedFrameIdEndsTheFrame) {
    add(id_0, {1, 2, 3, 4});
    add(id_1, {5, 6, 7, 8});
    add(id_0, {});
    EXPECT_THAT(frames_, ElementsAre(Seen{{1, 2, 3, 4}, Damage::none}, Seen{{5, 6, 7, 8}, Damage::none}));
}

TEST_F(Assembly, HeadersWithoutDataAreNoFrames) {
    add(id_0, {});
    add(id_0 | end_of_frame, {});
    add(id_1, {});
    EXPECT_TRUE(frames_.empty());
    add(id_1, {1, 2, 3, 4});
    add(id_1 | end_of_frame, {});
    EXPECT_THAT(frames_, ElementsAre(Seen{{1, 2, 3, 4}, Damage::none}));
}

TEST_F(Assembly, DamagedFramesAreMarkedWithTheFirstCause) {
    add(id_0, {1, 2});
    add(id_1 | end_of_frame, {5, 6, 7, 8}); // the rest of the first frame is missing
    add(id_0 | error, {1, 2});
    add(id_0 | end_of_frame, {3, 4});
    add(id_1, {1, 2});
    assembler_.lose_packet();
    add(id_1 | error | end_of_frame, {4});
    add(id_0, {1, 2});
    assembler_.add_payload(Octets{0, 0}, 0);
    add(id_0 | end_of_frame, {3, 4});
    add(id_1 | end_of_frame, {1, 2, 3, 4, 5, 6, 7, 8, 9});
    add(id_0 | end_of_frame, {1, 2, 3, 4});
    EXPECT_THAT(frames_, ElementsAre(Seen{{1, 2}, Damage::truncated}, Seen{{5, 6, 7, 8}, Damage::none},
                                     Seen{{1, 2, 3, 4}, Damage::marked}, Seen{{1, 2, 4}, Damage::lost_packet},
                                     Seen{{1, 2, 3, 4}, Damage::malformed}, Seen{{1, 2, 3, 4}, Damage::oversized},
                                     Seen{{1, 2, 3, 4}, Damage::none}));
    Losses losses;
    for (const Seen &frame : frames_)
        losses.count(frame.damage);
    EXPECT_EQ(losses, (Losses{.marked = 1, .lost_packet = 1, .malformed = 1, .truncated = 1, .oversized = 1}));
}

TEST_F(Assembly, FaultsBetweenFramesDamageNone) {
    assembler_.lose_packet();
    assembler_.add_payload(Octets{0, 0}, 0);
    add(id_0 | still, {9, 9});
    add(id_0 | end_of_frame, {1, 2, 3, 4});
    EXPECT_THAT(frames_, ElementsAre(Seen{{1, 2, 3, 4}, Damage::none}));
}

TEST_F(Assembly, ABulkPayloadMayNeedSeveralTransfers) {
    assembler_.add_bulk(payload(id_0 | end_of_frame, {1}), false, 7);
    assembler_.add_bulk(Octets{0, 3}, false, 8); // data, although it looks like a malformed header
    EXPECT_TRUE(frames_.empty());
    assembler_.add_bulk(Octets{4}, true, 9);
    assembler_.add_bulk({}, true, 10);
    assembler_.add_bulk(payload(id_1 | end_of_frame, {5, 6, 7, 8}), true, 11);
    EXPECT_THAT(frames_, ElementsAre(Seen{{1, 0, 3, 4}, Damage::none}, Seen{{5, 6, 7, 8}, Damage::none}));
    EXPECT_EQ(all_[0].arrival_ns, 7);
}

TEST_F(Assembly, ABulkTransferAfterAMalformedHeaderIsSkipped) {
    assembler_.add_bulk(Octets{0, 3}, false, 8);
    assembler_.add_bulk(payload(id_0 | end_of_frame, {1, 2, 3, 4}), true, 9); // still the malformed payload
    EXPECT_TRUE(frames_.empty());
    assembler_.add_bulk(payload(id_0 | end_of_frame, {1, 2, 3, 4}), true, 9);
    EXPECT_EQ(frames_.size(), 1u);
}

TEST_F(Assembly, TimesAreThoseOfTheFirstPayloadThatHasThem) {
    add(id_0, {1}, 100);
    assembler_.add_payload(Octets{12, 0x8c, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 2}, 200);
    assembler_.add_payload(Octets{12, 0x8e, 3, 0, 0, 0, 4, 0, 0, 0, 0, 0, 3, 4}, 300);
    add(id_1 | end_of_frame, {1, 2, 3, 4}, 400);
    ASSERT_EQ(all_.size(), 2u);
    EXPECT_EQ(all_[0].arrival_ns, 100);
    EXPECT_EQ(all_[0].presentation_ticks, 1u);
    EXPECT_EQ(all_[0].clock_ticks, 2u);
    EXPECT_EQ(all_[0].clock_arrival_ns, 200);
    EXPECT_EQ(all_[1].arrival_ns, 400);
    EXPECT_FALSE(all_[1].presentation_ticks);
    EXPECT_FALSE(all_[1].clock_ticks);
}

TEST(Assembler, FramesStayWithinTheirMaximumWhateverTheCameraSends) {
    std::minstd_rand random(3);
    std::size_t frames = 0;
    FrameAssembler assembler(100, 0, [&](AssembledFrame &frame) {
        ++frames;
        ASSERT_LE(frame.bytes.size(), 100u);
        ASSERT_FALSE(frame.bytes.empty());
    });
    for (int i = 0; i < 20000; ++i) {
        Octets bytes(random() % 60);
        for (std::uint8_t &byte : bytes)
            byte = static_cast<std::uint8_t>(random() >> 8);
        if (!bytes.empty())
            bytes[0] = static_cast<std::uint8_t>(random() % 16);
        if (i % 3)
            assembler.add_payload(bytes, i);
        else
            assembler.add_bulk(bytes, random() % 2, i);
    }
    EXPECT_GT(frames, 1000u);
}
