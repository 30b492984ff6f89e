// SPDX-License-Identifier: Apache-2.0
#include "supervise/worker_budget.hpp"

#include "ipc/messages.hpp"

#include <algorithm>

namespace arhost::supervise {

void WorkerBudget::log(arhost_severity severity, const std::string &text, Clock::time_point now) {
    log(severity >= ARHOST_SEVERITY_WARNING ? warnings_ : other_lines_, severity, text, now);
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
        log_(severity, name_, text.substr(0, ipc::messages::max_text));
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
