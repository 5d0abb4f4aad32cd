// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <string_view>
#include <type_traits>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace rigcal {

// Runs a round of a worker's loop, or a callback of others in it, and returns its status; OK for
// one without. What it throws becomes INTERNAL with `what` in front: an exception that leaves a
// thread ends the whole program. Who calls it logs the error once, with what to do, and goes on or
// reports itself as failed.
template <typename Body>
absl::Status Guarded(std::string_view what, Body&& body) {
  const auto failed = [what](absl::string_view why) {
    return absl::InternalError(
        absl::StrCat(absl::string_view(what.data(), what.size()), ": ", why));
  };
  try {
    if constexpr (std::is_void_v<std::invoke_result_t<Body>>) {
      std::forward<Body>(body)();
      return absl::OkStatus();
    } else {
      return std::forward<Body>(body)();
    }
  } catch (const std::exception& error) {
    return failed(error.what());
  } catch (...) {
    return failed("an exception of an unknown kind");
  }
}

}  // namespace rigcal
