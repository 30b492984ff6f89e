// SPDX-License-Identifier: Apache-2.0
#include "ipc/messages.hpp"

#include <algorithm>
#include <cstring>
#include <type_traits>

namespace nlohmann {

template <class T> struct adl_serializer<std::optional<T>> {
    static void to_json(json &out, const std::optional<T> &value) {
        if (value)
            out = *value;
        else
            out = nullptr;
    }
    static void from_json(const json &in, std::optional<T> &value) {
        if (!in.is_null())
            value = in.get<T>();
    }
};

template <> struct adl_serializer<arhost_intrinsics> {
    static void to_json(json &out, const arhost_intrinsics &i) {
        out = {{"width", i.width},
               {"height", i.height},
               {"fx", i.fx},
               {"fy", i.fy},
               {"cx", i.cx},
               {"cy", i.cy},
               {"distortion", i.distortion},
               {"coefficients", std::vector<double>(i.coefficients, i.coefficients + i.coefficient_count)}};
    }
    static void from_json(const json &in, arhost_intrinsics &i) {
        i = {};
        i.struct_size = sizeof i;
        in.at("width").get_to(i.width);
        in.at("height").get_to(i.height);
        in.at("fx").get_to(i.fx);
        in.at("fy").get_to(i.fy);
        in.at("cx").get_to(i.cx);
        in.at("cy").get_to(i.cy);
        in.at("distortion").get_to(i.distortion);
        const auto coefficients = in.at("coefficients").get<std::vector<double>>();
        if (i.fx <= 0 || i.fy <= 0 || i.width < 1 || i.height < 1 || i.distortion < ARHOST_DISTORTION_NONE ||
            i.distortion > ARHOST_DISTORTION_FISHEYE || coefficients.size() > ARHOST_MAX_DISTORTION)
            throw std::runtime_error("the camera's intrinsics are out of range");
        i.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
        std::copy(coefficients.begin(), coefficients.end(), i.coefficients);
    }
};

// The JSON contains only the fields that a source sets; the layout is computed from them.
template <> struct adl_serializer<arhost_frame_format> {
    static void to_json(json &out, const arhost_frame_format &f) {
        out = {{"pixel_format", f.pixel_format}, {"width", f.width},         {"height", f.height},
               {"yuv_matrix", f.yuv_matrix},     {"yuv_range", f.yuv_range}, {"fps", f.fps},
               {"has_depth", f.has_depth != 0},  {"transfer", f.transfer}};
    }
    static void from_json(const json &in, arhost_frame_format &f) {
        f = {};
        f.struct_size = sizeof f;
        in.at("pixel_format").get_to(f.pixel_format);
        in.at("width").get_to(f.width);
        in.at("height").get_to(f.height);
        in.at("yuv_matrix").get_to(f.yuv_matrix);
        in.at("yuv_range").get_to(f.yuv_range);
        in.at("fps").get_to(f.fps);
        f.has_depth = in.at("has_depth").get<bool>();
        in.at("transfer").get_to(f.transfer);
        const bool yuv = f.pixel_format >= ARHOST_PIXEL_FORMAT_YUYV;
        if (f.fps < 0 || f.fps > 100'000 || f.transfer < ARHOST_TRANSFER_SRGB ||
            f.transfer > ARHOST_TRANSFER_LINEAR ||
            (yuv && (f.yuv_matrix < ARHOST_YUV_MATRIX_BT601 || f.yuv_matrix > ARHOST_YUV_MATRIX_BT709 ||
                     f.yuv_range < ARHOST_YUV_RANGE_LIMITED || f.yuv_range > ARHOST_YUV_RANGE_FULL)) ||
            !arhost_frame_layout(&f))
            throw std::runtime_error("the frame format is invalid: pixel format " + std::to_string(f.pixel_format) +
                                     ", " + std::to_string(f.width) + "x" + std::to_string(f.height) + " px, " +
                                     std::to_string(f.fps) + " fps");
    }
};

} // namespace nlohmann

namespace arhost::model {

using Json = nlohmann::json;

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(OptionValue, key, type, integer, real, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TargetMarker, id, family, corners_mm, file, pattern_ratio)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Target, name, markers, body)

static void to_json(Json &json, const OptionDeclaration &o) {
    json = {{"key", o.key},         {"type", o.type},       {"minimum", o.minimum},
            {"maximum", o.maximum}, {"choices", o.choices}, {"help", o.help}};
    if (o.default_value)
        json["default"] = *o.default_value;
}

static void from_json(const Json &json, OptionDeclaration &o) {
    o = {json.at("key"),     json.at("type"), {}, json.at("minimum"), json.at("maximum"),
         json.at("choices"), json.at("help")};
    if (json.contains("default"))
        o.default_value = json.at("default").get<std::string>();
}

void to_json(Json &json, const PluginDescription &d) {
    json = {{"kind", d.kind},
            {"id", d.id},
            {"name", d.name},
            {"version", d.version},
            {"vendor", d.vendor},
            {"licence", d.licence},
            {"description", d.description},
            {"capabilities", d.capabilities},
            {"options", d.options},
            {"needs", d.needs},
            {"changeable", d.changeable}};
}

