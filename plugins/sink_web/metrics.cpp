// SPDX-License-Identifier: Apache-2.0
#include "metrics.hpp"

#include <nlohmann/json.hpp>

#include <initializer_list>
#include <utility>

namespace arhost::web {
namespace {

using Json = nlohmann::json;
using Labels = std::initializer_list<std::pair<const char *, std::string>>;

constexpr std::pair<const char *, const char *> percentiles[] = {
    {"0.5", "p50_ms"}, {"0.95", "p95_ms"}, {"0.99", "p99_ms"}};

class Text {
public:
    void begin(const std::string &name, const char *type, const char *help) {
        text_ += "# HELP " + name + " " + help + "\n# TYPE " + name + " " + type + "\n";
        name_ = name;
    }
    void add(const Json &value, Labels labels = {}) {
        if (!value.is_number())
            return;
        text_ += name_;
        const char *separator = "{";
        for (const auto &[label, content] : labels) {
            text_ += separator + std::string(label) + "=\"" + escaped(content) + "\"";
            separator = ",";
        }
        text_ += (labels.size() > 0 ? "} " : " ") + value.dump() + "\n";
    }
    std::string take() { return std::move(text_); }

private:
    static std::string escaped(const std::string &content) {
        std::string text;
        for (const char c : content)
            text += c == '\\' ? "\\\\" : c == '"' ? "\\\"" : c == '\n' ? "\\n" : std::string(1, c);
        return text;
    }
    std::string text_, name_;
};

void add_status(Text &text, const Json &status) {
    text.begin("arhost_info", "gauge", "Version of arhost; always 1.");
    text.add(1, {{"version", status.value("arhost", "")}, {"mode", status.value("mode", "")}});
    text.begin("arhost_frozen", "gauge", "1 while the video is frozen.");
    text.add(status.value("frozen", false) ? 1 : 0);
    text.begin("arhost_fps", "gauge", "Recent frame rate.");
    text.add(status.value("fps", Json()));
    const Json frames = status.value("frames", Json::object());
    text.begin("arhost_frames_total", "counter", "Frames that reached a stage.");
    for (const char *stage : {"in", "tracked", "augmented", "composited", "passed_unaugmented"})
        text.add(frames.value(stage, Json()), {{"stage", stage}});
    text.begin("arhost_dropped_frames_total", "counter", "Dropped frames by cause.");
    const Json dropped = frames.value("dropped", Json::object()), stages = status.value("stages", Json::object());
    for (const auto &[cause, count] : dropped.items())
        text.add(count, {{"cause", cause}});
    text.begin("arhost_stage_milliseconds", "gauge", "Recent percentiles of the time of each stage.");
    for (const auto &[stage, timing] : stages.items())
        for (const auto &[quantile, key] : percentiles)
            text.add(timing.value(key, Json()), {{"stage", stage}, {"quantile", quantile}});
    text.begin("arhost_latency_milliseconds", "gauge",
               "Recent percentiles of the time from the capture (without a camera: the arrival) of a frame until an "
               "output has written it.");
    const Json outputs = status.value("latency", Json::object()).value("outputs", Json::object());
    for (const auto &[output, timing] : outputs.items())
        for (const auto &[quantile, key] : percentiles)
            text.add(timing.value(key, Json()), {{"output", output}, {"quantile", quantile}});
    const Json components = status.value("components", Json::array());
    text.begin("arhost_component_running", "gauge", "1 while the component runs.");
    for (const Json &each : components)
        text.add(each.value("state", "") == "running" ? 1 : 0,
                 {{"component", each.value("name", "")}, {"plugin", each.value("plugin", "")}});
    text.begin("arhost_component_restarts_total", "counter", "Restarts of the component.");
    for (const Json &each : components)
        text.add(each.value("restarts", Json()), {{"component", each.value("name", "")}});
}

} // namespace

std::string metrics(const std::string &answer, const OwnCounts &own) {
    Text text;
    const Json json = Json::parse(answer, nullptr, false);
    if (json.is_object() && json.contains("status"))
        add_status(text, json["status"]);
    text.begin("arhost_web_frames_total", "counter", "Frames that this output received.");
    text.add(own.frames);
    text.begin("arhost_web_encoded_frames_total", "counter", "Frames that this output encoded for viewers.");
    text.add(own.encoded);
    text.begin("arhost_web_viewers", "gauge", "Viewers of the live picture.");
    text.add(own.viewers);
    text.begin("arhost_web_connections", "gauge", "Open connections.");
    text.add(own.connections);
    return text.take();
}

} // namespace arhost::web
