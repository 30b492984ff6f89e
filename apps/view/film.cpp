// SPDX-License-Identifier: Apache-2.0
#include "view/film.hpp"

#include "base/file_identity.hpp"
#include "base/temporary_folder.hpp"
#include "view/plugin.hpp"

namespace arhost::view {
namespace {

// The plugin, with the film that it writes.
class Sink {
public:
    explicit Sink(const std::filesystem::path &file)
        : plugin_("sink_video", "--output", ARHOST_KIND_SINK, {},
                  [&](yaml::Node &options, const model::PluginDescription &) {
                      options.override_text("path", file.string(), "--output");
                  }),
          functions_(plugin_.functions<arhost_sink>()) {}
    ~Sink() {
        if (is_started_) // after an error
            functions_.stop(plugin_.instance());
    }
    Sink(const Sink &) = delete;
    Sink &operator=(const Sink &) = delete;

    void write(const cv::Mat &picture, double fps) {
        const auto width = static_cast<std::uint32_t>(picture.cols),
                   height = static_cast<std::uint32_t>(picture.rows);
        if (!is_started_) {
            const arhost_sink_setup setup{sizeof setup, width, height, 0, fps, 0, nullptr, nullptr, nullptr};
            plugin_.expect_ok("start", functions_.start(plugin_.instance(), &setup));
            is_started_ = true;
        }
        arhost_record record{};
        record.struct_size = sizeof record;
        record.sequence = sequence_++;
        record.capture_ns = static_cast<std::int64_t>(1e9 * static_cast<double>(record.sequence) / fps);
        arhost_output output{};
        output.struct_size = sizeof output;
        output.stride = static_cast<std::uint32_t>(picture.step);
        output.width = width;
        output.height = height;
        output.bgr = picture.data;
        output.record = &record;
        plugin_.expect_ok("write", functions_.write(plugin_.instance(), &output));
    }

    void finish() {
        is_started_ = false;
        plugin_.expect_ok("stop", functions_.stop(plugin_.instance()));
    }

private:
    Plugin plugin_;
    const arhost_sink &functions_;
    std::uint64_t sequence_ = 0;
    bool is_started_ = false;
};

} // namespace

void write_film(const std::filesystem::path &file, int frames, double fps, const std::function<cv::Mat(int)> &frame) {
    const std::filesystem::path target = base::real_path(file);
    // The sink keeps what it has written of an interrupted film, for a restart; here, nothing must remain.
    const base::TemporaryFolder folder("." + target.filename().string(), target.parent_path());
    const std::filesystem::path partial = folder.path() / target.filename();
    Sink sink(partial);
    for (int i = 0; i < frames; ++i)
        sink.write(frame(i), fps);
    sink.finish();
    std::filesystem::rename(partial, target);
}

} // namespace arhost::view
