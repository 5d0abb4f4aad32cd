// SPDX-License-Identifier: Apache-2.0
#include "tests/server/lens/board_session.h"

#include <algorithm>

#include "common/board/board.h"
#include "common/target/target.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::testing {
namespace {

Board KnownBoard() { return *ParseBoard("board:checker,9x6,0.03"); }

}  // namespace

Session OfBoard(Session session, const std::string& board) {
  session.target = *MakeBoardTarget(*ParseBoard(board));
  for (SessionCamera& camera : session.cameras) {
    camera.description.image_size_px = kKnownImage;
    camera.description.intrinsics.reset();
  }
  return session;
}

std::vector<BoardView> WavedViews(int count, uint32_t seed) {
  const Board board = KnownBoard();
  const Intrinsics lens = KnownPinhole();
  return SeenBoards(board, lens, kKnownImage,
                    WavedBoard(board, lens, kKnownImage, count, 0.3, 0.5, 0.7, seed), 0.05, seed);
}

ObservationBatch RowsOfViews(const StreamKey& stream, uint32_t first_seq,
                             const std::vector<BoardView>& views, double sigma_px) {
  const std::vector<Eigen::Vector3d> points = KnownBoard().Points();
  ObservationBatch batch;
  batch.stream = stream;
  batch.first_seq = first_seq;
  batch.marker_count = static_cast<uint32_t>(points.size());
  for (size_t i = 0; i < views.size(); ++i) {
    Observation row;
    row.time_ns = 100'000'000 * static_cast<int64_t>(first_seq + i);
    row.markers.resize(points.size());
    for (const BoardCorner& corner : views[i].corners) {
      const auto point = std::find(points.begin(), points.end(), corner.x_in_board_m);
      MarkerObservation& marker = row.markers[static_cast<size_t>(point - points.begin())];
      marker.visible = true;
      marker.centre_px = corner.pixel;
      marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    }
    batch.Append(row);
  }
  return batch;
}

}  // namespace rigcal::testing
