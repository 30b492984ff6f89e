// SPDX-License-Identifier: Apache-2.0
#include "supervise/worker_budget.hpp"

#include "ipc/messages.hpp"

#include <algorithm>
#include <utility>

namespace arhost::supervise {

void WorkerBudget::log(arhost_severity severity, const std::string &text, Clock::time_point now) {
    constexpr std::size_t max_recent_lines = 32;
    std::erase_if(recent_lines_, [&](const auto &line) { return now - line.second >= std::chrono::seconds(10); });
    if (!recent_lines_.try_emplace({severity, text}, now).second) {
        ++repetitions_[severity >= ARHOST_SEVERITY_WARNING];
        return;
    }
    if (recent_lines_.size() > max_recent_lines)
        recent_lines_.clear();
    log(severity >= ARHOST_SEVERITY_WARNING ? warnings_ : other_lines_, severity,
        text.substr(0, ipc::messages::max_text), now);
}

void WorkerBudget::report_repetitions(Clock::time_point now) {
    for (const bool are_warnings : {false, true})
        if (const std::uint64_t count = std::exchange(repetitions_[are_warnings], 0))
            log(are_warnings ? warnings_ : other_lines_,
                are_warnings ? ARHOST_SEVERITY_WARNING : ARHOST_SEVERITY_DEBUG,
                "lines that repeat others and were not printed: " + std::to_string(count), now);
}

void WorkerBudget::log_death(const std::string &text, Clock::time_point now) {
    log(deaths_, ARHOST_SEVERITY_WARNING, text, now);
}

void WorkerBudget::log(LineCount &lines, arhost_severity severity, const std::string &text, Clock::time_point now) {
    if (now >= second_ends_) {
        report_suppressed_lines();
        second_ends_ = now + std::chrono::seconds(1);
    }
    if (lines.logged++ < max_lines)
        log_(severity, name_, text);
    else
        ++lines.suppressed;
}

void WorkerBudget::report_suppressed_lines() {
    for (const auto &[lines, severity] : {std::pair{&other_lines_, ARHOST_SEVERITY_DEBUG},
                                          {&warnings_, ARHOST_SEVERITY_WARNING},
                                          {&deaths_, ARHOST_SEVERITY_WARNING}}) {
        if (lines->suppressed > 0)
            log_(severity, name_,
                 "suppressed " + std::to_string(lines->suppressed) + " more log lines within one second");
        *lines = {};
    }
}

bool WorkerBudget::spend(std::size_t message_bytes, Clock::time_point now) {
    const double gained =
        static_cast<double>(cost_per_second) * std::chrono::duration<double>(now - last_spent_).count();
    left_ = std::min(left_ + gained, static_cast<double>(max_cost)) -
            static_cast<double>(message_bytes + cost_per_message);
    last_spent_ = now;
    return left_ >= 0;
}

} // namespace arhost::supervise
