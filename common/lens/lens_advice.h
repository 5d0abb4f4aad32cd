// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/camera/intrinsics.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_solver.h"

namespace rigcal {

// FAILED_PRECONDITION: the boards were never tilted, or the focal length is uncertain by more than
// 3 %, so that it and the distance cannot be told apart; or half of the image is known within 50 px
// at best. `tilts_deg`: of the views that were used.
absl::Status CheckTilt(const LensSolution& solution, const std::vector<double>& tilts_deg);

// What would make a solution better, sentence by sentence. `used`: the views it was made from;
// `tilts_deg`: theirs.
void AddAdvice(const ImageSize& image_size_px, const std::vector<BoardView>& used,
               std::vector<double> tilts_deg, LensSolution* solution);
// Likewise, of a solution with a bent board.
void AddBendAdvice(LensSolution* solution);

// Why nobody should use this lens: its errors, or the distance of its halves, say that the pictures
// do not show what was told. Empty: no reason.
std::string WhyNotToUse(const LensSolution& solution);

}  // namespace rigcal
