// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/camera_agreement.h"

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/triangulate/point_fit.h"

namespace rigcal {
namespace {

constexpr uint32_t kFewestCentres = 20;
constexpr double kMostLeftOut = 0.5;
// Of views that did not agree, how many must once two cameras are exchanged, beside those with
// centres that are bad by themselves, and how many times as many as with any other two. Clocks that
// are exchanged, too, cost some sigmas.
constexpr size_t kFewestOdd = 6;
constexpr double kExplained = 0.5, kThanOthers = 2, kMeetSigmas = 15;

// Share of the odd views that agree with the centres of two cameras exchanged, of those that have
// one of them; and their number.
struct ExchangeTrial {
  double share = 0;
  size_t count = 0;
};

ExchangeTrial TryExchange(const CalibrationResult& calibration, const Triangulation& triangulation,
                          int a, int b) {
  ExchangeTrial trial;
  size_t agreeing = 0;
  for (std::vector<PixelView> views : triangulation.odd_views) {
    bool any = false;
    for (PixelView& view : views) {
      any |= view.camera == a || view.camera == b;
      view.camera = view.camera == a ? b : view.camera == b ? a : view.camera;
    }
    trial.count += any ? 1 : 0;
    const auto point = FitPoint(calibration.cameras, views);
    agreeing += any && point && point->WorstSigmas() < kMeetSigmas ? 1 : 0;
  }
  if (trial.count > 0) {
    trial.share = static_cast<double>(agreeing) / static_cast<double>(trial.count);
  }
  return trial;
}

uint32_t LeftOutRows(const Triangulation& triangulation, const std::string& camera) {
  const auto found = triangulation.left_out_rows.find(camera);
  return found == triangulation.left_out_rows.end() ? 0 : found->second;
}

// Two cameras whose rows are each other's; empty: none.
std::vector<std::string> FindExchanged(const CalibrationResult& calibration,
                                       const Triangulation& triangulation) {
  std::vector<std::string> exchanged;
  double best = 0, second = 0;
  const auto count = static_cast<int>(calibration.cameras.size());
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      const ExchangeTrial trial = TryExchange(calibration, triangulation, a, b);
      if (trial.count < kFewestOdd) continue;
      if (trial.share > best) {
        second = best;
        best = trial.share;
        exchanged = {calibration.cameras[static_cast<size_t>(a)].camera,
                     calibration.cameras[static_cast<size_t>(b)].camera};
      } else {
        second = std::max(second, trial.share);
      }
    }
  }
  if (best < kExplained || best < kThanOthers * second) exchanged.clear();
  return exchanged;
}

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
  const std::vector<std::string> exchanged = FindExchanged(calibration, triangulation);
  if (!exchanged.empty()) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "the rays of %s and %s miss those of the other cameras, and meet them when the rows of the "
        "two are taken for each other's (%d and %d rows): are the files of %s and %s exchanged, or "
        "the cameras' names?",
        exchanged[0], exchanged[1], LeftOutRows(triangulation, exchanged[0]),
        LeftOutRows(triangulation, exchanged[1]), exchanged[0], exchanged[1]));
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

std::string DescribeLeftOut(const std::vector<CameraRows>& rows,
                            const std::map<std::string, uint32_t>& left_out_rows) {
  std::vector<std::string> cameras;
  for (const CameraRows& camera : rows) {
    const auto found = left_out_rows.find(camera.camera);
    if (found == left_out_rows.end()) continue;
    cameras.push_back(
        absl::StrFormat("%d of %d rows of %s", found->second, camera.rows.size(), camera.camera));
  }
  return absl::StrJoin(cameras, ", ");
}

}  // namespace rigcal
