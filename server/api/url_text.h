// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::server {

// A named value of an address.
struct UrlParameter {
  std::string name;
  std::string value;

  friend bool operator==(const UrlParameter&, const UrlParameter&) = default;
};

// A percent-encoded text; `plus_is_space` within a query. None: "%" without two hexadecimal digits,
// a control character (encoded or not), or what is no UTF-8.
std::optional<std::string> DecodeUrlText(std::string_view text, bool plus_is_space);

// "a=1&b=x%20y". INVALID_ARGUMENT: it cannot be decoded, has a name twice, or more than 64 names.
absl::StatusOr<std::vector<UrlParameter>> ParseUrlQuery(std::string_view query);

}  // namespace rigcal::server