void from_json(const Json &json, PluginDescription &d) {
    d = {json.at("kind"),    json.at("id"),      json.at("name"),        json.at("version"),
         json.at("vendor"),  json.at("licence"), json.at("description"), json.at("capabilities"),
         json.at("options"), json.at("needs"),   json.at("changeable")};
    check(d);
}

} // namespace arhost::model

namespace arhost::ipc {

using namespace model;

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SlotLayout, slot_size, count)

namespace messages {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SourceSetup, first_sequence, fps, paced, intrinsics)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TrackerSetup, format, intrinsics, full_search_every, smooth, confirm)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RaytracerSetup, width, height, intrinsics, form, compositing, video_format)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SinkSetup, video_format, fps, first_sequence, intrinsics, run_description)

void to_json(Json &json, const Create &create) {
    json["options"] = create.options;
    std::visit(
        [&]<class T>(const T &setup) {
            json["setup"] = setup;
            json["kind"] = T::kind;
        },
        create.setup);
}

template <std::size_t index = 0> Setup setup_from_json(const Json &json, const std::string &kind) {
    if constexpr (index < std::variant_size_v<Setup>) {
        using T = std::variant_alternative_t<index, Setup>;
        return kind == T::kind ? Setup(json.get<T>()) : setup_from_json<index + 1>(json, kind);
    }
    throw ProtocolViolation("unknown kind of setup '" + kind + "'");
}

void from_json(const Json &json, Create &create) {
    create = {json.at("options").get<std::vector<OptionValue>>(),
              setup_from_json(json.at("setup"), json.at("kind").get<std::string>())};
}

} // namespace messages

template <class T> void cut_text(T &message) {
    if (message.text.size() > messages::max_text)
        message.text.resize(messages::max_text);
}

template <class T> Json encode(const T &message) {
    Json json = Json::object();
    if constexpr (requires { message.text; }) {
        T cut = message;
        cut_text(cut);
        json = cut;
    } else if constexpr (!std::is_empty_v<T>) {
        json = message;
    }
    json["type"] = T::type;
    return json;
}

template <class T> T parse(const Message &message) {
    try {
        T parsed;
        if constexpr (!std::is_empty_v<T>)
            parsed = message.body.get<T>();
        if constexpr (requires { parsed.text; })
            cut_text(parsed);
        return parsed;
    } catch (const Json::exception &error) {
        throw ProtocolViolation(std::string("malformed message '") + T::type + "': " + error.what());
    }
}

// Instantiates the conversion of a message whose JSON functions are defined, or which has no fields.
#define ARHOST_CONVERTED(name)                                                                                       \
    template Json encode(const messages::name &);                                                                    \
    template messages::name parse(const Message &);
// A message and its fields.
#define ARHOST_MESSAGE(name, ...)                                                                                    \
    namespace messages {                                                                                             \
    NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(name, __VA_ARGS__)                                                            \
    }                                                                                                                \
    ARHOST_CONVERTED(name)

ARHOST_MESSAGE(Open, plugin, sandbox)
ARHOST_MESSAGE(Load, scene, readable, sandbox, content, lists_contents)
ARHOST_MESSAGE(ReadLog, file, video_bytes, sandbox)
ARHOST_CONVERTED(ListDevices)
ARHOST_CONVERTED(Create)
ARHOST_MESSAGE(Attach, is_output, generation, layout)
ARHOST_MESSAGE(Detach, generation)
ARHOST_MESSAGE(SetOption, option)
ARHOST_MESSAGE(Answer, id, answer)
ARHOST_CONVERTED(Stop)
ARHOST_MESSAGE(Hello, descriptor, sandbox)
ARHOST_MESSAGE(Devices, part, is_last)
ARHOST_MESSAGE(Ready, format, frame_count, intrinsics, capabilities, state_size)
ARHOST_MESSAGE(Attached, is_output, generation)
ARHOST_MESSAGE(Detached, generation)
ARHOST_MESSAGE(Stopped, status, text)
ARHOST_MESSAGE(Log, severity, text)
ARHOST_MESSAGE(Progress, fraction, what)
ARHOST_MESSAGE(Failed, status, text)
ARHOST_MESSAGE(Request, id, command)
ARHOST_MESSAGE(OptionSet, status, text)
ARHOST_MESSAGE(CountersChanged, counters)
ARHOST_CONVERTED(End)
ARHOST_MESSAGE(Reads, path, node)
ARHOST_MESSAGE(AnchorOrigin, text)
ARHOST_MESSAGE(Listed, kind, text, number)
ARHOST_CONVERTED(Loaded)
#undef ARHOST_MESSAGE
#undef ARHOST_CONVERTED

SharedMemory to_memory(const std::vector<Target> &targets) {
    const std::string text = Json(targets).dump();
    SharedMemory memory = SharedMemory::create("arhost-targets", text.size());
    const Mapping mapping = memory.map(Access::read_write);
    memory.seal_future_writes();
    std::memcpy(mapping.bytes().data(), text.data(), text.size());
    return memory;
}

std::vector<Target> targets_from(const Mapping &memory) {
    try {
        const std::span<const std::byte> bytes = memory.bytes();
        const auto *text = reinterpret_cast<const char *>(bytes.data());
        return Json::parse(text, text + bytes.size()).get<std::vector<Target>>();
    } catch (const Json::exception &error) {
        throw ProtocolViolation(std::string("malformed targets: ") + error.what());
    }
}

} // namespace arhost::ipc
