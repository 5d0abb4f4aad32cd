// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// Return the status of `expression` from the enclosing function unless it is OK.
#define RIGCAL_RETURN_IF_ERROR(expression)                                \
  do {                                                                    \
    if (absl::Status rigcal_status = (expression); !rigcal_status.ok()) { \
      return rigcal_status;                                               \
    }                                                                     \
  } while (false)

#define RIGCAL_CONCAT_INNER(a, b) a##b
#define RIGCAL_CONCAT(a, b) RIGCAL_CONCAT_INNER(a, b)

// `RIGCAL_ASSIGN_OR_RETURN(auto x, F())`: x is the value of the StatusOr, or its status is
// returned.
#define RIGCAL_ASSIGN_OR_RETURN(declaration, expression) \
  RIGCAL_ASSIGN_OR_RETURN_INNER(RIGCAL_CONCAT(rigcal_status_or_, __LINE__), declaration, expression)
#define RIGCAL_ASSIGN_OR_RETURN_INNER(temporary, declaration, expression) \
  auto temporary = (expression);                                          \
  if (!temporary.ok()) {                                                  \
    return std::move(temporary).status();                                 \
  }                                                                       \
  declaration = *std::move(temporary)
