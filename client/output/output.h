// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/message.h>

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "absl/status/status.h"

namespace rigcal::client {

// The contract of `-o json`: protobuf JSON with the proto's own field names and defaults printed.
// Messages that are not set are left out. Ends without a newline. `indented` false: one line.
std::string ToJson(const google::protobuf::Message& message, bool indented = true);

// Writes the file whole or not at all: a reader never sees half of it.
absl::Status ReplaceFile(const std::filesystem::path& path, const std::string& bytes);

// Our own JSON, indented like that of messages.
std::string JsonText(const nlohmann::ordered_json& json);

}  // namespace rigcal::client
