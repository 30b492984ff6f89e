// SPDX-License-Identifier: Apache-2.0
#include "host/message_log.hpp"

#include "base/text.hpp"

#include <nlohmann/json.hpp>
#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <vector>

namespace arhost::host {

using Json = nlohmann::ordered_json;

void MessageLog::add(arhost_severity severity, const std::string &component, const std::string &text,
                     std::chrono::system_clock::time_point now) {
    if (severity < ARHOST_SEVERITY_WARNING)
        return;
    messages_.push_back(
        {++count_, severity >= ARHOST_SEVERITY_ERROR, component, base::printable(text, max_text), now});
    if (messages_.size() > max_messages)
        messages_.pop_front();
}

Json MessageLog::to_json() const {
    std::vector<Json> newest_first;
    std::size_t size = 0;
    for (auto each = messages_.rbegin(); each != messages_.rend(); ++each) {
        const Message &message = *each;
        using namespace std::chrono;
        const auto ms = duration_cast<milliseconds>(message.time.time_since_epoch()).count() % 1000;
        Json json = {{"number", message.number},
                     {"severity", message.is_error ? "error" : "warning"},
                     {"component", message.component},
                     {"time", fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z",
                                          fmt::gmtime(system_clock::to_time_t(message.time)), ms)},
                     {"text", message.text}};
        size += json.dump().size();
        if (size > max_json)
            break;
        newest_first.push_back(std::move(json));
    }
    std::ranges::reverse(newest_first);
    return newest_first;
}

std::string MessageLog::error_of(const std::string &component, std::uint64_t after, const std::string &known) const {
    const auto found = std::find_if(messages_.rbegin(), messages_.rend(), [&](const Message &message) {
        return message.number > after && message.is_error && message.component == component && message.text != known;
    });
    return found == messages_.rend() ? "" : found->text;
}

} // namespace arhost::host
