// SPDX-License-Identifier: Apache-2.0
//
// Keeps the last warnings and errors of a run for the status document, because nobody may read the console.
#pragma once

#include <arhost/arhost.h>

#include <nlohmann/json_fwd.hpp>

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>

namespace arhost::host {

class MessageLog {
public:
    static constexpr std::size_t max_messages = 100;
    static constexpr std::size_t max_text = 300;       // bytes of a text
    static constexpr std::size_t max_json = 24 * 1024; // the status must fit into a message to a worker

    // Keeps warnings and errors; ignores other messages.
    void add(arhost_severity severity, const std::string &component, const std::string &text,
             std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

    // Returns the messages, the oldest first. Omits the oldest ones if the text would exceed max_json.
    nlohmann::ordered_json to_json() const;

    std::uint64_t last_number() const { return count_; } // number of the last message; 0: none
    // Returns the last error of the component after message number `after`, except the text `known`; "" if there is
    // none.
    std::string error_of(const std::string &component, std::uint64_t after, const std::string &known) const;

private:
    struct Message {
        std::uint64_t number; // from 1
        bool is_error;
        std::string component, text;
        std::chrono::system_clock::time_point time;
    };
    std::deque<Message> messages_;
    std::uint64_t count_ = 0;
};

} // namespace arhost::host
