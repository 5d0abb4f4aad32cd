// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/command/board_pictures.h"
#include "common/board/board.h"
#include "common/lens/board_view.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

struct BoardViewsOptions {
  int views = 0;  // enough; 0: as many as there are
  // Of a camera or video that shows the same for long: views are taken only where a corner has
  // moved by 4 % of the image since every other view, and edges are about as sharp as elsewhere.
  bool only_different = false;
};

// What was seen of a board in the pictures of one camera.
struct BoardViews {
  ImageSize image_size_px;
  std::string camera;
  int pictures = 0;    // looked at
  int with_board = 0;  // of them
  // With a board, but as another one that was taken: of pictures that somebody has chosen, with
  // every corner within a pixel.
  int alike = 0;
  int blurred = 0;     // with a board, but not sharp
  // Files that are no picture of this camera: unreadable, or of another size than the first one.
  std::vector<Refusal> refused;
  std::vector<BoardView> views;
  std::optional<EventBoardCounts> events;  // of an event camera
};

// Takes views of the board from pictures until there are enough, or no more pictures, or 200
// pictures of a source without end have shown none. `taken` is called after each view and says
// whether more are wanted. FAILED_PRECONDITION: there were no pictures, or none shows the board;
// where boards with other counts are found instead, also by most pictures of which a few show the
// board by chance, they are named; of events, what they show instead. Other errors are those of the source.
absl::StatusOr<BoardViews> CollectBoardViews(const Board& board, const BoardViewsOptions& options,
                                             BoardPictures* pictures,
                                             const std::function<bool(const BoardViews&)>& taken);

}  // namespace rigcal::agent
