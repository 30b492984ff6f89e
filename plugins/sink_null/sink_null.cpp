// SPDX-License-Identifier: Apache-2.0
//
// sink_null: discards frames. Used to measure the rest of the pipeline, or the effect of a slow sink.
#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <chrono>
#include <thread>

namespace {

using namespace std::chrono_literals;

class NullSink {
public:
    NullSink(const arhost::Host &host, const arhost::Options &options)
        : host_(host), delay_(options.integer("delay_ms")) {}

    void start(const arhost_sink_setup &) {}

    arhost_status write(const arhost_output &) {
        const auto end = std::chrono::steady_clock::now() + delay_;
        for (auto left = end - std::chrono::steady_clock::now(); left > 0ns;
             left = end - std::chrono::steady_clock::now()) {
            if (host_.cancelled())
                return ARHOST_STATUS_ERROR_CANCELLED;
            std::this_thread::sleep_for(std::min<std::chrono::nanoseconds>(left, 10ms));
        }
        return ARHOST_STATUS_OK;
    }

private:
    arhost::Host host_;
    std::chrono::milliseconds delay_;
};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "delay_ms", "0", "Time to wait per frame, in milliseconds.", 0, 600000),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_null",
    .name = "Nothing",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Discards frames, immediately or after a delay.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(NullSink, descriptor)
