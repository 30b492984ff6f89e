// SPDX-License-Identifier: Apache-2.0
//
// Limits what a worker can make the host do: handle messages, and write log lines. The budget belongs to a component,
// so a restart of its worker does not renew it.
#pragma once

#include "ipc/reactor.hpp"
#include "supervise/launcher.hpp"

#include <map>

namespace arhost::supervise {

class WorkerBudget {
public:
    using Clock = ipc::Reactor::Clock;

    // Lines per second, separately for deaths, warnings (and errors) and other lines, so that none displaces another.
    static constexpr int max_lines = 100;
    // Cost of messages, in bytes. The largest amount that arhost-worker lets its plugin log costs far less.
    static constexpr std::size_t cost_per_message = 512, cost_per_second = 2 << 20, max_cost = 16 << 20;

    WorkerBudget(LogFunction log, std::string name) : log_(std::move(log)), name_(std::move(name)) {}
    ~WorkerBudget() {
        report_repetitions();
        report_suppressed_lines();
    }
    WorkerBudget(const WorkerBudget &) = delete;
    WorkerBudget &operator=(const WorkerBudget &) = delete;

    // Logs a line that a worker sent or caused. Lines beyond the limit are only counted; their number is logged
    // before the next line of a later second. A line that was already printed in the last 10 s is also only counted.
    void log(arhost_severity severity, const std::string &text, Clock::time_point now = Clock::now());
    // Logs a warning about the death of a worker. The host has composed it from texts of limited size.
    void log_death(const std::string &text, Clock::time_point now = Clock::now());
    // Logs the number of repeated lines.
    void report_repetitions(Clock::time_point now = Clock::now());

    // Deducts the cost of a message. Returns false if the budget is exhausted: it holds max_cost, and regains
    // cost_per_second.
    bool spend(std::size_t message_bytes, Clock::time_point now = Clock::now());
    // Call this after handling messages: the budget regains nothing for the time that this took. Otherwise, a flood
    // would not exhaust the budget if the host handled messages more slowly than they arrive.
    void exclude(Clock::duration handling) { last_spent_ += handling; }

private:
    struct LineCount { // lines within the current second
        int logged = 0, suppressed = 0;
    };
    void log(LineCount &lines, arhost_severity severity, const std::string &text, Clock::time_point now);
    void report_suppressed_lines();

    LogFunction log_;
    std::string name_;
    Clock::time_point second_ends_{}, last_spent_{};
    LineCount other_lines_, warnings_, deaths_;
    std::map<std::pair<arhost_severity, std::string>, Clock::time_point>
        recent_lines_;                  // by severity and text: the time of printing
    std::uint64_t repetitions_[2] = {}; // repeated lines that were not printed; [1]: warnings and errors
    double left_ = max_cost;
};

} // namespace arhost::supervise
