// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"
#include "common/board/board.h"

namespace rigcal::agent {

// A board in a picture: for each point of Board::Points(), by index, the pixel that shows it; not a
// number where a point is not seen: of a board with markers, or a corner of a checker that is no
// corner (blurred, covered). The centre of the first pixel is (0,
// 0). The order is that of a board seen from its front, never mirrored; where a checker has no
// twin, the square between points (0, 0) and (1, 1) is black; where it has one, point 0 is the one
// of the two that is nearer to the picture's upper left.
struct SeenBoard {
  std::vector<Eigen::Vector2d> pixels;
  bool Sees(size_t point) const { return pixels[point].allFinite(); }
  // One sigma of each pixel along either axis; empty: not known (circles).
  std::vector<double> sigmas_px;
  // Of an edge between black and white, from 10 to 90 % of the step, median, pixels: about 2 is
  // sharp. 0: not known (circles).
  double edge_width_px = 0;
};

// Searches a picture for the board with OpenCV, a board with markers for those of its points that
// it shows, any other for the whole: checkers by findChessboardCornersSB (Duda and Frese 2018) and
// FitCorner, circles by findCirclesGrid and the centroid of their darkness, or of their brightness
// where they are white on dark. The centroid
// of an ellipse is not the image of the centre; nothing corrects for that here. None: it does not
// show the board, or not all of it. INTERNAL: OpenCV failed.
enum class BoardSearch : uint8_t {
  // A checker in a large image at half the resolution: 0.1 s for 1.3 megapixels; circles only dark.
  kQuick = 1,
  kThorough,  // a checker also in full: 0.5 s more where it is not there; circles also white
};
absl::StatusOr<std::optional<SeenBoard>> FindBoard(const Board& board, const ImageView& image,
                                                   BoardSearch time = BoardSearch::kThorough);

// A checker that was seen at `last_px` of the last image, which is of the same size: its corners
// are followed by the flow of the image, and each is proved by a fit. None: some are not, or the
// board is no checker; search for it.
absl::StatusOr<std::optional<SeenBoard>> FollowBoard(const Board& board, const ImageView& last,
                                                     const std::vector<Eigen::Vector2d>& last_px,
                                                     const ImageView& image);

}  // namespace rigcal::agent
