// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace rigcal {

// One id follows a request from the program that began it to the worker that serves it: every line
// that is logged about it names the id.

// The metadata key of a gRPC call.
inline constexpr char kCorrelationKey[] = "rigcal-correlation-id";
// The environment variable that hands an id to a program that is started.
inline constexpr char kCorrelationVariable[] = "RIGCAL_CORRELATION_ID";

// 16 random hexadecimal digits.
std::string NewCorrelationId();

// 1 to 64 letters, digits, '_', '-' or '.': what others send is used only if it is one.
bool IsCorrelationId(std::string_view text);

// Of this run of the program: the one in the environment if it is one, else a new one. The same at
// each call. Thread-safe.
const std::string& OwnCorrelationId();

}  // namespace rigcal
