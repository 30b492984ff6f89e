// SPDX-License-Identifier: Apache-2.0
//
// Forwards libav's log messages to the host.
#pragma once

extern "C" {
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include "libav_common/libav_pointers.hpp"

#include <arhost-cpp/plugin.hpp>

#include <mutex>
#include <string>

namespace arhost {

// libav has one log callback per process. While this object exists, libav's messages go to the host as debug messages
// instead of stderr.
class LibavLog {
public:
    // `hides` replaces secrets, such as passwords, in each message.
    explicit LibavLog(const Host &host, std::string (*hides)(const std::string &text) = nullptr);
    ~LibavLog();
    LibavLog(const LibavLog &) = delete;
    LibavLog &operator=(const LibavLog &) = delete;

    // Returns the last error since the previous call, to be appended to an error message: " (moov atom not found)".
    // Returns "" if there was no error.
    std::string take_reason();

private:
    static void on_message(void *context, int level, const char *format, va_list arguments);

    Host host_;
    std::string (*hides_)(const std::string &text);
    std::mutex mutex_;
    std::string last_error_;
    int print_prefix_ = 1; // state of av_log_format_line2: 1 if the next text begins a new line
};

} // namespace arhost
