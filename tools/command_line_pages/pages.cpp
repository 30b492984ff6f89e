// SPDX-License-Identifier: Apache-2.0
//
// command-line-pages man|bash|zsh|fish < DESCRIPTION
//
// Generates a program's man page or shell completion from the definitions of its command line, which the program
// prints with `--describe`. Placeholders determine which values are completed: FILE and PLUGIN as files, FOLDER and
// DIR as folders, choices as they are.
#include "command_line/description.hpp"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <string_view>

namespace {

using arhost::command_line::CommandDescription;
using arhost::command_line::OptionDescription;

std::string joined(const std::vector<std::string> &words, std::string_view separator) {
    std::string text;
    for (const std::string &word : words)
        text.append(text.empty() ? "" : separator).append(word);
    return text;
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
        text.replace(at, from.size(), to);
    return text;
}

std::string first_line(const std::string &text) {
    return text.substr(0, text.find('\n'));
}

bool takes_file(const OptionDescription &option) {
    return option.value.starts_with("FILE") || option.value == "PLUGIN" ||
           option.value.find("PATH") != std::string::npos || option.positional == "FILE" ||
           option.positional == "PLUGIN" || option.positional == "scene";
}

bool takes_folder(const OptionDescription &option) {
    return option.value == "FOLDER" || option.value == "DIR";
}

std::vector<std::string> option_names(const CommandDescription &command) {
    std::vector<std::string> names;
    for (const OptionDescription &option : command.options)
        names.insert(names.end(), option.names.begin(), option.names.end());
    return names;
}

std::string first_sentence(const std::string &text) {
    return text.substr(0, std::min(text.find('.'), text.find('\n')));
}

const OptionDescription *first_positional(const CommandDescription &command) {
    const auto found = std::ranges::find_if(command.options, [](const auto &o) { return !o.positional.empty(); });
    return found == command.options.end() ? nullptr : &*found;
}

// "arhost conform" → "arhost-conform"
std::string program_name(const CommandDescription &program) {
    return replaced(program.name, " ", "-");
}

// The shell function that completes a command: "arhost new-plugin" → "_arhost_new_plugin"
std::string function_name(const std::string &command) {
    return "_" + replaced(replaced(command, " ", "_"), "-", "_");
}

// ---- Man pages ---------------------------------------------------------------------------------------------------

std::string roff(const std::string &text) {
    std::string escaped = replaced(replaced(text, "\\", "\\e"), "-", "\\-");
    escaped = replaced(escaped, "\n.", "\n\\&.");
    escaped = replaced(escaped, "\n'", "\n\\&'");
    return escaped.starts_with('.') || escaped.starts_with('\'') ? "\\&" + escaped : escaped;
}

std::string man_option(const OptionDescription &option) {
    std::string text = ".TP\n";
    const std::string value = option.value.empty() ? "" : " \\fI" + roff(option.value) + "\\fR";
    std::vector<std::string> forms;
    for (const std::string &name : option.names)
        forms.push_back("\\fB" + roff(name) + "\\fR" + value);
    if (!option.positional.empty())
        forms.insert(forms.begin(), "\\fI" + roff(option.positional) + "\\fR");
    text += joined(forms, ", ") + "\n" + roff(option.help.empty() ? option.value : option.help);
    if (!option.choices.empty())
        text += "; one of: " + roff(joined(option.choices, ", "));
    return text + ".\n";
}

std::string synopsis(const std::string &name, const CommandDescription &command) {
    std::string text = "\\fB" + roff(name) + "\\fR [\\fIOPTIONS\\fR]";
    for (const OptionDescription &option : command.options)
        if (!option.positional.empty())
            text += std::string(option.is_required ? " " : " [") + "\\fI" + roff(option.positional) + "\\fR" +
                    (option.is_required ? "" : "]");
    return text + "\n";
}

std::string man_page(const CommandDescription &program) {
    const std::string name = program_name(program);
    std::string summary = first_sentence(program.description);
    if (summary.starts_with(name + " ")) // "arhost overlays …"
        summary.erase(0, name.size() + 1);
    std::string upper = name;
    std::ranges::transform(upper, upper.begin(),
                           [](char c) { return c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c; });
    std::string text = ".TH " + roff(upper) + " 1 \"\" arhost \"arhost manual\"\n.SH NAME\n" + roff(name) + " \\- " +
                       roff(summary) + "\n.SH SYNOPSIS\n" + synopsis(program.name, program);
    for (const CommandDescription &command : program.commands)
        text += ".br\n" + synopsis(program.name + " " + command.name, command);
    text += ".SH DESCRIPTION\n" + roff(program.description) + "\n.SH OPTIONS\n";
    for (const OptionDescription &option : program.options)
        text += man_option(option);
    if (!program.commands.empty())
        text += ".SH COMMANDS\n";
    for (const CommandDescription &command : program.commands) {
        text += ".SS " + roff(program.name + " " + command.name) + "\n" + roff(command.description) + ".\n";
        if (command.is_program)
            text += "See " + roff(name + "-" + command.name) + "(1).\n";
        for (const OptionDescription &option : command.options)
            text += man_option(option);
    }
    return text;
}

// ---- bash --------------------------------------------------------------------------------------------------------

std::string bash_values(const OptionDescription &option) {
    if (!option.choices.empty())
        return "_arhost_words '" + joined(option.choices, " ") + "'";
    return takes_file(option) ? "_arhost_paths -f" : takes_folder(option) ? "_arhost_paths -d" : ":";
}

std::string bash_command(const CommandDescription &command) {
    std::string text;
    for (const OptionDescription &option : command.options)
        if (!option.value.empty() && !option.names.empty())
            text += "        " + joined(option.names, " | ") + ") " + bash_values(option) + "; return ;;\n";
    std::string subcommands;
    for (const CommandDescription &sub : command.commands)
        subcommands += (subcommands.empty() ? "" : " ") + sub.name;
    text = "        case $prev in\n" + text +
           "        esac\n        if [[ $cur == -* ]]; then\n            _arhost_words '" +
           joined(option_names(command), " ") + "'\n            return\n        fi\n";
    // A folder may have the same name as a command.
    if (!subcommands.empty())
        text += "        _arhost_words '" + subcommands + "'\n        [[ $cur && ${COMPREPLY[*]} ]] && return\n";
    if (const OptionDescription *positional = first_positional(command))
        text += "        " + bash_values(*positional) + "\n";
    return text;
}

std::string bash_completion(const CommandDescription &program) {
    const std::string function = function_name(program.name);
    std::string names, cases;
    for (const CommandDescription &command : program.commands) {
        names += (names.empty() ? "" : " | ") + command.name;
        cases += "    " + command.name + ")\n" +
                 (command.is_program ? "        " + function_name(program.name + " " + command.name) + "\n"
                                     : bash_command(command)) +
                 "        ;;\n";
    }
    return "# bash completion of " + program.name + ", generated from the definitions of its command line.\n" +
           "_arhost_words() {\n    local word\n    while read -r word; do COMPREPLY+=(\"$word\"); done < <(compgen "
           "-W "
           "\"$1\" -- \"$cur\")\n}\n"
           "_arhost_paths() {\n    local path\n    compopt -o filenames 2>/dev/null\n    while read -r path; do "
           "COMPREPLY+=(\"$path\"); done < <(compgen \"$1\" -- \"$cur\")\n}\n" +
           function +
           "() {\n    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} command= word\n" +
           "    COMPREPLY=()\n" +
           (names.empty()
                ? ""
                : "    for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n        case $word in\n        " + names +
                      ") command=$word; break ;;\n        esac\n    done\n") +
           "    case $command in\n" + cases + "    *)\n" + bash_command(program) +
           "        ;;\n    esac\n}\ncomplete -F " + function + " " + program_name(program) + "\n";
}

// ---- zsh ---------------------------------------------------------------------------------------------------------

std::string zsh_text(const std::string &text) {
    std::string escaped = replaced(first_line(text), "'", "'\\''");
    for (const char *special : {"[", "]", ":"})
        escaped = replaced(escaped, special, std::string("\\") + special);
    return escaped;
}

std::string zsh_values(const OptionDescription &option) {
    const std::string label = ":" + zsh_text(option.value.empty() ? option.positional : option.value) + ":";
    if (!option.choices.empty())
        return label + "(" + joined(option.choices, " ") + ")";
    return label + (takes_file(option) ? "_files" : takes_folder(option) ? "_files -/" : " ");
}

// Returns the arguments of _arguments.
std::string zsh_specs(const CommandDescription &command, bool with_positionals) {
    std::string text;
    int position = 0;
    for (const OptionDescription &option : command.options) {
        const std::string exclusive = option.is_repeatable ? "*" : "(" + joined(option.names, " ") + ")";
        for (const std::string &name : option.names)
            text += " \\\n        '" + exclusive + name + "[" + zsh_text(option.help) + "]" +
                    (option.value.empty() ? "" : zsh_values(option)) + "'";
        if (with_positionals && !option.positional.empty())
            text += " \\\n        '" + std::to_string(++position) + (option.is_required ? "" : ":") +
                    zsh_values(option) + "'";
    }
    return text + "\n";
}

std::string zsh_completion(const CommandDescription &program) {
    const std::string function = function_name(program.name);
    std::string text = program.commands.empty() ? "" : "#compdef " + program_name(program) + "\n";
    text += function + "() {\n";
    if (program.commands.empty())
        return text + "    _arguments -S -s" + zsh_specs(program, true) + "}\n";
    std::string names, cases;
    for (const CommandDescription &command : program.commands) {
        names += " \\\n            '" + command.name + ":" + zsh_text(command.description) + "'";
        cases += "        " + command.name + ")\n    " +
                 (command.is_program ? function_name(program.name + " " + command.name) + "\n"
                                     : "_arguments -S -s" + zsh_specs(command, true)) +
                 "        ;;\n";
    }
    text += "    local curcontext=\"$curcontext\" state line\n    local -a commands\n    _arguments -C -S -s" +
            zsh_specs(program, false);
    text.pop_back();
    text +=
        " \\\n        '1: :->first' \\\n        '*::: :->rest'\n    case $state in\n    first)\n        commands=(" +
        names +
        ")\n        _describe -t commands command commands\n        _files\n        ;;\n    rest)\n"
        "        words=($line[1] \"${words[@]}\")\n        (( CURRENT += 1 ))\n        case $line[1] in\n" +
        cases + "        esac\n        ;;\n    esac\n}\n";
    return text;
}

// ---- fish --------------------------------------------------------------------------------------------------------

std::string fish_text(const std::string &text) {
    return "'" + replaced(replaced(first_line(text), "\\", "\\\\"), "'", "\\'") + "'";
}

std::string fish_options(const std::string &complete, const CommandDescription &command) {
    std::string text;
    for (const OptionDescription &option : command.options) {
        if (option.names.empty()) {
            if (!option.choices.empty())
                text += complete + " -f -a '" + joined(option.choices, " ") + "'\n";
            continue;
        }
        text += complete;
        for (const std::string &name : option.names)
            text += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
        if (!option.choices.empty())
            text += " -x -a '" + joined(option.choices, " ") + "'";
        else if (!option.value.empty())
            text += takes_file(option) || takes_folder(option) ? " -r -F" : " -x";
        text += " -d " + fish_text(option.help) + "\n";
    }
    return text;
}

std::string fish_completion(const CommandDescription &program) {
    const std::size_t space = program.name.find(' '); // "arhost conform" is completed as a command of arhost
    const std::string complete = "complete -c " + program.name.substr(0, space) + " -n ";
    const auto within = [&](const std::string &command) {
        return complete + "'__fish_seen_subcommand_from " + command + "'";
    };
    if (space != std::string::npos)
        return fish_options(within(program.name.substr(space + 1)), program);
    std::string text = program.commands.empty() ? fish_options("complete -c " + program.name, program)
                                                : fish_options(complete + "__fish_use_subcommand", program);
    for (const CommandDescription &command : program.commands) {
        text +=
            complete + "__fish_use_subcommand -a " + command.name + " -d " + fish_text(command.description) + "\n";
        text += fish_options(within(command.name), command);
    }
    return text;
}

} // namespace

int main(int argc, char **argv) {
    const std::string_view kind = argc > 1 ? argv[1] : "";
    const auto program = nlohmann::json::parse(std::cin).get<CommandDescription>();
    const std::string page = kind == "man"    ? man_page(program)
                             : kind == "bash" ? bash_completion(program)
                             : kind == "zsh"  ? zsh_completion(program)
                                              : fish_completion(program);
    std::fputs(page.c_str(), stdout);
    return 0;
}
