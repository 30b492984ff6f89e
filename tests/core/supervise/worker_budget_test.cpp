// SPDX-License-Identifier: Apache-2.0
#include "supervise/worker_budget.hpp"

#include "ipc/messages.hpp"

#include <gmock/gmock.h>

using namespace arhost::supervise;
using namespace std::chrono_literals;

namespace {

struct Lines {
    std::vector<std::string> all;
    WorkerBudget budget{[this](arhost_severity severity, const std::string &component, const std::string &text) {
                            all.push_back((severity >= ARHOST_SEVERITY_WARNING ? "warning " : "") + component + ": " +
                                          text);
                        },
                        "tracker"};
};

const WorkerBudget::Clock::time_point start = WorkerBudget::Clock::time_point(1h);

} // namespace

TEST(WorkerBudget, LimitsTheLinesOfEachSecondAndReportsTheirNumber) {
    Lines lines;
    for (int i = 0; i < 1000; ++i) {
        lines.budget.log(ARHOST_SEVERITY_WARNING, "w" + std::to_string(i), start);
        lines.budget.log(ARHOST_SEVERITY_DEBUG, "d" + std::to_string(i), start + 500ms);
        lines.budget.log_death("killed", start + 500ms);
    }
    EXPECT_EQ(lines.all.size(), 3u * WorkerBudget::max_lines) << "no kind displaces another";
    lines.all.clear();
    lines.budget.log(ARHOST_SEVERITY_INFO, "later", start + 1s);
    EXPECT_THAT(lines.all, testing::ElementsAre("tracker: suppressed 900 more log lines within one second",
                                                "warning tracker: suppressed 900 more log lines within one second",
                                                "warning tracker: suppressed 900 more log lines within one second",
                                                "tracker: later"));
}

TEST(WorkerBudget, OnlyCountsLinesThatRepeatOthers) {
    Lines lines;
    for (int i = 0; i < 20; ++i)
        for (const char *text : {"no light", "no marker"})
            lines.budget.log(ARHOST_SEVERITY_ERROR, text, start + i * 1s);
    lines.budget.report_repetitions(start + 20s);
    EXPECT_THAT(lines.all,
                testing::ElementsAre("warning tracker: no light", "warning tracker: no marker",
                                     "warning tracker: no light", "warning tracker: no marker", // printed every 10 s
                                     "warning tracker: lines that repeat others and were not printed: 36"));
}

TEST(WorkerBudget, CutsLongLines) {
    Lines lines;
    lines.budget.log(ARHOST_SEVERITY_INFO, std::string(1 << 20, 'x'), start);
    EXPECT_EQ(lines.all.at(0).size(), std::string("tracker: ").size() + arhost::ipc::messages::max_text);
    lines.budget.log_death(std::string(arhost::ipc::messages::max_text, 'x') + "; restarting it", start);
    EXPECT_THAT(lines.all.at(1), testing::EndsWith("; restarting it"));
}

TEST(WorkerBudget, RegainsNothingWhileTheHostHandlesMessages) {
    Lines lines;
    std::size_t left = WorkerBudget::max_cost;
    auto now = start;
    for (; left >= WorkerBudget::cost_per_second; left -= WorkerBudget::cost_per_second, now += 1s) {
        ASSERT_TRUE(lines.budget.spend(WorkerBudget::cost_per_second - WorkerBudget::cost_per_message, now));
        lines.budget.exclude(1s);
    }
    EXPECT_FALSE(lines.budget.spend(WorkerBudget::cost_per_second, now));
}

TEST(WorkerBudget, LimitsTheNumberAndTheBytesOfMessages) {
    for (const std::size_t size : {std::size_t{0}, std::size_t{120 << 10}}) {
        Lines lines;
        const std::size_t cost = size + WorkerBudget::cost_per_message, in_burst = WorkerBudget::max_cost / cost;
        for (std::size_t i = 0; i < in_burst; ++i)
            ASSERT_TRUE(lines.budget.spend(size, start)) << i;
        EXPECT_FALSE(lines.budget.spend(size, start));
        // After some seconds, it may send again, but no more than it has regained.
        const std::size_t regained = (2 * WorkerBudget::cost_per_second - cost) / cost;
        for (std::size_t i = 0; i < regained; ++i)
            ASSERT_TRUE(lines.budget.spend(size, start + 2s)) << i;
        EXPECT_FALSE(lines.budget.spend(2 * cost, start + 2s));
    }
}
