// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/lens/board_view.h"
#include "common/session/observation_batch.h"
#include "common/session/session.h"

namespace rigcal::testing {

// The session with a checker as its target, and images of kKnownImage, of cameras without a lens.
Session OfBoard(Session session, const std::string& board = "board:checker,9x6,0.03");

// What KnownPinhole sees of that board, tilted to every side all over the image.
std::vector<BoardView> WavedViews(int count, uint32_t seed = 1);

// The views as rows of a stream, a tenth of a second apart; views without corners are rows in which
// nothing was seen.
ObservationBatch RowsOfViews(const StreamKey& stream, uint32_t first_seq,
                             const std::vector<BoardView>& views, double sigma_px = 0.05);

}  // namespace rigcal::testing
