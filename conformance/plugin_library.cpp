// SPDX-License-Identifier: Apache-2.0
#include "conformance/plugin_library.hpp"

#include "base/listening_socket.hpp"
#include "conformance/verdict.hpp"
#include "ipc/channel.hpp"
#include "worker/library.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <cstring>

namespace arhost::conformance {

using ipc::Call;

const arhost_entry_point &PluginLibrary::entry() {
    if (!entry_)
        entry_ = in_call(calls_, Call::load, [&] { return &worker::open_library(file_); });
    return *entry_;
}

const arhost_plugin &PluginLibrary::plugin() {
    if (!plugin_)
        plugin_ =
            in_call(calls_, Call::negotiate, [&, &opened = entry()] { return &worker::negotiate(file_, opened); });
    return *plugin_;
}

const arhost_option_descriptor *PluginLibrary::option(const std::string &key) {
    for (const arhost_option_descriptor *option : options_of(descriptor()))
        if (key == option->key)
            return option;
    return nullptr;
}

arhost_option parse_option(const arhost_option_descriptor &option, const std::string &text) {
    arhost_option value{sizeof value, option.type, option.key, 0, 0, text.c_str()};
    const auto reject = [&](const char *why) {
        throw std::runtime_error(fmt::format("option '{}': '{}' {}", option.key, text, why));
    };
    const auto check_range = [&](double number) {
        const bool bounded = option.minimum != 0 || option.maximum != 0;
        if (bounded && !(number >= option.minimum && number <= option.maximum))
            reject(fmt::format("is outside the range {} to {}", option.minimum, option.maximum).c_str());
    };
    try {
        std::size_t used = text.size();
        switch (option.type) {
        case ARHOST_OPTION_BOOL:
            if (text != "true" && text != "false")
                reject("is neither true nor false");
            value.integer = text == "true";
            break;
        case ARHOST_OPTION_INTEGER:
            value.integer = std::stoll(text, &used);
            check_range(static_cast<double>(value.integer));
            break;
        case ARHOST_OPTION_REAL:
            value.real = std::stod(text, &used);
            check_range(value.real);
            break;
        case ARHOST_OPTION_TEXT:
            if (option.choices) {
                const char *const *choice = option.choices;
                while (*choice && text != *choice)
                    ++choice;
                if (!*choice)
                    reject("is not one of the choices");
            }
            break;
        case ARHOST_OPTION_INPUT_PATH:
        case ARHOST_OPTION_OUTPUT_PATH:
            break;
        case ARHOST_OPTION_LISTEN:
            if (const std::string problem = base::problem_with_address(text); !text.empty() && !problem.empty())
                reject(problem.c_str());
            value.integer = -1; // without a socket
            break;
        default:
            reject("has an unknown type");
        }
        if (used != text.size())
            reject("is not a number");
    } catch (const std::logic_error &) { // of stoll and stod
        reject("is not a number");
    }
    return value;
}

Host::Host()
    : host_{sizeof host_, ARHOST_ABI_VERSION, "arhost-conform", ARHOST_VERSION, this, nullptr, nullptr, nullptr,
            nullptr} {
    host_.log = [](const arhost_host *host, arhost_severity severity, const char *text) {
        constexpr const char *names[] = {"?", "debug", "info", "warning", "error", "HOST_MISBEHAVING", "?"};
        const std::string line = text ? text : "(NULL)";
        const std::lock_guard lock(self(host).mutex_);
        if (severity == ARHOST_SEVERITY_ERROR)
            self(host).last_error_ = line;
        if (self(host).log_.size() < 1000)
            self(host).log_.push_back(
                fmt::format("{}: {}", names[severity > 0 && severity < 6 ? severity : 0], line));
    };
    host_.progress = [](const arhost_host *, double, const char *) {};
    host_.cancelled = [](const arhost_host *host) { return static_cast<std::int32_t>(self(host).cancelled_); };
    host_.get_extension = [](const arhost_host *host, const char *name) -> const void * {
        static constexpr arhost_control control = {
            sizeof control, 0,
            [](const arhost_host *sink_host, const char *command, arhost_take_answer take, void *context) {
                return self(sink_host).send(command, take, context);
            }};
        return self(host).offers_control_ && name && std::string_view(name) == ARHOST_CONTROL_EXTENSION ? &control
                                                                                                        : nullptr;
    };
}

arhost_status Host::send(const char *command, arhost_take_answer take, void *context) {
    const std::lock_guard lock(mutex_);
    if (!accepts_commands_ || !command || std::strlen(command) > ARHOST_MAX_COMMAND_SIZE ||
        !ipc::Json::parse(command, nullptr, false).is_object())
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    if (commands_.size() >= ARHOST_MAX_PENDING_COMMANDS)
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    commands_.emplace_back(take, context);
    return ARHOST_STATUS_OK;
}

void Host::accept_commands(bool accept) {
    const std::lock_guard lock(mutex_);
    accepts_commands_ = accept;
    commands_.clear();
}

void Host::answer_commands() {
    std::vector<std::pair<arhost_take_answer, void *>> commands;
    {
        const std::lock_guard lock(mutex_);
        commands.swap(commands_);
    }
    for (const auto &[take, context] : commands)
        if (take)
            take(context, R"({"ok":false,"error":"arhost conform executes no commands"})");
}

std::vector<std::string> Host::log() const {
    const std::lock_guard lock(mutex_);
    return log_;
}
std::string Host::last_error() const {
    const std::lock_guard lock(mutex_);
    return last_error_;
}

Instance::Instance(PluginLibrary &library, Settings overrides, std::filesystem::path folder)
    : library_(library), settings_(std::move(overrides)), folder_(std::move(folder)) {
    settings_.insert(library.settings().begin(), library.settings().end());
}

arhost_status Instance::create(Newer newer) {
    const arhost_plugin &plugin = library_.plugin();
    if (plugin.descriptor->kind == ARHOST_KIND_SINK)
        host_.offer_control();
    std::vector<std::string> texts; // referenced by the values
    std::vector<arhost_option> values;
    const auto declared = options_of(*plugin.descriptor);
    texts.reserve(declared.size());
    for (const arhost_option_descriptor *option : declared) {
        const auto set = settings_.find(option->key);
        if (set == settings_.end() && !option->default_value)
            throw std::runtime_error(fmt::format("the option '{0}' has no default; give --set {0}=…", option->key));
        texts.push_back(set != settings_.end() ? set->second : option->default_value);
        if (const std::filesystem::path path = texts.back(); !path.empty()) {
            if (option->type == ARHOST_OPTION_INPUT_PATH)
                texts.back() = std::filesystem::absolute(path);
            if (option->type == ARHOST_OPTION_OUTPUT_PATH && path != standard_output)
                texts.back() = library_.scratch() / folder_ / path.filename();
        }
        const auto socket = texts.back().empty() ? library_.sockets().end() : library_.sockets().find(option->key);
        if (socket != library_.sockets().end())
            texts.back() = socket->second.address;
        try {
            values.push_back(parse_option(*option, texts.back()));
        } catch (const std::runtime_error &error) {
            if (set != settings_.end())
                throw;
            throw Failure(std::string("invalid default: ") + error.what());
        }
        if (socket != library_.sockets().end())
            values.back().integer = socket->second.fd;
    }
    for (const auto &[key, value] : settings_)
        if (!library_.option(key))
            throw std::runtime_error(fmt::format("--set {}={}: the plugin has no such option", key, value));
    if (newer.option)
        values.push_back({sizeof(arhost_option), ARHOST_OPTION_TEXT, "arhost_conform_unknown", 0, 0, "?"});
    const std::size_t step = sizeof(arhost_option) + newer.bytes;
    std::vector<std::byte> passed(values.size() * step, std::byte{0xa5});
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i].struct_size = static_cast<std::uint32_t>(step);
        std::memcpy(passed.data() + i * step, &values[i], sizeof values[i]);
    }
    return in_call(library_.calls(), Call::create, [&] {
        return plugin.create(host_.get(), reinterpret_cast<const arhost_option *>(passed.data()),
                             static_cast<std::uint32_t>(values.size()), &instance_);
    });
}

