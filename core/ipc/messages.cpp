// SPDX-License-Identifier: Apache-2.0
#include "ipc/messages.hpp"

#include <algorithm>
#include <type_traits>

// JSON conversion of ABI structs and other types by their own functions.
namespace nlohmann {

namespace ipc = arhost::ipc;
namespace sandbox = arhost::sandbox;

template <> struct adl_serializer<arhost_intrinsics> {
    static void to_json(json &out, const arhost_intrinsics &value) { out = ipc::to_json(value); }
    static void from_json(const json &in, arhost_intrinsics &value) { value = ipc::intrinsics_from_json(in); }
};
template <> struct adl_serializer<arhost_frame_format> {
    static void to_json(json &out, const arhost_frame_format &value) { out = ipc::to_json(value); }
    static void from_json(const json &in, arhost_frame_format &value) { value = ipc::format_from_json(in); }
};
template <> struct adl_serializer<ipc::PluginDescription> {
    static void to_json(json &out, const ipc::PluginDescription &value) { out = ipc::to_json(value); }
    static void from_json(const json &in, ipc::PluginDescription &value) { value = ipc::description_from_json(in); }
};
template <> struct adl_serializer<ipc::SlotLayout> {
    static void to_json(json &out, const ipc::SlotLayout &value) { out = ipc::to_json(value); }
    static void from_json(const json &in, ipc::SlotLayout &value) { value = ipc::layout_from_json(in); }
};
template <> struct adl_serializer<sandbox::Policy> {
    static void to_json(json &out, const sandbox::Policy &value) { out = sandbox::to_json(value); }
    static void from_json(const json &in, sandbox::Policy &value) { value = sandbox::policy_from_json(in); }
};
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

} // namespace nlohmann

namespace arhost::ipc {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(OptionValue, key, type, integer, real, text)

namespace messages {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Open, plugin, sandbox)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Load, scene, sandbox)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SourceSetup, first_sequence, fps, paced, intrinsics)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TrackerSetup, format, intrinsics, full_search_every, smooth, confirm)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RaytracerSetup, width, height, intrinsics)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SinkSetup, video_format, fps, first_sequence, intrinsics, run_description)

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Attach, is_output, generation, layout)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Detach, generation)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SetOption, option)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Answer, id, answer)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Request, id, command)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(OptionSet, status, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(CountersChanged, counters)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Hello, descriptor, sandbox)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Devices, part, is_last)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Ready, format, frame_count, intrinsics, capabilities, state_size)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Attached, is_output, generation)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Detached, generation)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Stopped, status, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Log, severity, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Progress, fraction, what)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Failed, status, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Reads, path, node)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(AnchorOrigin, text)

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

#define ARHOST_MESSAGE(name)                                                                                         \
    template Json encode(const messages::name &);                                                                    \
    template messages::name parse(const Message &);
ARHOST_MESSAGE(Open)
ARHOST_MESSAGE(Load)
ARHOST_MESSAGE(ListDevices)
ARHOST_MESSAGE(Create)
ARHOST_MESSAGE(Attach)
ARHOST_MESSAGE(Detach)
ARHOST_MESSAGE(SetOption)
ARHOST_MESSAGE(Answer)
ARHOST_MESSAGE(Stop)
ARHOST_MESSAGE(Hello)
ARHOST_MESSAGE(Devices)
ARHOST_MESSAGE(Ready)
ARHOST_MESSAGE(Attached)
ARHOST_MESSAGE(Detached)
ARHOST_MESSAGE(Stopped)
ARHOST_MESSAGE(Log)
ARHOST_MESSAGE(Progress)
ARHOST_MESSAGE(Failed)
ARHOST_MESSAGE(Request)
ARHOST_MESSAGE(OptionSet)
ARHOST_MESSAGE(CountersChanged)
ARHOST_MESSAGE(End)
ARHOST_MESSAGE(Reads)
ARHOST_MESSAGE(AnchorOrigin)
ARHOST_MESSAGE(Loaded)
#undef ARHOST_MESSAGE

bool are_valid(const Counters &counters) {
    constexpr std::string_view characters = "abcdefghijklmnopqrstuvwxyz0123456789_";
    return counters.size() <= ARHOST_MAX_COUNTERS && std::ranges::all_of(counters, [&](const auto &counter) {
               const std::string &name = counter.first;
               return !name.empty() && name.size() <= ARHOST_MAX_COUNTER_NAME &&
                      name.find_first_not_of(characters) == std::string::npos;
           });
}

} // namespace arhost::ipc
