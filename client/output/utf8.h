// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal::client {

// Protobuf strings must be UTF-8; what a user types need not be.
bool IsUtf8(const std::string& text);

}  // namespace rigcal::client
