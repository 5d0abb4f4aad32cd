// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "common/camera/intrinsics.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_solver.h"

namespace rigcal {

// FAILED_PRECONDITION: the boards were never tilted, or the focal length is uncertain by more than
// 3 %, so that it and the distance cannot be told apart. `tilts_deg`: of the views that were used.
absl::Status CheckTilt(const LensSolution& solution, const std::vector<double>& tilts_deg);

// What would make a solution better, sentence by sentence. `used`: the views it was made from;
// `tilts_deg`: theirs.
void AddAdvice(const ImageSize& image_size_px, const std::vector<BoardView>& used,
               std::vector<double> tilts_deg, LensSolution* solution);
// Likewise, of a solution with a bent board.
void AddBendAdvice(LensSolution* solution);

}  // namespace rigcal
