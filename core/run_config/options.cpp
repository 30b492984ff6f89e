// SPDX-License-Identifier: Apache-2.0
#include "run_config/options.hpp"

#include "base/listening_socket.hpp"
#include "run_config/access.hpp"

#include <algorithm>
#include <limits>

namespace arhost::run_config {

static std::vector<std::string_view> choices_of(const model::OptionDeclaration &declared) {
    return {declared.choices.begin(), declared.choices.end()};
}

model::OptionValue value_of(const model::OptionDeclaration &declared, const yaml::Node &node) {
    model::OptionValue value{declared.key, declared.type, 0, 0.0, ""};
    const bool bounded = declared.minimum != 0 || declared.maximum != 0;
    const auto as_integer = [](double bound) { return static_cast<std::int64_t>(std::clamp(bound, -9e18, 9e18)); };
    switch (declared.type) {
    case ARHOST_OPTION_BOOL:
        value.integer = node.boolean();
        break;
    case ARHOST_OPTION_INTEGER:
        value.integer =
            bounded ? node.integer(as_integer(declared.minimum), as_integer(declared.maximum)) : node.integer();
        break;
    case ARHOST_OPTION_REAL:
        value.real = bounded ? node.real(declared.minimum, declared.maximum) : node.real();
        break;
    case ARHOST_OPTION_INPUT_PATH:
        value.text = node.input_path().string();
        break;
    case ARHOST_OPTION_OUTPUT_PATH:
        value.text = is_standard_output(node) ? "-" : node.output_path().string();
        break;
    case ARHOST_OPTION_LISTEN:
        value.integer = -1; // the host opens the socket
        value.text = node.text();
        if (const std::string problem = base::problem_with_address(value.text); !problem.empty())
            node.fail(problem);
        break;
    default:
        value.text = declared.choices.empty() ? node.text() : node.choice(choices_of(declared));
    }
    return value;
}

// Parses a default value. The message about an invalid default names the plugin, not the configuration.
static model::OptionValue default_of(const model::OptionDeclaration &declared, const std::string &plugin) {
    if (declared.default_value->empty())
        return {declared.key, declared.type, declared.type == ARHOST_OPTION_LISTEN ? -1 : 0, 0.0, ""};
    const yaml::Node node =
        yaml::Node::scalar(*declared.default_value, plugin + "'s default of '" + declared.key + "'");
    return value_of(declared, node);
}

std::vector<model::OptionValue> resolve_options(const model::PluginDescription &plugin,
                                                const std::optional<yaml::Node> &options,
                                                const std::optional<yaml::Node> &path, const yaml::Node &owner,
                                                std::vector<std::string> &notes) {
    std::vector<std::string_view> keys;
    for (const model::OptionDeclaration &declared : plugin.options)
        keys.push_back(declared.key);
    if (options && std::ranges::count(plugin.needs, "listen"))
        options->allow_keys(keys); // a misspelled option must not make a server accessible
    std::vector<yaml::Node> unknown = options ? options->set_aside_keys(keys) : std::vector<yaml::Node>();
    if (path && std::find(keys.begin(), keys.end(), "path") == keys.end())
        unknown.push_back(*path);
    for (const yaml::Node &node : unknown)
        notes.push_back(node.where() + ": " + node.path() + ": set aside, because " + plugin.short_name() +
                        " has no such option");

    std::vector<model::OptionValue> values;
    for (const model::OptionDeclaration &declared : plugin.options) {
        std::optional<yaml::Node> value = options ? options->find(declared.key) : std::nullopt;
        if (declared.key == "path" && path) {
            if (value)
                value->fail("the path is also given by the key 'path' next to 'plugin'; remove one of them");
            value = path;
        }
        if (value && !declared.choices.empty() && value->is_unlike(choices_of(declared))) {
            notes.push_back(value->where() + ": " + value->path() + ": '" + value->text() +
                            "' is set aside, because " + plugin.short_name() + " has no such choice");
            value.reset();
        }
        if (value && declared.type == ARHOST_OPTION_OUTPUT_PATH && is_standard_output(*value) &&
            !(plugin.kind == ARHOST_KIND_SINK && plugin.capabilities & ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT &&
              declared.key == "path"))
            value->fail(plugin.short_name() + " cannot write to standard output; name a file");
        if (value)
            values.push_back(value_of(declared, *value));
        else if (declared.default_value)
            values.push_back(default_of(declared, plugin.short_name()));
        else
            owner.fail(plugin.short_name() + " needs '" + declared.key + "': " + declared.help);
    }
    return values;
}

} // namespace arhost::run_config
