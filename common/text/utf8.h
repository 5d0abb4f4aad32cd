// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace rigcal {

// Protobuf strings and logs must be UTF-8; what a user types need not be. Overlong forms and
// surrogates pass: protobuf checks no more than the continuation bytes of each lead byte.
bool IsUtf8(std::string_view text);

}  // namespace rigcal
