// SPDX-License-Identifier: Apache-2.0
#include "command_line/command_line.hpp"

#include "base/program.hpp"
#include "base/text.hpp"
#include "command_line/description.hpp"

#include <CLI/CLI.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iomanip>
#include <sstream>

namespace arhost::command_line {
namespace {

// Returns the choices of CLI::IsMember, whose description is "{a,b,c}".
std::vector<std::string> choices_of(const CLI::Option &option) {
    const std::string type = option.get_type_name();
    const std::size_t begin = type.find('{'), end = type.rfind('}');
    if (begin == std::string::npos || end == std::string::npos || end < begin)
        return {};
    return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

OptionDescription describe(const CLI::Option &option) {
    OptionDescription described;
    for (const std::string &name : option.get_snames())
        described.names.push_back("-" + name);
    for (const std::string &name : option.get_lnames())
        described.names.push_back("--" + name);
    described.positional = option.get_positional() ? option.get_name(true) : "";
    described.help = option.get_description();
    described.choices = choices_of(option);
    const bool is_flag = option.get_items_expected_max() == 0;
    if (!is_flag)
        described.value = described.choices.empty() ? CLI::detail::split(option.get_type_name(), ':').front() : "";
    if (!is_flag && described.value.empty())
        described.value = described.positional.empty() ? "VALUE" : described.positional;
    described.is_required = option.get_required();
    described.is_repeatable = option.get_expected_max() > 1;
    return described;
}

void add_options(CommandDescription &command, const CLI::App &app) {
    const bool is_group = app.get_name().empty() && app.get_parent(); // repeats its parent's --help
    for (const CLI::Option *option : app.get_options())
        if (!option->get_group().empty() && !(is_group && option == app.get_help_ptr())) // hidden: no group
            command.options.push_back(describe(*option));
}

CommandDescription describe(const CLI::App &app) {
    CommandDescription command{app.get_name(), app.get_description(), app.get_prefix_command(), {}, {}};
    add_options(command, app);
    for (const CLI::App *group : app.get_subcommands([](const CLI::App *sub) { return sub->get_name().empty(); }))
        add_options(command, *group);
    return command;
}

// Prints placeholders and choices instead of the types of values.
struct Formatter : CLI::Formatter {
    std::string make_option_name(const CLI::Option *option, bool is_positional) const override {
        const std::string name = CLI::Formatter::make_option_name(option, is_positional);
        const OptionDescription described = describe(*option);
        return is_positional || described.value.empty() || !described.choices.empty() ? name
                                                                                      : name + " " + described.value;
    }
    std::string make_option_opts(const CLI::Option *option) const override {
        const std::string choices = CLI::detail::join(choices_of(*option), "|"), value = option->get_default_str();
        return (choices.empty() ? "" : " " + choices) + (value.empty() ? "" : "=" + value) +
               (option->get_expected_max() > 1 ? " ..." : "") + (option->get_required() ? " (required)" : "");
    }
};

std::vector<const CLI::App *> named_subcommands(const CLI::App &app) {
    return app.get_subcommands([](const CLI::App *sub) { return !sub->get_name().empty(); });
}

} // namespace

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
Option Option::range(double minimum, double maximum) {
    return Option(option_->check([minimum, maximum](const std::string &text) -> std::string {
        double value = 0;
        if (!CLI::detail::lexical_cast(text, value) || std::isnan(value))
            return text + " is not a number";
        if (value >= minimum && value <= maximum)
            return "";
        std::ostringstream range;
        range << std::setprecision(16) << "must be " << minimum << " to " << maximum << ", but is " << text;
        return range.str();
    }));
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
    app_->formatter(std::make_shared<Formatter>());
    app_->get_formatter()->column_width(34);
    // The message quotes arguments, which might contain control characters for the terminal.
    app_->failure_message([](const CLI::App *, const CLI::Error &error) {
        return base::printable(error.what()) + "\nRun with --help for more information.\n";
    });
}

CommandLine::CommandLine(std::shared_ptr<CLI::App> app) : app_(std::move(app)) {}

void CommandLine::version(const std::string &text) {
    app_->set_version_flag("-V,--version", text);
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
template Option CommandLine::option(const std::string &, std::optional<std::array<double, 3>> &, const std::string &);
template Option CommandLine::option(const std::string &, std::array<std::uint32_t, 2> &, const std::string &);
template Option CommandLine::option(const std::string &, std::vector<std::string> &, const std::string &);
template Option CommandLine::option(const std::string &, std::vector<std::filesystem::path> &, const std::string &);

Option CommandLine::flag(const std::string &names, bool &value, const std::string &description) {
    return Option(app_->add_flag(names, value, description));
}

std::optional<int> CommandLine::parse(int argc, char **argv) {
    if (argc == 2 && std::string_view(argv[1]) == "--describe") {
        if (app_->get_name().empty())
            app_->name(std::filesystem::path(argv[0]).filename().string());
        CommandDescription program = describe(*app_);
        for (const CLI::App *sub : named_subcommands(*app_))
            program.commands.push_back(describe(*sub));
        std::printf("%s\n", nlohmann::json(program).dump().c_str());
        return 0;
    }
    // A misspelt subcommand would be taken for a file.
    const std::vector<std::string> names = subcommands();
    const std::vector<std::string_view> candidates(names.begin(), names.end());
    const std::string first = argc > 1 ? argv[1] : "", near = base::nearest(first, candidates);
    std::error_code ignored;
    if (!first.starts_with('-') && !near.empty() && near != first && !std::filesystem::exists(first, ignored))
        return base::print_error("there is no command or file '" + first + "'; did you mean '" + near + "'?",
                                 base::invalid_input);
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

std::vector<std::string> CommandLine::subcommands() const {
    std::vector<std::string> names;
    for (const CLI::App *sub : named_subcommands(*app_))
        names.push_back(sub->get_name());
    return names;
}

std::string CommandLine::help(const std::string &subcommand) const {
    const CLI::App *app = subcommand.empty() ? app_.get() : app_->get_subcommand(subcommand);
    const std::string name = subcommand.empty() ? app_->get_name() : app_->get_name() + " " + subcommand;
    return app_->get_formatter()->make_help(app, name, CLI::AppFormatMode::Normal);
}

} // namespace arhost::command_line
