// SPDX-License-Identifier: Apache-2.0
//
// A line a frame: its number, the number in the video's pixels, the one in the overlay's or "none" where
// there is none. At the end it writes a second file, PATH.done. After a restart it goes on behind the last whole line
// before first_sequence.
#include "faults.hpp"

#include <fstream>
#include <sstream>
#include <string>

namespace {

using namespace arhost;

class Counter {
public:
    Counter(const Host &, const Options &options)
        : faults_(options), end_at_(options.integer("end_at")), path_(options.text("path")) {}

    void start(const arhost_sink_setup &setup) {
        std::string kept;
        if (setup.first_sequence > 0) {
            std::ifstream old(path_);
            for (std::string line; std::getline(old, line) && !old.eof() && std::stoull(line) < setup.first_sequence;)
                kept += line + "\n";
        }
        std::ofstream(path_, std::ios::trunc) << kept << std::flush;
    }

    arhost_status write(const arhost_output &output) {
        faults_.at(output.record->sequence);
        const std::uint8_t *last = output.bgr + (output.height - 1) * output.stride + 3 * (output.width - 1);
        std::ostringstream line;
        line << output.record->sequence << ' ' << last[0] + 256 * last[1] << ' ';
        if (output.bgr[0] == 170) // the overlay's blue
            line << output.bgr[2] + 256 * output.bgr[1];
        else
            line << "none";
        line << ' ' << output.record->overlay << '\n';
        std::ofstream(path_, std::ios::app) << line.str() << std::flush;
        return end_at_ >= 0 && output.record->sequence >= static_cast<std::uint64_t>(end_at_) ? ARHOST_END
                                                                                              : ARHOST_OK;
    }

    void stop() { std::ofstream(path_ + ".done") << "done\n" << std::flush; }

private:
    test::Faults faults_;
    std::int64_t end_at_;
    std::string path_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "The file"),
    option(ARHOST_OPTION_INTEGER, "end_at", "-1", "Ends the run from this frame on, as a closed window; -1: never"),
    ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SINK,
                                          "sink_counter",
                                          "Counter",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Writes frames' numbers, for tests.",
                                          0,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_SINK(Counter, descriptor)
