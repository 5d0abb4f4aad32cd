// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <string_view>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace rigcal::agent {

// UNAVAILABLE, "WHAT: why", with the SDK's message of several lines on one.
absl::Status MetavisionFailure(std::string_view what, std::string_view why);

// INVALID_ARGUMENT: a setting that the camera does not offer or take.
template <typename... Pieces>
absl::Status NotOffered(const Pieces&... pieces) {
  return absl::InvalidArgumentError(absl::StrCat(pieces...));
}

// Calls the SDK; its exceptions become a status.
template <typename Function>
absl::Status WithoutExceptions(std::string_view what, Function&& run) {
  try {
    run();
    return absl::OkStatus();
  } catch (const std::exception& error) {
    return MetavisionFailure(what, error.what());
  } catch (...) {
    return MetavisionFailure(what, "the SDK threw something that is no exception of C++'s library");
  }
}

}  // namespace rigcal::agent
