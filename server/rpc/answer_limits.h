// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/session.pb.h"

namespace rigcal::server {

// Of one session or calibration in an answer. Clients accept 4 MiB; a page has at most one such
// more than its own limit (list_arguments.h).
inline constexpr size_t kMaxResourceBytes = size_t{2} << 20;

// Shortens what only explains until the message is within the limit: first the examples of what was
// refused, then the clock epochs and streams of each camera but the newest. Counts stay.
void FitAnswer(v1::Session* session);
// The same: examples, then the advice of findings and reasons of the grade. Rows that a request
// brought itself (OriginOptions.measured) are never sent back.
void FitAnswer(v1::Calibration* calibration);

}  // namespace rigcal::server
