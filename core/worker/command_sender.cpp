// SPDX-License-Identifier: Apache-2.0
#include "worker/command_sender.hpp"

#include <nlohmann/json.hpp>

#include <cstring>

namespace arhost::worker {

using namespace ipc;

void CommandSender::enable() {
    const std::lock_guard lock(mutex_);
    enabled_ = true;
}

arhost_status CommandSender::send(const char *command, arhost_take_answer take, void *context) {
    const std::size_t size = command ? ::strnlen(command, ARHOST_MAX_COMMAND_SIZE + 1) : 0;
    if (size > ARHOST_MAX_COMMAND_SIZE || !Json::parse(command, command + size, nullptr, false).is_object())
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    const std::lock_guard lock(mutex_);
    if (!enabled_)
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    if (pending_.size() >= ARHOST_MAX_PENDING_COMMANDS)
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    if (!link_.try_send(messages::Request{next_id_, command}))
        return ARHOST_STATUS_ERROR_IO;
    pending_[next_id_++] = {take, context};
    return ARHOST_STATUS_OK;
}

void CommandSender::deliver(const messages::Answer &answer) {
    Pending pending{};
    {
        const std::lock_guard lock(mutex_);
        const auto found = pending_.find(answer.id);
        if (found == pending_.end())
            throw ProtocolViolation("the host answered a command that was not sent");
        pending = found->second;
        pending_.erase(found);
    }
    if (pending.take)
        pending.take(pending.context, answer.answer.c_str());
}

} // namespace arhost::worker
