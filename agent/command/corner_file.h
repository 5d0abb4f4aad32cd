// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "agent/command/board_views.h"
#include "common/board/board.h"

namespace rigcal::agent {

// The points of the board in every view, as a vnlog of mrcal (its --corners-cache): a line
// "file x y" for each point, row by row of the board, "-" where it was not seen. Pixels, the centre
// of the first one is (0, 0).
std::string CornersText(const Board& board, const BoardViews& views);

}  // namespace rigcal::agent
