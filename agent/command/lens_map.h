// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "agent/command/board_views.h"
#include "common/lens/lens_solver.h"

namespace rigcal::agent {

// A PNG: the uncertainty of a lens over the image in colours, with a scale in px, and a dot for
// each corner that was seen. Grey: the lens has no ray there. FAILED_PRECONDITION: the uncertainty
// is not determined.
absl::StatusOr<std::string> DrawLensMap(const BoardViews& views, const LensSolution& solution);

}  // namespace rigcal::agent
