// SPDX-License-Identifier: Apache-2.0
#include "server/lens/session_lens.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/board/board.h"
#include "common/lens/view_choice.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::server {
namespace {

constexpr size_t kLeastCorners = 6;  // of a view
// One sigma of a corner that is as good as any, pixels.
constexpr double kSharpSigmaPx = 0.1;

// The row as a view; too few corners: it shows no board.
BoardView ViewOf(const ObservationBatch& batch, size_t row, const Target& target, double radius_m) {
  BoardView view;
  for (uint32_t m = 0; m < batch.marker_count && m < target.points.size(); ++m) {
    if (!batch.IsVisible(row, m)) continue;
    const size_t i = row * batch.marker_count + m;
    const TargetPoint& point = target.points[m];
    view.corners.push_back(
        {{point.x_m, point.y_m, point.z_m}, {batch.x_px[i], batch.y_px[i]}, radius_m});
  }
  return view;
}

// The median sigma of the corners, which grows as edges become wider.
double BlurOf(const ObservationBatch& batch, size_t row) {
  std::vector<double> sigmas;
  for (uint32_t m = 0; m < batch.marker_count; ++m) {
    if (!batch.IsVisible(row, m)) continue;
    const size_t i = row * batch.marker_count + m;
    sigmas.push_back(std::sqrt(0.5 * (batch.cov_xx_px2[i] + batch.cov_yy_px2[i])));
  }
  return UpperMedian(&sigmas);
}

}  // namespace

absl::StatusOr<const SessionCamera*> FindLensCamera(const Session& session,
                                                    const std::string& camera) {
  if (session.target.board.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the target of session '", session.id, "' is no board, and a lens is made from one: ",
        "record a session with --target board:checker,9x6,0.025 (the counts and the side of your "
        "board), or make the lens on the PC of the camera with `rigcal-agent intrinsics`"));
  }
  if (session.observations_delete_utc_ns != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("the observations of session '", session.id,
                     "' were deleted; record again, or restore a backup"));
  }
  const SessionCamera* const found = session.FindCamera(camera);
  if (found != nullptr) return found;
  std::vector<std::string> names;
  for (const SessionCamera& other : session.cameras) names.push_back(other.description.camera);
  return absl::NotFoundError(absl::StrCat("session '", session.id, "' has no camera '", camera, "'",
                                          names.empty() ? ": it has not been started" : "; it has ",
                                          absl::StrJoin(names, ", ")));
}

absl::StatusOr<SessionViews> ReadSessionViews(const Store& store, const Session& session,
                                              const SessionCamera& camera) {
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(session.target.board));
  const double radius_m = camera.description.intrinsics ? 0 : 0.5 * board.CircleDiameter();
  ViewChoice choice(camera.description.image_size_px,
                    {.sharp = kSharpSigmaPx, .most = kMostLensViews});
  SessionViews seen;
  int64_t first_ns = std::numeric_limits<int64_t>::max();
  const auto take = [&](StoredBatch stored) -> absl::Status {
    if (stored.damaged_rows > 0 || stored.late) return absl::OkStatus();
    for (const ObservationBatch& batch : AcceptedRows(std::move(stored))) {
      seen.observation_count += batch.rows();
      for (size_t row = 0; row < batch.rows(); ++row) {
        first_ns = std::min(first_ns, batch.time_ns[row]);
        BoardView view = ViewOf(batch, row, session.target, radius_m);
        if (view.corners.size() < kLeastCorners) continue;
        ++seen.board_count;
        view.time_ns = batch.time_ns[row];
        choice.Offer(view, BlurOf(batch, row));
      }
    }
    return absl::OkStatus();
  };
  RIGCAL_RETURN_IF_ERROR(store.ReadObservations(session.id, camera.description.camera, take));
  seen.views = choice.views();
  // Streams of an agent that was started again come in any order.
  std::ranges::stable_sort(seen.views, {}, &BoardView::time_ns);
  for (BoardView& view : seen.views) {
    view.name =
        absl::StrFormat("view at %.1f s", 1e-9 * static_cast<double>(view.time_ns - first_ns));
  }
  seen.alike = choice.alike();
  seen.blurred = choice.blurred();
  return seen;
}

}  // namespace rigcal::server
