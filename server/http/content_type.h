// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace rigcal::server {

// The media type (RFC 9110, 8.3) of a file by the ending of its name: "text/html; charset=utf-8".
// "application/octet-stream": unknown.
std::string ContentTypeOf(std::string_view name);

}  // namespace rigcal::server
