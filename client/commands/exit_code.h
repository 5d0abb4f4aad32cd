// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "absl/status/status.h"

namespace rigcal::client {

// What the program ends with; part of the contract with scripts.
enum class ExitCode : int {
  kOk = 0,
  kFailed = 1,
  kUsage = 2,
  kBelowQualityGate = 3,
  kNotAllowed = 4,
  kNotVerified = 5,
  kServerUnreachable = 6,
  kCameraMoved = 7,
  kIncomplete = 8,
};

// The list that ends every --help.
inline constexpr std::string_view kExitCodeHelp =
    "Exit codes:\n"
    "  0  ok\n"
    "  1  failed\n"
    "  2  usage: the command line is wrong\n"
    "  3  calibrated, but below the quality gate (quality.grade is BAD)\n"
    "  4  not allowed\n"
    "  5  not verified: observations damaged, missing or waiting (session verify)\n"
    "  6  server unreachable\n"
    "  7  a camera has moved, or it cannot be told (monitor)\n"
    "  8  written in part: a camera was left out or is doubtful (import)\n"
    "Ended by a signal: 128 and its number, as the shell counts it.";

// UNAVAILABLE and DEADLINE_EXCEEDED: the server did not answer. UNAUTHENTICATED and
// PERMISSION_DENIED: not allowed. Everything else that is not OK: failed.
inline ExitCode ExitCodeOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return ExitCode::kOk;
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      return ExitCode::kServerUnreachable;
    case absl::StatusCode::kUnauthenticated:
    case absl::StatusCode::kPermissionDenied:
      return ExitCode::kNotAllowed;
    default:
      return ExitCode::kFailed;
  }
}

}  // namespace rigcal::client
