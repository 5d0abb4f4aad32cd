// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal::testing {

// Sends one message to any method and returns the first answer, as a client without our stubs does.
absl::StatusOr<std::string> CallRaw(const std::shared_ptr<grpc::Channel>& channel,
                                    const std::string& method, const std::string& request);

// Asks the reflection service (grpc.reflection.v1alpha); request and answer in text format. An
// error is returned as text, too.
std::string Reflect(const std::shared_ptr<grpc::Channel>& channel, const std::string& request_text);

}  // namespace rigcal::testing
