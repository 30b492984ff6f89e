// SPDX-License-Identifier: Apache-2.0
//
// Command-line parsing. Wraps CLI11: its headers take seconds to compile, so only command_line.cpp includes them.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace arhost::command_line {

class Option {
public:
    explicit Option(CLI::Option *option) : option_(option) {}

    Option required();
    Option hidden();
    Option type_name(const std::string &name); // placeholder for the value in --help
    Option show_default();                     // shows the initial value of the variable in --help
    Option default_text(const std::string &text);
    Option separator(char c); // one argument may contain several values, separated by `c`
    Option one_value_each();  // for lists: each occurrence of the option takes one value
    Option range(double minimum, double maximum);
    Option one_of(const std::vector<std::string> &choices);
    Option existing_path();
    // `problem` returns an error message, or "" if the value is valid.
    Option check(const std::function<std::string(const std::string &value)> &problem);

private:
    CLI::Option *option_;
};

// If the only argument is `--describe`, parse() prints the definitions of options and commands as JSON, from which
// the build generates man pages and shell completions.
class CommandLine {
public:
    // `name`: the name in --help and in the man page, such as "arhost conform" for arhost-conform.
    explicit CommandLine(const std::string &description, const std::string &name = "");

    void version(const std::string &text);
    CommandLine group(const std::string &name, const std::string &description); // a heading in --help
    CommandLine subcommand(const std::string &name, const std::string &description);
    // A subcommand whose arguments, including --help, are not parsed; arguments() returns them.
    CommandLine raw_subcommand(const std::string &name, const std::string &description);

    // `names`: "FILE" (positional) or "-v,--verbose".
    template <class Value> Option option(const std::string &names, Value &value, const std::string &description = "");
    Option flag(const std::string &names, bool &value, const std::string &description);

    // Returns nullopt if the program should continue, otherwise its exit status: 0 after --help or --version, 2 after
    // invalid arguments.
    std::optional<int> parse(int argc, char **argv);
    bool selected() const; // whether the user has given this subcommand
    std::vector<std::string> arguments() const;
    std::vector<std::string> subcommands() const;
    std::string help(const std::string &subcommand = "") const;

private:
    explicit CommandLine(std::shared_ptr<CLI::App> app);

    std::shared_ptr<CLI::App> app_;
};

} // namespace arhost::command_line
