// SPDX-License-Identifier: Apache-2.0
#include "host/message_log.hpp"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

using namespace arhost::host;

TEST(MessageLog, KeepsWarningsAndErrors) {
    MessageLog log;
    const std::chrono::system_clock::time_point time(std::chrono::milliseconds(1'700'000'000'042));
    log.add(ARHOST_SEVERITY_INFO, "tracker", "an information");
    log.add(ARHOST_SEVERITY_WARNING, "tracker", "a warning", time);
    log.add(ARHOST_SEVERITY_PLUGIN_MISBEHAVING, "record", "two\nlines", time);
    EXPECT_EQ(log.to_json().dump(),
              R"([{"number":1,"severity":"warning","component":"tracker","time":"2023-11-14T22:13:20.042Z",)"
              R"("text":"a warning"},{"number":2,"severity":"error","component":"record",)"
              R"("time":"2023-11-14T22:13:20.042Z","text":"two lines"}])");
}

TEST(MessageLog, KeepsTheLastHundred) {
    MessageLog log;
    for (std::size_t i = 0; i < 250; ++i)
        log.add(ARHOST_SEVERITY_WARNING, "tracker", std::to_string(i));
    const auto json = log.to_json();
    ASSERT_EQ(json.size(), MessageLog::max_messages);
    EXPECT_EQ(json.front()["text"], "150");
    EXPECT_EQ(json.back()["text"], "249");
    EXPECT_EQ(json.back()["number"], 250);
}

TEST(MessageLog, StaysSmallWhateverAPluginLogs) {
    MessageLog log;
    for (std::size_t i = 0; i < MessageLog::max_messages; ++i)
        log.add(ARHOST_SEVERITY_WARNING, "tracker", std::string(4000, '"'));
    const std::string text = log.to_json().dump();
    EXPECT_LE(text.size(), MessageLog::max_json + MessageLog::max_messages);
    EXPECT_GT(log.to_json().size(), 20u);
}

TEST(MessageLog, NamesTheLastErrorOfAComponent) {
    MessageLog log;
    log.add(ARHOST_SEVERITY_ERROR, "record", "first");
    log.add(ARHOST_SEVERITY_ERROR, "record", "second");
    log.add(ARHOST_SEVERITY_WARNING, "record", "a warning");
    log.add(ARHOST_SEVERITY_ERROR, "tracker", "of another component");
    EXPECT_EQ(log.error_of("record", 0, ""), "second");
    EXPECT_EQ(log.error_of("record", 0, "second"), "first");
    EXPECT_EQ(log.error_of("record", 2, ""), "");
    EXPECT_EQ(log.error_of("snapshot", 0, ""), "");
}
