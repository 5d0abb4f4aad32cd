// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rigcal {

// The known name that `name` was most likely meant to be: the fewest letters inserted, left out,
// changed or exchanged with their neighbour, at most one in three. Empty: none is near.
std::string NearestName(std::string_view name, const std::vector<std::string>& known);

// `unknown option "fpss"; did you mean "fps"?`, or the list of known names if none is near.
std::string UnknownName(std::string_view noun, std::string_view name,
                        const std::vector<std::string>& known);

// Text from outside for a message: short and printable.
std::string Shown(std::string_view text);

}  // namespace rigcal
