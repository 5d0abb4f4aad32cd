// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_solver.h"
#include "common/lens/next_view.h"
#include "common/session/session.h"
#include "server/store/store.h"

namespace rigcal::server {

// Views that a lens is made from at most: twice what is good. Where more differ, those are taken
// that differ by more.
inline constexpr size_t kMostLensViews = 60;

// What a session has seen of its board with one camera.
struct SessionViews {
  std::vector<BoardView> views;    // chosen: they differ and are sharp; in the order of time
  uint64_t observation_count = 0;  // that were read
  uint64_t board_count = 0;        // of them, with enough corners for a view
  int alike = 0;                   // of these, as another view
  int blurred = 0;                 // likewise, less sharp than others
};

// Reads the stored observations of a camera of the session and chooses the views. The points of a
// board of circles are images of circles where the camera had no lens, and corrected where it had.
// INVALID_ARGUMENT: the board of the target cannot be read; and the store's errors.
absl::StatusOr<SessionViews> ReadSessionViews(const Store& store, const Session& session,
                                              const SessionCamera& camera);

// FAILED_PRECONDITION, with what to do: the target of the session is no board; its observations
// were deleted. NOT_FOUND: no such camera in it, which names those there are.
absl::StatusOr<const SessionCamera*> FindLensCamera(const Session& session,
                                                    const std::string& camera);

// The lens of a camera of a session, as far as it is known.
struct SessionLens {
  enum class State : uint8_t { kReading = 1, kCollecting, kSolving, kSolved, kFailed };

  State state = State::kReading;
  std::string problem;  // why there is no lens, and what to do
  SessionViews seen;
  double covered_share = 0;
  std::vector<std::string> bare_sides;
  std::optional<LensSolution> solution;
  std::vector<int64_t> solution_times_ns;   // of the views it was made from
  uint64_t solution_observation_count = 0;  // that were read for it
  NextView next_view;                       // without words: not known
};

}  // namespace rigcal::server
