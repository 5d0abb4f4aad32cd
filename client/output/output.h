// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "client/output/console.h"

namespace rigcal::client {

// The contract of `-o json`: protobuf JSON with the proto's own field names and defaults printed.
// Messages that are not set are left out. Ends without a newline. `indented` false: one line.
std::string ToJson(const google::protobuf::Message& message, bool indented = true);

// ToJson and a newline on `console.out`.
void PrintJson(Console& console, const google::protobuf::Message& message, bool indented = true);

}  // namespace rigcal::client
