// SPDX-License-Identifier: Apache-2.0
//
// A sink that writes one line per frame: the frame number, the number encoded in the video's pixels, and the number
// encoded in the overlay's pixels (or "none"). Writes PATH.done at the end. After a restart, keeps the complete lines
// of the frames before first_sequence.
#include "faults.hpp"

#ifndef ID // sink_realtime is the same plugin with the capability that window sinks have
#define ID "sink_counter"
#define CAPABILITIES 0
#endif

#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

namespace {

using namespace arhost;

class Counter {
public:
    Counter(const Host &, const Options &options)
        : faults_(options), end_at_(options.integer("end_at")), hang_in_stop_(options.boolean("hang_in_stop")),
          path_(options.text("path")) {}

    void start(const arhost_sink_setup &setup) {
        std::string kept;
        if (setup.first_sequence > 0) {
            std::ifstream old(path_);
            for (std::string line; std::getline(old, line) && !old.eof() && std::stoull(line) < setup.first_sequence;)
                kept += line + "\n";
        }
        if (setup.first_sequence == 0) {
            std::ofstream(path_, std::ios::trunc) << std::flush;
            return;
        }
        // Writes a new file first, because no data must be lost if the plugin is killed here.
        std::ofstream(path_ + ".new", std::ios::trunc) << kept << std::flush;
        std::rename((path_ + ".new").c_str(), path_.c_str());
    }

    arhost_status write(const arhost_output &output) {
        faults_.at(output.record->sequence);
        const std::uint8_t *last = output.bgr + (output.height - 1) * output.stride + 3 * (output.width - 1);
        std::ostringstream line;
        line << output.record->sequence << ' ' << last[0] + 256 * last[1] << ' ';
        if (output.bgr[0] == 170) // the blue value of all overlay pixels
            line << output.bgr[2] + 256 * output.bgr[1];
        else
            line << "none";
        line << ' ' << output.record->overlay << '\n';
        std::ofstream(path_, std::ios::app) << line.str() << std::flush;
        return end_at_ >= 0 && output.record->sequence >= static_cast<std::uint64_t>(end_at_) ? ARHOST_STATUS_END
                                                                                              : ARHOST_STATUS_OK;
    }

    void stop() {
        while (hang_in_stop_)
            ::pause();
        std::ofstream(path_ + ".done") << "done\n" << std::flush;
    }

private:
    test::Faults faults_;
    std::int64_t end_at_;
    bool hang_in_stop_;
    std::string path_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "Output file"),
    option(ARHOST_OPTION_INTEGER, "end_at", "-1", "Ends the run at this frame, like a closed window; -1: never"),
    option(ARHOST_OPTION_BOOL, "hang_in_stop", "false", "Never returns from stop"), ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SINK,
                                          "org.arhost.test." ID,
                                          "Counter",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Writes frames' numbers, for tests.",
                                          CAPABILITIES,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_SINK(Counter, descriptor)
