// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/types/span.h"
#include "server/api/url_text.h"

namespace rigcal::server {

// One row of the JSON API: which RPC a method and path call.
struct ApiRoute {
  std::string_view method;  // "POST"
  std::string_view path;    // "/v1/sessions/{id}:start"; {id} is the field `id` of the request
  std::string_view rpc;     // "/rigcal.v1.SessionService/StartSession"
  std::string_view summary;
  // A bytes field of the answer that is served as it is, with its content type, unless the answer
  // has one in a field `content_type`; with a field `file_name` it is a download. Empty: the whole
  // answer, as JSON.
  std::string_view bytes_field = {};
  std::string_view content_type = "application/json";

  // Fields come from the address; else from a JSON body and the variables of the path.
  bool HasBody() const { return method == "POST"; }
};

// Every route.
absl::Span<const ApiRoute> ApiRoutes();

// An RPC that the JSON API leaves out, and why.
struct RpcWithoutRoute {
  std::string_view rpc;
  std::string_view reason;
};
absl::Span<const RpcWithoutRoute> RpcsWithoutRoute();

// What a method and path lead to.
struct ApiMatch {
  const ApiRoute* route = nullptr;      // null: no route has this path with this method
  std::vector<UrlParameter> variables;  // of the path
  std::string allowed_methods;          // of this path: "GET, POST"; empty: no route has it
};
// `path` as it came: percent-encoded, without the query.
ApiMatch MatchApiRoute(std::string_view method, std::string_view path);

// Names of the variables of a path: "id".
std::vector<std::string> VariablesOf(std::string_view path);

}  // namespace rigcal::server
