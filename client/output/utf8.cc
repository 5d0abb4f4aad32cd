// SPDX-License-Identifier: Apache-2.0
#include "client/output/utf8.h"

#include <nlohmann/json.hpp>

namespace rigcal::client {

bool IsUtf8(const std::string& text) {
  try {
    nlohmann::json(text).dump();
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

}  // namespace rigcal::client
