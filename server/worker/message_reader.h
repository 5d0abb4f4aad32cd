// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "server/worker/message_stream.h"

namespace rigcal::server {

// Reads messages from a descriptor to its end and calls `take` after each, until it gives an error.
// UNAVAILABLE: the descriptor cannot be read. DATA_LOSS: no messages, or the last one is cut off.
absl::Status ReadMessages(int descriptor, google::protobuf::MessageLite* message,
                          const std::function<absl::Status()>& take);

}  // namespace rigcal::server
