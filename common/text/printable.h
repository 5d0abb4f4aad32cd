// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace rigcal {

// A text from elsewhere as it may be shown on one line of a log or a terminal: control characters
// (newline and escape among them), characters that change the direction of writing, line and
// paragraph separators, and bytes that are no UTF-8 become \n, \r, \t, \x1b or \u202e. Other text
// stays as it is.
std::string Printable(std::string_view text);
// The same for a text of several lines.
std::string PrintableLines(std::string_view text);

// The beginning of a text, at most `bytes` long, not cut within a character.
std::string_view Beginning(std::string_view text, size_t bytes);

}  // namespace rigcal
