// SPDX-License-Identifier: Apache-2.0
#include "yaml/hints.hpp"

#include "base/text.hpp"

#include <algorithm>
#include <vector>

namespace arhost::yaml {
namespace {

constexpr std::string_view blanks = " \t\r";

std::vector<std::string_view> lines_up_to(std::string_view text, std::size_t last) {
    std::vector<std::string_view> lines;
    for (std::size_t begin = 0; begin <= text.size() && lines.size() <= last;) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        lines.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return lines;
}

std::string_view without_indentation(std::string_view line) {
    return line.substr(std::min(line.find_first_not_of(blanks), line.size()));
}

bool is_key_character(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
}

// Returns the position of a '#' that follows a colon, a comma or a bracket and has no blank after it, as in
// "{colour: #ff0000}"; npos if there is none.
std::size_t bare_hash_in(std::string_view line) {
    for (std::size_t at = line.find('#'); at != std::string_view::npos; at = line.find('#', at + 1)) {
        const std::size_t before = line.substr(0, at).find_last_not_of(blanks);
        if (before != std::string_view::npos && before + 1 < at && at + 1 < line.size() &&
            std::string_view(":,[{").find(line[before]) != std::string_view::npos &&
            blanks.find(line[at + 1]) == std::string_view::npos)
            return at;
    }
    return std::string_view::npos;
}

std::string in_line(std::size_t line) {
    return "in line " + std::to_string(line + 1) + ", ";
}

} // namespace

std::string hint_for_missing_space(std::string_view scalar) {
    while (scalar.starts_with("- "))
        scalar = without_indentation(scalar.substr(2));
    const auto colon = static_cast<std::size_t>(std::ranges::find_if_not(scalar, is_key_character) - scalar.begin());
    const bool is_url_or_path = scalar.substr(std::min(colon, scalar.size())).starts_with(":/");
    if (colon == 0 || colon + 1 >= scalar.size() || scalar[colon] != ':' || is_url_or_path ||
        blanks.find(scalar[colon + 1]) != std::string_view::npos)
        return "";
    std::string_view value = scalar.substr(colon + 1);
    value = value.substr(0, value.find_first_of(" \t\r,]}"));
    return "; write a space after the colon: '" +
           base::printable(std::string(scalar.substr(0, colon + 1)) + " " + std::string(value), 60) + "'";
}

std::string hint_for_syntax_error(std::string_view text, std::size_t line) {
    const std::vector<std::string_view> lines = lines_up_to(text, line);
    if (line < lines.size()) {
        const std::string_view indentation =
            lines[line].substr(0, lines[line].size() - without_indentation(lines[line]).size());
        if (indentation.find('\t') != std::string_view::npos)
            return "; line " + std::to_string(line + 1) + " is indented with a tab; use spaces";
    }
    // In a block, the parser notices the error in the next line.
    for (std::size_t i = std::min(line + 1, lines.size()); i-- > (line == 0 ? 0 : line - 1);)
        if (const std::string hint = hint_for_missing_space(without_indentation(lines[i])); !hint.empty())
            return "; " + in_line(i) + hint.substr(2);
    // In a flow map, the rest of the line is lost, and the parser looks for the closing bracket up to the end.
    for (std::size_t i = lines.size(); i-- > 0;)
        if (const std::size_t hash = bare_hash_in(lines[i]); hash != std::string_view::npos) {
            const std::string_view value = lines[i].substr(hash, lines[i].find_first_of(" \t\r,]}", hash) - hash);
            return "; " + in_line(i) + "'#' starts a comment; put the value in quotes: '" +
                   base::printable(std::string(value), 60) + "'";
        }
    return "";
}

} // namespace arhost::yaml
