// SPDX-License-Identifier: Apache-2.0
//
// Recognises frequent mistakes in YAML and says how to fix them.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace arhost::yaml {

// Returns a hint to append to the message about a syntax error, such as "; line 3 is indented with a tab; use
// spaces". `line` is the line in which the parser noticed the error, counted from 0; the mistake may be in an earlier
// line. Returns "" if no frequent mistake is found.
std::string hint_for_syntax_error(std::string_view text, std::size_t line);

// If `scalar` begins with a key and a value without a space between them ("width:640"), returns "; write a space
// after the colon: 'width: 640'", otherwise "".
std::string hint_for_missing_space(std::string_view scalar);

} // namespace arhost::yaml
