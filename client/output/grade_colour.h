// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace rigcal::client {

// Text for people with the grades in it in colour, by escape sequences of terminals: behind
// "Quality: " at the beginning of a line, and in the column "quality" of a table, which ends with
// an empty line. good is green, usable yellow, bad red.
std::string ColourGrades(std::string_view text);

}  // namespace rigcal::client