void Instance::create_or_fail(Newer newer) {
    expect_ok("create", create(newer));
    if (!instance_)
        throw Failure("create returned OK but left the instance NULL");
}

void Instance::destroy() {
    if (instance_)
        in_call(library_.calls(), Call::destroy,
                [&] { library_.plugin().destroy(std::exchange(instance_, nullptr)); });
}

void Instance::expect_ok(const char *call, arhost_status status) const {
    if (status == ARHOST_STATUS_OK)
        return;
    throw Failure(call_result(call, status, host_));
}

std::string call_result(const char *call, arhost_status status, const Host &host) {
    const std::string reason = host.last_error();
    return fmt::format("{} returned {}{}", call, status_name(status), reason.empty() ? "" : ": " + reason);
}

std::string status_name(arhost_status status) {
    switch (status) {
    case ARHOST_STATUS_OK:
        return "OK";
    case ARHOST_STATUS_END:
        return "END";
    case ARHOST_STATUS_END_TRUNCATED:
        return "END_TRUNCATED";
    case ARHOST_STATUS_ERROR_INVALID_ARGUMENT:
        return "INVALID_ARGUMENT";
    case ARHOST_STATUS_ERROR_CONFIGURATION:
        return "CONFIGURATION";
    case ARHOST_STATUS_ERROR_UNSUPPORTED:
        return "UNSUPPORTED";
    case ARHOST_STATUS_ERROR_IO:
        return "IO";
    case ARHOST_STATUS_ERROR_OUT_OF_MEMORY:
        return "OUT_OF_MEMORY";
    case ARHOST_STATUS_ERROR_DEVICE_LOST:
        return "DEVICE_LOST";
    case ARHOST_STATUS_ERROR_CANCELLED:
        return "CANCELLED";
    case ARHOST_STATUS_ERROR_INTERNAL:
        return "INTERNAL";
    default:
        return fmt::format("{}, which is not a valid status", status);
    }
}

} // namespace arhost::conformance
