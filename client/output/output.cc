// SPDX-License-Identifier: Apache-2.0
#include "client/output/output.h"

#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

namespace rigcal::client {

std::string ToJson(const google::protobuf::Message& message, bool indented) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = indented;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  // It fails only for Any and for timestamps outside the years 1 to 9999, which no message here has
  // unless the server is broken; what was written up to there is no JSON.
  if (const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
      !status.ok()) {
    return "null";
  }
  while (!json.empty() && json.back() == '\n') json.pop_back();
  return json;
}

std::string JsonText(const nlohmann::ordered_json& json) {
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace rigcal::client
