// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal::server {

// The OpenAPI 3.0 description of the JSON API, as JSON: every route with its parameters, body and
// answer, and every message and enum that they reach. Made from the proto files and ApiRoutes.
std::string ApiDescription();

}  // namespace rigcal::server
