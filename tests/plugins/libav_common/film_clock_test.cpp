// SPDX-License-Identifier: Apache-2.0
#include "libav_common/film_clock.hpp"

#include <gmock/gmock.h>

#include <vector>

using arhost::libav::FilmClock;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr std::int64_t none = -1; // no time stamp

struct Film {
    const char *name;
    bool has_jumps;
    std::vector<std::int64_t> stamps_ms, times_ms; // one picture every 40 ms
};

std::vector<std::int64_t> times_ms(const Film &film) {
    FilmClock clock(40 * ms);
    std::vector<std::int64_t> times;
    for (const std::int64_t stamp : film.stamps_ms)
        times.push_back(clock.next_ns(stamp == none ? std::nullopt : std::optional(stamp * ms), film.has_jumps) / ms);
    return times;
}

} // namespace

TEST(FilmClock, TimeContinuesAtJumpsButNotAtSingleWrongTimeStamps) {
    for (const Film &film : std::vector<Film>{
             {"without jumps", true, {80, 120, 200, 240}, {80, 120, 200, 240}},
             {"no time stamps", true, {none, none, 500, 540}, {0, 40, 80, 120}},
             {"not in order", true, {0, 80, 40, 120}, {0, 80, 80, 120}},
             {"joined, back", true, {5000, 5040, 0, 40, 80}, {5000, 5040, 5080, 5120, 5160}},
             {"joined, back by 200 ms", true, {5000, 5040, 4840, 4880}, {5000, 5040, 5080, 5120}},
             {"joined, forwards", true, {0, 40, 60000, 60040, 60080}, {0, 40, 80, 120, 160}},
             {"one wrong before a gap", true, {5000, 0, 9000, 9040, 40}, {5000, 5040, 9000, 9040, 9080}},
             {"one wrong, back", true, {3600000, 0, 3600080, 3600120}, {3600000, 3600040, 3600080, 3600120}},
             {"one wrong, back by 1 s",
              true,
              {3600000, 3599000, 3600080, 3600120},
              {3600000, 3600040, 3600080, 3600120}},
             {"one wrong, forwards", true, {0, 60000, 80, 120}, {0, 40, 80, 120}},
             {"two wrong", true, {3600000, 0, 60000000, 3600120}, {3600000, 3600040, 3600080, 3600120}},
             {"one wrong, container without jumps", false, {3600000, 0, 3600080}, {3600000, 3600000, 3600080}},
             {"a long picture, container without jumps", false, {0, 40, 60000, 60040}, {0, 40, 60000, 60040}},
         })
        EXPECT_EQ(times_ms(film), film.times_ms) << film.name;
}
