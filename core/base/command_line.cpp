// SPDX-License-Identifier: Apache-2.0
#include "base/command_line.hpp"

#include "base/text.hpp"

#include <CLI/CLI.hpp>

#include <array>
#include <cstdint>

namespace arhost::base {

Option Option::required() {
    return Option(option_->required());
}
Option Option::hidden() {
    return Option(option_->group(""));
}
Option Option::type_name(const std::string &name) {
    return Option(option_->type_name(name));
}
Option Option::show_default() {
    return Option(option_->capture_default_str());
}
Option Option::default_text(const std::string &text) {
    return Option(option_->default_str(text));
}
Option Option::separator(char c) {
    return Option(option_->delimiter(c));
}
Option Option::one_value_each() {
    return Option(option_->allow_extra_args(false));
}
Option Option::range(int minimum, int maximum) {
    return Option(option_->check(CLI::Range(minimum, maximum)));
}
Option Option::range(double minimum, double maximum) {
    return Option(option_->check(CLI::Range(minimum, maximum)));
}
Option Option::one_of(const std::vector<std::string> &choices) {
    return Option(option_->check(CLI::IsMember(choices)));
}
Option Option::existing_path() {
    return Option(option_->check(CLI::ExistingPath));
}
Option Option::check(const std::function<std::string(const std::string &value)> &problem) {
    return Option(option_->check(problem));
}

CommandLine::CommandLine(const std::string &description, const std::string &name)
    : app_(std::make_shared<CLI::App>(description, name)) {
    app_->get_formatter()->column_width(34);
    // The message quotes arguments, which might contain control characters for the terminal.
    app_->failure_message([](const CLI::App *, const CLI::Error &error) {
        return printable(error.what()) + "\nRun with --help for more information.\n";
    });
}

CommandLine::CommandLine(std::shared_ptr<CLI::App> app) : app_(std::move(app)) {}

void CommandLine::version(const std::string &text) {
    app_->set_version_flag("--version", text);
}

CommandLine CommandLine::group(const std::string &name, const std::string &description) {
    return CommandLine({app_, app_->add_option_group(name, description)});
}

CommandLine CommandLine::subcommand(const std::string &name, const std::string &description) {
    app_->require_subcommand(0, 1);
    return CommandLine({app_, app_->add_subcommand(name, description)});
}

CommandLine CommandLine::raw_subcommand(const std::string &name, const std::string &description) {
    CommandLine command = subcommand(name, description);
    command.app_->set_help_flag();
    command.app_->prefix_command();
    return command;
}

template <class Value>
Option CommandLine::option(const std::string &names, Value &value, const std::string &description) {
    return Option(app_->add_option(names, value, description));
}

// Explicit instantiations for all types of option values that the project's programs use.
template Option CommandLine::option(const std::string &, double &, const std::string &);
template Option CommandLine::option(const std::string &, unsigned &, const std::string &);
template Option CommandLine::option(const std::string &, std::uint64_t &, const std::string &);
template Option CommandLine::option(const std::string &, std::optional<int> &, const std::string &);
template Option CommandLine::option(const std::string &, std::optional<double> &, const std::string &);
template Option CommandLine::option(const std::string &, std::optional<std::uint32_t> &, const std::string &);
template Option CommandLine::option(const std::string &, std::optional<std::uint64_t> &, const std::string &);
template Option CommandLine::option(const std::string &, std::string &, const std::string &);
template Option CommandLine::option(const std::string &, std::filesystem::path &, const std::string &);
template Option CommandLine::option(const std::string &, std::array<double, 3> &, const std::string &);
template Option CommandLine::option(const std::string &, std::array<std::uint32_t, 2> &, const std::string &);
template Option CommandLine::option(const std::string &, std::vector<std::string> &, const std::string &);
template Option CommandLine::option(const std::string &, std::vector<std::filesystem::path> &, const std::string &);

Option CommandLine::flag(const std::string &names, bool &value, const std::string &description) {
    return Option(app_->add_flag(names, value, description));
}

std::optional<int> CommandLine::parse(int argc, char **argv) {
    try {
        app_->parse(argc, argv);
        return std::nullopt;
    } catch (const CLI::ParseError &error) {
        return app_->exit(error) == 0 ? 0 : 2;
    }
}

bool CommandLine::selected() const {
    return app_->parsed();
}

std::vector<std::string> CommandLine::arguments() const {
    return app_->remaining();
}

std::string CommandLine::help() const {
    return app_->help();
}

} // namespace arhost::base
