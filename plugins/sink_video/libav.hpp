// SPDX-License-Identifier: Apache-2.0
//
// Owning pointer to a libav muxer and its file, and conversion of libav's errors to Failure.
#pragma once

#include "libav_common/libav_pointers.hpp"

#include <arhost-cpp/plugin.hpp>

extern "C" {
#include <libavutil/opt.h>
}

#include <memory>
#include <string>

namespace arhost::video {

using namespace libav;

struct CloseOutput {
    void operator()(AVFormatContext *p) const {
        avio_closep(&p->pb);
        avformat_free_context(p);
    }
};
using OutputPointer = std::unique_ptr<AVFormatContext, CloseOutput>;

inline Failure libav_failure(arhost_status status, const std::string &what, int code) {
    return Failure(status, what + ": " + error_text(code));
}

} // namespace arhost::video
