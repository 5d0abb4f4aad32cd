// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace rigcal::client {

// The contract of `-o json`: protobuf JSON with the proto's own field names and defaults printed.
// Messages that are not set are left out. Ends without a newline. `indented` false: one line.
std::string ToJson(const google::protobuf::Message& message, bool indented = true);

// Our own JSON, indented like that of messages.
std::string JsonText(const nlohmann::ordered_json& json);

}  // namespace rigcal::client
