// SPDX-License-Identifier: Apache-2.0
#include "model/control.hpp"

#include "base/text.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace arhost::control {
namespace {

using Json = nlohmann::ordered_json;

// A command's JSON object, whose members must all be read.
class Members {
public:
    explicit Members(const Json &json) : json_(json) {}

    std::string text(const char *key) {
        const Json &value = require(key);
        if (!value.is_string())
            throw Error(std::string("'") + key + "' must be a string");
        return value.get<std::string>();
    }
    std::string text_or_missing(const char *key) { return find(key) ? text(key) : ""; }
    std::optional<bool> boolean(const char *key) {
        const Json *value = find(key);
        if (!value)
            return std::nullopt;
        if (!value->is_boolean())
            throw Error(std::string("'") + key + "' must be true or false");
        return value->get<bool>();
    }
    // Returns a string, number or boolean as text.
    std::string scalar(const char *key) {
        const Json &value = require(key);
        if (value.is_string())
            return value.get<std::string>();
        if (!value.is_number() && !value.is_boolean())
            throw Error(std::string("'") + key + "' must be a string, a number, true or false");
        return value.dump();
    }
    void expect_no_more() const {
        for (const auto &[key, value] : json_.items())
            if (std::find(read_.begin(), read_.end(), key) == read_.end())
                throw Error("unknown member '" + base::printable(key, 100) + "'");
    }

private:
    const Json *find(const char *key) {
        read_.emplace_back(key);
        const auto found = json_.find(key);
        return found == json_.end() ? nullptr : &*found;
    }
    const Json &require(const char *key) {
        if (const Json *value = find(key))
            return *value;
        throw Error(std::string("the member '") + key + "' is missing");
    }

    const Json &json_;
    std::vector<std::string> read_;
};

Command parse_members(const std::string &name, Members &members, const std::set<std::string, std::less<>> &granted) {
    if (name == "quit")
        return Quit{};
    if (name == "freeze")
        return Freeze{members.boolean("on")};
    if (name == "snapshot")
        return Snapshot{};
    if (name == "record")
        return Record{members.boolean("on")};
    if (name == "load_scene")
        return LoadScene{members.text_or_missing("scene")};
    if (name == "swap") {
        const std::string component = members.text_or_missing("component");
        return Swap{component, members.text_or_missing("plugin")};
    }
    if (name == "set") {
        const std::string component = members.text("component"), option = members.text_or_missing("option");
        return Set{component, option, option.empty() ? "" : members.scalar("value")};
    }
    return Status{granted};
}

} // namespace

Command parse(const std::string &text, const std::set<std::string, std::less<>> &granted) {
    const Json json = Json::parse(text, nullptr, false);
    if (!json.is_object())
        throw Error("a command must be a JSON object, as in {\"command\": \"status\"}");
    Members members(json);
    const std::string name = members.text("command");
    if (std::ranges::find(names, name) == names.end())
        throw Error("unknown command '" + base::printable(name, 100) + "'");
    if (!granted.contains(name))
        throw NotGranted("the configuration does not grant '" + name +
                         "' to this output: add it to its key 'control'");
    Command command = parse_members(name, members, granted);
    members.expect_no_more();
    return command;
}

std::string answer_text(const std::string &error, const Json &members) {
    Json answer = {{"ok", error.empty()}};
    if (!error.empty())
        answer["error"] = error;
    if (members.is_object())
        answer.update(members);
    return answer.dump(-1, ' ', false, Json::error_handler_t::replace);
}

} // namespace arhost::control
