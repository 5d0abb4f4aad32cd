// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/camera/intrinsics_vector.h"
#include "common/geometry/rigid_transform.h"
#include "common/lens/board_bend.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_adjustment.h"
#include "common/lens/lens_difference.h"
#include "common/lens/lens_model.h"
#include "common/lens/lens_uncertainty.h"

namespace rigcal {

inline constexpr int kLeastLensViews = 6;

struct LensSolution;

struct LensOptions {
  std::optional<LensModel> model;  // none: the one that predicts views best that it has not seen
  // Of most of these views (by name, which must differ): the solve goes on from there, in a few
  // steps and without the comparison of halves, for whom cannot wait. A family of models (pinhole,
  // fisheye) that was much worse is left out. Null: from nothing.
  const LensSolution* previous = nullptr;
};

// What one model made of the views.
struct LensCandidate {
  LensModel model = LensModel::kPinhole4;
  double rms_px = 0;           // distances of corners that were used
  double held_out_rms_px = 0;  // the same of views that were not in the solve, by turns
  LensEstimate estimate;       // the poses of all views, also of those that were left out
};

struct LensViewResult {
  std::string name;
  int corners = 0;
  int left_out_corners = 0;  // of a view that was used
  double rms_px = 0;         // of its corners that were used, or of all where it was left out
  RigidTransform cam_from_board;
  double tilt_deg = 0;   // between the board's normal and the camera's axis
  std::string left_out;  // why the view was not used; empty: it was
};

struct LensSolution {
  LensModel model = LensModel::kPinhole4;
  Intrinsics intrinsics;
  // One sigma of each free value of the intrinsics, FreeIntrinsics(model) of them: of noise in the
  // corners alone.
  Eigen::VectorXd sigmas;
  // Likewise of the projection, over the image.
  LensUncertainty uncertainty;
  // Of the free intrinsics, with the poses eliminated, for the noise of these corners.
  Eigen::MatrixXd information;
  double noise_px = 0;  // of the corners in each coordinate, by the residuals
  double rms_px = 0;
  double held_out_rms_px = 0;
  int corners = 0;                           // that were used
  int views = 0;                             // likewise
  std::vector<LensCandidate> candidates;     // the simplest model first
  std::vector<LensViewResult> view_results;  // in the order of the views
  // Between the lenses of two halves of the views, each solved alone. The lens of all views has
  // about half of that. None: they could not be compared.
  std::optional<LensDifference> halves;
  double covered_share = 0;       // of the image, by corners that were used
  double blind_share = 0;         // of the image: the lens has no ray there
  std::optional<BoardBend> bend;  // of the board, where it predicts views that were held out better
  // What would make the result better, sentence by sentence; nothing: all is well.
  std::vector<std::string> advice;
};

// The lens of a camera from views of a flat board. Images of circles are moved to those of their
// centres by the lens and the poses that were solved, in two rounds. A bend of the board that is
// five times its sigma is tried, and stays where held-out errors become smaller by 2 %.
//
// Every model is solved with Cauchy's loss. Corners and views that even the best of them does not
// explain are left out for all (6 sigma; views whose median error is 5 times that of all). The rest
// is solved by least squares, once with all views and once without each fifth of them, which then
// is predicted: its boards are placed with that lens, and the errors are the model's held-out
// error. The simplest model is taken that is within 2 % of the least, and not worse view by view
// (the mean of the differences is below 2.5 times its standard error).
//
// FAILED_PRECONDITION, with what to do: fewer than 6 views; boards that are never tilted, so that
// focal length and distance cannot be told apart; no start could be found.
// INVALID_ARGUMENT: an image size of 0, or a view with fewer than 6 corners.
absl::StatusOr<LensSolution> SolveLens(const std::vector<BoardView>& views,
                                       const ImageSize& image_size_px,
                                       const LensOptions& options = {});

}  // namespace rigcal
