// SPDX-License-Identifier: Apache-2.0
#include "libav_common/log.hpp"

#include <array>
#include <utility>

namespace arhost {

namespace {

// The callback has no user argument, so the current log must be global. It is the most recently created LibavLog.
struct {
    std::mutex mutex;
    LibavLog *log = nullptr;
} active;

} // namespace

LibavLog::LibavLog(const Host &host, std::string (*hides)(const std::string &text)) : host_(host), hides_(hides) {
    std::lock_guard lock(active.mutex);
    active.log = this;
    av_log_set_callback(&on_message);
}

LibavLog::~LibavLog() {
    std::lock_guard lock(active.mutex);
    if (active.log == this)
        active.log = nullptr;
}

std::string LibavLog::take_reason() {
    std::lock_guard lock(mutex_);
    const std::string error = std::exchange(last_error_, {});
    return error.empty() ? "" : " (" + error + ")";
}

void LibavLog::on_message(void *context, int level, const char *format, va_list arguments) {
    if (level > AV_LOG_INFO)
        return;
    std::lock_guard lock(active.mutex);
    if (!active.log)
        return;
    LibavLog &log = *active.log;
    std::array<char, 8192> line{}; // a truncated URL would hide where its password ends
    av_log_format_line2(context, level, format, arguments, line.data(), line.size(), &log.print_prefix_);
    std::string text = line.data();
    while (!text.empty() && (text.back() == '\n' || text.back() == '\r'))
        text.pop_back();
    if (text.empty())
        return;
    if (log.hides_)
        text = log.hides_(text);
    log.host_.log(ARHOST_SEVERITY_DEBUG, "libav: " + text);
    if (level <= AV_LOG_ERROR) {
        // "[mov,mp4 @ 0x55…] moov atom not found": drop the prefix with the address.
        const std::size_t end_of_prefix = text.starts_with('[') ? text.find("] ") : std::string::npos;
        std::lock_guard own(log.mutex_);
        log.last_error_ = end_of_prefix == std::string::npos ? text : text.substr(end_of_prefix + 2);
    }
}

} // namespace arhost
