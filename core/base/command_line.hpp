// SPDX-License-Identifier: Apache-2.0
//
// Command-line parsing. Wraps CLI11, whose headers take seconds to compile, so that one file includes them.
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

namespace arhost::base {

class Option {
public:
    explicit Option(CLI::Option *option) : option_(option) {}

    Option required();
    Option hidden();
    Option type_name(const std::string &name); // in --help
    Option show_default();                     // in --help: the variable's present value
    Option default_text(const std::string &text);
    Option separator(char c); // between the values of one argument
    Option one_value_each();  // a list: one value per occurrence of the option
    Option range(int minimum, int maximum);
    Option range(double minimum, double maximum);
    Option one_of(const std::vector<std::string> &choices);
    Option existing_path();
    Option check(const std::function<std::string(const std::string &value)> &problem); // returns "" if valid

private:
    CLI::Option *option_;
};

class CommandLine {
public:
    explicit CommandLine(const std::string &description, const std::string &name = "");

    void version(const std::string &text);
    CommandLine group(const std::string &name, const std::string &description); // a heading in --help
    CommandLine subcommand(const std::string &name, const std::string &description);
    // Leaves all its arguments, --help included, to arguments().
    CommandLine raw_subcommand(const std::string &name, const std::string &description);

    // `names`: "FILE" (positional) or "-v,--verbose".
    template <class Value> Option option(const std::string &names, Value &value, const std::string &description = "");
    Option flag(const std::string &names, bool &value, const std::string &description);

    // The exit status if the program ends here: 0 after --help or --version, 2 after invalid arguments.
    std::optional<int> parse(int argc, char **argv);
    bool selected() const; // a subcommand
    std::vector<std::string> arguments() const;
    std::string help() const;

private:
    explicit CommandLine(std::shared_ptr<CLI::App> app);

    std::shared_ptr<CLI::App> app_;
};

} // namespace arhost::base
