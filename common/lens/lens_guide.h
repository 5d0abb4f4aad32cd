// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_model.h"
#include "common/lens/lens_solver.h"
#include "common/lens/next_view.h"

namespace rigcal {

struct LensGuideOptions {
  std::optional<LensModel> model;  // none: as SolveLens
  // Views are enough where 95 % of the image are less uncertain; 0: never.
  double until_px = 0;
  bool is_whole = true;  // as of AdviseNextView
};

// Goes along while somebody takes views of a board: what is known of the lens so far, and where to
// hold the board next. The lens is solved from nothing once, with 6 views; then each solve goes on
// from the last one, so that nobody waits.
class LensGuide {
 public:
  // Of fewer views a noise is not known well enough, and the model is a guess.
  static constexpr int kLeastViews = 10;

  // `points_m`: of the board, in its frame.
  LensGuide(std::vector<Eigen::Vector3d> points_m, const ImageSize& image_size_px,
            const LensGuideOptions& options);

  // `views`: all so far.
  void Follow(const std::vector<BoardView>& views);

  // Of the views so far, or of some of them where these make none. None: there is no lens yet.
  const std::optional<LensSolution>& solution() const { return solution_; }
  const NextView& next() const { return next_; }
  // The solution is as good as asked for, and complete: it is SolveLens' of all views.
  bool is_enough() const { return is_enough_; }

 private:
  bool IsGood(const LensSolution& solution) const;

  std::vector<Eigen::Vector3d> points_m_;
  ImageSize image_size_px_;
  LensGuideOptions options_;
  std::optional<LensSolution> solution_;
  NextView next_;
  bool is_enough_ = false;
};

}  // namespace rigcal
