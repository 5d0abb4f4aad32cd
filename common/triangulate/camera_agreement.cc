// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/camera_agreement.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace rigcal {
namespace {

constexpr uint32_t kFewestCentres = 20;
constexpr double kMostLeftOut = 0.5;

}  // namespace

absl::Status CheckCamerasAgree(const CalibrationResult& calibration,
                               const Triangulation& triangulation) {
  std::vector<uint32_t> used(calibration.cameras.size());
  for (const TriangulatedPoint& point : triangulation.points) {
    for (const PixelView& view : point.views) ++used[static_cast<size_t>(view.camera)];
  }
  std::vector<std::string> odd, names;
  size_t good_count = 0;
  for (size_t c = 0; c < used.size(); ++c) {
    const std::string& name = calibration.cameras[c].camera;
    const auto found = triangulation.left_out.find(name);
    const uint32_t left_out = found == triangulation.left_out.end() ? 0 : found->second;
    const uint32_t all = left_out + used[c];
    if (left_out <= kMostLeftOut * all) {
      if (all > 0) ++good_count;
      continue;
    }
    if (all < kFewestCentres) continue;
    odd.push_back(
        absl::StrFormat("%s (%.0f %% of its %d centres)", name, 100.0 * left_out / all, all));
    names.push_back(name);
  }
  if (odd.empty()) return absl::OkStatus();
  const bool one = odd.size() == 1;
  const std::string missed =
      absl::StrCat("the rays of ", absl::StrJoin(odd, ", "), " miss those of the other cameras");
  // Which cameras moved can only be told by some that did not.
  if (good_count < 2) {
    return absl::FailedPreconditionError(
        absl::StrCat(missed,
                     ": were some moved or exchanged, or are the rows of another rig? "
                     "Calibrate anew"));
  }
  return absl::FailedPreconditionError(absl::StrCat(
      missed, ": ",
      one ? "was it moved or exchanged, or its clock"
          : "were they moved or exchanged, or their clocks",
      " set anew? Repair first (rigcal calibrate SESSION --only ", absl::StrJoin(names, ","),
      "), or leave the rows of ", one ? "this camera" : "these cameras", " out"));
}

}  // namespace rigcal
