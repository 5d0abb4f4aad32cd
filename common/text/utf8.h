// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace rigcal {

// Protobuf strings must be UTF-8; what users type, and names of files, need not be. Overlong forms
// and surrogates are not UTF-8.
bool IsUtf8(std::string_view text);

}  // namespace rigcal
